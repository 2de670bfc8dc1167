//! The choices of a state as data, for front ends that show them in their own way; their values
//! as JSON and as text of bounded length; `:set`, `:flip` and `:draw`, which change them.

use super::look::{ROWS, more};
use super::reply::Reply;
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, Draws, Given, Target, Trace};
use pcadlang_inference::{StepContext, accepts};
use pcadlang_numerics::dist::Support;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::number;
use pcadlang_syntax::ast::{ItemKind, StmtKind};
use pcadlang_syntax::diag::SourceMap;
use pcadlang_syntax::{parse, print_expr, record_key};
use serde_json::{Number, json};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write};
use std::sync::Arc;

/// Maximum elements of an array that are written out.
const ELEMENTS_AS_JSON: usize = 1000;

/// A choice.
#[derive(Clone, Debug)]
pub struct ChoiceRow {
    /// Its address, such as `@body/knee`.
    pub address: String,
    /// Its value.
    pub value: Value,
    /// The name of the distribution it is drawn from.
    pub family: String,
    /// Its log density.
    pub log_density: f64,
    /// The values it can have, in words.
    pub support: String,
    /// The least and the greatest number it can be, if there are any.
    pub bounds: [Option<f64>; 2],
    /// The standard deviation of its distribution, if it is a finite number.
    pub scale: Option<f64>,
}

impl ChoiceRow {
    /// Describes a choice of a trace.
    pub fn of(trace: &Trace, target: Target) -> ChoiceRow {
        let dist = trace.dist(target);
        let support = dist.as_ref().map(|d| d.support());
        ChoiceRow {
            address: trace.address(target).to_string(),
            value: trace.value(target),
            family: dist.as_ref().map_or_else(String::new, |d| d.name().to_owned()),
            log_density: trace.score_of(target),
            support: support.as_ref().map_or_else(String::new, ToString::to_string),
            bounds: support.as_ref().map_or([None; 2], bounds),
            scale: dist.and_then(|d| d.sd()).filter(|sd| sd.is_finite() && *sd > 0.0),
        }
    }

    /// Describes all choices of a trace, in order of address.
    pub fn all(trace: &Trace) -> Vec<ChoiceRow> {
        let mut all: Vec<_> = trace.all_targets().iter().map(|t| (trace.address(*t), *t)).collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all.into_iter().map(|(_, t)| ChoiceRow::of(trace, t)).collect()
    }

    /// Formats the value briefly.
    pub fn text(&self) -> String {
        short(&self.value)
    }
}

/// The marks that a program gives its choices, apart from their distributions.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    /// The choices that `force` statements set.
    pub forced: BTreeSet<String>,
    /// The choices that `freeze` statements take out of every proposal.
    pub frozen: BTreeSet<String>,
    /// The choices of each tag.
    pub tags: BTreeMap<String, BTreeSet<String>>,
}

impl Session {
    /// Returns what the program says of the choices of the present state.
    pub fn marks(&mut self) -> Marks {
        let (program, _) = parse(self.text(), SourceMap::new().add("", self.text()));
        let mut marks = Marks::default();
        for item in &program.items {
            let ItemKind::Stmt(statement) = &item.kind else { continue };
            match &statement.kind {
                StmtKind::Force { target, .. } => {
                    marks.forced.extend(self.selected(&print_expr(target)));
                }
                StmtKind::Freeze(selection) => {
                    marks.frozen.extend(self.selected(&print_expr(selection)));
                }
                _ => {}
            }
        }
        let tags: Vec<Arc<str>> = self.model().code().tags.clone();
        for tag in tags {
            let of = self.selected(&format!("${tag}")).collect();
            marks.tags.insert(tag.to_string(), of);
        }
        marks
    }

    /// Returns the addresses of a selection; none if it selects nothing.
    fn selected(&mut self, selection: &str) -> impl Iterator<Item = String> + use<> {
        let found = self.select(selection).unwrap_or_default();
        found.into_iter().map(|(address, _)| address.to_string())
    }
}

fn bounds(support: &Support) -> [Option<f64>; 2] {
    match support {
        Support::Positive => [Some(0.0), None],
        Support::AtLeast { lo } => [Some(*lo), None],
        Support::AtMost { hi } => [None, Some(*hi)],
        Support::Interval { lo, hi } | Support::Pole { lo, hi, .. } => [Some(*lo), Some(*hi)],
        Support::Circle => [Some(-std::f64::consts::PI), Some(std::f64::consts::PI)],
        Support::Integers { lo, hi } => [Some(*lo as f64), hi.map(|hi| hi as f64)],
        Support::Simplex(_) => [Some(0.0), Some(1.0)],
        Support::Product(one, _) | Support::Ascending(one, _) => bounds(one),
        _ => [None; 2],
    }
}

