//! Tests of draws against independently computed distribution functions
//! (Kolmogorov-Smirnov), or against the probabilities of the reference-checked log
//! densities (chi-squared).

use super::*;
use crate::num::{log_normal_cdf, normal_cdf};
use statrs::distribution::{self as s, ContinuousCDF};
use std::f64::consts::{PI, TAU};

const DRAWS: usize = 20_000;

fn draws(d: &Dist, site: u64) -> Vec<f64> {
    let mut rng = stream(site);
    (0..DRAWS)
        .map(|_| {
            let x = d.sample(&mut rng);
            assert!(d.support().contains(&x), "{d:?} drew {x:?}");
            assert!(d.log_density(&x) > f64::NEG_INFINITY, "{d:?} drew the impossible {x:?}");
            x.num().unwrap()
        })
        .collect()
}

/// Returns sqrt(n) times the largest distance between the empirical distribution function
/// and `cdf`. Of equal draws only the last counts, so draws clamped to the smallest or
/// largest double are treated correctly.
fn distance(mut xs: Vec<f64>, cdf: &dyn Fn(f64) -> f64) -> f64 {
    xs.sort_by(f64::total_cmp);
    let n = xs.len() as f64;
    let ends = (0..xs.len()).filter(|i| i + 1 == xs.len() || xs[i + 1] > xs[*i]);
    ends.map(|i| ((i + 1) as f64 / n - cdf(xs[i])).abs()).fold(0.0, f64::max) * n.sqrt()
}

