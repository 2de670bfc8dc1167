//! Elliptical slice sampling (Murray, Adams & MacKay 2010, figure 2) of choices with
//! Gaussian priors.
//!
//! The kernel works on the white noise of the choices, so that any mean and covariance
//! are supported, also those that depend on choices of the same block. Points at which
//! choices appear or vanish count as outside the slice: the kernel moves within the
//! present structure, and leaves the posterior given that structure invariant.

use super::row::{KernelRow, SEL, number};
use crate::kernel::{Kernel, Outcome, Registered, SiteSelection, StepContext, recoverable};
use pcadlang_engine::lang::error::{FaultKind, RunError};
use pcadlang_engine::trace::{Change, Target, Trace, TraceResult};
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::rng::Stream;
use std::f64::consts::TAU;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "elliptical",
    &[SEL],
    "Elliptical slice sampling of choices with a Gaussian prior: normal, mv_normal, gp \
     (Murray et al. 2010).",
    number!("infer { repeat 100 { elliptical(@x); collect x; } }"),
    |call| call.moving(|scope, _| Ok(Elliptical::new(scope))),
);

/// After this many shrinkage steps the bracket is narrower than the floating-point
/// resolution.
const MAX_SHRINKS: u32 = 200;

/// `elliptical(sel)`: slice sampling along an ellipse through the state and a draw from
/// the prior.
#[derive(Clone, Debug)]
pub struct Elliptical {
    scope: Registered,
}

impl Elliptical {
    /// A kernel for these choices.
    pub fn new(scope: SiteSelection) -> Self {
        Elliptical { scope: Registered::new(scope) }
    }
}

/// The white noise that determines a choice.
fn noise(trace: &Trace, t: Target) -> Option<Vec<f64>> {
    let dist = trace.dist(t)?;
    let stored = trace.stored(t)?;
    match (dist.is_stored_whitened(), stored) {
        (true, Datum::Vec(z)) => Some(z.to_vec()),
        (_, x) => dist.whiten(&x),
    }
}

impl Kernel for Elliptical {
    fn name(&self) -> String {
        "elliptical".into()
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, _) = self.scope.members(trace, &mut rng);
        if targets.is_empty() {
            return Ok(Outcome::default());
        }
        let mut here = Vec::with_capacity(targets.len());
        for t in &targets {
            here.push(noise(trace, *t).ok_or_else(|| not_gaussian(trace, *t))?);
        }
        let there: Vec<Vec<f64>> =
            here.iter().map(|z| z.iter().map(|_| rng.standard_normal()).collect()).collect();
        let threshold = libm::log(rng.open_uniform());
        let mut angle = rng.uniform() * TAU;
        let (mut low, mut high) = (angle - TAU, angle);
        let mut outcome = Outcome::default();
        for _ in 0..MAX_SHRINKS {
            outcome.proposals += 1;
            let changes = point(&targets, &here, &there, angle);
            match recoverable(trace.propose(&changes, at.draws(0)))? {
                Some(w) if w.appeared == 0 && w.vanished == 0 && at.tempered(&w) > threshold => {
                    trace.commit();
                    outcome.accepted = 1;
                    outcome.proposals = 1;
                    return Ok(outcome);
                }
                Some(_) => {}
                None => outcome.failed += 1,
            }
            if angle < 0.0 {
                low = angle;
            } else {
                high = angle;
            }
            angle = shrink(low, high, &mut rng);
        }
        trace.rollback();
        outcome.proposals = 1;
        Ok(outcome)
    }
}

fn shrink(low: f64, high: f64, rng: &mut Stream) -> f64 {
    low + (high - low) * rng.uniform()
}

fn point(
    targets: &[Target],
    here: &[Vec<f64>],
    there: &[Vec<f64>],
    angle: f64,
) -> Vec<(Target, Change)> {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let mix =
        |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| a * cos + b * sin).collect();
    targets
        .iter()
        .zip(here.iter().zip(there))
        .map(|(t, (a, b))| (*t, Change::White(mix(a, b))))
        .collect()
}

fn not_gaussian(trace: &Trace, t: Target) -> Box<RunError> {
    let name = trace.dist(t).map_or("unknown".to_owned(), |d| d.name().to_owned());
    Box::new(RunError {
        kind: FaultKind::Type,
        message: format!("elliptical: the prior of {} is {name}, not Gaussian", trace.address(t)),
        span: Default::default(),
        address: trace.address(t),
        calls: Vec::new(),
        hint: Some("select normal, mv_normal and gp choices only, e.g. with & $gaussian".into()),
    })
}
