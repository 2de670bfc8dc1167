//! The range of unconstrained coordinates.

/// Coordinates are clamped to this magnitude: e^-700 is near the smallest normal double.
pub(super) const FAR: f64 = 700.0;

/// Clamps a coordinate to magnitude [`FAR`]; 0 for NaN.
#[inline]
pub(super) fn near(y: f64) -> f64 {
    if y.is_nan() { 0.0 } else { y.clamp(-FAR, FAR) }
}
