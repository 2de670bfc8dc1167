//! Numbers for kinematics and profiles: plain doubles, or variables of a tape that
//! differentiates the same computation in reverse mode. So values and gradients come from
//! the same code.

use std::cell::RefCell;
use std::ops::{Add, Mul, Neg, Sub};

/// The operations on numbers.
pub(super) trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// The value as a double.
    fn value(self) -> f64;
    /// A constant of the same type, on the same tape.
    fn constant(self, x: f64) -> Self;
    /// A function of this number, given by its value and derivative there.
    fn map(self, value: f64, slope: f64) -> Self;

    /// The square root, with derivative 0 at 0.
    fn sqrt(self) -> Self {
        let r = self.value().sqrt();
        self.map(r, if r > 0.0 { 0.5 / r } else { 0.0 })
    }

    /// The reciprocal.
    fn recip(self) -> Self {
        let r = 1.0 / self.value();
        self.map(r, -r * r)
    }

    /// The angle of the direction (x, self), from -pi to pi.
    fn atan2(self, x: Self) -> Self;
    /// The quotient self / o.
    fn over(self, o: Self) -> Self;
}

impl Real for f64 {
    fn value(self) -> f64 {
        self
    }

    fn constant(self, x: f64) -> f64 {
        x
    }

    fn map(self, value: f64, _slope: f64) -> f64 {
        value
    }

    fn atan2(self, x: f64) -> f64 {
        libm::atan2(self, x)
    }

    fn over(self, o: f64) -> f64 {
        self / o
    }
}

/// The record of a computation: for each variable, its two operands and the partial
/// derivatives with respect to them.
#[derive(Default)]
pub(super) struct Tape(RefCell<Vec<[(u32, f64); 2]>>);

/// A variable of a tape.
#[derive(Clone, Copy)]
pub(super) struct Var<'t> {
    tape: &'t Tape,
    index: u32,
    value: f64,
}

impl Tape {
    /// Adds an independent variable.
    pub fn variable(&self, value: f64) -> Var<'_> {
        self.push(value, [(0, 0.0); 2])
    }

    fn push(&self, value: f64, from: [(u32, f64); 2]) -> Var<'_> {
        let mut records = self.0.borrow_mut();
        records.push(from);
        Var { tape: self, index: records.len() as u32 - 1, value }
    }

    /// Returns the derivatives of the weighted sum of `outputs` with respect to every
    /// variable of the tape.
    pub fn reverse<'t>(&'t self, outputs: impl Iterator<Item = (Var<'t>, f64)>) -> Vec<f64> {
        let records = self.0.borrow();
        let mut slopes = vec![0.0; records.len()];
        for (v, factor) in outputs {
            slopes[v.index as usize] += factor;
        }
        for (i, from) in records.iter().enumerate().rev() {
            let s = slopes[i];
            if s != 0.0 {
                for (j, d) in from {
                    slopes[*j as usize] += s * d;
                }
            }
        }
        slopes
    }
}

impl Var<'_> {
    /// The index in the result of [`Tape::reverse`].
    pub fn index(&self) -> usize {
        self.index as usize
    }
}

impl Add for Var<'_> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        self.tape.push(self.value + o.value, [(self.index, 1.0), (o.index, 1.0)])
    }
}

impl Sub for Var<'_> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self.tape.push(self.value - o.value, [(self.index, 1.0), (o.index, -1.0)])
    }
}

impl Mul for Var<'_> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        self.tape.push(self.value * o.value, [(self.index, o.value), (o.index, self.value)])
    }
}

impl Neg for Var<'_> {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(-self.value, -1.0)
    }
}

impl Real for Var<'_> {
    fn value(self) -> f64 {
        self.value
    }

    fn constant(self, x: f64) -> Self {
        self.tape.variable(x)
    }

    fn map(self, value: f64, slope: f64) -> Self {
        self.tape.push(value, [(self.index, slope), (self.index, 0.0)])
    }

    fn atan2(self, x: Self) -> Self {
        let square = self.value * self.value + x.value * x.value;
        let (dy, dx) =
            if square > 0.0 { (x.value / square, -self.value / square) } else { (0.0, 0.0) };
        self.tape.push(libm::atan2(self.value, x.value), [(self.index, dy), (x.index, dx)])
    }

    fn over(self, o: Self) -> Self {
        let (q, inverse) = (self.value / o.value, 1.0 / o.value);
        self.tape.push(q, [(self.index, inverse), (o.index, -q * inverse)])
    }
}

/// A 3-vector of numbers.
#[derive(Clone, Copy)]
pub(super) struct V3<T>(pub [T; 3]);

/// A 3 x 3 matrix of numbers, by rows.
#[derive(Clone, Copy)]
pub(super) struct M3<T>(pub [[T; 3]; 3]);

impl<T: Real> V3<T> {
    pub fn dot(self, o: Self) -> T {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }

    pub fn cross(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        V3([b * z - c * y, c * x - a * z, a * y - b * x])
    }

    pub fn scale(self, s: T) -> Self {
        V3(self.0.map(|x| x * s))
    }

