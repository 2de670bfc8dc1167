//! Records draws: determines the columns, and flattens values into them.

use super::draws::{Column, MOST_LEVELS, MOST_POINTS, POINTWISE, Shape, merged, width};
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::lang::value::{Record, Value};
use pcadlang_engine::trace::{Draws, Trace};
use std::borrow::Cow;

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
    /// were added or extended for it. Numbers, bools, texts, and arrays and records of them are
    /// recorded; other values are left out. The fields of a record are columns; those of an
    /// array of records are arrays.
    pub fn row(&mut self, values: &[(String, Value)]) -> (Vec<f64>, bool) {
        let (row, fits) = self.flatten(values);
        if fits {
            return (row, false);
        }
        let mut here = Vec::new();
        values.iter().for_each(|(name, v)| add_columns(name.clone(), v, false, &mut here));
        let before = self.columns.clone();
        self.columns = if before.is_empty() { here } else { merged(&before, &here) };
        self.columns.iter_mut().for_each(|c| c.levels.truncate(MOST_LEVELS));
        (self.flatten(values).0, self.columns != before)
    }

    /// The row, and whether it holds all of the values.
    fn flatten(&self, values: &[(String, Value)]) -> (Vec<f64>, bool) {
        let mut row = vec![f64::NAN; width(&self.columns)];
        let (mut found, mut fits, mut at) = (0, true, 0);
        for c in &self.columns {
            let own = &mut row[at..at + c.shape.len()];
            at += own.len();
            if let Some(v) = find(values, &c.name) {
                fits &= place(&v, c, c.shape.dims(), own);
                found += 1;
            }
        }
        let asked: usize = values.iter().map(|(_, v)| leaves(v)).sum();
        (row, fits && found >= asked)
    }
}

/// The first of an array of records, if all have the same fields.
fn records(v: &Value) -> Option<(&Record, &[Value])> {
    let Value::List(all) = v else { return None };
    let Value::Record(first) = all.first()? else { return None };
    let same = |v: &Value| matches!(v, Value::Record(r) if r.keys().eq(first.keys()));
    all.iter().all(same).then_some((first, all))
}

/// One field of each record of an array.
fn gathered(all: &[Value], field: &str) -> Value {
    let of = |v: &Value| match v {
        Value::Record(r) => r.get(field).cloned(),
        _ => None,
    };
    Value::from_elements(all.iter().filter_map(of).collect())
}

fn add_columns(name: String, v: &Value, is_field: bool, columns: &mut Vec<Column>) {
    if let Some((first, all)) = records(v) {
        for field in first.keys() {
            add_columns(format!("{name}/{field}"), &gathered(all, field), true, columns);
        }
        return;
    }
    match v {
        Value::Record(r) => {
            r.iter().for_each(|(k, v)| add_columns(format!("{name}/{k}"), v, true, columns))
        }
        v if leaves(v) == 1 => {
            let mut levels = Vec::new();
            add_levels(v, &mut levels);
            columns.push(Column { is_field, levels, ..Column::new(name, shape(v)) });
        }
        _ => {}
    }
}

/// The number of columns of a value.
fn leaves(v: &Value) -> usize {
    match v {
        Value::Num(_) | Value::Bool(_) | Value::Str(_) | Value::Array(_) => 1,
        Value::List(_) => records(v).map_or(1, |(_, all)| leaves(&all[0])),
        Value::Record(r) => r.values().map(leaves).sum(),
        _ => 0,
    }
}

/// The shape of a value: nested arrays of equal shapes have their dimensions, all others are
/// vectors of what they hold.
fn shape(v: &Value) -> Shape {
    match v {
        Value::Array(xs) => Shape::Array(vec![xs.len()]),
        Value::List(all) => {
            let first = all.first().map_or(Shape::Scalar, shape);
            match all.iter().all(|x| shape(x) == first) {
                true => Shape::Array([&[all.len()], first.dims()].concat()),
                false => Shape::Array(vec![count(v)]),
            }
        }
        Value::Record(_) => Shape::Array(vec![count(v)]),
        _ => Shape::Scalar,
    }
}