/// Returns a value as JSON: numbers that are not finite as null, and what JSON has no
/// form for as text.
pub fn to_json(v: &Value) -> serde_json::Value {
    match v {
        Value::Unit => serde_json::Value::Null,
        Value::Num(x) => Number::from_f64(*x).map_or(serde_json::Value::Null, Into::into),
        Value::Bool(b) => json!(b),
        Value::Str(s) => json!(&**s),
        Value::Array(_) | Value::List(_) => {
            let most = v.len().unwrap_or(0).min(ELEMENTS_AS_JSON);
            (0..most).map(|i| to_json(&v.element(i).unwrap_or_default())).collect()
        }
        Value::Record(r) => r.iter().map(|(k, v)| (k.to_string(), to_json(v))).collect(),
        other => json!(short(other)),
    }
}

/// The maximum length of a value shown by itself, in characters.
const WHOLE: usize = 2000;
/// The maximum length of a value in a table, in characters.
const CELL: usize = 48;

/// A text of bounded length.
struct Bounded {
    text: String,
    left: usize,
}

impl Write for Bounded {
    fn write_str(&mut self, s: &str) -> fmt::Result {
        for c in s.chars() {
            if self.left == 0 {
                self.text.push('…');
                return Err(fmt::Error);
            }
            self.left -= 1;
            self.text.push(c);
        }
        Ok(())
    }
}

/// Formats a value by itself, with numbers in full precision.
pub(super) fn whole(v: &Value) -> String {
    bounded(WHOLE, |out| write(out, v, &exact))
}

/// Formats a value briefly, with numbers to four digits.
pub fn short(v: &Value) -> String {
    bounded(CELL, |out| write(out, v, &number))
}

fn bounded(most: usize, f: impl FnOnce(&mut Bounded) -> fmt::Result) -> String {
    let mut out = Bounded { text: String::new(), left: most };
    // An error means that the text was cut off.
    let _ = f(&mut out);
    out.text
}

/// Formats all digits of a number, in scientific notation if it is very large or small.
fn exact(x: f64) -> String {
    let plain = x == 0.0 || !x.is_finite() || (1e-5..1e15).contains(&x.abs());
    if plain { format!("{x}") } else { format!("{x:e}") }
}

/// The maximum number of elements shown.
const ELEMENTS_AS_TEXT: usize = 8;

