//! Warm-up of Hamiltonian kernels: dual averaging of the step size (Hoffman & Gelman
//! 2014, section 3.2), and a metric from windows that double in length, as in Stan: scales
//! from variances, and a map that makes up for correlations (`super::curvature`). Other than
//! in Stan, variances are not shrunk towards 1e-3, which is not small where a scale is
//! smaller. docs/measurements/speed.md says what others cost.

use super::curvature::Window;
use super::metric::{Metric, Mixing};
use super::point::Point;
use super::system::System;
use crate::state::{StateError, holds};
use pcadlang_engine::trace::TraceResult;
use pcadlang_numerics::rng::Stream;
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
    /// The coordinates of the metric: addresses and their numbers of coordinates.
    signature: Vec<(u64, usize)>,
    pub metric: Metric,
    /// By address, the variances from the last windows. Choices that disappear and
    /// reappear get theirs again, so that after warm-up the metric is a function of the
    /// set of choices.
    learnt: BTreeMap<u64, Vec<f64>>,
    /// The map that the last window gave, and for which coordinates.
    mixing: (Vec<(u64, usize)>, Mixing),
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
    /// The states and forces of this window since these choices are the ones that move.
    together: Window,
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

    /// The variances, which are the inverse masses; `None` for too few states. Where the
    /// states do not vary, for instance since every transition was rejected, nothing is
    /// learnt and what was known `before` stays.
    fn variances(&self, before: Option<&Vec<f64>>) -> Option<Vec<f64>> {
        let one = |(i, s): (usize, &f64)| {
            let found = s / (self.count - 1.0);
            let before = || before.and_then(|b| b.get(i)).copied().unwrap_or(1.0);
            let known = found.is_finite() && found > 0.0;
            if known { found.clamp(LIGHTEST.recip(), LIGHTEST) } else { before() }
        };
        (self.count >= 3.0).then(|| self.square.iter().enumerate().map(one).collect())
    }
}

impl Adaptation {
    pub fn new(target: f64, fixed: Option<f64>) -> Self {
        Adaptation {
            target,
            signature: Vec::new(),
            metric: Metric::default(),
            learnt: BTreeMap::new(),
            mixing: Default::default(),
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
            together: Window::default(),
        }
    }

    /// Restores the state of an adaptation with the same arguments.
    ///
    /// # Errors
    /// If the sizes of its parts are inconsistent.
    pub fn take_up(&mut self, read: Adaptation) -> Result<(), StateError> {
        let n = read.metric.dimensions();
        let sizes = read.signature.iter().try_fold(0usize, |sum, s| sum.checked_add(s.1));
        let whole = |m: &Moments| m.mean.len() == m.square.len();
        let (known, mixing) = &read.mixing;
        let coordinates = known.iter().fold(0, |n: usize, s| n.saturating_add(s.1));
        let mixed = [0, coordinates.saturating_mul(coordinates)].contains(&mixing.columns.len());
        holds(mixed, "a metric")?;
        read.metric.check()?;
        let whole = read.together.is_whole() && read.states.values().all(whole);
        holds(sizes == Some(n) && whole, "a step size and metric")?;
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
            self.metric = self.metric();
            self.together = Window::default();
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

    /// Adapts to a transition: its mean acceptance probability, its end point and the force
    /// there.
    pub fn learn(&mut self, acceptance: f64, y: &[f64], force: &[f64]) {
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
            self.together.add(y, force);
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
            if let Some(masses) = moments.variances(before) {
                self.learnt.insert(hash, masses);
            }
        }
        let mixing = std::mem::take(&mut self.together).mixing(&self.scales());
        self.mixing = (self.signature.clone(), mixing);
        let metric = self.metric();
        let before = std::mem::replace(&mut self.metric, metric);
        (before.log_size - self.metric.log_size) / before.dimensions().max(1) as f64
    }

    /// The metric of the present choices, with the map of the last window if that was about
    /// the same choices.
    fn metric(&self) -> Metric {
        let (same, nothing) = (self.mixing.0 == self.signature, Mixing::default());
        Metric::new(self.scales(), if same { &self.mixing.1 } else { &nothing })
    }

    /// The standard deviations of the present choices: those of previous windows, or 1 for
    /// choices without.
    fn scales(&self) -> Vec<f64> {
        let known =
            |(hash, n): &(u64, usize)| self.learnt.get(hash).filter(|m| m.len() == *n).cloned();
        let variances =
            self.signature.iter().flat_map(|s| known(s).unwrap_or_else(|| vec![1.0; s.1]));
        variances.map(f64::sqrt).collect()
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
            let from = system.launch(here, &self.metric, rng);
            let start = from.kinetic();
            let ratio = match system.leapfrog(&from, step, &self.metric)? {
                Some(to) => to.log_density - here.log_density + start - to.kinetic(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn variances(states: &[f64], before: Option<&Vec<f64>>) -> Option<Vec<f64>> {
        let mut moments = Moments::default();
        states.iter().for_each(|y| moments.add(&[*y]));
        moments.variances(before)
    }

    #[test]
    fn variances_are_those_of_states_of_any_scale() {
        for scale in [1e-40, 1e-3, 1.0, 1e30] {
            let states = [1.0, 2.0, 3.0, 4.0].map(|z| z * scale);
            let found = variances(&states, None).unwrap()[0] / scale / scale;
            assert!((found - 5.0 / 3.0).abs() < 1e-9, "{scale}: {found}");
        }
    }

    #[test]
    fn nothing_is_learnt_from_few_states_or_from_one_that_stays() {
        assert_eq!(variances(&[1.0, 2.0], None), None);
        assert_eq!(variances(&[1.0; 9], Some(&vec![5.0])), Some(vec![5.0]));
        assert_eq!(variances(&[1.0; 9], None), Some(vec![1.0]));
        assert_eq!(variances(&[1e300, -1e300, 0.0], None), Some(vec![1.0]));
    }

    #[test]
    fn a_step_stays_as_long_as_it_was_when_the_metric_changes() {
        let mut adaptation = Adaptation::new(0.8, None);
        adaptation.signature = vec![(7, 1)];
        adaptation.metric = Metric::new(vec![1.0], &Mixing::default());
        adaptation.step = 1e-30;
        adaptation.averaged = 1e-30;
        adaptation.mean_log = libm::log(1e-30);
        for i in 0..BURN + WINDOW {
            adaptation.learn(0.8, &[1e-30 * f64::from(i % 5)], &[0.0]);
        }
        // It is to be searched for, from about where it was.
        assert_eq!(adaptation.step, 0.0);
        let length = adaptation.averaged * adaptation.metric.scales[0];
        assert!((length / 1e-30 - 1.0).abs() < 1e-6, "{length}");
    }
}
