//! `abc(move, eps)`: approximate Bayesian computation by Markov chain Monte Carlo (Marjoram et al. 2003).
//!
//! The kernel inside proposes as if nothing were observed; then everything observed is drawn anew from its own distribution, and
//! the proposal stays if what was drawn is near enough to what is observed. The densities of the
//! observations play no part. The chain draws from the prior given that simulated data come within `eps`: the posterior, as `eps` goes to 0.
//! The distance is the root mean square of the differences between the observed numbers and the drawn ones.

use crate::infer::kernel::{At, Kernel, Outcome};
use crate::infer::selection::fail;
use crate::lang::value::Value;
use crate::syntax::span::Span;
use crate::trace::{Draws, Trace, TraceResult};

/// Likelihood-free Metropolis-Hastings around a kernel that leaves the prior invariant and is reversible.
pub struct Abc {
    kernel: Box<dyn Kernel>,
    eps: f64,
    /// The distance at which the present state was accepted: above `eps` until a state comes near enough.
    distance: f64,
    span: Span,
}

impl Abc {
    /// A kernel and the largest distance. `span` is where errors point.
    pub fn new(kernel: Box<dyn Kernel>, eps: f64, span: Span) -> Self {
        Abc { kernel, eps, distance: f64::INFINITY, span }
    }

    /// How far data drawn in this state are from those observed.
    fn simulate(&self, trace: &Trace, draws: Draws) -> TraceResult<f64> {
        let replicate = trace.replicate(draws)?;
        if let Some((address, what)) = replicate.silent.first() {
            return Err(fail(self.span, format!("abc draws all that is observed, and {address} is {what}")));
        }
        let observed = trace.observed();
        let (mut squares, mut count) = (0.0, 0.0);
        for o in &observed {
            let Some((_, drawn)) = replicate.values.iter().find(|(hash, _)| *hash == o.hash) else { continue };
            let (mut a, mut b) = (Vec::new(), Vec::new());
            if !numbers(&o.value, &mut a) || !numbers(drawn, &mut b) || a.len() != b.len() {
                return Err(fail(
                    self.span,
                    format!("abc compares numbers, and {} is {}", o.address, o.value.type_name()),
                ));
            }
            squares += a.iter().zip(&b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            count += a.len() as f64;
        }
        let distance = (squares / f64::max(count, 1.0)).sqrt();
        Ok(if distance.is_nan() { f64::INFINITY } else { distance })
    }
}

/// The numbers in a value; false if there is anything else in it.
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

    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome> {
        if self.kernel.sweep(trace).is_some() {
            return Err(fail(self.span, "abc takes a kernel of one step, without each(…)".into()));
        }
        let before = trace.constraints();
        let inner = self.kernel.step(trace, &At { power: 0.0, ..at.within(0) })?;
        if inner.accepted == 0 && self.distance <= self.eps {
            return Ok(Outcome::one(false));
        }
        let distance = self.simulate(trace, at.within(1).draws(0))?;
        // Until a state is near enough, any that is nearer will do.
        let near = distance <= self.eps.max(if self.distance > self.eps { self.distance } else { 0.0 });
        if near {
            self.distance = distance;
        } else {
            trace.restore(&before, at.within(2).draws(0))?;
        }
        Ok(Outcome { accepted: u32::from(near), proposals: 1, ..inner })
    }
}
