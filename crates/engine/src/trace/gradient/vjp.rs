//! How adjoints propagate from a node to the nodes it is computed from, by kind of
//! operation.

use super::{Inputs, Reverse};
use crate::lang::adjoint::Adjoint;
use crate::lang::code::{DistSpec, Op, Operand};
use crate::lang::value::Value;
use crate::trace::choices::Target;
use crate::trace::node::*;
use crate::trace::update::Failure;
use pcadlang_numerics::dist::Dist;
use pcadlang_numerics::num::accumulate;
use smallvec::SmallVec;

impl Reverse<'_> {
    /// Returns the nodes that a node's value is computed from. For a target: those that
    /// move its support.
    pub(super) fn inputs(&self, n: NodeId, target: bool) -> Inputs {
        let (g, mut all) = (self.graph, Inputs::new());
        let frame = g[n].frame;
        let side = g[n].side.as_deref();
        match g.op(n) {
            Op::Prim { args, .. } | Op::Array(args) => {
                all.extend(args.iter().filter_map(|o| self.source(frame, *o)));
            }
            Op::Record { values, .. } => {
                all.extend(values.iter().filter_map(|o| self.source(frame, *o)))
            }
            Op::Index { .. } => all.extend(self.indexed(n).map(|(source, _)| source)),
            Op::Param { default, .. } => {
                all.extend(match g.argument(n) {
                    Some((from, o)) => self.source(from, o),
                    None => self
                        .passed(n)
                        .map(|(source, _)| source)
                        .or(default.and_then(|o| self.source(frame, o))),
                });
            }
            Op::Item => all.extend(self.passed(n).map(|(source, _)| source)),
            Op::Accumulator | Op::Gather => {
                if let Some(Side::Deps(deps)) = side {
                    all.extend(deps.iter().map(|d| self.whole(*d)));
                }
            }
            Op::Call { .. } | Op::If { .. } | Op::Fold { .. } => match side {
                Some(Side::Child(c)) if c.result != NodeId::NONE => all.push(self.whole(c.result)),
                Some(Side::MemoCall(c)) if c.result != NodeId::NONE => {
                    all.push(self.whole(c.result))
                }
                Some(Side::Loop(l)) if l.result != NodeId::NONE => all.push(self.whole(l.result)),
                // A built-in function value was called.
                Some(Side::Deps(deps) | Side::Kept(Kept { deps, .. })) => {
                    all.extend(deps.iter().map(|d| self.whole(*d)))
                }
                _ => {}
            },
            Op::Select { .. } => all.extend(self.taken(n).and_then(|o| self.source(frame, o))),
            // The results of a map of a built-in.
            Op::Map { over, .. } if !matches!(side, Some(Side::Loop(_))) => {
                all.extend(self.source(frame, *over))
            }
            Op::Draw { dist, .. } => {
                let moves = |d: Dist| d.is_stored_whitened() || target && d.has_moving_support();
                if g.dist_of(n).is_some_and(moves) {
                    self.dist_inputs(n, dist, &mut all);
                }
            }
            _ => {}
        }
        all
    }

    fn whole(&self, n: NodeId) -> NodeId {
        match &self.graph[n].value {
            Value::Container(r) => r.node.gather(),
            _ => n,
        }
    }

    /// Propagates an adjoint to the inputs of a node.
    pub(super) fn vjp(&mut self, n: NodeId, by: &Adjoint) -> Result<(), Failure> {
        let g = self.graph;
        let frame = g[n].frame;
        match g.op(n) {
            Op::Prim { builtin, args } => {
                let builtin = self.graph.code.builtins.get(*builtin);
                self.vjp_builtin(n, builtin, args, by)?;
            }
            Op::Array(items) => {
                for (i, o) in items.iter().enumerate() {
                    self.give(frame, *o, by.element(i));
                }
            }
            Op::Record { names, values } => {
                for (name, o) in names.iter().zip(values.iter()) {
                    self.give(frame, *o, by.field(name));
                }
            }
            Op::Index { .. } => {
                if let Some((source, keys)) = self.indexed(n) {
                    let mut whole = Adjoint::Zero;
                    whole.add_at(&g[source].value, &keys, by.clone());
                    self.give_node(source, whole);
                }
            }
            Op::Param { default, .. } => match (g.argument(n), self.passed(n)) {
                (Some((from, o)), _) => self.give(from, o, by.clone()),
                (None, Some((source, Some(i)))) => self.give_part(source, i, by),
                (None, Some((source, None))) => self.give_node(source, by.clone()),
                (None, None) => {
                    if let Some(o) = default {
                        self.give(frame, *o, by.clone());
                    }
                }
            },
            Op::Item => {
                if let Some((source, Some(i))) = self.passed(n) {
                    self.give_part(source, i, by);
                }
            }
            Op::Gather => self.vjp_gather(n, by)?,
            Op::Call { .. } if self.vjp_called(n, by)? => {}
            Op::Accumulator | Op::Call { .. } | Op::If { .. } | Op::Fold { .. } => {
                match &self.inputs(n, false)[..] {
                    [one] => self.give_node(*one, by.clone()),
                    _ => return Err(self.no_derivative(n, "the result of this call")),
                }
            }
            Op::Select { .. } => {
                if let Some(o) = self.taken(n) {
                    self.give(frame, o, by.clone());
                }
            }
            Op::Map { .. } => self.vjp_mapped(n, by)?,
            Op::Draw { dist, .. } => self.vjp_noncentred(n, dist, by)?,
            _ => {}
        }
        Ok(())
    }

    /// Returns the alternative that a selection takes.
    pub(super) fn taken(&self, n: NodeId) -> Option<Operand> {
        let Op::Select { then, otherwise, .. } = self.graph.op(n) else { return None };
        Some(if self.graph[n].flags & OTHERWISE == 0 { *then } else { *otherwise })
    }

    fn give_part(&mut self, source: NodeId, i: usize, by: &Adjoint) {
        let mut whole = Adjoint::Zero;
        whole.add_position(&self.graph[source].value, i, by.clone());
        self.give_node(source, whole);
    }

    /// Returns the source of a parameter of a pass: the node, and the index of the
    /// element, or `None` if the parameter gets the whole value.
    pub(super) fn passed(&self, n: NodeId) -> Option<(NodeId, Option<usize>)> {
        let g = self.graph;
        let f = &g[g[n].frame];
        let slot = (n - f.base).0;
        let element = match (&f.args, g.op(n)) {
            (_, Op::Item) | (Arguments::Item, _) => slot == 0 || matches!(g.op(n), Op::Item),
            (Arguments::Fold, _) if slot == 1 => true,
            (Arguments::Fold, _) if slot == 0 => {
                return match g[n].side.as_deref() {
                    Some(Side::Deps(deps)) => deps.first().map(|d| (self.whole(*d), None)),
                    _ => None,
                };
            }
            _ => false,
        };
        if !element {
            return None;
        }
        let home = g[f.owner].frame;
        let over = match g.op(f.owner) {
            Op::For { iter, .. } => *iter,
            Op::Map { over, .. } | Op::Fold { over, .. } => *over,
            _ => return None,
        };
        Some((self.source(home, over)?, Some(f.pass as usize)))
    }

    /// Returns the source of an index: the node whose plain value the last keys select
    /// from, and those keys.
    pub(super) fn indexed(&self, n: NodeId) -> Option<(NodeId, SmallVec<[Value; 2]>)> {
        let g = self.graph;
        let frame = g[n].frame;
        let Op::Index { base, keys } = g.op(n) else { return None };
        let mut gathered = Deps::new();
        let mut rest: SmallVec<[Value; 2]> =
            keys.iter().map(|k| g.plain(frame, *k, &mut gathered).clone()).collect();
        let found: &[NodeId] = match g[n].side.as_deref() {
            Some(Side::Deps(deps)) => &deps[gathered.len().min(deps.len())..],
            _ => &[],
        };
        let mut found = found.iter();
        let mut source = g.resolve(frame, *base)?;
        while !rest.is_empty() {
            let Value::Container(r) = &g[source].value else { break };
            let next = *found.next()?;
            if next != r.node.gather() {
                let width = g.key_width(r.node).min(rest.len());
                rest.drain(..width);
            }
            source = next;
        }
        Some((source, rest))
    }

    fn vjp_gather(&mut self, n: NodeId, by: &Adjoint) -> Result<(), Failure> {
        if !matches!(self.graph[n].side.as_deref(), Some(Side::Deps(_))) {
            return Ok(());
        }
        let Some(elements) = self.gathered(n) else {
            return Err(self.no_derivative(n, "the result of this map"));
        };
        for (i, d) in elements.into_iter().enumerate() {
            let part = match &self.graph[n].value {
                Value::Record(r) => {
                    r.get_index(i).map_or(Adjoint::Zero, |(name, _)| by.field(name))
                }
                _ => by.element(i),
            };
            self.give_node(d, part);
        }
        Ok(())
    }

    /// Returns the nodes of the elements of a container that is read as a whole; `None`
    /// if some elements are constants.
    pub(super) fn gathered(&self, n: NodeId) -> Option<Inputs> {
        let g = self.graph;
        let Some(Side::Deps(deps)) = g[n].side.as_deref() else { return None };
        let nested = deps.iter().filter(|d| matches!(g[**d].value, Value::Container(_))).count();
        let elements = &deps[..deps.len() - nested];
        let count = match &g[n].value {
            Value::Record(r) => r.len(),
            v => v.len().unwrap_or(0),
        };
        (elements.len() == count).then(|| elements.iter().map(|d| self.whole(*d)).collect())
    }

    /// A choice stored as white noise moves with its mean and covariance.
    fn vjp_noncentred(&mut self, n: NodeId, dist: &DistSpec, by: &Adjoint) -> Result<(), Failure> {
        let Some(d) = self.graph.dist_of(n) else { return Ok(()) };
        let Some(size) = self.graph.stored(n).and_then(|z| z.len()) else { return Ok(()) };
        // value = mean + L z
        let by = by.numbers(size);
        if let Some(z) = self.graph.stored(n) {
            self.give_matrix(n, dist, &d, &z, &by, 1.0)?;
        }
        self.give_params(n, dist, &d, by)
    }

    /// Propagates the part of a target's adjoint that goes to the parameters which move
    /// its support or its value (if stored as white noise); the target's own adjoint is
    /// unchanged.
    pub(super) fn vjp_support(
        &mut self,
        n: NodeId,
        targets: &[Target],
        by: &Adjoint,
    ) -> Result<(), Failure> {
        let Op::Draw { dist: spec, .. } = self.graph.op(n) else { return Ok(()) };
        let Some(dist) = self.graph.dist_of(n) else { return Ok(()) };
        if dist.is_stored_whitened() {
            return self.vjp_noncentred(n, spec, by);
        }
        if !dist.has_moving_support() {
            return Ok(());
        }
        if let Some(params) = self.by_bounds(n, &dist, targets, by) {
            return self.give_params(n, spec, &dist, params);
        }
        let mut inputs = Inputs::new();
        self.dist_inputs(n, spec, &mut inputs);
        match inputs.iter().any(|i| self.is_active(*i)) {
            true => Err(self.no_derivative(n, &format!("the support of `{}`", dist.name()))),
            false => Ok(()),
        }
    }

    /// x(y) moves with the bounds while y is fixed: returns the derivative with respect
    /// to the distribution's parameters.
    fn by_bounds(
        &self,
        n: NodeId,
        dist: &Dist,
        targets: &[Target],
        by: &Adjoint,
    ) -> Option<Vec<f64>> {
        let stored = self.graph.stored(n)?;
        let Some(count) = dist.elements() else {
            return dist.by_bounds(&stored, by.number());
        };
        let mut all = Vec::new();
        for i in 0..count {
            let moved = targets
                .iter()
                .any(|t| t.node == n && (t.element == NONE || t.element as usize == i));
            let one = dist.element(i);
            let x = stored.element(i)?;
            let part = one.by_bounds(&x, by.element(i).number())?;
            let part = if moved { part } else { vec![0.0; part.len()] };
            if matches!(dist, Dist::Iid(_)) {
                accumulate(&mut all, &part);
            } else {
                all.extend(part);
            }
        }
        Some(all)
    }
}
