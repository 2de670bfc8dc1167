//! The transforms to unconstrained space and back, and their log Jacobians, compared with
//! the table.

use super::points::Points;
use super::table::{Row, agree, rows};
use pcadlang_numerics::dist::{Datum, Support};

fn support(r: &Row) -> Support {
    match (r.name, &r.parameters[..]) {
        ("positive", []) => Support::Positive,
        ("at_least", [lo]) => Support::AtLeast { lo: *lo },
        ("at_most", [hi]) => Support::AtMost { hi: *hi },
        ("interval", [lo, hi]) => Support::Interval { lo: *lo, hi: *hi },
        ("simplex", []) => Support::Simplex(r.point.len() + 1),
        ("correlation", []) => Support::CorrelationFactor(3),
        ("covariance", []) => Support::CovarianceFactor(2),
        ("ascending", []) => Support::Ascending(Box::new(Support::Real), 3),
        other => panic!("unknown support {other:?}"),
    }
}

fn flat(x: &Datum) -> Vec<f64> {
    match x {
        Datum::Num(x) => vec![*x],
        Datum::Vec(xs) => xs.to_vec(),
        Datum::List(xs) => xs.iter().flat_map(flat).collect(),
        Datum::Bool(_) => Vec::new(),
    }
}

/// Returns the nearest double strictly inside of the support.
fn inside(s: &Support, x: f64) -> f64 {
    match s {
        Support::AtLeast { lo } => x.max(lo.next_up()),
        Support::AtMost { hi } => x.min(hi.next_down()),
        Support::Interval { lo, hi } => x.clamp(lo.next_up(), hi.next_down()),
        _ => x,
    }
}

#[test]
fn values_and_jacobians_agree_with_the_table() {
    let mut points = Points::of("transforms");
    for r in rows("from") {
        let s = support(&r);
        let (x, jacobian) = s.from_free(&r.point);
        let (expected, values) = r.values.split_last().unwrap();
        let got = flat(&x);
        // Near a bound, up to the rounding error of the bound.
        let bound = r.parameters.iter().fold(0.0, |m: f64, p| m.max(p.abs()));
        let right = got.len() == values.len()
            && got.iter().zip(values).all(|(g, v)| agree(*g, inside(&s, *v), 1e-12, 4e-16 * bound))
            && agree(jacobian, *expected, 1e-12, 1e-12)
            && s.contains(&x);
        points.check(right, || format!("{}: got {got:?}, {jacobian:e}", r.line));
    }
    for r in rows("to") {
        let mut got = Vec::new();
        support(&r).to_free(&Datum::Num(r.point[0]), &mut got);
        points
            .check(agree(got[0], r.values[0], 1e-12, 1e-12), || format!("{}: got {got:?}", r.line));
    }
    points.finish();
}

#[test]
fn there_and_back_from_anywhere() {
    let mut points = Points::of("transforms at the ends");
    let mut seen: Vec<Support> = rows("from").iter().map(support).collect();
    seen.dedup();
    seen.extend([Support::Real, Support::Circle, Support::Vector(3)]);
    let ends = [0.0, 5e-324, 1e-300, 701.0, 1e4, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
    for s in &seen {
        for y in ends.into_iter().flat_map(|y| [y, -y]) {
            let coordinates = vec![y; s.free_dim()];
            let (x, jacobian) = s.from_free(&coordinates);
            let mut back = Vec::new();
            s.to_free(&x, &mut back);
            let mut slope = Vec::new();
            s.free_gradient(&coordinates, &vec![1.0; s.gradient_dim()], &mut slope);
            let right = s.contains(&x)
                && jacobian.is_finite()
                && back.iter().all(|b| b.is_finite())
                && slope.len() == s.free_dim()
                && slope.iter().all(|g| !g.is_nan());
            points.check(right, || {
                format!("{s:?} at {y}: {x:?}, {jacobian}, back {back:?}, slopes {slope:?}")
            });
        }
    }
    points.finish();
}
