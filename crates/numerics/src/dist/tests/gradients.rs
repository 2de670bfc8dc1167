//! Tests of gradients against central differences.

use super::*;

/// Returns a central difference with Richardson extrapolation: its error is of order h^4.
fn difference(f: impl Fn(f64) -> f64, x: f64) -> f64 {
    let h = 1e-3 * x.abs().clamp(1e-2, 1e3);
    let d = |h: f64| (f(x + h) - f(x - h)) / (2.0 * h);
    (4.0 * d(h / 2.0) - d(h)) / 3.0
}

fn close(got: f64, expected: f64, what: &str) {
    assert!(
        (got - expected).abs() <= 1e-6 * (1.0 + expected.abs()),
        "{what}: {got} against {expected}"
    );
}

#[test]
fn numbers() {
    let cases: &[(&str, &[f64], &[f64])] = &[
        ("normal", &[1.0, 2.0], &[-3.0, 1.0, 9.0]),
        ("lognormal", &[0.5, 0.7], &[0.1, 1.0, 5.0]),
        ("uniform", &[-1.0, 2.0], &[0.0, 1.5]),
        ("beta", &[2.0, 0.7], &[0.1, 0.5, 0.9]),
        ("beta", &[90.0, 120.0], &[0.3, 0.45, 0.6]),
        ("gamma", &[0.4, 2.0], &[0.05, 1.0, 4.0]),
        ("gamma", &[90.0, 3.0], &[20.0, 31.0]),
        ("exponential", &[0.3], &[0.5, 8.0]),
        ("half_normal", &[1.5], &[0.2, 4.0]),
        ("half_cauchy", &[-1.0, 0.5], &[-0.9, 0.0, 30.0]),
        ("student_t", &[3.0, 1.0, 0.5], &[-4.0, 1.1, 2.0, 300.0]),
        ("student_t", &[0.2, 0.0, 2.0], &[-50.0, 0.1]),
        ("binomial", &[20.0, 0.3], &[0.0, 6.0, 20.0]),
        ("poisson", &[4.0], &[0.0, 3.0, 12.0]),
        ("binomial_logit", &[20.0, -0.8], &[0.0, 6.0, 20.0]),
        ("binomial_logit", &[20.0, 35.0], &[0.0, 6.0, 20.0]),
        ("poisson_log", &[1.3], &[0.0, 3.0, 12.0]),
        ("poisson_log", &[-20.0], &[0.0, 3.0, 12.0]),
        ("categorical_logits", &[0.2, -1.5, 3.0], &[0.0, 1.0, 2.0]),
        ("categorical", &[1.0, 2.0, 0.5], &[0.0, 1.0, 2.0]),
        ("truncated_normal", &[0.5, 2.0, -1.0, 3.0], &[-0.5, 0.6, 2.5]),
        ("truncated_normal", &[0.5, 2.0, 8.0, 10.0], &[8.5, 9.5]),
        ("truncated_normal", &[0.5, 2.0, 0.4, 0.9], &[0.6]),
        ("truncated_normal", &[0.0, 1.0, -9.0, -8.0], &[-8.5]),
        ("inv_gamma", &[0.4, 2.0], &[0.05, 1.0, 40.0]),
        ("inv_gamma", &[90.0, 30.0], &[0.2, 0.4]),
        ("cauchy", &[1.0, 0.5], &[-30.0, 0.9, 2.0]),
        ("laplace", &[1.0, 0.5], &[-30.0, 0.9, 2.0]),
        ("von_mises", &[1.0, 0.5], &[-3.0, 0.9, 2.0]),
        ("von_mises", &[-1.0, 40.0], &[-1.3, -0.7]),
        ("weibull", &[0.6, 3.0], &[0.05, 1.0, 9.0]),
        ("weibull", &[8.0, 3.0], &[2.0, 3.5]),
        ("neg_binomial", &[2.5, 0.3], &[0.0, 4.0, 30.0]),
        ("geometric", &[0.3], &[0.0, 4.0]),
    ];
    for (family, p, points) in cases {
        for x in *points {
            let d = make(family, p);
            let g = d.gradient(&Datum::Num(*x)).unwrap();
            assert_eq!(g.params.len(), p.len());
            assert_eq!(g.x.len(), d.support().gradient_dim());
            if let [by_x] = g.x[..] {
                close(
                    by_x,
                    difference(|x| d.log_density_num(x), *x),
                    &format!("{family}{p:?} by x at {x}"),
                );
            }
            for i in 0..p.len() {
                if i == 0 && family.starts_with("binomial") {
                    assert_eq!(g.params[0], 0.0);
                    continue;
                }
                let at = |v: f64| {
                    let mut p = p.to_vec();
                    p[i] = v;
                    make(family, &p).log_density_num(*x)
                };
                close(
                    g.params[i],
                    difference(at, p[i]),
                    &format!("{family}{p:?} by parameter {i} at {x}"),
                );
            }
        }
    }
}

