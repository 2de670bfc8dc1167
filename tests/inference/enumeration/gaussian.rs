//! Values that are affine in Gaussian choices, and the distribution of such choices given
//! observations that are affine in them.

/// The largest number of Gaussian choices in an execution.
pub const MOST: usize = 6;

/// A number, or an affine function of Gaussian choices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    pub constant: f64,
    pub slopes: [f64; MOST],
}

impl Affine {
    pub fn number(constant: f64) -> Affine {
        Affine { constant, slopes: [0.0; MOST] }
    }

    pub fn choice(i: usize) -> Affine {
        let mut a = Affine::number(0.0);
        a.slopes[i] = 1.0;
        a
    }

    pub fn is_number(&self) -> bool {
        self.slopes == [0.0; MOST]
    }

    pub fn plus(&self, o: &Affine) -> Affine {
        let mut a = *self;
        a.constant += o.constant;
        a.slopes.iter_mut().zip(o.slopes).for_each(|(s, t)| *s += t);
        a
    }

    /// Multiplies two values; `None` if neither is a constant.
    pub fn times(&self, o: &Affine) -> Option<Affine> {
        let (a, by) = if o.is_number() { (self, o.constant) } else { (o, self.constant) };
        (self.is_number() || o.is_number())
            .then(|| Affine { constant: a.constant * by, slopes: a.slopes.map(|s| s * by) })
    }
}

/// The distribution of Gaussian choices given the observations.
#[derive(Clone, Debug)]
pub struct Gaussian {
    pub mean: Vec<f64>,
    /// The Cholesky factor of the precision matrix, by rows.
    factor: Vec<Vec<f64>>,
    /// The log of the integral of prior times likelihood.
    pub log_evidence: f64,
}

const LOG_SQRT_TAU: f64 = 0.918_938_533_204_672_8;

impl Gaussian {
    /// Conditions `n` choices on their residuals, each normal around 0 with a standard
    /// deviation. The prior's residual of choice `i` has slope 1 in that choice.
    pub fn new(n: usize, residuals: &[(Affine, f64)]) -> Gaussian {
        let mut precision = vec![vec![0.0; n]; n];
        let mut vjp = vec![0.0; n];
        let mut log_evidence = n as f64 * LOG_SQRT_TAU;
        for (r, sd) in residuals {
            let w = 1.0 / (sd * sd);
            log_evidence -= LOG_SQRT_TAU + sd.ln() + 0.5 * w * r.constant * r.constant;
            for i in 0..n {
                vjp[i] -= w * r.slopes[i] * r.constant;
                (0..n).for_each(|j| precision[i][j] += w * r.slopes[i] * r.slopes[j]);
            }
        }
        let mut factor = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in 0..=i {
                let inner: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                let rest = precision[i][j] - inner;
                factor[i][j] = if i == j { rest.sqrt() } else { rest / factor[j][j] };
            }
        }
        let mut white = vec![0.0; n];
        for i in 0..n {
            let inner: f64 = (0..i).map(|k| factor[i][k] * white[k]).sum();
            white[i] = (vjp[i] - inner) / factor[i][i];
            log_evidence += 0.5 * white[i] * white[i] - factor[i][i].ln();
        }
        let mut g = Gaussian { mean: vec![0.0; n], factor, log_evidence };
        g.mean = g.coloured(&white);
        g
    }

    /// Solves with the transposed factor for white noise: returns the choices' offset
    /// from their mean.
    fn coloured(&self, white: &[f64]) -> Vec<f64> {
        let n = white.len();
        let mut x = vec![0.0; n];
        for i in (0..n).rev() {
            let inner: f64 = (i + 1..n).map(|k| self.factor[k][i] * x[k]).sum();
            x[i] = (white[i] - inner) / self.factor[i][i];
        }
        x
    }

    /// Returns the draw that corresponds to white noise.
    pub fn draw(&self, white: &[f64]) -> Vec<f64> {
        self.coloured(white).iter().zip(&self.mean).map(|(x, m)| x + m).collect()
    }

    /// Returns the standard deviation of a choice.
    pub fn sd(&self, i: usize) -> f64 {
        let n = self.mean.len();
        let unit = |k| (0..n).map(|j| f64::from(u8::from(j == k))).collect::<Vec<f64>>();
        (0..n).map(|k| self.coloured(&unit(k))[i].powi(2)).sum::<f64>().sqrt()
    }

    /// Returns the log density of the draw that corresponds to white noise.
    pub fn log_density(&self, white: &[f64]) -> f64 {
        white
            .iter()
            .enumerate()
            .map(|(i, z)| self.factor[i][i].ln() - LOG_SQRT_TAU - 0.5 * z * z)
            .sum()
    }

    /// Returns the white noise that corresponds to a draw.
    pub fn whitened(&self, x: &[f64]) -> Vec<f64> {
        let n = x.len();
        (0..n).map(|i| (i..n).map(|k| self.factor[k][i] * (x[k] - self.mean[k])).sum()).collect()
    }
}
