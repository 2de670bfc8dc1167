//! The gradient of a colour picture: smoothing and differentiation by Gaussians, and the
//! structure tensor over the channels (Di Zenzo 1986, "A note on the gradient of a
//! multi-image", CVGIP 33, 116-125), with the picture mirrored at its borders. Thin contours
//! from it: non-maximum suppression along the gradient's direction, sub-pixel positions, and
//! hysteresis (Canny 1986, "A computational approach to edge detection", PAMI 8, 679-698).

use pcadlang_numerics::num::simd::vectorised;

/// Gradient magnitude and direction of every pixel, in row-major order.
#[derive(Clone, Debug)]
pub struct Gradient {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Square root of the tensor's larger eigenvalue: change per pixel, at least 0.
    pub magnitude: Vec<f32>,
    /// The structure tensor, `[xx, xy, yy]`: products of changes per pixel, summed over
    /// the channels.
    pub tensor: Vec<[f32; 3]>,
}

impl Gradient {
    /// Returns the direction of strongest change as a unit vector of arbitrary sign. It
    /// is computed on demand, because few pixels need it. Outside the picture it points
    /// to the right.
    pub fn normal(&self, pixel: usize) -> [f32; 2] {
        self.tensor.get(pixel).map_or([1.0, 0.0], |&[a, b, c]| principal(a, b, c).1)
    }
}

/// Returns samples of a Gaussian at `-r..=r` with sum 1, and of its derivative, scaled to
/// be exact on linear ramps; `r` is three standard deviations. The standard deviation is
/// clamped to 0.1..=100 pixels.
fn kernels(sigma: f32) -> (Vec<f64>, Vec<f64>) {
    let s = if sigma.is_nan() { 0.1 } else { f64::from(sigma).clamp(0.1, 100.0) };
    let r = (3.0 * s).ceil() as i32;
    let g: Vec<f64> = (-r..=r).map(|i| libm::exp(-0.5 * f64::from(i * i) / (s * s))).collect();
    let sum: f64 = g.iter().sum();
    let smooth: Vec<f64> = g.iter().map(|v| v / sum).collect();
    let slope: Vec<f64> = smooth.iter().zip(-r..=r).map(|(v, i)| v * f64::from(i)).collect();
    let ramp: f64 = slope.iter().zip(-r..=r).map(|(v, i)| v * f64::from(i)).sum();
    (smooth, slope.iter().map(|v| v / ramp).collect())
}

/// Returns position `i` of a line of `n`, mirrored at its ends (the end pixels count
/// twice).
pub fn mirrored(i: i64, n: i64) -> usize {
    let m = i.rem_euclid(2 * n);
    (if m < n { m } else { 2 * n - 1 - m }) as usize
}

/// Number of values that a filter processes at a time.
const LANES: usize = 16;

/// Sums `line[i + k] * kernel[k]` over k into `out[i]`, in the order of k and in double
/// precision. `line` is padded for the kernel and for whole lanes beyond `out`.
#[inline(always)]
fn convolve(line: &[f64], kernel: &[f64], out: &mut [f32]) {
    for (n, out) in out.chunks_mut(LANES).enumerate() {
        let mut sums = [0.0f64; LANES];
        for (window, c) in line[n * LANES..].windows(LANES).zip(kernel) {
            sums.iter_mut().zip(window).for_each(|(s, v)| *s += c * v);
        }
        out.iter_mut().zip(sums).for_each(|(o, s)| *o = s as f32);
    }
}

/// Filters the rows by a kernel of odd length.
fn along_rows(width: usize, data: &[f32], kernel: &[f64]) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let source: Vec<usize> =
        (0..width + 2 * reach).map(|i| mirrored(i as i64 - reach as i64, width as i64)).collect();
    let mut line = vec![0.0f64; source.len() + LANES];
    let mut out = vec![0.0f32; data.len()];
    vectorised(
        #[inline(always)]
        || {
            for (row, out) in data.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
                line[reach..reach + width]
                    .iter_mut()
                    .zip(row)
                    .for_each(|(l, v)| *l = f64::from(*v));
                for i in (0..reach).chain(reach + width..source.len()) {
                    line[i] = f64::from(row[source[i]]);
                }
                convolve(&line, kernel, out);
            }
        },
    );
    out
}

/// Filters the columns by a kernel of odd length.
fn along_columns(width: usize, data: &[f32], kernel: &[f64]) -> Vec<f32> {
    let (height, reach) = (data.len() / width, (kernel.len() / 2) as i64);
    let mut out = vec![0.0f32; data.len()];
    let mut sums = vec![0.0f64; width];
    vectorised(
        #[inline(always)]
        || {
            for (j, out) in out.chunks_exact_mut(width).enumerate() {
                sums.fill(0.0);
                for (c, k) in kernel.iter().zip(-reach..) {
                    let row = mirrored(j as i64 + k, height as i64) * width;
                    let row = &data[row..row + width];
                    sums.iter_mut().zip(row).for_each(|(s, v)| *s += c * f64::from(*v));
                }
                out.iter_mut().zip(&sums).for_each(|(o, s)| *o = *s as f32);
            }
        },
    );
    out
}

/// The pixels of a channel; empty for a picture without pixels.
fn pixels(width: u32, height: u32, data: &[f32]) -> &[f32] {
    &data[..width as usize * height as usize]
}

/// Smooths a channel (at least `width * height` values) by a Gaussian of `sigma` pixels.
pub fn smoothed(width: u32, height: u32, data: &[f32], sigma: f32) -> Vec<f32> {
    let (smooth, _) = kernels(sigma);
    let w = (width as usize).max(1);
    along_columns(w, &along_rows(w, pixels(width, height, data), &smooth), &smooth)
}

