//! Tests of truncated distributions: normalisation, accuracy in the tails, draws,
//! derivatives, and invalid bounds.

use super::*;
use crate::dist::truncated;

const CONTINUOUS: &[(&str, &[f64])] = &[
    ("normal", &[0.3, 1.2]),
    ("lognormal", &[0.2, 0.7]),
    ("uniform", &[-1.0, 4.0]),
    ("beta", &[2.0, 3.5]),
    ("beta", &[0.5, 0.4]),
    ("gamma", &[2.5, 1.3]),
    ("gamma", &[0.6, 1.0]),
    ("exponential", &[0.8]),
    ("half_normal", &[1.5]),
    ("half_cauchy", &[0.1, 0.7]),
    ("student_t", &[3.0, 0.2, 0.9]),
    ("inv_gamma", &[3.0, 2.0]),
    ("cauchy", &[0.2, 0.6]),
    ("laplace", &[0.4, 0.7]),
    ("weibull", &[1.7, 1.1]),
];

const DISCRETE: &[(&str, &[f64])] = &[
    ("poisson", &[3.2]),
    ("binomial", &[12.0, 0.35]),
    ("neg_binomial", &[2.5, 0.4]),
    ("geometric", &[0.3]),
    ("uniform_discrete", &[-2.0, 9.0]),
    ("categorical", &[0.3, 0.2, 0.1, 0.9, 0.4]),
    ("poisson_log", &[1.2]),
    ("binomial_logit", &[12.0, -0.6]),
    ("categorical_logits", &[-0.3, 0.2, 1.1, -0.9, 0.4]),
];

fn cut(family: &str, p: &[f64], lo: f64, hi: f64) -> Dist {
    truncated(&make(family, p), lo, hi).unwrap()
}

fn close(found: f64, wanted: f64, tolerance: f64) {
    assert!(
        found == wanted || (found - wanted).abs() <= tolerance * wanted.abs().max(1.0),
        "{found} is not {wanted}"
    );
}

#[test]
fn densities_integrate_to_one() {
    for (family, p) in CONTINUOUS {
        for (lo, hi) in [(0.2, 0.9), (0.5, 0.50001), (0.05, 0.3), (0.3, 0.31)] {
            let d = cut(family, p, lo, hi);
            let n = 4000;
            let h = (hi - lo) / f64::from(n);
            let sum: f64 =
                (0..n).map(|i| d.log_density_num(lo + (f64::from(i) + 0.5) * h).exp() * h).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{family}{p:?} {lo} {hi}: {sum}");
        }
    }
    for (family, p) in DISCRETE {
        for (lo, hi) in
            [(1.0, 3.0), (0.5, 2.0), (2.0, 2.0), (-5.0, 4.0), (1.0, INF), (-INF, 3.0), (3.0, 400.0)]
        {
            let d = cut(family, p, lo, hi);
            let sum: f64 = (-5..500).map(|k| d.log_density_num(f64::from(k)).exp()).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{family}{p:?} {lo} {hi}: {sum}");
        }
    }
    // Without bounds it equals the base distribution.
    for (family, p) in CONTINUOUS.iter().chain(DISCRETE) {
        let (one, d) = (make(family, p), cut(family, p, -INF, INF));
        close(d.log_density_num(1.0), one.log_density_num(1.0), 1e-14);
    }
}

