//! The terms of the log joint density: choices with their distributions, and observations
//! and factors with their scores.

use super::choices::Target;
use super::node::*;
use super::select::{Facts, Selector};
use super::shortcuts::register::Register;
use super::store::Store;
use super::update::Failure;
use crate::lang::address::Address;
use crate::lang::builtins::Scalar;
use crate::lang::code::{DistSpec, Op, Operand};
use crate::lang::density::{self, Score, is_repeated, likelihood_score};
use crate::lang::error::Fault;
use crate::lang::key::Key;
use crate::lang::local_density::PARAMETERS;
use crate::lang::value::Value;
use pcadlang_numerics::dist::{Datum, Dist, Support};
use pcadlang_numerics::num::ExactSum;
use pcadlang_numerics::rng::Stream;
use std::sync::Arc;

impl Store {
    /// True if a selector selects a choice.
    pub fn selects(&self, selector: &Selector, t: &Target) -> bool {
        let mut facts = self.facts(t.node, selector.needs_address(), None);
        if t.element != NONE && selector.needs_address() {
            push_key(&mut facts.address, t.element);
        }
        selector.selects(&facts)
    }

    /// Returns the facts that selectors need about a choice (or an observation, for
    /// `project`).
    pub fn facts(&self, n: NodeId, with_address: bool, dist: Option<&Dist>) -> Facts {
        let made = if dist.is_none() { self.dist_of(n) } else { None };
        let dist = dist.or(made.as_ref());
        let support = dist.map(Dist::stored_support);
        Facts {
            choice: matches!(self.op(n), Op::Draw { .. }),
            address: if with_address { self.address(n) } else { Address::default() },
            tags: self.tags(n),
            discrete: support.as_ref().is_some_and(Support::has_discrete_part),
            finite: support.as_ref().is_some_and(Support::is_finite),
            gaussian: dist.is_some_and(Dist::is_gaussian),
        }
    }

    /// Returns the distribution of a choice under the current values of its parameters.
    pub fn dist_of(&self, n: NodeId) -> Option<Dist> {
        let Op::Draw { dist, .. } = self.op(n) else { return None };
        if let Some(simple) = self.simple_dist(n) {
            return Some(simple);
        }
        self.make_dist(n, dist).ok()
    }

    fn tags(&self, n: NodeId) -> Vec<(Arc<str>, Option<Key>)> {
        let mut tags = Vec::new();
        let mut node = n;
        loop {
            let frame = self[node].frame;
            let (Op::Draw { site, .. }
            | Op::Call { site, .. }
            | Op::Map { site, .. }
            | Op::Fold { site, .. }
            | Op::Mem { site, .. }) = self.op(node)
            else {
                let owner = self[frame].owner;
                if owner == NodeId::NONE {
                    return tags;
                }
                node = owner;
                continue;
            };
            for t in &self.code.sites[*site].tags {
                let value = t.value.and_then(|o| Key::from_value(self.value(frame, o)));
                tags.push((Arc::clone(&self.code.tags[t.name as usize]), value));
            }
            match self[frame].owner {
                NodeId::NONE => return tags,
                owner => node = owner,
            }
        }
    }

    /// True if a stale choice may get another value without being a target: a whitened
    /// one moves with its distribution, and one whose key, length or kind changes is
    /// resampled.
    pub fn may_be_redrawn(&self, n: NodeId) -> bool {
        let node = &self[n];
        let Op::Draw { dist, keys, .. } = self.op(n) else { return false };
        let stale = |o: &Operand| {
            self.resolve(node.frame, *o).is_some_and(|k| matches!(self[k].state, State::Stale))
        };
        let whole = matches!(node.side.as_deref(), Some(Side::Choice(c)) if c.stored.is_some() || c.elements != NONE);
        whole
            || matches!(dist, DistSpec::Value(_))
            || !matches!(node.value, Value::Num(_) | Value::Bool(_))
            || keys.iter().any(stale)
    }

    /// Returns the address hash of a keyed choice.
    pub fn own_hash(&self, n: NodeId) -> Option<u64> {
        self.choice_of(n)?.hash
    }

    /// Returns the distribution of a draw or observation whose parameters are evaluated.
    pub(crate) fn make_dist(&self, n: NodeId, spec: &DistSpec) -> Result<Dist, Failure> {
        self.dist_now(n, spec, &mut Deps::new())
            .unwrap_or_else(|_| Err(self.type_error(n, "its parameters are not evaluated".into())))
    }

    /// Returns the distribution of a draw or observation, or else the node to wait for.
    pub(crate) fn dist_now(
        &self,
        n: NodeId,
        spec: &DistSpec,
        deps: &mut Deps,
    ) -> Result<Result<Dist, Failure>, NodeId> {
        let values = self.inputs(self[n].frame, spec.operands(), deps)?;
        Ok(self.dist_of_values(n, spec, &values))
    }

