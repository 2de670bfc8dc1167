//! To and from unconstrained space: the transforms of Stan (Stan Reference Manual, "Constraint Transforms"): log for positive
//! numbers, scaled logit for intervals, stick-breaking for the simplex.

use super::{Datum, Support};
use crate::num::{expit, log1p_exp};

impl Support {
    /// The dimension of the unconstrained space; 0 for discrete supports.
    pub fn free_dim(&self) -> usize {
        match self {
            Support::Real | Support::Positive | Support::NonNegative | Support::Interval { .. } => 1,
            Support::Boolean | Support::Integers { .. } => 0,
            Support::Simplex(n) => n.saturating_sub(1),
            Support::Vector(n) => *n,
            Support::Repeat(s, n) => s.free_dim() * n,
            Support::Product(s) => s.iter().map(Support::free_dim).sum(),
        }
    }

    /// Appends the unconstrained coordinates of a value; values at an edge are moved inside by the least that keeps them
    /// finite.
    pub fn to_free(&self, x: &Datum, out: &mut Vec<f64>) {
        match (self, x) {
            (Support::Simplex(n), Datum::Vec(v)) if v.len() == *n => {
                let mut left = 1.0;
                for (k, p) in v[..n.saturating_sub(1)].iter().enumerate() {
                    let z = if left > 0.0 { p / left } else { 0.5 };
                    let rest = (n - 1 - k) as f64;
                    out.push(logit(z) + libm::log(rest));
                    left -= p;
                }
            }
            (Support::Vector(_), Datum::Vec(v)) => out.extend_from_slice(v),
            (Support::Repeat(s, n), x) => {
                (0..*n).for_each(|i| {
                    if let Some(e) = x.element(i) {
                        s.to_free(&e, out)
                    }
                });
            }
            (Support::Product(s), x) => {
                s.iter().enumerate().for_each(|(i, s)| {
                    if let Some(e) = x.element(i) {
                        s.to_free(&e, out)
                    }
                });
            }
            (_, Datum::Num(x)) if self.free_dim() == 1 => out.push(self.to_free_number(*x)),
            _ => {}
        }
    }

    /// The unconstrained coordinate of a number.
    pub fn to_free_number(&self, x: f64) -> f64 {
        match self {
            Support::Positive | Support::NonNegative => libm::log(x.max(f64::MIN_POSITIVE)),
            Support::Interval { lo, hi } if *hi == f64::INFINITY => libm::log((x - lo).max(f64::MIN_POSITIVE)),
            Support::Interval { lo, hi } => logit((x - lo) / (hi - lo)),
            _ => x,
        }
    }

    /// The number of an unconstrained coordinate, and the log of the absolute derivative there.
    pub fn from_free_number(&self, y: f64) -> (f64, f64) {
        match self {
            Support::Positive | Support::NonNegative => (libm::exp(y), y),
            Support::Interval { lo, hi } if *hi == f64::INFINITY => (lo + libm::exp(y), y),
            Support::Interval { lo, hi } => {
                let p = expit(y);
                // From the nearer end, so that no precision is lost close to the upper one.
                let x = if y < 0.0 { lo + (hi - lo) * p } else { hi - (hi - lo) * expit(-y) };
                (x, libm::log(hi - lo) - log1p_exp(-y) - log1p_exp(y))
            }
            _ => (y, 0.0),
        }
    }

    /// The value of unconstrained coordinates, and the log absolute determinant of the derivative there.
    pub fn from_free(&self, y: &[f64]) -> (Datum, f64) {
        match self {
            Support::Simplex(n) => {
                let mut left = 1.0;
                let mut log_left = 0.0;
                let mut log_jacobian = 0.0;
                let mut v = Vec::with_capacity(*n);
                for (k, y) in y.iter().take(n.saturating_sub(1)).enumerate() {
                    let y = y - libm::log((n - 1 - k) as f64);
                    let z = expit(y);
                    log_jacobian += log_left - log1p_exp(-y) - log1p_exp(y);
                    v.push(left * z);
                    left *= expit(-y);
                    log_left -= log1p_exp(y);
                }
                v.push(left);
                (Datum::Vec(v.into()), log_jacobian)
            }
            Support::Vector(_) => (Datum::Vec(y.into()), 0.0),
            Support::Repeat(s, n) => {
                let d = s.free_dim();
                let parts = (0..*n).map(|i| s.from_free(y.get(i * d..(i + 1) * d).unwrap_or_default()));
                collect(parts)
            }
            Support::Product(supports) => {
                let mut at = 0;
                let parts = supports.iter().map(|s| {
                    let d = s.free_dim();
                    at += d;
                    s.from_free(y.get(at - d..at).unwrap_or_default())
                });
                collect(parts)
            }
            Support::Boolean => (Datum::Bool(false), 0.0),
            Support::Integers { lo, .. } => (Datum::Num(*lo as f64), 0.0),
            _ => {
                let (x, j) = self.from_free_number(y.first().copied().unwrap_or(0.0));
                (Datum::Num(x), j)
            }
        }
    }
}

