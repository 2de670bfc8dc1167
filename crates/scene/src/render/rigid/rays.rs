//! Lines of sight through the tree of a mesh's faces, a few close ones at a time.

use super::Posed;
use super::lanes::Lanes;
use crate::geom::{Faces, LEAF, Node, WIDE};
use crate::render::Camera;
use crate::render::pixels::frame::depth_of;
use crate::render::pixels::place::{Place, Point, size};
use crate::render::pixels::raster::back_of;
use crate::render::pixels::triangle::{Triangle, bits};
use glam::{DVec3, Vec3, Vec4};
use wide::f32x8;

/// Pixels looked up at a time.
pub(super) const GROUP: usize = 8;

/// What the tests at a pixel ask: the least depth at which all of them pass, and the least
/// at which any does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Asked {
    pub all: f64,
    pub any: f64,
}

/// Lines of sight through the tree of a mesh.
pub(super) struct Rays<'a> {
    posed: &'a Posed<'a>,
    size: Vec4,
    back: f64,
    /// Depth as a linear form of the mesh's coordinates, less a margin.
    depth: [f32; 4],
    /// Of a pinhole camera, its place in the mesh's coordinates.
    eye: DVec3,
    /// Faces tested, and faces of which depth was computed.
    pub tested: usize,
    pub drawn: usize,
}

/// Some lines of sight in the mesh's coordinates: depth `t` is at `from + t way`.
struct Group {
    from: [f32x8; 3],
    way: [[f32; GROUP]; 3],
    inverse: [f32x8; 3],
    /// What a test of an edge may be off by, per size of the face.
    slack: [f32; GROUP],
    /// Faces at this depth or beyond do not matter; negative for lines that are finished.
    limit: f32x8,
    /// What [`Posed::pad`] is.
    pad: f32,
    around: Around,
}

/// Bounds of a group by axis.
struct Around {
    /// The side of a box that is met first.
    first: [usize; 3],
    /// The least and the greatest inverse of `way`; 0 if its sign is not the same for all.
    inverse: [[f32; 2]; 3],
    /// What is taken from the coordinates of the near and of the far side of a box.
    near: [f32; 3],
    far: [f32; 3],
    /// What is added to the depth where the far side is met: infinity if the sign is not the
    /// same for all.
    beyond: [f32; 3],
    limit: f32,
}