#[test]
fn far_tails_are_exact() {
    // The tail of an exponential is an exponential.
    for (lo, rate) in [(1e4, 1.0), (700.0, 3.0), (1e-3, 1.0), (2e9, 5.0)] {
        close(cut("exponential", &[rate], lo, INF).log_density_num(lo), rate.ln(), 1e-6);
        close(cut("laplace", &[0.0, 1.0 / rate], lo, INF).log_density_num(lo), rate.ln(), 1e-6);
        close(cut("gamma", &[1.0, rate], lo, INF).log_density_num(lo), rate.ln(), 1e-6);
    }
    // Q(2, x) = (1 + x) e^-x.
    close(
        cut("gamma", &[2.0, 1.0], 3000.0, INF).log_density_num(3000.0),
        (3000f64 / 3001.0).ln(),
        1e-9,
    );
    // I_x(a, 1) = x^a: the density at the upper bound is a / x.
    close(
        cut("beta", &[300.0, 1.0], 0.0, 1e-3).log_density_num(1e-3),
        (300.0 / 1e-3f64).ln(),
        1e-12,
    );
    // The tail of a Cauchy is 1 / (pi x) (1 - 1 / (3 x^2) …).
    close(cut("cauchy", &[0.0, 1.0], 1e8, INF).log_density_num(1e8), -(1e8f64.ln()), 1e-12);
    close(cut("half_cauchy", &[0.0, 1.0], 1e8, INF).log_density_num(1e8), -(1e8f64.ln()), 1e-12);
    // Student's t with 2 degrees of freedom: P(T > t) = (1 - t / sqrt(2 + t^2)) / 2,
    // about 1 / (2 t^2) in the tail.
    close(
        cut("student_t", &[2.0, 0.0, 1.0], -INF, -1e7).log_density_num(-1e7),
        (2.0 / 1e7f64).ln(),
        1e-12,
    );
    // lognormal(0, 1) above e^20, from mpmath with 40 digits. The tails of the discrete
    // families, from sums of ratios of successive probabilities.
    close(
        cut("lognormal", &[0.0, 1.0], 20f64.exp(), INF).log_density_num(20f64.exp()),
        -17.001_783_162_107_41,
        1e-13,
    );
    let ratio = |from: i32, term: &dyn Fn(f64) -> f64| {
        let (mut sum, mut t) = (1.0, 1.0);
        for k in from..from + 200 {
            t *= term(f64::from(k));
            sum += t;
        }
        -f64::ln(sum)
    };
    let poisson = ratio(200, &|k| 1.0 / (k + 1.0));
    close(cut("poisson", &[1.0], 200.0, INF).log_density_num(200.0), poisson, 1e-12);
    let binomial = ratio(100, &|k| (1000.0 - k) / (k + 1.0) * 0.001 / 0.999);
    close(cut("binomial", &[1000.0, 0.001], 100.0, INF).log_density_num(100.0), binomial, 1e-12);
    let failures = ratio(500, &|k| (k + 2.0) / (k + 1.0) * 0.3);
    close(cut("neg_binomial", &[2.0, 0.7], 500.0, INF).log_density_num(500.0), failures, 1e-11);
    // So narrow that the distribution function is the same double at both ends.
    for (family, p) in CONTINUOUS {
        let d = cut(family, p, 0.7, 0.7 + 1e-12);
        let width = (0.7 + 1e-12) - 0.7;
        close(d.log_density_num(0.7), -f64::ln(width), 1e-3);
    }
}

#[test]
fn tails_of_integers_are_sums() {
    for (family, p) in DISCRETE {
        let d = make(family, p);
        let sum = |from: i32, to: i32| {
            (from..=to).map(|k| d.log_density_num(f64::from(k)).exp()).sum::<f64>()
        };
        for k in -4..16 {
            for x in [f64::from(k), f64::from(k) + 0.5] {
                let tails = d.tails(x).unwrap();
                close(tails.below.exp(), sum(-9, k), 1e-11);
                close(tails.above.exp(), sum(k + 1, 400), 1e-11);
            }
        }
    }
}

