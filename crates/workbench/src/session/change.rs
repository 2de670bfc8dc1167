//! Manual changes of the state: `:flip`, `:set`, `:draw`.

use super::look::{ROWS, addressed, more};
use super::reply::Reply;
use super::shown::{self, short};
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, Draws, Given, Trace};
use pcadlang_inference::{StepContext, accepts};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::number;

/// The log joint density and its parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Their sum.
    pub joint: f64,
    /// That of the choices.
    pub prior: f64,
    /// That of observations and factors.
    pub likelihood: f64,
}

impl Scores {
    /// Those of a state.
    pub fn of(t: &Trace) -> Scores {
        Scores { joint: t.log_joint(), prior: t.log_prior(), likelihood: t.log_likelihood() }
    }

    /// Formats the change to another state in one line.
    fn to(self, other: Scores) -> String {
        let by = |a: f64, b: f64| if a == b { "+0".into() } else { signed(b - a) };
        format!(
            "log joint {} -> {} ({}: choices {}, observed {})\n",
            number(self.joint),
            number(other.joint),
            by(self.joint, other.joint),
            by(self.prior, other.prior),
            by(self.likelihood, other.likelihood)
        )
    }
}

/// Formats a number with its sign.
fn signed(x: f64) -> String {
    if x < 0.0 || x.is_nan() { number(x) } else { format!("+{}", number(x)) }
}

impl Session {
    /// `:flip sel`: a Metropolis-Hastings step with proposals from the prior, like that
    /// of the kernel `block`.
    pub(super) fn flip(&mut self, text: &str) -> Result<Reply, Failure> {
        let found = self.select(text)?;
        let targets: Vec<_> = found.iter().map(|(_, t)| *t).collect();
        let old: Vec<_> = targets.iter().map(|t| self.trace.value(*t)).collect();
        let before = Scores::of(&self.trace);
        let past = self.remember(&format!(":flip {text}"));
        let at = StepContext::new(self.seed, 0, self.clock);
        let weight = match self.trace.regenerate(&targets, self.values()) {
            Ok(weight) => weight,
            Err(e) if e.is_recoverable() => {
                return Ok(Reply::text(format!(
                    "rejected: the log density is undefined there: {}\n",
                    e.message
                )));
            }
            Err(e) => return Err(Failure::run(&self.model, *e)),
        };
        let mut s = String::new();
        for ((address, t), old) in found.iter().zip(&old).take(ROWS) {
            let new = match self.trace.was_removed(*t) || !self.trace.is_active(*t) {
                true => "gone".to_owned(),
                false => shown::short(&self.trace.value(*t)),
            };
            s += &format!("{address}: {} -> {new}\n", shown::short(old));
        }
        s += &more(found.len(), "choices");
        if weight.appeared + weight.vanished > 0 {
            s += &format!("{} choices appear, {} vanish\n", weight.appeared, weight.vanished);
        }
        s += &before.to(Scores::of(&self.trace));
        let mut rng = at.stream();
        if accepts(weight.log_weight, &mut rng) {
            self.trace.commit();
            self.keep(past);
            s += &format!("accepted (log ratio {})\n", signed(weight.log_weight));
        } else {
            self.trace.rollback();
            s += &format!(
                "rejected (log ratio {}): the state is unchanged\n",
                signed(weight.log_weight)
            );
        }
        Ok(Reply::text(s))
    }

    /// `:set @a value`, `:set param value`.
    pub(super) fn set(&mut self, text: &str) -> Result<Reply, Failure> {
        let (name, value) = split_address(text);
        if value.is_empty() {
            return Err(plain("`:set` needs an address and a value").hint(":set @x 1.5"));
        }
        if self.is_param(name) {
            return self.set_param(name, value);
        }
        let value = self.value_of(value)?;
        let address = addressed(name).parse().map_err(|e| plain(format!("{e}")))?;
        let past = self.remember(&format!(":set {text}"));
        let (before, after) = self.give(address, value)?;
        self.keep(past);
        Ok(Reply::text(before.to(after)))
    }

    /// Gives a value to a choice or an observation, as `:set` does. With `joins`, the
    /// change joins the one before it for `:undo`, if that was such a change of the same
    /// address: those of one drag, which begins without `joins`, are undone together.
    ///
    /// # Errors
    /// If there is no such address, the value does not fit it, or the state would have
    /// probability zero; nothing has changed then.
    pub fn assign(&mut self, address: &str, value: Value, joins: bool) -> Result<Scores, Failure> {
        let at: Address = addressed(address).parse().map_err(|e| plain(format!("{e}")))?;
        let is_same = joins && self.dragged.as_ref() == Some(&at);
        let past = (!is_same).then(|| self.remember(&format!(":set {address} {}", short(&value))));
        self.clock += 1;
        let (_, after) = self.give(at.clone(), value)?;
        if let Some(past) = past {
            self.keep(past);
        }
        self.dragged = Some(at);
        Ok(after)
    }

    /// Gives a value to a choice or an observation. Returns the log densities before and
    /// after.
    fn give(&mut self, address: Address, value: Value) -> Result<(Scores, Scores), Failure> {
        let before = Scores::of(&self.trace);
        let given = [(address, Given::Value(value))];
        self.trace.update(&given, self.values()).map_err(|e| Failure::run(&self.model, *e))?;
        let after = Scores::of(&self.trace);
        if after.joint == f64::NEG_INFINITY && before.joint > f64::NEG_INFINITY {
            let by: Vec<String> =
                self.trace.impossible().iter().take(3).map(|(a, _)| a.to_string()).collect();
            self.trace.rollback();
            return Err(plain(format!("that state has probability zero, by {}", by.join(", "))));
        }
        self.trace.commit();
        Ok((before, after))
    }

    /// `:draw`.
    pub(super) fn draw(&mut self) -> Result<Reply, Failure> {
        let past = self.remember(":draw");
        let (mut trace, said) = self.restart(&self.model, &[], self.trace.replacements())?;
        self.force(&self.model, &mut trace, 0)?;
        self.trace = trace;
        self.keep(past);
        Ok(Reply::text(said + &self.summary()))
    }

    /// Returns the random stream for proposed values.
    fn values(&self) -> Draws {
        Draws { key: StreamKey::new(self.seed, 0, Purpose::VALUES), step: self.clock, substream: 0 }
    }
}

/// Splits a text after its address; keys of addresses may contain spaces.
fn split_address(text: &str) -> (&str, &str) {
    let mut depth = 0_i64;
    let end = text.char_indices().find(|(_, c)| {
        match c {
            '[' | '{' => depth += 1,
            ']' | '}' => depth -= 1,
            _ => {}
        }
        depth <= 0 && (c.is_whitespace() || *c == '=')
    });
    let (name, rest) = text.split_at(end.map_or(text.len(), |(i, _)| i));
    (name, rest.trim_start().trim_start_matches('=').trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_end_at_a_space_outside_of_keys() {
        assert_eq!(split_address("@a 1 + 2"), ("@a", "1 + 2"));
        assert_eq!(split_address("@t[\"a b\"]/x = [1, 2]"), ("@t[\"a b\"]/x", "[1, 2]"));
        assert_eq!(split_address("n=3"), ("n", "3"));
        assert_eq!(split_address("@a"), ("@a", ""));
    }
}
