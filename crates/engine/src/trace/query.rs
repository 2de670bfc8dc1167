//! Queries: values of expressions and names that no observation depends on, and
//! surrogates of observations. Choices drawn for a query are discarded afterwards.

use super::graph::Graph;
use super::node::{Arguments, Frame, FrameId, State};
use super::{Address, Draws, Trace, TraceResult};
use crate::lang::code::{BlockId, Code, Operand};
use crate::lang::value::Value;
use std::sync::Arc;

impl Trace {
    /// Returns the values of top-level expressions. Choices that they need and no
    /// observation depends on are drawn from their prior given the rest, and discarded
    /// afterwards.
    ///
    /// # Errors
    /// If their evaluation fails.
    #[doc(hidden)]
    pub fn query(&mut self, operands: &[Operand], draws: Draws) -> TraceResult<Vec<Value>> {
        self.asked(
            |graph, code| graph.query(code, FrameId::ROOT, operands),
            draws,
            |_, values| Ok(values),
        )
    }

    /// Returns the value of a top-level expression, if the state has it.
    #[doc(hidden)]
    pub fn evaluated(&self, operand: Operand) -> Option<&Value> {
        let node = &self.graph.store[self.graph.resolve(FrameId::ROOT, operand)?];
        (node.state == State::Clean).then_some(&node.value)
    }

    /// Evaluates a function of the program, which sees the present state, with these
    /// arguments. One that is missing is an error only if the function reads it. Choices
    /// that the state lacks are drawn as by [`Trace::query`].
    #[doc(hidden)]
    pub fn call(
        &mut self,
        function: BlockId,
        args: Arc<[TraceResult<Value>]>,
        draws: Draws,
    ) -> TraceResult<Value> {
        let args = Arguments::Supplied(args);
        let root = self.graph.store[FrameId::ROOT].clone();
        let frame = Frame { block: function, parent: FrameId::ROOT, depth: 1, args, ..root };
        let evaluate = |graph: &mut Graph, code: &Code| {
            let frame = graph.make_frame(frame)?;
            graph.query(code, frame, code.blocks[function].result.as_slice())
        };
        self.asked(evaluate, draws, |_, mut values| Ok(values.pop().unwrap_or_default()))
    }

    /// Like [`Trace::query`], and passes to `look` the trace with the choices that were
    /// drawn for it, before they are discarded.
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
        self.asked(
            |graph, code| graph.query(code, FrameId::ROOT, operands),
            draws,
            |trace, values| {
                let Graph { choices, store, update, .. } = &mut trace.graph;
                choices.update_selections(store, update)?;
                Ok(look(trace, values))
            },
        )
    }

    /// Evaluates expressions, passes them to `used`, and undoes the evaluation.
    fn asked<T>(
        &mut self,
        evaluate: impl FnOnce(&mut Graph, &Code) -> TraceResult<Vec<Value>>,
        draws: Draws,
        used: impl FnOnce(&mut Trace, Vec<Value>) -> TraceResult<T>,
    ) -> TraceResult<T> {
        self.rollback();
        let before = self.graph.begin();
        self.graph.update.draws = draws;
        self.graph.score.before = Some(before.clone());
        let result = evaluate(&mut self.graph, &self.code);
        self.graph.score.before = None;
        let result = result.and_then(|values| used(self, values));
        self.graph.rollback(before);
        result
    }

    /// Returns the value of a top-level name.
    ///
    /// # Errors
    /// As [`Trace::query`]; `None` if the name does not exist.
    pub fn global(&mut self, name: &str, draws: Draws) -> Option<TraceResult<Value>> {
        let operand = *self.code.globals.get(name)?;
        Some(self.query(&[operand], draws).map(|mut v| v.swap_remove(0)))
    }

    /// Returns the log density of the coarse surrogate of an observation
    /// (`with coarse = …`), given the observation's address. It is never part of the
    /// joint.
    ///
    /// # Errors
    /// If its evaluation fails; `None` if the observation does not exist or has no
    /// surrogate.
    #[doc(hidden)]
    pub fn surrogate(&mut self, address: &Address, draws: Draws) -> TraceResult<Option<f64>> {
        let Some((n, _)) =
            self.scored().into_iter().find(|(n, _)| self.graph.address(*n) == *address)
        else {
            return Ok(None);
        };
        self.rollback();
        let before = self.graph.begin();
        self.graph.update.draws = draws;
        let result = self.graph.surrogate_score(&self.code, n);
        self.graph.rollback(before);
        result
    }
}
