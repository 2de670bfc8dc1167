//! Enumeration: the weights of a choice's other values without an update.
//!
//! Gibbs updates need the weight of every value and keep one. If a value changes no
//! structure, its weight depends only on the few observations and choices that depend on
//! the choice, so those are scored without modifying the trace: nothing is journaled,
//! released or rolled back. Terms are quantised as in an update, so the weights agree to
//! the last bit. Values that would change the structure, or that need operations not
//! handled here, are left to an update.

use crate::dist::{Datum, Dist};
use crate::lang::code::{Code, DistSpec, Op, Operand};
use crate::lang::index::index_value;
use crate::lang::value::Value;
use crate::num::ExactSum;
use crate::trace::choices::Target;
use crate::trace::eval::Score;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use crate::trace::propose::Weight;
use crate::trace::update::Failure;
use crate::trace::{Trace, TraceResult};
use smallvec::SmallVec;

/// Everything that depends on a choice: found once, valid until the trace changes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Enumeration {
    target: NodeId,
    /// Computations with their values under the candidate value, followed by those that
    /// only the candidate value needs.
    values: Vec<(NodeId, Option<Value>)>,
    /// How many of them depend on the choice.
    dependent: usize,
    /// Observations, factors and choices to be scored.
    sinks: Vec<NodeId>,
    /// How many references to each node would be released.
    released: Vec<(NodeId, u32)>,
    stack: Vec<NodeId>,
}

/// The maximum number of computations and scores for which this is worthwhile.
const MOST: usize = 48;

/// Why a value cannot be weighted here.
pub(crate) enum Obstacle {
    /// An update must decide.
    Unsuitable,
    /// The program fails at this value.
    Fault(Failure),
}

impl From<Failure> for Obstacle {
    fn from(e: Failure) -> Self {
        Obstacle::Fault(e)
    }
}

impl Trace {
    /// Passes to `weight` the log weights that the values of a choice with this
    /// distribution would have in an update, relative to the current state (that of the
    /// `current` value is 0), with the likelihood raised to a power; `None` for values at
    /// which the program fails with a recoverable error. Returns false if updates are
    /// needed instead, because structure depends on the choice.
    pub(crate) fn enumerate_conditional(
        &self,
        target: Target,
        dist: &Dist,
        (values, current): (&[Datum], usize),
        enumeration: &mut Enumeration,
        power: f64,
        mut weight: impl FnMut(Option<f64>),
    ) -> TraceResult<bool> {
        let g = &self.graph;
        if self.update.is_some() || target.element != NONE {
            return Ok(false);
        }
        let local_densities = g.local_densities(&self.code, target.node);
        let mut evaluation = g.evaluation(&self.code);
        let mut enumerated = false;
        for (i, v) in values.iter().enumerate() {
            if i == current {
                weight(Some(0.0));
                continue;
            }
            if let Some(f) = &local_densities
                && let Some(w) = evaluation.weigh(target.node, f, dist, v, power)
            {
                weight(Some(w));
                continue;
            }
            if !enumerated && !g.enumerate_at(&self.code, target.node, enumeration) {
                return Ok(false);
            }
            enumerated = true;
            match g.log_weight_of(&self.code, enumeration, dist, v, power) {
                Ok(w) => weight(Some(w)),
                Err(Obstacle::Fault(e)) if e.is_recoverable() => weight(None),
                Err(_) => return Ok(false),
            }
        }
        Ok(true)
    }
}

