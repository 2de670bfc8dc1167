//! What hides pieces of contour: for each pixel at which some are tested, the nearest
//! surface in front of the farthest depth that a test asks about. Surfaces behind that, most
//! of them, are not looked at.

use super::Posed;
use crate::geom::{Faces, LEAF, Node, WIDE};
use crate::render::Camera;
use crate::render::lines::visibility::{Depths, Piece};
use crate::render::pixels::frame::depth_of;
use crate::render::pixels::place::size;
use crate::render::pixels::raster::back_of;
use crate::render::pixels::triangle::{Triangle, bits};
use crate::render::simd::vectorised;
use glam::{DVec3, Vec4};
use wide::f32x8;

/// Depth at the pixels where pieces are tested. Reused from image to image.
#[derive(Default)]
pub(in crate::render) struct Hiding {
    /// For each pixel, the least depth at which all of its tests pass, and the least at
    /// which any does; [`UNASKED`] between images.
    limits: Vec<[f64; 2]>,
    /// The pixels with tests.
    pixels: Vec<u32>,
    /// The depth there, or infinity if it is beyond all limits; meaningless elsewhere.
    depth: Vec<f32>,
    /// Work done so far.
    pub tested: usize,
    pub drawn: usize,
}

const UNASKED: [f64; 2] = [0.0, f64::INFINITY];

impl Hiding {
    /// Clears `hidden` for the pieces that pass their test on a side, of those that are set.
    pub fn test(
        &mut self,
        posed: &[Posed<'_>],
        camera: &Camera,
        extent: f64,
        (side, pieces, hidden): (usize, &[Piece], &mut [bool]),
    ) {
        let pixels = camera.pixels();
        if self.limits.len() < pixels {
            self.limits.resize(pixels, UNASKED);
            self.depth.resize(pixels, f32::INFINITY);
        }
        let Some(depths) = Depths::new(&self.depth[..pixels], camera.width, camera.height, extent)
        else {
            return;
        };
        self.pixels.clear();
        for (_, piece) in hidden.iter().zip(pieces).filter(|(hidden, _)| **hidden) {
            let Some((pixel, least)) = depths.least_by(piece, side) else { continue };
            let Some(limits) = self.limits.get_mut(pixel as usize) else { continue };
            if *limits == UNASKED {
                self.pixels.push(pixel);
            }
            *limits = [limits[0].max(least), limits[1].min(least)];
        }
        let mut rays: smallvec::SmallVec<[Rays<'_>; 1]> =
            posed.iter().filter(|p| !p.outside).map(|p| Rays::new(p, camera)).collect();
        let Hiding { limits, pixels: list, depth, tested, drawn } = self;
        vectorised(
            #[inline(always)]
            || {
                for pixel in list.iter() {
                    let at = *pixel as usize;
                    let (Some(limits), Some(depth)) = (limits.get_mut(at), depth.get_mut(at))
                    else {
                        continue;
                    };
                    *depth = f32::INFINITY;
                    let place = [pixel % camera.width, pixel / camera.width].map(|v| v as usize);
                    for rays in &mut rays {
                        rays.nearest(place, *limits, depth);
                    }
                    *limits = UNASKED;
                }
            },
        );
        for rays in rays {
            (*tested, *drawn) = (*tested + rays.tested, *drawn + rays.drawn);
        }
        let depths = Depths::new(&self.depth[..pixels], camera.width, camera.height, extent);
        for (hidden, piece) in hidden.iter_mut().zip(pieces) {
            *hidden = *hidden && !depths.as_ref().is_some_and(|d| d.visible_by(piece, side));
        }
    }
}

/// Lines of sight through the tree of a mesh.
struct Rays<'a> {
    posed: &'a Posed<'a>,
    size: Vec4,
    back: f64,
    /// Depth as a linear form of the mesh's coordinates, less a margin.
    depth: [f32; 4],
    /// Of a pinhole camera, its place in the mesh's coordinates.
    eye: DVec3,
    tested: usize,
    drawn: usize,
}

/// A line of sight in the mesh's coordinates: depth `t` is at `from + t way`.
struct Ray {
    from: [f32; 3],
    way: [f32; 3],
    /// What an edge's function may be off by, per size of the face.
    slack: f32,
    /// By axis: which side of a box is met first, the inverse of `way`, and what is taken
    /// from the near and the far sides' coordinates.
    first: [usize; 3],
    inverse: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
}

impl<'a> Rays<'a> {
    fn new(posed: &'a Posed<'a>, camera: &Camera) -> Rays<'a> {
        let [a, b, c, t] = posed.placement.rows()[2];
        let tree = &posed.trees.surface;
        let bound = tree.middle.abs() + tree.half;
        let whole = DVec3::new(a, b, c).abs().dot(bound) + t.abs();
        let depth = [-a, -b, -c, -t - super::ROUNDING * whole].map(|v| v as f32);
        Rays {
            posed,
            size: size(camera.width, camera.height),
            back: back_of(posed.mesh, &posed.placement, true),
            depth,
            eye: posed.inverse * -posed.placement.shift(),
            tested: 0,
            drawn: 0,
        }
    }

