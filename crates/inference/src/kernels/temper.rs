//! `temper(move)`: replica exchange over powers of the likelihood (Geyer 1991; Hukushima
//! & Nemoto 1996).
//!
//! Beside the chain's own state there are replicas whose likelihood is raised to lower
//! powers, so that they cross between modes. Each step moves every replica by the inner
//! kernel, and then neighbours swap states with the Metropolis ratio, alternating between
//! even and odd pairs (Okabe et al. 2001). In warm-up the powers are adapted so that all
//! neighbours swap about equally often (Miasojedow, Moulines & Vihola 2013).

use super::row::{Built, INNER, KernelRow, int, num, number};
use crate::kernel::{Kernel, Outcome, StepContext, accepts, inner_step};
use crate::state::{StateError, holds, pack, unpack};
use pcadlang_engine::trace::{Constraint, Trace, TraceResult};

pub(crate) const ROW: KernelRow = KernelRow::new(
    "temper",
    &[
        INNER,
        int("levels", 6, [2, 1000], "The number of temperatures."),
        num(
            "hottest",
            0.01,
            "The lowest power of the likelihood; warm-up adapts the ladder of temperatures.",
        ),
    ],
    "Replica exchange (parallel tempering) over powers of the likelihood: each step updates \
     every replica, then proposes swaps of neighbours (Geyer 1991).",
    number!(
        "\
infer {
  warmup 200 { temper(drift(@x), levels = 3); }
  repeat 100 { temper(drift(@x), levels = 3); collect x; }
}"
    ),
    |call| {
        let levels = call.whole("levels")?;
        let hottest = call.positive_if_given("hottest")?.unwrap_or(1.0);
        let inner = (0..levels).map(|_| call.inner()).collect::<Result<Vec<_>, _>>()?;
        let signature = format!("temper({}, {levels}, {hottest})", inner[0].signature);
        let inner = inner.into_iter().map(|b| b.kernel).collect();
        Ok(Built::new(Temper::new(inner, hottest.min(1.0)), signature))
    },
)
.irreversible();

/// The target swap rate: the optimum for many temperatures (Kone & Kofke 2005).
const AIM: f64 = 0.234;

/// Replica exchange with an inner kernel.
pub struct Temper {
    /// The kernel of each level; level 0 is the chain's own.
    kernels: Vec<Box<dyn Kernel>>,
    /// The states of the levels after the first.
    replicas: Vec<Trace>,
    /// The replicas of a checkpoint, until the first step.
    saved: Vec<Vec<(u64, Constraint)>>,
    /// The logarithms of the differences between neighbours' log powers.
    gaps: Vec<f64>,
    rounds: u64,
}

impl Temper {
    /// One level per kernel. The powers fall geometrically from 1 to `hottest` until
    /// warm-up adapts them.
    pub fn new(kernels: Vec<Box<dyn Kernel>>, hottest: f64) -> Self {
        let pairs = kernels.len().saturating_sub(1);
        let gap = (-libm::log(hottest) / pairs.max(1) as f64).max(1e-6);
        Temper {
            kernels,
            replicas: Vec::new(),
            saved: Vec::new(),
            gaps: vec![libm::log(gap); pairs],
            rounds: 0,
        }
    }

    /// The powers of the levels; the chain's own comes first.
    pub fn powers(&self) -> Vec<f64> {
        let mut log = 0.0;
        let lower = self.gaps.iter().map(|g| {
            log -= libm::exp(*g);
            libm::exp(log)
        });
        std::iter::once(1.0).chain(lower).collect()
    }

    /// Adapts the gap of a pair to the probability of its swap.
    fn adapt(&mut self, pair: usize, probability: f64) {
        let gain = libm::pow(self.rounds as f64 / 2.0 + 1.0, -0.6).max(0.01);
        self.gaps[pair] = (self.gaps[pair] + gain * (probability - AIM)).clamp(-12.0, 4.0);
    }
}

impl Kernel for Temper {
    fn name(&self) -> String {
        "temper".into()
    }

    fn save(&self, trace: &Trace) -> Vec<u8> {
        let replicas: Vec<_> = match &self.replicas[..] {
            [] => self.saved.clone(),
            all => all.iter().map(Trace::constraints).collect(),
        };
        let state = |level: usize| {
            if level == 0 { trace } else { self.replicas.get(level - 1).unwrap_or(trace) }
        };
        let kernels: Vec<Vec<u8>> =
            self.kernels.iter().enumerate().map(|(level, k)| k.save(state(level))).collect();
        pack(&(kernels, replicas, &self.gaps, self.rounds))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let (kernels, replicas, gaps, rounds): (Vec<Vec<u8>>, Vec<_>, Vec<f64>, u64) =
            unpack(state)?;
        let fits = kernels.len() == self.kernels.len() && gaps.len() == self.gaps.len();
        holds(fits && (replicas.is_empty() || replicas.len() == gaps.len()), "temper")?;
        (self.saved, self.gaps, self.rounds) = (replicas, gaps, rounds);
        self.replicas.clear();
        self.kernels.iter_mut().zip(kernels).try_for_each(|(k, state)| k.load(&state))
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let pairs = self.gaps.len();
        for state in std::mem::take(&mut self.saved) {
            self.replicas.push(trace.another(state, at.draws(0))?);
        }
        while self.replicas.len() < pairs {
            self.replicas.push(trace.clone());
        }
        for replica in &mut self.replicas {
            replica.observe_as(trace)?;
        }
        let powers = self.powers();
        for (level, kernel) in self.kernels.iter_mut().enumerate() {
            let state = if level == 0 { &mut *trace } else { &mut self.replicas[level - 1] };
            inner_step(
                &mut **kernel,
                state,
                &StepContext { power: at.power * powers[level], ..at.within(level as u64) },
            )?;
        }
        let mut rng = at.stream();
        let mut outcome = Outcome::default();
        for pair in ((self.rounds % 2) as usize..pairs).step_by(2) {
            let (low, high) = self.replicas.split_at_mut(pair);
            let (colder, hotter) = (low.last_mut().unwrap_or(&mut *trace), &mut high[0]);
            let rise = hotter.log_likelihood() - colder.log_likelihood();
            // If both states have zero likelihood, they are not swapped.
            let rise = if rise.is_nan() { f64::NEG_INFINITY } else { rise };
            let ratio = at.power * (powers[pair] - powers[pair + 1]) * rise;
            let swapped = accepts(ratio, &mut rng);
            if swapped {
                std::mem::swap(colder, hotter);
            }
            outcome.add(Outcome::one(swapped));
            if at.adapting {
                self.adapt(pair, libm::exp(ratio.min(0.0)));
            }
        }
        self.rounds = self.rounds.wrapping_add(1);
        Ok(outcome)
    }
}
