//! Vertices in camera and image coordinates, shared by the rasteriser and the extraction
//! of contours.
//!
//! Camera coordinates: x right, y up, z towards the camera, which is at the origin.
//! `nearness` is 1 / depth for a pinhole and -depth for a parallel projection: linear
//! over the image inside a triangle, and larger for nearer points in both.

use crate::geom::{Affine, Mesh, Run, Solid, Topology};
use crate::render::pixels::area::Area;
use crate::render::pixels::place::{Extent, Place, Point, place, rounded, size};
use crate::render::pixels::triangle::Triangle;
use crate::render::simd::vectorised;
use crate::render::{Camera, Projection};
use glam::{DMat3, DVec3, Vec3};

/// Vertices processed at a time: enough that loops over them are not fully unrolled, and
/// few enough for the first-level cache.
const LANES: usize = 64;

/// Vertices with a coordinate beyond this (scene units) are unusable.
pub(in crate::render) const HUGE: f64 = 1e9;

/// A camera's projection from camera coordinates to the image.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Lens {
    pub pinhole: bool,
    /// Focal length in pixels, or pixels per unit.
    pub scale: f64,
    pub cx: f64,
    pub cy: f64,
}

impl Lens {
    pub fn new(camera: &Camera) -> Lens {
        match camera.projection {
            Projection::Pinhole { focal_px, cx, cy } => {
                Lens { pinhole: true, scale: focal_px, cx, cy }
            }
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                Lens { pinhole: false, scale: 1.0 / units_per_pixel, cx, cy }
            }
        }
    }

    /// Projects a point in camera coordinates that is beyond the near plane.
    #[inline(always)]
    pub fn point(&self, p: DVec3) -> Point {
        let depth = -p.z;
        let nearness = if self.pinhole { 1.0 / depth } else { -depth };
        let k = if self.pinhole { self.scale * nearness } else { self.scale };
        Point { x: self.cx + k * p.x, y: self.cy - k * p.y, nearness }
    }

    /// The place and nearness of a point to the right and up at a depth beyond the near plane.
    #[inline(always)]
    fn at<const PINHOLE: bool>(&self, x: f64, y: f64, depth: f64) -> ([f64; 2], f64) {
        let near = if PINHOLE { 1.0 / depth } else { -depth };
        let scale = if PINHOLE { self.scale * near } else { self.scale };
        ([self.cx + scale * x, self.cy - scale * y], near)
    }

    /// Depth from nearness.
    #[inline(always)]
    pub fn depth(&self, nearness: f64) -> f64 {
        if self.pinhole { 1.0 / nearness } else { -nearness }
    }
}

/// The part of a segment in camera coordinates that is beyond the near plane; `None` if
/// there is none.
pub(in crate::render) fn beyond_near([mut from, mut to]: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let near = -Camera::NEAR;
    if from.z > near && to.z > near {
        return None;
    }
    if from.z > near || to.z > near {
        let u = (near - from.z) / (to.z - from.z);
        let mut at = from + (to - from) * u;
        at.z = near;
        *(if from.z > near { &mut from } else { &mut to }) = at;
    }
    Some([from, to])
}

/// The least and the greatest ratio of `a` and `b` over all angles, each `n[0] + n[1]
/// cos(angle) + n[2] sin(angle)`, with `b` above 0: those `t` at which `a - t b` touches 0.
pub(in crate::render) fn ratios(a: &[f64; 3], b: &[f64; 3]) -> [f64; 2] {
    let form = |p: &[f64; 3], q: &[f64; 3]| p[0] * q[0] - p[1] * q[1] - p[2] * q[2];
    let (square, middle, rest) = (form(b, b), form(a, b), form(a, a));
    let root = (middle * middle - square * rest).max(0.0).sqrt();
    [(middle - root) / square, (middle + root) / square]
}

/// The transform from an instance's mesh to camera coordinates.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Placement {
    m: DMat3,
    t: DVec3,
    /// Cofactors of `m` times the sign of its determinant: maps outward normals to
    /// outward normals.
    cofactor: DMat3,
    /// True if the instance is mirrored, which reverses the winding of its faces.
    pub mirrored: bool,
    /// `facing = n . (view - bend * p)` in the mesh's coordinates.
    view: DVec3,
    bend: f64,
}

