//! Depth, part and normal of what a camera sees, one value per pixel centre.
//!
//! No anti-aliasing, no colours (see `shade`). Invariant: `depth` has `width * height` entries, row by row from the top,
//! finite exactly where something is seen; the other channels have as many entries or, when not asked for, none.

use super::candidates::Candidates;
use super::project::{Lens, Projected, project};
use super::raster::{draw_nearness, each_triangle, empty};
use super::simd::vectorised;
use super::{Camera, work};
use crate::geom::Solid;
use glam::{DVec3, Vec3};
use std::cell::RefCell;

/// Which channels to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channels {
    /// Depth alone; the fastest.
    Depth,
    /// Depth, parts and normals.
    All,
}

/// A drawn frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Distance along the viewing axis in scene units; infinite off the object.
    pub depth: Vec<f32>,
    /// Part number; `u16::MAX` off the object. Empty when only depth was drawn.
    pub part: Vec<u16>,
    /// Unit normal in the camera's frame (x right, y up, z towards the camera), turned to the side that is seen;
    /// zero off the object. Empty when only depth was drawn.
    pub normal: Vec<[f32; 3]>,
}

thread_local! {
    /// Projected vertices and what may be drawn, reused from frame to frame.
    static SCRATCH: RefCell<(Projected, Candidates)> = RefCell::default();
}

impl Frame {
    /// Draws a solid. Back faces are drawn too, but for bodies that hide their own; triangles with a vertex that is not finite are left out.
    pub fn render(solid: &Solid, camera: &Camera, channels: Channels) -> Frame {
        SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
            Ok(mut scratch) => Frame::draw(solid, camera, channels, &mut scratch),
            Err(_) => Frame::draw(solid, camera, channels, &mut Default::default()),
        })
    }

    /// Whether a pixel shows the object, row by row.
    pub fn mask(&self) -> impl Iterator<Item = bool> + '_ {
        self.depth.iter().map(|d| d.is_finite())
    }

    fn draw(
        solid: &Solid,
        camera: &Camera,
        channels: Channels,
        (projected, candidates): &mut (Projected, Candidates),
    ) -> Frame {
        work::count(|work| work.whole += 1);
        solid.instances().iter().for_each(|i| work::drawn(&i.mesh));
        let (width, height) = (camera.width, camera.height);
        let (mut depth, mut part, mut normal) = (Vec::new(), Vec::new(), Vec::new());
        match channels {
            Channels::Depth => {
                draw_nearness(solid, camera, projected, candidates, &mut depth);
            }
            Channels::All => {
                project(solid, camera, projected);
                depth.resize(camera.pixels(), empty(camera));
                part.resize(camera.pixels(), u16::MAX);
                normal.resize(camera.pixels(), [0.0; 3]);
                draw_all(solid, camera, projected, &mut depth, &mut part, &mut normal);
            }
        }
        to_depth(camera, &mut depth);
        Frame { width, height, depth, part, normal }
    }
}

/// Depth from nearness.
#[inline(always)]
pub(super) fn depth_of(pinhole: bool, nearness: f32) -> f32 {
    if pinhole { 1.0 / nearness } else { -nearness }
}

/// Nearness to depth, in place.
pub(super) fn to_depth(camera: &Camera, buffer: &mut [f32]) {
    let pinhole = Lens::new(camera).pinhole;
    vectorised(
        #[inline(always)]
        || {
            for q in buffer.iter_mut() {
                *q = depth_of(pinhole, *q);
            }
        },
    );
}

fn draw_all(
    solid: &Solid,
    camera: &Camera,
    projected: &Projected,
    nearness: &mut [f32],
    part: &mut [u16],
    normal: &mut [[f32; 3]],
) {
    let width = camera.width as usize;
    let lens = Lens::new(camera);
    let (bend, cx, cy) = (if lens.pinhole { 1.0 / lens.scale } else { 0.0 }, lens.cx, lens.cy);
    each_triangle(solid, camera, projected, |triangle, source| {
        let Some(instance) = solid.instances().get(source.instance) else { return };
        let mesh = &instance.mesh;
        let number = mesh.topology.parts.get(source.face).map_or(0, |p| p.saturating_add(instance.first_part));
        let number = number.min(u16::MAX - 1);
        // Counter-clockwise in the scene is a negative area in the image, whose y runs down.
        let turn = if (triangle.area < 0.0) != source.placement.mirrored { 1.0 } else { -1.0 };
        let corner = |v: u32| {
            let n = mesh.normals.get(v as usize).map_or(DVec3::ZERO, |n| n.as_dvec3());
            source.placement.normal(n).normalize_or_zero() * turn
        };
        let corners = mesh.topology.triangles[source.face].map(corner);
        let [a, b, c] = triangle.points;
        let weight = |p: &super::project::Point| if lens.pinhole { p.nearness } else { 1.0 };
        let at = |i: usize| {
            let w = source.weights[i];
            (corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]) * weight(&triangle.points[i])
        };
        let (na, nb, nc) = (at(0), at(1), at(2));
        let inverse = 1.0 / triangle.area;
        let (nb, nc) = (nb - na, nc - na);
        let dx = (nb * (c.y - a.y) - nc * (b.y - a.y)) * inverse;
        let dy = (nc * (b.x - a.x) - nb * (c.x - a.x)) * inverse;
        triangle.runs(|run| {
            let y = run.row as f64 + 0.5;
            let row_start = na + dy * (y - a.y);
            for column in run.from..run.to {
                let i = run.row * width + column;
                let q = run.nearness(column);
                if let (Some(at), Some(part), Some(normal)) = (nearness.get_mut(i), part.get_mut(i), normal.get_mut(i))
                    && q > *at
                {
                    *at = q;
                    *part = number;
                    let x = column as f64 + 0.5;
                    let n = (row_start + dx * (x - a.x)).as_vec3();
                    let to_eye = DVec3::new((cx - x) * bend, (y - cy) * bend, 1.0).as_vec3();
                    *normal = seen_normal(n, to_eye);
                }
            }
        });
    });
}

/// A unit normal that does not point away from the eye: interpolated normals can lean a little beyond the outline,
/// and are then pulled back to a right angle.
fn seen_normal(n: Vec3, to_eye: Vec3) -> [f32; 3] {
    let v = to_eye.normalize();
    let mut n = n.normalize_or(v);
    let away = n.dot(v);
    if away < 0.0 {
        n = (n - v * away).normalize_or(v);
    }
    n.to_array()
}

#[cfg(test)]
#[path = "frame_tests.rs"]
mod tests;