#[test]
fn continuous_draws_follow_their_distribution_functions() {
    type Cdf = Box<dyn Fn(f64) -> f64>;
    let beta = |a, b| -> Cdf { Box::new(move |x| s::Beta::new(a, b).unwrap().cdf(x)) };
    let gamma = |a, b| -> Cdf { Box::new(move |x| s::Gamma::new(a, b).unwrap().cdf(x)) };
    let student =
        |v, m, k| -> Cdf { Box::new(move |x| s::StudentsT::new(m, k, v).unwrap().cdf(x)) };
    let between = |lo, hi| -> Cdf {
        let (from, all) = (normal_cdf(lo), normal_cdf(hi) - normal_cdf(lo));
        Box::new(move |x| (normal_cdf(x) - from) / all)
    };
    let cases: Vec<(&str, Vec<f64>, Cdf)> = vec![
        ("normal", vec![-2.0, 0.3], Box::new(|x| normal_cdf((x + 2.0) / 0.3))),
        ("lognormal", vec![1.0, 2.0], Box::new(|x: f64| normal_cdf((x.ln() - 1.0) / 2.0))),
        ("uniform", vec![-1.0, 4.0], Box::new(|x| (x + 1.0) / 5.0)),
        ("beta", vec![2.0, 5.0], beta(2.0, 5.0)),
        ("beta", vec![0.3, 0.6], beta(0.3, 0.6)),
        ("beta", vec![0.01, 3.0], beta(0.01, 3.0)),
        ("beta", vec![300.0, 500.0], beta(300.0, 500.0)),
        ("gamma", vec![3.5, 2.0], gamma(3.5, 2.0)),
        ("gamma", vec![1.0, 0.1], gamma(1.0, 0.1)),
        ("gamma", vec![0.05, 4.0], gamma(0.05, 4.0)),
        ("gamma", vec![1e-3, 1.0], gamma(1e-3, 1.0)),
        ("gamma", vec![1000.0, 1.0], gamma(1000.0, 1.0)),
        ("exponential", vec![0.2], Box::new(|x| -(-0.2 * x).exp_m1())),
        ("half_normal", vec![2.0], Box::new(|x| 2.0 * normal_cdf(x / 2.0) - 1.0)),
        (
            "half_cauchy",
            vec![-1.0, 3.0],
            Box::new(|x: f64| ((x + 1.0) / 3.0).atan() * std::f64::consts::FRAC_2_PI),
        ),
        (
            "student_t",
            vec![1.0, 0.0, 1.0],
            Box::new(|x: f64| 0.5 + x.atan() * std::f64::consts::FRAC_1_PI),
        ),
        ("student_t", vec![4.0, 1.0, 0.5], student(4.0, 1.0, 0.5)),
        ("student_t", vec![0.2, 0.0, 1.0], student(0.2, 0.0, 1.0)),
        ("student_t", vec![500.0, 0.0, 1.0], student(500.0, 0.0, 1.0)),
        ("truncated_normal", vec![1.0, 2.0, -INF, INF], Box::new(|x| normal_cdf((x - 1.0) / 2.0))),
        ("truncated_normal", vec![0.0, 1.0, -1.0, 0.5], between(-1.0, 0.5)),
        ("truncated_normal", vec![0.0, 1.0, -3.0, 0.5], between(-3.0, 0.5)),
        ("truncated_normal", vec![0.0, 1.0, 0.5, 0.6], between(0.5, 0.6)),
        ("truncated_normal", vec![0.0, 1.0, 1.0, 4.0], between(1.0, 4.0)),
        ("truncated_normal", vec![0.0, 1.0, -6.0, -4.0], between(-6.0, -4.0)),
        ("truncated_normal", vec![0.0, 1.0, -INF, 2.0], between(-INF, 2.0)),
        // Thirty sd from the mean.
        (
            "truncated_normal",
            vec![0.0, 1.0, 30.0, INF],
            Box::new(|x: f64| 1.0 - (log_normal_cdf(-x) - log_normal_cdf(-30.0)).exp()),
        ),
        (
            "truncated_normal",
            vec![5.0, 0.1, -INF, 2.0],
            Box::new(|x: f64| (log_normal_cdf((x - 5.0) / 0.1) - log_normal_cdf(-30.0)).exp()),
        ),
        (
            "inv_gamma",
            vec![3.5, 2.0],
            Box::new(|x: f64| 1.0 - s::Gamma::new(3.5, 2.0).unwrap().cdf(1.0 / x)),
        ),
        (
            "inv_gamma",
            vec![0.2, 2.0],
            Box::new(|x: f64| 1.0 - s::Gamma::new(0.2, 2.0).unwrap().cdf(1.0 / x)),
        ),
        (
            "cauchy",
            vec![1.0, 3.0],
            Box::new(|x: f64| 0.5 + ((x - 1.0) / 3.0).atan() * std::f64::consts::FRAC_1_PI),
        ),
        (
            "laplace",
            vec![0.0, 2.0],
            Box::new(
                |x: f64| if x < 0.0 { 0.5 * (x / 2.0).exp() } else { 1.0 - 0.5 * (-x / 2.0).exp() },
            ),
        ),
        ("weibull", vec![0.4, 3.0], Box::new(|x: f64| -(-(x / 3.0).powf(0.4)).exp_m1())),
        ("weibull", vec![7.0, 3.0], Box::new(|x: f64| -(-(x / 3.0).powf(7.0)).exp_m1())),
        ("von_mises", vec![0.5, 0.0], Box::new(|x: f64| 0.5 + x / TAU)),
        ("von_mises", vec![0.5, 1e8], Box::new(|x: f64| normal_cdf((x - 0.5) * 1e4))),
        // The starting points of a chain with the improper prior.
        ("flat", vec![], Box::new(|x: f64| (x + 2.0) / 4.0)),
    ];
    for (i, (family, p, cdf)) in cases.iter().enumerate() {
        let d = distance(draws(&make(family, p), i as u64), cdf);
        // 2.2 is exceeded with probability 1e-4.
        assert!(d < 2.2, "{family}{p:?}: {d}");
    }
}

