//! Colours: sRGB bytes, linear light, and CIE L*a*b* (D65). There is no colour
//! management: profiles in files are ignored and every picture is assumed to be sRGB (IEC
//! 61966-2-1).

use pcadlang_numerics::num::simd::vectorised;
use std::sync::OnceLock;

/// Converts an sRGB value in 0..=1 to linear light in 0..=1.
pub fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// Converts linear light in 0..=1 to an sRGB value in 0..=1.
pub fn linear_to_srgb(v: f64) -> f64 {
    if v <= 0.0031308 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 }
}

/// Returns the linear light of every sRGB byte.
pub fn linear_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| srgb_to_linear(i as f64 / 255.0) as f32))
}

/// Converts linear light to an sRGB byte; values outside 0..=1 are clamped.
pub fn linear_to_byte(v: f32) -> u8 {
    (linear_to_srgb(f64::from(v).clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// Returns X, Y and Z of linear sRGB light relative to the D65 white of sRGB: the IEC
/// 61966-2-1 matrix with its rows divided by the white point (their sums), so that greys
/// have exactly a* = b* = 0.
#[inline(always)]
fn linear_to_xyz(rgb: [f32; 3]) -> [f64; 3] {
    let [r, g, b] = [f64::from(rgb[0]), f64::from(rgb[1]), f64::from(rgb[2])];
    let row = |m: [f64; 3]| (m[0] * r + m[1] * g + m[2] * b) / (m[0] + m[1] + m[2]);
    [row([0.4124, 0.3576, 0.1805]), row([0.2126, 0.7152, 0.0722]), row([0.0193, 0.1192, 0.9505])]
}

/// Returns L*, a* and b* from the cube roots of X, Y and Z (CIE 15:2004, 8.2.1), in
/// double precision.
#[inline(always)]
fn lab([fx, fy, fz]: [f64; 3]) -> [f64; 3] {
    [116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)]
}

/// Below this a straight line replaces the cube root.
const STRAIGHT: f64 = 216.0 / 24389.0;

/// The straight line below `STRAIGHT`.
#[inline(always)]
fn straight(t: f64) -> f64 {
    t * (841.0 / 108.0) + 4.0 / 29.0
}

/// Converts linear sRGB light to CIE L*a*b* (L* in 0..=100), relative to the D65 white of
/// sRGB.
pub fn linear_to_lab(rgb: [f32; 3]) -> [f32; 3] {
    let f = |t: f64| if t > STRAIGHT { libm::cbrt(t) } else { straight(t) };
    lab(linear_to_xyz(rgb).map(f)).map(|v| v as f32)
}

/// Error bound of the fast L*, a* or b*; many times the actual error.
const DOUBT: f64 = 1e-10;

/// Applies [`linear_to_lab`] to many colours, several at a time, with the same result to
/// the last bit. Roots are computed to 14 digits; where that does not determine the
/// nearest single precision number (once in many thousand colours, and for exact greys),
/// the slow path decides.
pub fn linear_to_labs(rgb: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut out = vec![[f32::NAN; 3]; rgb.len()];
    vectorised(
        #[inline(always)]
        || {
            for (out, rgb) in out.iter_mut().zip(rgb) {
                let f = |t: f64| {
                    let (root, line) = (quick_cbrt(t), straight(t));
                    if t > STRAIGHT { root } else { line }
                };
                let near = |v: f64| {
                    let (low, high) = ((v - DOUBT) as f32, (v + DOUBT) as f32);
                    if low == high { low } else { f32::NAN }
                };
                // Not a `map` over an array, which is not always inlined.
                let [x, y, z] = linear_to_xyz(*rgb);
                let [l, a, b] = lab([f(x), f(y), f(z)]);
                *out = [near(l), near(a), near(b)];
            }
        },
    );
    for (out, rgb) in out.iter_mut().zip(rgb).filter(|(o, _)| o.iter().any(|v| v.is_nan())) {
        *out = linear_to_lab(*rgb);
    }
    out
}

/// Returns the cube root of a number between 1e-3 and 1e3 with a relative error of 1e-14.
/// The first guess is a third of the logarithm, taken from the bits of the floating point
/// number; each of Halley's steps triples the number of correct digits.
#[inline(always)]
fn quick_cbrt(t: f64) -> f64 {
    let third = (t as f32).to_bits() as i32 as f32 * (1.0 / 3.0) + 709_958_130.0;
    let mut root = f64::from(f32::from_bits(third as i32 as u32));
    for _ in 0..3 {
        let cube = root * root * root;
        root *= (cube + 2.0 * t) / (2.0 * cube + t);
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_survives_linear_light() {
        for i in 0..=255u8 {
            assert_eq!(linear_to_byte(linear_table()[i as usize]), i);
        }
        assert_eq!(linear_to_byte(-1.0), 0);
        assert_eq!(linear_to_byte(7.0), 255);
        assert_eq!(linear_to_byte(f32::NAN), 0);
    }

    #[test]
    fn lab_of_known_colours() {
        // Values of the sRGB primaries from the CIE formulas (D65): red (53.24, 80.09,
        // 67.20), blue (32.30, 79.19, -107.86).
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(p, q)| (p - q).abs() < 0.05);
        assert!(near(linear_to_lab([1.0, 1.0, 1.0]), [100.0, 0.0, 0.0]));
        assert!(near(linear_to_lab([0.0, 0.0, 0.0]), [0.0, 0.0, 0.0]));
        assert!(
            near(linear_to_lab([1.0, 0.0, 0.0]), [53.24, 80.09, 67.20]),
            "{:?}",
            linear_to_lab([1.0, 0.0, 0.0])
        );
        assert!(
            near(linear_to_lab([0.0, 0.0, 1.0]), [32.30, 79.19, -107.86]),
            "{:?}",
            linear_to_lab([0.0, 0.0, 1.0])
        );
    }

    #[test]
    fn many_colours_are_as_one_by_one() {
        let value = |i: u32| {
            linear_table()[(i % 256) as usize] * if i.is_multiple_of(7) { 0.37 } else { 1.0 }
        };
        let mut colours: Vec<[f32; 3]> =
            (0..60_000u32).map(|i| [value(i), value(i / 3), value(i * 31 / 5)]).collect();
        colours.extend((0..256).map(|i| [value(i); 3]));
        colours.extend([
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [4.0, 9.0, 1e3],
            [f32::NAN, 0.5, 0.5],
            [-1.0, 0.2, f32::INFINITY],
        ]);
        for (lab, rgb) in linear_to_labs(&colours).iter().zip(&colours) {
            let expected = linear_to_lab(*rgb);
            assert!(
                lab.iter()
                    .zip(expected)
                    .all(|(a, b)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()))
            );
        }
        for i in 0..100_000 {
            let t = libm::exp(f64::from(i - 50_000) * 1.3e-4);
            assert!((quick_cbrt(t) / libm::cbrt(t) - 1.0).abs() < 1e-14, "{t}");
        }
    }
}
