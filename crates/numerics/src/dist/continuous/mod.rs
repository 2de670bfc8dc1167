//! Continuous distributions of one number.

pub(in crate::dist) mod beta;
pub(in crate::dist) mod cauchy;
pub(in crate::dist) mod exponential;
pub(in crate::dist) mod flat;
pub(in crate::dist) mod gamma;
pub(in crate::dist) mod half_cauchy;
pub(in crate::dist) mod half_normal;
pub(in crate::dist) mod interval;
pub(in crate::dist) mod inv_gamma;
pub(in crate::dist) mod laplace;
pub(in crate::dist) mod lognormal;
pub(in crate::dist) mod normal;
pub(in crate::dist) mod student_t;
pub(in crate::dist) mod truncated;
pub(in crate::dist) mod truncated_normal;
pub(in crate::dist) mod uniform;
pub(in crate::dist) mod von_mises;
pub(in crate::dist) mod weibull;

pub use beta::Beta;
pub use cauchy::Cauchy;
pub use exponential::Exponential;
pub use flat::Flat;
pub use gamma::Gamma;
pub use half_cauchy::HalfCauchy;
pub use half_normal::HalfNormal;
pub use inv_gamma::InvGamma;
pub use laplace::Laplace;
pub use lognormal::LogNormal;
pub use normal::Normal;
pub(super) use normal::log_norm;
pub use student_t::StudentT;
pub use truncated::{Truncated, truncated};
pub use truncated_normal::TruncatedNormal;
pub use uniform::Uniform;
pub use von_mises::VonMises;
pub use weibull::Weibull;
