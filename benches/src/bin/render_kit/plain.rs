//! A plain rasteriser like those of the peers: edge functions for each pixel, contours
//! where depth jumps or bends, and the mean of the distance transform at contour pixels.

use super::raw::{Pose, Raw};
use pcadlang_scene::vision::distance_transform::distance_transform;

/// A neighbour that is farther by more than this fraction is behind.
const JUMP: f32 = 0.03;
/// The threshold of a crease: the second difference of 1/z, relative to 1/z, times (size
/// / 4)^2.
const CREASE: f32 = 6.0;

/// A mesh and its pictures.
pub struct Plain<'a> {
    raw: &'a Raw,
    size: usize,
    /// Projected vertices: x and y in pixels, and the inverse depth.
    points: Vec<[f32; 3]>,
    depth: Vec<f32>,
    contour: Vec<bool>,
    distance: Vec<f32>,
}

impl<'a> Plain<'a> {
    pub fn new(raw: &'a Raw, size: usize) -> Self {
        let points = vec![[0.0; 3]; raw.vertices.len()];
        let (depth, contour) = (vec![0.0; size * size], vec![false; size * size]);
        Plain { raw, size, points, depth, contour, distance: Vec::new() }
    }

    /// Sets the observation to the contours of a pose.
    pub fn observe(&mut self, pose: &Pose) {
        let size = self.size as u32;
        let map = distance_transform(size, size, self.contour(pose));
        let at = |i: usize| ((i % self.size) as f32 + 0.5, (i / self.size) as f32 + 0.5);
        self.distance =
            (0..self.size * self.size).map(|i| map.sample(at(i).0, at(i).1).0).collect();
    }

    /// Renders depth along the viewing axis, infinite outside the object.
    pub fn depth(&mut self, pose: &Pose) -> &[f32] {
        let (size, half) = (self.size, self.size as f32 * 0.5);
        let focal = half / 22.5f32.to_radians().tan();
        self.depth.fill(f32::INFINITY);
        for (to, v) in self.points.iter_mut().zip(&self.raw.vertices) {
            let row = |r: usize| {
                pose[4 * r] * v[0]
                    + pose[4 * r + 1] * v[1]
                    + pose[4 * r + 2] * v[2]
                    + pose[4 * r + 3]
            };
            let inverse = -1.0 / row(2);
            *to = [
                half - 0.5 + focal * row(0) * inverse,
                half - 0.5 - focal * row(1) * inverse,
                inverse,
            ];
        }
        for t in &self.raw.triangles {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            let low = |i: usize| a[i].min(b[i]).min(c[i]).ceil().max(0.0) as i32;
            let high = |i: usize| a[i].max(b[i]).max(c[i]).floor().min(size as f32 - 1.0) as i32;
            let (left, right, top, bottom) = (low(0), high(0), low(1), high(1));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            if left > right || top > bottom || area == 0.0 {
                continue;
            }
            let (ax, ay) = ((b[1] - c[1]) / area, (c[0] - b[0]) / area);
            let (bx, by) = ((c[1] - a[1]) / area, (a[0] - c[0]) / area);
            for y in top..=bottom {
                let mut u = ax * (left as f32 - c[0]) + ay * (y as f32 - c[1]);
                let mut v = bx * (left as f32 - c[0]) + by * (y as f32 - c[1]);
                for pixel in &mut self.depth
                    [y as usize * size + left as usize..=y as usize * size + right as usize]
                {
                    let w = 1.0 - u - v;
                    if u >= 0.0 && v >= 0.0 && w >= 0.0 {
                        let d = 1.0 / (u * a[2] + v * b[2] + w * c[2]);
                        *pixel = if d < *pixel { d } else { *pixel };
                    }
                    u += ax;
                    v += bx;
                }
            }
        }
        &self.depth
    }

    /// Marks pixels where the object ends, occludes itself, or bends sharply.
    pub fn contour(&mut self, pose: &Pose) -> &[bool] {
        self.depth(pose);
        let (size, z) = (self.size, &self.depth);
        let bend = CREASE / (size * size) as f32 * 16.0;
        for (i, to) in self.contour.iter_mut().enumerate() {
            let (x, y, d) = (i % size, i / size, z[i]);
            let inner = |at: usize| at > 0 && at + 1 < size;
            let near = |there: bool, j: usize| if there { z[j] } else { d };
            let (left, right) = (near(x > 0, i.wrapping_sub(1)), near(x + 1 < size, i + 1));
            let (up, down) = (near(y > 0, i.wrapping_sub(size)), near(y + 1 < size, i + size));
            let limit = d * (1.0 + JUMP);
            let bends = |a: f32, b: f32| (1.0 / a - 2.0 / d + 1.0 / b).abs() > bend / d;
            *to = d.is_finite()
                && (left > limit
                    || right > limit
                    || up > limit
                    || down > limit
                    || (inner(x) && bends(left, right))
                    || (inner(y) && bends(up, down)));
        }
        &self.contour
    }

    /// Returns the mean distance of contour pixels from the observed contours.
    pub fn likelihood(&mut self, pose: &Pose) -> f64 {
        self.contour(pose);
        let (mut sum, mut n) = (0.0, 0.0);
        for (d, _) in self.distance.iter().zip(&self.contour).filter(|(_, c)| **c) {
            sum += f64::from(*d);
            n += 1.0;
        }
        sum / n
    }
}
