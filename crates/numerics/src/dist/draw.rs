//! Draws and formulas that several families share. All use `libm`, so results are the
//! same on every platform.

use crate::rng::Stream;

/// Clamps a draw to the positive, finite, normal doubles.
#[inline]
pub(super) fn representable(x: f64) -> f64 {
    x.clamp(f64::MIN_POSITIVE, f64::MAX)
}

/// Draws the logarithm of a gamma number with rate 1 (Marsaglia & Tsang 2000): for small
/// shapes the number itself would underflow.
pub(super) fn ln_gamma_draw(shape: f64, rng: &mut Stream) -> f64 {
    if shape < 1.0 {
        let above = libm::log(gamma_draw(shape + 1.0, rng));
        return above + libm::log(rng.open_uniform()) / shape;
    }
    libm::log(gamma_draw(shape, rng))
}

/// Draws a gamma number with rate 1, for shape >= 1.
pub(super) fn gamma_draw(shape: f64, rng: &mut Stream) -> f64 {
    let d = shape - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let x = rng.standard_normal();
        let root = 1.0 + c * x;
        if root <= 0.0 {
            continue;
        }
        let v = root * root * root;
        let log_u = libm::log(rng.open_uniform());
        if log_u < 0.5 * x * x + d * (1.0 - v + libm::log(v)) {
            return d * v;
        }
    }
}

/// Returns (x - location) / scale, also where the difference would overflow.
#[inline]
pub(super) fn standard(x: f64, location: f64, scale: f64) -> f64 {
    let d = x - location;
    if d.is_finite() { d / scale } else { x / scale - location / scale }
}

/// Returns x ln y, which is 0 if x = 0, for any y.
#[inline]
pub(super) fn x_log_y(x: f64, y: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x * libm::log(y) }
}

/// Returns x ln(1 + y), which is 0 if x = 0, for any y.
#[inline]
pub(super) fn x_log1p_y(x: f64, y: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x * libm::log1p(y) }
}

/// Returns ln(1 + z^2) for z = (x - location) / scale, also where z or its square would
/// overflow.
#[inline]
pub(super) fn log1p_square(x: f64, location: f64, scale: f64) -> f64 {
    let z = standard(x, location, scale);
    if z.abs() < 1e150 { libm::log1p(z * z) } else { far_square(x, location, scale) }
}

/// Returns the same for a z so large that it equals ln(z^2).
#[cold]
pub(super) fn far_square(x: f64, location: f64, scale: f64) -> f64 {
    // Halves, so that the difference does not overflow.
    2.0 * (libm::log((0.5 * x - 0.5 * location).abs()) - libm::log(scale) + core::f64::consts::LN_2)
}