    /// Returns the distribution with these parameters.
    pub(crate) fn dist_of_values(
        &self,
        n: NodeId,
        spec: &DistSpec,
        values: &[&Value],
    ) -> Result<Dist, Failure> {
        let made = match spec {
            DistSpec::Family { builtin, .. } => {
                self.code.builtins.get(*builtin).distribution(values)
            }
            DistSpec::Value(_) => match values[0] {
                Value::Dist(d) => Ok(Dist::clone(d)),
                Value::Likelihood(l) => {
                    let message =
                        format!("`{}` is a likelihood: it can be observed, not drawn", l.name());
                    Err(Fault::type_error(message))
                }
                v => Err(Fault::type_error(format!(
                    "`~` needs a distribution, got {}",
                    v.type_name()
                ))
                .with_hint("write `=` to bind a value")),
            },
        };
        made.map_err(|f| self.fault(n, f))
    }

    /// Returns the hash of a choice's address.
    pub(crate) fn choice_hash(&self, n: NodeId) -> u64 {
        match (self.own_hash(n), self.op(n)) {
            (Some(hash), _) => hash,
            (None, Op::Draw { site, .. }) => self.site_hash(self[n].frame, *site),
            _ => 0,
        }
    }

    /// Returns the stored form of a choice.
    pub(crate) fn stored(&self, n: NodeId) -> Option<Datum> {
        let stored = self.choice_of(n).and_then(|c| c.stored.clone());
        stored.or_else(|| self[n].value.to_datum())
    }

    /// Returns the stored form of a choice as a value of the language.
    pub(crate) fn stored_value(&self, n: NodeId) -> Value {
        let stored = self.choice_of(n).and_then(|c| c.stored.as_ref());
        stored.map_or_else(|| self[n].value.clone(), Value::from_datum)
    }

    pub(crate) fn is_whitened(&self, n: NodeId) -> bool {
        self.choice_of(n).is_some_and(|c| c.stored.is_some())
    }

    /// Scores an observation, or returns the node to wait for.
    pub fn observation_score(
        &self,
        n: NodeId,
        spec: &DistSpec,
        value: Operand,
        deps: &mut Deps,
    ) -> Result<Result<Score, Failure>, NodeId> {
        let values = self.inputs(self[n].frame, spec.operands(), deps)?;
        let observed = match self.replaced(n) {
            Some(v) => v,
            None => self.input(self[n].frame, value, deps)?,
        };
        Ok(self.score_of_values(n, spec, &values, observed))
    }

    /// Returns the score of an observation with these parameters.
    pub(crate) fn score_of_values(
        &self,
        n: NodeId,
        spec: &DistSpec,
        values: &[&Value],
        observed: &Value,
    ) -> Result<Score, Failure> {
        if let DistSpec::Value(_) = spec {
            match values[0] {
                Value::Dist(_) => {}
                v @ Value::Likelihood(_) => {
                    return likelihood_score(v, observed)
                        .map(Score::One)
                        .map_err(|f| self.fault(n, f));
                }
                v => {
                    let message = format!(
                        "`observe` needs a distribution or likelihood, got {}",
                        v.type_name()
                    );
                    return Err(self.type_error(n, message));
                }
            }
        }
        if let Some(score) = self.score_of_number(spec, values, observed) {
            return Ok(Score::One(score));
        }
        let dist = self.dist_of_values(n, spec, values)?;
        density::score(&dist, observed).map_err(|f| self.fault(n, f))
    }

    /// Returns the log density of a number, without making the distribution, if its parameters
    /// are numbers.
    fn score_of_number(&self, spec: &DistSpec, values: &[&Value], observed: &Value) -> Option<f64> {
        let (DistSpec::Family { builtin, .. }, Value::Num(x)) = (spec, observed) else {
            return None;
        };
        let builtin = self.code.builtins.get(*builtin);
        let Some(Scalar::Family(family)) = builtin.scalar.filter(|_| !x.is_nan()) else {
            return None;
        };
        let mut space = [0.0; PARAMETERS];
        let numbers = space.get_mut(..values.len())?;
        for ((to, from), arg) in numbers.iter_mut().zip(values).zip(&*builtin.args) {
            *to = Register::of(from).number_or_default(arg)?;
        }
        (family.log_density)(numbers, *x)
    }

    /// Adds an observation's or factor's score to a sum.
    pub(crate) fn put_score(&self, n: NodeId, to: &mut ExactSum) {
        let node = &self[n];
        match node.side.as_deref() {
            Some(Side::Total(t)) if node.score == 0.0 => to.merge(&t.sum),
            _ => to.add(node.score),
        }
    }

    /// Adds the score of a choice to one sum, that of an observation or factor to the other.
    pub(crate) fn put_scored(&self, n: NodeId, prior: &mut ExactSum, likelihood: &mut ExactSum) {
        let node = &self[n];
        match (self.op(n), node.side.as_deref()) {
            (Op::Draw { .. }, Some(Side::Choice(c))) if c.elements != NONE => {
                c.scores.iter().for_each(|s| prior.add(*s));
            }
            (Op::Draw { .. }, _) => prior.add(node.score),
            _ => self.put_score(n, likelihood),
        }
    }