fn collect(parts: impl Iterator<Item = (Datum, f64)>) -> (Datum, f64) {
    let mut jacobian = 0.0;
    let items = parts
        .map(|(d, j)| {
            jacobian += j;
            d
        })
        .collect();
    (Datum::from_elements(items), jacobian)
}

/// ln(p / (1 - p)), finite also at 0 and 1.
fn logit(p: f64) -> f64 {
    let p = p.clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON / 2.0);
    libm::log(p) - libm::log1p(-p)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cases() -> Vec<(Support, Vec<f64>)> {
        let interval = |lo, hi| Support::Interval { lo, hi };
        vec![
            (Support::Real, vec![-1.3]),
            (Support::Positive, vec![0.7]),
            (Support::NonNegative, vec![-2.0]),
            (interval(-2.0, 5.0), vec![0.4]),
            (interval(-2.0, 5.0), vec![-3.0]),
            (interval(1.0, f64::INFINITY), vec![0.3]),
            (Support::Simplex(4), vec![0.3, -0.8, 1.1]),
            (Support::Vector(3), vec![1.0, -2.0, 0.5]),
            (Support::Repeat(Box::new(Support::Positive), 3), vec![0.1, 0.2, -0.3]),
            (Support::Product([Support::Real, Support::Positive].into()), vec![0.1, 0.2]),
        ]
    }

    fn flat(x: &Datum) -> Vec<f64> {
        match x {
            Datum::Num(x) => vec![*x],
            Datum::Vec(v) => v.to_vec(),
            _ => unreachable!("only numbers here"),
        }
    }

    #[test]
    fn there_and_back() {
        for (s, y) in cases() {
            let (x, _) = s.from_free(&y);
            assert!(s.contains(&x) && s.fits(&x), "{s:?}: {x:?}");
            let mut back = Vec::new();
            s.to_free(&x, &mut back);
            assert_eq!(back.len(), s.free_dim());
            assert!(back.iter().zip(&y).all(|(a, b)| (a - b).abs() < 1e-12), "{s:?}: {back:?} against {y:?}");
        }
    }

    #[test]
    fn jacobians_against_differences() {
        for (s, y) in cases() {
            let n = s.free_dim();
            let h = 1e-6;
            let m = nalgebra::DMatrix::from_fn(n, n, |i, j| {
                let at = |d: f64| {
                    let mut y = y.clone();
                    y[j] += d;
                    flat(&s.from_free(&y).0)[i]
                };
                (at(h) - at(-h)) / (2.0 * h)
            });
            let expected = m.determinant().abs().ln();
            let got = s.from_free(&y).1;
            assert!((got - expected).abs() < 1e-7, "{s:?}: {got} against {expected}");
        }
    }

    #[test]
    fn extremes_stay_finite() {
        for (s, _) in cases() {
            for y in [-700.0, -40.0, 40.0, 700.0] {
                let (x, j) = s.from_free(&vec![y; s.free_dim()]);
                assert!(j.is_finite(), "{s:?} at {y}: {j}");
                assert!(flat(&x).iter().all(|x| x.is_finite()), "{s:?} at {y}: {x:?}");
            }
        }
        let mut y = Vec::new();
        Support::Interval { lo: 0.0, hi: 1.0 }.to_free(&Datum::Num(0.0), &mut y);
        Support::Interval { lo: 0.0, hi: 1.0 }.to_free(&Datum::Num(1.0), &mut y);
        Support::NonNegative.to_free(&Datum::Num(0.0), &mut y);
        Support::Simplex(3).to_free(&Datum::Vec([1.0, 0.0, 0.0].into()), &mut y);
        assert!(y.iter().all(|y| y.is_finite()), "{y:?}");
    }
}
