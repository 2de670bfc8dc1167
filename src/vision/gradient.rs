//! Contours as ridges of the colour gradient (after Canny 1986, with the colour gradient of Di Zenzo 1986).
//!
//! The picture is averaged down in linear light, smoothed in L*a*b*, differentiated; ridges across the gradient's direction
//! are located between pixels; weak ridges stay where they hang on strong ones.

use super::color::{lab, linear};
use super::resize::{Plane, fitted};
use super::{ContourDetector, ContourMap, Photo};

/// Finds ridges of the colour gradient.
#[derive(Clone, Debug, PartialEq)]
pub struct GradientDetector {
    /// The longer side of the working picture, in pixels.
    pub size: u32,
    /// The standard deviation of the smoothing, in pixels of the working picture.
    pub sigma: f32,
    /// The share of pixels whose gradient is weaker than a strong ridge's.
    pub quantile: f32,
    /// The least gradient of a strong ridge, in L*a*b* units per pixel.
    pub least: f32,
    /// The gradient of the weakest ridge, as a fraction of that of a strong one.
    pub weak: f32,
}

impl Default for GradientDetector {
    fn default() -> Self {
        GradientDetector { size: 256, sigma: 1.4, quantile: 0.88, least: 1.2, weak: 0.4 }
    }
}

/// The gradient of a picture: strength and unit direction.
struct Field {
    width: usize,
    height: usize,
    strength: Vec<f32>,
    direction: Vec<[f32; 2]>,
}

impl ContourDetector for GradientDetector {
    fn detect(&self, photo: &Photo) -> ContourMap {
        let (width, height) = fitted(photo.width(), photo.height(), self.size.max(1));
        let field = self.gradient(photo, width as usize, height as usize);
        let (ridge, offset) = ridges(&field);
        let mut sorted = field.strength.clone();
        sorted.sort_by(f32::total_cmp);
        let rank = (self.quantile.clamp(0.0, 1.0) * (sorted.len() - 1) as f32) as usize;
        let high = sorted[rank].max(self.least);
        let kept = hysteresis(&ridge, field.width, high, self.weak * high);
        let mut map = ContourMap { width, height, ..ContourMap::default() };
        let top = sorted[sorted.len() - 1 - sorted.len() / 200].max(high);
        for (i, _) in kept.iter().enumerate().filter(|(_, k)| **k) {
            let [nx, ny] = field.direction[i];
            map.x.push((i % field.width) as f32 + 0.5 + offset[i] * nx);
            map.y.push((i / field.width) as f32 + 0.5 + offset[i] * ny);
            map.tx.push(-ny);
            map.ty.push(nx);
            map.strength.push((field.strength[i] / top).min(1.0));
        }
        map
    }
}

impl GradientDetector {
    /// The larger eigenvalue and its vector of the colour structure tensor.
    fn gradient(&self, photo: &Photo, width: usize, height: usize) -> Field {
        let pixels = photo.pixels();
        let table: Vec<f32> = (0..=255).map(linear).collect();
        let channel = |c: usize| {
            let values = pixels.pixels().map(|p| table[usize::from(p.0[c])]).collect();
            Plane { width: photo.width() as usize, height: photo.height() as usize, values }.resized(width, height)
        };
        let rgb = [channel(0), channel(1), channel(2)];
        let mut planes = [const { Vec::new() }; 3];
        for i in 0..width * height {
            let v = lab([rgb[0].values[i], rgb[1].values[i], rgb[2].values[i]]);
            (0..3).for_each(|c| planes[c].push(v[c]));
        }
        let smooth = planes.map(|p| blurred(&p, width, height, self.sigma));
        let mut field =
            Field { width, height, strength: vec![0.0; width * height], direction: vec![[1.0, 0.0]; width * height] };
        for y in 0..height {
            let (up, down) = (y.saturating_sub(1), (y + 1).min(height - 1));
            for x in 0..width {
                let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
                let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
                for p in &smooth {
                    let gx = 0.5 * (p[y * width + right] - p[y * width + left]);
                    let gy = 0.5 * (p[down * width + x] - p[up * width + x]);
                    xx += gx * gx;
                    xy += gx * gy;
                    yy += gy * gy;
                }
                let half = 0.5 * (xx - yy);
                let root = (half * half + xy * xy).sqrt();
                let i = y * width + x;
                field.strength[i] = (0.5 * (xx + yy) + root).max(0.0).sqrt();
                // The eigenvector, from the row that does not cancel.
                let (vx, vy) = if half >= 0.0 { (half + root, xy) } else { (xy, root - half) };
                let n = (vx * vx + vy * vy).sqrt();
                if n > 0.0 {
                    field.direction[i] = [vx / n, vy / n];
                }
            }
        }
        field
    }
}

