//! Hamiltonian dynamics on the unconstrained coordinates of continuous choices.
//!
//! The potential is minus the log joint density and the log Jacobians of the transforms;
//! its gradient is taken through the trace. Acceptance uses the density itself, so that a
//! wrong or jumping gradient costs acceptance, never correctness: the leapfrog map is
//! volume-preserving and reversible for any force that depends on position alone. A place
//! where the program has no value, where choices appear or vanish, or where the density
//! is 0 has infinite energy.

mod adapt;
mod hmc;
mod kernel;
mod laplace;
mod memory;
mod modes;
mod nuts;
mod optimize;
mod summed;
mod system;

pub use hmc::Hmc;
pub use kernel::Hamiltonian;
pub use modes::Modes;
pub use nuts::Nuts;
pub use optimize::Optimize;

use kernel::{End, Path, Trajectory};
use memory::Memory;
use system::{Point, System};

/// By how much the energy may be off before a trajectory counts as divergent (Stan's
/// bound).
const DIVERGENT: f64 = 1000.0;
