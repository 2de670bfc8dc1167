//! Tests at the ends of supports and parameter domains, and with values of the wrong
//! kind.

use super::*;

const NEVER: f64 = f64::NEG_INFINITY;

fn at(family: &str, p: &[f64], x: f64) -> f64 {
    make(family, p).log_density_num(x)
}

#[test]
fn poles_and_ends() {
    assert_eq!(at("beta", &[0.01, 0.01], 0.0), f64::INFINITY);
    assert_eq!(at("beta", &[0.01, 0.01], 1.0), f64::INFINITY);
    assert!(at("beta", &[0.01, 0.01], 1e-300).is_finite());
    assert!(at("beta", &[0.01, 0.01], 1f64.next_down()).is_finite());
    assert_eq!(at("beta", &[1.0, 2.0], 0.0), 2f64.ln());
    assert_eq!(at("beta", &[100.0, 100.0], 0.0), NEVER);
    assert_eq!(at("gamma", &[1.0, 1.0], 0.0), NEVER);
    assert_eq!(at("exponential", &[2.0], 0.0), 2f64.ln());
    assert_eq!(at("uniform", &[1.0, 3.0], 1.0), -(2f64.ln()));
    assert_eq!(at("uniform", &[1.0, 3.0], 3.0), -(2f64.ln()));
    assert_eq!(at("uniform", &[1.0, 3.0], 1f64.next_down()), NEVER);
    assert_eq!(at("lognormal", &[0.0, 1.0], 0.0), NEVER);
    assert_eq!(at("lognormal", &[0.0, 1.0], f64::INFINITY), NEVER);
    assert_eq!(at("poisson", &[0.0], 0.0), 0.0);
    assert_eq!(at("poisson", &[0.0], 1.0), NEVER);
    assert_eq!(at("poisson", &[3.0], 1e308), NEVER);
    assert_eq!(make("flip", &[1.0]).log_density_bool(true), 0.0);
    assert_eq!(make("flip", &[1.0]).log_density_bool(false), NEVER);
    assert_eq!(at("truncated_normal", &[0.0, 1.0, 1.0, 2.0], 1f64.next_down()), NEVER);
    assert!(at("truncated_normal", &[0.0, 1.0, 1.0, 2.0], 2.0).is_finite());
    assert_eq!(at("inv_gamma", &[1.0, 1.0], 0.0), NEVER);
    assert_eq!(at("weibull", &[0.5, 1.0], 0.0), NEVER);
    assert_eq!(at("laplace", &[1.0, 0.5], 1.0), 0.0);
    assert_eq!(at("von_mises", &[0.0, 1.0], -std::f64::consts::PI), NEVER);
    assert_eq!(
        at("von_mises", &[7.0, 2.0], 1.0),
        at("von_mises", &[7.0 - std::f64::consts::TAU, 2.0], 1.0)
    );
    assert_eq!(at("neg_binomial", &[2.0, 1.0], 0.0), 0.0);
    assert_eq!(at("neg_binomial", &[2.0, 1.0], 1.0), NEVER);
    assert_eq!(at("geometric", &[1.0], 0.0), 0.0);
    assert_eq!(at("flat", &[], -1e300), 0.0);
    assert_eq!(make("multinomial", &[0.0, 1.0, 1.0]).log_density(&vec![0.0, 0.0].into()), 0.0);
    assert_eq!(
        make("lkj", &[1.0, 2.0]).log_density(&Datum::List(vec![vec![1.0].into()].into())),
        0.0
    );
    let shares =
        |alpha: &[f64], x: [f64; 3]| make("dirichlet", alpha).log_density(&x.to_vec().into());
    assert_eq!(shares(&[0.5, 1.0, 2.0], [0.0, 0.5, 0.5]), f64::INFINITY);
    assert_eq!(shares(&[0.5, 1.0, 2.0], [0.0, 1.0, 0.0]), NEVER);
    assert_eq!(shares(&[1.0, 1.0, 1.0], [0.0, 1.0, 0.0]), 2f64.ln());
    assert_eq!(shares(&[1.0, 1.0, 1.0], [0.3, 0.3, 0.3]), NEVER);
}

