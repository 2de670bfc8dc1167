//! Poles at an end that is not 0, in unconstrained coordinates.

use super::*;
use crate::dist::truncated;
use crate::num::beta_tails;

/// The integral over coordinates of the density there times the Jacobian.
fn mass(d: &Dist, from: f64, to: f64) -> f64 {
    let support = d.stored_support();
    let n = 400_000;
    let h = (to - from) / f64::from(n);
    let at = |i: i32| {
        let (x, jacobian) = support.from_free_scalar(from + (f64::from(i) + 0.5) * h);
        (d.log_density_num(x) + jacobian).exp() * h
    };
    (0..n).map(at).sum()
}

#[test]
fn densities_integrate_to_one_in_coordinates() {
    for (a, b) in [(9999.0, 0.1), (0.5, 0.02), (1.0, 0.3), (2.0, 0.9)] {
        let beta = make("beta", &[a, b]);
        let total = mass(&beta, -100.0, 30.0 / b + 50.0);
        assert!((total - 1.0).abs() < 2e-3, "{a} {b}: {total}");
        // Beyond a point that doubles hardly tell from 1.
        let beyond = 1e-12f64;
        let y = -beyond.ln();
        let wanted = beta_tails(a, b, 1.0 - beyond, beyond).unwrap().1.exp();
        let found = mass(&beta, y, 30.0 / b + 50.0);
        assert!((found / wanted - 1.0).abs() < 2e-3, "{a} {b}: {found} {wanted}");
        let cut = truncated(&beta, 0.7, f64::INFINITY).unwrap();
        let total = mass(&cut, -40.0, 30.0 / b + 50.0);
        assert!((total - 1.0).abs() < 2e-3, "{a} {b}, truncated: {total}");
    }
    // Without a pole within the support, nothing is special.
    let plain = |d: &Dist| matches!(d.stored_support(), Support::Interval { .. });
    assert!(plain(&make("beta", &[0.1, 1.0])) && plain(&make("uniform", &[0.0, 1.0])));
    assert!(plain(&truncated(&make("beta", &[0.1, 0.1]), 0.1, 0.9).unwrap()));
}

#[test]
fn coordinates_are_those_of_their_values() {
    let support = make("beta", &[0.5, 0.1]).stored_support();
    let last = 1f64.next_down();
    for u in [1e-9, 0.2, 0.5, 0.999] {
        let y = support.coarse_coordinate(last, None, || u).unwrap();
        assert_eq!(support.from_free_scalar(y).0, last);
        assert_eq!(support.coarse_coordinate(last, Some(y), || 0.5), Some(y));
    }
    // One that was kept for another value is not used.
    assert_eq!(support.coarse_coordinate(0.3, Some(50.0), || 0.5), None);
    assert_eq!(
        support.to_free_scalar(0.3),
        Support::Interval { lo: 0.0, hi: 1.0 }.to_free_scalar(0.3)
    );
    // The share of the probability beyond is uniform.
    let y = |u: f64| support.coarse_coordinate(last, None, || u).unwrap();
    assert!((y(0.25) - y(0.5) - 2f64.ln() / 0.1).abs() < 1e-9);
}

#[test]
fn slopes_in_coordinates_are_those_of_differences() {
    let d = make("beta", &[0.5, 0.1]);
    let support = d.stored_support();
    for y in [-3.0, 0.4, 12.0, 40.0, 300.0] {
        let at = |y: f64| {
            let (x, jacobian) = support.from_free_scalar(y);
            d.log_density_num(x) + jacobian
        };
        let wanted = (at(y + 1e-3) - at(y - 1e-3)) / 2e-3;
        let x = support.from_free_scalar(y).0;
        let mut found = Vec::new();
        support.free_gradient(&[y], &d.gradient(&Datum::Num(x)).unwrap().x, &mut found);
        assert!((found[0] - wanted).abs() < 1e-4, "{y}: {found:?} {wanted}");
    }
}
