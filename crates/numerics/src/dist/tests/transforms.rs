//! Tests of the maps to unconstrained space: round trips, Jacobians and gradients by
//! finite differences, extreme points.

use super::*;
use nalgebra::DMatrix;
use std::f64::consts::TAU;

fn supports() -> Vec<Support> {
    vec![
        Support::Real,
        Support::Positive,
        Support::AtLeast { lo: -3.0 },
        Support::Interval { lo: -2.0, hi: 5.0 },
        Support::AtMost { hi: 4.0 },
        Support::Circle,
        Support::Ascending(Box::new(Support::Real), 3),
        Support::Ascending(Box::new(Support::Interval { lo: -1.0, hi: 3.0 }), 3),
        Support::Ascending(Box::new(Support::Positive), 0),
        Support::CorrelationFactor(1),
        Support::CorrelationFactor(2),
        Support::CorrelationFactor(4),
        Support::CovarianceFactor(1),
        Support::CovarianceFactor(3),
        Support::Counts { total: 5, kinds: 3 },
        Support::Product(Box::new(Support::CovarianceFactor(2)), 2),
        Support::Vector(3),
        Support::Simplex(1),
        Support::Simplex(2),
        Support::Simplex(4),
        Support::Product(Box::new(Support::Positive), 3),
        Support::Product(Box::new(Support::Simplex(3)), 2),
        Support::Each(
            vec![
                Support::Interval { lo: 0.0, hi: 1.0 },
                Support::Boolean,
                Support::Simplex(3),
                Support::Real,
            ]
            .into(),
        ),
    ]
}

fn points(s: &Support) -> Vec<Vec<f64>> {
    let mut rng = stream(500);
    // Gaps add up: with wide ones, the last numbers of an interval would differ only by
    // rounding.
    let spread =
        if matches!(s, Support::Ascending(one, _) if **one != Support::Real) { 0.5 } else { 2.0 };
    (0..20).map(|_| (0..s.free_dim()).map(|_| spread * rng.standard_normal()).collect()).collect()
}

/// Returns whether two coordinates are of the same point; angles are equal modulo 2 pi.
fn same(s: &Support, a: f64, b: f64) -> bool {
    let d = a - b;
    let d = if *s == Support::Circle { d - TAU * (d / TAU).round() } else { d };
    d.abs() < 1e-9
}

#[test]
fn there_and_back() {
    for s in supports() {
        for y in points(&s) {
            let (x, jacobian) = s.from_free(&y);
            assert!(s.contains(&x) && s.fits(&x) && jacobian.is_finite(), "{s:?} {x:?}");
            let mut back = vec![7.0];
            s.to_free(&x, &mut back);
            assert_eq!(back.len(), 1 + y.len());
            assert!(
                y.iter().zip(&back[1..]).all(|(a, b)| same(&s, *a, *b)),
                "{s:?}: {y:?} against {back:?}"
            );
        }
    }
}

#[test]
fn points_at_an_end_or_beyond_are_the_nearest_inside() {
    let kept = |s: &Support, x: f64| s.from_free_scalar(s.to_free_scalar(x)).0;
    let (above, below) = (Support::AtLeast { lo: -3.0 }, Support::AtMost { hi: 4.0 });
    let between = Support::Interval { lo: -2.0, hi: 5.0 };
    for by in [0.0, 5.0] {
        assert!((0.0..1e-300).contains(&kept(&Support::Positive, -by)));
        assert_eq!(kept(&above, -3.0 - by), (-3f64).next_up());
        assert_eq!(kept(&below, 4.0 + by), 4f64.next_down());
        assert_eq!(kept(&between, -2.0 - by), (-2f64).next_up());
        assert_eq!(kept(&between, 5.0 + by), 5f64.next_down());
    }
    assert!(
        kept(&Support::Positive, INF) > 1e300
            && kept(&above, INF) > 1e300
            && kept(&below, -INF) < -1e300
    );
}

#[test]
fn products_are_made_part_by_part() {
    let dice = Support::Product(Box::new(Support::Integers { lo: 1, hi: Some(6) }), 3);
    assert_eq!(dice.from_free(&[]), (Datum::from(vec![1.0; 3]), 0.0));
    for one in
        [Support::Simplex(2), Support::Vector(1), Support::Ascending(Box::new(Support::Real), 1)]
    {
        let s = Support::Product(Box::new(one.clone()), 2);
        let (x, jacobian) = s.from_free(&[0.3, -0.8]);
        let parts = [0.3, -0.8].map(|y| one.from_free(&[y]));
        assert!(s.contains(&x), "{s:?} {x:?}");
        assert_eq!(numbers(&x), parts.iter().flat_map(|(x, _)| numbers(x)).collect::<Vec<_>>());
        assert!((jacobian - parts[0].1 - parts[1].1).abs() < 1e-14);
    }
}

