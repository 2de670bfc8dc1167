//! Tests that densities integrate to 1 over unconstrained space and that probabilities
//! sum to 1.

use super::*;

#[test]
fn continuous_densities_integrate_to_one() {
    let cases: &[(&str, &[f64])] = &[
        ("normal", &[3.0, 0.7]),
        ("lognormal", &[0.5, 1.2]),
        ("uniform", &[-2.0, 1.0]),
        ("beta", &[2.0, 3.0]),
        ("beta", &[0.2, 1.4]),
        ("beta", &[80.0, 70.0]),
        ("gamma", &[0.2, 3.0]),
        ("gamma", &[7.0, 0.01]),
        ("gamma", &[80.0, 1.0]),
        ("exponential", &[40.0]),
        ("half_normal", &[0.1]),
        ("half_cauchy", &[2.0, 0.5]),
        ("student_t", &[4.0, 1.0, 2.0]),
        ("truncated_normal", &[0.3, 2.0, -INF, INF]),
        ("truncated_normal", &[0.0, 1.0, 30.0, INF]),
        ("truncated_normal", &[0.0, 0.5, -INF, -4.0]),
        ("truncated_normal", &[0.0, 1.0, 30.0, 30.01]),
        ("truncated_normal", &[1.0, 1.0, 0.9, 3.5]),
        ("truncated_normal", &[1.0, 1.0, -100.0, -3.0]),
        ("inv_gamma", &[0.3, 2.0]),
        ("inv_gamma", &[80.0, 70.0]),
        ("weibull", &[0.3, 2.0]),
        ("weibull", &[9.0, 2.0]),
    ];
    for (family, p) in cases {
        let d = make(family, p);
        let s = d.support();
        // The trapezoidal rule converges fast here because everything decays at both
        // ends.
        let (from, to) = if s == Support::Real { (-2000.0, 2000.0) } else { (-200.0, 200.0) };
        let n = 200_000;
        let h = (to - from) / f64::from(n);
        let term = |i: i32| {
            let (x, jacobian) = s.from_free_scalar(from + h * f64::from(i));
            (d.log_density_num(x) + jacobian).exp()
        };
        let total: f64 = (0..=n).map(term).sum::<f64>() * h;
        assert!((total - 1.0).abs() < 1e-9, "{family}{p:?}: {total}");
    }
}

#[test]
fn probabilities_sum_to_one() {
    let cases: &[(&str, &[f64], i64)] = &[
        ("uniform_discrete", &[-4.0, 9.0], 9),
        ("binomial", &[0.0, 0.2], 0),
        ("binomial", &[17.0, 0.0], 17),
        ("binomial", &[17.0, 1.0], 17),
        ("binomial", &[17.0, 0.3], 17),
        ("binomial", &[5000.0, 0.7], 5000),
        ("poisson", &[0.0], 5),
        ("poisson", &[0.3], 40),
        ("poisson", &[500.0], 2000),
        ("neg_binomial", &[0.4, 0.3], 200),
        ("neg_binomial", &[1e-12, 0.3], 200),
        ("neg_binomial", &[50.0, 0.2], 1000),
        ("neg_binomial", &[2.0, 1.0], 3),
        ("geometric", &[0.2], 200),
        ("geometric", &[1.0], 3),
        ("categorical", &[3.0, 0.0, 1e-3, 5.0], 3),
        ("binomial_logit", &[17.0, 0.4], 17),
        ("binomial_logit", &[17.0, -800.0], 17),
        ("poisson_log", &[5.0], 1000),
        ("categorical_logits", &[3.0, -INF, 700.0, 701.0], 3),
    ];
    for (family, p, last) in cases {
        let d = make(family, p);
        let total: f64 = (-5..=*last).map(|k| d.log_density_num(k as f64).exp()).sum();
        assert!((total - 1.0).abs() < 1e-12, "{family}{p:?}: {total}");
    }
}

#[test]
fn shares_integrate_to_one() {
    // Over a grid in the two free coordinates.
    let d = make("dirichlet", &[0.7, 2.0, 1.5]);
    let s = d.support();
    let h = 0.05;
    let mut total = 0.0;
    for i in -900..=900 {
        for j in -900..=900 {
            let (x, jacobian) = s.from_free(&[h * f64::from(i), h * f64::from(j)]);
            total += (d.log_density(&x) + jacobian).exp() * h * h;
        }
    }
    assert!((total - 1.0).abs() < 1e-8, "{total}");
}