    pub fn is_zero(self) -> bool {
        self.0.iter().all(|x| x.value() == 0.0)
    }
}

impl<T: Real> Add for V3<T> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        V3([0, 1, 2].map(|i| self.0[i] + o.0[i]))
    }
}

impl<T: Real> Sub for V3<T> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        V3([0, 1, 2].map(|i| self.0[i] - o.0[i]))
    }
}

impl<T: Real> M3<T> {
    pub fn apply(self, v: V3<T>) -> V3<T> {
        V3(self.0.map(|row| V3(row).dot(v)))
    }

    pub fn times(self, o: Self) -> Self {
        let t = o.transposed();
        M3(self.0.map(|row| t.0.map(|column| V3(row).dot(V3(column)))))
    }

    pub fn transposed(self) -> Self {
        M3([0, 1, 2].map(|i| [0, 1, 2].map(|j| self.0[j][i])))
    }

    /// Scales each column by a component of a vector.
    pub fn scaled(self, s: V3<T>) -> Self {
        M3(self.0.map(|row| [0, 1, 2].map(|j| row[j] * s.0[j])))
    }

    /// The rotation by a rotation vector, axis times angle (Rodrigues' formula); smooth
    /// also at 0.
    pub fn from_rotation_vector(v: V3<T>) -> Self {
        let square = v.dot(v);
        let q = square.value();
        // sin(a) / a and (1 - cos(a)) / a^2 as functions of a^2, with their derivatives.
        let (s, ds, c, dc) = if q < 1e-8 {
            (1.0 - q / 6.0, -1.0 / 6.0 + q / 60.0, 0.5 - q / 24.0, -1.0 / 24.0 + q / 360.0)
        } else {
            let a = q.sqrt();
            let (sin, cos) = libm::sincos(a);
            let (s, c) = (sin / a, (1.0 - cos) / q);
            (s, 0.5 * (cos - s) / q, c, 0.5 * (s - 2.0 * c) / q)
        };
        let (s, c) = (square.map(s, ds), square.map(c, dc));
        let one = square.constant(1.0);
        let [x, y, z] = v.0;
        let (sx, sy, sz) = (s * x, s * y, s * z);
        let (xy, xz, yz) = (c * x * y, c * x * z, c * y * z);
        M3([
            [one - c * (y * y + z * z), xy - sz, xz + sy],
            [xy + sz, one - c * (x * x + z * z), yz - sx],
            [xz - sy, yz + sx, one - c * (x * x + y * y)],
        ])
    }

    /// The rotation Rz Ry Rx.
    pub fn from_angles(angles: V3<T>) -> Self {
        let [x, y, z] = angles.0.map(|a| {
            let (s, c) = (libm::sin(a.value()), libm::cos(a.value()));
            (a.map(s, c), a.map(c, -s))
        });
        let ((sx, cx), (sy, cy), (sz, cz)) = (x, y, z);
        M3([
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Plain = fn(V3<f64>) -> M3<f64>;
    type Taped = for<'a> fn(V3<Var<'a>>) -> M3<Var<'a>>;

    #[test]
    fn rotations_and_their_derivatives() {
        for v in [[0.3, -0.4, 1.2], [1e-5, 2e-5, -1e-5], [0.0; 3], [3.0, 0.5, -0.2]] {
            let axis = glam::DVec3::from(v);
            let want = glam::DMat3::from_quat(glam::DQuat::from_scaled_axis(axis))
                .transpose()
                .to_cols_array();
            let got = M3::from_rotation_vector(V3(v)).0.concat();
            assert!(want.iter().zip(&got).all(|(a, b)| (a - b).abs() < 1e-14), "{v:?}");
            let turned =
                crate::geom::Affine::new(glam::DVec3::ZERO, axis, glam::DVec3::ONE).0.matrix3;
            let got = M3::from_angles(V3(v)).0.concat();
            assert!(
                turned
                    .transpose()
                    .to_cols_array()
                    .iter()
                    .zip(&got)
                    .all(|(a, b)| (a - b).abs() < 1e-14)
            );
            let weights: Vec<f64> = (0..9).map(|i| libm::cos(f64::from(i))).collect();
            let by: [(Plain, Taped); 2] = [
                (M3::from_rotation_vector, |v| M3::from_rotation_vector(v)),
                (M3::from_angles, |v| M3::from_angles(v)),
            ];
            for (plain, taped) in by {
                let tape = Tape::default();
                let x = V3(v.map(|x| tape.variable(x)));
                let out = taped(x).0.concat();
                let slopes = tape.reverse(out.iter().copied().zip(weights.iter().copied()));
                for k in 0..3 {
                    let f = |h: f64| {
                        let mut v = v;
                        v[k] += h;
                        plain(V3(v))
                            .0
                            .concat()
                            .iter()
                            .zip(&weights)
                            .map(|(a, b)| a * b)
                            .sum::<f64>()
                    };
                    let numeric = (f(1e-5) - f(-1e-5)) / 2e-5;
                    assert!((numeric - slopes[x.0[k].index()]).abs() < 1e-8, "{v:?} {k}");
                }
            }
        }
    }
}
