//! The exact Euclidean distance transform: for every pixel the distance to the nearest set pixel, and which one that is.
//! Felzenszwalb & Huttenlocher 2012, "Distance transforms of sampled functions", Theory of Computing 8, 415-428: lower envelopes
//! of parabolas, rows after columns, linear time. Distances are between pixel centres, in pixels, exact up to one rounding.

/// Distances to the nearest set pixel of a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DistanceMap {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Distances, pixels, row by row. Where no pixel is set, all are the map's diagonal.
    pub values: Vec<f32>,
    /// Index (row * width + column) of a nearest set pixel; `u32::MAX` everywhere where none is set.
    pub nearest: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// Scratch of one line's lower envelope.
struct Envelope {
    /// Places of the parabolas, from the left.
    place: Vec<usize>,
    /// From where on each is the lowest.
    from: Vec<f64>,
}

impl Envelope {
    fn new(n: usize) -> Self {
        Envelope { place: Vec::with_capacity(n), from: Vec::with_capacity(n) }
    }

    /// The envelope of the parabolas `(x - q)^2 + f(q)` over the `q` where `f` is finite.
    fn build(&mut self, f: &[f64]) {
        self.place.clear();
        self.from.clear();
        for (q, &fq) in f.iter().enumerate().filter(|(_, v)| v.is_finite()) {
            let mut start = f64::NEG_INFINITY;
            while let (Some(&p), Some(&z)) = (self.place.last(), self.from.last()) {
                let (a, b) = (q as f64, p as f64);
                // p < q; values are squares of integers, exact in f64.
                start = ((fq + a * a) - (f[p] + b * b)) / (2.0 * (a - b));
                if start > z {
                    break;
                }
                self.place.pop();
                self.from.pop();
                start = f64::NEG_INFINITY;
            }
            self.place.push(q);
            self.from.push(start);
        }
    }

    /// The lowest parabola of every place, in order; nothing for an empty envelope.
    fn walk(&self, n: usize) -> impl Iterator<Item = usize> + '_ {
        let mut k = 0;
        (0..if self.place.is_empty() { 0 } else { n }).map(move |x| {
            while self.from.get(k + 1).is_some_and(|&z| z < x as f64) {
                k += 1;
            }
            self.place[k]
        })
    }
}

/// The distance transform of a map of `width` x `height` pixels; pixels beyond the end of `set` are not set. When no pixel is
/// set, all distances are the diagonal and all `nearest` are `u32::MAX`.
pub fn distance_transform(width: u32, height: u32, set: &[bool]) -> DistanceMap {
    let (w, h) = (width as usize, height as usize);
    let mut nearest = vec![NONE; w * h];
    let mut values = vec![libm::hypot(f64::from(width), f64::from(height)) as f32; w * h];
    if w * h == 0 || !set.iter().take(w * h).any(|&s| s) {
        return DistanceMap { width, height, values, nearest };
    }
    // Columns: the distance to the nearest set pixel above or below, squared, and its row.
    let mut squared = vec![f64::INFINITY; w * h];
    let is_set = |i: usize| set.get(i).copied().unwrap_or(false);
    for x in 0..w {
        let mut last = None;
        for y in 0..h {
            if is_set(y * w + x) {
                last = Some(y);
            }
            if let Some(row) = last {
                squared[y * w + x] = ((y - row) * (y - row)) as f64;
                nearest[y * w + x] = (row * w + x) as u32;
            }
        }
        last = None;
        for y in (0..h).rev() {
            if is_set(y * w + x) {
                last = Some(y);
            }
            if let Some(row) = last {
                let d = ((row - y) * (row - y)) as f64;
                if d < squared[y * w + x] {
                    squared[y * w + x] = d;
                    nearest[y * w + x] = (row * w + x) as u32;
                }
            }
        }
    }
    // Rows: the lower envelope over columns.
    let mut envelope = Envelope::new(w);
    let mut row_nearest = vec![NONE; w];
    for y in 0..h {
        let row = y * w..(y + 1) * w;
        envelope.build(&squared[row.clone()]);
        row_nearest.copy_from_slice(&nearest[row.clone()]);
        for (x, q) in envelope.walk(w).enumerate() {
            let d = x.abs_diff(q);
            values[y * w + x] = (squared[y * w + q] + (d * d) as f64).sqrt() as f32;
            nearest[y * w + x] = row_nearest[q];
        }
    }
    DistanceMap { width, height, values, nearest }
}

