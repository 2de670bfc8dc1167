//! Distributions of several numbers, and of parts: vectors, matrices, mixtures.

pub(in crate::dist) mod ascending;
pub(in crate::dist) mod covariance;
pub(in crate::dist) mod dirichlet;
pub(in crate::dist) mod factor;
pub(in crate::dist) mod gaussian;
pub(in crate::dist) mod gp;
pub(in crate::dist) mod iid;
pub(in crate::dist) mod lkj;
pub(in crate::dist) mod mixed;
pub(in crate::dist) mod mixture;
pub(in crate::dist) mod mv_normal;
pub(in crate::dist) mod ordered;
pub(in crate::dist) mod product;
pub(in crate::dist) mod triangle;
pub(in crate::dist) mod wishart;

pub use covariance::Covariance;
pub use dirichlet::Dirichlet;
pub use factor::Factor;
pub use gp::{Gp, JITTER};
pub use iid::Iid;
pub use lkj::Lkj;
pub use mixed::batch_of_mixture;
pub use mixture::Mixture;
pub use mv_normal::MvNormal;
pub use ordered::Ordered;
pub use product::Product;
pub use wishart::Wishart;
