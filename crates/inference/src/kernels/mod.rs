//! The kernels, one per file.

mod abc;
mod abc_smc;
mod block;
mod delayed;
mod drift;
mod elliptical;
mod gibbs;
mod hamiltonian;
mod involution;
mod knn;
mod mh;
mod particles;
mod program_kernel;
mod shape;
mod slice;
mod smc;
mod temper;

pub use abc::Abc;
pub use abc_smc::AbcSmc;
pub use block::Block;
pub use delayed::Delayed;
pub use drift::Drift;
pub use elliptical::Elliptical;
pub use gibbs::Gibbs;
pub use hamiltonian::{Hamiltonian, Hmc, Modes, Nuts, Optimize};
pub use knn::Knn;
pub use mh::Mh;
pub use particles::Independent;
pub(crate) use program_kernel::ProgramKernel;
pub use slice::Slice;
pub use smc::Smc;
pub use temper::Temper;
