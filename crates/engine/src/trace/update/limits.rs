//! Counts what an update uses of its limits.

use super::propagate::Failure;
use crate::lang::code::Code;
use crate::lang::error::FaultKind;
use crate::lang::value::{Extent, MOST_ELEMENTS, MOST_NESTED, Value};
use crate::trace::graph::Graph;
use crate::trace::limits::raise;
use crate::trace::node::NodeId;
use pcadlang_numerics::platform::clock::Instant;

/// The number of operations between two checks of flags and clock.
const BETWEEN_LOOKS: u32 = 1 << 12;

impl Graph {
    /// Counts one evaluation.
    #[inline]
    pub fn count_operation(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        self.spent.operations += 1;
        self.spent.since_look += 1;
        if self.spent.operations > self.limits.operations {
            let message =
                format!("one evaluation took more than {} operations", self.limits.operations);
            return Err(self.fail(code, n, FaultKind::Limit, message, Some(raise("operations"))));
        }
        if self.spent.since_look >= BETWEEN_LOOKS { self.look_at_clock(code, n) } else { Ok(()) }
    }

    #[cold]
    fn look_at_clock(&mut self, code: &Code, n: NodeId) -> Result<(), Failure> {
        self.spent.since_look = 0;
        if !self.limits.stop.is_asked() {
            self.spent.late = None;
            return Ok(());
        }
        let since = *self.spent.late.get_or_insert_with(Instant::now);
        if since.elapsed() < self.limits.stop.patience {
            return Ok(());
        }
        let message = "stopped in the middle of an evaluation".to_owned();
        let hint = "one evaluation of the program took longer than the remaining time".to_owned();
        Err(self.fail(code, n, FaultKind::Stopped, message, Some(hint)))
    }

    /// Counts the elements of a value that a node made, and rejects values that are too
    /// large or too deeply nested.
    #[inline]
    pub fn count_elements(&mut self, code: &Code, n: NodeId, value: &Value) -> Result<(), Failure> {
        let made = match value {
            Value::Num(_) | Value::Bool(_) => return Ok(()),
            Value::Array(xs) => xs.len(),
            Value::Str(s) => s.len() / 8,
            Value::List(_) | Value::Record(_) => {
                self.check_extent(code, n, value)?;
                value.len().unwrap_or(0)
            }
            Value::Object(o) => {
                self.spent.count_large();
                o.own_numbers()
            }
            _ => return Ok(()),
        };
        self.spent.elements += made as u64;
        if self.spent.elements > self.limits.elements {
            let message = format!(
                "the values made by one evaluation have more than {} elements",
                self.limits.elements
            );
            return Err(self.fail(code, n, FaultKind::Limit, message, Some(raise("elements"))));
        }
        Ok(())
    }

    fn check_extent(&self, code: &Code, n: NodeId, value: &Value) -> Result<(), Failure> {
        let (message, hint) = match value.extent() {
            Extent::Fits => return Ok(()),
            Extent::TooDeep => (
                format!("arrays and records are nested more than {MOST_NESTED} deep"),
                "collect growing values in one array: append(xs, x)",
            ),
            Extent::TooLarge => (
                format!("a value with more than {MOST_ELEMENTS} elements, counting nested ones"),
                "an array that is used several times counts each time",
            ),
        };
        Err(self.fail(code, n, FaultKind::Limit, message, Some(hint.into())))
    }
}
