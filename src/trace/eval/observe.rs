//! Observations and factors: what conditions the trace.

use crate::dist::{Datum, Dist};
use crate::lang::code::{Code, DistSpec, Op, Operand};
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;
use crate::num::ExactSum;
use crate::trace::demand::{Failure, Step};
use crate::trace::graph::Graph;
use crate::trace::journal::Entry;
use crate::trace::node::*;

/// The score of an observation.
pub(crate) enum Score {
    /// One term.
    One(f64),
    /// One an element.
    Sum(ExactSum),
}

impl Graph {
    pub(super) fn evaluate_observe(
        &mut self,
        code: &Code,
        n: NodeId,
        spec: &DistSpec,
        value: Operand,
    ) -> Result<Step, Failure> {
        let frame = self.nodes[n as usize].frame;
        let mut deps = Deps::new();
        let score = match self.observation_score(code, n, frame, spec, value, &mut deps) {
            Ok(score) => score?,
            Err(m) => return self.need(code, m),
        };
        let stale = self.nodes[n as usize].flags & WAS_STALE != 0;
        if stale {
            self.retire_score(n);
        }
        match score {
            Score::One(score) => {
                self.likelihood.add(score);
                self.nodes[n as usize].score = score;
                if matches!(self.nodes[n as usize].side.as_deref(), Some(Side::Total(_))) || !deps.is_empty() {
                    self.set_total(n, ExactSum::default());
                }
            }
            Score::Sum(sum) => {
                self.likelihood.merge(&sum);
                self.nodes[n as usize].score = 0.0;
                self.set_total(n, sum);
            }
        }
        self.set_deps(n, deps);
        self.nodes[n as usize].flags &= !TARGET;
        Ok(self.finish(code, n, Value::Unit))
    }

    /// Keeps the total of an observation's elements.
    fn set_total(&mut self, n: NodeId, sum: ExactSum) {
        match self.nodes[n as usize].side.as_deref_mut() {
            Some(Side::Total(t)) => {
                let old = std::mem::replace(&mut t.sum, sum);
                self.journal.push(Entry::Sum(n, old));
            }
            _ => self.set_side(n, Some(Side::Total(Total { sum, deps: Deps::new() }))),
        }
    }

    /// Scores an observation, or tells the node to wait for.
    fn observation_score(
        &self,
        code: &Code,
        n: NodeId,
        frame: FrameId,
        spec: &DistSpec,
        value: Operand,
        deps: &mut Deps,
    ) -> Result<Result<Score, Failure>, NodeId> {
        let values = self.inputs(code, frame, spec.operands(), deps)?;
        let observed = match self.replaced(code, n) {
            Some(v) => v,
            None => self.inputs(code, frame, &[value], deps)?[0],
        };
        Ok(self.score_of_values(code, n, spec, &values, observed))
    }

    /// The score of an observation with these parameters.
    pub(crate) fn score_of_values(
        &self,
        code: &Code,
        n: NodeId,
        spec: &DistSpec,
        values: &[&Value],
        observed: &Value,
    ) -> Result<Score, Failure> {
        if let DistSpec::Value(_) = spec {
            match values[0] {
                Value::Dist(_) => {}
                v @ Value::Likelihood(_) => {
                    return likelihood_score(v, observed).map(Score::One).map_err(|f| self.fault(code, n, f));
                }
                v => {
                    let message = format!("`observe` needs a distribution or likelihood, got {}", v.type_name());
                    return Err(self.type_error(code, n, message));
                }
            }
        }
        let dist = self.dist_of_values(code, n, spec, values)?;
        score_value(&dist, observed).map_err(|f| self.fault(code, n, f))
    }

    /// The log density of an observation's coarse surrogate: never part of the joint.
    pub(crate) fn surrogate_score(&mut self, code: &Code, n: NodeId) -> Result<Option<f64>, Failure> {
        let frame = self.nodes[n as usize].frame;
        let Op::Observe { value, coarse: Some(coarse), .. } = self.op(code, n) else { return Ok(None) };
        for o in [*value, *coarse] {
            if let Some(m) = self.unready(frame, o) {
                self.demand(code, m)?;
            }
        }
        let observed = match self.replaced(code, n) {
            Some(v) => v,
            None => self.value(code, frame, *value),
        };
        let score = match self.value(code, frame, *coarse) {
            v @ Value::Likelihood(_) => likelihood_score(v, observed),
            Value::Dist(d) => score_value(d, observed).map(|s| match s {
                Score::One(x) => x,
                Score::Sum(s) => s.value(),
            }),
            v => Err(Fault::type_error(format!(
                "`with coarse` needs a distribution or likelihood, got {}",
                v.type_name()
            ))),
        };
        score.map(Some).map_err(|f| self.fault(code, n, f))
    }

