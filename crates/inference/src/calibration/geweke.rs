//! Geweke's joint distribution test: "Getting it right: joint distribution tests of
//! posterior simulators" (2004).
//!
//! The marginal-conditional simulator draws a state from the prior and data given the
//! state. The successive-conditional one alternates between moving the state given the
//! data with the sampler, and redrawing the data given the state. Both have the same
//! joint distribution if the sampler leaves the posterior invariant.
//!
//! Every successive chain starts from a draw of the joint distribution, so it needs no
//! burn-in, and the test is valid for chains that mix slowly, though less powerful.
//! Chains are independent, so their means have a valid standard error whatever their
//! autocorrelation. Numbers are compared by their position among the marginal draws (0 to
//! 1): the mean and the mean square of positions exist for heavy tails too, and detect
//! the same errors as those of the numbers. The log joint density is among the numbers,
//! read before the data are redrawn: a kernel that ignores the data may leave the
//! distributions of all other numbers unchanged.

use super::quantities::{OF_DATA, Quantities, read_data};
use super::sampler::Sampler;
use super::simulate::{replicating, same_data, simulate};
use super::{CalibrationError, FALSE_ALARMS, FEWEST, Settings, each};
use crate::callback::Callback;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_numerics::num::inv_normal_cdf;
use std::sync::{Arc, Mutex, PoisonError};

/// Draws from the prior for each successive chain.
const MARGINAL: u32 = 20;

/// The comparison of the two simulators.
#[derive(Clone, Debug)]
pub struct Geweke {
    /// One row per quantity, by address; the log joint density and the statistics of the
    /// data come last.
    pub rows: Vec<GewekeRow>,
    /// The number of successive chains.
    pub chains: usize,
    /// The number of draws from the prior.
    pub marginal: usize,
    /// The smallest number of turns of a chain.
    pub turns: usize,
    /// A larger absolute z-score fails. Its two-sided probability is [`FALSE_ALARMS`]
    /// divided by the number of scores.
    pub threshold: f64,
    /// The number of components of choices that were not tested, because there are too
    /// many.
    pub left_out: usize,
}

/// The result for one quantity.
#[derive(Clone, Debug)]
pub struct GewekeRow {
    /// Its address.
    pub name: String,
    /// The median over draws from the prior.
    pub marginal: f64,
    /// The median over the successive chains.
    pub successive: f64,
    /// The z-score of the mean position.
    pub z_mean: f64,
    /// The z-score of the mean square of positions.
    pub z_square: f64,
    /// True if both are within the threshold.
    pub passes: bool,
}

impl Geweke {
    /// True if every quantity passes.
    pub fn passes(&self) -> bool {
        self.rows.iter().all(|r| r.passes)
    }
}

/// Compares the two simulators.
///
/// # Errors
/// If data cannot be simulated, or a chain fails.
pub fn geweke(
    code: &Arc<Code>,
    sampler: &dyn Sampler,
    settings: &Settings,
) -> Result<Geweke, CalibrationError> {
    if settings.replicates < FEWEST {
        return Err(CalibrationError::TooFew(format!("at least {FEWEST} replicates are needed")));
    }
    let chains = settings.replicates as u32;
    let mut first = each(settings, 0..chains, |i| simulate(code, settings, i))?;
    first.windows(2).try_for_each(|w| same_data(&w[0], &w[1]))?;
    let quantities = Arc::new(Quantities::of(first.iter_mut().map(|t| &mut t.trace)));
    drop(first);
    // The chains start from the first draws; the marginal ones are others.
    let marginal = each(settings, chains..chains * (1 + MARGINAL), |i| {
        simulate(code, settings, i).map(|mut s| read(&quantities, &mut s.trace))
    })?;
    let successive = each(settings, 0..chains, |i| {
        let callback = Arc::new(Alternating {
            code: Arc::clone(code),
            quantities: Arc::clone(&quantities),
            settings: settings.clone(),
            taken: Mutex::default(),
        });
        sampler.run(code, i, settings.steps, Arc::clone(&callback) as Arc<dyn Callback>)?;
        let taken =
            std::mem::take(&mut *callback.taken.lock().unwrap_or_else(PoisonError::into_inner));
        match taken.failed {
            Some(e) => Err(e),
            None if taken.readings.is_empty() => Err(CalibrationError::TooFew(
                "a chain has fewer than two draws; increase --steps".into(),
            )),
            None => Ok(taken.readings),
        }
    })?;
    let names: Vec<String> =
        quantities.names.iter().cloned().chain(OF_DATA.map(str::to_owned)).collect();
    Ok(judged(names, &marginal, &successive, quantities.left_out))
}

fn read(quantities: &Quantities, trace: &mut Trace) -> Vec<f64> {
    let mut row = quantities.read(trace);
    row.extend(read_data(trace));
    row
}

/// Reads the state at every draw of a chain, and then simulates new data.
#[derive(Debug)]
struct Alternating {
    code: Arc<Code>,
    quantities: Arc<Quantities>,
    settings: Settings,
    taken: Mutex<Taken>,
}

#[derive(Debug, Default)]
struct Taken {
    turns: u64,
    readings: Vec<Vec<f64>>,
    failed: Option<CalibrationError>,
}

