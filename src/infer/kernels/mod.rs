//! The kernels, one file each.

mod block;
mod drift;
mod elliptical;
mod gibbs;
mod hamiltonian;
mod knn;
mod mh;
mod slice;

pub use block::Block;
pub use drift::Drift;
pub use elliptical::Elliptical;
pub use gibbs::Gibbs;
pub use hamiltonian::{Hmc, Nuts};
pub use knn::Knn;
pub use mh::Mh;
pub use slice::Slice;