impl Placement {
    pub fn new(camera: &Camera, affine: &Affine) -> Placement {
        let rotation = DMat3::from_cols(camera.right, camera.up, -camera.forward).transpose();
        let m = rotation * affine.0.matrix3;
        let t = rotation * (affine.0.translation - camera.eye);
        let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
        let determinant = a.dot(b.cross(c));
        let sign = if determinant < 0.0 { -1.0 } else { 1.0 };
        let cofactor = DMat3::from_cols(b.cross(c) * sign, c.cross(a) * sign, a.cross(b) * sign);
        let pinhole = matches!(camera.projection, Projection::Pinhole { .. });
        let (view, bend) = if pinhole {
            (cofactor.transpose() * -t, determinant * sign)
        } else {
            (cofactor.transpose() * DVec3::Z, 0.0)
        };
        Placement { m, t, cofactor, mirrored: sign < 0.0, view, bend }
    }

    /// Transforms a point of the mesh to camera coordinates.
    #[inline(always)]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.m * p + self.t
    }

    /// The linear part and the shift by axis of the camera.
    #[inline(always)]
    pub fn rows(&self) -> [[f64; 4]; 3] {
        let Placement { m, t, .. } = self;
        [0, 1, 2].map(|r| [m.x_axis[r], m.y_axis[r], m.z_axis[r], t[r]])
    }

    /// Transforms a normal of the mesh to camera coordinates: outward, not of unit
    /// length.
    #[inline(always)]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.cofactor * n
    }
}

/// Nearest and farthest depth of the usable vertices beyond the near plane.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct DepthRange {
    pub near: f64,
    pub far: f64,
}

impl Default for DepthRange {
    fn default() -> DepthRange {
        DepthRange::EMPTY
    }
}

impl DepthRange {
    /// The range of no vertices.
    pub const EMPTY: DepthRange = DepthRange { near: f64::INFINITY, far: f64::NEG_INFINITY };

    /// The extent, 0 if there are no vertices.
    pub fn extent(&self) -> f64 {
        (self.far - self.near).max(0.0)
    }

    /// The range of the vertices of both.
    pub fn and(&self, other: &DepthRange) -> DepthRange {
        DepthRange { near: self.near.min(other.near), far: self.far.max(other.far) }
    }
}

/// The vertices of meshes in the image, in single precision: positions are accurate to
/// 1e-7 of their distance from the image's corner, nearness to 1e-7 of itself. Rounded
/// positions ([`Place`]) are computed in double precision. Buffers are reused, so nothing
/// is allocated once they have grown.
#[derive(Default)]
pub(in crate::render) struct Projected {
    x: Vec<f32>,
    y: Vec<f32>,
    nearness: Vec<f32>,
    places: Vec<Place>,
    /// Where the vertices of each mesh end, and whether all of them are usable and beyond
    /// the near plane.
    meshes: Vec<(usize, bool)>,
}

/// The vertices of one mesh in the image.
#[derive(Clone, Copy)]
pub(in crate::render) struct Vertices<'a> {
    x: &'a [f32],
    y: &'a [f32],
    nearness: &'a [f32],
    places: &'a [Place],
    /// True if every vertex is usable and beyond the near plane.
    pub whole: bool,
}

impl Projected {
    /// Forgets all meshes.
    pub fn clear(&mut self) {
        self.meshes.clear();
    }

