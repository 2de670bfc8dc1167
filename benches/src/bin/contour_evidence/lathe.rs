//! Random lathes under the paper's prior, and their masks in the camera of the data set.

/// A random number generator.
pub struct Numbers(pub u64);

impl Numbers {
    /// Samples uniformly from 0..1.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Samples from an approximate standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// A lathe: log radii at knots, and a pose.
#[derive(Clone)]
pub struct Lathe {
    radius: f64,
    knots: [f64; 12],
    /// Scale, three rotations, three translations, each as a fraction (0..1) of its
    /// prior's range.
    pose: [f64; 7],
}

impl Lathe {
    /// Samples from the prior.
    pub fn draw(n: &mut Numbers) -> Self {
        let mut knots = [0.0; 12];
        let mut level = 0.0;
        for k in &mut knots {
            level = 0.8 * level + 0.3 * n.normal();
            *k = level;
        }
        Lathe { radius: -1.2 + 0.9 * n.unit(), knots, pose: std::array::from_fn(|_| n.unit()) }
    }

    /// Returns a copy with a small random change of the pose or the profile.
    pub fn changed(&self, n: &mut Numbers) -> Self {
        let mut l = self.clone();
        let size = 0.3f64.powf(1.0 + 3.0 * n.unit());
        if n.unit() < 0.5 {
            for p in &mut l.pose {
                if n.unit() < 0.4 {
                    *p = (*p + size * n.normal()).clamp(0.0, 1.0);
                }
            }
        } else {
            l.radius += size * n.normal();
            let from = (n.unit() * 12.0) as usize;
            let to = (from + 1 + (n.unit() * 5.0) as usize).min(12);
            let step = 3.0 * size * n.normal();
            l.knots[from..to].iter_mut().for_each(|k| *k += step);
        }
        l
    }

    /// Renders the silhouette in a square picture.
    pub fn mask(&self, size: usize) -> Vec<bool> {
        let mut mask = vec![false; size * size];
        let focal = 465.45 * size as f64 / 256.0;
        let [s, a, b, c, x, y, z] = self.pose;
        let (s, turn) = (0.5 + s, |v: f64| (v * 60.0 - 30.0).to_radians().sin_cos());
        let ((sx, cx), (sy, cy), (sz, cz)) = (turn(a), turn(b), turn(c));
        let shift = [x, y, z].map(|v| 2.0 * v - 1.0);
        let discs = 140;
        for i in 0..=discs {
            let t = f64::from(i) / f64::from(discs);
            let u = t * 11.0;
            let k = (u as usize).min(10);
            let f = u - k as f64;
            let f = f * f * (3.0 - 2.0 * f);
            let r =
                (self.radius + self.knots[k] * (1.0 - f) + self.knots[k + 1] * f).exp().min(1.5);
            let ring: Vec<(f64, f64)> = (0..24)
                .map(|j| {
                    let (sin, cos) = (f64::from(j) * std::f64::consts::TAU / 24.0).sin_cos();
                    let (px, py, pz) = (r * cos, 2.0 * t - 1.0, r * sin);
                    let (py, pz) = (cx * py - sx * pz, sx * py + cx * pz);
                    let (px, pz) = (cy * px + sy * pz, cy * pz - sy * px);
                    let (px, py) = (cz * px - sz * py, sz * px + cz * py);
                    let depth = 8.0 - (s * pz + shift[2]);
                    let half = size as f64 / 2.0;
                    (
                        half + focal * (s * px + shift[0]) / depth,
                        half - focal * (s * py + shift[1]) / depth,
                    )
                })
                .collect();
            fill(&ring, size, &mut mask);
        }
        mask
    }
}

/// Fills a convex polygon, in at least one row of pixels.
fn fill(ring: &[(f64, f64)], size: usize, mask: &mut [bool]) {
    let (low, high) = ring.iter().fold((f64::MAX, f64::MIN), |m, p| (m.0.min(p.1), m.1.max(p.1)));
    for row in low.max(0.0) as usize..=(high.max(-1.0) as usize).min(size - 1) {
        if high < 0.0 {
            break;
        }
        let y = (row as f64 + 0.5).clamp(low, high);
        let (mut left, mut right) = (f64::MAX, f64::MIN);
        for i in 0..ring.len() {
            let (p, q) = (ring[i], ring[(i + 1) % ring.len()]);
            if (p.1 <= y) == (q.1 <= y) && p.1 != y {
                continue;
            }
            let x = if p.1 == q.1 { p.0 } else { p.0 + (q.0 - p.0) * (y - p.1) / (q.1 - p.1) };
            left = left.min(x);
            right = right.max(x);
        }
        let (a, b) =
            ((left + 0.5).max(0.0) as usize, (right + 0.5).clamp(0.0, size as f64) as usize);
        if a < b {
            mask[row * size + a..row * size + b].fill(true);
        }
    }
}
