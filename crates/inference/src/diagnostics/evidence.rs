//! The evidence of a mode, from the draws of chains that stay in it.
//!
//! log Z = E[log density] + entropy, both over the mode. The mean is that of the draws;
//! the entropy is that of a Gaussian with their covariance. There are often fewer draws
//! near a mode than choices, so their correlations are shrunk towards zero (Schäfer &
//! Strimmer 2005, "A shrinkage approach to large-scale covariance matrix estimation",
//! target D), with the effective number of draws in place of the actual one. Exact for
//! Gaussian modes and many draws. Chains that have not yet explored their mode are too
//! narrow, by dozens of nats if there are dozens of choices: the error reflects this, and
//! modes are then better distinguished by their densities.

use nalgebra::{Cholesky, DMatrix};
use serde::{Deserialize, Serialize};

/// The fewest draws that are informative about a mode.
const FEWEST: u64 = 8;
/// The further widening expected of chains that have not explored their mode, as a
/// multiple of the widening from blocks of draws to all draws.
const WIDER: f64 = 3.0;
/// The number of samples of the evidences within their errors, over which the modes'
/// probabilities are averaged.
const AVERAGED: u64 = 1000;

/// Moments of a chain's draws: mean and squared deviations of the log densities, means
/// and products of the coordinates, and the steps from each draw to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Cloud {
    count: u64,
    log: [f64; 2],
    mean: Vec<f64>,
    /// Sums of products about the mean: the lower triangle, row by row.
    products: Vec<f64>,
    first: Vec<f64>,
    last: Vec<f64>,
    /// Sums of the squared differences between successive draws (von Neumann 1941).
    steps: Vec<f64>,
}

/// A log evidence, and the standard error due to the number of draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogEvidence {
    /// The logarithm of the integral of the density over the mode.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
}

impl Cloud {
    /// Adds the next draw (Welford 1962). All draws have the same number of coordinates;
    /// a draw that is not finite is left out.
    fn add(&mut self, y: &[f64], log_density: f64) {
        let fits = self.count == 0 || y.len() == self.mean.len();
        if !fits || !log_density.is_finite() || y.iter().any(|x| !x.is_finite()) {
            return;
        }
        if self.count == 0 {
            (self.mean, self.steps) = (vec![0.0; y.len()], vec![0.0; y.len()]);
            self.products = vec![0.0; y.len() * (y.len() + 1) / 2];
            (self.first, self.last) = (y.to_vec(), y.to_vec());
        }
        self.count += 1;
        let n = self.count as f64;
        let before: Vec<f64> = y.iter().zip(&self.mean).map(|(y, m)| y - m).collect();
        self.mean.iter_mut().zip(&before).for_each(|(m, d)| *m += d / n);
        let mut products = self.products.iter_mut();
        for (i, d) in before.iter().enumerate() {
            let after = y[..=i].iter().zip(&self.mean);
            after.zip(&mut products).for_each(|((y, m), p)| *p += d * (y - m));
        }
        self.steps
            .iter_mut()
            .zip(y.iter().zip(&self.last))
            .for_each(|(s, (y, last))| *s += (y - last) * (y - last));
        self.last.copy_from_slice(y);
        let d = log_density - self.log[0];
        self.log[0] += d / n;
        self.log[1] += d * (log_density - self.log[0]);
    }

    /// Joins a block and the block after it.
    fn joined(parts: &[Cloud]) -> Cloud {
        let [a, b] = parts else { return parts.first().cloned().unwrap_or_default() };
        let (n, m) = (a.count as f64, b.count as f64);
        let all = n + m;
        let off: Vec<f64> = b.mean.iter().zip(&a.mean).map(|(b, a)| b - a).collect();
        let mut joined = a.clone();
        joined.count += b.count;
        joined.mean.iter_mut().zip(&off).for_each(|(mean, d)| *mean += d * m / all);
        let mut products = joined.products.iter_mut().zip(&b.products);
        for (i, d) in off.iter().enumerate() {
            (&mut products).zip(&off[..=i]).for_each(|((p, q), e)| *p += q + d * e * n * m / all);
        }
        let d = b.log[0] - a.log[0];
        joined.log = [a.log[0] + d * m / all, a.log[1] + b.log[1] + d * d * n * m / all];
        for (i, steps) in joined.steps.iter_mut().enumerate() {
            *steps += b.steps[i] + (b.first[i] - a.last[i]) * (b.first[i] - a.last[i]);
        }
        joined.last.clone_from(&b.last);
        joined
    }