    /// The vertices of the `i`-th mesh that was added.
    pub fn mesh(&self, i: usize) -> Vertices<'_> {
        let first = i.checked_sub(1).and_then(|i| self.meshes.get(i)).map_or(0, |m| m.0);
        let (past, whole) = self.meshes.get(i).copied().unwrap_or((first, true));
        Vertices {
            x: &self.x[first..past],
            y: &self.y[first..past],
            nearness: &self.nearness[first..past],
            places: &self.places[first..past],
            whole,
        }
    }

    /// Projects the vertices of one mesh and appends them.
    pub fn add(&mut self, mesh: &Mesh, placement: &Placement, lens: &Lens) -> DepthRange {
        let first = self.meshes.last().map_or(0, |m| m.0);
        let needed = first + mesh.positions.len().next_multiple_of(LANES);
        if self.x.len() < needed {
            self.x.resize(needed, 0.0);
            self.y.resize(needed, 0.0);
            self.nearness.resize(needed, 0.0);
            self.places.resize(needed, Place::ZERO);
        }
        let extents = vectorised(
            #[inline(always)]
            || match lens.pinhole {
                true => self.write::<true>(first, &mesh.positions, placement, lens),
                false => self.write::<false>(first, &mesh.positions, placement, lens),
            },
        );
        self.meshes.push((first + mesh.positions.len(), extents.whole));
        DepthRange { near: extents.near, far: extents.far }
    }

    #[inline(always)]
    fn write<const PINHOLE: bool>(
        &mut self,
        first: usize,
        positions: &[Vec3],
        placement: &Placement,
        lens: &Lens,
    ) -> Extents {
        let mut extents = Extents { near: f64::INFINITY, far: f64::NEG_INFINITY, whole: true };
        // Copies, so that the compiler knows that no write changes them.
        let (rows, lens) = (placement.rows(), Lens { pinhole: PINHOLE, ..*lens });
        let lists = groups(&mut self.x[first..])
            .zip(groups(&mut self.y[first..]))
            .zip(groups(&mut self.nearness[first..]))
            .zip(groups(&mut self.places[first..]));
        let vectors = Groups::new(positions);
        for (group, (((x, y), nearness), places)) in vectors.iter().zip(lists) {
            let ([cx, cy, depth], inside) = in_camera(group, &rows);
            if !inside {
                extents.whole = false;
                for i in 0..LANES {
                    let point = extents.odd(&lens, DVec3::new(cx[i], cy[i], -depth[i]));
                    (x[i], y[i], nearness[i]) =
                        (point.x as f32, point.y as f32, point.nearness as f32);
                    places[i] = place(point.x, point.y);
                }
                continue;
            }
            let [mut u, mut v] = [[0.0f32; LANES]; 2];
            for i in 0..LANES {
                let (at, near) = lens.at::<PINHOLE>(cx[i], cy[i], depth[i]);
                (x[i], y[i], nearness[i]) = (at[0] as f32, at[1] as f32, near as f32);
                (u[i], v[i]) = (rounded(at[0]), rounded(at[1]));
            }
            for i in 0..LANES {
                places[i] = Place::new(u[i], v[i], -u[i], -v[i]);
            }
            for depth in depth {
                extents.near = if depth < extents.near { depth } else { extents.near };
                extents.far = if depth > extents.far { depth } else { extents.far };
            }
        }
        extents
    }
}

/// Finds the places of vertices in the picture, to the bits that [`Projected`] has, which are those of
/// single precision. False if some
/// are not usable or not beyond the near plane; then the places are not known.
#[inline(always)]
pub(in crate::render) fn places_of(
    positions: &[Vec3],
    placement: &Placement,
    lens: &Lens,
    out: &mut [[f64; 2]],
) -> bool {
    match lens.pinhole {
        true => write_places::<true>(positions, placement, lens, out),
        false => write_places::<false>(positions, placement, lens, out),
    }
}

#[inline(always)]
fn write_places<const PINHOLE: bool>(
    positions: &[Vec3],
    placement: &Placement,
    lens: &Lens,
    out: &mut [[f64; 2]],
) -> bool {
    let (rows, lens, mut whole) = (placement.rows(), *lens, true);
    for (group, out) in Groups::new(positions).iter().zip(out.chunks_mut(LANES)) {
        let ([cx, cy, depth], inside) = in_camera(group, &rows);
        whole &= inside;
        let mut places = [[0.0; 2]; LANES];
        for i in 0..LANES {
            places[i] = lens.at::<PINHOLE>(cx[i], cy[i], depth[i]).0.map(|v| f64::from(v as f32));
        }
        out.copy_from_slice(&places[..out.len()]);
    }
    whole
}

/// Vertices to the right, up and away from the camera, and whether all are usable and beyond the
/// near plane.
#[inline(always)]
fn in_camera(group: &[Vec3; LANES], rows: &[[f64; 4]; 3]) -> ([[f64; LANES]; 3], bool) {
    let [px, py, pz] = coordinates(group);
    let [mut cx, mut cy, mut depth] = [[0.0; LANES]; 3];
    let mut inside = true;
    for i in 0..LANES {
        let [vx, vy, vz] = rows.map(|[a, b, c, t]| px[i] * a + py[i] * b + pz[i] * c + t);
        // Written so that it is false for NaN.
        inside &= (vx.abs() < HUGE) & (vy.abs() < HUGE) & (vz.abs() < HUGE) & (-vz >= Camera::NEAR);
        (cx[i], cy[i], depth[i]) = (vx, vy, -vz);
    }
    ([cx, cy, depth], inside)
}