/// Returns distributions of every family, including extreme ones.
fn zoo() -> Vec<Dist> {
    let cases: &[(&str, &[f64])] = &[
        ("normal", &[0.0, 1.0]),
        ("normal", &[1e308, 1e-300]),
        ("lognormal", &[700.0, 100.0]),
        ("uniform", &[-1e300, 1e300]),
        ("beta", &[0.01, 0.01]),
        ("beta", &[1e300, 1e300]),
        ("beta", &[1e-300, 1e-300]),
        ("gamma", &[1e-300, 1e300]),
        ("gamma", &[1e300, 1e-300]),
        ("exponential", &[1e-300]),
        ("half_normal", &[1e308]),
        ("half_cauchy", &[-1e308, 1e308]),
        ("normal", &[-1e308, 1e308]),
        ("student_t", &[0.5, 1e308, 1e308]),
        ("student_t", &[1e-3, 0.0, 1.0]),
        ("student_t", &[1e300, 1e308, 1e-300]),
        ("flip", &[0.0]),
        ("uniform_discrete", &[-9e15, 9e15]),
        ("binomial", &[9e15, 0.5]),
        ("binomial", &[9e15, 1e-300]),
        ("poisson", &[9e15]),
        ("poisson", &[1e-300]),
        ("categorical", &[1e-300, 1e300]),
        ("dirichlet", &[1e-300, 1e300, 1.0]),
        ("dirichlet", &[2.0]),
        ("truncated_normal", &[0.0, 1.0, -INF, INF]),
        ("truncated_normal", &[0.0, 1e-300, 1e-155, INF]),
        ("truncated_normal", &[1e308, 1e308, -1e308, 1e308]),
        ("truncated_normal", &[0.0, 1.0, -1e149, 1.0]),
        ("truncated_normal", &[0.0, 1.0, 1e149, 2e149]),
        ("truncated_normal", &[0.0, 1.0, -1e-300, 1e-300]),
        ("truncated_normal", &[0.0, 1.0, 1.0, 1f64.next_up()]),
        ("inv_gamma", &[1e-300, 1e300]),
        ("inv_gamma", &[1e300, 1e-300]),
        ("inv_gamma", &[100.0, 1e-300]),
        ("cauchy", &[-1e308, 1e308]),
        ("laplace", &[1e308, 1e-300]),
        ("von_mises", &[1e308, 1e300]),
        ("von_mises", &[3.0, 1e-300]),
        ("von_mises", &[3.0, 1e-14]),
        ("weibull", &[1e-300, 1e300]),
        ("weibull", &[1e300, 1e-300]),
        ("neg_binomial", &[1e-300, 1e-300]),
        ("neg_binomial", &[1e300, 1e-300]),
        ("neg_binomial", &[0.9, 0.5]),
        ("neg_binomial", &[1e300, 1.0]),
        ("geometric", &[1e-320]),
        ("flat", &[]),
        ("multinomial", &[9e15, 1e-300, 1e300, 1.0]),
        ("lkj", &[3.0, 1e-300]),
        ("lkj", &[3.0, 1e300]),
    ];
    let mut all: Vec<Dist> = cases.iter().map(|(f, p)| make(f, p)).collect();
    let parts = all[..3].to_vec();
    all.push(Dist::from(Product::new(parts).unwrap()));
    all.push(Dist::from(Iid::new(make("normal", &[0.0, 1.0]), 3).unwrap()));
    let identity = nalgebra::DMatrix::identity(3, 3);
    all.push(Dist::from(MvNormal::from_cov(&[0.0; 3], &identity).unwrap()));
    let whitened = MvNormal::from_cov(&[0.0; 3], &identity).unwrap().to_whitened();
    all.push(Dist::from(whitened));
    let scale = square(3, &[1e-100, 0.0, 0.0, 1e100, 1e100, 0.0, 0.0, 0.0, 1.0]);
    for df in [2.0001, 3.0, 1e300] {
        all.push(Dist::from(Wishart::new(df, &scale).unwrap()));
    }
    for one in [make("cauchy", &[0.0, 1e300]), make("uniform", &[0.0, 1.0]), make("flat", &[])] {
        all.push(Dist::from(Ordered::new(one, 3).unwrap()));
    }
    for (family, p, lo, hi) in [
        ("gamma", &[2.0, 1.0][..], 3000.0, INF),
        ("gamma", &[1e-3, 1.0], 1e-300, 1e300),
        ("lognormal", &[0.0, 1.0], 1e10, INF),
        ("cauchy", &[0.0, 1.0], -1e300, 1e-300),
        ("student_t", &[3.0, 0.0, 1.0], 1e5, 1e6),
        ("beta", &[0.01, 0.01], 0.0, 1e-300),
        ("exponential", &[1.0], 1.0, 1f64.next_up()),
        ("laplace", &[0.0, 1e-300], -1.0, 1.0),
        ("poisson", &[1.0], 150.0, INF),
        ("binomial", &[1e6, 0.5], 0.0, 10.0),
        ("uniform", &[-1e300, 1e300], 0.0, 1.0),
    ] {
        all.push(crate::dist::truncated(&make(family, p), lo, hi).unwrap());
    }
    all.push(make("flat", &[1.0, INF]));
    all.push(make("flat", &[-INF, -1.0]));
    let extremes = vec![
        make("beta", &[0.01, 0.01]),
        make("cauchy", &[0.0, 1e300]),
        make("gamma", &[1e-3, 1.0]),
    ];
    all.push(Dist::from(Mixture::new(&[1.0, 1e-300, 0.0], extremes).unwrap()));
    let gp = |centred| {
        Gp::new(vec![0.0; 3], &Covariance::sq_exp(1.0, 1.0).unwrap(), &[0.0, 1.0, 1.0], centred)
            .unwrap()
    };
    all.push(Dist::from(gp(false)));
    all.push(Dist::from(gp(true)));
    all
}