#[test]
fn infinite_bounds_and_flat_densities() {
    let half = make("truncated_normal", &[0.5, 2.0, 8.0, INF]);
    let g = half.gradient(&Datum::Num(9.0)).unwrap();
    let by_lo =
        difference(|lo| make("truncated_normal", &[0.5, 2.0, lo, INF]).log_density_num(9.0), 8.0);
    close(g.params[2], by_lo, "by the lower bound");
    assert_eq!(g.params[3], 0.0);
    let flat = make("flat", &[]).gradient(&Datum::Num(9.0)).unwrap();
    assert_eq!((flat.x, flat.params), (vec![0.0], vec![0.0; 2]));
    let x: Datum = vec![2.0, 0.0, 5.0].into();
    let at = |w: f64| make("multinomial", &[7.0, 1.0, 0.5, w]).log_density(&x);
    let g = make("multinomial", &[7.0, 1.0, 0.5, 2.0]).gradient(&x).unwrap();
    assert_eq!((g.x.len(), g.params.len(), g.params[0]), (0, 4, 0.0));
    close(g.params[3], difference(at, 2.0), "multinomial by a weight");
    let sorted = |sd: f64| Ordered::new(make("normal", &[1.0, sd]), 3).unwrap();
    let x: Datum = vec![-2.0, 0.1, 5.0].into();
    let g = sorted(1.5).gradient(&x).unwrap();
    close(g.params[1], difference(|sd| sorted(sd).log_density(&x), 1.5), "ordered by sd");
    let moved = |v: f64| sorted(1.5).log_density(&vec![-2.0, v, 5.0].into());
    close(g.x[1], difference(moved, 0.1), "ordered by x");
}

#[test]
fn truth_values() {
    for x in [false, true] {
        let g = make("flip", &[0.3]).gradient(&Datum::Bool(x)).unwrap();
        close(
            g.params[0],
            difference(|p| make("flip", &[p]).log_density_bool(x), 0.3),
            "flip by p",
        );
        assert!(g.x.is_empty());
    }
    assert!(make("flip", &[0.0]).gradient(&Datum::Bool(true)).is_none());
}

#[test]
fn shares() {
    // The formula extends off the simplex, so the derivatives with respect to x come from
    // the definition of the density.
    let (alpha, x) = ([0.5, 2.0, 3.5], [0.2, 0.3, 0.5]);
    let g = make("dirichlet", &alpha).gradient(&x.to_vec().into()).unwrap();
    for i in 0..3 {
        close(g.x[i], (alpha[i] - 1.0) / x[i], "dirichlet by x");
        let at = |v: f64| {
            let mut alpha = alpha;
            alpha[i] = v;
            make("dirichlet", &alpha).log_density(&x.to_vec().into())
        };
        close(g.params[i], difference(at, alpha[i]), "dirichlet by alpha");
    }
}

#[test]
fn vectors_and_products() {
    let cov = square(3, &[2.0, 0.6, 0.1, 0.6, 1.0, -0.3, 0.1, -0.3, 0.7]);
    let mean = [1.0, -1.0, 0.5];
    let parts = vec![make("normal", &[0.0, 2.0]), make("gamma", &[2.0, 1.0]), make("flip", &[0.2])];
    let three = |x: &[f64]| -> Datum { x.to_vec().into() };
    let mv = Dist::from(MvNormal::from_cov(&mean, &cov).unwrap());
    let iid = Dist::from(Iid::new(make("student_t", &[3.0, 0.0, 1.0]), 3).unwrap());
    let at = [0.3, 1.7, -0.4];
    for d in [&mv, &iid] {
        let g = d.gradient(&three(&at)).unwrap();
        for i in 0..3 {
            let f = |v: f64| {
                let mut x = at;
                x[i] = v;
                d.log_density(&three(&x))
            };
            close(g.x[i], difference(f, at[i]), d.name());
        }
    }
    for i in 0..3 {
        let f = |v: f64| {
            let mut mean = mean;
            mean[i] = v;
            MvNormal::from_cov(&mean, &cov).unwrap().log_density(&three(&at))
        };
        close(
            mv.gradient(&three(&at)).unwrap().params[i],
            difference(f, mean[i]),
            "mv_normal by the mean",
        );
    }
    let by_scale = difference(
        |v| Iid::new(make("student_t", &[3.0, 0.0, v]), 3).unwrap().log_density(&three(&at)),
        1.0,
    );
    close(iid.gradient(&three(&at)).unwrap().params[2], by_scale, "iid by a shared parameter");

    let product = Product::new(parts).unwrap();
    let x = Datum::List(vec![Datum::Num(0.5), Datum::Num(1.5), Datum::Bool(true)].into());
    let g = product.gradient(&x).unwrap();
    assert_eq!((g.x.len(), g.params.len()), (2, 5));
    close(g.x[0], -0.125, "the normal element");
    close(g.x[1], 1.0 / 1.5 - 1.0, "the gamma element");
    close(g.params[4], 5.0, "the flip element");
}

#[test]
fn bounds_move_values_as_differences_say() {
    let (y, slope) = (0.7, 1.3);
    // f(x) = slope x, plus the log Jacobian.
    let f = |d: &Dist| {
        let (x, jacobian) = d.support().from_free(&[y]);
        slope * x.num().unwrap() + jacobian
    };
    for family in ["uniform", "half_cauchy"] {
        let at = [0.5, 2.0];
        let d = make(family, &at);
        let (x, _) = d.support().from_free(&[y]);
        let found = d.by_bounds(&x, slope).unwrap();
        for i in 0..2 {
            let moved = |h: f64| {
                let mut p = at;
                p[i] += h;
                f(&make(family, &p))
            };
            assert!(
                (found[i] - (moved(1e-6) - moved(-1e-6)) / 2e-6).abs() < 1e-6,
                "{i}: {found:?}"
            );
        }
    }
    let normal = make("normal", &[0.0, 1.0]);
    assert_eq!(normal.by_bounds(&Datum::Num(0.3), 1.0), Some(vec![0.0, 0.0]));
    assert!(!normal.has_moving_support());
}