fn write(out: &mut Bounded, v: &Value, number: &dyn Fn(f64) -> String) -> fmt::Result {
    match v {
        Value::Num(x) => out.write_str(&number(*x)),
        Value::Array(_) | Value::List(_) => {
            let n = v.len().unwrap_or(0);
            out.write_char('[')?;
            for i in 0..n.min(ELEMENTS_AS_TEXT) {
                out.write_str(if i > 0 { ", " } else { "" })?;
                write(out, &v.element(i).unwrap_or_default(), number)?;
            }
            if n > ELEMENTS_AS_TEXT {
                write!(out, ", … {n} in all")?;
            }
            out.write_char(']')
        }
        Value::Record(r) if !r.is_empty() => {
            out.write_str("{ ")?;
            for (i, (k, v)) in r.iter().enumerate() {
                write!(out, "{}{}: ", if i > 0 { ", " } else { "" }, record_key(k))?;
                write(out, v, number)?;
            }
            out.write_str(" }")
        }
        v => write!(out, "{v}"),
    }
}

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
                false => short(&self.trace.value(*t)),
            };
            s += &format!("{address}: {} -> {new}\n", short(old));
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
        let (before, after) = self.give(&[(address, Given::Value(value))])?;
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
        let (_, after) = self.give(&[(at.clone(), Given::Value(value))])?;
        if let Some(past) = past {
            self.keep(past);
        }
        self.dragged = Some(at);
        Ok(after)
    }

    /// Gives values to choices or observations. Returns the log densities before and after.
    pub(super) fn give(&mut self, given: &[(Address, Given)]) -> Result<(Scores, Scores), Failure> {
        let before = Scores::of(&self.trace);
        self.trace.update(given, self.values()).map_err(|e| Failure::run(&self.model, *e))?;
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

/// Turns a plain name or path, such as `x` or `t["x"]`, into an address, `@x`; other
/// selections are unchanged.
pub(super) fn addressed(text: &str) -> Cow<'_, str> {
    let begins = text.starts_with(|c: char| c.is_alphabetic() || c == '_');
    let name = text.split(['[', '/']).next().unwrap_or(text);
    let is_name = name.chars().all(|c| c.is_alphanumeric() || c == '_');
    if begins && is_name { Cow::Owned(format!("@{text}")) } else { Cow::Borrowed(text) }
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
    use pcadlang_engine::lang::builtins::data::Json;

    #[test]
    fn choices_are_described() {
        let mut session = Session::new(1, pcadlang_engine::trace::Stop::default()).unwrap();
        session
            .enter(
                "assume x ~ normal(0, 2); assume n ~ poisson(3); assume up ~ flip(0.5);
                 assume w ~ uniform(-1, 4); assume p ~ dirichlet([1, 1, 1]);",
            )
            .unwrap();
        let trace = session.trace();
        let all = ChoiceRow::all(trace);
        let of = |name: &str| all.iter().find(|c| c.address == name).unwrap();
        assert_eq!((of("@x").scale, of("@x").bounds), (Some(2.0), [None, None]));
        assert_eq!((of("@n").bounds, &*of("@n").family), ([Some(0.0), None], "poisson"));
        assert_eq!(of("@w").bounds, [Some(-1.0), Some(4.0)]);
        assert_eq!(of("@w").support, "numbers from -1 to 4");
        assert_eq!(of("@p").bounds, [Some(0.0), Some(1.0)]);
        assert!(matches!(of("@up").value, Value::Bool(_)));
        assert_eq!(of("@x").log_density, trace.choices()[4].2);
    }

    #[test]
    fn forced_frozen_and_tagged_choices_are_known() {
        let mut session = Session::new(1, pcadlang_engine::trace::Stop::default()).unwrap();
        for text in [
            "assume x ~ normal(0, 1) #place;",
            "assume y ~ normal(0, 1) #place;",
            "assume z ~ normal(0, 1);",
            "force @z = 2;",
            "freeze $place - @x;",
        ] {
            session.enter(text).unwrap();
        }
        let marks = session.marks();
        let all = |s: &BTreeSet<String>| s.iter().cloned().collect::<Vec<_>>().join(" ");
        assert_eq!((&*all(&marks.forced), &*all(&marks.frozen)), ("@z", "@y"));
        assert_eq!(all(&marks.tags["place"]), "@x @y");
    }

    #[test]
    fn values_go_to_json_and_back() {
        for text in ["1.5", "true", "\"a\"", "[1.0,2.0]", "[true,[1.0]]", "{\"a\":1.0,\"b\":[]}"] {
            let json: serde_json::Value = serde_json::from_str(text).unwrap();
            let Json(value) = serde_json::from_str(text).unwrap();
            assert_eq!(to_json(&value), json, "{text}");
        }
        assert_eq!(to_json(&Value::Num(f64::INFINITY)), serde_json::Value::Null);
        assert_eq!(
            to_json(&Value::array(vec![0.0; 5000])).as_array().map(Vec::len),
            Some(ELEMENTS_AS_JSON)
        );
    }

    #[test]
    fn addresses_end_at_a_space_outside_of_keys() {
        assert_eq!(split_address("@a 1 + 2"), ("@a", "1 + 2"));
        assert_eq!(split_address("@t[\"a b\"]/x = [1, 2]"), ("@t[\"a b\"]/x", "[1, 2]"));
        assert_eq!(split_address("n=3"), ("n", "3"));
        assert_eq!(split_address("@a"), ("@a", ""));
    }

    #[test]
    fn the_largest_values_are_a_few_letters() {
        assert_eq!(whole(&Value::Num(1.0 / 3.0)), "0.3333333333333333");
        assert_eq!(
            (whole(&Value::Num(1e300)), whole(&Value::Num(-1e-300))),
            ("1e300".into(), "-1e-300".into())
        );
        assert_eq!(short(&Value::array(vec![1.0 / 3.0; 3])), "[0.3333, 0.3333, 0.3333]");
        // A list of itself, nested thirty deep: a billion characters if written out.
        let mut v = Value::Str("x".into());
        for _ in 0..30 {
            v = Value::List(vec![v.clone(), v].into());
        }
        let text = whole(&v);
        assert!(text.chars().count() == WHOLE + 1 && text.ends_with('…'));
        assert!(short(&v).chars().count() <= CELL + 1);
    }
}