#[test]
fn slopes_are_those_of_differences() {
    for (family, p) in CONTINUOUS.iter().chain(DISCRETE) {
        let discrete = DISCRETE.iter().any(|(f, _)| f == family);
        let bounds: &[(f64, f64)] = match discrete {
            true => &[(1.0, 3.0), (1.0, INF), (2.0, 90.0), (-INF, 3.0)],
            false => &[(0.2, 0.9), (0.3, INF), (-INF, 0.8), (0.45, 0.45 + 1e-5), (-9.0, 0.7)],
        };
        for (lo, hi) in bounds {
            let x = if discrete { 2.0 } else { 0.5 * (lo.max(0.0) + hi.min(1.0)) };
            let d = cut(family, p, *lo, *hi);
            let g = d.gradient(&Datum::Num(x)).unwrap_or_else(|| panic!("{family} {lo} {hi}"));
            let whole = !matches!(*family, "binomial" | "binomial_logit" | "uniform_discrete");
            for i in 0..p.len() {
                if !whole && (i == 0 || *family == "uniform_discrete") {
                    continue;
                }
                let at = |h: f64| {
                    let mut p = p.to_vec();
                    p[i] += h;
                    cut(family, &p, *lo, *hi).log_density_num(x)
                };
                let h = 1e-4;
                let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                let found = g.params[i];
                assert!(
                    (found - slope).abs() < 1e-6 * (1.0 + slope.abs()),
                    "{family} {i} {lo} {hi}: {found} {slope}"
                );
            }
            for (i, bound) in [*lo, *hi].into_iter().enumerate() {
                if discrete || !bound.is_finite() {
                    continue;
                }
                let at = |h: f64| {
                    let (lo, hi) = if i == 0 { (lo + h, *hi) } else { (*lo, hi + h) };
                    cut(family, p, lo, hi).log_density_num(x)
                };
                let h = 1e-7 * (1.0f64).min(hi - lo);
                let (slope, found) = ((at(h) - at(-h)) / (2.0 * h), g.params[p.len() + i]);
                assert!(
                    (found - slope).abs() < 1e-4 * (1.0 + slope.abs()),
                    "{family} bound {i} {lo} {hi}: {found} {slope}"
                );
            }
        }
    }
    // A mixture, with respect to its weights and its components' parameters.
    let mix = |p: [f64; 4]| {
        let parts = vec![make("normal", &[p[2], 1.0]), make("gamma", &[2.0, p[3]])];
        truncated(&Dist::from(Mixture::new(&p[..2], parts).unwrap()), 0.4, 3.0).unwrap()
    };
    let p = [0.7, 1.1, 0.2, 1.4];
    let g = mix(p).gradient(&Datum::Num(0.9)).unwrap();
    for (i, k) in [(0, 0), (1, 1), (2, 2), (3, 5)] {
        let at = |h: f64| {
            let mut p = p;
            p[i] += h;
            mix(p).log_density_num(0.9)
        };
        close(g.params[k], (at(1e-5) - at(-1e-5)) / 2e-5, 1e-7);
    }
}

#[test]
fn draws_follow_the_distribution() {
    let mut rng = stream(700);
    for (family, p) in CONTINUOUS.iter().chain(DISCRETE) {
        // Likely and unlikely intervals: by rejection and by inversion.
        for (lo, hi) in [(0.0, 1.0), (0.9, 1.0), (3.0, INF), (5.0, INF), (1.0, 3.0)] {
            let Ok(d) = truncated(&make(family, p), lo, hi) else { continue };
            let support = d.support();
            let n = 4000;
            let xs: Vec<f64> = (0..n).map(|_| d.sample(&mut rng).num().unwrap()).collect();
            assert!(xs.iter().all(|x| support.contains_num(*x)), "{family} {lo} {hi}");
            // The fraction of draws up to a point equals the ratio of the two intervals'
            // probabilities.
            let mut sorted = xs.clone();
            sorted.sort_by(f64::total_cmp);
            let middle = sorted[n / 3];
            let share = xs.iter().filter(|x| **x <= middle).count() as f64 / n as f64;
            let whole = d.log_density_num(middle);
            let Ok(part) = truncated(&make(family, p), lo, middle) else { continue };
            let wanted = (whole - part.log_density_num(middle)).exp();
            assert!(
                (share - wanted).abs() < 0.04,
                "{family} {lo} {hi}: {share} of draws, {wanted} expected"
            );
        }
    }
    let far = cut("gamma", &[2.0, 1.0], 3000.0, INF);
    let mean =
        (0..2000).map(|_| far.sample(&mut rng).num().unwrap() - 3000.0).sum::<f64>() / 2000.0;
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
}

#[test]
fn supports_are_cut() {
    let support = |family: &str, p: &[f64], lo: f64, hi: f64| cut(family, p, lo, hi).support();
    assert_eq!(support("gamma", &[2.0, 1.0], 0.0, INF), Support::Positive);
    assert_eq!(support("gamma", &[2.0, 1.0], 1.0, INF), Support::AtLeast { lo: 1.0 });
    assert_eq!(support("gamma", &[2.0, 1.0], -3.0, 1.0), Support::Interval { lo: 0.0, hi: 1.0 });
    assert_eq!(support("cauchy", &[0.0, 1.0], -INF, 2.0), Support::AtMost { hi: 2.0 });
    assert_eq!(support("poisson", &[2.0], 0.5, 3.7), Support::Integers { lo: 1, hi: Some(3) });
    assert_eq!(cut("poisson", &[2.0], 3.0, 3.0).log_density_num(3.0), 0.0);
    assert!(matches!(cut("normal", &[0.0, 1.0], 1.0, INF), Dist::TruncatedNormal(_)));
    let three = Dist::from(Iid::new(make("gamma", &[2.0, 1.0]), 3).unwrap());
    assert_eq!(truncated(&three, 1.0, INF).unwrap().elements(), Some(3));
}