#[test]
fn angles_sides_and_heavy_tails_integrate_to_one() {
    for p in [[0.3, 0.0], [1.0, 0.2], [-3.0, 5.0], [3.1, 200.0]] {
        let d = make("von_mises", &p);
        let n = 2000;
        let h = std::f64::consts::TAU / f64::from(n);
        // Equal steps around the circle: exact to rounding for smooth periodic functions.
        let total: f64 = (1..=n)
            .map(|i| d.log_density_num(-std::f64::consts::PI + h * f64::from(i)).exp())
            .sum::<f64>()
            * h;
        assert!((total - 1.0).abs() < 1e-9, "{p:?}: {total}");
    }
    // The Laplace density has a kink, so each side is integrated separately.
    let d = make("laplace", &[1.0, 3.0]);
    let side = |sign: f64| {
        let at = |y: f64| (d.log_density_num(1.0 + sign * y.exp()) + y).exp();
        (-4000..1000).map(|i| at(0.01 * f64::from(i))).sum::<f64>() * 0.01
    };
    assert!((side(1.0) - 0.5).abs() < 1e-9 && (side(-1.0) - 0.5).abs() < 1e-9);
    // The tails of the Cauchy distribution are too heavy for the rule, but it is uniform
    // in the angle.
    let d = make("cauchy", &[1.0, 0.5]);
    for t in [-1.5f64, -0.2, 0.0, 1.4] {
        let x = 1.0 + 0.5 * t.tan();
        assert!(
            (d.log_density_num(x).exp() * 0.5 / (t.cos() * t.cos()) * std::f64::consts::PI - 1.0)
                .abs()
                < 1e-12
        );
    }
}

#[test]
fn counts_of_kinds_sum_to_one() {
    for (n, weights) in
        [(0, [1.0, 1.0, 1.0]), (7, [0.2, 3.0, 1.0]), (40, [1.0, 0.0, 2.0]), (90, [1.0, 5.0, 2.0])]
    {
        let d = Multinomial::new(f64::from(n), &weights).unwrap();
        let mut total = 0.0;
        for i in 0..=n {
            for j in 0..=n - i {
                let x: Vec<f64> = [i, j, n - i - j].map(f64::from).to_vec();
                total += d.log_density(&x.into()).exp();
            }
        }
        assert!((total - 1.0).abs() < 1e-12, "{n} {weights:?}: {total}");
    }
}

/// Integrates over a two-dimensional unconstrained space.
fn plane(d: &dyn Distribution, reach: f64, h: f64) -> f64 {
    let (s, n) = (d.support(), (reach / h) as i32);
    let mut total = 0.0;
    for i in -n..=n {
        for j in -n..=n {
            let (x, jacobian) = s.from_free(&[h * f64::from(i), h * f64::from(j)]);
            total += (d.log_density(&x) + jacobian).exp() * h * h;
        }
    }
    total
}

#[test]
fn vectors_integrate_to_one() {
    let check = |d: &dyn Distribution, reach, h| {
        let total = plane(d, reach, h);
        assert!((total - 1.0).abs() < 1e-6, "{d:?}: {total}");
    };
    check(&Ordered::new(make("normal", &[1.0, 1.5]), 2).unwrap(), 40.0, 0.05);
    check(&Ordered::new(make("uniform", &[0.0, 3.0]), 2).unwrap(), 40.0, 0.05);
    let one = make("normal", &[0.0, 1.0]);
    let pair =
        |m: f64| Dist::from(Product::new(vec![make("normal", &[m, 0.7]), one.clone()]).unwrap());
    check(&Mixture::new(&[1.0, 3.0], vec![pair(-2.0), pair(1.0)]).unwrap(), 12.0, 0.05);
    // Components whose supports differ.
    let mixed =
        Mixture::new(&[1.0, 1.0], vec![make("gamma", &[2.0, 1.0]), make("normal", &[0.0, 2.0])])
            .unwrap();
    assert_eq!(mixed.support(), Support::Real);
    let total: f64 =
        (-40_000..40_000).map(|i| mixed.log_density(&Datum::Num(f64::from(i) * 1e-3)).exp()).sum();
    assert!((total * 1e-3 - 1.0).abs() < 1e-6, "{total}");
}