    /// The effective number of draws: the median over the coordinates, with each modelled
    /// as a first-order autoregression.
    fn effective(&self) -> f64 {
        let n = self.count as f64;
        let one = |i: usize| {
            let r = (1.0 - 0.5 * self.steps[i] / self.products[i * (i + 3) / 2]).clamp(0.0, 1.0);
            if r.is_nan() { 0.0 } else { n * (1.0 - r) / (1.0 + r) }
        };
        let mut all: Vec<f64> = (0..self.mean.len()).map(one).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).map_or(n, |m| m.max(1.0))
    }
}

/// The draws of one chain in the unconstrained space, in two to four blocks of equal
/// length, of which the last may not be full. Comparing a block with all of them shows
/// whether the chain has explored its mode.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clouds {
    blocks: Vec<Cloud>,
    /// The number of draws of a full block: a power of two times [`FEWEST`].
    length: u64,
}

impl Clouds {
    /// Adds the next draw of the chain, with the same number of coordinates as the
    /// others; a draw that is not finite is left out.
    pub fn add(&mut self, y: &[f64], log_density: f64) {
        self.length = self.length.max(FEWEST);
        if self.blocks.last().is_none_or(|b| b.count >= self.length) {
            if self.blocks.len() == 4 {
                self.blocks = self.blocks.chunks(2).map(Cloud::joined).collect();
                self.length *= 2;
            }
            self.blocks.push(Cloud::default());
        }
        if let Some(block) = self.blocks.last_mut() {
            block.add(y, log_density);
        }
    }

    /// The number of draws.
    pub fn count(&self) -> u64 {
        self.blocks.iter().map(|b| b.count).sum()
    }
}

/// The mean log density and the entropy of a set of draws.
struct Gaussian {
    log: f64,
    log_variance: f64,
    entropy: f64,
    effective: f64,
    /// The logarithms of the standard deviations.
    widths: Vec<f64>,
}

impl Gaussian {
    fn of(clouds: &[&Cloud]) -> Option<Gaussian> {
        let count: u64 = clouds.iter().map(|c| c.count).sum();
        let d = clouds.first()?.mean.len();
        if count < FEWEST || clouds.iter().any(|c| c.mean.len() != d) {
            return None;
        }
        let n = count as f64;
        let effective = clouds.iter().map(|c| c.effective()).sum::<f64>().clamp(3.0, n);
        let share = |c: &Cloud| c.count as f64 / n;
        let log = clouds.iter().map(|c| share(c) * c.log[0]).sum::<f64>();
        let off = |c: &Cloud| share(c) * (c.log[0] - log) * (c.log[0] - log);
        let log_variance = clouds.iter().map(|c| c.log[1] / n + off(c)).sum::<f64>();
        let mean: Vec<f64> =
            (0..d).map(|i| clouds.iter().map(|c| share(c) * c.mean[i]).sum()).collect();
        let covariance = |i: usize, j: usize| {
            let between = |c: &Cloud| share(c) * (c.mean[i] - mean[i]) * (c.mean[j] - mean[j]);
            clouds.iter().map(|c| c.products[i * (i + 1) / 2 + j] / n + between(c)).sum::<f64>() * n
                / (n - 1.0)
        };
        let entropy = entropy(d, effective, covariance)?;
        let widths = (0..d).map(|i| 0.5 * libm::log(covariance(i, i))).collect();
        Some(Gaussian { log, log_variance, entropy, effective, widths })
    }
}

