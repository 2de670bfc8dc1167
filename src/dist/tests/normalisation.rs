//! Densities integrate to 1 over unconstrained space, probabilities sum to 1.

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
    ];
    for (family, p) in cases {
        let d = make(family, p);
        let s = d.support();
        // The trapezoidal rule converges fast here: everything decays at both ends.
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
        ("categorical", &[3.0, 0.0, 1e-3, 5.0], 3),
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