/// Returns the chi-squared statistic over cells of at least 10 expected draws, and its
/// degrees of freedom.
fn chi_square(xs: &[f64], d: &Dist, values: impl Iterator<Item = i64>) -> (f64, usize) {
    let (mut statistic, mut cells) = (0.0, 0);
    let (mut expected, mut from, mut left) = (0.0, f64::NEG_INFINITY, 1.0);
    let n = xs.len() as f64;
    let mut cell = |from: f64, to: f64, expected: f64| {
        let seen = xs.iter().filter(|x| **x > from && **x <= to).count() as f64;
        statistic += (seen - expected) * (seen - expected) / expected;
        cells += 1;
    };
    for v in values {
        let p = d.log_density_num(v as f64).exp();
        expected += p * n;
        left -= p;
        if expected >= 10.0 && left * n >= 10.0 {
            cell(from, v as f64, expected);
            (from, expected) = (v as f64, 0.0);
        }
    }
    cell(from, f64::INFINITY, expected + left.max(0.0) * n);
    (statistic, cells - 1)
}

#[test]
fn counts_follow_their_probabilities() {
    let cases: &[(&str, &[f64], i64)] = &[
        ("uniform_discrete", &[-3.0, 8.0], 8),
        ("binomial", &[5.0, 0.3], 5),
        ("binomial", &[40.0, 0.9], 40),
        ("binomial", &[1000.0, 0.4], 1000),
        ("binomial", &[1000.0, 0.985], 1000),
        ("binomial", &[30.0, 0.34], 30),
        ("binomial", &[1e9, 2e-9], 60),
        ("poisson", &[0.01], 20),
        ("poisson", &[3.0], 40),
        ("poisson", &[9.99], 60),
        ("poisson", &[10.0], 60),
        ("poisson", &[80.0], 300),
        ("poisson", &[4000.0], 5000),
        ("categorical", &[1.0, 0.0, 3.0, 0.5], 3),
        ("binomial_logit", &[40.0, 2.2], 40),
        ("binomial_logit", &[1000.0, -0.4], 1000),
        ("poisson_log", &[1.1], 40),
        ("poisson_log", &[4.4], 300),
        ("categorical_logits", &[0.0, -INF, 1.1, -0.7], 3),
        ("neg_binomial", &[2.5, 0.3], 60),
        ("neg_binomial", &[0.1, 0.01], 2000),
        ("neg_binomial", &[400.0, 0.5], 800),
        ("geometric", &[0.2], 80),
        ("geometric", &[0.001], 20_000),
    ];
    for (i, (family, p, last)) in cases.iter().enumerate() {
        let d = make(family, p);
        let xs = draws(&d, 100 + i as u64);
        let (statistic, freedom) = chi_square(&xs, &d, -3..=*last);
        // Wilson & Hilferty's normal approximation.
        let f = freedom.max(1) as f64;
        let z = ((statistic / f).cbrt() - (1.0 - 2.0 / (9.0 * f))) / (2.0 / (9.0 * f)).sqrt();
        assert!(z < 3.7, "{family}{p:?}: {statistic} with {freedom} degrees of freedom");
        assert!(freedom > 0 || *family == "poisson");
    }
}

