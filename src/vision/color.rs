//! Colour: sRGB to linear light, and CIE L*a*b* (D65), where distances are nearly as large as they look.

/// Linear light of an 8-bit sRGB value (IEC 61966-2-1).
pub(super) fn linear(v: u8) -> f32 {
    let x = f32::from(v) / 255.0;
    if x <= 0.040_45 { x / 12.92 } else { libm::powf((x + 0.055) / 1.055, 2.4) }
}

/// L*a*b* of linear light.
pub(super) fn lab([r, g, b]: [f32; 3]) -> [f32; 3] {
    let f = |t: f32| if t > 0.008_856_452 { libm::cbrtf(t) } else { 7.787_037 * t + 4.0 / 29.0 };
    let x = f((0.412_390_8 * r + 0.357_584_3 * g + 0.180_480_8 * b) / 0.950_489);
    let y = f(0.212_639 * r + 0.715_168_7 * g + 0.072_192_3 * b);
    let z = f((0.019_330_8 * r + 0.119_194_8 * g + 0.950_532_2 * b) / 1.088_84);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_colours() {
        let close = |rgb: [u8; 3], expected: [f32; 3]| {
            let got = lab(rgb.map(linear));
            assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.02), "{rgb:?}: {got:?}");
        };
        close([255, 255, 255], [100.0, 0.0, 0.0]);
        close([255, 0, 0], [53.24, 80.09, 67.20]);
        close([0, 0, 255], [32.30, 79.19, -107.86]);
        close([0, 0, 0], [0.0, 0.0, 0.0]);
    }
}
