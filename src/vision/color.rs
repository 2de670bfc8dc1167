//! Colours: sRGB bytes, linear light, and CIE L*a*b* (D65). Not colour management: profiles in files are ignored and every
//! picture is taken to be sRGB (IEC 61966-2-1).

use std::sync::OnceLock;

/// Linear light in 0..=1 of an sRGB value in 0..=1.
pub fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// sRGB value in 0..=1 of linear light in 0..=1.
pub fn linear_to_srgb(v: f64) -> f64 {
    if v <= 0.0031308 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 }
}

/// Linear light of every sRGB byte.
pub fn linear_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| std::array::from_fn(|i| srgb_to_linear(i as f64 / 255.0) as f32))
}

/// sRGB byte of linear light; values outside 0..=1 are clamped.
pub fn linear_to_byte(v: f32) -> u8 {
    (linear_to_srgb(f64::from(v).clamp(0.0, 1.0)) * 255.0 + 0.5) as u8
}

/// CIE L*a*b* (L* in 0..=100) of linear sRGB light, relative to the D65 white of sRGB.
pub fn linear_to_lab(rgb: [f32; 3]) -> [f32; 3] {
    let [r, g, b] = rgb.map(f64::from);
    // IEC 61966-2-1 matrix, rows divided by the white point (its row sums), so greys have a* = b* = 0 exactly.
    let row = |m: [f64; 3]| (m[0] * r + m[1] * g + m[2] * b) / (m[0] + m[1] + m[2]);
    let x = row([0.4124, 0.3576, 0.1805]);
    let y = row([0.2126, 0.7152, 0.0722]);
    let z = row([0.0193, 0.1192, 0.9505]);
    // CIE 15:2004, 8.2.1.
    let f = |t: f64| if t > 216.0 / 24389.0 { libm::cbrt(t) } else { t * (841.0 / 108.0) + 4.0 / 29.0 };
    let (fx, fy, fz) = (f(x), f(y), f(z));
    [(116.0 * fy - 16.0) as f32, (500.0 * (fx - fy)) as f32, (200.0 * (fy - fz)) as f32]
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
        // Values of the sRGB primaries from the CIE formulas (D65): red (53.24, 80.09, 67.20), blue (32.30, 79.19, -107.86).
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(p, q)| (p - q).abs() < 0.05);
        assert!(near(linear_to_lab([1.0, 1.0, 1.0]), [100.0, 0.0, 0.0]));
        assert!(near(linear_to_lab([0.0, 0.0, 0.0]), [0.0, 0.0, 0.0]));
        assert!(near(linear_to_lab([1.0, 0.0, 0.0]), [53.24, 80.09, 67.20]), "{:?}", linear_to_lab([1.0, 0.0, 0.0]));
        assert!(near(linear_to_lab([0.0, 0.0, 1.0]), [32.30, 79.19, -107.86]), "{:?}", linear_to_lab([0.0, 0.0, 1.0]));
    }
}
