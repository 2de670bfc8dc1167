//! A GPU that draws the contours of many scenes at once ([`Gpu::contours`]), and their scores against one picture ([`Gpu::log_likelihoods`]).
//!
//! It is never needed: [`Cores`] draws the same on the CPU, more exactly. Arithmetic is in
//! single precision, so results differ by rounding: pieces by at most 0.02 pixels, and
//! pieces whose depth test is decided at its margin may be visible in one and hidden in
//! the other, at most 0.5 % of the length (`tests/equal.rs`). The same scenes on the same
//! device give the same bits, alone or among others. Surfaces of revolution are drawn as
//! their mesh of [`SIDES`] sides, so their contours differ from the closed form of the CPU
//! by up to the mesh's error, 0.05 % of their radius.
//!
//! What it does not draw is drawn by the CPU within the same call: scenes that the near
//! plane cuts or that reach more than 16384 pixels beyond the picture, pictures of more
//! than 65,536 pixels, and scenes of more than 4096 pieces or tested pixels.
#![warn(missing_docs)]
#![forbid(unsafe_code)]

mod batch;
mod buffers;
mod device;
mod drawing;
mod layout;
mod renderer;
mod scenes;
mod topologies;
mod vertices;

pub use device::NoDevice;
pub use layout::SIDES;
pub use renderer::Gpu;
pub use scenes::{ContourBatch, Cores, Scene};
