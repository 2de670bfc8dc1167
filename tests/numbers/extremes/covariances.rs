//! Covariance functions compared with the table; covariance matrices of any condition
//! number give a factor whose product is the matrix, or an error.

use super::points::Points;
use super::table::{agree, rows};
use nalgebra::DMatrix;
use pcadlang_numerics::dist::Distribution as _;
use pcadlang_numerics::dist::{Covariance, Datum, Gp, MvNormal};

fn function(name: &str, p: &[f64]) -> Covariance {
    match (name, p) {
        ("sq_exp", [length, sd]) => Covariance::sq_exp(*length, *sd),
        ("matern32", [length, sd]) => Covariance::matern32(*length, *sd),
        ("matern52", [length, sd]) => Covariance::matern52(*length, *sd),
        ("periodic", [period, length, sd]) => Covariance::periodic(*period, *length, *sd),
        other => panic!("unknown covariance {other:?}"),
    }
    .unwrap()
}

#[test]
fn covariance_functions_agree_with_the_table() {
    let mut points = Points::of("covariance functions");
    for r in rows("covariance") {
        let got = function(r.name, &r.parameters).at_distance(r.point[0]);
        points.check(agree(got, r.values[0], 1e-12, 1e-320), || format!("{}: got {got:e}", r.line));
    }
    points.finish();
}

/// Returns the Cholesky factor, whose columns are the images of unit vectors.
fn factor(n: usize, colour: impl Fn(&[f64]) -> Option<Datum>) -> DMatrix<f64> {
    let column = |j: usize| {
        let z: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == j))).collect();
        match colour(&z) {
            Some(Datum::Vec(x)) => x.to_vec(),
            other => panic!("{other:?}"),
        }
    };
    DMatrix::from_columns(&(0..n).map(column).map(nalgebra::DVector::from_vec).collect::<Vec<_>>())
}

/// Returns the error of the factor's product relative to the largest entry of the matrix.
fn residual(l: &DMatrix<f64>, k: &DMatrix<f64>) -> f64 {
    // In a unit in which the squares of entries of L do not overflow.
    let most = k.amax();
    let l = l / most.sqrt();
    (&l * l.transpose() - k / most).amax()
}

#[test]
fn processes_of_any_bandwidth_have_factors() {
    let mut points = Points::of("Gaussian processes");
    let names = ["sq_exp", "matern32", "matern52", "periodic"];
    for n in [2, 500] {
        let spacings: [Box<dyn Fn(usize) -> f64>; 4] = [
            Box::new(|i| i as f64),
            Box::new(|_| 1.0),
            Box::new(|i| (i / 2) as f64),
            Box::new(|i| 1e8 + i as f64 * 1e-8),
        ];
        for (kind, place) in spacings.iter().enumerate() {
            let at: Vec<f64> = (0..n).map(place).collect();
            for name in names {
                for bandwidth in [1e-300, 1e-6, 1.0, 1e6, 1e300] {
                    for sd in if n == 2 { &[1e-150, 1.0, 1e150][..] } else { &[1.0] } {
                        let p = if name == "periodic" {
                            vec![7.0, bandwidth, *sd]
                        } else {
                            vec![bandwidth, *sd]
                        };
                        let cov = function(name, &p);
                        let gp = Gp::new(vec![0.0; n], &cov, &at, true);
                        let right = gp.as_ref().is_ok_and(|gp| {
                            let l = factor(n, |z| gp.colour(z));
                            let jitter =
                                DMatrix::from_diagonal_element(n, n, 1e-6 * cov.variance());
                            let density = gp.log_density(&vec![0.0; n].into());
                            residual(&l, &(cov.matrix(&at) + jitter)) < 1e-13 && density.is_finite()
                        });
                        points.check(right, || {
                            format!("{cov} at {n} points, spacing {kind}: {:?}", gp.err())
                        });
                    }
                }
            }
        }
    }
    // A variance that a double cannot hold is an error that names the function.
    for sd in [1e-300, 1e300] {
        for name in &names[..3] {
            let cov = function(name, &[1.0, sd]);
            let e = Gp::new(vec![0.0; 2], &cov, &[0.0, 1.0], true).err().map(|e| e.to_string());
            let said =
                e.as_ref().is_some_and(|e| e.contains(name) && e.contains("positive definite"));
            points.check(said, || format!("{cov}: {e:?}"));
        }
    }
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let cov = function("sq_exp", &[1.0, 1.0]);
        points
            .check(Gp::new(vec![0.0; 2], &cov, &[0.0, bad], true).is_err(), || format!("at {bad}"));
        points.check(Gp::new(vec![0.0, bad], &cov, &[0.0, 1.0], true).is_err(), || {
            format!("mean {bad}")
        });
        for bad in [bad, 0.0, -1.0] {
            points.check(Covariance::sq_exp(bad, 1.0).is_err(), || format!("length {bad}"));
            points.check(Covariance::periodic(1.0, 1.0, bad).is_err(), || format!("sd {bad}"));
        }
    }
    points.finish();
}

