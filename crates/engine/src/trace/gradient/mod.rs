//! Gradients of the log joint density with respect to selected choices: reverse mode over
//! the trace.
//!
//! The nodes between the choices and the scores are sorted so that operands come first;
//! adjoints then flow from the scores back through that order. Structure is held fixed:
//! which branch is taken, how many choices there are, the values of discrete choices.
//! Built-ins provide their vector-Jacobian products ([`crate::lang::builtins`]),
//! distributions and likelihoods their gradients, and supports those of their transforms.

mod calls;
mod in_place;
mod record;
mod recording;
mod scores;
mod vjp;

pub(in crate::trace) use in_place::Given;
pub(in crate::trace) use record::{Recorded, Recorder};
pub use recording::Recording;
pub(in crate::trace) use recording::SummedChoices;

use super::choices::Target;
use super::node::*;
use super::store::Store;
use super::update::Failure;
use crate::lang::adjoint::Adjoint;
use crate::lang::code::{DistSpec, Operand};
use crate::lang::error::FaultKind;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Datum, Dist};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

/// Nodes that a value is computed from.
type Inputs = SmallVec<[NodeId; 8]>;

/// True if a node's value depends on a target of the gradient.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mark {
    Unseen,
    Target,
    Open,
    Fixed,
    Active,
}

/// A reverse pass.
pub(super) struct Reverse<'a> {
    graph: &'a Store,
    marks: Vec<Mark>,
    /// The active nodes, operands first.
    order: Vec<NodeId>,
    adjoints: FxHashMap<NodeId, Adjoint>,
    /// The weight of the log density that is being differentiated, and that weight times
    /// the power of the likelihood.
    weight: f64,
    power: f64,
}

impl Store {
    /// Appends to `out` the gradient, with respect to the unconstrained coordinates of
    /// the targets one after the other, of the log prior plus `power` times the log
    /// likelihood plus the log Jacobians of the transforms, with a weight for each score.
    /// Discrete targets have no coordinates.
    ///
    /// # Errors
    /// If a score depends on a target through an operation without a derivative; the
    /// error names the operation.
    pub fn gradient(
        &self,
        targets: &[Target],
        scored: &[NodeId],
        (power, weight): (f64, &dyn Fn(NodeId) -> f64),
        out: &mut Vec<f64>,
    ) -> Result<(), Failure> {
        let mut marks = vec![Mark::Unseen; self.len()];
        for t in targets {
            marks[t.node] = Mark::Target;
        }
        let mut pass = Reverse {
            graph: self,
            marks,
            order: Vec::new(),
            adjoints: FxHashMap::default(),
            weight: 1.0,
            power,
        };
        for t in targets {
            pass.visit(t.node);
        }
        let mut active_scores = Vec::new();
        for n in scored {
            let mut reached = pass.marks[*n] == Mark::Active;
            for input in pass.score_inputs(*n) {
                reached |= pass.visit(input);
            }
            if reached {
                active_scores.push(*n);
            }
        }
        for n in active_scores {
            pass.weight = weight(n);
            pass.power = pass.weight * power;
            pass.vjp_score(n)?;
        }
        let mut own: FxHashMap<NodeId, Option<TargetAdjoint>> =
            targets.iter().map(|t| (t.node, None)).collect();
        while let Some(n) = pass.order.pop() {
            let by = pass.adjoints.remove(&n).unwrap_or_default();
            // A likelihood may have no derivative for some of its arguments; that matters
            // only if these depend on a target.
            let in_parts =
                matches!((&self[n].value, &by), (Value::Likelihood(_), Adjoint::List(_)));
            if by.is_unknown() && !in_parts {
                return Err(pass.no_derivative(n, "a value computed from this"));
            }
            if let Some(place) = own.get_mut(&n) {
                pass.vjp_support(n, targets, &by)?;
                *place = self.own(n, by);
            } else if !by.is_zero() {
                pass.vjp(n, &by)?;
            }
        }
        for t in targets {
            if let Some(Some(o)) = own.get(&t.node) {
                o.free_gradient(*t, out);
            }
        }
        Ok(())
    }

    fn own(&self, n: NodeId, mut by: Adjoint) -> Option<TargetAdjoint> {
        let (dist, stored) = (self.dist_of(n)?, self.stored(n)?);
        if dist.is_stored_whitened() {
            // The value moves with the noise, which has its own density.
            let mut g = dist.from_noncentred_vjp(&by.numbers(stored.len()?))?;
            g.iter_mut().zip(dist.gradient_stored(&stored)?.x).for_each(|(g, own)| *g += own);
            by = Adjoint::Array(g);
        }
        Some(TargetAdjoint { dist, stored, by })
    }
}

