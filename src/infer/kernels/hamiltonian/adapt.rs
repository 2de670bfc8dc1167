//! Warm-up of Hamiltonian kernels: dual averaging of the step size (Hoffman & Gelman
//! 2014, section 3.2), and a diagonal metric from the variances over windows that double
//! in length, as in Stan.

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
    /// By address, the variances from the last windows. Choices that disappear and
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
    /// The states of this window, by address; choices that disappear and reappear
    /// continue to be counted.
    states: BTreeMap<u64, Moments>,
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

    /// The variances, shrunk towards a small value if there are few states, as in Stan;
    /// `None` for fewer than two states.
    fn variances(&self) -> Option<Vec<f64>> {
        let n = self.count;
        let variance = |s: &f64| (n / (n + 5.0)) * (s / (n - 1.0)) + 1e-3 * 5.0 / (n + 5.0);
        (n >= 2.0).then(|| self.square.iter().map(variance).collect())
    }
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
        let whole = |m: &Moments| m.mean.len() == m.square.len();
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
    pub fn learn(&mut self, acceptance: f64, y: &[f64]) {
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
            let mut rest = y;
            for (hash, n) in &self.signature {
                let (own, others) = rest.split_at((*n).min(rest.len()));
                self.states.entry(*hash).or_default().add(own);
                rest = others;
            }
        }
        if self.seen == self.window_end {
            self.close();
            self.window = self.window.saturating_mul(2);
            self.window_end = self.seen.saturating_add(self.window);
            // The step size is adapted again for the new metric, starting from its
            // present value.
            self.mean_log = libm::log(10.0 * self.averaged);
            (self.bias, self.rounds) = (0.0, 0.0);
            self.step = self.averaged;
        }
    }

    /// Ends a window: its variances become the metric of the choices that it saw at least
    /// twice.
    fn close(&mut self) {
        let seen = std::mem::take(&mut self.states);
        self.learnt.extend(seen.into_iter().filter_map(|(hash, m)| Some((hash, m.variances()?))));
        self.inverse_mass = self.metric();
    }

    /// The inverse masses of the present choices: the variances of previous windows, or 1
    /// for those without.
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
