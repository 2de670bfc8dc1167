//! Moving a trace to a point of a tape in place: the nodes take their values and scores
//! from the tape, with the same bits that an update would give them. Nothing is
//! invalidated, evaluated or journaled.

use crate::lang::builtins::CovarianceValue;
use crate::lang::code::{Code, Op, Operand};
use crate::lang::tape::{Form, ScoreSums, ScoreTerms, Tape};
use crate::lang::value::Value;
use crate::num::ExactSum;
use crate::trace::Trace;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use std::sync::Arc;

/// The nodes that a tape gives values and scores.
#[derive(Debug)]
pub(super) struct InPlace {
    values: Vec<(NodeId, Form)>,
    /// Nodes that contribute to the score, and the operation of the tape with their terms.
    scores: Vec<(NodeId, usize)>,
    each: Vec<f64>,
    made: Vec<Value>,
}

impl InPlace {
    /// For the nodes whose inputs move, with their forms on a tape, and those among them
    /// whose score one operation computes; `None` if a node keeps anything else that
    /// moves.
    pub fn new(
        graph: &Graph,
        code: &Code,
        moving: impl Iterator<Item = (NodeId, Form)>,
        scores: Vec<(NodeId, usize)>,
        is_fixed: impl Fn(FrameId, Operand) -> bool,
    ) -> Option<InPlace> {
        let mut values = Vec::new();
        for (n, form) in moving {
            let node = &graph.nodes[n as usize];
            let op = graph.op(code, n);
            let fits = match node.side.as_deref() {
                None | Some(Side::Deps(_) | Side::Child(_) | Side::MemoCall(_)) => true,
                Some(Side::Choice(c)) => c.stored.is_none(),
                Some(Side::Total(_)) => matches!(op, Op::Observe { .. }),
                Some(Side::Loop(_)) => match op {
                    Op::Map { over, .. } | Op::Fold { over, .. } => is_fixed(node.frame, *over),
                    _ => false,
                },
                Some(Side::Kept(_) | Side::Table(_) | Side::Memo(_)) => false,
            };
            if !fits {
                return None;
            }
            if !form.is_fixed() {
                values.push((n, form));
            }
        }
        Some(InPlace { values, scores, each: Vec::new(), made: Vec::new() })
    }

    /// Moves the trace to the point of the tape's last run; `before` are the sums of its
    /// scores where the trace is. False, with nothing changed, if only an update can do
    /// that.
    pub fn apply(
        &mut self,
        graph: &mut Graph,
        code: &Code,
        tape: &Tape,
        before: &ScoreSums,
    ) -> bool {
        self.made.clear();
        for (_, form) in self.values.iter().filter(|(_, form)| tape.numbers(form).is_none()) {
            let Some(value) = tape.value(form) else { return false };
            self.made.push(value);
        }
        let fits = self.scores.iter().all(|(n, i)| {
            let terms = tape.terms(*i, &mut self.each);
            let node = &graph.nodes[*n as usize];
            match (graph.op(code, *n), node.side.as_deref(), terms) {
                (Op::Draw { .. }, Some(Side::Choice(c)), Some(ScoreTerms::Each)) => {
                    c.scores.len() == self.each.len() && c.elements != NONE
                }
                (Op::Draw { .. }, Some(Side::Choice(c)), Some(ScoreTerms::One(_))) => {
                    c.elements == NONE
                }
                (Op::Draw { .. }, None, Some(ScoreTerms::One(_))) => true,
                (Op::Observe { .. }, Some(Side::Total(_)), Some(_)) => true,
                (Op::Observe { .. } | Op::Factor { .. }, None, Some(ScoreTerms::One(_))) => true,
                _ => false,
            }
        });
        if !fits {
            return false;
        }
        let mut made = self.made.drain(..);
        for (n, form) in &self.values {
            let value = &mut graph.nodes[*n as usize].value;
            match (tape.numbers(form), form) {
                (Some([x]), Form::Num(_)) => *value = Value::Num(*x),
                (Some(xs), _) => put(value, xs),
                (None, _) => *value = made.next().unwrap_or_default(),
            }
        }
        for (n, i) in &self.scores {
            let terms = tape.terms(*i, &mut self.each);
            let node = &mut graph.nodes[*n as usize];
            match (node.side.as_deref_mut(), terms) {
                (Some(Side::Choice(c)), Some(ScoreTerms::Each)) => {
                    c.scores.copy_from_slice(&self.each)
                }
                (Some(Side::Total(t)), Some(ScoreTerms::Each)) => {
                    node.score = 0.0;
                    t.sum = ExactSum::default();
                    self.each.iter().for_each(|s| t.sum.add(*s));
                }
                (Some(Side::Total(t)), Some(ScoreTerms::Sum(sum))) => {
                    node.score = 0.0;
                    t.sum = sum;
                }
                (Some(Side::Total(t)), Some(ScoreTerms::One(score))) => {
                    node.score = score;
                    t.sum = ExactSum::default();
                }
                (_, Some(ScoreTerms::One(score))) => node.score = score,
                _ => {}
            }
        }
        tape.sums().replace(before, &mut graph.prior, &mut graph.likelihood);
        graph.revision += 1;
        true
    }
}

/// Replaces an array, in its own memory if nothing else holds it.
fn put(value: &mut Value, xs: &[f64]) {
    if let Value::Array(old) = value
        && let Some(old) = Arc::get_mut(old)
        && old.len() == xs.len()
    {
        old.copy_from_slice(xs);
        return;
    }
    *value = Value::Array(xs.into());
}

impl Trace {
    /// Whether every node of a trace of the same history is the same to the last bit; else
    /// says how one differs.
    #[doc(hidden)]
    pub fn same_nodes(&self, other: &Trace) -> Result<(), String> {
        let (mine, theirs) = (&self.graph, &other.graph);
        let all = |g: &Graph| (g.nodes.len(), g.prior.clone(), g.likelihood.clone());
        if all(mine) != all(theirs) {
            return Err(format!("sums {:?}, {:?}", all(mine), all(theirs)));
        }
        for (i, (a, b)) in mine.nodes.iter().zip(&theirs.nodes).enumerate() {
            // Distributions and objects are the same only if they are one.
            let same_value = match (a.value.downcast(), b.value.downcast()) {
                (Some(CovarianceValue(a)), Some(CovarianceValue(b))) => a == b,
                _ => a.value.same(&b.value) || format!("{:?}", a.value) == format!("{:?}", b.value),
            };
            let rest =
                |n: &Node| (n.score.to_bits(), n.state, n.refs, n.flags, format!("{:?}", n.side));
            if !same_value || rest(a) != rest(b) {
                return Err(format!("node {i}: {a:?}, {b:?}"));
            }
        }
        Ok(())
    }
}
