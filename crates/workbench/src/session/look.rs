//! `:trace`: the choices of the state; `:why`: the dependencies of one.

use super::choices::{addressed, short};
use super::reply::Reply;
use super::state::{INPUT, Session};
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::plan::{Formula, Selection};
use pcadlang_engine::trace::{Address, Effect, Selector, Target, Term};
use pcadlang_inference::{not_a_selection, selected};
use pcadlang_library::model::Error;
use pcadlang_report::number;
use pcadlang_report::table::aligned;
use pcadlang_syntax::diag::{SourceMap, nearest};
use pcadlang_syntax::{parse_expr, print_expr};

/// The maximum number of rows of a table.
pub(super) const ROWS: usize = 40;

impl Session {
    /// `:trace [sel]`.
    pub(super) fn show_trace(&mut self, selection: &str) -> Result<Reply, Failure> {
        let all = selection.is_empty();
        let targets = if all { self.by_address(&Selector::All) } else { self.select(selection)? };
        let t = &self.trace;
        let mut rows =
            vec![["choice", "value", "drawn from", "log density"].map(str::to_owned).to_vec()];
        for (address, target) in targets.iter().take(ROWS) {
            let dist = t.dist(*target).map_or_else(String::new, |d| d.name().to_owned());
            let score = number(t.score_of(*target));
            rows.push(vec![address.to_string(), short(&t.value(*target)), dist, score]);
        }
        let mut text = if targets.is_empty() { "no choices\n".to_owned() } else { aligned(&rows) };
        text += &more(targets.len(), "choices");
        if all {
            let observed = t.observations();
            if !observed.is_empty() {
                let mut rows = vec![["observed", "log density"].map(str::to_owned).to_vec()];
                rows.extend(
                    observed.iter().take(ROWS).map(|(a, s)| vec![a.to_string(), number(*s)]),
                );
                text += &format!("\n{}{}", aligned(&rows), more(observed.len(), "observations"));
            }
            let parts = [t.log_joint(), t.log_prior(), t.log_likelihood()].map(number);
            text += &format!(
                "\nlog joint {} = {} (choices) + {} (observed)\n",
                parts[0], parts[1], parts[2]
            );
        }
        Ok(Reply::text(text))
    }

    /// Returns the choices of a typed selection, in order of address. An empty selection
    /// is an error.
    pub(super) fn select(&mut self, text: &str) -> Result<Vec<(Address, Target)>, Failure> {
        let text = &addressed(text);
        let mut sources = SourceMap::new();
        let file = sources.add(INPUT, text);
        let wrong = |diagnostics, sources| Failure::from(Error { diagnostics, sources });
        let expr = match parse_expr(text, file) {
            Ok(e) => e,
            Err(errors) => {
                let all = errors
                    .into_iter()
                    .map(pcadlang_syntax::diag::IntoDiagnostic::into_diagnostic)
                    .collect();
                return Err(wrong(all, sources));
            }
        };
        let mut failed = None;
        let selection = Selection::read(&expr, &mut |key| {
            let value = self.value_of(&print_expr(key)).map_err(|e| failed = Some(e));
            Formula::constant(value.unwrap_or_default(), key.span)
        });
        if let Some(failure) = failed {
            return Err(failure);
        }
        let selector = selection
            .map_err(not_a_selection)
            .and_then(|s| selected(&s, &mut self.trace))
            .map_err(|e| {
                wrong(vec![pcadlang_syntax::diag::IntoDiagnostic::into_diagnostic(*e)], sources)
            })?;
        let found = self.by_address(&selector);
        if !found.is_empty() {
            return Ok(found);
        }
        let known: Vec<String> =
            self.trace.all_targets().iter().map(|t| self.trace.address(*t).to_string()).collect();
        let failure = plain(format!("`{text}` selects no choice in the trace"));
        Err(match nearest(text, known.iter().map(String::as_str)) {
            Some(n) => failure.hint(format!("did you mean `{n}`?")),
            None if known.is_empty() => {
                failure.hint("the trace has no choices yet: assume x ~ normal(0, 1)")
            }
            None => failure.hint("`:trace` shows all of them"),
        })
    }

    /// Returns the choices of a selection, in order of address.
    fn by_address(&mut self, selector: &Selector) -> Vec<(Address, Target)> {
        let selection = self.trace.select(selector);
        let t = &self.trace;
        let mut all: Vec<(Address, Target)> =
            t.targets(selection).iter().map(|x| (t.address(*x), *x)).collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    }
}

/// Counts the rows that are left out of a table.
pub(super) fn more(rows: usize, what: &str) -> String {
    if rows > ROWS { format!("… and {} more {what}\n", rows - ROWS) } else { String::new() }
}

impl Session {
    /// `:why @a`.
    pub(super) fn why(&mut self, text: &str) -> Result<Reply, Failure> {
        let found = self.select(text)?;
        let [(address, target)] = &found[..] else {
            let first: Vec<String> = found.iter().take(3).map(|(a, _)| a.to_string()).collect();
            let failure = plain(format!("`{text}` selects {} choices", found.len()));
            return Err(failure.hint(format!("ask for one of them: {}, …", first.join(", "))));
        };
        let (value, score) =
            (short(&self.trace.value(*target)), number(self.trace.score_of(*target)));
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
