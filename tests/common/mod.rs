//! Helpers of the integration tests, included once by each test program; here are those
//! that run programs given as text and check their draws.
//!
//! Where a test goes. What users rely on is tested here, through public items, in the
//! program of its subject: `tests/SUBJECT/main.rs` with a module for each topic. What
//! only private items show is tested beside the code: in `mod tests` at the end of the
//! file, or in a file `x_tests.rs` or `x/tests.rs` of its own when that is over about 100
//! lines.
//!
//! The tests of a program share one process: none sets environment variables or the
//! current folder, and each writes to a [`folder::Folder`] of its own. A test that cannot
//! share its process is a program of its own, which says why (`tests/allocation.rs`).
//! `cargo test --release --test SUBJECT -- TOPIC::` runs one topic.
#![allow(dead_code)]

pub mod breaks;
pub mod families;
pub mod folder;
pub mod gltf;
pub mod kernels;
pub mod programs;
pub mod snapshots;
pub mod tape;

use pcadlang::Model;
use pcadlang_inference::{Latent, Neighbours, RunOptions};
use std::collections::BTreeMap;

/// Draws by column, with the chains concatenated.
pub type Draws = BTreeMap<String, Vec<f64>>;

/// Runs a program and returns its draws.
pub fn run(text: &str, seed: u64, chains: usize) -> Draws {
    run_with(text, &RunOptions { seed, ..RunOptions::default() }, chains, 2)
}

/// Does the same with options.
pub fn run_with(text: &str, options: &RunOptions, chains: usize, threads: usize) -> Draws {
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let posterior = model.run(options, chains, threads).unwrap_or_else(|e| panic!("{e}"));
    let mut draws = Draws::new();
    for (name, values) in posterior.scalars() {
        draws.entry(name).or_default().extend(values);
    }
    draws
}

/// Returns three draws from the prior as neighbours: unrelated to the data, so they
/// mislead.
pub fn wrong_neighbours(model: &Model) -> Neighbours {
    let draw = |i| Latent::all(&model.simulate(9, i).unwrap_or_else(|e| panic!("{e}")));
    Neighbours::new((0..3).map(draw).collect(), &(3..40).map(draw).collect::<Vec<_>>())
}

pub fn mean(xs: &[f64]) -> f64 {
    xs.iter().sum::<f64>() / xs.len() as f64
}

pub fn variance(xs: &[f64]) -> f64 {
    let m = mean(xs);
    xs.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / (xs.len() as f64 - 1.0)
}

/// Returns the Monte Carlo standard error of the mean by batch means, which is valid for
/// correlated draws.
pub fn standard_error(xs: &[f64]) -> f64 {
    let batches = 40;
    let size = xs.len() / batches;
    let means: Vec<f64> = (0..batches).map(|b| mean(&xs[b * size..(b + 1) * size])).collect();
    (variance(&means) / batches as f64).sqrt()
}

/// Asserts that a posterior mean is right within 5 standard errors (batch means of 40
/// batches, with a false alarm rate of about 1e-5), and that the error is small enough
/// for the test to be meaningful.
pub fn assert_mean(what: &str, xs: &[f64], expected: f64, tolerance: f64) {
    let (m, se) = (mean(xs), standard_error(xs));
    assert!(
        5.0 * se < tolerance,
        "{what}: the standard error {se} is too large to tell {tolerance}; run longer"
    );
    assert!(
        (m - expected).abs() < 5.0 * se + 1e-12,
        "{what}: mean {m} (se {se}), expected {expected}"
    );
}

/// Integrates f over a..b by Simpson's rule with n (even) intervals.
pub fn integrate(f: impl Fn(f64) -> f64, a: f64, b: f64, n: usize) -> f64 {
    let h = (b - a) / n as f64;
    let inner: f64 = (1..n).map(|i| f(a + i as f64 * h) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (f(a) + inner + f(b)) * h / 3.0
}

pub fn normal_pdf(x: f64, m: f64, sd: f64) -> f64 {
    let z = (x - m) / sd;
    (-0.5 * z * z).exp() / (sd * (2.0 * std::f64::consts::PI).sqrt())
}

/// Returns the largest distance between the empirical distribution of these draws and a
/// continuous one, times the root of their number (Kolmogorov-Smirnov); for independent
/// draws it is above 2.5 with probability 8e-6.
pub fn kolmogorov_smirnov(xs: &[f64], cdf: impl Fn(f64) -> f64) -> f64 {
    let mut sorted = xs.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = xs.len() as f64;
    let gap = |(i, x): (usize, &f64)| {
        let p = cdf(*x);
        (p - i as f64 / n).abs().max((p - (i + 1) as f64 / n).abs())
    };
    sorted.iter().enumerate().map(gap).fold(0.0, f64::max) * n.sqrt()
}
