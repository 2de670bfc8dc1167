//! Thin contours from a gradient: non-maximum suppression along the gradient's direction,
//! sub-pixel positions, and hysteresis (Canny 1986, "A computational approach to edge
//! detection", PAMI 8, 679-698).

use crate::vision::detect::gradient::Gradient;

/// A maximum of the gradient along its direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePoint {
    /// Its pixel (row * width + column).
    pub pixel: usize,
    /// Column, pixels (pixel centres at +0.5).
    pub x: f32,
    /// Row, pixels (pixel centres at +0.5).
    pub y: f32,
    /// Unit vector across the contour.
    pub normal: [f32; 2],
    /// Gradient magnitude of the pixel.
    pub magnitude: f32,
}

/// Returns the bilinear interpolation at a position relative to the first pixel's centre,
/// clamped to the picture.
fn bilinear(width: usize, height: usize, data: &[f32], x: f32, y: f32) -> f32 {
    let (x, y) = (x.clamp(0.0, (width - 1) as f32), y.clamp(0.0, (height - 1) as f32));
    let (i, j) = (x as usize, y as usize);
    let (i1, j1) = ((i + 1).min(width - 1), (j + 1).min(height - 1));
    let (fx, fy) = (x - i as f32, y - j as f32);
    let top = data[j * width + i] * (1.0 - fx) + data[j * width + i1] * fx;
    let bottom = data[j1 * width + i] * (1.0 - fx) + data[j1 * width + i1] * fx;
    top * (1.0 - fy) + bottom * fy
}

/// Returns the offset of a ridge of `data` from the centre of a pixel along a unit
/// normal, pixels, within 0.7: the peak of the quadratic through the pixel with the first
/// and second central differences there (Steger 1998, "An unbiased detector of
/// curvilinear structures", PAMI 20, 113-125). Values at the border are repeated beyond
/// it. Returns 0 if the quadratic has no peak.
pub fn ridge_offset(width: u32, height: u32, data: &[f32], pixel: usize, normal: [f32; 2]) -> f32 {
    let (w, h) = (width as usize, height as usize);
    let (x, y) = (pixel % w, pixel / w);
    let (left, right) = (x.saturating_sub(1), (x + 1).min(w - 1));
    let (up, down) = (y.saturating_sub(1), (y + 1).min(h - 1));
    let at = |i: usize, j: usize| data[j * w + i];
    let gx = 0.5 * (at(right, y) - at(left, y));
    let gy = 0.5 * (at(x, down) - at(x, up));
    let xx = at(right, y) - 2.0 * at(x, y) + at(left, y);
    let yy = at(x, down) - 2.0 * at(x, y) + at(x, up);
    let xy = 0.25 * (at(right, down) - at(left, down) - at(right, up) + at(left, up));
    let slope = normal[0] * gx + normal[1] * gy;
    let bend =
        normal[0] * normal[0] * xx + 2.0 * normal[0] * normal[1] * xy + normal[1] * normal[1] * yy;
    if bend < 0.0 { (-slope / bend).clamp(-0.7, 0.7) } else { 0.0 }
}

/// Returns the direction of strongest change of a structure tensor, up to sign, accurate
/// to a millionth and without trigonometry.
fn approximate_principal([a, b, c]: [f32; 3]) -> [f32; 2] {
    let (half, b) = (0.5 * (f64::from(a) - f64::from(c)), f64::from(b));
    let root = (half * half + b * b).sqrt();
    let (x, y) = if half >= 0.0 { (root + half, b) } else { (b, root - half) };
    let length = (x * x + y * y).sqrt();
    [(x / length) as f32, (y / length) as f32]
}

/// Returns all maxima with a magnitude above `floor`, in raster order.
pub fn suppress(gradient: &Gradient, floor: f32) -> Vec<EdgePoint> {
    let (w, h) = (gradient.width as usize, gradient.height as usize);
    let strength = &gradient.magnitude;
    // A pixel that is below a neighbour in the approximate direction, by more than errors
    // of the direction and of positions can explain, is not a maximum. This spares most
    // pixels the exact angle.
    let most = strength.iter().copied().fold(0.0, f32::max);
    let slack = most * (1e-5 + 5e-7 * w.max(h) as f32);
    let mut out = Vec::new();
    for (pixel, (&m, &tensor)) in strength.iter().zip(&gradient.tensor).enumerate().take(w * h) {
        if m.is_nan() || m <= floor {
            continue;
        }
        let (x, y) = ((pixel % w) as f32, (pixel / w) as f32);
        let at = |t: f32, n: [f32; 2]| bilinear(w, h, strength, x + t * n[0], y + t * n[1]);
        let rough = approximate_principal(tensor);
        if at(-1.0, rough) > m + slack || at(1.0, rough) > m + slack {
            continue;
        }
        let normal = gradient.normal(pixel);
        // One of the comparisons allows equality, so that a maximum between two pixels is
        // found once.
        if m > at(-1.0, normal) && m >= at(1.0, normal) {
            let t = ridge_offset(gradient.width, gradient.height, strength, pixel, normal);
            let (px, py) = (x + 0.5 + t * normal[0], y + 0.5 + t * normal[1]);
            let (px, py) = (px.clamp(0.0, w as f32), py.clamp(0.0, h as f32));
            out.push(EdgePoint { pixel, x: px, y: py, normal, magnitude: m });
        }
    }
    out
}

