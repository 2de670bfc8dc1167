//! Cholesky factors: the lower triangle, packed by rows, with only the operations that
//! Gaussian vectors need.

use crate::num::simd::vectorised;
use nalgebra::DMatrix;

/// A lower triangular matrix L with a positive diagonal. The index of entry (i, j) is i
/// (i + 1) / 2 + j.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    n: usize,
    packed: Vec<f64>,
    log_diagonal: f64,
}

/// Returns the index at which row `i` begins.
#[inline]
fn row(i: usize) -> usize {
    i * (i + 1) / 2
}

impl Factor {
    /// Factors the symmetric matrix with this packed lower triangle.
    ///
    /// # Errors
    /// If it is not positive definite: the order of the smallest leading block that is
    /// not.
    pub fn new(n: usize, mut packed: Vec<f64>) -> Result<Factor, usize> {
        debug_assert_eq!(packed.len(), row(n));
        vectorised(
            #[inline(always)]
            || decompose(n, &mut packed),
        )?;
        Ok(Factor::with_sum(n, packed))
    }

    /// Takes a matrix that is already a factor; `None` unless it is square and finite
    /// with a positive diagonal. Entries above the diagonal are ignored.
    pub fn from_lower(m: &DMatrix<f64>) -> Option<Factor> {
        let packed = lower(m)?;
        let n = m.nrows();
        let good = packed.iter().all(|x| x.is_finite()) && (0..n).all(|i| packed[row(i) + i] > 0.0);
        good.then(|| Factor::with_sum(n, packed))
    }

    fn with_sum(n: usize, packed: Vec<f64>) -> Factor {
        let log_diagonal = (0..n).map(|i| libm::log(packed[row(i) + i])).sum();
        Factor { n, packed, log_diagonal }
    }

    /// The number of rows.
    pub fn size(&self) -> usize {
        self.n
    }

    /// Returns row i, up to the diagonal.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.packed[row(i)..=row(i) + i]
    }

    /// Returns entry (i, i).
    pub fn diagonal(&self, i: usize) -> f64 {
        self.packed[row(i) + i]
    }

    /// Returns ln det L.
    pub fn log_det(&self) -> f64 {
        self.log_diagonal
    }

    /// Returns mean + L z.
    pub fn colour(&self, mean: &[f64], z: &[f64]) -> Vec<f64> {
        (0..self.n).map(|i| mean[i] + dot(&self.packed[row(i)..=row(i) + i], &z[..=i])).collect()
    }

    /// Returns L' g.
    pub fn transposed_times(&self, g: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.n];
        for (i, g) in g.iter().enumerate().take(self.n) {
            let this = &self.packed[row(i)..=row(i) + i];
            out.iter_mut().zip(this).for_each(|(o, l)| *o += l * g);
        }
        out
    }

    /// Converts derivatives with respect to the packed entries of L to those with respect
    /// to the entries of the symmetric matrix K = L L', its lower triangle packed. An
    /// entry off the diagonal stands for both of its positions (Giles 2008; Murray 2016).
    pub fn vjp_cholesky(&self, by: &[f64]) -> Vec<f64> {
        let n = self.n;
        vectorised(
            #[inline(always)]
            || {
                // P, the lower triangle of L' times `by`, with its diagonal halved.
                let mut p = vec![0.0; n * n];
                for k in 0..n {
                    let (this, by) = (self.row(k), &by[row(k)..=row(k) + k]);
                    for (i, l) in this.iter().enumerate() {
                        let out = &mut p[i * n..=i * n + i];
                        out.iter_mut().zip(by).for_each(|(p, b)| *p += l * b);
                    }
                }
                (0..n).for_each(|i| p[i * n + i] *= 0.5);
                // S = L^-T P L^-1.
                self.solve_transposed_columns(&mut p);
                let mut s: Vec<f64> =
                    (0..n * n).map(|at| p[(at % n.max(1)) * n + at / n.max(1)]).collect();
                self.solve_transposed_columns(&mut s);
                let mut packed = Vec::with_capacity(row(n));
                for i in 0..n {
                    packed.extend((0..i).map(|j| s[i * n + j] + s[j * n + i]));
                    packed.push(s[i * n + i]);
                }
                packed
            },
        )
    }

    /// Solves L' X = M for all columns of a square matrix at once, in place.
    #[inline(always)]
    fn solve_transposed_columns(&self, m: &mut [f64]) {
        let n = self.n;
        for i in (0..n).rev() {
            let (above, rest) = m.split_at_mut(i * n);
            let (own, diagonal) = (&mut rest[..n], self.diagonal(i));
            own.iter_mut().for_each(|x| *x /= diagonal);
            for (k, l) in self.row(i)[..i].iter().enumerate() {
                let other = &mut above[k * n..(k + 1) * n];
                other.iter_mut().zip(&*own).for_each(|(z, x)| *z -= l * x);
            }
        }
    }

    /// Returns L^-1 (x - mean).
    pub fn whiten(&self, mean: &[f64], x: &[f64]) -> Vec<f64> {
        let mut z: Vec<f64> = Vec::with_capacity(self.n);
        for i in 0..self.n {
            let this = &self.packed[row(i)..=row(i) + i];
            z.push((x[i] - mean[i] - dot(&this[..i], &z)) / this[i]);
        }
        z
    }

    /// Returns (L L')^-1 b.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.solve_transposed(self.whiten(&vec![0.0; self.n], b))
    }

    /// Returns L^-T z.
    pub fn solve_transposed(&self, mut z: Vec<f64>) -> Vec<f64> {
        for i in (0..self.n).rev() {
            let this = &self.packed[row(i)..=row(i) + i];
            z[i] /= this[i];
            let x = z[i];
            z[..i].iter_mut().zip(this).for_each(|(z, l)| *z -= l * x);
        }
        z
    }
}