    /// The line of sight through a pixel's centre.
    #[inline(always)]
    fn ray(&self, [column, row]: [usize; 2]) -> Ray {
        let Posed { lens, inverse, pad, .. } = self.posed;
        let (x, y) = (column as f64 + 0.5 - lens.cx, lens.cy - row as f64 - 0.5);
        let aside = (inverse.x_axis * x + inverse.y_axis * y) / lens.scale;
        let (from, way) = match lens.pinhole {
            true => (self.eye, aside - inverse.z_axis),
            false => (self.eye + aside, -inverse.z_axis),
        };
        let (from, mut way) = (from.as_vec3().to_array(), way.as_vec3());
        let most = way.abs().max_element();
        // No division by zero; this moves a ray by less than the margin.
        let least = 1e-7 * most;
        for axis in 0..3 {
            if way[axis].abs() < least {
                way[axis] = if way[axis] < 0.0 { -least } else { least };
            }
        }
        let (way, pad) = (way.to_array(), *pad as f32);
        let first = way.map(|v| usize::from(v < 0.0));
        let sign = way.map(|v| if v < 0.0 { -pad } else { pad });
        Ray {
            from,
            way,
            slack: 6.0 * pad * most,
            first,
            inverse: way.map(|v| 1.0 / v),
            near: std::array::from_fn(|i| from[i] + sign[i]),
            far: std::array::from_fn(|i| from[i] - sign[i]),
        }
    }

    /// Lowers a pixel's depth to that of the nearest face, if one is nearer and before the
    /// first limit; any face before the second limit will do.
    #[inline(always)]
    fn nearest(&mut self, pixel: [usize; 2], [limit, enough]: [f64; 2], depth: &mut f32) {
        // Rounded upwards.
        let mut limit = depth.min((limit as f32).next_up());
        if !(limit > 0.0) {
            return;
        }
        let ray = self.ray(pixel);
        let tree = &self.posed.trees.surface;
        let mut waiting = [0u32; 128];
        waiting[0] = tree.root;
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let at = waiting[count & 127];
            if at < LEAF {
                let Some(node) = tree.nodes.get(at as usize) else { continue };
                for i in bits(u64::from(ray.met(node, &self.depth, limit))) {
                    waiting[count & 127] = node.children[i & 7];
                    count += 1;
                }
                continue;
            }
            let Some(leaf) = tree.leaves.get((at - LEAF) as usize) else { continue };
            self.tested += WIDE;
            for i in bits(u64::from(ray.may_cover(leaf))) {
                self.drawn += 1;
                let Some(there) = self.depth_at(leaf.faces[i & 7], pixel) else { continue };
                if there < *depth {
                    *depth = there;
                    limit = limit.min(there);
                    if f64::from(there) < enough {
                        return;
                    }
                }
            }
        }
    }

    /// The depth of a face at a pixel, if it covers it, as whole pictures have it.
    #[inline(never)]
    fn depth_at(&self, face: u32, [column, row]: [usize; 2]) -> Option<f32> {
        let corners = self.posed.mesh.topology.triangles.get(face as usize)?;
        let [Some(a), Some(b), Some(c)] = corners.map(|v| self.posed.vertex(v)) else {
            return None;
        };
        let triangle = Triangle::within([a.0, b.0, c.0], [a.1, b.1, c.1], self.size, self.back)?;
        Some(depth_of(self.posed.lens.pinhole, triangle.nearness_at(column, row)?))
    }
}

impl Ray {
    /// The children, as bits, whose boxes it meets and that reach before a depth.
    #[inline(always)]
    fn met(&self, node: &Node<3>, depth: &[f32; 4], limit: f32) -> u32 {
        let mut from = f32x8::splat(f32::NEG_INFINITY);
        let mut to = f32x8::splat(f32::INFINITY);
        let mut least = f32x8::splat(depth[3]);
        for axis in 0..3 {
            let first = self.first[axis] & 1;
            let inverse = f32x8::splat(self.inverse[axis]);
            let near = f32x8::new(node.sides[first][axis]) - f32x8::splat(self.near[axis]);
            let far = f32x8::new(node.sides[1 - first][axis]) - f32x8::splat(self.far[axis]);
            from = from.fast_max(near * inverse);
            to = to.fast_min(far * inverse);
            let factor = depth[axis];
            least += f32x8::new(node.sides[usize::from(factor < 0.0)][axis]) * factor;
        }
        (from.simd_le(to) & least.simd_lt(f32x8::splat(limit))).to_bitmask()
    }

    /// The faces, as bits, that it may meet.
    #[inline(always)]
    fn may_cover(&self, leaf: &Faces) -> u32 {
        let from = self.from.map(f32x8::splat);
        let way = self.way.map(f32x8::splat);
        let corners: [[f32x8; 3]; 3] = leaf
            .corners
            .each_ref()
            .map(|corner| std::array::from_fn(|axis| f32x8::new(corner[axis]) - from[axis]));
        let slack = f32x8::new(leaf.size) * self.slack;
        let mut least = f32x8::splat(f32::INFINITY);
        let mut most = f32x8::splat(f32::NEG_INFINITY);
        for (k, a) in corners.iter().enumerate() {
            // The volume of the edge, the way and the corner.
            let b = &corners[(k + 1) % 3];
            let [x, y, z]: [f32x8; 3] = std::array::from_fn(|axis| b[axis] - a[axis]);
            let side = a[0] * (y * way[2] - z * way[1])
                + a[1] * (z * way[0] - x * way[2])
                + a[2] * (x * way[1] - y * way[0]);
            least = least.fast_min(side);
            most = most.fast_max(side);
        }
        (least.simd_ge(-slack) | most.simd_le(slack)).to_bitmask()
    }
}

/// The depth at all pixels.
#[cfg(test)]
pub(super) fn depth(posed: &Posed<'_>, camera: &Camera) -> Vec<f32> {
    let mut rays = Rays::new(posed, camera);
    let pixels = 0..camera.pixels();
    let place = |pixel: usize| [pixel % camera.width as usize, pixel / camera.width as usize];
    let mut one = |pixel: usize| {
        let mut depth = f32::INFINITY;
        rays.nearest(place(pixel), [f64::INFINITY, 0.0], &mut depth);
        depth
    };
    pixels.map(&mut one).collect()
}
