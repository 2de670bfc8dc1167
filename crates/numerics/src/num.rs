//! Numerics for densities: exact sums, functions that are stable in log space, a hash.
//! All through `libm`, so results are the same on every platform.

mod column;
mod exact;
mod exp;
mod hash;
mod incomplete;
mod log_tails;
mod saddle;
pub mod simd;
mod special;
mod tails;
pub mod wide;

pub use column::Column;
pub use exact::ExactSum;
pub use exp::exp_each;
pub use hash::fnv1a;
pub use incomplete::{chi_square_tail, upper_gamma};
pub use log_tails::{beta_tails, gamma_tails};
pub use saddle::{LN_SQRT_2PI, deviance, stirling_error};
pub use special::{
    digamma, expit, inv_normal_cdf, ln_beta, ln_choose, ln_factorial, ln_gamma, log_diff_exp,
    log_normal_cdf, log_normal_cdf_slope, log_sum_exp, log1m_exp, log1p_exp, logit, normal_cdf,
    normal_density,
};
pub use tails::{log_scaled_i0, mills_ratio, one_minus_i1_over_i0};

/// Adds `more` to `all` element by element, extending `all` with zeros if it is shorter.
pub fn accumulate(all: &mut Vec<f64>, more: &[f64]) {
    if all.len() < more.len() {
        all.resize(more.len(), 0.0);
    }
    all.iter_mut().zip(more).for_each(|(a, b)| *a += b);
}