/// The entropy of a Gaussian with a sample covariance of `effective` independent draws.
/// `None` if a coordinate never moved.
fn entropy(d: usize, effective: f64, covariance: impl Fn(usize, usize) -> f64) -> Option<f64> {
    let sd: Vec<f64> = (0..d).map(|i| covariance(i, i).sqrt()).collect();
    if sd.iter().any(|s| !s.is_normal()) {
        return None;
    }
    let mut correlations = DMatrix::identity(d, d);
    let (mut squares, mut noise) = (0.0, 0.0);
    for i in 0..d {
        for j in 0..i {
            let r = covariance(i, j) / (sd[i] * sd[j]);
            (correlations[(i, j)], correlations[(j, i)]) = (r, r);
            squares += r * r;
            noise += (1.0 - r * r) * (1.0 - r * r) / (effective - 1.0);
        }
    }
    let kept = 1.0 - if squares > 0.0 { (noise / squares).min(1.0) } else { 1.0 };
    for (i, j) in (0..d).flat_map(|i| (0..d).map(move |j| (i, j))).filter(|(i, j)| i != j) {
        correlations[(i, j)] *= kept;
    }
    let factor = Cholesky::new(correlations)?;
    let freedom = effective - 1.0;
    // The expected bias of the log of a sample variance, which is too small: log(x) -
    // digamma(x) at x = freedom / 2.
    let bias = 1.0 / freedom + 1.0 / (3.0 * freedom * freedom);
    let each = 0.5 * (libm::log(2.0 * std::f64::consts::PI) + 1.0 + bias);
    let log = |i: usize| each + libm::log(sd[i]) + libm::log(factor.l_dirty()[(i, i)]);
    Some((0..d).map(log).sum())
}

/// The evidence of a mode from chains that stay in it. Its error has two parts: that of
/// the number of draws, and that of chains which have not explored the mode, whose blocks
/// of draws are narrower than all draws together. `None` if there are too few draws, or a
/// coordinate never moved.
pub fn log_evidence(chains: &[&Clouds]) -> Option<LogEvidence> {
    let blocks: Vec<&Cloud> = chains.iter().flat_map(|c| &c.blocks).collect();
    let all = Gaussian::of(&blocks)?;
    let width = |g: &Gaussian| g.widths.iter().sum::<f64>();
    let known = |b: &&Cloud| Some((b.count as f64, width(&Gaussian::of(&[b])?)));
    let parts: Vec<(f64, f64)> = blocks.iter().filter_map(known).collect();
    let count: f64 = parts.iter().map(|(n, _)| n).sum();
    let widened = width(&all) - parts.iter().map(|(n, w)| n / count * w).sum::<f64>();
    let value = all.log + all.entropy;
    let drawn = (all.log_variance + 0.5 * all.widths.len() as f64) / all.effective;
    let error = (drawn + (WIDER * widened).powi(2)).sqrt();
    (value.is_finite() && error.is_finite()).then_some(LogEvidence { value, error })
}

/// The mean log density of chains, which ranks modes as if all were equally wide. The
/// error is that of this assumption: entropies in d dimensions differ by about √d. `None`
/// without draws.
pub fn log_density(chains: &[&Clouds]) -> Option<LogEvidence> {
    let blocks: Vec<&Cloud> = chains.iter().flat_map(|c| &c.blocks).collect();
    let count: f64 = blocks.iter().map(|b| b.count as f64).sum();
    let dimensions = blocks.first()?.mean.len() as f64;
    let value = blocks.iter().map(|b| b.count as f64 / count * b.log[0]).sum();
    Some(LogEvidence { value, error: dimensions.sqrt() })
}

