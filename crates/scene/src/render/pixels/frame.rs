//! Depth, part and normal of what a camera sees, one value per pixel centre.
//!
//! No anti-aliasing, no colours (see `shade`). Invariant: `depth` has `width * height`
//! entries, row by row from the top, finite exactly where something is visible; the other
//! channels have as many entries, or none if they were not requested.

use crate::geom::{Mesh, Solid};
use crate::render::pixels::area::Area;
use crate::render::pixels::candidates::Candidates;
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Lens, Placement, Projected, project};
use crate::render::pixels::raster::{WHOLE, cut_triangles, draw_nearness, empty, fill_faces};
use crate::render::pixels::triangle::area;
use crate::render::simd::vectorised;
use crate::render::{Camera, work};
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
    /// Unit normal in the camera's frame (x right, y up, z towards the camera), on the
    /// visible side of the surface; zero off the object. Empty when only depth was drawn.
    pub normal: Vec<[f32; 3]>,
}

thread_local! {
    /// Scratch memory reused from frame to frame: projected vertices, candidate triangles
    /// and shading.
    static SCRATCH: RefCell<(Projected, Candidates, Shading)> = RefCell::default();
}

impl Frame {
    /// Draws a solid. Back faces are drawn too, except those of bodies known to hide
    /// them; triangles with a vertex that is not finite are left out.
    pub fn render(solid: &Solid, camera: &Camera, channels: Channels) -> Frame {
        SCRATCH.with(|scratch| match scratch.try_borrow_mut() {
            Ok(mut scratch) => Frame::draw(solid, camera, channels, &mut scratch),
            Err(_) => Frame::draw(solid, camera, channels, &mut Default::default()),
        })
    }

    /// A frame of depth alone.
    pub(in crate::render) fn of_depth(camera: &Camera, depth: Vec<f32>) -> Frame {
        let (width, height) = (camera.width, camera.height);
        Frame { width, height, depth, part: Vec::new(), normal: Vec::new() }
    }

    /// Whether each pixel shows the object, row by row.
    pub fn mask(&self) -> impl Iterator<Item = bool> + '_ {
        self.depth.iter().map(|d| d.is_finite())
    }

    fn draw(
        solid: &Solid,
        camera: &Camera,
        channels: Channels,
        (projected, candidates, shading): &mut (Projected, Candidates, Shading),
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
                let scratch = (&*projected, candidates, shading);
                draw_all(solid, camera, scratch, &mut depth, &mut part, &mut normal);
            }
        }
        to_depth(camera, &mut depth);
        Frame { width, height, depth, part, normal }
    }
}

/// Depth from nearness.
#[inline(always)]
pub(in crate::render) fn depth_of(pinhole: bool, nearness: f32) -> f32 {
    if pinhole { 1.0 / nearness } else { -nearness }
}