impl DistanceMap {
    /// The distance at a place in pixel coordinates (pixel centres at +0.5) and its derivatives along x and y: bilinear between
    /// pixel centres. Beyond the outermost centres it is the value at the nearest place between them plus the distance to that
    /// place, so it is continuous everywhere. At coordinates that are not finite, and in a map without pixels, it is the map's
    /// diagonal with derivatives 0.
    pub fn sample(&self, x: f32, y: f32) -> (f32, f32, f32) {
        let (w, h) = (self.width as usize, self.height as usize);
        if w == 0 || h == 0 || !x.is_finite() || !y.is_finite() {
            return (libm::hypot(f64::from(self.width), f64::from(self.height)) as f32, 0.0, 0.0);
        }
        let (u, v) = (f64::from(x) - 0.5, f64::from(y) - 0.5);
        let (cu, cv) = (u.clamp(0.0, (w - 1) as f64), v.clamp(0.0, (h - 1) as f64));
        let (i, j) = (cu as usize, cv as usize);
        let (fx, fy) = (cu - i as f64, cv - j as f64);
        let at = |i: usize, j: usize| f64::from(self.values[j.min(h - 1) * w + i.min(w - 1)]);
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
        let top = a + fx * (b - a);
        let bottom = c + fx * (d - c);
        let mut value = top + fy * (bottom - top);
        let mut dx = if cu == u { (b - a) + fy * ((d - c) - (b - a)) } else { 0.0 };
        let mut dy = if cv == v { bottom - top } else { 0.0 };
        let (ox, oy) = (u - cu, v - cv);
        let out = (ox * ox + oy * oy).sqrt();
        if out > 0.0 {
            value += out;
            dx += ox / out;
            dy += oy / out;
        }
        (value as f32, dx as f32, dy as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, StreamKey};

    fn brute(w: usize, h: usize, set: &[bool]) -> Vec<f32> {
        let on: Vec<(i64, i64)> = (0..w * h).filter(|&i| set[i]).map(|i| ((i % w) as i64, (i / w) as i64)).collect();
        (0..w * h)
            .map(|i| {
                let (x, y) = ((i % w) as i64, (i / w) as i64);
                let d = on.iter().map(|(a, b)| (a - x).pow(2) + (b - y).pow(2)).min().unwrap();
                (d as f64).sqrt() as f32
            })
            .collect()
    }

    fn random(w: usize, h: usize, density: f64, seed: u64) -> Vec<bool> {
        let mut s = StreamKey::new(seed, 0, Purpose::VALUES).stream(0, 0, 0);
        (0..w * h).map(|_| s.uniform() < density).collect()
    }

    #[test]
    fn equal_to_brute_force() {
        let mut seed = 0;
        for (w, h) in [(1, 1), (1, 17), (23, 1), (2, 2), (16, 9), (31, 40)] {
            for density in [0.01, 0.1, 0.5, 1.0] {
                seed += 1;
                let mut set = random(w, h, density, seed);
                set[(seed as usize * 7) % (w * h)] = true;
                let map = distance_transform(w as u32, h as u32, &set);
                assert_eq!(map.values, brute(w, h, &set), "{w} x {h} {density}");
                for (i, &n) in map.nearest.iter().enumerate() {
                    let n = n as usize;
                    assert!(set[n]);
                    let d2 = (n % w).abs_diff(i % w).pow(2) + (n / w).abs_diff(i / w).pow(2);
                    assert_eq!((d2 as f64).sqrt() as f32, map.values[i]);
                }
            }
        }
    }

    #[test]
    fn empty_and_odd_maps() {
        let map = distance_transform(3, 4, &[false; 12]);
        assert!(map.values.iter().all(|&v| v == 5.0));
        assert!(map.nearest.iter().all(|&n| n == u32::MAX));
        assert_eq!(distance_transform(0, 5, &[]).values.len(), 0);
        assert_eq!(distance_transform(0, 5, &[]).sample(1.0, 1.0), (5.0, 0.0, 0.0));
        // Missing pixels are not set.
        assert_eq!(distance_transform(3, 1, &[true]).values, [0.0, 1.0, 2.0]);
    }

    #[test]
    fn samples_meet_pixels_and_derivatives() {
        let set = random(12, 9, 0.05, 5);
        let map = distance_transform(12, 9, &set);
        for j in 0..9 {
            for i in 0..12 {
                assert_eq!(map.sample(i as f32 + 0.5, j as f32 + 0.5).0, map.values[j * 12 + i]);
            }
        }
        let mut s = StreamKey::new(9, 0, Purpose::VALUES).stream(0, 0, 0);
        let mut checked = 0;
        for _ in 0..2000 {
            let (x, y) = (s.uniform() as f32 * 24.0 - 6.0, s.uniform() as f32 * 21.0 - 6.0);
            let e = 1.0 / 256.0;
            // A cell's border between the two samples has two derivatives.
            let crosses = |v: f32| ((v - 0.5 - e).floor() - (v - 0.5 + e).floor()) != 0.0;
            if crosses(x) || crosses(y) {
                continue;
            }
            let (_, dx, dy) = map.sample(x, y);
            let nx = (map.sample(x + e, y).0 - map.sample(x - e, y).0) / (2.0 * e);
            let ny = (map.sample(x, y + e).0 - map.sample(x, y - e).0) / (2.0 * e);
            assert!((dx - nx).abs() < 2e-3 && (dy - ny).abs() < 2e-3, "({x}, {y}): {dx} {nx} {dy} {ny}");
            checked += 1;
        }
        assert!(checked > 1500);
    }

    #[test]
    fn outside_is_continuous_and_grows() {
        let map = distance_transform(8, 8, &random(8, 8, 0.1, 2));
        for k in 0..80 {
            let y = k as f32 * 0.1;
            for edge in [0.5f32, 7.5] {
                let (a, b) = (map.sample(edge - 1e-4, y).0, map.sample(edge + 1e-4, y).0);
                assert!((a - b).abs() < 1e-3);
            }
        }
        assert_eq!(map.sample(-9.5, 0.5).0, map.values[0] + 10.0);
        assert_eq!(map.sample(f32::NAN, 0.5).1, 0.0);
        assert!(map.sample(f32::MAX, f32::MAX).0.is_finite() || map.sample(f32::MAX, f32::MAX).0 == f32::INFINITY);
    }
}
