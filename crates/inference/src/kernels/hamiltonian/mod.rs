//! Hamiltonian dynamics on the unconstrained coordinates of continuous choices.
//!
//! The potential is minus the sum of the log joint density and the log Jacobians of the
//! transforms; its gradient is computed through the trace. Acceptance uses the density
//! itself, so that a wrong or discontinuous gradient lowers the acceptance rate, but the
//! kernel stays correct: the leapfrog map is volume-preserving and reversible for any
//! force that depends on position alone. A point at which the program is undefined,
//! choices appear or vanish, or the density is 0 has infinite energy.

mod adapt;
mod ascent;
mod curvature;
pub(super) mod hmc;
mod kernel;
mod laplace;
pub(super) mod mala;
mod memory;
mod metric;
pub(super) mod modes;
pub(super) mod nuts;
mod point;
mod summed;
mod system;

pub(crate) use ascent::approach;
pub use hmc::Hmc;
pub use kernel::Hamiltonian;
pub use nuts::Nuts;