impl Graph {
    /// Finds everything that depends on a choice; false if its values must be weighted by
    /// updates.
    pub fn enumerate_at(&self, code: &Code, target: NodeId, enumeration: &mut Enumeration) -> bool {
        enumeration.target = target;
        enumeration.values.clear();
        enumeration.sinks.clear();
        let finite = self.prior.is_fine() && self.likelihood.is_fine();
        if !self.incremental || !finite || !self.is_plain_choice(target) {
            return false;
        }
        enumeration.stack.clear();
        enumeration.stack.push(target);
        while let Some(n) = enumeration.stack.pop() {
            let facts = self.slot_facts(code, n);
            if facts.is_result {
                return false;
            }
            let outside = &self.outside[self.nodes[n as usize].outside as usize].users;
            if outside.len() + enumeration.values.len() + enumeration.sinks.len() > MOST {
                return false;
            }
            for m in facts.users.iter().map(|u| n - facts.slot + u).chain(outside.iter().copied()) {
                if self.nodes[m as usize].state != State::Clean || enumeration.knows(m) {
                    continue;
                }
                match self.op(code, m) {
                    Op::Prim { .. }
                    | Op::Array(_)
                    | Op::Record { .. }
                    | Op::Index { .. }
                    | Op::Select { .. } => {
                        enumeration.values.push((m, None));
                        enumeration.stack.push(m);
                    }
                    Op::Observe { .. } | Op::Factor { .. } => enumeration.sinks.push(m),
                    Op::Draw { dist: DistSpec::Family { .. }, .. } if self.is_plain_choice(m) => {
                        enumeration.sinks.push(m)
                    }
                    _ => return false,
                }
            }
        }
        enumeration.dependent = enumeration.values.len();
        let keyed = |n: &NodeId| match self.op(code, *n) {
            Op::Draw { keys, .. } => {
                let frame = self.nodes[*n as usize].frame;
                keys.iter().any(|k| {
                    self.resolve(frame, *k).is_some_and(|d| d == target || enumeration.knows(d))
                })
            }
            _ => false,
        };
        !enumeration.sinks.iter().any(keyed)
    }

    /// Whether a choice is a single number or boolean, stored as the program sees it.
    pub fn is_plain_choice(&self, n: NodeId) -> bool {
        let node = &self.nodes[n as usize];
        let whole = match node.side.as_deref() {
            None => true,
            Some(Side::Choice(c)) => c.stored.is_none() && c.elements == NONE && c.deps.is_empty(),
            _ => false,
        };
        whole && matches!(node.value, Value::Num(_) | Value::Bool(_))
    }

    /// Returns the log weight of a value of the choice relative to the current one.
    fn log_weight_of(
        &self,
        code: &Code,
        enumeration: &mut Enumeration,
        dist: &Dist,
        value: &Datum,
        power: f64,
    ) -> Result<f64, Obstacle> {
        enumeration.values.truncate(enumeration.dependent);
        enumeration.values.iter_mut().for_each(|(_, v)| *v = None);
        enumeration.released.clear();
        let target = enumeration.target;
        let (mut prior, mut likelihood) = (ExactSum::default(), ExactSum::default());
        prior.sub(self.nodes[target as usize].score);
        prior.add(dist.log_density_stored(value));
        let value = Value::from_datum(value);
        for i in 0..enumeration.sinks.len() {
            let n = enumeration.sinks[i];
            let node = &self.nodes[n as usize];
            match self.op(code, n) {
                Op::Draw { dist: spec, .. } => {
                    let values =
                        self.values_of(code, enumeration, &value, node.frame, spec.operands())?;
                    let dist = self.dist_of_values(code, n, spec, &refs(&values))?;
                    let stored = self
                        .stored(n)
                        .filter(|x| dist.elements().is_none() && dist.stored_support().fits(x));
                    let stored = stored.ok_or(Obstacle::Unsuitable)?;
                    if dist.is_stored_whitened() {
                        return Err(Obstacle::Unsuitable);
                    }
                    prior.sub(node.score);
                    prior.add(dist.log_density_stored(&stored));
                }
                Op::Observe { dist: spec, value: observed, .. } => {
                    let values =
                        self.values_of(code, enumeration, &value, node.frame, spec.operands())?;
                    let observed = match self.replaced(code, n) {
                        Some(v) => v.clone(),
                        None => {
                            self.value_of_operand(code, enumeration, &value, node.frame, *observed)?
                        }
                    };
                    let score = self.score_of_values(code, n, spec, &refs(&values), &observed)?;
                    self.take_score(n, &mut likelihood);
                    match score {
                        Score::One(x) => likelihood.add(x),
                        Score::Sum(sum) => likelihood.merge(&sum),
                    }
                }
                Op::Factor { weight, .. } => {
                    match self.value_of_operand(code, enumeration, &value, node.frame, *weight)? {
                        Value::Num(w) if !w.is_nan() => {
                            likelihood.sub(node.score);
                            likelihood.add(w);
                        }
                        _ => return Err(Obstacle::Unsuitable),
                    }
                }
                _ => return Err(Obstacle::Unsuitable),
            }
        }
        Ok(Weight::beside(&prior, &likelihood, power))
    }