    /// Subtracts an observation's or factor's score from a sum.
    pub(crate) fn take_score(&self, n: NodeId, from: &mut ExactSum) {
        let node = &self[n];
        match node.side.as_deref() {
            Some(Side::Total(t)) if node.score == 0.0 => from.unmerge(&t.sum),
            _ => from.sub(node.score),
        }
    }

    /// Undoes the replacement of an observed value.
    pub(super) fn undo_observed(&mut self, hash: u64, old: Option<Value>) {
        let all = Arc::make_mut(&mut self.observed);
        match old {
            Some(v) => all.insert(hash, v),
            None => all.remove(&hash),
        };
    }

    /// Returns the hash of the address of an observation.
    pub fn observation_hash(&self, n: NodeId) -> Option<u64> {
        let Op::Observe { site, .. } = self.op(n) else { return None };
        Some(self.site_hash(self[n].frame, *site))
    }

    /// Returns the value that replaces an observation's value in the program, if any.
    pub(crate) fn replaced(&self, n: NodeId) -> Option<&Value> {
        if self.observed.is_empty() {
            return None;
        }
        self.observed.get(&self.observation_hash(n)?)
    }

    /// Returns the value of an observation.
    pub(crate) fn observed_value(&self, n: NodeId) -> &Value {
        match (self.replaced(n), self.op(n)) {
            (Some(v), _) => v,
            (None, Op::Observe { value, .. }) => {
                self.plain(self[n].frame, *value, &mut Deps::new())
            }
            _ => &Value::Unit,
        }
    }

    /// Returns a message if the observed value is outside the support of its distribution
    /// under the current parameters, so that its probability is zero.
    pub(super) fn outside_support(&self, n: NodeId) -> Option<String> {
        let Op::Observe { dist: spec, .. } = self.op(n) else { return None };
        let frame = self[n].frame;
        let observed = self.observed_value(n);
        if let DistSpec::Value(o) = spec
            && !matches!(self.value(frame, *o), Value::Dist(_))
        {
            return None;
        }
        let dist = self.make_dist(n, spec).ok()?;
        let count =
            dist.elements().or_else(|| observed.len().filter(|_| is_repeated(&dist, observed)));
        let Some(count) = count else { return outside(&dist, observed) };
        (0..count).find_map(|i| outside(&dist.element(i), &observed.element(i)?))
    }

    /// Samples an observation, or describes why it cannot be sampled.
    pub fn draw_observed(
        &self,
        n: NodeId,
        rng: &mut Stream,
    ) -> Result<Result<Value, String>, Failure> {
        let frame = self[n].frame;
        let Op::Observe { dist: spec, .. } = self.op(n) else {
            return Ok(Err("a factor".into()));
        };
        let observed = self.observed_value(n);
        if let DistSpec::Value(o) = spec
            && let Value::Likelihood(l) = self.value(frame, *o)
        {
            return match l.sample(observed, rng) {
                Some(drawn) => drawn.map(Ok).map_err(|f| self.fault(n, f)),
                None => Ok(Err(format!("the likelihood `{}`", l.name()))),
            };
        }
        let dist = self.make_dist(n, spec)?;
        if dist.is_improper() {
            return Ok(Err(format!("the improper distribution `{}`", dist.name())));
        }
        Ok(Ok(sample_like(&dist, observed, rng)))
    }
}

/// Returns a message if a value is outside the support of a distribution.
fn outside(dist: &Dist, observed: &Value) -> Option<String> {
    let x = observed.to_datum()?;
    let support = dist.support();
    let is_truth = support == Support::Boolean && matches!(x, Datum::Num(0.0 | 1.0));
    let apart = || {
        format!(
            "the observed value {observed} is outside the support of `{}` ({support})",
            dist.name()
        )
    };
    (!is_truth && !support.contains(&x)).then(apart)
}

/// Samples in the form in which a value is scored: element by element if the distribution
/// is over less than the whole value.
fn sample_like(dist: &Dist, observed: &Value, rng: &mut Stream) -> Value {
    let mut one = |d: &Dist| Value::from_datum(&d.sample(rng));
    if let Some(count) = dist.elements() {
        return Value::from_elements((0..count).map(|i| one(&dist.element(i))).collect());
    }
    match observed {
        Value::Array(xs) if is_repeated(dist, observed) => {
            Value::from_elements(xs.iter().map(|_| one(dist)).collect())
        }
        Value::List(_) if observed.to_datum().is_some_and(|x| dist.support().fits(&x)) => one(dist),
        Value::List(xs) => Value::from_elements(xs.iter().map(|_| one(dist)).collect()),
        _ => one(dist),
    }
}

pub(crate) fn push_key(address: &mut Address, element: u32) {
    if let Some(last) = address.segments.last_mut() {
        last.keys.push(Key::Num(f64::from(element).to_bits()));
    }
}

pub(crate) fn pop_key(address: &mut Address) {
    if let Some(last) = address.segments.last_mut() {
        last.keys.pop();
    }
}