/// Returns the log density at 0 of a normal vector, or the reason why it is undefined.
fn at_zero(k: &DMatrix<f64>) -> Result<(MvNormal, f64), String> {
    let n = k.nrows();
    let d = MvNormal::from_cov(&vec![0.0; n], k).map_err(|e| e.to_string())?;
    let p = d.log_density(&vec![0.0; n].into());
    Ok((d, p))
}

const LN_TAU: f64 = 1.837_877_066_409_345_6;

/// Checks for a factor with a residual of rounding size and the right determinant, as far
/// as the condition number allows; from a condition number of 1e15 on, an error that says
/// so is also correct.
fn factors(k: &DMatrix<f64>, log_det: f64, condition: f64) -> Result<(), String> {
    let n = k.nrows();
    match at_zero(k) {
        Ok((d, p)) => {
            let (off, far) = (
                residual(&factor(n, |z| d.colour(z)), k),
                (-2.0 * p - n as f64 * LN_TAU - log_det).abs(),
            );
            let bound = n as f64 * condition * f64::EPSILON + 1e-12 * log_det.abs().max(1.0);
            let right = off <= n as f64 * f64::EPSILON && (far <= bound || condition > 1e15);
            if right {
                Ok(())
            } else {
                Err(format!("residual {off:e}, log determinant off by {far:e} of {bound:e}"))
            }
        }
        Err(e) if condition > 1e15 && e.contains("must be positive definite") => Ok(()),
        Err(e) => Err(e),
    }
}

#[test]
fn matrices_of_any_condition_factor_or_say_so() {
    let mut points = Points::of("covariance matrices");
    // Two ever more strongly correlated numbers: the condition number is (2 - d) / d.
    for power in 0..=52 {
        let d = 2f64.powi(-power);
        for unit in [1e-300, 1.0, 1e300] {
            let k = DMatrix::from_row_slice(2, 2, &[1.0, 1.0 - d, 1.0 - d, 1.0]) * unit;
            let log_det = d.ln() + (2.0 - d).ln() + 2.0 * unit.ln();
            let end = factors(&k, log_det, (2.0 - d) / d);
            points.check(end.is_ok(), || {
                format!("correlation 1 - 2^-{power}, times {unit:e}: {}", end.unwrap_err())
            });
        }
    }
    // Hilbert matrices, as rounded to doubles.
    for r in rows("hilbert") {
        let (n, [log_det, condition]) = (r.point[0] as usize, &r.values[..]) else {
            panic!("{}", r.line)
        };
        let k = DMatrix::from_fn(n, n, |i, j| 1.0 / (i + j + 1) as f64);
        let end = factors(&k, *log_det, *condition);
        points.check(end.is_ok(), || format!("{}: {}", r.line, end.unwrap_err()));
    }
    // Different units do not reduce the accuracy.
    for far in [1.0, 1e50, 1e100, 1e150] {
        let units = [1.0 / far, 1.0, far];
        let k = DMatrix::from_fn(3, 3, |i, j| units[i] * units[j] * if i == j { 1.0 } else { 0.5 });
        let end = at_zero(&k).map(|(_, p)| p);
        // det = 1/2 times the squares of the units, which cancel.
        let expected = -0.5 * (0.5f64.ln() + 3.0 * LN_TAU);
        points.check(end.as_ref().is_ok_and(|p| agree(*p, expected, 1e-12, 0.0)), || {
            format!("units to {far:e}: {end:?}")
        });
    }
    let (inf, nan) = (f64::INFINITY, f64::NAN);
    let bad = [
        [1.0, 1.0, 1.0, 1.0],
        [1.0, 1.0 + 1e-8, 1.0 + 1e-8, 1.0],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [-1.0, 0.0, 0.0, 1.0],
        [1.0, 0.5, 0.4, 1.0],
        [inf, 0.0, 0.0, 1.0],
        [1.0, nan, nan, 1.0],
        [1.0, 1e300, 1e300, 1.0],
        [nan; 4],
    ];
    for entries in bad {
        let end = at_zero(&DMatrix::from_row_slice(2, 2, &entries));
        points.check(end.as_ref().is_err_and(|e| e.contains("mv_normal: cov must be")), || {
            format!("{entries:?}: {end:?}")
        });
    }
    points.finish();
}
