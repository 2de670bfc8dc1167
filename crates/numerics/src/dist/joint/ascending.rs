//! The map between ascending sequences of numbers and unconstrained space: the first
//! coordinate, then the logarithms of the gaps.
//!
//! In a bounded space, the gaps are those between the numbers' unconstrained coordinates.

use crate::dist::Support;
use crate::dist::clamp::{FAR, near};

/// Returns the space in which coordinates are ordered: angles count as an interval.
fn line(one: &Support) -> Support {
    match one {
        Support::Circle => {
            Support::Interval { lo: -core::f64::consts::PI, hi: core::f64::consts::PI }
        }
        other => other.clone(),
    }
}

pub(in crate::dist) fn to_free(one: &Support, xs: &[f64], out: &mut Vec<f64>) {
    let one = line(one);
    let mut last = None;
    for x in xs {
        let u = one.to_free_scalar(*x);
        // Numbers out of order have no gap.
        let gap = |last: f64| if u > last { libm::log(u - last).clamp(-FAR, FAR) } else { -FAR };
        out.push(last.map_or(u, gap));
        last = Some(u);
    }
}

/// Returns the numbers' unconstrained coordinates and the sum of the logarithms of the
/// gaps.
fn coordinates(n: usize, at: impl Fn(usize) -> f64) -> (Vec<f64>, f64) {
    let (mut u, mut jacobian) = (0.0, 0.0);
    let mut next = |k: usize| {
        if k == 0 {
            u = Support::Real.to_free_scalar(at(0));
        } else {
            let y = near(at(k));
            u = (u + libm::exp(y)).min(f64::MAX);
            jacobian += y;
        }
        u
    };
    let us = (0..n).map(&mut next).collect();
    (us, jacobian)
}

pub(in crate::dist) fn from_free(
    one: &Support,
    n: usize,
    at: impl Fn(usize) -> f64,
) -> (Vec<f64>, f64) {
    let one = line(one);
    let (us, mut jacobian) = coordinates(n, at);
    let mut number = |u: &f64| {
        let (x, j) = one.from_free_scalar(*u);
        jacobian += j;
        x
    };
    let xs = us.iter().map(&mut number).collect();
    (xs, jacobian)
}

pub(in crate::dist) fn free_gradient(
    one: &Support,
    n: usize,
    at: impl Fn(usize) -> f64,
    by: impl Fn(usize) -> f64,
    out: &mut Vec<f64>,
) {
    let one = line(one);
    let (us, _) = coordinates(n, &at);
    let start = out.len();
    us.iter().enumerate().for_each(|(k, u)| one.free_gradient(&[*u], &[by(k)], out));
    // A coordinate moves its own number and all numbers after it.
    let mut after = 0.0;
    for (k, g) in out[start..].iter_mut().enumerate().rev() {
        after += *g;
        *g = if k == 0 { after } else { after * libm::exp(near(at(k))) + 1.0 };
    }
}
