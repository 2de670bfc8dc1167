//! What the CPU and the shaders share: structures as `shaders/layout.wgsl` has them, and
//! limits.

use crate::topologies::Place;
use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use pcadlang_scene::geom::Affine;
use pcadlang_scene::render::{Camera, Projection};

/// Sides of the mesh that stands for a surface of revolution.
pub const SIDES: u32 = 96;
/// Pieces of contour of a scene, hidden or not; scenes with more are drawn by the CPU.
pub const MOST_PIECES: u32 = 4096;
/// Lines of creases or boundaries of a mesh.
pub const MOST_LINES: usize = 2048;
/// Bits of the bitmap of tested pixels, whose rows are padded to words.
const MOST_PIXELS: u32 = 65536;

/// [`Draw::flags`].
pub const ENCLOSES: u32 = 1;
pub const OPEN: u32 = 2;
pub const MIRRORED: u32 = 4;
pub const REVOLUTION: u32 = 8;

/// What [`Outcome::status`] says: drawn, to be drawn by the CPU, no room for its pieces.
pub const DRAWN: u32 = 0;
pub const FOR_CPU: u32 = 1;
pub const NO_ROOM: u32 = 2;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Params {
    pub scenes: u32,
    /// Pieces for which the list of all scenes has room.
    pub room: u32,
    /// Vertices for which each workgroup has room.
    pub vertices: u32,
    /// Distance fields; 0 to write contours.
    pub channels: u32,
    pub size: [u32; 2],
    pub scale: [f32; 2],
    pub percent: f32,
    pub truncate: f32,
    pub unused: [u32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Scene {
    pub lens: [f32; 4],
    pub first: u32,
    pub past: u32,
    pub unused: [u32; 2],
}

impl Scene {
    /// A scene without draws.
    pub fn new(camera: &Camera) -> Scene {
        let lens = match camera.projection {
            Projection::Pinhole { focal_px, cx, cy } => [focal_px, cx, cy, 1.0],
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                [1.0 / units_per_pixel, cx, cy, 0.0]
            }
        };
        Scene { lens: lens.map(|v| v as f32), ..Scene::default() }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Draw {
    /// Rows of the map to camera coordinates.
    pub rows: [[f32; 4]; 3],
    pub facing: [f32; 4],
    /// Rows of the map of normals.
    pub normal: [[f32; 4]; 2],
    pub positions: u32,
    pub normals: u32,
    pub count: u32,
    pub projected: u32,
    pub triangles: u32,
    pub triangle_count: u32,
    pub edges: u32,
    pub edge_count: u32,
    pub lines: u32,
    pub line_count: u32,
    pub flags: u32,
    pub unused: u32,
}

impl Draw {
    /// The numbers of a placement, computed in double precision as `Placement` of
    /// `render/pixels/project.rs`.
    pub fn placed(camera: &Camera, affine: &Affine) -> Draw {
        let rotation = DMat3::from_cols(camera.right, camera.up, -camera.forward).transpose();
        let m = rotation * affine.0.matrix3;
        let t = rotation * (affine.0.translation - camera.eye);
        let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
        let determinant = a.dot(b.cross(c));
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let cofactor = DMat3::from_cols(b.cross(c) * sign, c.cross(a) * sign, a.cross(b) * sign);
        let (view, bend) = match camera.projection {
            Projection::Pinhole { .. } => (cofactor.transpose() * -t, determinant * sign),
            Projection::Orthographic { .. } => (cofactor.transpose() * DVec3::Z, 0.0),
        };
        let row = |v: DVec3, w: f64| [v.x, v.y, v.z, w].map(|v| v as f32);
        Draw {
            rows: [0, 1, 2].map(|i| row(m.row(i), t[i])),
            facing: row(view, bend),
            normal: [0, 1].map(|i| row(cofactor.row(i), 0.0)),
            flags: if sign < 0.0 { MIRRORED } else { 0 },
            ..Draw::default()
        }
    }
}

impl Draw {
    /// With a topology.
    pub fn with(self, place: &Place) -> Draw {
        Draw {
            triangles: place.triangles,
            triangle_count: place.triangle_count,
            edges: place.edges,
            edge_count: place.edge_count,
            lines: place.lines,
            line_count: place.line_count,
            flags: self.flags | place.flags,
            ..self
        }
    }
}

/// The outcome of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Outcome {
    pub status: u32,
    /// Its visible pieces among those of all scenes.
    pub first: u32,
    pub count: u32,
    pub pieces: u32,
    /// Length, length times distance, length times squared distance.
    pub sums: [f32; 4],
}

impl Outcome {
    /// Its visible pieces among those of all scenes.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + self.count as usize
    }
}

/// Bytes of a workgroup's memory for each piece, and for each vertex.
pub const PIECE_BYTES: u64 = 48;
pub const VERTEX_BYTES: u64 = 16;

/// The shader for pictures of a size; `None` if they are too large.
pub fn shader([width, height]: [u32; 2]) -> Option<String> {
    let stride = width.div_ceil(32);
    let fits = stride.checked_mul(32)?.checked_mul(height)? <= MOST_PIXELS;
    let words = (stride * height).next_multiple_of(4);
    let numbers = [
        ("$SIDES", SIDES),
        ("$PIECES", MOST_PIECES),
        ("$STRIDE", stride),
        ("$WORDS", words),
        ("$WIDTH", width),
        ("$HEIGHT", height),
    ];
    let source = [
        include_str!("shaders/layout.wgsl"),
        include_str!("shaders/project.wgsl"),
        include_str!("shaders/pieces.wgsl"),
        include_str!("shaders/depth.wgsl"),
        include_str!("shaders/main.wgsl"),
    ];
    (fits && words > 0).then(|| {
        numbers
            .iter()
            .fold(source.join("\n"), |text, (name, number)| text.replace(name, &number.to_string()))
    })
}