/// A list in groups of [`LANES`], without the incomplete last one.
#[inline(always)]
fn groups<T>(list: &mut [T]) -> std::slice::IterMut<'_, [T; LANES]> {
    list.as_chunks_mut().0.iter_mut()
}

/// Depth range and usability of the vertices processed so far.
struct Extents {
    /// Least and greatest depth.
    near: f64,
    far: f64,
    /// True if all are usable and beyond the near plane.
    whole: bool,
}

impl Extents {
    /// Projects a vertex that may be unusable or not beyond the near plane.
    #[inline(never)]
    fn odd(&mut self, lens: &Lens, p: DVec3) -> Point {
        if !(p.x.abs() < HUGE && p.y.abs() < HUGE && p.z.abs() < HUGE) {
            return Point { x: 0.0, y: 0.0, nearness: f64::NAN };
        }
        if -p.z < Camera::NEAR {
            return Point { x: 0.0, y: 0.0, nearness: f64::INFINITY };
        }
        self.near = self.near.min(-p.z);
        self.far = self.far.max(-p.z);
        lens.point(p)
    }
}

impl Vertices<'_> {
    /// The number of vertices.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// The rounded positions of a triangle's corners; `None` if a vertex does not exist.
    #[inline(always)]
    pub fn places(&self, corners: &[u32; 3]) -> Option<[Place; 3]> {
        match corners.map(|v| self.places.get(v as usize)) {
            [Some(a), Some(b), Some(c)] => Some([*a, *b, *c]),
            _ => None,
        }
    }

    /// Width plus height of the bounding box of some vertices, in pixels.
    pub fn span(&self, of: impl Iterator<Item = u32>) -> f32 {
        let places = of.filter_map(|v| self.places.get(v as usize));
        span_of(places.fold(Place::INFINITY, |a, b| a.min(*b)))
    }

    /// The least coordinates of the rounded positions in some runs.
    #[inline(always)]
    pub fn least(&self, of: &[Run]) -> Place {
        let places = of.iter().filter_map(|run| self.places.get(run.range())).flatten();
        places.fold(Place::INFINITY, |a, b| a.min(*b))
    }

    /// The least coordinates of all rounded positions.
    pub fn least_of_all(&self) -> Place {
        self.places.iter().fold(Place::INFINITY, |a, b| a.min(*b))
    }

    /// All pixels that the mesh can cover. The whole image if only some of the vertices are
    /// usable and beyond the near plane.
    pub fn area(&self, camera: &Camera) -> Area {
        if !self.whole {
            let any = (0..self.len() as u32).any(|v| self.point(v).nearness < f64::INFINITY);
            return if any { Area::whole(camera) } else { Area::default() };
        }
        let extent = Extent::between(self.least_of_all(), size(camera.width, camera.height));
        if self.len() == 0 || extent.is_empty() {
            return Area::default();
        }
        let [[left, right], [top, bottom]] = extent.ends();
        Area { left, right, top, bottom }
    }

    /// True if the whole mesh is behind the camera, or beside the picture by at least
    /// half a pixel, so that it covers no pixel and has no contours there.
    pub fn outside(&self, camera: &Camera) -> bool {
        if !self.whole {
            return self.nearness.iter().all(|n| *n == f32::INFINITY);
        }
        let [left, top, right, bottom] = self.least_of_all().to_array();
        let (width, height) = (camera.width as f32, camera.height as f32);
        left > width || top > height || -right < -1.0 || -bottom < -1.0
    }

    /// Sets up a triangle to be drawn; `None` as for [`Triangle::new`].
    #[inline(always)]
    pub fn triangle(
        &self,
        topology: &Topology,
        face: u32,
        extent: Extent,
        back: f64,
    ) -> Option<Triangle> {
        let corners = topology.triangles.get(face as usize)?;
        Triangle::new(corners.map(|v| self.point(v)), self.places(corners)?, extent, back)
    }

    /// The corners of a triangle in the image.
    #[inline(always)]
    pub fn corners(&self, topology: &Topology, face: u32) -> [Point; 3] {
        let corners = topology.triangles.get(face as usize).copied().unwrap_or_default();
        corners.map(|v| self.point(v))
    }

    /// A vertex in the image. If it cannot be drawn, its nearness is infinite (not beyond
    /// the near plane) or NaN (unusable).
    #[inline(always)]
    pub fn point(&self, v: u32) -> Point {
        let at = |list: &[f32]| list.get(v as usize).map_or(f64::NAN, |x| f64::from(*x));
        Point { x: at(self.x), y: at(self.y), nearness: at(self.nearness) }
    }
}