/// Converts nearness to depth, in place.
pub(in crate::render) fn to_depth(camera: &Camera, buffer: &mut [f32]) {
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

/// Draws nearness, parts and normals of all meshes. For each mesh, the nearest face of
/// each pixel is found first, so that the normal is computed once per pixel.
fn draw_all(
    solid: &Solid,
    camera: &Camera,
    (projected, candidates, shading): (&Projected, &mut Candidates, &mut Shading),
    nearness: &mut [f32],
    part: &mut [u16],
    normal: &mut [[f32; 3]],
) {
    let (width, lens) = (camera.width as usize, Lens::new(camera));
    let (bend, cx, cy) = (if lens.pinhole { 1.0 / lens.scale } else { 0.0 }, lens.cx, lens.cy);
    // The normal at a pixel's centre, from its slope over the triangle.
    let shade = |slope: &Slope, row: usize, column: usize| {
        let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
        let to_eye = DVec3::new((cx - x) * bend, (y - cy) * bend, 1.0).as_vec3();
        seen_normal(slope.at(x, y).as_vec3(), to_eye)
    };
    for (i, instance) in solid.instances().iter().enumerate() {
        let (mesh, placement) = (&instance.mesh, &Placement::new(camera, &instance.affine));
        let number = |face: usize| {
            let own =
                mesh.topology.parts.get(face).map_or(0, |p| p.saturating_add(instance.first_part));
            own.min(u16::MAX - 1)
        };
        let vertices = projected.mesh(i);
        if vertices.outside(camera) {
            continue;
        }
        if !vertices.whole {
            cut_triangles(mesh, placement, camera, &vertices, |triangle, face, weights| {
                let slope =
                    Slope::new(mesh, placement, lens.pinhole, face, &triangle.points, weights);
                let number = number(face);
                triangle.runs(|run| {
                    for column in run.from..run.to {
                        let (i, q) = (run.row * width + column, run.nearness(column));
                        if q > nearness[i] {
                            (nearness[i], part[i], normal[i]) =
                                (q, number, shade(&slope, run.row, column));
                        }
                    }
                });
            });
            continue;
        }
        let area = vertices.area(camera);
        shading.begin(camera.pixels(), mesh.topology.triangles.len(), width, &area);
        fill_faces(mesh, placement, camera, &vertices, candidates, nearness, &mut shading.faces);
        for row in area.top..area.bottom {
            for column in area.left..area.right {
                let i = row * width + column;
                let face = shading.faces[i];
                if face != NOWHERE {
                    let slope = shading.slope(face, |face| {
                        let points = vertices.corners(&mesh.topology, face);
                        Slope::new(mesh, placement, lens.pinhole, face as usize, &points, WHOLE)
                    });
                    (part[i], normal[i]) = (number(face as usize), shade(slope, row, column));
                }
            }
        }
    }
}

/// No face.
const NOWHERE: u32 = u32::MAX;

/// The nearest faces of one mesh, and how normals change over them. Reused from mesh to
/// mesh.
#[derive(Default)]
struct Shading {
    /// The face at each pixel where the mesh is nearest.
    faces: Vec<u32>,
    /// The index in `slopes` of each face, [`NOWHERE`] if its slope is not computed yet.
    known: Vec<u32>,
    slopes: Vec<Slope>,
}

impl Shading {
    /// Clears all slopes, and the faces in an area; the mesh must lie inside that area.
    fn begin(&mut self, pixels: usize, faces: usize, width: usize, area: &Area) {
        self.faces.resize(pixels, NOWHERE);
        for row in self.faces.chunks_exact_mut(width).take(area.bottom).skip(area.top) {
            row[area.left..area.right].fill(NOWHERE);
        }
        self.known.clear();
        self.known.resize(faces, NOWHERE);
        self.slopes.clear();
    }

    /// The slope of a face, computed on first use.
    #[inline]
    fn slope(&mut self, face: u32, new: impl Fn(u32) -> Slope) -> &Slope {
        let known = &mut self.known[face as usize];
        if *known == NOWHERE {
            *known = self.slopes.len() as u32;
            self.slopes.push(new(face));
        }
        &self.slopes[*known as usize]
    }
}

/// A normal that changes linearly over a triangle in the image, not of unit length.
struct Slope {
    first: DVec3,
    by_column: DVec3,
    by_row: DVec3,
    corner: [f64; 2],
}

impl Slope {
    /// For a triangle with the given corners, which are weighted means of the face's
    /// corners.
    fn new(
        mesh: &Mesh,
        placement: &Placement,
        pinhole: bool,
        face: usize,
        points: &[Point; 3],
        weights: [[f64; 3]; 3],
    ) -> Slope {
        let area = area(points);
        // Counter-clockwise in the scene is a negative area in the image, where y points
        // down.
        let turn = if (area < 0.0) != placement.mirrored { 1.0 } else { -1.0 };
        let corner = |v: u32| {
            let n = mesh.normals.get(v as usize).map_or(DVec3::ZERO, |n| n.as_dvec3());
            placement.normal(n).normalize_or_zero() * turn
        };
        let corners = mesh.topology.triangles.get(face).copied().unwrap_or_default().map(corner);
        let weight = |p: &Point| if pinhole { p.nearness } else { 1.0 };
        let at = |i: usize| {
            let w = weights[i];
            (corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2]) * weight(&points[i])
        };
        let [a, b, c] = points;
        let (na, nb, nc) = (at(0), at(1), at(2));
        let inverse = 1.0 / area;
        let (nb, nc) = (nb - na, nc - na);
        let by_column = (nb * (c.y - a.y) - nc * (b.y - a.y)) * inverse;
        let by_row = (nc * (b.x - a.x) - nb * (c.x - a.x)) * inverse;
        Slope { first: na, by_column, by_row, corner: [a.x, a.y] }
    }

    /// The normal at a position in the image.
    #[inline(always)]
    fn at(&self, x: f64, y: f64) -> DVec3 {
        self.first + self.by_row * (y - self.corner[1]) + self.by_column * (x - self.corner[0])
    }
}

/// A unit normal that does not point away from the camera: interpolated normals can lean
/// slightly beyond the outline, and are then projected back to a right angle.
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