/// Gaussian smoothing, the border repeated.
fn blurred(p: &[f32], width: usize, height: usize, sigma: f32) -> Vec<f32> {
    if sigma <= 0.0 {
        return p.to_vec();
    }
    let radius = (3.0 * sigma).ceil() as isize;
    let weight = |i: isize| libm::expf(-(i * i) as f32 / (2.0 * sigma * sigma));
    let kernel: Vec<f32> = (-radius..=radius).map(weight).collect();
    let total: f32 = kernel.iter().sum();
    let at = |i: usize, k: usize, n: usize| (i as isize + k as isize - radius).clamp(0, n as isize - 1) as usize;
    let mut across = vec![0.0; p.len()];
    let mut out = vec![0.0; p.len()];
    for y in 0..height {
        for x in 0..width {
            let sum: f32 = kernel.iter().enumerate().map(|(k, w)| w * p[y * width + at(x, k, width)]).sum();
            across[y * width + x] = sum / total;
        }
    }
    for y in 0..height {
        for (k, w) in kernel.iter().enumerate() {
            let from = at(y, k, height) * width;
            for x in 0..width {
                out[y * width + x] += w * across[from + x] / total;
            }
        }
    }
    out
}

/// Pixels that are strongest along the gradient's direction, and where between pixels the ridge runs.
fn ridges(f: &Field) -> (Vec<f32>, Vec<f32>) {
    let (w, h) = (f.width, f.height);
    let (mut ridge, mut offset) = (vec![0.0; w * h], vec![0.0; w * h]);
    // The border's gradients are one-sided, and a picture's frame is no contour.
    for y in 1..h.saturating_sub(1) {
        for x in 1..w.saturating_sub(1) {
            let i = y * w + x;
            let (m, [nx, ny]) = (f.strength[i], f.direction[i]);
            let at = |t: f32| {
                let (px, py) = (x as f32 + t * nx, y as f32 + t * ny);
                let (x0, y0) = (px as usize, py as usize);
                let (fx, fy) = (px - x0 as f32, py - y0 as f32);
                let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
                (f.strength[y0 * w + x0] * (1.0 - fx) + f.strength[y0 * w + x1] * fx) * (1.0 - fy)
                    + (f.strength[y1 * w + x0] * (1.0 - fx) + f.strength[y1 * w + x1] * fx) * fy
            };
            let (a, b) = (at(-1.0), at(1.0));
            if m > 0.0 && m >= a && m > b {
                ridge[i] = m;
                // The top of the parabola through the three.
                let bend = a - 2.0 * m + b;
                offset[i] = if bend < 0.0 { (0.5 * (a - b) / bend).clamp(-0.5, 0.5) } else { 0.0 };
            }
        }
    }
    (ridge, offset)
}

/// Ridges of at least `low` that hang together with one of at least `high`.
fn hysteresis(ridge: &[f32], width: usize, high: f32, low: f32) -> Vec<bool> {
    let mut kept = vec![false; ridge.len()];
    let mut stack: Vec<usize> = (0..ridge.len()).filter(|i| ridge[*i] >= high).collect();
    while let Some(i) = stack.pop() {
        if std::mem::replace(&mut kept[i], true) {
            continue;
        }
        for d in [1, width - 1, width, width + 1] {
            for j in [i.wrapping_sub(d), i + d] {
                if j < ridge.len() && ridge[j] >= low && ridge[j] > 0.0 && !kept[j] {
                    stack.push(j);
                }
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgb, RgbImage};

    /// A disc drawn with smooth edges.
    fn disc(size: u32, cx: f32, cy: f32, r: f32) -> Photo {
        Photo::new(RgbImage::from_fn(size, size, |x, y| {
            let d = (x as f32 + 0.5 - cx).hypot(y as f32 + 0.5 - cy);
            let t = (r - d + 0.5).clamp(0.0, 1.0);
            Rgb([200, 40, 40].map(|c: u8| (f32::from(c) * t + 220.0 * (1.0 - t)) as u8))
        }))
    }

    #[test]
    fn a_disc_has_a_circle() {
        let map = GradientDetector::default().detect(&disc(128, 60.3, 66.7, 30.0));
        assert!(map.x.len() > 150, "{} points", map.x.len());
        for i in 0..map.x.len() {
            let (dx, dy) = (map.x[i] - 60.3, map.y[i] - 66.7);
            let d = dx.hypot(dy);
            assert!((d - 30.0).abs() < 0.6, "a point at {d} from the centre");
            assert!((dx * map.tx[i] + dy * map.ty[i]).abs() / d < 0.2, "the tangent runs round");
        }
        let mean = map.x.iter().zip(&map.y).map(|(x, y)| (x - 60.3).hypot(y - 66.7)).sum::<f32>() / map.x.len() as f32;
        assert!((mean - 30.0).abs() < 0.15, "mean radius {mean}");
    }

    #[test]
    fn an_even_picture_has_none_and_small_ones_do_not_panic() {
        for (w, h) in [(1, 1), (1, 9), (2, 2), (64, 64)] {
            let photo = Photo::new(RgbImage::from_pixel(w, h, Rgb([10, 200, 30])));
            let map = GradientDetector::default().detect(&photo);
            assert_eq!((map.width, map.height, map.x.len()), (w, h, 0));
        }
    }

    #[test]
    fn a_large_picture_is_worked_on_small() {
        let map = GradientDetector::default().detect(&disc(600, 300.0, 300.0, 140.0));
        assert_eq!((map.width, map.height), (256, 256));
        let r = 140.0 * 256.0 / 600.0;
        assert!(map.x.iter().zip(&map.y).all(|(x, y)| ((x - 128.0).hypot(y - 128.0) - r).abs() < 0.7));
    }
}