#[test]
fn bounds_without_sense_are_errors() {
    let message = |d: &Dist, lo: f64, hi: f64| truncated(d, lo, hi).unwrap_err().to_string();
    let gamma = make("gamma", &[2.0, 1.0]);
    assert_eq!(message(&gamma, 2.0, 1.0), "truncated: lo must be below hi, got 2 and 1");
    assert!(message(&gamma, 1.0, 1.0).contains("an interval without width has no density"));
    assert!(message(&gamma, f64::NAN, 1.0).contains("must be numbers"));
    assert!(
        message(&gamma, -2.0, -1.0)
            .contains("must overlap the support of `d`, got -2 and -1 of gamma")
    );
    assert!(message(&make("poisson", &[2.0]), 1.2, 1.8).contains("must overlap"));
    assert!(
        message(&make("geometric", &[1.0]), 1.0, INF)
            .contains("must contain some of the probability")
    );
    assert!(message(&make("flat", &[]), 0.0, INF).contains("give the bounds to `flat(lo, hi)`"));
    assert!(
        message(&make("von_mises", &[0.0, 1.0]), 0.0, 1.0)
            .contains("must not be a distribution of angles")
    );
    assert!(
        message(&make("dirichlet", &[1.0, 1.0]), 0.0, 1.0)
            .contains("must be a distribution of single numbers")
    );
    assert!(
        message(&make("flip", &[0.5]), 0.0, 1.0)
            .contains("must be a distribution of single numbers")
    );
    assert!(
        message(&truncated(&gamma, 0.0, 1.0).unwrap(), 0.0, 0.5)
            .contains("must not be truncated already")
    );
    assert!(message(&make("normal", &[0.0, 1.0]), 2.0, 1.0).contains("must be below hi"));
}

#[test]
fn flat_priors_on_half_lines() {
    let positive = make("flat", &[0.0, INF]);
    assert_eq!(positive.support(), Support::AtLeast { lo: 0.0 });
    assert_eq!(
        (positive.log_density_num(1e300), positive.log_density_num(-1e-300)),
        (0.0, f64::NEG_INFINITY)
    );
    assert!(
        positive.is_improper()
            && make("flat", &[-INF, 3.0]).support() == Support::AtMost { hi: 3.0 }
    );
    let mut rng = stream(701);
    assert!((0..1000).all(|_| (0.13..7.4).contains(&positive.sample(&mut rng).num().unwrap())));
    let message = |p: &[f64]| try_make("flat", p).unwrap_err().to_string();
    assert!(message(&[0.0, 1.0]).contains("between two finite bounds use uniform(lo, hi)"));
    assert!(
        message(&[INF, INF]).contains("must have numbers")
            && message(&[f64::NAN, 1.0]).contains("be numbers")
    );
}

#[test]
fn unlike_priors_in_order() {
    let parts = || {
        vec![make("normal", &[0.0, 1.0]), make("gamma", &[2.0, 1.0]), make("normal", &[3.0, 2.0])]
    };
    let d = Ordered::of(parts()).unwrap();
    let x: Datum = vec![-0.3, 0.8, 2.0].into();
    let sum: f64 = parts().iter().zip([-0.3, 0.8, 2.0]).map(|(p, x)| p.log_density_num(x)).sum();
    close(d.log_density(&x), sum, 1e-15);
    assert_eq!(d.log_density(&vec![0.9, 0.8, 2.0].into()), f64::NEG_INFINITY);
    assert_eq!(d.log_density(&vec![-0.9, -0.8, 2.0].into()), f64::NEG_INFINITY);
    assert_eq!(d.support(), Support::Ascending(Box::new(Support::Real), 3));
    assert!(
        Distribution::is_improper(&d),
        "it is not normalised, so nothing may take it for what it draws"
    );
    let g = Distribution::gradient(&d, &x).unwrap();
    assert_eq!((g.x.len(), g.params.len()), (3, 6));
    close(g.params[0], -0.3, 1e-14);
    let mut rng = stream(702);
    for _ in 0..200 {
        assert!(d.log_density(&d.sample(&mut rng)).is_finite());
    }
    // Never in order by chance, so the draws are sorted.
    let apart =
        Ordered::of(vec![make("normal", &[50.0, 1.0]), make("normal", &[0.0, 1.0])]).unwrap();
    assert!(apart.support().contains(&apart.sample(&mut rng)));
    assert!(Ordered::of(vec![make("poisson", &[1.0])]).is_err());
}