impl<'a> Rays<'a> {
    pub fn new(posed: &'a Posed<'a>, camera: &Camera) -> Rays<'a> {
        let [a, b, c, t] = posed.placement.rows()[2];
        let tree = &posed.trees.surface;
        let bound = tree.middle.abs() + tree.half;
        let whole = DVec3::new(a, b, c).abs().dot(bound) + t.abs();
        Rays {
            posed,
            size: size(camera.width, camera.height),
            back: back_of(posed.mesh, &posed.placement, true),
            depth: [-a, -b, -c, -t - super::ROUNDING * whole].map(|v| v as f32),
            eye: posed.inverse * -posed.placement.shift(),
            tested: 0,
            drawn: 0,
        }
    }

    /// The line of sight through a pixel's centre: a point on it and its way, in which no
    /// coordinate is 0.
    #[inline(always)]
    fn ray(&self, [column, row]: [u32; 2]) -> (Vec3, Vec3) {
        let Posed { lens, inverse, .. } = self.posed;
        let (x, y) = (f64::from(column) + 0.5 - lens.cx, lens.cy - f64::from(row) - 0.5);
        let per_unit = 1.0 / lens.scale;
        let aside = inverse.x_axis * (x * per_unit) + inverse.y_axis * (y * per_unit);
        let (from, way) = match lens.pinhole {
            true => (self.eye, aside - inverse.z_axis),
            false => (self.eye + aside, -inverse.z_axis),
        };
        let (from, way) = (from.as_vec3(), way.as_vec3());
        // No division by zero; this moves the line by less than the margin.
        let least = 1e-7 * way.abs().max_element();
        let sound = |v: f32| match v.abs() < least {
            true if v < 0.0 => -least,
            true => least,
            false => v,
        };
        (from, Vec3::new(sound(way.x), sound(way.y), sound(way.z)))
    }

    #[inline(always)]
    fn group(&self, pixels: &[(u32, Asked, f32)], width: u32) -> Group {
        let pad = self.posed.pad as f32;
        let rows = [[1.0; GROUP]; 3];
        let (mut from, mut way, mut inverse) = (rows, rows, rows);
        let (mut slack, mut limit) = ([0.0; GROUP], [-1.0; GROUP]);
        let [mut low, mut high] = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let [mut least, mut most] = [low, high];
        for (i, (pixel, asked, depth)) in pixels.iter().enumerate().take(GROUP) {
            let (origin, own) = self.ray([pixel % width, pixel / width]);
            (low, high) = (low.min(origin), high.max(origin));
            (least, most) = (least.min(own), most.max(own));
            for axis in 0..3 {
                (from[axis][i], way[axis][i]) = (origin[axis], own[axis]);
                inverse[axis][i] = 1.0 / own[axis];
            }
            slack[i] = 6.0 * pad * own.abs().max_element();
            // Rounded upwards.
            let all = (asked.all as f32).next_up();
            limit[i] = if *depth < all { *depth } else { all };
        }
        let split = [0, 1, 2].map(|axis| least[axis] < 0.0 && most[axis] > 0.0);
        let first = [0, 1, 2].map(|axis| usize::from(most[axis] < 0.0));
        let around = Around {
            first,
            inverse: std::array::from_fn(|i| match split[i] {
                true => [0.0; 2],
                false => [1.0 / most[i], 1.0 / least[i]],
            }),
            near: std::array::from_fn(|i| if first[i] == 0 { high[i] + pad } else { low[i] - pad }),
            far: std::array::from_fn(|i| if first[i] == 0 { low[i] - pad } else { high[i] + pad }),
            beyond: split.map(|split| if split { f32::INFINITY } else { 0.0 }),
            limit: limit.into_iter().fold(-1.0, |m, v| if v > m { v } else { m }),
        };
        let [from, inverse] = [from, inverse].map(|rows| rows.map(f32x8::new));
        Group { from, way, inverse, slack, limit: f32x8::new(limit), pad, around }
    }

    /// Lowers the depth of the first `count` pixels, close to each other in a picture of some
    /// width, to that of the nearest face, if one is nearer and in front of what all tests
    /// there ask; any face in front of what each test asks will do.
    #[inline(always)]
    pub fn nearest<L: Lanes>(
        &mut self,
        lanes: L,
        pixels: &mut [(u32, Asked, f32); GROUP],
        count: usize,
        width: u32,
    ) {
        let mut group = self.group(&pixels[..count], width);
        let tree = &self.posed.trees.surface;
        let mut waiting = [0u32; 128];
        waiting[0] = tree.root;
        let mut left = usize::from(group.around.limit > 0.0);
        while left > 0 && group.around.limit > 0.0 {
            left -= 1;
            let Some(node) = tree.nodes.get(waiting[left & 127] as usize) else { continue };
            let (met, depth) = group.around.met(lanes, node, &self.depth);
            for i in bits(u64::from(met)) {
                let child = node.children[i & 7];
                if child < LEAF {
                    waiting[left & 127] = child;
                    left += 1;
                    continue;
                }
                let Some(leaf) = tree.leaves.get((child - LEAF) as usize) else { continue };
                for k in bits(u64::from(group.meeting(lanes, node, i & 7, depth[i & 7]))) {
                    self.leaf(lanes, leaf, &mut group, &mut pixels[k & 7], k & 7, width);
                }
            }
        }
    }

    /// Looks at the faces of a leaf along the `k`-th line of a group.
    #[inline(always)]
    fn leaf<L: Lanes>(
        &mut self,
        lanes: L,
        leaf: &Faces,
        group: &mut Group,
        (pixel, asked, depth): &mut (u32, Asked, f32),
        k: usize,
        width: u32,
    ) {
        self.tested += WIDE;
        for i in bits(u64::from(group.may_cover(lanes, leaf, k))) {
            self.drawn += 1;
            let place = [*pixel % width, *pixel / width].map(|v| v as usize);
            let Some(there) = self.depth_at(leaf.faces[i & 7], place) else { continue };
            if there < *depth {
                *depth = there;
                let enough = f64::from(there) < asked.any;
                group.lower(k & 7, if enough { -1.0 } else { there });
                if enough {
                    return;
                }
            }
        }
    }

    /// The depth of a face at a pixel, if it covers it, as whole pictures have it.
    #[inline(never)]
    fn depth_at(&self, face: u32, pixel: [usize; 2]) -> Option<f32> {
        let Posed { mesh, lens, .. } = self.posed;
        let corners = mesh.topology.triangles.get(face as usize)?;
        let nowhere = Point { x: 0.0, y: 0.0, nearness: 0.0 };
        let (mut points, mut places) = ([nowhere; 3], [Place::ZERO; 3]);
        for (k, v) in corners.iter().enumerate() {
            (points[k], places[k]) = self.posed.vertex(*v)?;
        }
        let how = (self.size, self.back);
        let nearness = Triangle::nearness_at(&points, places, how, pixel)?;
        Some(depth_of(lens.pinhole, nearness))
    }
}

