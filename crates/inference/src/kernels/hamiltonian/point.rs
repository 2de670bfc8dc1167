//! A point of a trajectory.

/// A position with its log density and force, and the momentum at it.
#[derive(Clone, Debug, Default)]
pub(super) struct Point {
    pub y: Vec<f64>,
    pub gradient: Vec<f64>,
    pub momentum: Vec<f64>,
    /// The momentum times the inverse mass.
    pub velocity: Vec<f64>,
    /// The log density in the unconstrained space, relative to that of the trace's state.
    pub log_density: f64,
}

impl Point {
    /// The kinetic energy.
    pub fn kinetic(&self, inverse_mass: &[f64]) -> f64 {
        0.5 * self.momentum.iter().zip(inverse_mass).map(|(p, m)| p * p * m).sum::<f64>()
    }
}
