//! Simulation-based calibration (Talts et al. 2018): for data drawn from the model, the
//! posterior quantile of the truth is uniform. The model is a figure of eight joints with
//! a shift and a scale; its posterior is summed on a grid.

use super::{Detection, KeypointLikelihood, KeypointOptions};
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};

const JOINTS: [[f64; 2]; 8] = [
    [0.0, -60.0],
    [-25.0, -30.0],
    [25.0, -30.0],
    [-40.0, 5.0],
    [40.0, 5.0],
    [0.0, 20.0],
    [-18.0, 65.0],
    [18.0, 65.0],
];
const SHIFTS: usize = 61;
const SCALES: usize = 31;
const BINS: usize = 20;
/// The 0.999 quantile of chi-square with 19 degrees of freedom.
const CRITICAL: f64 = 43.82;

/// The position of a joint in an image of 640 x 480; both parameters have a normal prior
/// on their grid.
fn joint(k: usize, shift: usize, scale: usize) -> [f64; 2] {
    let t = 40.0 * 6.0 * (shift as f64 / (SHIFTS - 1) as f64 - 0.5);
    let s = libm::exp(0.2 * 6.0 * (scale as f64 / (SCALES - 1) as f64 - 0.5));
    [320.0 + t + s * JOINTS[k][0], 240.0 + s * JOINTS[k][1]]
}

fn prior(i: usize, of: usize) -> f64 {
    let z = 6.0 * (i as f64 / (of - 1) as f64 - 0.5);
    libm::exp(-0.5 * z * z)
}

fn pick(weights: &[f64], rng: &mut Stream) -> usize {
    let mut left = rng.uniform() * weights.iter().sum::<f64>();
    let past = weights.iter().position(|w| {
        left -= w;
        left < 0.0
    });
    past.unwrap_or(weights.len() - 1)
}

/// The quantile of `truth` in weights on a grid; ties are broken at random, so that it is
/// exactly uniform under the prior.
fn quantile(weights: &[f64], truth: usize, rng: &mut Stream) -> f64 {
    let below: f64 = weights[..truth].iter().sum();
    (below + rng.uniform() * weights[truth]) / weights.iter().sum::<f64>()
}

/// Chi-square of the quantiles of shift and scale over 400 data sets. `minds`: the
/// weights of the detector's alternative positions.
fn chi_squares(
    drawn: &KeypointOptions,
    assumed: &KeypointOptions,
    missing: f64,
    sure: bool,
    minds: &[f64],
) -> [f64; 2] {
    let model = |o| KeypointLikelihood::new(640.0, 480.0, 0.0, o).unwrap();
    let (from, to) = (model(drawn), model(assumed));
    let (p, q): (Vec<f64>, Vec<f64>) = (
        (0..SHIFTS).map(|i| prior(i, SHIFTS)).collect(),
        (0..SCALES).map(|i| prior(i, SCALES)).collect(),
    );
    let runs = 400;
    let mut bins = [[0.0f64; BINS]; 2];
    for run in 0..runs {
        let mut rng = StreamKey::new(11, 0, Purpose::PREDICT).stream(run, 0, 0);
        let truth = (pick(&p, &mut rng), pick(&q, &mut rng));
        let mut seen = Vec::new();
        for k in 0..JOINTS.len() {
            let confidence = if sure { 1.0 } else { rng.uniform() };
            let others =
                |z: &[[f64; 2]]| z.iter().copied().zip(minds.iter().copied()).collect::<Vec<_>>();
            let blank =
                Detection::new([0.0; 2], confidence).or(minds.iter().map(|w| ([0.0; 2], *w)));
            let z = from.sample(&blank, Some(joint(k, truth.0, truth.1)), &mut rng);
            if rng.uniform() >= missing {
                seen.push((k, Detection::new(z[0], confidence).or(others(&z[1..]).into_iter())));
            }
        }
        let log = |i: usize, j: usize| -> f64 {
            seen.iter().map(|(k, z)| to.log_density(z, Some(joint(*k, i, j)))).sum()
        };
        let mut posterior = vec![0.0; SHIFTS * SCALES];
        let mut most = f64::NEG_INFINITY;
        for (at, w) in posterior.iter_mut().enumerate() {
            *w = log(at / SCALES, at % SCALES);
            most = most.max(*w);
        }
        for (at, w) in posterior.iter_mut().enumerate() {
            *w = libm::exp(*w - most) * p[at / SCALES] * q[at % SCALES];
        }
        let shift: Vec<f64> = posterior.chunks(SCALES).map(|row| row.iter().sum()).collect();
        let scale: Vec<f64> =
            (0..SCALES).map(|j| posterior.iter().skip(j).step_by(SCALES).sum()).collect();
        for (bins, u) in bins
            .iter_mut()
            .zip([quantile(&shift, truth.0, &mut rng), quantile(&scale, truth.1, &mut rng)])
        {
            bins[((u * BINS as f64) as usize).min(BINS - 1)] += 1.0;
        }
    }
    let expected = runs as f64 / BINS as f64;
    bins.map(|b| b.iter().map(|n| (n - expected) * (n - expected) / expected).sum())
}

fn options(sd: f64, outlier: f64) -> KeypointOptions {
    KeypointOptions { sd, outlier, ..KeypointOptions::default() }
}

#[test]
fn quantiles_of_the_truth_are_uniform() {
    for (outlier, missing, sure) in
        [(1e-9, 0.0, true), (0.3, 0.0, true), (0.1, 0.4, true), (0.2, 0.3, false)]
    {
        let o = KeypointOptions { misses: missing / 2.0, ..options(1.5, outlier) };
        for minds in [&[][..], &[0.5], &[1.0, 0.25]] {
            let chi = chi_squares(&o, &o, missing, sure, minds);
            assert!(chi.iter().all(|c| *c < CRITICAL), "{outlier} {missing} {minds:?} {chi:?}");
        }
    }
}

#[test]
fn a_wrong_model_is_found_out() {
    let chi = chi_squares(&options(1.5, 0.1), &options(0.75, 0.1), 0.0, true, &[]);
    assert!(chi.iter().all(|c| *c > CRITICAL), "too small a spread: {chi:?}");
    let chi = chi_squares(&options(1.5, 0.4), &options(1.5, 1e-100), 0.0, true, &[]);
    assert!(chi.iter().all(|c| *c > CRITICAL), "no outliers: {chi:?}");
}