#[test]
fn nothing_is_ever_nan() {
    let extremes = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.5,
        1e-320,
        1e-300,
        1e300,
        -1e300,
        f64::MAX,
        f64::MIN,
        1e16,
        40.0,
        2.5,
    ];
    let infinite = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
    for d in zoo() {
        for x in extremes.into_iter().chain(infinite) {
            let others = [
                vec![x; 3].into(),
                Datum::List(vec![Datum::Num(x), Datum::Num(0.5), Datum::Num(x)].into()),
            ];
            let matrix = Datum::List(vec![vec![x; 3].into(); 3].into());
            let triangle = Datum::List(
                (0..3)
                    .map(|i| {
                        (0..3)
                            .map(|j| if j < i { 0.0 } else { x * f64::from(u8::from(i == j)) })
                            .collect::<Vec<_>>()
                            .into()
                    })
                    .collect(),
            );
            for x in others.into_iter().chain([matrix, triangle]).chain([Datum::Num(x)]) {
                let p = d.log_density(&x);
                assert!(!p.is_nan(), "{d:?} at {x:?}");
                assert!(!d.log_density_stored(&x).is_nan(), "{d:?} at {x:?}");
                if !d.support().contains(&x) && !is_truth(&d, &x) {
                    assert_eq!(p, NEVER, "{d:?} at {x:?}");
                }
                if let Some(g) = d.gradient(&x) {
                    assert!(
                        g.x.iter().chain(&g.params).all(|g| !g.is_nan()),
                        "{d:?} at {x:?}: {g:?}"
                    );
                }
            }
        }
        for x in infinite {
            assert_eq!(d.log_density_num(x), NEVER, "{d:?} at {x}");
        }
    }
}

/// Returns whether `x` is a number that stands for a truth value.
fn is_truth(d: &Dist, x: &Datum) -> bool {
    matches!(d, Dist::Flip(_)) && matches!(x, Datum::Num(0.0 | 1.0))
}

#[test]
fn extreme_draws_are_in_the_support() {
    let mut rng = stream(600);
    for d in zoo() {
        for _ in 0..200 {
            let x = d.sample(&mut rng);
            assert!(d.support().contains(&x), "{d:?} drew {x:?}");
            let s = d.sample_stored(&mut rng);
            assert!(
                d.stored_support().contains(&s) && d.log_density_stored(&s) > NEVER,
                "{d:?} drew {s:?}"
            );
        }
    }
}

