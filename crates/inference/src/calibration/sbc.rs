//! Simulation-based calibration: Talts, Betancourt, Simpson, Vehtari & Gelman,
//! "Validating Bayesian inference algorithms with simulation-based calibration" (2018).
//!
//! A true state is drawn from the prior and data from that state, and the sampler is run
//! on the data. If it draws from the posterior, the rank of each true number among nearly
//! independent draws is uniform. The log joint density is ranked too: it reveals errors
//! in the use of the data that no single choice shows (Modrák et al. 2023).

use super::quantities::Quantities;
use super::sampler::Sampler;
use super::simulate::{replicating, same_data, simulate};
use super::{CalibrationError, FALSE_ALARMS, FEWEST, Settings, each};
use crate::callback::Callback;
use crate::diagnostics::ess_bulk;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_numerics::num::chi_square_tail;
use pcadlang_numerics::platform::clock::Instant;
use std::sync::{Arc, Mutex, PoisonError};

/// The number of possible ranks of a true value: one more than the draws kept.
pub const RANKS: usize = 20;
/// The number of pilot chains, which determine how long the others have to be.
const PILOTS: u32 = 8;
/// The largest factor by which chains are lengthened.
const LONGEST: f64 = 64.0;
/// The fraction of chains that may have fewer independent draws than are ranked.
const SHORT: f64 = 0.1;

/// The result of the check.
#[derive(Clone, Debug)]
pub struct Sbc {
    /// One row per quantity, by address; the log joint density comes last.
    pub rows: Vec<SbcRow>,
    /// The number of data sets.
    pub replicates: usize,
    /// The number of bins of the ranks.
    pub bins: usize,
    /// A quantity fails if its p-value is below this: [`FALSE_ALARMS`] divided by the
    /// number of quantities.
    pub threshold: f64,
    /// Kernel applications of the longest chain after warm-up.
    pub steps: u64,
    /// The number of components of choices that were not tested, because there are too
    /// many.
    pub left_out: usize,
}

/// The result for one quantity.
#[derive(Clone, Debug)]
pub struct SbcRow {
    /// Its address.
    pub name: String,
    /// The number of ranks in each bin.
    pub counts: Vec<u32>,
    /// Pearson's chi-square statistic.
    pub chi_square: f64,
    /// The probability of a statistic at least as large if the ranks are uniform.
    pub p: f64,
    /// The smallest effective sample size of a chain.
    pub least_ess: f64,
    /// True if more than a tenth of the chains had fewer independent draws than are
    /// ranked: ranks then pile up at both ends even if the kernels are correct.
    pub is_short: bool,
    /// True if the ranks are consistent with uniform ones.
    pub passes: bool,
}

impl Sbc {
    /// True if every quantity passes.
    pub fn passes(&self) -> bool {
        self.rows.iter().all(|r| r.passes)
    }
}

/// Checks a sampler on data simulated from the program.
///
/// # Errors
/// If data cannot be simulated, a chain fails, or a chain has fewer draws than are
/// ranked.
pub fn sbc(
    code: &Arc<Code>,
    sampler: &dyn Sampler,
    settings: &Settings,
) -> Result<Sbc, CalibrationError> {
    if settings.replicates < FEWEST {
        return Err(CalibrationError::TooFew(format!("at least {FEWEST} replicates are needed")));
    }
    let count = settings.replicates as u32;
    let mut truths = each(settings, 0..count, |i| simulate(code, settings, i))?;
    truths.windows(2).try_for_each(|w| same_data(&w[0], &w[1]))?;
    let quantities = Arc::new(Quantities::of(truths.iter_mut().map(|t| &mut t.trace)));
    let truths: Vec<(Vec<f64>, Arc<Code>)> = truths
        .iter_mut()
        .map(|t| (quantities.read(&mut t.trace), Arc::new(code.with_observed(Arc::clone(&t.data)))))
        .collect();
    let one = |i: u32, steps: Option<u64>| {
        let (truth, code) = &truths[i as usize];
        let callback =
            Arc::new(Collect { quantities: Arc::clone(&quantities), rows: Mutex::default() });
        let steps = sampler.run(code, i, steps, Arc::clone(&callback) as Arc<dyn Callback>)?;
        let rows =
            std::mem::take(&mut *callback.rows.lock().unwrap_or_else(PoisonError::into_inner));
        ranked(truth, &rows, settings, i).map(|ranks| (steps, ranks))
    };
    let begun = Instant::now();
    let mut done = each(settings, 0..count.min(PILOTS), |i| one(i, settings.steps))?;
    let mut each_takes = begun.elapsed() / done.len().max(1) as u32;
    let least = done.iter().flat_map(|(_, r)| r).map(|r| r.ess).fold(f64::INFINITY, f64::min);
    let wanted = 2.0 * RANKS as f64;
    let mut steps = settings.steps;
    if steps.is_none() && least < wanted {
        let longer = (1.5 * wanted / least).clamp(1.0, LONGEST);
        each_takes = each_takes.mul_f64(longer);
        steps = done.iter().map(|(s, _)| (*s as f64 * longer) as u64).max();
        done.clear();
    }
    let first = done.len() as u32;
    settings.estimated.iter().for_each(|tell| tell(each_takes * (count - first)));
    done.extend(each(settings, first..count, |i| one(i, steps))?);
    Ok(judged(&quantities, &done))
}

