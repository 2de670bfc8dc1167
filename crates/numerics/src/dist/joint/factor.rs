//! Cholesky factors: the lower triangle, packed by rows, with only the operations that
//! Gaussian vectors need.

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
        for i in 0..n {
            let (above, rest) = packed.split_at_mut(row(i));
            let this = &mut rest[..=i];
            for j in 0..i {
                let other = &above[row(j)..=row(j) + j];
                let sum = dot(&this[..j], &other[..j]);
                this[j] = (this[j] - sum) / other[j];
            }
            let pivot = this[i] - dot(&this[..i], &this[..i]);
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(i + 1);
            }
            this[i] = pivot.sqrt();
        }
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
        let entry = |m: &[f64], i: usize, j: usize| m[row(i) + j];
        // The columns of P, the lower triangle of L' times `by`, with its diagonal
        // halved.
        let mut columns: Vec<Vec<f64>> = vec![vec![0.0; n]; n];
        for (j, column) in columns.iter_mut().enumerate() {
            for (i, p) in column.iter_mut().enumerate().skip(j) {
                let sum: f64 = (i..n).map(|k| entry(&self.packed, k, i) * entry(by, k, j)).sum();
                *p = if i == j { 0.5 * sum } else { sum };
            }
        }
        // S = L^-T P L^-1.
        let half: Vec<Vec<f64>> = columns.into_iter().map(|c| self.solve_transposed(c)).collect();
        let rows: Vec<Vec<f64>> =
            (0..n).map(|i| self.solve_transposed(half.iter().map(|c| c[i]).collect())).collect();
        let packed = |i: usize| (0..=i).map(move |j| (i, j));
        (0..n)
            .flat_map(packed)
            .map(|(i, j)| if i == j { rows[i][i] } else { rows[i][j] + rows[j][i] })
            .collect()
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
    let n = m.nrows();
    (m.ncols() == n).then(|| (0..n).flat_map(|i| (0..=i).map(move |j| m[(i, j)])).collect())
}

/// Returns the dot product, in a fixed order with four running sums, which the compiler
/// can vectorise.
#[inline]
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