/// Returns the packed lower triangle of a square matrix.
pub(in crate::dist) fn lower(m: &DMatrix<f64>) -> Option<Vec<f64>> {
    let (n, by_columns) = (m.nrows(), m.as_slice());
    let mut packed = Vec::with_capacity(row(n));
    for i in 0..n {
        packed.extend(by_columns.iter().skip(i).step_by(n).take(i + 1));
    }
    (m.ncols() == n).then_some(packed)
}

/// How many rows are factored together, so that their dot products with the same row run
/// side by side.
const ROWS: usize = 4;

/// Factors a matrix in place, or returns the order of the smallest leading block that is
/// not positive definite.
#[inline(always)]
fn decompose(n: usize, packed: &mut [f64]) -> Result<(), usize> {
    let mut i = 0;
    while i + ROWS <= n {
        let (above, rest) = packed.split_at_mut(row(i));
        let (a, rest) = rest.split_at_mut(i + 1);
        let (b, rest) = rest.split_at_mut(i + 2);
        let (c, rest) = rest.split_at_mut(i + 3);
        let d = &mut rest[..i + 4];
        for j in 0..i {
            let other = &above[row(j)..=row(j) + j];
            let sums = dots([&a[..j], &b[..j], &c[..j], &d[..j]], &other[..j]);
            for (this, sum) in [&mut *a, &mut *b, &mut *c, &mut *d].into_iter().zip(sums) {
                this[j] = (this[j] - sum) / other[j];
            }
        }
        (i..i + ROWS).try_for_each(|k| decompose_row(packed, k, i))?;
        i += ROWS;
    }
    (i..n).try_for_each(|k| decompose_row(packed, k, 0))
}

