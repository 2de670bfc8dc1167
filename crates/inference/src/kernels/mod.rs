//! The kernels, one per file, and their list.

mod abc;
mod block;
mod delayed;
mod drift;
mod elliptical;
mod exact;
mod gibbs;
mod hamiltonian;
mod involution;
mod knn;
mod mh;
mod program_kernel;
mod row;
mod shape;
mod slice;
mod smc;
mod temper;

pub use abc::Abc;
pub use block::Block;
pub use delayed::Delayed;
pub use drift::Drift;
pub use elliptical::Elliptical;
pub use exact::Exact;
pub use gibbs::Gibbs;
pub use hamiltonian::{Hamiltonian, Hmc, Nuts};
pub use knn::Knn;
pub use mh::Mh;
pub(crate) use program_kernel::ProgramKernel;
pub use slice::Slice;
pub use smc::Smc;
pub use temper::Temper;

pub(crate) use hamiltonian::approach;
use hamiltonian::{hmc, mala, modes, nuts};
use pcadlang_engine::lang::builtins::{Builtin, Table};
use row::KernelRow;

/// The kernels of the language, in the order of the reference.
const ROWS: &[KernelRow] = &[
    mh::ROW,
    block::ROW,
    drift::ROW,
    gibbs::ROW,
    exact::ROW,
    elliptical::ROW,
    slice::ROW,
    hmc::ROW,
    nuts::ROW,
    mala::ROW,
    knn::ROW,
    delayed::ROW,
    temper::ROW,
    smc::ROW,
    abc::ROW,
    modes::ROW,
];

/// The built-ins of the language, kernels included.
pub fn table() -> Table {
    Table::with_kernels(ROWS.iter().map(Builtin::from))
}