    fn values_of(
        &self,
        code: &Code,
        enumeration: &mut Enumeration,
        value: &Value,
        frame: FrameId,
        operands: &[Operand],
    ) -> Result<SmallVec<[Value; 4]>, Obstacle> {
        let mut values = SmallVec::new();
        for o in operands {
            values.push(self.value_of_operand(code, enumeration, value, frame, *o)?);
        }
        Ok(values)
    }

    fn value_of_operand(
        &self,
        code: &Code,
        enumeration: &mut Enumeration,
        value: &Value,
        frame: FrameId,
        o: Operand,
    ) -> Result<Value, Obstacle> {
        let v = match self.resolve(frame, o) {
            None => self.value(code, frame, o).clone(),
            Some(n) => self.value_of_node(code, enumeration, value, n)?,
        };
        let Value::Container(r) = v else { return Ok(v) };
        let gather = &self.nodes[r.node as usize + 1];
        if gather.state == State::Clean {
            Ok(gather.value.clone())
        } else {
            Err(Obstacle::Unsuitable)
        }
    }

    /// Returns the value that a node would have.
    fn value_of_node(
        &self,
        code: &Code,
        enumeration: &mut Enumeration,
        value: &Value,
        n: NodeId,
    ) -> Result<Value, Obstacle> {
        if n == enumeration.target {
            return Ok(value.clone());
        }
        let node = &self.nodes[n as usize];
        let place = enumeration.values.iter().position(|(m, _)| *m == n);
        match place.map(|i| &enumeration.values[i].1) {
            Some(Some(v)) => return Ok(v.clone()),
            None if node.state == State::Clean => return Ok(node.value.clone()),
            None if enumeration.values.len() > MOST => return Err(Obstacle::Unsuitable),
            _ => {}
        }
        let frame = node.frame;
        let v = match self.op(code, n) {
            Op::Prim { builtin, args } => {
                let values = self.values_of(code, enumeration, value, frame, args)?;
                let made = self.apply_at(n, code.builtins.get(*builtin), &refs(&values));
                made.map_err(|f| self.fault(code, n, f))?.into_value()
            }
            Op::Array(items) => Value::from_elements(
                self.values_of(code, enumeration, value, frame, items)?.into_vec(),
            ),
            Op::Record { names, values } => {
                let values = self.values_of(code, enumeration, value, frame, values)?;
                Value::Record(std::sync::Arc::new(names.iter().cloned().zip(values).collect()))
            }
            Op::Index { base, keys } => {
                self.value_of_index(code, enumeration, value, n, *base, keys)?
            }
            Op::Select { cond, then, otherwise } => {
                let holds = match self.value_of_operand(code, enumeration, value, frame, *cond)? {
                    Value::Bool(b) => b,
                    _ => return Err(Obstacle::Unsuitable),
                };
                let (chosen, other) = if holds { (then, otherwise) } else { (otherwise, then) };
                if node.state == State::Clean && holds != (node.flags & OTHERWISE == 0) {
                    self.let_go(code, enumeration, frame, *other)?;
                }
                match self.resolve(frame, *chosen) {
                    Some(m) => self.value_of_node(code, enumeration, value, m)?,
                    None => self.value(code, frame, *chosen).clone(),
                }
            }
            // A choice that would appear, or an operation with structure.
            _ => return Err(Obstacle::Unsuitable),
        };
        match place {
            Some(i) => enumeration.values[i].1 = Some(v.clone()),
            None => enumeration.values.push((n, Some(v.clone()))),
        }
        Ok(v)
    }