/// Returns the points of at least `low` that are 8-connected to one of at least `high`,
/// in the given order.
pub fn hysteresis(
    width: u32,
    height: u32,
    points: &[EdgePoint],
    low: f32,
    high: f32,
) -> Vec<EdgePoint> {
    let (w, h) = (width as usize, height as usize);
    let mut kept = vec![0u8; w * h];
    for p in points.iter().filter(|p| p.magnitude >= low) {
        kept[p.pixel] = 1;
    }
    let mut todo: Vec<usize> =
        points.iter().filter(|p| p.magnitude >= high.max(low)).map(|p| p.pixel).collect();
    todo.iter().for_each(|&k| kept[k] = 2);
    while let Some(k) = todo.pop() {
        let (x, y) = (k % w, k / w);
        for j in y.saturating_sub(1)..(y + 2).min(h) {
            for i in x.saturating_sub(1)..(x + 2).min(w) {
                if kept[j * w + i] == 1 {
                    kept[j * w + i] = 2;
                    todo.push(j * w + i);
                }
            }
        }
    }
    points.iter().filter(|p| kept[p.pixel] == 2).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::detect::gradient::colour_gradient;

    /// A picture that is bright beyond the line `x cos a + y sin a = d`, with pixel
    /// coverage computed from 16 x 16 samples.
    fn half_plane(n: usize, angle: f32, d: f32) -> Vec<[f32; 1]> {
        let (c, s) = (libm::cosf(angle), libm::sinf(angle));
        (0..n * n)
            .map(|k| {
                let inside = (0..256).filter(|q| {
                    let x = (k % n) as f32 + ((q % 16) as f32 + 0.5) / 16.0;
                    let y = (k / n) as f32 + ((q / 16) as f32 + 0.5) / 16.0;
                    x * c + y * s > d
                });
                [inside.count() as f32 / 2.56]
            })
            .collect()
    }

    #[test]
    fn straight_edges_are_found_where_they_are() {
        for (angle, d) in
            [(0.0f32, 20.0), (0.0, 20.3), (0.4, 26.7), (0.785, 30.1), (1.2, 25.5), (1.57, 19.8)]
        {
            let g = colour_gradient(40, 40, &half_plane(40, angle, d), 1.0);
            let points = suppress(&g, 5.0);
            let (c, s) = (libm::cosf(angle), libm::sinf(angle));
            let inner: Vec<_> = points
                .iter()
                .filter(|p| (5.0..35.0).contains(&p.x) && (5.0..35.0).contains(&p.y))
                .collect();
            assert!(inner.len() >= 25, "{angle}: {}", inner.len());
            for p in inner {
                assert!((p.x * c + p.y * s - d).abs() < 0.12, "{angle} {d}: {p:?}");
                assert!((p.normal[0] * c + p.normal[1] * s).abs() > 0.995);
            }
        }
    }

    #[test]
    fn no_maximum_is_passed_over() {
        // Noise, plateaus and exact ties.
        for (seed, step) in [(1u32, 1.0f32), (2, 16.0), (3, 100.0)] {
            let mut s = seed;
            let mut next = || {
                s = s.wrapping_mul(1664525).wrapping_add(1013904223);
                ((s >> 8) as f32 / 65536.0 / step).floor() * step
            };
            let picture: Vec<[f32; 2]> = (0..60 * 40).map(|_| [next(), next()]).collect();
            let g = colour_gradient(60, 40, &picture, 0.8);
            let plain = |k: &usize| {
                let (x, y, n, m) =
                    ((k % 60) as f32, (k / 60) as f32, g.normal(*k), g.magnitude[*k]);
                let at = |t: f32| bilinear(60, 40, &g.magnitude, x + t * n[0], y + t * n[1]);
                m > 0.0 && m > at(-1.0) && m >= at(1.0)
            };
            let expected: Vec<usize> = (0..60 * 40).filter(plain).collect();
            let found: Vec<usize> = suppress(&g, 0.0).iter().map(|p| p.pixel).collect();
            assert!(found.len() > 100);
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn hysteresis_follows_weak_points_from_strong_ones() {
        let point =
            |pixel, magnitude| EdgePoint { pixel, x: 0.0, y: 0.0, normal: [1.0, 0.0], magnitude };
        // A row of ten: strong, weak, weak, missing, weak, too weak, strong.
        let row = [
            point(0, 9.0),
            point(1, 3.0),
            point(2, 3.0),
            point(4, 3.0),
            point(5, 1.0),
            point(6, 9.0),
        ];
        let kept: Vec<usize> = hysteresis(10, 1, &row, 2.0, 8.0).iter().map(|p| p.pixel).collect();
        assert_eq!(kept, [0, 1, 2, 6]);
    }

    #[test]
    fn peaks_of_quadratics_are_exact() {
        // -(0.6 x + 0.8 y - 0.3)^2 around the middle of 3 x 3.
        let data: Vec<f32> = (0..9)
            .map(|k| {
                let d = 0.6 * ((k % 3) as f32 - 1.0) + 0.8 * ((k / 3) as f32 - 1.0) - 0.3;
                -d * d
            })
            .collect();
        assert!((ridge_offset(3, 3, &data, 4, [0.6, 0.8]) - 0.3).abs() < 1e-6);
        assert!((ridge_offset(3, 3, &data, 4, [-0.6, -0.8]) + 0.3).abs() < 1e-6);
        assert_eq!(ridge_offset(3, 3, &[1.0; 9], 4, [1.0, 0.0]), 0.0);
        assert_eq!(ridge_offset(1, 1, &[1.0], 0, [1.0, 0.0]), 0.0);
    }
}