impl Callback for Alternating {
    fn draw(&self, chain: u32, trace: &mut Trace, _: Draws) {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if taken.failed.is_some() {
            return;
        }
        match self.turn(chain, taken.turns, trace) {
            Ok(Some(reading)) => taken.readings.push(reading),
            Ok(None) => {}
            Err(e) => taken.failed = Some(e),
        }
        taken.turns += 1;
    }
}

impl Alternating {
    /// The first turn replaces the state after warm-up by a draw of the joint
    /// distribution; what the kernels have adapted is kept. Later turns read the state
    /// and redraw the data.
    fn turn(
        &self,
        chain: u32,
        turn: u64,
        trace: &mut Trace,
    ) -> Result<Option<Vec<f64>>, CalibrationError> {
        if turn == 0 {
            let start = simulate(&self.code, &self.settings, chain)?;
            trace.restore(&start.trace.constraints(), replicating(self.settings.seed, chain, 0))?;
            let data: Vec<_> =
                start.trace.observed().into_iter().map(|o| (o.hash, o.value)).collect();
            trace.set_observed(&data)?;
            trace.commit();
            return Ok(None);
        }
        // Read before the data are redrawn: afterwards they fit any state, even if the
        // kernels ignored them.
        let reading = read(&self.quantities, trace);
        let drawn = trace.replicate(replicating(self.settings.seed, chain, turn))?;
        trace.set_observed(&drawn.values)?;
        trace.commit();
        Ok(Some(reading))
    }
}

fn judged(
    names: Vec<String>,
    marginal: &[Vec<f64>],
    successive: &[Vec<Vec<f64>>],
    left_out: usize,
) -> Geweke {
    let tests = 2.0 * names.len() as f64;
    let z = inv_normal_cdf(1.0 - 0.5 * FALSE_ALARMS / tests);
    // Student's quantile from the normal one (Abramowitz & Stegun 26.7.5), since the
    // error is estimated from the chains.
    let threshold = z + (z * z * z + z) / (4.0 * (successive.len() as f64 - 1.0));
    let row = |(q, name): (usize, String)| {
        let mut sorted: Vec<f64> = marginal.iter().filter_map(|r| r.get(q).copied()).collect();
        sorted.sort_by(f64::total_cmp);
        let chains: Vec<Vec<f64>> = successive
            .iter()
            .map(|c| c.iter().filter_map(|r| r.get(q).copied()).collect())
            .collect();
        let score = |power: i32| {
            let of = |x: f64| place(&sorted, x).powi(power);
            let expected: Vec<f64> = sorted.iter().map(|x| of(*x)).collect();
            let means: Vec<f64> = chains.iter().map(|c| mean(c.iter().map(|x| of(*x)))).collect();
            let error =
                variance(&expected) / expected.len() as f64 + variance(&means) / means.len() as f64;
            let difference = mean(means.iter().copied()) - mean(expected.iter().copied());
            if difference.abs() < 1e-12 { 0.0 } else { difference / error.sqrt() }
        };
        let (z_mean, z_square) = (score(1), score(2));
        let passes = z_mean.abs() <= threshold && z_square.abs() <= threshold;
        let mut all = chains.concat();
        all.sort_by(f64::total_cmp);
        let middle = |xs: &[f64]| xs.get(xs.len() / 2).copied().unwrap_or(f64::NAN);
        GewekeRow {
            name,
            marginal: middle(&sorted),
            successive: middle(&all),
            z_mean,
            z_square,
            passes,
        }
    };
    Geweke {
        rows: names.into_iter().enumerate().map(row).collect(),
        chains: successive.len(),
        marginal: marginal.len(),
        turns: successive.iter().map(Vec::len).min().unwrap_or(0),
        threshold,
        left_out,
    }
}

/// The fraction of sorted numbers below `x`, with equal ones counting half.
fn place(sorted: &[f64], x: f64) -> f64 {
    let below = sorted.partition_point(|y| *y < x);
    let upto = sorted.partition_point(|y| *y <= x);
    0.5 * (below + upto) as f64 / sorted.len().max(1) as f64
}

fn mean(xs: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = xs.len() as f64;
    xs.sum::<f64>() / n
}

fn variance(xs: &[f64]) -> f64 {
    let m = mean(xs.iter().copied());
    xs.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / (xs.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    #[test]
    fn scores_are_judged_by_students_quantile() {
        for (names, chains) in [(1, 10), (5, 40), (30, 200)] {
            let draws = vec![vec![vec![0.5; names]; 3]; chains];
            let judged = judged((0..names).map(|i| i.to_string()).collect(), &draws[0], &draws, 0);
            let student = StudentsT::new(0.0, 1.0, chains as f64 - 1.0).unwrap();
            let exact = student.inverse_cdf(1.0 - 0.5 * FALSE_ALARMS / (2 * names) as f64);
            // The quantile is approximated from the normal one, to first order.
            let normal = inv_normal_cdf(1.0 - 0.5 * FALSE_ALARMS / (2 * names) as f64);
            assert!(judged.threshold > normal && judged.threshold <= exact, "{}", judged.threshold);
            assert!(
                exact - judged.threshold < 0.5 * (exact - normal),
                "{} {exact}",
                judged.threshold
            );
        }
    }
}