    fn value_of_index(
        &self,
        code: &Code,
        enumeration: &mut Enumeration,
        value: &Value,
        n: NodeId,
        base: Operand,
        keys: &[Operand],
    ) -> Result<Value, Obstacle> {
        let frame = self.nodes[n as usize].frame;
        let whole = match self.resolve(frame, base) {
            Some(b) => self.value_of_node(code, enumeration, value, b)?,
            None => self.value(code, frame, base).clone(),
        };
        if let Value::Container(r) = whole {
            // The element is the same as before if the keys are.
            let depends = |o: &Operand| {
                self.resolve(frame, *o)
                    .is_some_and(|d| d == enumeration.target || enumeration.knows(d))
            };
            return match self.nodes[n as usize].side.as_deref() {
                Some(Side::Deps(deps))
                    if deps.len() == 1 && deps[0] != r.node + 1 && !keys.iter().any(depends) =>
                {
                    self.value_of_node(code, enumeration, value, deps[0])
                }
                _ => Err(Obstacle::Unsuitable),
            };
        }
        let mut v = whole;
        for k in keys {
            let key = self.value_of_operand(code, enumeration, value, frame, *k)?;
            v = index_value(&v, &key).map_err(|f| self.fail(code, n, f.kind, f.message, f.hint))?;
            if matches!(v, Value::Container(_)) {
                return Err(Obstacle::Unsuitable);
            }
        }
        Ok(v)
    }

    /// Records that a reference to a node would be released, and with the last one
    /// everything that only it holds; fails if a choice would vanish.
    fn let_go(
        &self,
        code: &Code,
        enumeration: &mut Enumeration,
        frame: FrameId,
        o: Operand,
    ) -> Result<(), Obstacle> {
        let mut gone: SmallVec<[NodeId; 8]> = self.resolve(frame, o).into_iter().collect();
        while let Some(n) = gone.pop() {
            let times = match enumeration.released.iter_mut().find(|(m, _)| *m == n) {
                Some((_, times)) => {
                    *times += 1;
                    *times
                }
                None => {
                    enumeration.released.push((n, 1));
                    1
                }
            };
            if times < self.nodes[n as usize].refs {
                continue;
            }
            if !matches!(
                self.op(code, n),
                Op::Prim { .. }
                    | Op::Array(_)
                    | Op::Record { .. }
                    | Op::Index { .. }
                    | Op::Select { .. }
                    | Op::Item
            ) {
                return Err(Obstacle::Unsuitable);
            }
            self.each_dep(code, n, |d, _| gone.push(d));
        }
        Ok(())
    }
}

impl Enumeration {
    fn knows(&self, n: NodeId) -> bool {
        self.values.iter().any(|(m, _)| *m == n) || self.sinks.contains(&n)
    }
}

fn refs(values: &[Value]) -> SmallVec<[&Value; 4]> {
    values.iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Change, Draws};

    /// Local densities do not cover arrays.
    #[test]
    fn weights_through_arrays_are_those_of_updates() {
        let text = "assume k ~ categorical([1, 2, 3]); factor(-sum([k, 1])); observe normal(sum([k, 0.5]), 1) = 1;";
        let mut trace = crate::Model::from_text(text).unwrap().simulate(1, 0).unwrap();
        let target = trace.all_targets()[0];
        let dist = trace.dist(target).unwrap();
        let values = dist.support().finite_values().unwrap();
        let current = values.iter().position(|v| Some(v) == trace.stored(target).as_ref()).unwrap();
        for power in [1.0, 0.3] {
            let (mut enumeration, mut weights) = (Enumeration::default(), Vec::new());
            let put = |w| weights.push(w);
            assert!(
                trace
                    .enumerate_conditional(
                        target,
                        &dist,
                        (&values, current),
                        &mut enumeration,
                        power,
                        put
                    )
                    .unwrap()
            );
            assert_eq!(weights.len(), 3);
            for (value, found) in values.iter().zip(weights) {
                let update = trace
                    .propose(&[(target, Change::Set(value.clone()))], Draws::default())
                    .unwrap();
                trace.rollback();
                assert_eq!(found, Some(update.tempered(power)), "{value:?}");
            }
        }
    }
}
