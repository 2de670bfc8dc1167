//! Features that published models need, with independently known answers: recurrences,
//! truncation, flat priors on half-lines, ordering with different priors, explicit
//! mixtures.

use pcadlang::{Model, Program, RunOptions};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Draws;
use pcadlang_inference::diagnostics::mcse_mean;
use pcadlang_numerics::rng::{Purpose, StreamKey};

/// Returns the log joint density of a program at these values.
fn log_joint(model: &Model, values: &[(&str, f64)]) -> f64 {
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    for (address, value) in values {
        trace.set(address, *value, Draws::default()).unwrap_or_else(|e| panic!("{e}"));
    }
    trace.log_joint()
}

/// Asserts that the means of quantities under the default plan are right, within four
/// standard errors.
fn has_mean(text: &str, expected: &[(&str, f64)]) {
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let posterior = model
        .run(&RunOptions { seed: 3, ..RunOptions::default() }, 4, 2)
        .unwrap_or_else(|e| panic!("{e}"));
    for (name, expected) in expected {
        let quantities = posterior.quantities();
        let q = quantities.iter().find(|q| q.name == *name).unwrap_or_else(|| panic!("no {name}"));
        let all: Vec<f64> = q.chains.concat();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let (error, z) = (mcse_mean(&q.chains), (mean - expected) / mcse_mean(&q.chains));
        println!("{name}: {mean}, exactly {expected}, z = {z:.2}");
        assert!(
            z.abs() < 4.0 && error < 0.1 * expected.abs(),
            "{text}\n{name}: {mean} +- {error}, exactly {expected}"
        );
    }
}