#[test]
fn other_kinds_of_values_are_impossible() {
    let kinds = [
        Datum::Num(0.0),
        Datum::Bool(false),
        vec![0.25; 4].into(),
        Datum::List(vec![Datum::Bool(true)].into()),
    ];
    for d in zoo() {
        for x in &kinds {
            if !d.support().fits(x) && !is_truth(&d, x) {
                assert_eq!(d.log_density(x), NEVER, "{d:?} at {x:?}");
                assert!(d.gradient(x).is_none());
            }
        }
        assert!(d.support().fits(&d.sample(&mut stream(601))));
    }
}

#[test]
fn bad_parameters_are_errors_that_say_so() {
    let message = |family: &str, p: &[f64]| try_make(family, p).unwrap_err().to_string();
    assert_eq!(message("normal", &[0.0, -0.3]), "normal: sd must be positive and finite, got -0.3");
    assert_eq!(message("uniform", &[2.0, 1.0]), "uniform: lo must be below hi, got 2 and 1");
    assert_eq!(message("flip", &[1.5]), "flip: p must be between 0 and 1, got 1.5");
    assert_eq!(
        message("categorical", &[0.0, 0.0]),
        "categorical: weights must have a positive, finite sum, got 0"
    );
    assert_eq!(
        message("binomial", &[2.5, 0.5]),
        "binomial: n must be an integer of at most 2^53, got 2.5"
    );
    // Bounds with a default may be infinite.
    let bounded = |f: &&Family| f.params.iter().any(|p| p.default.is_some());
    let numbers = FAMILIES.iter().filter(|f| f.numbers.is_some() && !bounded(f));
    let others = [("categorical", 2), ("dirichlet", 2), ("multinomial", 3), ("lkj", 2)];
    let sizes = numbers.map(|f| (f.name, f.params.len())).chain(others);
    for (family, n) in sizes {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for i in 0..n {
                let mut p = vec![1.0; n];
                p[i] = bad;
                assert!(try_make(family, &p).is_err(), "{family}{p:?}");
            }
        }
    }
    let bad = [
        [0.0, 1.0, 2.0, 1.0],
        [0.0, 1.0, f64::NAN, 1.0],
        [0.0, 1e-300, 1.0, 2.0],
        [INF, 1.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 1.0],
    ];
    for p in bad.iter().chain([&[0.0, 1.0, INF, INF], &[0.0, 1.0, -INF, -INF]]) {
        assert!(try_make("truncated_normal", p).is_err(), "{p:?}");
    }
    assert_eq!(
        message("truncated_normal", &[0.0, 1e-300, 1.0, 2.0]),
        "truncated_normal: lo to hi must be within 1e150 sd of the mean, got 1 and 2"
    );
    assert_eq!(
        message("multinomial", &[3.0, 0.0]),
        "multinomial: weights must have a positive, finite sum, got 0"
    );
    assert_eq!(message("geometric", &[0.0]), "geometric: p must be above 0 and at most 1, got 0");
    assert_eq!(message("lkj", &[0.0, 1.0]), "lkj: n must be between 1 and 1000, got 0");
    assert!(try_make("uniform", &[-1e308, 1e308]).is_err());
    assert!(try_make("dirichlet", &[]).is_err() && try_make("categorical", &[]).is_err());
}

