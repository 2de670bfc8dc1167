//! Asking a trace for what no observation asks for: values of expressions and names,
//! surrogates of observations. What that draws is forgotten again.

use super::graph::Graph;
use super::node::Deps;
use super::{Address, Draws, Trace, TraceResult};
use crate::lang::code::{Code, Operand};
use crate::lang::value::Value;

impl Trace {
    /// The values of expressions of the top level; what they need and no observation asks
    /// for is drawn from its prior given the rest, and forgotten again.
    ///
    /// # Errors
    /// What goes wrong while they are evaluated.
    #[doc(hidden)]
    pub fn query(&mut self, operands: &[Operand], draws: Draws) -> TraceResult<Vec<Value>> {
        self.asked(operands, draws, |_, values| Ok(values))
    }

    /// As [`Trace::query`], and shows the trace with the choices that were drawn for it,
    /// before they are forgotten.
    ///
    /// # Errors
    /// As [`Trace::query`].
    #[doc(hidden)]
    pub fn imagine<T>(
        &mut self,
        operands: &[Operand],
        draws: Draws,
        look: impl FnOnce(&Trace, Vec<Value>) -> T,
    ) -> TraceResult<T> {
        self.asked(operands, draws, |trace, values| {
            trace.graph.update_selections(&trace.code)?;
            Ok(look(trace, values))
        })
    }

    /// Evaluates expressions, uses them, and forgets them.
    fn asked<T>(
        &mut self,
        operands: &[Operand],
        draws: Draws,
        used: impl FnOnce(&mut Trace, Vec<Value>) -> TraceResult<T>,
    ) -> TraceResult<T> {
        self.rollback();
        let before = self.graph.begin();
        self.graph.draws = draws;
        self.graph.before = Some(before.clone());
        let result = self.graph.query(&self.code, operands);
        self.graph.before = None;
        let result = result.and_then(|values| used(self, values));
        self.graph.rollback(&self.code, before);
        result
    }

    /// The value of a top-level name.
    ///
    /// # Errors
    /// As [`Trace::query`]; `None` if there is no such name.
    pub fn global(&mut self, name: &str, draws: Draws) -> Option<TraceResult<Value>> {
        let operand = *self.code.globals.get(name)?;
        Some(self.query(&[operand], draws).map(|mut v| v.swap_remove(0)))
    }

    /// The log density of the coarse surrogate of an observation (`with coarse = …`), by
    /// the address it has. It is never part of the joint.
    ///
    /// # Errors
    /// What goes wrong while it is evaluated; `None` if there is no such observation or
    /// it has no surrogate.
    #[doc(hidden)]
    pub fn surrogate(&mut self, address: &Address, draws: Draws) -> TraceResult<Option<f64>> {
        let Some((n, _)) =
            self.scored().into_iter().find(|(n, _)| self.graph.address(&self.code, *n) == *address)
        else {
            return Ok(None);
        };
        self.rollback();
        let before = self.graph.begin();
        self.graph.draws = draws;
        let result = self.graph.surrogate_score(&self.code, n);
        self.graph.rollback(&self.code, before);
        result
    }
}

impl Graph {
    pub(super) fn query(&mut self, code: &Code, operands: &[Operand]) -> TraceResult<Vec<Value>> {
        let mut values = Vec::with_capacity(operands.len());
        for o in operands {
            if let Some(n) = self.resolve(0, *o) {
                self.evaluate(code, n)?;
            }
            if let Value::Container(r) = self.value(code, 0, *o) {
                let gather = r.node + 1;
                self.evaluate(code, gather)?;
            }
            let mut deps = Deps::new();
            values.push(self.plain(code, 0, *o, &mut deps).clone());
        }
        Ok(values)
    }
}
