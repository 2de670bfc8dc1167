//! Contours of meshes that keep their shape, whose cost follows the outline rather than the
//! mesh: the trees of [`crate::geom::Clusters`] find the faces that silhouettes cross and
//! those that hide them, and only these are projected.
//!
//! Invariant: pieces, their order, their visibility and the depth range are those of the
//! plain way, bit for bit. Trees only exclude faces, with margins for rounding; what is
//! left is computed by the same arithmetic. Where the margins are not known to suffice
//! ([`Posed::new`]), nothing is drawn this way.

mod crossed;
pub(in crate::render) mod hiding;
mod lanes;
pub(in crate::render) mod pieces;
mod points;
mod range;
mod rays;

use crate::geom::{Mesh, Solid, Trees};
use crate::render::Camera;
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{HUGE, Lens, Placement};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Positions in the image are known to this, in pixels: they are rounded to 1/1024 of a
/// pixel, and computed in double precision to a tenth of that.
const BLUR: f64 = 1e-3;
/// Projected meshes that reach farther than this, in pixels, are drawn the plain way:
/// rounded positions are bounded there.
const FARTHEST: f64 = 16_000.0;
/// Clusters of coarse meshes are wider than this in the image, in pixels.
const COARSE: f64 = 24.0;
/// Rounding errors of single precision, with a margin, relative to the largest number.
const ROUNDING: f64 = 4e-6;

/// A mesh with trees, placed before a camera.
pub(in crate::render) struct Posed<'a> {
    pub mesh: &'a Mesh,
    trees: &'a Trees,
    pub placement: Placement,
    lens: Lens,
    /// Facing as a linear form of the planes of vertices, relative to the greatest sum of
    /// magnitudes that can make it up.
    facing: [f32; 4],
    /// From camera coordinates, less the shift, to those of the mesh.
    inverse: DMat3,
    /// How far a line of sight may pass from a face that covers the pixel, along each axis
    /// of the mesh, rounding included.
    pad: f64,
    /// About how wide the boxes of the smallest clusters are in the image, in pixels.
    grain: f64,
    /// Whether it is beside the picture by at least half a pixel.
    pub outside: bool,
}

/// The meshes of a solid, if all of them can be drawn this way and it pays: of coarse meshes,
/// drawing all faces costs less than looking up pixels.
pub(in crate::render) fn posed<'a>(
    solid: &'a Solid,
    camera: &Camera,
) -> Option<SmallVec<[Posed<'a>; 1]>> {
    let pays = |posed: &Posed<'_>| posed.grain < COARSE || posed.outside;
    all_posed(solid, camera).filter(|list| list.iter().all(pays))
}

/// The meshes of a solid, if all of them can be drawn this way.
fn all_posed<'a>(solid: &'a Solid, camera: &Camera) -> Option<SmallVec<[Posed<'a>; 1]>> {
    let one = |instance: &'a crate::geom::Instance| {
        let trees = instance.mesh.drawn()?;
        Posed::new(&instance.mesh, trees, Placement::new(camera, &instance.affine), camera)
    };
    solid.instances().iter().map(one).collect()
}

