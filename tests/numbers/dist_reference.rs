//! Log densities and special functions compared with a table computed with 60 digits, and
//! with statrs.
//!
//! The inputs of the table are doubles, so the whole difference is due to this crate. The
//! tolerance is relative to the value, with a floor for values near 0, where terms of
//! size 1 to 100 have cancelled.

use crate::common::families::{datum, made};
use pcadlang_numerics::dist::*;
use pcadlang_numerics::num;

const TABLE: &str = include_str!("../data/dist_reference.csv");

fn function(name: &str, p: &[f64]) -> f64 {
    match (name, p) {
        ("log_normal_cdf", [x]) => num::log_normal_cdf(*x),
        ("mills_ratio", [x]) => num::mills_ratio(*x),
        ("log_scaled_i0", [x]) => num::log_scaled_i0(*x),
        ("bessel_deficit", [x]) => num::one_minus_i1_over_i0(*x),
        ("digamma", [x]) => num::digamma(*x),
        ("ln_beta", [a, b]) => num::ln_beta(*a, *b),
        ("ln_choose", [n, k]) => num::ln_choose(*n, *k),
        ("stirling_error", [x]) => num::stirling_error(*x),
        ("deviance", [x, m]) => num::deviance(*x, *m),
        other => panic!("unknown function {other:?}"),
    }
}

/// Whether two values agree up to a relative error and an absolute floor; infinities must
/// be equal.
fn agree(got: f64, expected: f64, relative: f64, floor: f64) -> bool {
    got == expected || (got - expected).abs() <= relative * expected.abs() + floor
}

#[test]
fn the_table_agrees() {
    let mut rows = 0;
    let mut wrong = Vec::new();
    for line in TABLE.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let [name, parameters, point, expected] = fields[..] else { panic!("bad row {line}") };
        let p: Vec<f64> = parameters.split(' ').map(|p| p.parse().unwrap()).collect();
        let expected: f64 = expected.parse().unwrap();
        let (got, floor) = match name.strip_prefix("num:") {
            Some(f) => (function(f, &p), if f == "deviance" { 0.0 } else { 5e-15 }),
            None => {
                let x: Vec<f64> = point.split(' ').map(|x| x.parse().unwrap()).collect();
                let x = datum(name, &x);
                // The values are differences of logarithms.
                let floor = if name.starts_with("truncated:") { 1e-11 } else { 5e-14 };
                (made(name, &p).log_density(&x), floor)
            }
        };
        rows += 1;
        if !agree(got, expected, 3e-13, floor) {
            wrong.push(format!("{line}: got {got:e}, off by {:e}", (got - expected).abs()));
        }
    }
    assert!(rows > 1500, "only {rows} rows");
    assert!(wrong.is_empty(), "{} of {rows}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn statrs_agrees_on_ordinary_parameters() {
    use statrs::distribution as s;
    use statrs::distribution::{Continuous, Discrete};
    let check = |d: Dist, x: f64, expected: f64| {
        let got = d.log_density_num(x);
        assert!(
            agree(got, expected, 1e-10, 1e-10),
            "{} at {x}: {got} against {expected}",
            d.name()
        );
    };
    for i in 1..40u32 {
        let x = f64::from(i) * 0.37;
        let (u, k) = (f64::from(i) / 40.0, f64::from(i));
        check(made("normal", &[1.0, 2.0]), x, s::Normal::new(1.0, 2.0).unwrap().ln_pdf(x));
        check(made("lognormal", &[0.3, 0.8]), x, s::LogNormal::new(0.3, 0.8).unwrap().ln_pdf(x));
        check(made("uniform", &[-1.0, 20.0]), x, s::Uniform::new(-1.0, 20.0).unwrap().ln_pdf(x));
        check(made("beta", &[0.7, 3.5]), u, s::Beta::new(0.7, 3.5).unwrap().ln_pdf(u));
        check(made("gamma", &[2.5, 1.5]), x, s::Gamma::new(2.5, 1.5).unwrap().ln_pdf(x));
        check(made("exponential", &[0.4]), x, s::Exp::new(0.4).unwrap().ln_pdf(x));
        check(
            made("student_t", &[4.0, 1.0, 2.0]),
            x,
            s::StudentsT::new(1.0, 2.0, 4.0).unwrap().ln_pdf(x),
        );
        check(
            made("binomial", &[60.0, 0.3]),
            k,
            s::Binomial::new(0.3, 60).unwrap().ln_pmf(u64::from(i)),
        );
        check(made("poisson", &[12.5]), k, s::Poisson::new(12.5).unwrap().ln_pmf(u64::from(i)));
    }
}
