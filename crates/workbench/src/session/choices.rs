//! The choices of a state as data, for front ends that show them in their own way.

use super::shown;
use super::state::Session;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Target, Trace};
use pcadlang_numerics::dist::Support;
use pcadlang_syntax::ast::{ItemKind, StmtKind};
use pcadlang_syntax::diag::SourceMap;
use pcadlang_syntax::{parse, print_expr};
use serde_json::{Number, json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Maximum elements of an array that are written out.
const ELEMENTS: usize = 1000;

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
        shown::short(&self.value)
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
            let most = v.len().unwrap_or(0).min(ELEMENTS);
            (0..most).map(|i| to_json(&v.element(i).unwrap_or_default())).collect()
        }
        Value::Record(r) => r.iter().map(|(k, v)| (k.to_string(), to_json(v))).collect(),
        other => json!(shown::short(other)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_engine::lang::builtins::data::from_json;

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
            assert_eq!(to_json(&from_json(json.clone())), json, "{text}");
        }
        assert_eq!(to_json(&Value::Num(f64::INFINITY)), serde_json::Value::Null);
        assert_eq!(
            to_json(&Value::array(vec![0.0; 5000])).as_array().map(Vec::len),
            Some(ELEMENTS)
        );
    }
}