/// A choice and the derivative with respect to its stored form.
struct TargetAdjoint {
    dist: Dist,
    stored: Datum,
    by: Adjoint,
}

impl TargetAdjoint {
    /// Appends the derivatives with respect to the unconstrained coordinates of a target.
    fn free_gradient(&self, t: Target, out: &mut Vec<f64>) {
        let of = |dist: &Dist, stored: &Datum, by: &Adjoint, out: &mut Vec<f64>| {
            let support = dist.stored_support();
            let mut y = Vec::with_capacity(support.free_dim());
            support.to_free(stored, &mut y);
            let mut by_x = Vec::new();
            flatten(by, support.gradient_dim(), &mut by_x);
            support.free_gradient(&y, &by_x, out);
        };
        let element = |i: usize, out: &mut Vec<f64>| {
            if let Some(x) = self.stored.element(i) {
                of(&self.dist.element(i), &x, &self.by.element(i), out);
            }
        };
        match self.dist.elements() {
            None => of(&self.dist, &self.stored, &self.by, out),
            Some(_) if t.element != NONE => element(t.element as usize, out),
            Some(n) => (0..n).for_each(|i| element(i, out)),
        }
    }
}

/// Appends the numbers of an adjoint, flattened.
fn flatten(by: &Adjoint, n: usize, out: &mut Vec<f64>) {
    match by {
        Adjoint::Num(g) => out.push(*g),
        Adjoint::Array(gs) => out.extend(gs),
        Adjoint::List(all) => {
            let each = n / all.len().max(1);
            all.iter().for_each(|a| flatten(a, each, out));
        }
        _ => out.resize(out.len() + n, 0.0),
    }
}

impl<'a> Reverse<'a> {
    /// True if a node's value depends on a target; if so, it is appended to the order.
    fn visit(&mut self, root: NodeId) -> bool {
        // A node, its inputs, how many of them are done, and whether it is active so far.
        let mut stack: Vec<(NodeId, Inputs, usize, bool)> = Vec::new();
        self.open(root, &mut stack);
        while let Some((n, inputs, next, active)) = stack.last_mut() {
            let Some(input) = inputs.get(*next).copied() else {
                let (n, active) = (*n, *active);
                stack.pop();
                self.marks[n] = if active { Mark::Active } else { Mark::Fixed };
                if active {
                    self.order.push(n);
                }
                continue;
            };
            match self.marks[input] {
                Mark::Unseen | Mark::Target => self.open(input, &mut stack),
                mark => {
                    *active |= mark == Mark::Active;
                    *next += 1;
                }
            }
        }
        self.marks[root] == Mark::Active
    }

    fn open(&mut self, n: NodeId, stack: &mut Vec<(NodeId, Inputs, usize, bool)>) {
        let target = match self.marks[n] {
            Mark::Unseen => false,
            Mark::Target => true,
            _ => return,
        };
        let inputs = self.inputs(n, target);
        if inputs.is_empty() && !target {
            self.marks[n] = Mark::Fixed;
        } else {
            self.marks[n] = Mark::Open;
            stack.push((n, inputs, 0, target));
        }
    }

    /// Returns the node that holds an operand's value; a container is read as a whole.
    fn source(&self, frame: FrameId, o: Operand) -> Option<NodeId> {
        let n = self.graph.resolve(frame, o)?;
        Some(match &self.graph[n].value {
            Value::Container(r) => r.node.gather(),
            _ => n,
        })
    }

    /// Returns the values of a call's arguments.
    fn values(&self, frame: FrameId, args: &[Operand]) -> SmallVec<[&'a Value; 8]> {
        let graph = self.graph;
        args.iter().map(|a| graph.plain(frame, *a, &mut Deps::new())).collect()
    }

    fn is_active(&self, n: NodeId) -> bool {
        self.marks[n] == Mark::Active
    }

    /// Adds to the adjoint of an operand.
    fn give(&mut self, frame: FrameId, o: Operand, by: Adjoint) {
        if let Some(n) = self.source(frame, o) {
            self.give_node(n, by);
        }
    }

    fn give_node(&mut self, n: NodeId, by: Adjoint) {
        if !by.is_zero() && self.is_active(n) {
            self.adjoints.entry(n).or_default().add(by);
        }
    }

    fn dist_inputs(&self, n: NodeId, dist: &DistSpec, inputs: &mut Inputs) {
        let frame = self.graph[n].frame;
        inputs.extend(dist.operands().iter().filter_map(|o| self.source(frame, *o)));
    }

    fn no_derivative(&self, n: NodeId, of: &str) -> Failure {
        self.graph.fail(
            n,
            FaultKind::Type,
            format!("{of} depends on a selected choice, but its derivative is not available"),
            Some("use a kernel without gradients for that choice, such as drift".into()),
        )
    }
}
