//! The gradient of a colour picture: smoothing and differentiation by Gaussians, and the structure tensor over the channels
//! (Di Zenzo 1986, "A note on the gradient of a multi-image", CVGIP 33, 116-125). Beyond the border the picture is mirrored.

/// Gradient magnitude and direction of every pixel, row by row.
#[derive(Clone, Debug)]
pub struct Gradient {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Root of the tensor's larger eigenvalue: change per pixel, at least 0.
    pub magnitude: Vec<f32>,
    /// The direction of most change as a unit vector (its sign means nothing).
    pub normal: Vec<[f32; 2]>,
}

/// Samples of a Gaussian at `-r..=r`, sum 1, and of its derivative, exact on straight ramps; `r` is three standard deviations.
/// Deviations outside 0.1..=100 pixels are taken to be its ends.
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

/// The place `i` of a line of `n`, mirrored at its ends (the end pixels count twice).
fn mirrored(i: i64, n: i64) -> usize {
    let m = i.rem_euclid(2 * n);
    (if m < n { m } else { 2 * n - 1 - m }) as usize
}

/// A row filter then a column filter, both of odd length.
fn filter(width: u32, height: u32, data: &[f32], along_x: &[f64], along_y: &[f64]) -> Vec<f32> {
    let (w, h) = (width as usize, height as usize);
    let line = |n: usize, kernel: &[f64], at: &dyn Fn(usize) -> f32, i: usize| -> f32 {
        let r = (kernel.len() / 2) as i64;
        let inside = i as i64 >= r && (i as i64) + r < n as i64;
        let place = |k: usize| match inside {
            true => i + k - r as usize,
            false => mirrored(i as i64 + k as i64 - r, n as i64),
        };
        kernel.iter().enumerate().map(|(k, c)| c * f64::from(at(place(k)))).sum::<f64>() as f32
    };
    let mut rows = vec![0.0f32; w * h];
    for (row, out) in data.chunks_exact(w.max(1)).zip(rows.chunks_exact_mut(w.max(1))) {
        for (i, o) in out.iter_mut().enumerate() {
            *o = line(w, along_x, &|k| row[k], i);
        }
    }
    let mut out = vec![0.0f32; w * h];
    for j in 0..h {
        for i in 0..w {
            out[j * w + i] = line(h, along_y, &|k| rows[k * w + i], j);
        }
    }
    out
}

/// A channel (at least `width * height` values) smoothed by a Gaussian of `sigma` pixels.
pub fn smoothed(width: u32, height: u32, data: &[f32], sigma: f32) -> Vec<f32> {
    let (smooth, _) = kernels(sigma);
    filter(width, height, data, &smooth, &smooth)
}

/// Derivatives along x and y of a channel smoothed by a Gaussian of `sigma` pixels.
pub fn derivatives(width: u32, height: u32, data: &[f32], sigma: f32) -> (Vec<f32>, Vec<f32>) {
    let (smooth, slope) = kernels(sigma);
    (filter(width, height, data, &slope, &smooth), filter(width, height, data, &smooth, &slope))
}

/// Larger eigenvalue and its unit eigenvector of the symmetric matrix `[[a, b], [b, c]]`.
pub fn principal(a: f32, b: f32, c: f32) -> (f32, [f32; 2]) {
    let (a, b, c) = (f64::from(a), f64::from(b), f64::from(c));
    let root = libm::hypot(a - c, 2.0 * b);
    let angle = 0.5 * libm::atan2(2.0 * b, a - c);
    ((0.5 * (a + c + root)) as f32, [libm::cos(angle) as f32, libm::sin(angle) as f32])
}

/// The gradient of a picture of several channels, smoothed by a Gaussian of `sigma` pixels.
pub fn colour_gradient<const N: usize>(width: u32, height: u32, pixels: &[[f32; N]], sigma: f32) -> Gradient {
    let mut tensor = vec![[0.0f32; 3]; pixels.len()];
    for c in 0..N {
        let channel: Vec<f32> = pixels.iter().map(|p| p[c]).collect();
        let (gx, gy) = derivatives(width, height, &channel, sigma);
        for (t, (&x, &y)) in tensor.iter_mut().zip(gx.iter().zip(&gy)) {
            *t = [t[0] + x * x, t[1] + x * y, t[2] + y * y];
        }
    }
    let (magnitude, normal) = tensor
        .into_iter()
        .map(|[a, b, c]| {
            let (most, direction) = principal(a, b, c);
            (most.max(0.0).sqrt(), direction)
        })
        .unzip();
    Gradient { width, height, magnitude, normal }
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
                let dot = g.normal[k][0] * 0.6 + g.normal[k][1] * 0.8;
                assert!((dot.abs() - 1.0).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn opposite_channels_do_not_cancel() {
        // A step of equal luminance: the mean of the channels is flat.
        let data: Vec<[f32; 2]> = (0..400).map(|i| if i % 20 < 10 { [0.0, 8.0] } else { [8.0, 0.0] }).collect();
        let g = colour_gradient(20, 20, &data, 1.0);
        let one: Vec<[f32; 1]> = data.iter().map(|p| [p[0]]).collect();
        let single = colour_gradient(20, 20, &one, 1.0);
        let k = 10 * 20 + 10;
        assert!((g.magnitude[k] - 2f32.sqrt() * single.magnitude[k]).abs() < 1e-4 && g.magnitude[k] > 3.0);
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
}
