//! Depth, part and normal of what a camera sees, one value per pixel centre.
//!
//! No anti-aliasing, no colours (see `shade`). Invariant: `depth` has `width * height`
//! entries, row by row from the top, finite exactly where something is visible; the other
//! channels have as many entries, or none if they were not requested.

use crate::geom::{Mesh, Solid};
use crate::render::pixels::area::Area;
use crate::render::pixels::candidates::Candidates;
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Lens, Placement, Projected, Vertices, project};
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

    /// For each pixel, row by row, true if it shows the object.
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
        let mut pixels = ChannelPixels::default();
        match channels {
            Channels::Depth => {
                draw_nearness(solid, camera, projected, candidates, &mut pixels.nearness);
            }
            Channels::All => {
                project(solid, camera, projected);
                let whole = Area::whole(camera);
                pixels.clear(camera, &whole);
                for (i, instance) in solid.instances().iter().enumerate() {
                    let placement = Placement::new(camera, &instance.affine);
                    let (drawn, scratch) = (
                        (&*instance.mesh, &placement, &projected.mesh(i)),
                        (&mut *candidates, &mut *shading),
                    );
                    pixels.draw(drawn, instance.first_part, camera, scratch, &whole);
                }
            }
        }
        let ChannelPixels { nearness: mut depth, part, normal } = pixels;
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

/// The number of a part beyond which all parts are drawn as one.
const LAST_PART: u16 = u16::MAX - 1;

/// The number of a part among those of a solid, given its own one among those of its mesh.
#[inline(always)]
pub(in crate::render) fn part_number(own: u16, first_part: u16) -> u16 {
    own.saturating_add(first_part).min(LAST_PART)
}

/// Nearness, parts and normals of an area, row by row; `u16::MAX` and 0 off the object.
#[derive(Default)]
pub(in crate::render) struct ChannelPixels {
    pub nearness: Vec<f32>,
    pub part: Vec<u16>,
    pub normal: Vec<[f32; 3]>,
}

impl ChannelPixels {
    /// Nothing is seen in an area.
    pub fn clear(&mut self, camera: &Camera, area: &Area) {
        let ChannelPixels { nearness, part, normal } = self;
        nearness.clear();
        nearness.resize(area.pixels(), empty(camera));
        part.clear();
        part.resize(area.pixels(), u16::MAX);
        normal.clear();
        normal.resize(area.pixels(), [0.0; 3]);
    }

    /// Draws a mesh where it is nearer than what is there. The pixels are those of `of`,
    /// which must contain all pixels that the mesh can cover. The nearest face of each pixel
    /// is found first, so that the normal is computed once per pixel.
    pub fn draw(
        &mut self,
        (mesh, placement, vertices): (&Mesh, &Placement, &Vertices<'_>),
        first_part: u16,
        camera: &Camera,
        (candidates, shading): (&mut Candidates, &mut Shading),
        of: &Area,
    ) {
        let (width, lens) = (of.right - of.left, Lens::new(camera));
        let ChannelPixels { nearness, part, normal } = self;
        let number = |face: usize| {
            part_number(mesh.topology.parts.get(face).copied().unwrap_or(0), first_part)
        };
        let eye = Eye::new(&lens);
        let own = vertices.area(camera);
        if vertices.outside(camera) || own.pixels() == 0 {
            return;
        }
        if !vertices.whole {
            cut_triangles(mesh, placement, camera, vertices, |triangle, face, weights| {
                let slope =
                    Slope::new(mesh, placement, lens.pinhole, face, &triangle.points, weights);
                let number = number(face);
                triangle.runs(|run| {
                    for column in run.from..run.to {
                        let i = (run.row - of.top) * width + column - of.left;
                        let q = run.nearness(column);
                        if q > nearness[i] {
                            (nearness[i], part[i], normal[i]) =
                                (q, number, eye.shade(&slope, run.row, column));
                        }
                    }
                });
            });
            return;
        }
        shading.begin(of, mesh.topology.triangles.len(), &own);
        let faces = &mut shading.faces;
        fill_faces(mesh, placement, camera, vertices, candidates, of, (nearness, faces));
        for row in own.top..own.bottom {
            for column in own.left..own.right {
                let i = (row - of.top) * width + column - of.left;
                let face = shading.faces[i];
                if face != NOWHERE {
                    let slope = shading.slope(face, |face| {
                        let points = vertices.corners(&mesh.topology, face);
                        Slope::new(mesh, placement, lens.pinhole, face as usize, &points, WHOLE)
                    });
                    (part[i], normal[i]) = (number(face as usize), eye.shade(slope, row, column));
                }
            }
        }
    }
}

/// The directions from pixels to the camera.
struct Eye {
    bend: f64,
    cx: f64,
    cy: f64,
}

impl Eye {
    fn new(lens: &Lens) -> Eye {
        Eye { bend: if lens.pinhole { 1.0 / lens.scale } else { 0.0 }, cx: lens.cx, cy: lens.cy }
    }

    /// The normal at a pixel's centre, from its slope over the triangle.
    #[inline(always)]
    fn shade(&self, slope: &Slope, row: usize, column: usize) -> [f32; 3] {
        let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
        let to_eye =
            DVec3::new((self.cx - x) * self.bend, (y - self.cy) * self.bend, 1.0).as_vec3();
        seen_normal(slope.at(x, y).as_vec3(), to_eye)
    }
}

/// No face.
const NOWHERE: u32 = u32::MAX;

/// The nearest faces of one mesh, and how normals change over them. Reused from mesh to
/// mesh.
#[derive(Default)]
pub(in crate::render) struct Shading {
    /// The face at each pixel where the mesh is nearest.
    faces: Vec<u32>,
    /// The index in `slopes` of each face, [`NOWHERE`] if its slope is not computed yet.
    known: Vec<u32>,
    slopes: Vec<Slope>,
}

impl Shading {
    /// Clears all slopes, and the faces in the part of an area in which the mesh lies.
    fn begin(&mut self, of: &Area, faces: usize, own: &Area) {
        let width = of.right - of.left;
        self.faces.resize(of.pixels(), NOWHERE);
        let rows = self.faces.chunks_exact_mut(width);
        for row in rows.take(own.bottom - of.top).skip(own.top - of.top) {
            row[own.left - of.left..own.right - of.left].fill(NOWHERE);
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
