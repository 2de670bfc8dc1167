//! `:why @a`: what a choice depends on, and what depends on it.

use super::look::{ROWS, more};
use super::reply::Reply;
use super::shown;
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_engine::trace::{Effect, Term};
use pcadlang_report::number;
use pcadlang_report::table::aligned;

impl Session {
    /// `:why @a`.
    pub(super) fn why(&mut self, text: &str) -> Result<Reply, Failure> {
        let found = self.select(text)?;
        let [(address, target)] = &found[..] else {
            let first: Vec<String> = found.iter().take(3).map(|(a, _)| a.to_string()).collect();
            let trouble = plain(format!("`{text}` selects {} choices", found.len()));
            return Err(trouble.hint(format!("ask for one of them: {}, …", first.join(", "))));
        };
        let (value, score) =
            (shown::short(&self.trace.value(*target)), number(self.trace.score_of(*target)));
        let dist = self.trace.dist(*target).map_or_else(String::new, |d| d.name().to_owned());
        let mut s = format!("{address} = {value}, drawn from {dist}, log density {score}\n");
        let origins = self.trace.origins(*target);
        if !origins.is_empty() {
            let names: Vec<String> = origins.iter().take(ROWS).map(ToString::to_string).collect();
            s += &format!("depends on {}\n{}", names.join(", "), more(origins.len(), "choices"));
        }
        let reach = self.trace.dependents(*target);
        if !reach.names.is_empty() {
            let names: Vec<&str> = reach.names.iter().map(|n| &**n).collect();
            s += &format!("used by {}\n", names.join(", "));
        }
        if reach.terms.is_empty() {
            s += "no observation or factor depends on it in this state\n";
            return Ok(Reply::text(s));
        }
        let mut rows = vec![["depends on it", "", "log density", ""].map(str::to_owned).to_vec()];
        for r in reach.terms.iter().take(ROWS) {
            let what = match r.term {
                Term::Choice => "choice",
                Term::Observation => "observation",
                Term::Factor => "factor",
            };
            let effect = match r.effect {
                Effect::Scored => "",
                Effect::Moved => "may move with it",
                Effect::Structural => "may appear or vanish",
            };
            rows.push(vec![
                r.address.to_string(),
                what.into(),
                number(r.log_density),
                effect.into(),
            ]);
        }
        s += &aligned(&rows);
        s += &more(reach.terms.len(), "terms");
        Ok(Reply::text(s))
    }
}
