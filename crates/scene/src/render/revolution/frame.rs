//! Depth, parts and normals of a surface of revolution: a line of sight for each pixel
//! against its cones and level spans.

use super::lanes::LANES;
use super::rays::{Seen, Spans};
use super::sight::Sight;
use crate::geom::{Affine, Revolution};
use crate::render::simd::vectorised;
use crate::render::{Camera, Channels, Frame};
use glam::DVec3;

impl Frame {
    /// Draws a placed surface of revolution without a mesh; nothing if the placement is
    /// not invertible.
    pub fn of_revolution(
        surface: &Revolution,
        affine: &Affine,
        camera: &Camera,
        channels: Channels,
    ) -> Frame {
        let (width, height) = (camera.width, camera.height);
        let count = camera.pixels();
        let mut frame = Frame {
            width,
            height,
            depth: vec![f32::INFINITY; count],
            part: Vec::new(),
            normal: Vec::new(),
        };
        if channels == Channels::All {
            frame.part.resize(count, u16::MAX);
            frame.normal.resize(count, [0.0; 3]);
        }
        let Some(sight) = Sight::new(camera, affine) else { return frame };
        let [columns, rows] = sight.window(surface, camera);
        let mut spans = Spans::default();
        vectorised(
            #[inline(always)]
            || {
                spans.set(surface);
                for y in rows[0]..rows[1] {
                    let mut first = columns[0];
                    while first < columns[1] {
                        let seen = spans.nearest_at(&sight, [first, y]);
                        if seen.depth.iter().all(|d| *d == f64::INFINITY) {
                            first += LANES;
                            continue;
                        }
                        let past = (first + LANES).min(columns[1]);
                        let from = y * width as usize + first;
                        for (i, at) in (from..from + (past - first)).enumerate() {
                            if seen.depth[i] == f64::INFINITY {
                                continue;
                            }
                            if let Some(place) = frame.depth.get_mut(at) {
                                *place = seen.depth[i] as f32;
                            }
                            if channels == Channels::All {
                                let pixel = [first + i, y];
                                let (part, normal) =
                                    shown(surface, &sight, pixel, seen.depth[i], seen.span[i]);
                                (frame.part[at], frame.normal[at]) = (part, normal);
                            }
                        }
                        first += LANES;
                    }
                }
            },
        );
        frame
    }
}

impl Revolution {
    /// The depth at some pixels of a camera's image (row by row from the top): infinite
    /// where the surface does not show, and everywhere if the placement is not invertible.
    pub fn depth_at(&self, affine: &Affine, camera: &Camera, pixels: &[u32]) -> Vec<f32> {
        let mut out = vec![f32::INFINITY; pixels.len()];
        let Some(sight) = Sight::new(camera, affine) else { return out };
        let width = camera.width.max(1);
        let mut spans = Spans::default();
        vectorised(
            #[inline(always)]
            || {
                spans.set(self);
                for (pixels, out) in pixels.chunks(LANES).zip(out.chunks_mut(LANES)) {
                    let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
                    for (i, pixel) in pixels.iter().enumerate() {
                        x[i] = f64::from(pixel % width) + 0.5;
                        y[i] = f64::from(pixel / width) + 0.5;
                    }
                    let seen = spans.nearest(&sight.rays([&x, &y]), Camera::NEAR);
                    out.iter_mut().zip(seen.depth).for_each(|(out, d)| *out = d as f32);
                }
            },
        );
        out
    }
}

impl Spans {
    /// What shows at the centres of pixels of a row from one on.
    #[inline(always)]
    fn nearest_at(&self, sight: &Sight, [column, row]: [usize; 2]) -> Seen {
        let mut x = [0.0; LANES];
        for (i, x) in x.iter_mut().enumerate() {
            *x = (column + i) as f64 + 0.5;
        }
        self.nearest(&sight.rays([&x, &[row as f64 + 0.5; LANES]]), Camera::NEAR)
    }
}

/// The part and the normal of the surface at a pixel, as in a [`Frame`].
fn shown(
    surface: &Revolution,
    sight: &Sight,
    [column, row]: [usize; 2],
    depth: f64,
    span: u64,
) -> (u16, [f32; 3]) {
    let Some(span) = surface.spans().get(span as usize) else { return (u16::MAX, [0.0; 3]) };
    let Some([a, b]) = surface.ends(span) else { return (u16::MAX, [0.0; 3]) };
    let at = [column as f64 + 0.5, row as f64 + 0.5];
    let p = sight.point(at, depth);
    let r = (p.x * p.x + p.z * p.z).sqrt();
    // The share along the longer side is the more accurate one.
    let (dr, dy) = (b.r - a.r, b.y - a.y);
    let t = if dr.abs() > dy.abs() { (r - a.r) / dr } else { (p.y - a.y) / dy };
    let (nr, ny) = (a.nr + (b.nr - a.nr) * t, a.ny + (b.ny - a.ny) * t);
    let (c, s) = if r > 0.0 { (p.x / r, p.z / r) } else { (1.0, 0.0) };
    let normal = sight.cofactor * DVec3::new(nr * c, ny, nr * s);
    let [x, y] = sight.slopes(at);
    let to_eye = if sight.lens.pinhole { DVec3::new(-x, -y, 1.0) } else { DVec3::Z };
    let normal = normal.normalize_or(to_eye.normalize());
    let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
    (span.part, normal.as_vec3().to_array())
}

#[cfg(test)]
#[path = "frame_tests.rs"]
mod tests;