/// Returns the derivatives along x and y of a channel smoothed by a Gaussian of `sigma`
/// pixels.
pub fn derivatives(width: u32, height: u32, data: &[f32], sigma: f32) -> (Vec<f32>, Vec<f32>) {
    let (smooth, slope) = kernels(sigma);
    let (w, data) = ((width as usize).max(1), pixels(width, height, data));
    let filter = |x: &[f64], y: &[f64]| along_columns(w, &along_rows(w, data, x), y);
    (filter(&slope, &smooth), filter(&smooth, &slope))
}

/// Returns the larger eigenvalue of the symmetric matrix `[[a, b], [b, c]]` and its unit
/// eigenvector.
pub fn principal(a: f32, b: f32, c: f32) -> (f32, [f32; 2]) {
    let angle = 0.5 * libm::atan2(2.0 * f64::from(b), f64::from(a) - f64::from(c));
    (most(a, b, c), [libm::cos(angle) as f32, libm::sin(angle) as f32])
}

/// The larger eigenvalue.
fn most(a: f32, b: f32, c: f32) -> f32 {
    let (a, b, c) = (f64::from(a), f64::from(b), f64::from(c));
    (0.5 * (a + c + libm::hypot(a - c, 2.0 * b))) as f32
}

/// Returns the gradient of a picture of several channels, smoothed by a Gaussian of
/// `sigma` pixels.
pub fn colour_gradient<const N: usize>(
    width: u32,
    height: u32,
    pixels: &[[f32; N]],
    sigma: f32,
) -> Gradient {
    let mut tensor = vec![[0.0f32; 3]; pixels.len()];
    for c in 0..N {
        let channel: Vec<f32> = pixels.iter().map(|p| p[c]).collect();
        let (gx, gy) = derivatives(width, height, &channel, sigma);
        for (t, (&x, &y)) in tensor.iter_mut().zip(gx.iter().zip(&gy)) {
            *t = [t[0] + x * x, t[1] + x * y, t[2] + y * y];
        }
    }
    let magnitude = tensor.iter().map(|&[a, b, c]| most(a, b, c).max(0.0).sqrt()).collect();
    Gradient { width, height, magnitude, tensor }
}

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

    #[test]
    fn ramps_have_their_slope_inside() {
        let (w, h) = (24u32, 20u32);
        let data: Vec<[f32; 2]> = (0..w * h)
            .map(|i| {
                let (x, y) = ((i % w) as f32, (i / w) as f32);
                [3.0 * x + 4.0 * y, 1.0]
            })
            .collect();
        let g = colour_gradient(w, h, &data, 1.2);
        for j in 5..15 {
            for i in 5..19 {
                let k = j * w as usize + i;
                assert!((g.magnitude[k] - 5.0).abs() < 1e-4);
                let dot = g.normal(k)[0] * 0.6 + g.normal(k)[1] * 0.8;
                assert!((dot.abs() - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn filters_are_sums_in_the_order_of_the_kernel() {
        let (smooth, slope) = kernels(1.3);
        let sum = |kernel: &[f64], at: &dyn Fn(i64) -> f32| {
            let reach = (kernel.len() / 2) as i64;
            kernel.iter().zip(-reach..).fold(0.0, |s, (c, k)| s + c * f64::from(at(k))) as f32
        };
        for (w, h) in [(1usize, 1usize), (3, 2), (16, 7), (37, 23)] {
            let data: Vec<f32> =
                (0..w * h).map(|i| ((i * 7919) % 613) as f32 / 7.0 - 40.0).collect();
            let (rows, columns) = (along_rows(w, &data, &slope), along_columns(w, &data, &smooth));
            for i in 0..w * h {
                let (x, y) = ((i % w) as i64, (i / w) as i64);
                let row = sum(&slope, &|k| data[y as usize * w + mirrored(x + k, w as i64)]);
                let column = sum(&smooth, &|k| data[mirrored(y + k, h as i64) * w + x as usize]);
                assert_eq!((rows[i], columns[i]), (row, column), "{w} x {h}");
            }
        }
    }

    #[test]
    fn opposite_channels_do_not_cancel() {
        // A step of equal luminance: the mean of the channels is constant.
        let data: Vec<[f32; 2]> =
            (0..400).map(|i| if i % 20 < 10 { [0.0, 8.0] } else { [8.0, 0.0] }).collect();
        let g = colour_gradient(20, 20, &data, 1.0);
        let one: Vec<[f32; 1]> = data.iter().map(|p| [p[0]]).collect();
        let single = colour_gradient(20, 20, &one, 1.0);
        let k = 10 * 20 + 10;
        assert!(
            (g.magnitude[k] - 2f32.sqrt() * single.magnitude[k]).abs() < 1e-4
                && g.magnitude[k] > 3.0
        );
    }

    #[test]
    fn flat_pictures_have_none_and_tiny_ones_work() {
        for (w, h) in [(1, 1), (1, 30), (30, 1), (2, 3)] {
            let g = colour_gradient(w, h, &vec![[7.0f32; 3]; (w * h) as usize], 2.0);
            assert!(g.magnitude.iter().all(|m| *m < 1e-4), "{w} x {h}");
        }
        for sigma in [f32::NAN, f32::INFINITY, -1.0] {
            assert!(smoothed(3, 2, &[1.0; 6], sigma).iter().all(|v| (v - 1.0).abs() < 1e-5));
        }
        assert!(smoothed(0, 0, &[], 1.0).is_empty());
        assert_eq!([-1, -2, 0, 2, 3, 5, 6].map(|i| mirrored(i, 3)), [0, 1, 0, 2, 2, 0, 0]);
    }

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
