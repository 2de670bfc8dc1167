//! Warm-up of Hamiltonian kernels: dual averaging of the step size (Hoffman & Gelman
//! 2014, section 3.2), and a diagonal metric from windows that double in length, as in
//! Stan. The metric is the geometric mean of the variances of the states and the inverse
//! variances of the forces there, which minimises the Fisher divergence among diagonal
//! ones (Seyboldt, Carlson & Carpenter 2026), as in nutpie.

use super::point::Point;
use super::system::System;
use crate::infer::state::{StateError, holds};
use crate::rng::Stream;
use crate::trace::TraceResult;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The constants of dual averaging, as in Stan.
const GAMMA: f64 = 0.05;
const T0: f64 = 10.0;
const KAPPA: f64 = 0.75;

/// The logarithms of the smallest and largest adapted step size.
const SHORTEST: f64 = -350.0;
const LONGEST: f64 = 10.0;

/// Bounds on the search for the first step size: a flat density has no step that is too
/// long, so doublings are limited.
const DOUBLINGS: u32 = 40;
const HALVINGS: u32 = 400;

/// The largest inverse mass; the smallest is one over it. Squares of momenta and of velocities
/// then are finite.
const LIGHTEST: f64 = 1e140;

/// The number of initial states that are excluded from the variances, and the length of
/// the first window.
const BURN: u32 = 30;
const WINDOW: u32 = 25;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Adaptation {
    /// The target acceptance rate.
    target: f64,
    /// What the metric belongs to: addresses and their numbers of coordinates.
    signature: Vec<(u64, usize)>,
    pub inverse_mass: Vec<f64>,
    /// By address, the inverse masses from the last windows. Choices that disappear and
    /// reappear get theirs again, so that after warm-up the metric is a function of the
    /// set of choices.
    learnt: BTreeMap<u64, Vec<f64>>,
    /// A given step size; adapted if `None`.
    fixed: Option<f64>,
    step: f64,
    averaged: f64,
    mean_log: f64,
    bias: f64,
    rounds: f64,
    seen: u32,
    window_end: u32,
    window: u32,
    /// The states of this window and the forces there, by address; choices that disappear
    /// and reappear continue to be counted.
    states: BTreeMap<u64, [Moments; 2]>,
}

/// Means and sums of squares of a choice's coordinates (Welford 1962).
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Moments {
    count: f64,
    mean: Vec<f64>,
    square: Vec<f64>,
}

impl Moments {
    fn add(&mut self, y: &[f64]) {
        if self.mean.len() != y.len() {
            *self = Moments { count: 0.0, mean: vec![0.0; y.len()], square: vec![0.0; y.len()] };
        }
        self.count += 1.0;
        for ((m, s), y) in self.mean.iter_mut().zip(&mut self.square).zip(y) {
            let d = y - *m;
            *m += d / self.count;
            *s += d * (y - *m);
        }
    }

    /// The variances, if there are enough states.
    fn variances(&self) -> Option<impl Iterator<Item = f64>> {
        (self.count >= 3.0).then(|| self.square.iter().map(|s| s / (self.count - 1.0)))
    }
}

/// The inverse masses for these states and the forces there; `None` for too few states. Where
/// the forces do not vary, the states alone count; where the states do not vary either, for
/// instance since every transition was rejected, nothing is learnt and the mass stays.
fn inverse_masses([states, forces]: &[Moments; 2], before: Option<&Vec<f64>>) -> Option<Vec<f64>> {
    let one = |(i, (y, g)): (usize, (f64, f64))| {
        let known = |m: &f64| m.is_finite() && *m > 0.0;
        let found = [(y / g).sqrt(), y].into_iter().find(known);
        let before = || before.and_then(|b| b.get(i)).copied().unwrap_or(1.0);
        found.map_or_else(before, |m| m.clamp(LIGHTEST.recip(), LIGHTEST))
    };
    Some(states.variances()?.zip(forces.variances()?).enumerate().map(one).collect())
}

impl Adaptation {
    pub fn new(target: f64, fixed: Option<f64>) -> Self {
        Adaptation {
            target,
            signature: Vec::new(),
            inverse_mass: Vec::new(),
            learnt: BTreeMap::new(),
            fixed,
            step: 0.0,
            averaged: 0.0,
            mean_log: 0.0,
            bias: 0.0,
            rounds: 0.0,
            seen: 0,
            window_end: BURN + WINDOW,
            window: WINDOW,
            states: BTreeMap::new(),
        }
    }

    /// Restores the state of an adaptation with the same arguments.
    ///
    /// # Errors
    /// If the sizes of its parts are inconsistent.
    pub fn take_up(&mut self, read: Adaptation) -> Result<(), StateError> {
        let n = read.inverse_mass.len();
        let sizes = read.signature.iter().try_fold(0usize, |sum, s| sum.checked_add(s.1));
        let whole = |ms: &[Moments; 2]| ms.iter().all(|m| m.mean.len() == m.square.len());
        holds(sizes == Some(n) && read.states.values().all(whole), "a step size and metric")?;
        *self = Adaptation { target: self.target, fixed: self.fixed, ..read };
        Ok(())
    }

