//! Discrete distributions.

pub(in crate::dist) mod binomial;
pub(in crate::dist) mod categorical;
pub(in crate::dist) mod flip;
pub(in crate::dist) mod geometric;
pub(in crate::dist) mod multinomial;
pub(in crate::dist) mod neg_binomial;
pub(in crate::dist) mod poisson;
pub(in crate::dist) mod uniform_discrete;

pub use binomial::{Binomial, BinomialLogit};
pub use categorical::{Categorical, CategoricalLogits};
pub use flip::{Flip, FlipLogit};
pub use geometric::Geometric;
pub use multinomial::Multinomial;
pub use neg_binomial::NegBinomial;
pub use poisson::{Poisson, PoissonLog};
pub use uniform_discrete::UniformDiscrete;
