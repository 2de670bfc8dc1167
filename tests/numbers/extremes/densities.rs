//! Log densities and their gradients compared with the table, and points without a
//! density.

use super::points::Points;
use super::table::{agree, rows};
use crate::common::families::{datum, made};
use pcadlang_numerics::dist::{Categorical, Datum, Dist, Flat, Flip, Iid, Ordered};

#[test]
fn log_densities_agree_with_the_table() {
    let mut points = Points::of("log densities");
    for r in rows("density") {
        // Near zeros of the log density, the error is absolute.
        let relative = if r.region == "body" { 1e-12 } else { 1e-9 };
        let got = made(r.name, &r.parameters).log_density(&datum(r.name, &r.point));
        let [expected] = r.values[..] else { panic!("{}", r.line) };
        points.check(agree(got, expected, relative, 1e-12), || format!("{}: got {got:e}", r.line));
    }
    points.finish();
}

#[test]
fn gradients_agree_with_the_table() {
    let mut points = Points::of("gradients");
    for r in rows("gradient") {
        let got = made(r.name, &r.parameters).gradient(&datum(r.name, &r.point));
        let got: Vec<f64> = got.iter().flat_map(|g| g.x.iter().chain(&g.params)).copied().collect();
        let is_discrete = got.len() == r.parameters.len();
        let by = if is_discrete { &[][..] } else { &r.point[..] }.iter().chain(&r.parameters);
        // A relative error of 1e-9, or an error of 1e-9 in the change of the log density
        // when the number changes by a factor of e. If a term is larger (a shape
        // parameter, or the squared distance of a bound in standard deviations), an error
        // of 1e-12 of that term.
        let shapes = match r.name {
            "beta" => 2,
            "gamma" | "inv_gamma" | "student_t" => 1,
            _ => 0,
        };
        let bound = match (r.name, &r.parameters[..]) {
            ("truncated_normal", [mean, sd, lo, _]) if lo.is_finite() => ((lo - mean) / sd).powi(2),
            _ => 0.0,
        };
        let little =
            r.parameters[..shapes].iter().fold(bound.max(1e3), |most: f64, s| most.max(*s)) * 1e-12;
        let right = got.len() == r.values.len()
            && r.values.iter().zip(&got).zip(by).all(|((v, g), by)| {
                v.is_nan() && !g.is_nan()
                    || agree(*g, *v, 1e-9, 0.0)
                    || ((v - g) * by).abs() < little
            });
        points.check(right, || format!("{}: got {got:?}", r.line));
    }
    points.finish();
}

#[test]
fn nothing_is_likely_that_is_not_finite() {
    let mut points = Points::of("points that are not finite");
    let mut last = String::new();
    for r in rows("density") {
        let this = format!("{} {:?}", r.name, r.parameters);
        if std::mem::replace(&mut last, this.clone()) == this {
            continue;
        }
        let d = made(r.name, &r.parameters);
        for odd in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            for i in 0..r.point.len() {
                let mut x = r.point.clone();
                x[i] = odd;
                let x = datum(r.name, &x);
                let right = d.log_density(&x) == f64::NEG_INFINITY && d.gradient(&x).is_none();
                points.check(right, || format!("{this} at {x:?}: {}", d.log_density(&x)));
            }
        }
        let other = Datum::Bool(true);
        points.check(d.log_density(&other) == f64::NEG_INFINITY, || format!("{this} at {other:?}"));
    }
    points.finish();
}

/// Distributions whose log density is a simple formula.
#[test]
fn log_densities_agree_with_formulas() {
    let mut points = Points::of("other log densities");
    let never = f64::NEG_INFINITY;
    for x in [0.0, 5e-324, -1e-300, 1e150, 1e300, f64::MAX, f64::INFINITY, never, f64::NAN] {
        let got = Dist::Flat(Flat::default()).log_density_num(x);
        points.check(got == if x.is_finite() { 0.0 } else { never }, || {
            format!("flat at {x}: {got}")
        });
    }
    for p in [0.0, 5e-324, 1e-300, 1e-16, 1.0 - 1e-16, 1.0f64] {
        let d = Dist::Flip(Flip::new(p).unwrap());
        for (x, expected) in [(true, p.ln()), (false, (-p).ln_1p())] {
            let got = d.log_density_bool(x);
            points.check(agree(got, expected, 1e-12, 0.0), || format!("flip({p:e}) at {x}: {got}"));
        }
    }
    for weights in [[1e-300, 1e300, 0.0], [1e-300; 3], [5e-324, 1.0, 1.0], [5e307; 3]] {
        let d = Dist::Categorical(Categorical::new(weights).unwrap());
        for x in [0.0, 1.0, 2.0, 3.0, -1.0, 0.5, 1e300, f64::NAN] {
            let weight = (0..3).find(|i| *i as f64 == x).map_or(0.0, |i| weights[i]);
            let (got, expected) =
                (d.log_density_num(x), weight.ln() - weights.iter().sum::<f64>().ln());
            points.check(agree(got, expected, 1e-12, 1e-12), || {
                format!("categorical({weights:?}) at {x}: {got}")
            });
        }
    }
    for scale in [1e-300, 1e-150, 1.0, 1e150, 1e300] {
        let one = made("normal", &[0.0, scale]);
        let xs = [-scale, 0.5 * scale, 2.0 * scale];
        let sum: f64 = xs.iter().map(|x| one.log_density_num(*x)).sum();
        let iid = Dist::from(Iid::new(one.clone(), 3).unwrap());
        let ordered = Dist::from(Ordered::new(one, 3).unwrap());
        let cases = [
            (&iid, xs, sum),
            (&ordered, xs, sum + 6f64.ln()),
            (&ordered, [xs[1], xs[0], xs[2]], never),
        ];
        for (d, x, expected) in cases {
            let got = d.log_density(&x.to_vec().into());
            points.check(agree(got, expected, 1e-12, 1e-12), || {
                format!("{} of scale {scale:e} at {x:?}: {got}", d.name())
            });
        }
    }
    points.finish();
}