    /// The step size to use now, found by trial if there is none yet.
    pub fn step(
        &mut self,
        system: &mut System,
        here: &Point,
        adapting: bool,
        rng: &mut Stream,
    ) -> TraceResult<f64> {
        if system.signature() != self.signature {
            // Step size and windows continue across changes of structure: if it changed
            // every few steps they would otherwise never adapt.
            self.signature = system.signature().to_vec();
            self.inverse_mass = self.metric();
        }
        if let Some(step) = self.fixed {
            return Ok(step);
        }
        if self.step == 0.0 {
            self.restart(system, here, rng)?;
        }
        Ok(if adapting || self.averaged == 0.0 { self.step } else { self.averaged })
    }

    /// The step size after warm-up, if there is one yet.
    pub fn step_size(&self) -> Option<f64> {
        let learnt = if self.averaged == 0.0 { self.step } else { self.averaged };
        self.fixed.or(Some(learnt)).filter(|s| *s > 0.0)
    }

    /// Adapts to a transition: its mean acceptance probability and its end point.
    pub fn learn(&mut self, acceptance: f64, end: &Point) {
        self.rounds += 1.0;
        let weight = 1.0 / (self.rounds + T0);
        let off = self.target - if acceptance.is_nan() { 0.0 } else { acceptance.min(1.0) };
        self.bias = (1.0 - weight) * self.bias + weight * off;
        let log_step = self.mean_log - self.bias * self.rounds.sqrt() / GAMMA;
        let share = libm::pow(self.rounds, -KAPPA);
        let log_averaged =
            share * log_step + (1.0 - share) * libm::log(self.averaged.max(f64::MIN_POSITIVE));
        self.step = libm::exp(log_step.clamp(SHORTEST, LONGEST));
        self.averaged = if self.rounds == 1.0 {
            self.step
        } else {
            libm::exp(log_averaged.clamp(SHORTEST, LONGEST))
        };
        self.seen = self.seen.saturating_add(1);
        if self.seen > BURN {
            let mut from = 0;
            for (hash, n) in &self.signature {
                let own = from..from + n;
                let lists = [&end.y, &end.gradient].map(|list| list.get(own.clone()));
                let moments = self.states.entry(*hash).or_default();
                moments.iter_mut().zip(lists).for_each(|(m, list)| m.add(list.unwrap_or(&[])));
                from = own.end;
            }
        }
        if self.seen == self.window_end {
            let log_longer = self.close();
            self.window = self.window.saturating_mul(2);
            self.window_end = self.seen.saturating_add(self.window);
            // The step size is searched for again at the next transition, since the new
            // metric may differ from the last by tens of orders of magnitude.
            let log_step = libm::log(self.averaged.max(f64::MIN_POSITIVE)) + log_longer;
            self.averaged = libm::exp(log_step.clamp(SHORTEST, LONGEST));
            (self.bias, self.rounds, self.step) = (0.0, 0.0, 0.0);
        }
    }

    /// Ends a window: it gives the metric of the choices that it saw often enough. Returns
    /// the log of the factor by which a step has to grow to stay as long as it was, in the
    /// geometric mean over all coordinates.
    fn close(&mut self) -> f64 {
        for (hash, moments) in std::mem::take(&mut self.states) {
            let before = self.learnt.get(&hash);
            if let Some(masses) = inverse_masses(&moments, before) {
                self.learnt.insert(hash, masses);
            }
        }
        let metric = self.metric();
        let before = std::mem::replace(&mut self.inverse_mass, metric);
        let pairs = before.iter().zip(&self.inverse_mass);
        let sum: f64 = pairs.map(|(old, new)| 0.5 * (libm::log(*old) - libm::log(*new))).sum();
        sum / before.len().max(1) as f64
    }

    /// The inverse masses of the present choices: those of previous windows, or 1 for
    /// choices without.
    fn metric(&self) -> Vec<f64> {
        let known =
            |(hash, n): &(u64, usize)| self.learnt.get(hash).filter(|m| m.len() == *n).cloned();
        self.signature.iter().flat_map(|s| known(s).unwrap_or_else(|| vec![1.0; s.1])).collect()
    }

    /// Doubles or halves the step size until the acceptance probability of one leapfrog
    /// step crosses 0.8 (algorithm 4, with Stan's bound).
    fn restart(&mut self, system: &mut System, here: &Point, rng: &mut Stream) -> TraceResult<()> {
        let mut step = if self.averaged > 0.0 {
            self.averaged
        } else {
            0.5 / (system.dimensions() as f64).powf(0.25)
        };
        let mut direction = 0.0;
        for round in 0..HALVINGS {
            if direction > 0.0 && round >= DOUBLINGS {
                break;
            }
            let from = system.launch(here, &self.inverse_mass, rng);
            let start = from.kinetic(&self.inverse_mass);
            let ratio = match system.leapfrog(&from, step, &self.inverse_mass)? {
                Some(to) => {
                    to.log_density - here.log_density + start - to.kinetic(&self.inverse_mass)
                }
                None => f64::NEG_INFINITY,
            };
            let up = if ratio > libm::log(0.8) { 1.0 } else { -1.0 };
            if direction == 0.0 {
                direction = up;
            } else if up != direction {
                break;
            }
            step *= libm::exp2(direction);
        }
        self.step = step;
        self.averaged = step;
        self.mean_log = libm::log(10.0 * step);
        (self.bias, self.rounds) = (0.0, 0.0);
        Ok(())
    }
}
