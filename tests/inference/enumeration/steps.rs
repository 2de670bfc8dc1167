//! A beta choice that a program only compares with quarters: its posterior is its prior, with a
//! weight for each quarter. The shapes give it poles at either end.

use statrs::function::beta::beta_reg;

/// The number of intervals between the numbers that programs compare it with.
pub const QUARTERS: usize = 4;

/// The prior's shapes, and what the posterior makes of it.
#[derive(Clone, Debug)]
pub struct Steps {
    shapes: (f64, f64),
    /// By quarter: the log weight, prior included, and the cumulative probability.
    log_weights: [f64; QUARTERS],
    sums: [f64; QUARTERS],
}

/// Returns the probability below the number whose logit is `t`; both ends are resolved, as far as
/// numbers of 64 bits are.
fn below_logit(shapes: (f64, f64), t: f64) -> f64 {
    let near = 1.0 / (1.0 + t.abs().exp());
    match t < 0.0 {
        true => beta_reg(shapes.0, shapes.1, near),
        false => 1.0 - beta_reg(shapes.1, shapes.0, near),
    }
}

/// Returns the prior probability below the quarter with this index.
fn before(shapes: (f64, f64), quarter: usize) -> f64 {
    match quarter {
        0 => 0.0,
        QUARTERS => 1.0,
        _ => beta_reg(shapes.0, shapes.1, quarter as f64 / QUARTERS as f64),
    }
}

/// Returns the prior probability of a quarter.
pub fn mass(shapes: (f64, f64), quarter: usize) -> f64 {
    before(shapes, quarter + 1) - before(shapes, quarter)
}

impl Steps {
    pub fn new(shapes: (f64, f64)) -> Steps {
        Steps { shapes, log_weights: [f64::NEG_INFINITY; QUARTERS], sums: [0.0; QUARTERS] }
    }

    pub fn set(&mut self, quarter: usize, log_weight: f64) {
        self.log_weights[quarter] = log_weight;
    }

    /// Computes the probabilities, and returns the log of the integral.
    pub fn add_up(&mut self) -> f64 {
        let top = self.log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut total = 0.0;
        for (w, s) in self.log_weights.iter().zip(&mut self.sums) {
            total += (w - top).exp();
            *s = total;
        }
        self.sums.iter_mut().for_each(|s| *s /= total);
        top + total.ln()
    }

    /// Returns the point below which the probability is `u`.
    pub fn quantile(&self, u: f64) -> f64 {
        let quarter = self.sums.partition_point(|s| *s <= u).min(QUARTERS - 1);
        let from = if quarter == 0 { 0.0 } else { self.sums[quarter - 1] };
        let share = (u - from) / (self.sums[quarter] - from);
        let prior = before(self.shapes, quarter) + share * mass(self.shapes, quarter);
        // The largest number below 1 has this logit.
        let (mut low, mut high) = (-700.0, 36.7);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            match below_logit(self.shapes, middle) < prior {
                true => low = middle,
                false => high = middle,
            }
        }
        1.0 / (1.0 + f64::exp(-low))
    }

    /// Returns the probability below a point.
    pub fn below(&self, x: f64) -> f64 {
        let quarter = ((x * QUARTERS as f64) as usize).min(QUARTERS - 1);
        let from = if quarter == 0 { 0.0 } else { self.sums[quarter - 1] };
        let prior = below_logit(self.shapes, x.ln() - (-x).ln_1p());
        let share = (prior - before(self.shapes, quarter)) / mass(self.shapes, quarter);
        from + (self.sums[quarter] - from) * share.clamp(0.0, 1.0)
    }
}