/// Where the probabilities themselves round to 0 and 1. The values are from mpmath.
#[test]
fn log_odds_keep_their_digits() {
    let near = |found: f64, wanted: f64| {
        assert!((found - wanted).abs() <= 4e-15 * wanted.abs(), "{found} is not {wanted}");
    };
    let flip = |l: f64, x: bool| make("flip_logit", &[l]).log_density_bool(x);
    assert_eq!((flip(40.0, false), flip(-800.0, true)), (-40.0, -800.0));
    near(flip(40.0, true), -libm::exp(-40.0));
    near(flip(0.5, true), -0.474_076_984_180_107_67);
    let at = |family: &str, p: &[f64], k: f64| make(family, p).log_density_num(k);
    near(at("binomial_logit", &[7.0, 40.0], 5.0), 21f64.ln() - 80.0);
    near(at("binomial_logit", &[7.0, -800.0], 7.0), -5600.0);
    near(at("binomial_logit", &[7.0, -800.0], 2.0), 21f64.ln() - 1600.0);
    near(at("poisson_log", &[-800.0], 3.0), -2400.0 - 6f64.ln());
    near(at("poisson_log", &[-800.0], 0.0), -libm::exp(-800.0));
    near(at("categorical_logits", &[0.0, 1000.0, -INF], 0.0), -1000.0);
    assert_eq!(at("categorical_logits", &[0.0, 1000.0, -INF], 2.0), NEVER);
    assert_eq!(at("categorical_logits", &[0.0, 1000.0], 0.5), NEVER);
    // In the ordinary range they are the other parametrisations.
    for l in [-3.0, -0.4, 0.0, 1.7] {
        let p = crate::num::expit(l);
        for k in [0.0, 4.0, 9.0] {
            let one = at("binomial", &[9.0, p], k);
            assert!((at("binomial_logit", &[9.0, l], k) - one).abs() < 1e-13 * one.abs());
            let one = at("poisson", &[libm::exp(l)], k);
            assert!((at("poisson_log", &[l], k) - one).abs() < 1e-13 * one.abs().max(1.0));
        }
    }
    let message = |family: &str, p: &[f64]| try_make(family, p).unwrap_err().to_string();
    assert_eq!(message("poisson_log", &[37.0]), "poisson: log must be at most log(2^53), got 37");
    assert_eq!(message("flip_logit", &[INF]), "flip: logit must be finite, got inf");
    assert_eq!(
        message("categorical_logits", &[-INF]),
        "categorical: logits must have a finite log_sum_exp, got -inf"
    );
}

#[test]
fn finite_supports_list_their_values() {
    let numbers = |d: &Dist| {
        d.support().finite_values().map(|v| v.iter().filter_map(Datum::num).collect::<Vec<_>>())
    };
    assert_eq!(numbers(&make("binomial", &[3.0, 0.5])), Some(vec![0.0, 1.0, 2.0, 3.0]));
    assert_eq!(numbers(&make("uniform_discrete", &[-1.0, 1.0])), Some(vec![-1.0, 0.0, 1.0]));
    assert_eq!(numbers(&make("categorical", &[1.0, 1.0])), Some(vec![0.0, 1.0]));
    assert_eq!(
        make("flip", &[0.5]).support().finite_values(),
        Some(vec![Datum::Bool(false), Datum::Bool(true)])
    );
    for d in [make("poisson", &[1.0]), make("binomial", &[1e9, 0.5]), make("normal", &[0.0, 1.0])] {
        assert_eq!(d.support().finite_values(), None);
        assert!(!d.support().is_finite());
    }
}

#[test]
fn elements_are_distributions_of_their_own() {
    let parts = vec![make("normal", &[0.0, 1.0]), make("flip", &[0.3])];
    let product = Dist::from(Product::new(parts.clone()).unwrap());
    assert_eq!(product.elements(), Some(2));
    assert_eq!(parts[0].elements(), None);
    let x = Datum::List(vec![Datum::Num(0.4), Datum::Bool(true)].into());
    let sum: f64 = (0..2).map(|i| product.element_log_density(i, &x.element(i).unwrap())).sum();
    assert_eq!(sum, product.log_density(&x));
    assert_eq!(product.element(1).log_density_bool(true), parts[1].log_density_bool(true));
    assert_eq!(product.element_log_density(2, &Datum::Num(0.0)), NEVER);
    let none = Dist::from(Iid::new(parts[0].clone(), 0).unwrap());
    assert_eq!(none.log_density(&none.sample(&mut stream(602))), 0.0);
    let gp =
        Gp::new(vec![0.0; 2], &Covariance::sq_exp(1.0, 1.0).unwrap(), &[0.0, 1.0], false).unwrap();
    let two = Dist::from(Iid::new(Dist::from(gp), 2).unwrap());
    assert!(!two.element(0).is_stored_whitened() && two.is_gaussian());
}