#[test]
fn draws_have_the_stated_moments() {
    let cases: &[(&str, &[f64])] = &[
        ("normal", &[3.0, 2.0]),
        ("lognormal", &[0.0, 0.4]),
        ("uniform", &[2.0, 5.0]),
        ("beta", &[2.0, 3.0]),
        ("gamma", &[4.0, 0.5]),
        ("exponential", &[3.0]),
        ("half_normal", &[2.0]),
        ("student_t", &[12.0, 1.0, 2.0]),
        ("uniform_discrete", &[1.0, 6.0]),
        ("binomial", &[1e12, 0.25]),
        ("poisson", &[1e9]),
        ("categorical", &[1.0, 2.0, 3.0]),
        ("truncated_normal", &[1.0, 2.0, 0.0, 3.0]),
        ("truncated_normal", &[1.0, 2.0, -INF, 0.0]),
        ("truncated_normal", &[0.0, 1.0, 1e6, INF]),
        ("truncated_normal", &[0.0, 1.0, 5.0, 5.01]),
        ("inv_gamma", &[9.0, 4.0]),
        ("laplace", &[1.0, 2.0]),
        ("weibull", &[2.0, 3.0]),
        ("weibull", &[5e4, 3.0]),
        ("neg_binomial", &[7.5, 0.4]),
        ("geometric", &[0.1]),
    ];
    for (i, (family, p)) in cases.iter().enumerate() {
        let d = make(family, p);
        let (mean, sd) = (d.mean().unwrap(), d.sd().unwrap());
        let zs: Vec<f64> = draws(&d, 200 + i as u64).iter().map(|x| (x - mean) / sd).collect();
        let n = zs.len() as f64;
        let (m, v) = (zs.iter().sum::<f64>() / n, zs.iter().map(|z| z * z).sum::<f64>() / n);
        assert!(m.abs() < 4.0 / n.sqrt(), "{family}{p:?}: mean off by {m} sd");
        assert!((v - 1.0).abs() < 0.06, "{family}{p:?}: variance ratio {v}");
    }
    assert!(make("student_t", &[1.0, 0.0, 1.0]).mean().is_none());
    assert!(make("half_cauchy", &[0.0, 1.0]).mean().is_none());
    assert!(make("cauchy", &[0.0, 1.0]).mean().is_none());
    assert!(
        make("inv_gamma", &[1.0, 1.0]).mean().is_none()
            && make("inv_gamma", &[2.0, 1.0]).sd().is_none()
    );
    // Truncated at the mean: the two halves of a normal.
    for (lo, hi, side) in [(1.0, INF, 1.0), (-INF, 1.0, -1.0)] {
        let mean = make("truncated_normal", &[1.0, 2.0, lo, hi]).mean().unwrap();
        assert!((mean - (1.0 + side * 2.0 * (2.0 / PI).sqrt())).abs() < 1e-9, "{mean}");
    }
    let ratio = make("weibull", &[1e8, 1.0]).sd().unwrap() / (PI / 6f64.sqrt() * 1e-8);
    assert!((ratio - 1.0).abs() < 1e-7, "{ratio}");
}

#[test]
fn certain_draws_are_certain() {
    let mut rng = stream(300);
    for (family, p, x) in [
        ("binomial", vec![20.0, 0.0], 0.0),
        ("binomial", vec![20.0, 1.0], 20.0),
        ("binomial", vec![0.0, 0.5], 0.0),
        ("poisson", vec![0.0], 0.0),
        ("categorical", vec![0.0, 0.0, 2.0, 0.0], 2.0),
        ("uniform_discrete", vec![7.0, 7.0], 7.0),
    ] {
        let d = make(family, &p);
        assert!((0..500).all(|_| d.sample(&mut rng) == Datum::Num(x)), "{family}{p:?}");
    }
    for (p, x) in [(0.0, false), (1.0, true)] {
        assert!((0..500).all(|_| make("flip", &[p]).sample(&mut rng) == Datum::Bool(x)));
    }
    let heads = (0..DRAWS)
        .filter(|_| make("flip", &[0.3]).sample(&mut rng) == Datum::Bool(true))
        .count() as f64;
    assert!((heads / DRAWS as f64 - 0.3).abs() < 0.013, "{heads}");
}

#[test]
fn shares_have_beta_marginals() {
    let alpha = [0.5, 2.0, 3.5];
    let d = make("dirichlet", &alpha);
    let mut rng = stream(400);
    let xs: Vec<Datum> = (0..DRAWS).map(|_| d.sample(&mut rng)).collect();
    assert!(xs.iter().all(|x| d.support().contains(x)));
    for (i, a) in alpha.iter().enumerate() {
        let share: Vec<f64> = xs.iter().map(|x| x.element(i).unwrap().num().unwrap()).collect();
        let marginal = s::Beta::new(*a, alpha.iter().sum::<f64>() - a).unwrap();
        let d = distance(share, &|x| marginal.cdf(x));
        assert!(d < 2.2, "share {i}: {d}");
    }
    let tiny = make("dirichlet", &[1e-4; 5]);
    for _ in 0..1000 {
        let x = tiny.sample(&mut rng);
        assert!(tiny.support().contains(&x) && tiny.log_density(&x).is_finite(), "{x:?}");
    }
}