/// Computes row `i` from column `from` on.
#[inline(always)]
fn decompose_row(packed: &mut [f64], i: usize, from: usize) -> Result<(), usize> {
    let (above, rest) = packed.split_at_mut(row(i));
    let this = &mut rest[..=i];
    for j in from..i {
        let other = &above[row(j)..=row(j) + j];
        let sum = dot(&this[..j], &other[..j]);
        this[j] = (this[j] - sum) / other[j];
    }
    let pivot = this[i] - dot(&this[..i], &this[..i]);
    if !(pivot > 0.0 && pivot.is_finite()) {
        return Err(i + 1);
    }
    this[i] = pivot.sqrt();
    Ok(())
}

/// Returns [`dot`] of each of these with `b`, all of one length.
#[inline(always)]
fn dots(all: [&[f64]; ROWS], b: &[f64]) -> [f64; ROWS] {
    let (b4, b_rest) = b.as_chunks::<4>();
    let all = all.map(|a| a[..b.len()].as_chunks::<4>());
    let mut sums = [[0.0; 4]; ROWS];
    let [p, q, r, s] = all.map(|(a4, _)| a4);
    for ((((b, p), q), r), s) in b4.iter().zip(p).zip(q).zip(r).zip(s) {
        for (sum, a) in sums.iter_mut().zip([p, q, r, s]) {
            *sum = [
                sum[0] + a[0] * b[0],
                sum[1] + a[1] * b[1],
                sum[2] + a[2] * b[2],
                sum[3] + a[3] * b[3],
            ];
        }
    }
    // Otherwise the compiler vectorises the sums of pairs below, and the loop in halves.
    let sums = std::hint::black_box(sums);
    core::array::from_fn(|r| {
        let tail = match (all[r].1, b_rest) {
            ([a], [b]) => a * b,
            ([a, c], [b, d]) => a * b + c * d,
            ([a, c, e], [b, d, f]) => a * b + c * d + e * f,
            _ => -0.0,
        };
        let s = sums[r];
        (s[0] + s[1]) + (s[2] + s[3]) + tail
    })
}

/// Returns the dot product, in a fixed order with four running sums, which the compiler
/// can vectorise.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let tail: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + tail
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite matrix, packed.
    fn matrix(n: usize) -> Vec<f64> {
        let entry = |i: usize, j: usize| {
            let d = i.abs_diff(j) as f64;
            libm::exp(-0.02 * d * d) * libm::cos(0.3 * d) + if i == j { 0.1 } else { 0.0 }
        };
        (0..n).flat_map(|i| (0..=i).map(move |j| entry(i, j))).collect()
    }

    #[test]
    fn rows_together_have_the_bits_of_rows_in_turn() {
        for n in [0, 1, 3, 4, 5, 8, 11, 30, 51] {
            let mut expected = matrix(n);
            (0..n).try_for_each(|i| decompose_row(&mut expected, i, 0)).unwrap();
            for found in [
                Factor::new(n, matrix(n)).unwrap(),
                crate::num::simd::portable(|| Factor::new(n, matrix(n)).unwrap()),
            ] {
                let bits = |xs: &[f64]| xs.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&found.packed), bits(&expected), "{n} rows");
            }
        }
        for bad in 0..9 {
            let mut singular = matrix(9);
            singular[row(bad) + bad] = -1.0;
            assert_eq!(Factor::new(9, singular), Err(bad + 1));
        }
    }

    #[test]
    fn derivatives_by_the_matrix_are_those_of_differences() {
        let n = 7;
        let by: Vec<f64> = (0..row(n)).map(|i| libm::sin(i as f64)).collect();
        let value = |packed: Vec<f64>| -> f64 {
            Factor::new(n, packed).unwrap().packed.iter().zip(&by).map(|(l, b)| l * b).sum()
        };
        let found = Factor::new(n, matrix(n)).unwrap().vjp_cholesky(&by);
        for (at, found) in found.iter().enumerate() {
            let moved = |by: f64| {
                let mut packed = matrix(n);
                packed[at] += by;
                value(packed)
            };
            let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((found - slope).abs() < 1e-6 * (1.0 + slope.abs()), "{at}: {found}, {slope}");
        }
    }
}
