//! The kernels, one file each.

mod block;
mod drift;
mod elliptical;
mod gibbs;
mod mh;

pub use block::Block;
pub use drift::Drift;
pub use elliptical::Elliptical;
pub use gibbs::Gibbs;
pub use mh::Mh;