#[test]
fn angles_fill_cells_of_equal_probability() {
    for (i, p) in
        [[1.0, 1e-9], [0.5, 0.7], [-3.0, 3.0], [3.1, 50.0], [0.0, 1e5]].into_iter().enumerate()
    {
        let d = make("von_mises", &p);
        let xs = draws(&d, 420 + i as u64);
        // The distribution function by summing steps around the mean, from the opposite
        // direction on.
        let (steps, reach) = (20_000, PI.min(12.0 / p[1].sqrt()));
        let h = 2.0 * reach / f64::from(steps);
        let at = |k: i32| {
            make("von_mises", &[0.0, p[1]]).log_density_num(-reach + h * (f64::from(k) + 0.5)).exp()
                * h
        };
        let mut sums = vec![0.0];
        (0..steps).for_each(|k| sums.push(sums[k as usize] + at(k)));
        let turned: Vec<f64> = xs.iter().map(|x| ((x - p[0] + PI).rem_euclid(TAU)) - PI).collect();
        let cdf = |x: f64| sums[(((x + reach) / h).round().max(0.0) as usize).min(sums.len() - 1)];
        let mut cells = [0.0; 20];
        turned.iter().for_each(|x| cells[((cdf(*x) * 20.0) as usize).min(19)] += 1.0);
        let expected = DRAWS as f64 / 20.0;
        let statistic: f64 = cells.iter().map(|c| (c - expected) * (c - expected) / expected).sum();
        // 19 degrees of freedom: 50 is exceeded with probability 1.3e-4.
        assert!(statistic < 50.0, "{p:?}: {statistic}");
    }
}

#[test]
fn counts_of_kinds_have_binomial_marginals() {
    let d = make("multinomial", &[12.0, 2.0, 0.0, 1.0, 3.0]);
    let mut rng = stream(430);
    let xs: Vec<Datum> = (0..DRAWS).map(|_| d.sample(&mut rng)).collect();
    assert!(xs.iter().all(|x| d.support().contains(x) && d.log_density(x).is_finite()));
    for (i, w) in [2.0, 0.0, 1.0, 3.0].into_iter().enumerate() {
        let counts: Vec<f64> = xs.iter().map(|x| numbers(x)[i]).collect();
        let (statistic, freedom) = chi_square(&counts, &make("binomial", &[12.0, w / 6.0]), 0..=12);
        assert!(statistic < 15.0 + 3.0 * freedom as f64, "kind {i}: {statistic} with {freedom}");
    }
    // The covariance of two counts is -n p q.
    let (mean, n) = ([4.0, 6.0], DRAWS as f64);
    let covariance: f64 =
        xs.iter().map(|x| (numbers(x)[0] - mean[0]) * (numbers(x)[3] - mean[1])).sum::<f64>() / n;
    assert!((covariance + 12.0 / 3.0 / 2.0).abs() < 0.1, "{covariance}");
}

#[test]
fn sorted_draws_are_order_statistics() {
    let d = Ordered::new(make("uniform", &[0.0, 1.0]), 3).unwrap();
    let mut rng = stream(431);
    let xs: Vec<Vec<f64>> = (0..DRAWS).map(|_| numbers(&d.sample(&mut rng))).collect();
    for k in 0..3 {
        let marginal = s::Beta::new((k + 1) as f64, (3 - k) as f64).unwrap();
        let d = distance(xs.iter().map(|x| x[k]).collect(), &|x| marginal.cdf(x));
        assert!(d < 2.2, "number {k}: {d}");
    }
}
