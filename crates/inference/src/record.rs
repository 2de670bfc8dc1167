//! Records draws: determines the columns, and flattens values into them.

use super::draws::{Column, MOST_POINTS, POINTWISE, Shape, merged};
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};

/// The columns recorded with every draw.
#[derive(Debug)]
pub(crate) struct Recorder {
    collects: bool,
    columns: Vec<Column>,
    /// The observations of the first draw: the hash of each one's address, and its number
    /// of values.
    observed: Option<Vec<(u64, usize)>>,
}

impl Recorder {
    /// A recorder for a plan.
    pub fn new(plan: &Plan) -> Self {
        Recorder { collects: plan.collected().is_some(), columns: Vec::new(), observed: None }
    }

    /// True if the plan says what to collect.
    pub fn collects(&self) -> bool {
        self.collects
    }

    /// The columns of all draws so far.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Restores the columns of a checkpoint.
    pub fn set_columns(&mut self, columns: Vec<Column>) {
        self.columns = columns;
    }

    /// The values to record: those collected (or else everything assumed), and the
    /// predictions.
    pub fn values(
        &self,
        code: &Code,
        trace: &mut Trace,
        collected: Option<&[(String, Operand)]>,
        draws: Draws,
    ) -> Result<Vec<(String, Value)>, Box<RunError>> {
        let mut names = Vec::new();
        let mut operands = Vec::new();
        match collected {
            Some(collected) => {
                names.extend(collected.iter().map(|(name, _)| name.clone()));
                operands.extend(collected.iter().map(|(_, operand)| *operand));
            }
            None => {
                names.extend(code.assumed.iter().map(|(n, _)| n.to_string()));
                operands.extend(code.assumed.iter().map(|(_, o)| *o));
            }
        }
        for (n, o) in &code.predictions {
            if !names.iter().any(|m| **m == **n) {
                names.push(n.to_string());
                operands.push(*o);
            }
        }
        Ok(names.into_iter().zip(trace.query(&operands, draws)?).collect())
    }

    /// The observations whose log densities are recorded.
    pub fn observed(&self) -> &Option<Vec<(u64, usize)>> {
        &self.observed
    }

    /// Restores the observations of a checkpoint.
    pub fn set_observed(&mut self, observed: Option<Vec<(u64, usize)>>) {
        self.observed = observed;
    }

    /// Adds the log density of each observed value, unless there are too many of them;
    /// NaN if other values are observed than in the first draw.
    pub fn add_pointwise(&mut self, trace: &Trace, values: &mut Vec<(String, Value)>) {
        let is_first = self.columns.is_empty();
        if values.iter().any(|(name, _)| name == POINTWISE) || !is_first && self.observed.is_none()
        {
            return;
        }
        let all = trace.pointwise(MOST_POINTS).unwrap_or_default();
        let here = || all.iter().map(|(hash, scores)| (*hash, scores.len()));
        if is_first && !all.is_empty() {
            self.observed = Some(here().collect());
        }
        let Some(known) = &self.observed else { return };
        let scores: Vec<f64> = match here().eq(known.iter().copied()) {
            true => all.into_iter().flat_map(|(_, scores)| scores).collect(),
            false => vec![f64::NAN; known.iter().map(|(_, n)| n).sum()],
        };
        values.push((POINTWISE.into(), Value::array(scores)));
    }

    /// Returns the row of a draw, with NaN for columns that it lacks, and whether columns
    /// were added or extended for it. Numbers, bools, and arrays and records of them are
    /// recorded; other values are left out.
    pub fn row(&mut self, values: &[(String, Value)]) -> (Vec<f64>, bool) {
        let (row, fits) = self.flatten(values);
        if fits {
            return (row, false);
        }
        let mut here = Vec::new();
        values.iter().for_each(|(name, v)| add_columns(name, v, &mut here));
        let before = self.columns.clone();
        self.columns = if before.is_empty() { here } else { merged(&before, &here) };
        (self.flatten(values).0, self.columns != before)
    }

    /// The row, and whether it holds all of the values.
    fn flatten(&self, values: &[(String, Value)]) -> (Vec<f64>, bool) {
        let mut row = Vec::new();
        let (mut found, mut fits) = (0, true);
        for c in &self.columns {
            let mut flat = Vec::new();
            if let Some(v) = find(values, &c.name) {
                flatten(v, &mut flat);
                found += 1;
            }
            fits &= flat.len() <= c.shape.len();
            flat.resize(c.shape.len(), f64::NAN);
            row.extend(flat);
        }
        let asked: usize = values.iter().map(|(_, v)| leaves(v)).sum();
        (row, fits && found >= asked)
    }
}

fn add_columns(name: &str, v: &Value, columns: &mut Vec<Column>) {
    match v {
        Value::Num(_) | Value::Bool(_) => {
            columns.push(Column { name: name.into(), shape: Shape::Scalar })
        }
        Value::Array(_) | Value::List(_) => {
            let mut flat = Vec::new();
            flatten(v, &mut flat);
            columns.push(Column { name: name.into(), shape: Shape::Vector(flat.len()) });
        }
        Value::Record(r) => {
            r.iter().for_each(|(k, v)| add_columns(&format!("{name}/{k}"), v, columns))
        }
        _ => {}
    }
}

/// The number of columns of a value.
fn leaves(v: &Value) -> usize {
    match v {
        Value::Num(_) | Value::Bool(_) | Value::Array(_) | Value::List(_) => 1,
        Value::Record(r) => r.values().map(leaves).sum(),
        _ => 0,
    }
}

/// The value of a column: parts of its name between slashes are fields of records.
fn find<'a>(values: &'a [(String, Value)], column: &str) -> Option<&'a Value> {
    values.iter().find_map(|(name, v)| {
        let rest = column.strip_prefix(name.as_str())?;
        if rest.is_empty() { Some(v) } else { within(v, rest.strip_prefix('/')?) }
    })
}

/// Finds what is at a path of fields. A name in quotes may have a `/` in it.
fn within<'a>(v: &'a Value, path: &str) -> Option<&'a Value> {
    let Value::Record(r) = v else { return None };
    let below = |v: &'a Value, rest: &str| match rest {
        "" => Some(v),
        rest => within(v, rest.strip_prefix('/')?),
    };
    let first = path.split('/').next().unwrap_or_default();
    let plain = r.get(first).and_then(|v| below(v, &path[first.len()..]));
    let mut slashed = r.iter().filter(|(k, _)| k.contains('/'));
    plain.or_else(|| slashed.find_map(|(k, v)| below(v, path.strip_prefix(&**k)?)))
}

fn flatten(v: &Value, out: &mut Vec<f64>) {
    match v {
        Value::Num(x) => out.push(*x),
        Value::Bool(b) => out.push(f64::from(u8::from(*b))),
        Value::Array(xs) => out.extend(xs.iter()),
        Value::List(xs) => xs.iter().for_each(|x| flatten(x, out)),
        Value::Record(r) => r.values().for_each(|x| flatten(x, out)),
        _ => out.push(f64::NAN),
    }
}
