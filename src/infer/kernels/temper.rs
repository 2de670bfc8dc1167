//! `temper(move)`: replica exchange over powers of the likelihood (Geyer 1991; Hukushima & Nemoto 1996).
//!
//! Beside the chain's own state there are replicas that see the likelihood raised to lower powers, so that they cross between
//! modes. Each step moves every replica by the kernel inside, then neighbours swap states with the Metropolis ratio, the even
//! pairs and the odd ones in turn (Okabe et al. 2001). In warm-up the ladder is spaced so that neighbours swap about as often
//! everywhere (Miasojedow, Moulines & Vihola 2013).

use crate::infer::kernel::{At, Kernel, Outcome, accepts, inner_step};
use crate::trace::{Trace, TraceResult};

/// The rate of swaps aimed at: the best one for many temperatures (Kone & Kofke 2005).
const AIM: f64 = 0.234;

/// Replica exchange around a kernel.
pub struct Temper {
    /// The kernel of each level, the chain's own first.
    kernels: Vec<Box<dyn Kernel>>,
    /// The states of the levels after the first.
    replicas: Vec<Trace>,
    /// The logarithms of the gaps between the log powers of neighbours.
    gaps: Vec<f64>,
    rounds: u64,
}

impl Temper {
    /// One level a kernel; the powers fall geometrically from 1 to `hottest` until warm-up finds better ones.
    pub fn new(kernels: Vec<Box<dyn Kernel>>, hottest: f64) -> Self {
        let pairs = kernels.len().saturating_sub(1);
        let gap = (-libm::log(hottest) / pairs.max(1) as f64).max(1e-6);
        Temper { kernels, replicas: Vec::new(), gaps: vec![libm::log(gap); pairs], rounds: 0 }
    }

    /// The powers of the levels, the chain's own first.
    pub fn powers(&self) -> Vec<f64> {
        let mut log = 0.0;
        let lower = self.gaps.iter().map(|g| {
            log -= libm::exp(*g);
            libm::exp(log)
        });
        std::iter::once(1.0).chain(lower).collect()
    }

    /// Learns from the probability of a swap.
    fn adapt(&mut self, pair: usize, probability: f64) {
        let gain = libm::pow(self.rounds as f64 / 2.0 + 1.0, -0.6).max(0.01);
        self.gaps[pair] = (self.gaps[pair] + gain * (probability - AIM)).clamp(-12.0, 4.0);
    }
}

impl Kernel for Temper {
    fn name(&self) -> String {
        "temper".into()
    }

    fn step(&mut self, trace: &mut Trace, at: &At) -> TraceResult<Outcome> {
        let pairs = self.gaps.len();
        while self.replicas.len() < pairs {
            self.replicas.push(trace.clone());
        }
        for replica in &mut self.replicas {
            replica.observe_as(trace)?;
        }
        let powers = self.powers();
        for (level, kernel) in self.kernels.iter_mut().enumerate() {
            let state = if level == 0 { &mut *trace } else { &mut self.replicas[level - 1] };
            inner_step(&mut **kernel, state, &At { power: at.power * powers[level], ..at.within(level as u64) })?;
        }
        let mut rng = at.stream();
        let mut outcome = Outcome::default();
        for pair in ((self.rounds % 2) as usize..pairs).step_by(2) {
            let (low, high) = self.replicas.split_at_mut(pair);
            let (colder, hotter) = (low.last_mut().unwrap_or(&mut *trace), &mut high[0]);
            let rise = hotter.log_likelihood() - colder.log_likelihood();
            let ratio = at.power * (powers[pair] - powers[pair + 1]) * rise;
            let swapped = accepts(ratio, &mut rng);
            if swapped {
                std::mem::swap(colder, hotter);
            }
            outcome.add(Outcome::one(swapped));
            if at.adapting {
                self.adapt(pair, if ratio.is_nan() { 0.0 } else { libm::exp(ratio.min(0.0)) });
            }
        }
        self.rounds += 1;
        Ok(outcome)
    }
}

#[cfg(test)]
mod tests {
    use crate::infer::kernel::{At, Kernel};
    use crate::infer::kernels::{Abc, Drift, Mh, Smc, Temper};
    use crate::infer::{Pick, Scope};
    use crate::lang::value::Value;
    use crate::model::Model;
    use crate::trace::{Selector, Trace};

    fn scope() -> Scope {
        Scope { selector: Selector::All, pick: Pick::All }
    }

    /// The mean of `x` after the data have become 5, with steps before that under the program's own.
    fn under_new_data(kernel: &mut dyn Kernel, steps: u64) -> f64 {
        let model = Model::from_text("assume x ~ normal(0, 1); observe normal(x, 1) = -3;").unwrap();
        let mut trace: Trace = model.simulate(1, 0).unwrap();
        for i in 0..50 {
            kernel.step(&mut trace, &At::new(1, 0, i)).unwrap();
        }
        let hash = trace.observed()[0].hash;
        trace.set_observed(&[(hash, Value::Num(5.0))]).unwrap();
        trace.commit();
        let (mut sum, skip) = (0.0, steps / 10);
        for i in 0..skip + steps {
            kernel.step(&mut trace, &At::new(1, 0, 50 + i)).unwrap();
            assert!(trace.observed()[0].value.same(&Value::Num(5.0)));
            if i >= skip {
                let Value::Num(x) = trace.value(trace.all_targets()[0]) else { panic!("no number") };
                sum += x;
            }
        }
        sum / steps as f64
    }

    /// Kernels that keep states or distances between steps go over to other data with the trace.
    #[test]
    fn other_data_reach_what_is_kept() {
        let walk = || -> Box<dyn Kernel> { Box::new(Drift::new(scope(), Some(1.0))) };
        let mean = under_new_data(&mut Temper::new((0..3).map(|_| walk()).collect(), 0.1), 4000);
        assert!((mean - 2.5).abs() < 0.15, "temper: {mean}");
        let mean = under_new_data(&mut Smc::new(walk(), 10, Selector::Nothing, Default::default()), 1000);
        assert!((mean - 2.5).abs() < 0.15, "smc: {mean}");
        let mean = under_new_data(&mut Abc::new(Box::new(Mh::new(scope())), 0.5, Default::default()), 60_000);
        // Data drawn within 0.5 of 5 stand for a slightly wider normal: 5 / (2 + 1/12) within a hundredth.
        assert!((mean - 2.45).abs() < 0.15, "abc: {mean}");
    }
}
