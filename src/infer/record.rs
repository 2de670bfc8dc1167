//! Recording draws: which columns there are, and flattening values into them.

use super::draws::{Column, Shape};
use crate::lang::code::Code;
use crate::lang::error::RunError;
use crate::lang::value::Value;
use crate::syntax::ast::{Expr, ExprKind, KStmt, KStmtKind};
use crate::trace::{Draws, Trace};

/// What is recorded with every draw.
#[derive(Debug)]
pub(crate) struct Recorder {
    collects: bool,
    columns: Vec<Column>,
}

impl Recorder {
    /// A recorder for a plan.
    pub fn new(_code: &Code, plan: &[KStmt]) -> Self {
        Recorder { collects: plan.iter().any(collects), columns: Vec::new() }
    }

    /// Whether the plan says itself what to collect.
    pub fn collects(&self) -> bool {
        self.collects
    }

    /// The columns, once the first draw has fixed them.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Takes up the columns of a checkpoint.
    pub fn set_columns(&mut self, columns: Vec<Column>) {
        self.columns = columns;
    }

    /// The values to record: what is collected (or everything assumed), and the predictions.
    pub fn values(
        &self,
        code: &Code,
        trace: &mut Trace,
        exprs: Option<&[Expr]>,
        draws: Draws,
    ) -> Result<Vec<(String, Value)>, Box<RunError>> {
        let mut names = Vec::new();
        let mut operands = Vec::new();
        match exprs {
            Some(exprs) => {
                for e in exprs {
                    let Some(operand) = code.queries.get(&e.span) else {
                        return Err(super::selection::fail(e.span, "this cannot be collected".into()));
                    };
                    names.push(column_name(e));
                    operands.push(*operand);
                }
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

    /// Fixes the columns by the first draw: numbers, bools, arrays and records of them are kept, anything else is left out.
    pub fn fix_columns(&mut self, values: &[(String, Value)]) {
        self.columns.clear();
        for (name, v) in values {
            self.add_columns(name, v);
        }
    }

    fn add_columns(&mut self, name: &str, v: &Value) {
        match v {
            Value::Num(_) | Value::Bool(_) => self.columns.push(Column { name: name.into(), shape: Shape::Scalar }),
            Value::Array(_) | Value::List(_) => {
                let mut flat = Vec::new();
                flatten(v, &mut flat);
                self.columns.push(Column { name: name.into(), shape: Shape::Vector(flat.len()) });
            }
            Value::Record(r) => r.iter().for_each(|(k, v)| self.add_columns(&format!("{name}/{k}"), v)),
            _ => {}
        }
    }

    /// One number a column: what is missing is NaN, what is too much is left out.
    pub fn flatten(&self, values: &[(String, Value)]) -> Vec<f64> {
        let mut row = Vec::new();
        for c in &self.columns {
            let mut flat = Vec::new();
            if let Some(v) = find(values, &c.name) {
                flatten(v, &mut flat);
            }
            let want = match c.shape {
                Shape::Scalar => 1,
                Shape::Vector(n) => n,
            };
            flat.resize(want, f64::NAN);
            row.extend(flat);
        }
        row
    }
}

/// The value of a column, looking into records by the names between slashes.
fn find<'a>(values: &'a [(String, Value)], column: &str) -> Option<&'a Value> {
    values.iter().find_map(|(name, v)| {
        let rest = column.strip_prefix(name.as_str())?;
        if rest.is_empty() {
            return Some(v);
        }
        rest.strip_prefix('/')?.split('/').try_fold(v, |v, field| match v {
            Value::Record(r) => r.get(field),
            _ => None,
        })
    })
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

/// What a collected expression is called: `log_joint()` without its parentheses, anything else as written.
fn column_name(e: &Expr) -> String {
    match &e.kind {
        ExprKind::Call { callee, args } if args.is_empty() => column_name(callee),
        _ => crate::syntax::print_expr(e).replace('.', "/"),
    }
}

fn collects(s: &KStmt) -> bool {
    match &s.kind {
        KStmtKind::Collect(_) => true,
        KStmtKind::Warmup { body, .. }
        | KStmtKind::Repeat { body, .. }
        | KStmtKind::Every { body, .. }
        | KStmtKind::For { body, .. } => body.iter().any(collects),
        _ => false,
    }
}