/// Returns the mean under a positive weight, over a grid.
fn over_a_grid(from: f64, to: f64, log_weight: impl Fn(f64) -> f64) -> f64 {
    let n = 20_000;
    let at = |i: i32| from + (to - from) * (f64::from(i) + 0.5) / f64::from(n);
    let most = (0..n).map(|i| log_weight(at(i))).fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = (0..n).map(|i| (log_weight(at(i)) - most).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().enumerate().map(|(i, w)| w * at(i as i32)).sum::<f64>() / sum
}

/// Simulates an ARMA(1, 1) series with mu = 0.4, phi = 0.7, theta = -0.3, and normal
/// errors of sd 0.5.
fn series(n: usize) -> Vec<f64> {
    let mut rng = StreamKey::new(11, 0, Purpose::VALUES).stream(0, 0, 0);
    let (mut y, mut last) = (Vec::new(), 0.0);
    for _ in 0..n {
        let err = 0.5 * rng.standard_normal();
        let before = y.last().copied().unwrap_or(0.4 / 0.3);
        y.push(0.4 + 0.7 * before - 0.3 * last + err);
        last = err;
    }
    y
}

fn arma(y: &[f64]) -> Model {
    let text = include_str!("../published/arma11.pcad");
    let program = Program::parse(text)
        .unwrap_or_else(|e| panic!("{e}"))
        .observe("y", Value::array(y.to_vec()));
    program.compile().unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_recurrence_scores_as_its_equations_say() {
    let normal = |x: f64, mean: f64, sd: f64| {
        -0.5 * ((x - mean) / sd).powi(2) - sd.ln() - 0.918_938_533_204_672_8
    };
    let y = series(30);
    let model = arma(&y);
    for (mu, phi, theta, sigma) in
        [(0.4, 0.7, -0.3, 0.5), (0.0, -0.2, 0.9, 1.5), (1.0, 0.99, 0.1, 0.05)]
    {
        let mut expected = normal(mu, 0.0, 10.0) + normal(phi, 0.0, 2.0) + normal(theta, 0.0, 2.0);
        expected += -(std::f64::consts::PI * 2.5 / 2.0 * (1.0 + (sigma / 2.5f64).powi(2))).ln();
        let mut err = y[0] - (mu + phi * mu);
        expected += normal(err, 0.0, sigma);
        for t in 1..y.len() {
            err = y[t] - (mu + phi * y[t - 1] + theta * err);
            expected += normal(err, 0.0, sigma);
        }
        let found =
            log_joint(&model, &[("@mu", mu), ("@phi", phi), ("@theta", theta), ("@sigma", sigma)]);
        assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} is not {expected}");
    }
}

#[test]
fn a_recurrence_is_inferred_with_gradients() {
    let y = series(200);
    let model = arma(&y);
    let (_, plan) = model.plan().unwrap_or_else(|e| panic!("{e}"));
    assert!(plan.is_some_and(|p| p.contains("nuts")));
    let options =
        RunOptions { seed: 1, steps: Some(400), warmup: Some(400), ..RunOptions::default() };
    let posterior = model.run(&options, 2, 2).unwrap_or_else(|e| panic!("{e}"));
    for (name, truth) in [("phi", 0.7), ("theta", -0.3), ("sigma", 0.5)] {
        let s = posterior.quantity(name).unwrap().summary;
        assert!((s.mean - truth).abs() < 4.0 * s.sd, "{name}: {} +- {}", s.mean, s.sd);
    }
}

/// The exponential distribution is memoryless, so the posterior is gamma(2 + 4, 1 + 2.6).
#[test]
fn truncated_waiting_times() {
    has_mean(
        "assume rate ~ gamma(2, 1); observe truncated(exponential(rate), lo = 3) = [3.2, 4.1, 3.9, 3.4] as waits;",
        &[("rate", 6.0 / 3.6)],
    );
}

#[test]
fn counts_without_zeros() {
    let log_weight = |rate: f64| {
        rate.ln() - rate + 10.0 * rate.ln() - 5.0 * rate - 5.0 * (-(-rate).exp_m1()).ln()
    };
    has_mean(
        "assume rate ~ gamma(2, 1); observe truncated(poisson(rate), lo = 1) = [1, 2, 1, 4, 2] as counts;",
        &[("rate", over_a_grid(1e-6, 20.0, log_weight))],
    );
}

/// Under a flat prior on the standard deviation, the variance is inv_gamma((n - 1) / 2,
/// sum of squares / 2).
#[test]
fn flat_priors_of_half_lines() {
    let y = [0.3, -1.2, 0.8, 1.9, -0.4, 0.1, -1.1, 0.6, 1.3];
    let squares: f64 = y.iter().map(|y| y * y).sum();
    has_mean(
        "assume sd ~ flat(lo = 0); observe normal(0, sd) = [0.3, -1.2, 0.8, 1.9, -0.4, 0.1, -1.1, 0.6, 1.3] as y;
         assume variance = sd ** 2;
         assume below ~ flat(hi = 1); observe normal(below, 2) = 0 as z;",
        &[("variance", squares / 6.0), ("below", over_a_grid(-30.0, 1.0, |x| -x * x / 8.0))],
    );
}

#[test]
fn unlike_priors_in_order() {
    let second = |x: f64| -0.5 * ((x - 1.0) / 2.0).powi(2) - 0.5 * (x - 0.5).powi(2);
    // The mass of the first value given the second, by a grid within a grid.
    let below = |x: f64| {
        let n = 400;
        let h = (x + 8.0) / f64::from(n);
        (0..n).map(|i| (-0.5 * (-8.0 + h * (f64::from(i) + 0.5)).powi(2)).exp() * h).sum::<f64>()
    };
    let expected = over_a_grid(-7.9, 9.0, |x| second(x) + below(x).ln());
    has_mean(
        "assume m ~ ordered([normal(0, 1), normal(1, 2)]); observe normal(m[1], 1) = 0.5 as y;",
        &[("m[1]", expected)],
    );
}

#[test]
fn mixtures_written_out_are_mixtures() {
    let of = "assume a ~ normal(0, 1); assume s ~ gamma(2, 1);";
    let built_in =
        format!("{of} observe mixture([0.3, 0.7], [normal(a, s), cauchy(0, 1)]) = 0.8 as y;");
    let written = format!(
        "{of} factor(log_sum_exp([log(0.3) + log_density(normal(a, s), 0.8), log(0.7) + log_density(cauchy(0, 1), 0.8)]));"
    );
    let [one, other] = [built_in, written].map(|text| Model::from_text(&text).unwrap());
    for (a, s) in [(0.3, 1.2), (-4.0, 0.1), (0.8, 1e-3)] {
        let at = [("@a", a), ("@s", s)];
        let (x, y) = (log_joint(&one, &at), log_joint(&other, &at));
        assert!((x - y).abs() < 1e-12 * x.abs().max(1.0), "{x} {y}");
    }
}

/// The other programs in the folder `published` run under their default plans, with gradients.
#[test]
fn the_programs_run() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/published");
    let (mut seen, compared) = (0, super::published_models::moments());
    for file in std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()) {
        let text = std::fs::read_to_string(&file).unwrap();
        let name = file.file_stem().unwrap().to_string_lossy();
        let is_compared = compared.iter().any(|(n, _)| *n == name);
        if is_compared || text.contains("data y;") || name == "moments" {
            continue;
        }
        let model = Model::from_text(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let (_, plan) = model.plan().unwrap_or_else(|e| panic!("{e}"));
        assert!(plan.is_some_and(|p| p.contains("nuts")), "{}", file.display());
        let options =
            RunOptions { seed: 2, steps: Some(100), warmup: Some(100), ..RunOptions::default() };
        let posterior =
            model.run(&options, 2, 2).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        for q in posterior.quantities() {
            assert!(
                q.chains.iter().flatten().all(|x| x.is_finite()),
                "{}: {}",
                file.display(),
                q.name
            );
        }
        seen += 1;
    }
    assert_eq!(seen, 6);
}