/// The probability of each mode, averaged over the errors of the evidences.
pub fn shares(all: &[LogEvidence]) -> Vec<f64> {
    let mut rng =
        pcadlang_numerics::rng::StreamKey::new(0, 0, pcadlang_numerics::rng::Purpose::KERNEL)
            .stream(0, 0, 0);
    let mut shares = vec![0.0; all.len()];
    for _ in 0..AVERAGED {
        let logs: Vec<f64> =
            all.iter().map(|e| e.value + e.error * rng.standard_normal()).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|l| libm::exp(l - most)).collect();
        let sum: f64 = weights.iter().sum();
        shares.iter_mut().zip(weights).for_each(|(s, w)| *s += w / sum / AVERAGED as f64);
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    /// Draws of a normal distribution of mass exp(log_mass) in `d` dimensions about `at`:
    /// neighbouring coordinates have correlation `r`, successive draws autocorrelation
    /// `lag`.
    fn cloud(
        seed: u64,
        (d, n): (usize, usize),
        (at, sd): (f64, f64),
        r: f64,
        lag: f64,
        log_mass: f64,
    ) -> Clouds {
        let mut rng = StreamKey::new(seed, 0, Purpose(77)).stream(0, 0, 0);
        let mut cloud = Clouds::default();
        let mut state = vec![0.0; d];
        for t in 0..n {
            let keep = if t == 0 { 0.0 } else { lag };
            state
                .iter_mut()
                .for_each(|z| *z = keep * *z + (1.0 - keep * keep).sqrt() * rng.standard_normal());
            let mut x = vec![0.0; d];
            for i in 0..d {
                let before = if i == 0 { 0.0 } else { r };
                x[i] = before * x[i.saturating_sub(1)] + (1.0 - before * before).sqrt() * state[i];
            }
            let log_sd = d as f64 * sd.ln() + (d as f64 - 1.0) * 0.5 * (1.0 - r * r).ln();
            let log_density = log_mass
                - 0.5 * state.iter().map(|z| z * z).sum::<f64>()
                - log_sd
                - 0.5 * d as f64 * std::f64::consts::TAU.ln();
            cloud.add(&x.iter().map(|x| at + sd * x).collect::<Vec<_>>(), log_density);
        }
        cloud
    }

    #[test]
    fn the_mass_of_a_normal_is_found() {
        let wide = cloud(1, (3, 4000), (5.0, 2.0), 0.9, 0.0, -7.0);
        let e = log_evidence(&[&wide]).unwrap();
        assert!((e.value + 7.0).abs() < 0.05 && e.error < 0.05, "{e:?}");
        // Two autocorrelated chains of the same mode: the effective number of draws is
        // about a fifth of the actual one.
        let two = [2, 3].map(|s| cloud(s, (3, 4000), (5.0, 2.0), 0.9, 0.7, -7.0));
        let worth: f64 = two[0].blocks.iter().map(Cloud::effective).sum();
        assert!((worth / 4000.0 - 0.3 / 1.7).abs() < 0.03, "{worth}");
        let e = log_evidence(&[&two[0], &two[1]]).unwrap();
        assert!((e.value + 7.0).abs() < 0.15, "{e:?}");
    }

    #[test]
    fn blocks_that_are_joined_are_as_one() {
        let draw = |t: u32| [f64::from(t * t % 17), f64::from(t % 5) - 1e3, f64::from(t * 7 % 11)];
        let of = |from: u32, to: u32| {
            let mut c = Cloud::default();
            (from..to).for_each(|t| c.add(&draw(t), f64::from(t % 3)));
            c
        };
        let (whole, joined) = (of(0, 50), Cloud::joined(&[of(0, 13), of(13, 50)]));
        let near = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-8 * (1.0 + a.abs()))
        };
        assert!(
            near(&whole.mean, &joined.mean) && near(&whole.products, &joined.products),
            "{whole:?} {joined:?}"
        );
        assert!(
            near(&whole.steps, &joined.steps)
                && near(&whole.log, &joined.log)
                && whole.last == joined.last
        );
        let mut blocks = Clouds::default();
        (0..1000).for_each(|t| blocks.add(&draw(t), 0.0));
        assert_eq!((blocks.count(), blocks.length), (1000, 256));
        assert!((2..=4).contains(&blocks.blocks.len()), "{}", blocks.blocks.len());
    }

    #[test]
    fn chains_still_on_their_way_have_an_error_that_says_so() {
        // A random walk in 30 dimensions: one that is twice as long is wider by log(2) /
        // 2 in each.
        let walk = log_evidence(&[&cloud(9, (30, 400), (0.0, 1.0), 0.0, 0.9999, 0.0)]).unwrap();
        let there = log_evidence(&[&cloud(9, (30, 4000), (0.0, 1.0), 0.0, 0.0, 0.0)]).unwrap();
        assert!(
            walk.error > 0.5 * walk.value.abs() && walk.error < 100.0 && there.error < 0.5,
            "{walk:?} {there:?}"
        );
    }

    #[test]
    fn densities_tell_what_widths_do_not() {
        let walk = |seed, log| cloud(seed, (30, 200), (0.0, 1.0), 0.0, 0.9999, log);
        let (low, high) = (walk(9, 0.0), walk(10, 60.0));
        let each = [&low, &high].map(|c| log_density(&[c]).unwrap());
        assert!(
            (each[0].error - 30f64.sqrt()).abs() < 1e-12 && shares(&each)[1] > 0.999,
            "{each:?}"
        );
        let near = [each[0], LogEvidence { value: each[0].value + 3.0, ..each[0] }];
        assert!((0.55..0.8).contains(&shares(&near)[1]), "{:?}", shares(&near));
        assert_eq!(log_density(&[]), None);
    }

    #[test]
    fn few_draws_in_many_dimensions_are_unbiased_to_their_error() {
        // Neighbours are correlated by 0.5: 39 of 780 correlations. 30 such modes with 60
        // autocorrelated draws each.
        let all: Vec<f64> = (0..30)
            .map(|s| log_evidence(&[&cloud(s, (40, 60), (0.0, 0.1), 0.5, 0.4, 3.0)]).unwrap())
            .map(|e| (e.value - 3.0) / e.error)
            .collect();
        let mean = all.iter().sum::<f64>() / 30.0;
        // The bias is due to the shrinkage of the correlations, at most 39 * 0.14 nats;
        // the error is 1.3 nats.
        assert!(mean > -1.0 && mean < 4.5, "{mean}");
    }

    #[test]
    fn shares_are_those_of_the_masses() {
        // The narrow mode is ten times as high and has a third of the mass.
        let narrow = cloud(4, (2, 3000), (0.0, 0.1), 0.0, 0.0, 1f64.ln());
        let wide = cloud(5, (2, 3000), (9.0, 3.0), 0.5, 0.0, 2f64.ln());
        let each = [&narrow, &wide].map(|c| log_evidence(&[c]).unwrap());
        let s = shares(&each);
        assert!((s[0] - 1.0 / 3.0).abs() < 0.02 && (s[0] + s[1] - 1.0).abs() < 1e-12, "{s:?}");
        // Errors make the probabilities more even, not less.
        let sure =
            |error| shares(&[LogEvidence { value: 0.0, error }, LogEvidence { value: 3.0, error }]);
        assert!((sure(0.0)[1] - 0.9526).abs() < 1e-3 && sure(4.0)[1] < 0.8 && sure(4.0)[1] > 0.6);
    }

    #[test]
    fn what_never_moved_has_no_evidence() {
        let mut stuck = Clouds::default();
        (0..50).for_each(|i| stuck.add(&[f64::from(i), 1.0], 0.0));
        assert_eq!(log_evidence(&[&stuck]), None);
        let mut short = Clouds::default();
        (0..5).for_each(|i| short.add(&[f64::from(i)], 0.0));
        short.add(&[f64::NAN], 0.0);
        short.add(&[1.0, 2.0], 0.0);
        assert_eq!((short.count(), log_evidence(&[&short])), (5, None));
        assert_eq!(log_evidence(&[]), None);
    }
}