/// Calls `check` with every family truncated in all these ways, with all parameters from a
/// list, and the logarithm of the interval's probability.
fn each_cut(values: &[f64], check: impl Fn(&str, &[f64], (f64, f64), &Dist)) {
    let bounds = [
        (5.0, INF),
        (0.95, INF),
        (0.95, 0.99),
        (5.0, 6.0),
        (-INF, 0.5),
        (-3.0, -2.0),
        (-INF, -5.0),
    ];
    let mut families: Vec<(&str, usize)> = CONTINUOUS.iter().map(|(f, p)| (*f, p.len())).collect();
    families.dedup();
    for (family, n) in families {
        for code in 0..values.len().pow(n as u32) {
            let digit = |i: usize| code / values.len().pow(i as u32) % values.len();
            let p: Vec<f64> = (0..n).map(|i| values[digit(i)]).collect();
            let Ok(base) = try_make(family, &p) else { continue };
            for (lo, hi) in bounds {
                if let Ok(d) = truncated(&base, lo, hi) {
                    check(family, &p, (lo, hi), &d);
                }
            }
        }
    }
}

const POINTS: [f64; 8] = [0.3, 0.96, 0.99, 5.01, 5.9, 40.0, -2.5, -40.0];

/// A leapfrog step may lead to any parameters.
#[test]
fn where_a_density_is_finite_there_are_derivatives() {
    let values =
        [1e-300, 1e-150, 1e-40, 1e-8, 1e-3, 0.1, 1.0, 7.0, 100.0, 1e4, 1e7, 1e40, 1e150, 1e300];
    each_cut(&values, |family, p, bounds, d| {
        for x in POINTS {
            let score = d.log_density_num(x);
            // More than the largest density of a distribution that double parameters give.
            assert!(score < 1e3, "{family}{p:?} {bounds:?} at {x}: {score}");
            let g = d.gradient(&Datum::Num(x));
            assert!(g.is_some() || score == -INF, "{family}{p:?} {bounds:?} at {x}: {score}");
        }
    });
}

#[test]
fn derivatives_far_from_the_mass_agree_with_differences() {
    each_cut(&[0.05, 0.3, 1.0, 7.0, 40.0, 200.0], |family, p, (lo, hi), d| {
        for x in POINTS.into_iter().filter(|x| d.log_density_num(*x).is_finite()) {
            let g = d.gradient(&Datum::Num(x)).unwrap();
            for (i, found) in g.params.iter().take(p.len()).enumerate() {
                let h = 2e-5 * p[i];
                let at = |by: f64| {
                    let mut q = p.to_vec();
                    q[i] += by * h;
                    let d = truncated(&make(family, &q), lo, hi);
                    d.map_or(f64::NAN, |d| d.log_density_num(x))
                };
                let wanted = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
                if !wanted.is_finite() {
                    continue;
                }
                // What rounding of the two terms of the density leaves of a difference.
                let term = make(family, p).log_density_num(x).abs().max(1.0);
                let noise = 1e-14 * term / h;
                assert!(
                    (found - wanted).abs() <= 1e-5 * wanted.abs() + 10.0 * noise + 1e-5,
                    "{family}{p:?} {lo} {hi} at {x}, {i}: {found} is not {wanted}"
                );
            }
        }
    });
}

#[test]
fn weights_of_a_mixture_count_in_its_far_tail() {
    // Above 60 only the second component is left: P(X > 60) = w exp(-30).
    let at = |w: f64| {
        let parts = vec![make("normal", &[0.0, 1.0]), make("exponential", &[0.5])];
        let mixed = Dist::from(Mixture::new(&[1.0, w], parts).unwrap());
        truncated(&mixed, 60.0, INF).unwrap()
    };
    let g = at(2.0).gradient(&Datum::Num(61.0)).unwrap();
    assert!(g.params.iter().all(|p| p.is_finite()), "{g:?}");
    // The same density whatever the weights.
    assert!(g.params[0].abs() < 1e-9 && g.params[1].abs() < 1e-9, "{g:?}");
    close(at(2.0).log_density_num(61.0), 0.5f64.ln() - 0.5, 1e-12);
}
