//! A point of a trajectory.

/// A position with its log density and force, and the momentum at it.
#[derive(Clone, Debug, Default)]
pub(super) struct Point {
    pub y: Vec<f64>,
    pub gradient: Vec<f64>,
    /// The gradient in the space of the metric, in which momenta are standard normal.
    pub force: Vec<f64>,
    /// The momentum there, which is also the velocity.
    pub momentum: Vec<f64>,
    /// The log density in the unconstrained space, relative to that of the trace's state.
    pub log_density: f64,
}

impl Point {
    /// The kinetic energy.
    pub fn kinetic(&self) -> f64 {
        0.5 * self.momentum.iter().map(|p| p * p).sum::<f64>()
    }
}
