//! Hamiltonian dynamics on the unconstrained coordinates of continuous choices.
//!
//! The potential is minus the sum of the log joint density and the log Jacobians of the
//! transforms; its gradient is computed through the trace. Acceptance uses the density
//! itself, so that a wrong or discontinuous gradient lowers the acceptance rate, but the
//! kernel stays correct: the leapfrog map is volume-preserving and reversible for any
//! force that depends on position alone. A point at which the program is undefined,
//! choices appear or vanish, or the density is 0 has infinite energy.

mod adapt;
mod hmc;
mod kernel;
mod laplace;
mod memory;
mod modes;
mod nuts;
mod optimize;
mod point;
mod summed;
mod system;

pub use hmc::Hmc;
pub use kernel::Hamiltonian;
pub use modes::Modes;
pub use nuts::Nuts;
pub use optimize::Optimize;