/// Width plus height of the bounding box of rounded positions with these least coordinates.
pub(in crate::render) fn span_of(least: Place) -> f32 {
    -(least.x + least.y + least.z + least.w)
}

/// Projects every vertex of a solid, instance by instance.
pub(in crate::render) fn project(
    solid: &Solid,
    camera: &Camera,
    out: &mut Projected,
) -> DepthRange {
    out.clear();
    let lens = Lens::new(camera);
    solid.instances().iter().fold(DepthRange::EMPTY, |range, instance| {
        range.and(&out.add(&instance.mesh, &Placement::new(camera, &instance.affine), &lens))
    })
}

/// Which vertices of a mesh face the camera. Reused from mesh to mesh.
#[derive(Default)]
pub(in crate::render) struct Fronts {
    /// Positive where the outward normal points towards the camera, zero where it is
    /// perpendicular to the line of sight; linear in the position.
    pub facing: Vec<f64>,
    /// 1 where `facing` is not negative, else 0; has [`Run::MOST`] more entries than
    /// vertices.
    pub front: Vec<u8>,
}

impl Fronts {
    /// Computes both for a mesh.
    pub fn find(&mut self, mesh: &Mesh, placement: &Placement) {
        let Fronts { facing, front } = self;
        let count = mesh.positions.len().min(mesh.normals.len());
        let room = count.next_multiple_of(LANES);
        facing.resize(room, 0.0);
        front.resize(room + LANES, 0);
        let Placement { view, bend, .. } = *placement;
        vectorised(
            #[inline(always)]
            || {
                let (p, n) =
                    (Groups::new(&mesh.positions[..count]), Groups::new(&mesh.normals[..count]));
                for ((p, n), (facing, front)) in
                    p.iter().zip(n.iter()).zip(groups(facing).zip(groups(front)))
                {
                    let ([px, py, pz], [nx, ny, nz]) = (coordinates(p), coordinates(n));
                    for i in 0..LANES {
                        facing[i] = nx[i] * (view.x - px[i] * bend)
                            + ny[i] * (view.y - py[i] * bend)
                            + nz[i] * (view.z - pz[i] * bend);
                    }
                    for i in 0..LANES {
                        front[i] = u8::from(facing[i] >= 0.0);
                    }
                }
            },
        );
        facing.truncate(count);
        front.truncate(count + Run::MOST);
    }
}

/// Vectors in groups of [`LANES`], the last group padded with its last vector.
struct Groups<'a> {
    whole: &'a [[Vec3; LANES]],
    last: [Vec3; LANES],
    count: usize,
}

impl<'a> Groups<'a> {
    #[inline(always)]
    fn new(vectors: &'a [Vec3]) -> Groups<'a> {
        let (whole, tail) = vectors.as_chunks();
        let mut last = [tail.last().copied().unwrap_or_default(); LANES];
        last[..tail.len()].copy_from_slice(tail);
        Groups { whole, last, count: whole.len() + usize::from(!tail.is_empty()) }
    }

    #[inline(always)]
    fn iter(&self) -> impl Iterator<Item = &[Vec3; LANES]> {
        (0..self.count).map(|i| self.whole.get(i).unwrap_or(&self.last))
    }
}

/// The coordinates of vectors as one array per axis, in double precision.
#[inline(always)]
fn coordinates(vectors: &[Vec3; LANES]) -> [[f64; LANES]; 3] {
    let mut out = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let v = vectors[i];
        (out[0][i], out[1][i], out[2][i]) = (f64::from(v.x), f64::from(v.y), f64::from(v.z));
    }
    out
}