/// The rank of a true value, and the effective sample size of its chain.
struct Ranked {
    rank: usize,
    ess: f64,
}

#[derive(Debug)]
struct Collect {
    quantities: Arc<Quantities>,
    rows: Mutex<Vec<Vec<f64>>>,
}

impl Callback for Collect {
    fn draw(&self, _: u32, trace: &mut Trace, _: Draws) {
        let row = self.quantities.read(trace);
        self.rows.lock().unwrap_or_else(PoisonError::into_inner).push(row);
    }
}

/// Ranks true values among widely spaced draws; the rank among equal ones is random.
fn ranked(
    truth: &[f64],
    rows: &[Vec<f64>],
    settings: &Settings,
    index: u32,
) -> Result<Vec<Ranked>, CalibrationError> {
    let kept = RANKS - 1;
    if rows.len() < kept {
        let message = format!(
            "a chain has only {} draws, but {kept} are ranked; increase --steps",
            rows.len()
        );
        return Err(CalibrationError::TooFew(message));
    }
    let one = |(q, truth): (usize, &f64)| {
        let series: Vec<f64> = rows.iter().filter_map(|r| r.get(q).copied()).collect();
        let thinned = (1..=kept).filter_map(|j| series.get(j * series.len() / kept - 1));
        let (mut less, mut same) = (0, 0);
        for x in thinned {
            less += usize::from(x < truth);
            same += usize::from(x == truth);
        }
        let mut rng = replicating(settings.seed, index, 1).key.stream(1, q as u64, 1);
        Ranked { rank: less + rng.index(same + 1), ess: ess_bulk(&[finite(series)]) }
    };
    Ok(truth.iter().enumerate().map(one).collect())
}

/// Replaces infinite numbers by finite ones, in the same order.
fn finite(series: Vec<f64>) -> Vec<f64> {
    let known = || series.iter().copied().filter(|x| x.is_finite());
    let (low, high) = (known().fold(0.0, f64::min) - 1.0, known().fold(0.0, f64::max) + 1.0);
    series
        .iter()
        .map(|x| {
            if x.is_finite() {
                *x
            } else if *x > 0.0 {
                high
            } else {
                low
            }
        })
        .collect()
}

fn judged(quantities: &Quantities, done: &[(u64, Vec<Ranked>)]) -> Sbc {
    let replicates = done.len();
    // At least five ranks are expected in each bin.
    let bins = [10, 5, 4].into_iter().find(|b| replicates >= 5 * b).unwrap_or(2);
    let threshold = FALSE_ALARMS / quantities.names.len() as f64;
    let row = |(q, name): (usize, &String)| {
        let mut counts = vec![0u32; bins];
        let (mut least, mut short) = (f64::INFINITY, 0);
        for r in done.iter().filter_map(|(_, all)| all.get(q)) {
            counts[(r.rank * bins / RANKS).min(bins - 1)] += 1;
            least = least.min(r.ess);
            short += usize::from(r.ess < (RANKS - 1) as f64);
        }
        let expected = replicates as f64 / bins as f64;
        let chi_square: f64 =
            counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
        let p = chi_square_tail(chi_square, bins as f64 - 1.0);
        let is_short = short as f64 > SHORT * replicates as f64;
        SbcRow {
            name: name.clone(),
            counts,
            chi_square,
            p,
            least_ess: least,
            is_short,
            passes: p >= threshold,
        }
    };
    Sbc {
        rows: quantities.names.iter().enumerate().map(row).collect(),
        replicates,
        bins,
        threshold,
        steps: done.iter().map(|(s, _)| *s).max().unwrap_or(0),
        left_out: quantities.left_out,
    }
}
