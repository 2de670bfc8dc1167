//! `abc(move, eps)`: approximate Bayesian computation by Markov chain Monte Carlo
//! (Marjoram et al. 2003).
//!
//! The inner kernel proposes as if nothing were observed. Then all observations are
//! redrawn from their own distributions, and the proposal is accepted if the simulated
//! data are close enough to the observed data. The densities of the observations play no
//! part. The chain draws from the prior given that simulated data come within `eps` of
//! the observed data: the posterior, as `eps` goes to 0. The distance is the root mean
//! square of the differences between the observed and the simulated numbers.

use super::row::{Built, INNER, KernelRow, Type, arg, number};
use crate::calls::error::fail;
use crate::kernel::{Kernel, Outcome, StepContext};
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::lang::code::Observed;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace, TraceResult};
use pcadlang_syntax::span::Span;
use std::sync::Arc;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "abc",
    &[INNER, arg("eps", Type::Num, "The tolerance: the largest accepted distance.")],
    "Approximate Bayesian computation (likelihood-free): the inner kernel targets the prior, \
     and a proposal is accepted if data simulated from it are within `eps` of the observed \
     data in root mean square (Marjoram et al. 2003).",
    number!("infer { repeat 100 { abc(block(@**), eps = 0.5); collect x; } }"),
    |call| {
        let inner = call.inner()?;
        let eps = call.positive_if_given("eps")?.unwrap_or(f64::INFINITY);
        let signature = format!("abc({}, {eps})", inner.signature);
        Ok(Built::new(Abc::new(inner.kernel, eps, call.span()), signature))
    },
)
.irreversible();

/// Likelihood-free Metropolis-Hastings with a reversible inner kernel that leaves the
/// prior invariant.
pub struct Abc {
    kernel: Box<dyn Kernel>,
    eps: f64,
    /// The distance at which the present state was accepted. It is above `eps` until a
    /// state comes close enough.
    distance: f64,
    /// The data that it is a distance from.
    observed: Option<Arc<Observed>>,
    /// True if the distance comes from a checkpoint; it then refers to the data that the
    /// trace observes at the next step.
    loaded: bool,
    span: Span,
}

impl Abc {
    /// `kernel` is the inner kernel, `eps` the largest distance; `span` is the position
    /// that errors refer to.
    pub fn new(kernel: Box<dyn Kernel>, eps: f64, span: Span) -> Self {
        Abc { kernel, eps, distance: f64::INFINITY, observed: None, loaded: false, span }
    }
}

/// Returns the distance between data simulated in this state and the observed data.
fn simulate(trace: &Trace, draws: Draws, span: Span) -> TraceResult<f64> {
    let replicate = trace.replicate(draws)?;
    if let Some((address, what)) = replicate.silent.first() {
        return Err(fail(
            span,
            format!(
                "abc simulates all observations, but {address} is {what}, which has no sampler"
            ),
        ));
    }
    let observed = trace.observed();
    let (mut squares, mut count) = (0.0, 0.0);
    for o in &observed {
        let Some((_, drawn)) = replicate.values.iter().find(|(hash, _)| *hash == o.hash) else {
            continue;
        };
        let (mut a, mut b) = (Vec::new(), Vec::new());
        if !numbers(&o.value, &mut a) || !numbers(drawn, &mut b) || a.len() != b.len() {
            return Err(fail(
                span,
                format!("abc compares numbers, but {} is {}", o.address, o.value.type_name()),
            ));
        }
        squares += a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        count += a.len() as f64;
    }
    let distance = (squares / f64::max(count, 1.0)).sqrt();
    Ok(if distance.is_nan() { f64::INFINITY } else { distance })
}

/// Collects the numbers in a value; false if it contains anything else.
fn numbers(v: &Value, out: &mut Vec<f64>) -> bool {
    match v {
        Value::Num(x) => out.push(*x),
        Value::Bool(b) => out.push(f64::from(u8::from(*b))),
        Value::Array(xs) => out.extend(xs.iter()),
        Value::List(xs) => return xs.iter().all(|x| numbers(x, out)),
        _ => return false,
    }
    true
}

impl Kernel for Abc {
    fn name(&self) -> String {
        "abc".into()
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        pack(&(self.kernel.save(trace), self.distance, self.loaded || self.observed.is_some()))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let inner: Vec<u8>;
        (inner, self.distance, self.loaded) = unpack(state)?;
        self.observed = None;
        self.kernel.load(&inner)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        if std::mem::take(&mut self.loaded) {
            self.observed = Some(Arc::clone(trace.replacements()));
        }
        let same = self.observed.as_ref().is_some_and(|o| Arc::ptr_eq(o, trace.replacements()));
        if !same {
            // The distance refers to other data.
            trace.rollback();
            self.distance = match self.observed {
                Some(_) => simulate(trace, at.within(3).draws(0), self.span)?,
                None => f64::INFINITY,
            };
            self.observed = Some(Arc::clone(trace.replacements()));
        }
        if self.kernel.sweep(trace, None).is_some() {
            let message = "abc takes a kernel that makes a single step, not each(…)";
            return Err(fail(self.span, message.into()));
        }
        // Until a state is close enough, any closer one is accepted.
        let eps = if self.distance > self.eps { self.distance } else { self.eps };
        let before = trace.constraints();
        let inner = self.kernel.step(trace, &StepContext { power: 0.0, ..at.within(0) })?;
        if inner.accepted == 0 && self.distance <= eps {
            return Ok(Outcome::one(false));
        }
        let new = simulate(trace, at.within(1).draws(0), self.span)?;
        let near = new <= eps;
        if near {
            self.distance = new;
        } else {
            trace.restore(&before, at.within(2).draws(0))?;
        }
        Ok(Outcome { accepted: u32::from(near), proposals: 1, ..inner })
    }
}