fn count(v: &Value) -> usize {
    match v {
        Value::Array(xs) => xs.len(),
        Value::List(all) => all.iter().map(count).sum(),
        Value::Record(r) => r.values().map(count).sum(),
        _ => 1,
    }
}

/// Adds the different texts in a value.
fn add_levels(v: &Value, levels: &mut Vec<String>) {
    match v {
        Value::Str(s) if levels.len() < MOST_LEVELS && !levels.iter().any(|l| **l == **s) => {
            levels.push(s.to_string())
        }
        Value::List(all) => all.iter().for_each(|v| add_levels(v, levels)),
        Value::Record(r) => r.values().for_each(|v| add_levels(v, levels)),
        _ => {}
    }
}

/// The value of a column: parts of its name between slashes are fields of records.
fn find<'a>(values: &'a [(String, Value)], column: &str) -> Option<Cow<'a, Value>> {
    values.iter().find_map(|(name, v)| {
        let rest = column.strip_prefix(name.as_str())?;
        if rest.is_empty() {
            return Some(Cow::Borrowed(v));
        }
        let mut fields = rest.strip_prefix('/')?.split('/');
        fields.try_fold(Cow::Borrowed(v), |v, field| {
            if let Some((first, all)) = records(&v) {
                return first.contains_key(field).then(|| Cow::Owned(gathered(all, field)));
            }
            match v {
                Cow::Borrowed(Value::Record(r)) => r.get(field).map(Cow::Borrowed),
                Cow::Owned(Value::Record(r)) => r.get(field).cloned().map(Cow::Owned),
                _ => None,
            }
        })
    })
}

/// Writes the numbers of a value to their places in an array of these dimensions. Returns
/// whether each has one.
fn place(v: &Value, column: &Column, dims: &[usize], out: &mut [f64]) -> bool {
    match (v, dims) {
        (Value::Array(xs), [n]) if xs.len() <= *n && column.levels.is_empty() => {
            out[..xs.len()].copy_from_slice(xs);
            true
        }
        (Value::List(all), [n, inner @ ..]) if all.len() <= *n && !inner.is_empty() => {
            let parts = out.chunks_mut((out.len() / n).max(1));
            all.iter()
                .zip(parts)
                .fold(true, |fits, (v, part)| place(v, column, inner, part) && fits)
        }
        _ => {
            let (mut flat, mut known) = (Vec::new(), true);
            flatten(v, column, &mut flat, &mut known);
            let fits = dims.len() < 2 && flat.len() <= out.len();
            out.iter_mut().zip(flat).for_each(|(to, x)| *to = x);
            fits && known
        }
    }
}

/// Adds the numbers of a value; `known` becomes false at a text that the column lacks.
fn flatten(v: &Value, column: &Column, out: &mut Vec<f64>, known: &mut bool) {
    let is_text = !column.levels.is_empty();
    match v {
        Value::Num(x) if !is_text => out.push(*x),
        Value::Bool(b) if !is_text => out.push(f64::from(u8::from(*b))),
        Value::Array(xs) if !is_text => out.extend(xs.iter()),
        Value::Array(xs) => out.extend(xs.iter().map(|_| f64::NAN)),
        Value::Str(s) => {
            let level = column.levels.iter().position(|l| **l == **s);
            *known &= level.is_some() || !is_text || column.levels.len() >= MOST_LEVELS;
            out.push(level.map_or(f64::NAN, |n| n as f64));
        }
        Value::List(all) => all.iter().for_each(|v| flatten(v, column, out, known)),
        Value::Record(r) => r.values().for_each(|v| flatten(v, column, out, known)),
        _ => out.push(f64::NAN),
    }
}