/// Returns the numbers that a density of `s` is with respect to: all numbers, except the
/// last proportion of each simplex and the dependent entries of Cholesky factors.
fn independent(s: &Support, x: &Datum) -> Vec<f64> {
    match (s, x) {
        (Support::Simplex(n), x) => numbers(x)[..n - 1].to_vec(),
        (Support::Counts { .. }, _) => Vec::new(),
        (Support::CorrelationFactor(n), x) => {
            (0..*n).flat_map(|i| numbers(x)[i * n..i * n + i].to_vec()).collect()
        }
        (Support::CovarianceFactor(n), x) => {
            (0..*n).flat_map(|i| numbers(x)[i * n..=i * n + i].to_vec()).collect()
        }
        (Support::Product(one, n), x) => {
            (0..*n).flat_map(|i| independent(one, &x.element(i).unwrap())).collect()
        }
        (Support::Each(all), x) => all
            .iter()
            .enumerate()
            .flat_map(|(i, s)| independent(s, &x.element(i).unwrap()))
            .collect(),
        _ => numbers(x),
    }
}

#[test]
fn jacobians_are_those_of_finite_differences() {
    for s in supports() {
        let n = s.free_dim();
        for y in points(&s) {
            let column = |j: usize| {
                let moved = |h: f64| {
                    let mut y = y.clone();
                    y[j] += h;
                    independent(&s, &s.from_free(&y).0)
                };
                let h = 1e-5;
                let (up, down) = (moved(h), moved(-h));
                up.iter().zip(down).map(|(u, d)| (u - d) / (2.0 * h)).collect::<Vec<_>>()
            };
            let columns: Vec<Vec<f64>> = (0..n).map(column).collect();
            let det = DMatrix::from_fn(n, n, |i, j| columns[j][i]).determinant().abs();
            let (_, jacobian) = s.from_free(&y);
            assert!(
                (det.ln() - jacobian).abs() < 1e-5,
                "{s:?} at {y:?}: {} against {jacobian}",
                det.ln()
            );
        }
    }
}

#[test]
fn gradients_pull_back() {
    // Uses log p = sum of sin(w_i x_i), with a different weight for each number.
    let weight = |i: usize| 0.5 + i as f64;
    let log_p =
        |x: &Datum| numbers(x).iter().enumerate().map(|(i, x)| (weight(i) * x).sin()).sum::<f64>();
    for s in supports() {
        for y in points(&s) {
            let total = |y: &[f64]| {
                let (x, jacobian) = s.from_free(y);
                log_p(&x) + jacobian
            };
            let by_x: Vec<f64> = numbers(&s.from_free(&y).0)
                .iter()
                .enumerate()
                .map(|(i, x)| weight(i) * (weight(i) * x).cos())
                .collect();
            let mut got = Vec::new();
            s.free_gradient(&y, &by_x, &mut got);
            assert_eq!(got.len(), y.len());
            for j in 0..y.len() {
                let (mut up, mut down) = (y.clone(), y.clone());
                up[j] += 1e-6;
                down[j] -= 1e-6;
                let expected = (total(&up) - total(&down)) / 2e-6;
                // Where x is large, the phase of the sine limits the accuracy of the
                // difference.
                let scale = 1.0 + expected.abs() + by_x.iter().map(|b| b.abs()).sum::<f64>();
                assert!(
                    (got[j] - expected).abs() < 1e-4 * scale,
                    "{s:?} at {y:?}: {} against {expected}",
                    got[j]
                );
            }
        }
    }
}

#[test]
fn extreme_points_stay_finite_and_inside() {
    for s in supports() {
        for far in [
            -1e308,
            -1e4,
            -800.0,
            -40.0,
            40.0,
            800.0,
            1e4,
            1e308,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ] {
            let (x, jacobian) = s.from_free(&vec![far; s.free_dim()]);
            assert!(s.contains(&x) && jacobian.is_finite(), "{s:?} at {far}: {x:?}, {jacobian}");
            let mut back = Vec::new();
            s.to_free(&x, &mut back);
            assert!(back.iter().all(|y| y.is_finite()), "{s:?} at {far}");
        }
    }
    let unit = Support::Interval { lo: 0.0, hi: 1.0 };
    let edges: &[(Support, f64)] = &[
        (unit.clone(), 0.0),
        (unit.clone(), 1.0),
        (unit.clone(), -3.0),
        (unit, 7.0),
        (Support::Positive, 0.0),
        (Support::Positive, -1.0),
        (Support::Positive, f64::MAX),
        (Support::AtLeast { lo: 1e20 }, 1e20),
        (Support::AtLeast { lo: 0.0 }, f64::INFINITY),
        (Support::Real, f64::NAN),
    ];
    for (s, x) in edges {
        let y = s.to_free_scalar(*x);
        assert!(y.is_finite(), "{s:?} at {x}: {y}");
        assert!(s.contains_num(s.from_free_scalar(y).0), "{s:?} at {x}");
    }
    let mut y = Vec::new();
    Support::Simplex(4).to_free(&vec![0.0, 1.0, 0.0, 0.0].into(), &mut y);
    assert!(y.iter().all(|y| y.is_finite()));
}

#[test]
fn values_that_do_not_fit_have_as_many_coordinates() {
    for s in supports() {
        for x in [Datum::Bool(true), Datum::Num(0.5), vec![0.5].into(), Datum::List(vec![].into())]
        {
            let mut y = Vec::new();
            s.to_free(&x, &mut y);
            assert_eq!(y.len(), s.free_dim(), "{s:?} {x:?}");
            if s.contains(&x) {
                assert!(s.fits(&x));
            }
        }
    }
}