    pub(super) fn evaluate_factor(&mut self, code: &Code, n: NodeId, weight: Operand) -> Result<Step, Failure> {
        let frame = self.nodes[n as usize].frame;
        if let Some(m) = self.unready(frame, weight) {
            return self.need(code, m);
        }
        let score = match self.value(code, frame, weight) {
            Value::Num(w) if w.is_nan() => {
                return Err(self.fail(code, n, FaultKind::Domain, "the log weight is not a number".into(), None));
            }
            Value::Num(w) => *w,
            v => {
                let message = format!("`factor` needs a log weight, a number; got {}", v.type_name());
                return Err(self.type_error(code, n, message));
            }
        };
        if self.nodes[n as usize].flags & WAS_STALE != 0 {
            self.retire_score(n);
        }
        self.likelihood.add(score);
        self.nodes[n as usize].score = score;
        Ok(self.finish(code, n, Value::Unit))
    }

    /// Takes an observation's or factor's score back.
    pub(crate) fn retire_score(&mut self, n: NodeId) {
        let mut likelihood = std::mem::take(&mut self.likelihood);
        self.take_score(n, &mut likelihood);
        self.likelihood = likelihood;
    }

    /// Adds an observation's or factor's score to a sum.
    pub(crate) fn put_score(&self, n: NodeId, to: &mut ExactSum) {
        let node = &self.nodes[n as usize];
        match node.side.as_deref() {
            Some(Side::Total(t)) if node.score == 0.0 => to.merge(&t.sum),
            _ => to.add(node.score),
        }
    }

    /// Takes an observation's or factor's score out of a sum.
    pub(crate) fn take_score(&self, n: NodeId, from: &mut ExactSum) {
        let node = &self.nodes[n as usize];
        match node.side.as_deref() {
            Some(Side::Total(t)) if node.score == 0.0 => from.unmerge(&t.sum),
            _ => from.sub(node.score),
        }
    }
}

fn likelihood_score(v: &Value, observed: &Value) -> Result<f64, Fault> {
    let Value::Likelihood(l) = v else { return Err(Fault::type_error("not a likelihood")) };
    let score = l.log_density(observed).map_err(Fault::type_error)?;
    if score.is_nan() {
        return Err(Fault::domain(format!("the likelihood `{}` is not a number here", l.name())));
    }
    Ok(score)
}

/// Scores a value, element by element where the distribution is over single numbers and the value is an array.
fn score_value(dist: &Dist, observed: &Value) -> Result<Score, Fault> {
    let wrong = || Fault::type_error(format!("`{}` cannot be observed to be {}", dist.name(), observed.type_name()));
    if let Some(count) = dist.elements() {
        if observed.len() != Some(count) {
            let got = observed.len().map_or(observed.type_name().to_owned(), |l| format!("{l} values"));
            return Err(Fault::type_error(format!("the distribution has {count} elements, but {got} are observed")));
        }
        return sum_scores(count, |i| {
            let x = observed.element(i).as_ref().and_then(Value::to_datum).ok_or_else(wrong)?;
            if matches!(x, Datum::Num(x) if x.is_nan()) {
                return Err(Fault::domain(format!("element {i} of what is observed is not a number")));
            }
            Ok(dist.element_log_density(i, &x))
        });
    }
    let nan = || Fault::domain("the observed value is not a number");
    match observed {
        Value::Num(x) if x.is_nan() => Err(nan()),
        Value::Array(xs) if xs.iter().any(|x| x.is_nan()) => Err(nan()),
        Value::Num(x) => Ok(Score::One(dist.log_density(&Datum::Num(*x)))),
        Value::Bool(b) => Ok(Score::One(dist.log_density(&Datum::Bool(*b)))),
        Value::Array(xs) if dist.is_scalar() => sum_scores(xs.len(), |i| Ok(dist.log_density(&Datum::Num(xs[i])))),
        Value::List(_) if observed.to_datum().is_some_and(|x| dist.support().fits(&x)) => {
            let x = observed.to_datum().ok_or_else(wrong)?;
            Ok(Score::One(dist.log_density(&x)))
        }
        Value::List(xs) => sum_scores(xs.len(), |i| xs[i].to_datum().map(|x| dist.log_density(&x)).ok_or_else(wrong)),
        Value::Array(xs) => Ok(Score::One(dist.log_density(&Datum::Vec(std::sync::Arc::clone(xs))))),
        _ => Err(wrong()),
    }
}

fn sum_scores(count: usize, mut score: impl FnMut(usize) -> Result<f64, Fault>) -> Result<Score, Fault> {
    let mut sum = ExactSum::default();
    for i in 0..count {
        sum.add(score(i)?);
    }
    Ok(Score::Sum(sum))
}