impl<'a> Posed<'a> {
    /// `None` unless the mesh is wholly beyond the near plane and its size, distance and
    /// placement are such that rounding stays within the margins.
    pub fn new(
        mesh: &'a Mesh,
        trees: &'a Trees,
        placement: Placement,
        camera: &Camera,
    ) -> Option<Posed<'a>> {
        let lens = Lens::new(camera);
        let (middle, half) = (trees.surface.middle, trees.surface.half);
        let rows = placement.rows();
        // In camera coordinates along each axis: the middle, how far the mesh reaches from
        // it, and the sum of the magnitudes that make it up.
        let [x, y, z] = rows.map(|[a, b, c, t]| {
            let (row, shift) = (DVec3::new(a, b, c), t);
            let reach = row.abs().dot(half);
            [row.dot(middle) + shift, reach, row.abs().dot(middle.abs() + half) + shift.abs()]
        });
        let sum = x[2] + y[2] + z[2];
        let near = -z[0] - z[1] - 1e-12 * z[2];
        let far = -z[0] + z[1] + 1e-12 * z[2];
        if !(near >= Camera::NEAR && sum < 0.5 * HUGE) {
            return None;
        }
        // The corners of the box around the mesh, in the image.
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in 0..8 {
            let sign = |bit: u32| if corner & bit == 0 { -1.0 } else { 1.0 };
            let corner = middle + half * DVec3::new(sign(1), sign(2), sign(4));
            let Point { x, y, .. } = lens.point(placement.point(corner));
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        let size = [f64::from(camera.width), f64::from(camera.height)];
        let most = low.into_iter().chain(high).chain(size).fold(0.0f64, |m, v| m.max(v.abs()));
        let per_unit = lens.scale * if lens.pinhole { 1.0 / near } else { 1.0 };
        let slope = most + lens.cx.abs() + lens.cy.abs();
        let error = 2e-15 * (per_unit * sum * (1.0 + slope / lens.scale) + slope);
        // Written so that it fails for NaN.
        if !(most < FARTHEST && error < 0.1 * BLUR) {
            return None;
        }
        let faces = mesh.topology.triangles.len() as f64;
        let grain = (16.0 * (high[0] - low[0]) * (high[1] - low[1]) / faces).sqrt();
        let outside = (0..2).any(|i| low[i] > size[i] + 1.0 || high[i] < -1.0);
        let inverse = placement.matrix().inverse();
        // How far it is from the inverse.
        let rest = inverse * placement.matrix() - DMat3::IDENTITY;
        let rest = rest.to_cols_array().into_iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let bound = (middle.abs() + half).max_element();
        // Along each axis of the camera, the farthest that the start of a line of sight or
        // a point on it may be.
        let across = (slope / lens.scale) * if lens.pinhole { far } else { 1.0 };
        let reach = DVec3::new(across, across, far) + placement.shift().abs();
        let row = |i: usize| inverse.row(i).abs();
        let from = [0, 1, 2].map(|i| row(i).dot(reach)).into_iter().fold(0.0, f64::max);
        let depth = if lens.pinhole { far } else { 1.0 };
        let blur = [0, 1, 2].map(|i| (row(i).x + row(i).y) * depth * BLUR / lens.scale);
        let blur = blur.into_iter().fold(0.0, f64::max);
        let origin = (inverse * placement.shift()).abs().max_element()
            + if lens.pinhole { 0.0 } else { from };
        let pad = ROUNDING * (origin + bound) + blur;
        let facing = facing(trees, &placement)?;
        let sound = rest < 1e-8
            && from < 1e6 * (origin + bound)
            && (1e-12..1e12).contains(&(origin + bound))
            && (1e-12..1e12).contains(&near)
            && far < 1e12
            && pad < 1e12;
        sound.then_some(Posed {
            mesh,
            trees,
            placement,
            lens,
            facing,
            inverse,
            pad,
            grain,
            outside,
        })
    }
}

/// The facing of a mesh's vertices as a form of their planes; `None` if it has no scale.
fn facing(trees: &Trees, placement: &Placement) -> Option<[f32; 4]> {
    let (tree, (view, bend)) = (&trees.facing, placement.sight());
    let most = |from: DVec3| tree.normal.dot(from.abs());
    let whole = most(view) + bend.abs() * (most(tree.middle) + most(tree.reach));
    let by_normal = (view - tree.middle * bend) / whole;
    let form = [by_normal.x, by_normal.y, by_normal.z, -bend / whole].map(|v| v as f32);
    (whole > 0.0 && whole.is_finite() && form.iter().all(|v| v.is_finite())).then_some(form)
}

#[cfg(test)]
mod tests;