impl Around {
    /// The children, as bits, whose boxes some line may meet, and that reach before the
    /// limit; and the least depth in each box.
    #[inline(always)]
    fn met<L: Lanes>(&self, lanes: L, node: &Node<3>, depth: &[f32; 4]) -> (u32, [f32; WIDE]) {
        let mut from = lanes.all(0.0);
        let mut to = lanes.all(f32::INFINITY);
        let mut least = lanes.all(depth[3]);
        for axis in 0..3 {
            let first = self.first[axis] & 1;
            let [a, b] = self.inverse[axis].map(|v| lanes.all(v));
            let side = |side: usize| lanes.load(&node.sides[side][axis]);
            let near = lanes.sub(side(first), lanes.all(self.near[axis]));
            let far = lanes.sub(side(1 - first), lanes.all(self.far[axis]));
            let far = lanes.max(lanes.mul(far, a), lanes.mul(far, b));
            from = lanes.max(lanes.min(lanes.mul(near, a), lanes.mul(near, b)), from);
            to = lanes.min(lanes.add(far, lanes.all(self.beyond[axis])), to);
            let factor = depth[axis];
            let reached = lanes.mul(side(usize::from(factor < 0.0)), lanes.all(factor));
            least = lanes.add(least, reached);
        }
        // False where there is no child.
        let met = lanes.at_most(from, to) & lanes.at_most(least, lanes.all(self.limit));
        (met, lanes.numbers(least))
    }
}

impl Group {
    /// Lowers the limit of a line.
    #[inline(always)]
    fn lower(&mut self, k: usize, to: f32) {
        let limits = self.limit.as_mut_array();
        limits[k & 7] = if to < limits[k & 7] { to } else { limits[k & 7] };
        self.around.limit = limits.iter().fold(-1.0, |m, v| if *v > m { *v } else { m });
    }

    /// The lines, as bits, that meet the box of a child with this least depth before their
    /// limits.
    #[inline(always)]
    fn meeting<L: Lanes>(&self, lanes: L, node: &Node<3>, child: usize, least: f32) -> u32 {
        let mut from = lanes.all(0.0);
        let mut to = lanes.all(f32::INFINITY);
        for axis in 0..3 {
            let (origin, inverse) = (lanes.load(&self.from[axis]), lanes.load(&self.inverse[axis]));
            let side = |side: usize| node.sides[side][axis].as_array()[child & 7];
            let low = lanes.sub(lanes.all(side(0) - self.pad), origin);
            let high = lanes.sub(lanes.all(side(1) + self.pad), origin);
            let (low, high) = (lanes.mul(low, inverse), lanes.mul(high, inverse));
            from = lanes.max(lanes.min(low, high), from);
            to = lanes.min(lanes.max(low, high), to);
        }
        lanes.at_most(from, to) & lanes.at_most(lanes.all(least), lanes.load(&self.limit))
    }

    /// The faces, as bits, that the `k`-th line may meet.
    #[inline(always)]
    fn may_cover<L: Lanes>(&self, lanes: L, leaf: &Faces, k: usize) -> u32 {
        let from = self.from.each_ref().map(|row| lanes.all(row.as_array()[k & 7]));
        let way = self.way.map(|row| lanes.all(row[k & 7]));
        let corners = leaf.corners.each_ref().map(|corner| {
            let at = |axis: usize| lanes.sub(lanes.load(&corner[axis]), from[axis]);
            [at(0), at(1), at(2)]
        });
        let slack = lanes.mul(lanes.load(&leaf.size), lanes.all(self.slack[k & 7]));
        let mut least = lanes.all(f32::INFINITY);
        let mut most = lanes.all(f32::NEG_INFINITY);
        for (i, a) in corners.iter().enumerate() {
            // The volume of the edge, the way and the corner.
            let b = &corners[(i + 1) % 3];
            let edge = [0, 1, 2].map(|axis| lanes.sub(b[axis], a[axis]));
            let product = |i: usize, j: usize| {
                lanes.sub(lanes.mul(edge[i], way[j]), lanes.mul(edge[j], way[i]))
            };
            let side = lanes.add(
                lanes.add(lanes.mul(a[0], product(1, 2)), lanes.mul(a[1], product(2, 0))),
                lanes.mul(a[2], product(0, 1)),
            );
            least = lanes.min(least, side);
            most = lanes.max(most, side);
        }
        let below = lanes.sub(lanes.all(0.0), slack);
        lanes.at_most(below, least) | lanes.at_most(most, slack)
    }
}
