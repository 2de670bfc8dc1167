//! Smooth silhouettes: in each face that they cross, the zero set of the (interpolated)
//! facing, for many faces at a time.

use crate::geom::{Mesh, Patches, Run, Topology};
use crate::render::lines::visibility::{BESIDE, LONGEST};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Lens, Placement, Vertices, beyond_near};
use glam::DVec3;

/// The last faces of a mesh are processed in a multiple of this many.
const FEW: usize = 16;
/// Faces processed at a time: a compile-time constant, so that loops over them are
/// vectorised.
pub(in crate::render) const MOST: usize = 64;

/// As many bytes as the longest run has vertices, each 1.
const EACH: u128 = u128::MAX / 255;

/// A number for each face.
type Row = [f64; MOST];

/// The faces that silhouettes cross, and the segment in each. Reused from mesh to mesh.
#[derive(Default)]
pub(in crate::render) struct Crossed {
    faces: Vec<u32>,
    count: usize,
    batch: Batch,
}

/// Segments of silhouettes in the image, for a batch of faces. Pairs are the two ends,
/// triples of rows the axes.
pub(in crate::render) struct Batch {
    /// The vertices of each face; the sign of facing of the first one differs from the
    /// others'.
    pub corners: [[u32; 3]; MOST],
    /// True if there is a segment.
    pub there: [bool; MOST],
    /// Where the ends lie along the sides from the first corner, as fractions.
    pub shares: [Row; 2],
    /// The ends in the image: x, y, nearness.
    pub ends: [[Row; 3]; 2],
    /// In pixels.
    pub length: Row,
    /// Unit vector along the segment, oriented so that outward lies to its left.
    pub tangent: [Row; 2],
    /// Unit vector away from the surface.
    pub outward: [Row; 2],
    /// How much nearer than the silhouette the face reaches, in scene units.
    pub slack: Row,
    /// Midpoint of the ends in the image.
    pub middle: [Row; 2],
    /// Depth there, in scene units.
    pub depth: Row,
    /// Position, normal and facing of the corners in the mesh's coordinates, and the
    /// corners in the image.
    positions: [[Row; 3]; 3],
    normals: [[Row; 3]; 3],
    facing: [Row; 3],
    image: [[Row; 3]; 3],
    /// Ends and normal in camera coordinates.
    camera: [[Row; 3]; 2],
    normal: [Row; 3],
}

impl Default for Batch {
    fn default() -> Batch {
        let three = [[0.0; MOST]; 3];
        Batch {
            corners: [[0; 3]; MOST],
            there: [false; MOST],
            shares: [[0.0; MOST]; 2],
            ends: [three; 2],
            length: [0.0; MOST],
            tangent: [[0.0; MOST]; 2],
            outward: [[0.0; MOST]; 2],
            slack: [0.0; MOST],
            middle: [[0.0; MOST]; 2],
            depth: [0.0; MOST],
            positions: [three; 3],
            normals: [three; 3],
            facing: three,
            image: [three; 3],
            camera: [three; 2],
            normal: three,
        }
    }
}

/// Where the segments of a batch are tested for visibility.
pub(in crate::render) struct Located {
    /// True if a segment is a single piece: short and wholly inside of the image.
    pub single: [bool; MOST],
    /// On the outer and the inner side: the pixel nearest to the position tested, and whether
    /// it contains it. The inner side only if both are tested.
    pub pixels: [[u32; MOST]; 2],
    pub inside: [[bool; MOST]; 2],
}

impl Located {
    /// For the first `count` segments in an image of some size.
    #[inline(always)]
    pub fn new(batch: &Batch, count: usize, [width, height]: [f64; 2], both: bool) -> Located {
        let mut located =
            Located { single: [false; MOST], pixels: [[0; MOST]; 2], inside: [[false; MOST]; 2] };
        let Batch { ends: [from, to], length, middle, outward, depth, .. } = batch;
        let (last, across) = ([width - 1.0, height - 1.0], width as i32);
        // NaN becomes 0.
        let index = |v: f64, last: f64| {
            let v = if v > 0.0 { v } else { 0.0 };
            (if v < last { v } else { last }) as i32
        };
        for start in (0..count.min(MOST)).step_by(FEW) {
            for i in start..start + FEW {
                let within = |end: &[Row; 3]| {
                    (end[0][i] >= 0.0)
                        & (end[1][i] >= 0.0)
                        & (end[0][i] <= width)
                        & (end[1][i] <= height)
                };
                located.single[i] = (length[i] < LONGEST)
                    & within(from)
                    & within(to)
                    & (depth[i].abs() < f64::INFINITY);
            }
            for (side, sign) in [(0, BESIDE), (1, -BESIDE)] {
                if side == 1 && !both {
                    continue;
                }
                for i in start..start + FEW {
                    let x = middle[0][i] + sign * outward[0][i];
                    let y = middle[1][i] + sign * outward[1][i];
                    located.inside[side][i] = (x >= 0.0) & (y >= 0.0) & (x < width) & (y < height);
                    located.pixels[side][i] =
                        index(y, last[1]).wrapping_mul(across).wrapping_add(index(x, last[0]))
                            as u32;
                }
            }
        }
        located
    }
}

impl Crossed {
    /// Calls `out` with the segments in all faces of a mesh, batch by batch in the order
    /// of the faces, and the number of faces in each batch. By vertex, `facing` is given,
    /// and in `front` whether it is not negative.
    #[inline(always)]
    pub fn each(
        &mut self,
        mesh: &Mesh,
        placement: &Placement,
        lens: &Lens,
        vertices: &Vertices<'_>,
        (facing, front): (&[f64], &[u8]),
        mut out: impl FnMut(&Batch, usize),
    ) {
        self.find(&mesh.topology, front);
        let Crossed { faces, count, batch } = self;
        for faces in faces[..*count].chunks(MOST) {
            for (i, face) in faces.iter().enumerate() {
                let Some(face) = mesh.topology.triangles.get(*face as usize) else { continue };
                batch.set(i, first_odd(face, front), mesh, vertices, facing);
            }
            let (count, whole) = (faces.len(), vertices.whole);
            match count.div_ceil(FEW) {
                1 => batch.work::<FEW>(placement, lens, count, whole),
                2 => batch.work::<{ 2 * FEW }>(placement, lens, count, whole),
                3 => batch.work::<{ 3 * FEW }>(placement, lens, count, whole),
                _ => batch.work::<MOST>(placement, lens, count, whole),
            }
            out(batch, faces.len());
        }
    }

    /// Finds the faces whose corners do not all have the same sign of facing.
    #[inline(always)]
    fn find(&mut self, topology: &Topology, front: &[u8]) {
        let (triangles, patches) = (&topology.triangles, topology.patches.of(&topology.triangles));
        if self.faces.len() < triangles.len() {
            self.faces.resize(triangles.len(), 0);
        }
        let faces = &mut self.faces[..];
        let mut count = 0;
        for (i, (patch, triangles)) in patches.zip(triangles.chunks(Patches::FACES)).enumerate() {
            let (mut some, mut all) = (false, true);
            for run in patch {
                let Some(bytes) = front.get(run.first..).and_then(|front| front.first_chunk())
                else {
                    continue;
                };
                let wanted = EACH >> (8 * (Run::MOST - run.count));
                let own = u128::from_le_bytes(*bytes) & wanted;
                (some, all) = (some | (own != 0), all & (own == wanted));
            }
            if some == all {
                continue;
            }
            for (face, corners) in (i * Patches::FACES..).zip(triangles) {
                let [Some(&a), Some(&b), Some(&c)] = corners.map(|v| front.get(v as usize)) else {
                    continue;
                };
                // Written to an entry that the next face overwrites unless this one
                // counts: a branch would be unpredictable.
                if let Some(place) = faces.get_mut(count) {
                    *place = face as u32;
                }
                count += usize::from((a ^ b) | (a ^ c) != 0);
            }
        }
        self.count = count;
    }
}

/// The corners of a face, beginning with the one whose sign differs from the two others.
#[inline(always)]
fn first_odd(&[a, b, c]: &[u32; 3], front: &[u8]) -> [u32; 3] {
    let front = |v: u32| front.get(v as usize).copied().unwrap_or_default();
    match (front(a) == front(b), front(a) == front(c)) {
        (true, _) => [c, a, b],
        (false, true) => [b, c, a],
        (false, false) => [a, b, c],
    }
}

impl Batch {
    /// The two ends of a segment in the image.
    #[inline(always)]
    pub fn segment(&self, i: usize) -> [Point; 2] {
        self.ends.each_ref().map(|[x, y, nearness]| Point {
            x: x[i],
            y: y[i],
            nearness: nearness[i],
        })
    }

    /// The same ends as weights of the corners.
    #[inline(always)]
    pub fn weights(&self, i: usize) -> [[f64; 3]; 2] {
        let [u, v] = [self.shares[0][i], self.shares[1][i]];
        [[1.0 - u, u, 0.0], [1.0 - v, 0.0, v]]
    }

    #[inline(always)]
    fn set(
        &mut self,
        i: usize,
        corners: [u32; 3],
        mesh: &Mesh,
        vertices: &Vertices<'_>,
        facing: &[f64],
    ) {
        self.corners[i] = corners;
        for (k, v) in corners.into_iter().enumerate() {
            let [p, n] = [&mesh.positions[..], &mesh.normals]
                .map(|list| list.get(v as usize).copied().unwrap_or_default().as_dvec3());
            for axis in 0..3 {
                (self.positions[k][axis][i], self.normals[k][axis][i]) = (p[axis], n[axis]);
            }
        }
        for (k, v) in corners.into_iter().enumerate() {
            let (at, point) = (v as usize, vertices.point(v));
            [self.image[k][0][i], self.image[k][1][i], self.image[k][2][i]] =
                [point.x, point.y, point.nearness];
            self.facing[k][i] = facing.get(at).copied().unwrap_or_default();
        }
    }

    /// Computes the segments in the first `N` faces, of which `count` are set; `whole` if
    /// all of the mesh is beyond the near plane.
    #[inline(always)]
    fn work<const N: usize>(
        &mut self,
        placement: &Placement,
        lens: &Lens,
        count: usize,
        whole: bool,
    ) {
        self.cross::<N>(placement);
        if !whole {
            self.cut(count);
        }
        if lens.pinhole {
            self.draw::<N, true>(lens)
        } else {
            self.draw::<N, false>(lens)
        }
        if !whole {
            self.no_slack_behind(count);
        }
    }

    /// Computes where the silhouettes cross the sides of the faces, in camera
    /// coordinates.
    #[inline(always)]
    fn cross<const N: usize>(&mut self, placement: &Placement) {
        let placement = *placement;
        let Batch { positions: [p, q, r], normals: [l, m, n], facing: [f, g, h], .. } = self;
        let (shares, camera, normal) = (&mut self.shares, &mut self.camera, &mut self.normal);
        for i in 0..N {
            let (u, v) = (f[i] / (f[i] - g[i]), f[i] / (f[i] - h[i]));
            let vector = |rows: &[Row; 3]| DVec3::new(rows[0][i], rows[1][i], rows[2][i]);
            let (p, q, r) = (vector(p), vector(q), vector(r));
            let (l, m, n) = (vector(l), vector(m), vector(n));
            let from = placement.point(p + (q - p) * u);
            let to = placement.point(p + (r - p) * v);
            let out = placement.normal(l * 2.0 + (m - l) * u + (n - l) * v);
            (shares[0][i], shares[1][i]) = (u, v);
            for axis in 0..3 {
                camera[0][axis][i] = from[axis];
                camera[1][axis][i] = to[axis];
                normal[axis][i] = out[axis];
            }
            self.there[i] = true;
        }
    }

    /// Cuts the segments at the near plane.
    #[inline(never)]
    fn cut(&mut self, count: usize) {
        for i in 0..count {
            let nearness = self.image.each_ref().map(|at| at[2][i]);
            let seen =
                nearness.iter().any(|n| *n < f64::INFINITY) && !nearness.iter().any(|n| n.is_nan());
            let ends =
                self.camera.each_ref().map(|end| DVec3::new(end[0][i], end[1][i], end[2][i]));
            let part = beyond_near(ends).filter(|_| seen);
            self.there[i] = part.is_some();
            for (end, at) in self.camera.iter_mut().zip(part.unwrap_or(ends)) {
                [end[0][i], end[1][i], end[2][i]] = at.to_array();
            }
        }
    }

    /// Projects the segments into the image.
    #[inline(always)]
    fn draw<const N: usize, const PINHOLE: bool>(&mut self, lens: &Lens) {
        let lens = Lens { pinhole: PINHOLE, ..*lens };
        let Batch {
            camera,
            normal,
            image,
            ends,
            length,
            tangent,
            outward,
            slack,
            middle,
            depth,
            there,
            ..
        } = self;
        for i in 0..N {
            let [a, b] = camera
                .each_ref()
                .map(|end| lens.point(DVec3::new(end[0][i], end[1][i], end[2][i])));
            let (dx, dy) = (b.x - a.x, b.y - a.y);
            let long = (dx * dx + dy * dy).sqrt();
            let (tx, ty) = (dx / long, dy / long);
            // The plane through the camera with this normal cuts the image in a line
            // perpendicular to the normal's (x, y).
            let (nx, ny) = (normal[0][i], normal[1][i]);
            let size = (nx * nx + ny * ny).sqrt();
            let sound = size > 1e-12;
            let (ox, oy) =
                (if sound { nx / size } else { ty }, if sound { -ny / size } else { -tx });
            let steep = if long > 0.02 { (b.nearness - a.nearness) / long } else { 0.0 };
            let ahead = image.each_ref().map(|[x, y, nearness]| {
                nearness[i] - a.nearness - steep * ((x[i] - a.x) * tx + (y[i] - a.y) * ty)
            });
            let most = ahead.into_iter().fold(0.0, |m, x| if x > m { x } else { m });
            slack[i] = if PINHOLE { most / (a.nearness * a.nearness) } else { most };
            let way = if ty * ox - tx * oy < 0.0 { -1.0 } else { 1.0 };
            for (end, point) in ends.iter_mut().zip([a, b]) {
                (end[0][i], end[1][i], end[2][i]) = (point.x, point.y, point.nearness);
            }
            (middle[0][i], middle[1][i]) = (a.x + dx * 0.5, a.y + dy * 0.5);
            depth[i] = lens.depth(a.nearness + (b.nearness - a.nearness) * 0.5);
            length[i] = long;
            (tangent[0][i], tangent[1][i]) = (way * tx, way * ty);
            (outward[0][i], outward[1][i]) = (ox, oy);
        }
        for i in 0..N {
            there[i] &= (length[i] > 1e-9) & (length[i] < f64::INFINITY);
        }
    }

    /// Clears the slack of faces that are not all beyond the near plane: it is not known
    /// how near they come.
    fn no_slack_behind(&mut self, count: usize) {
        for i in 0..count {
            if !self.image.iter().all(|at| at[2][i] < f64::INFINITY) {
                self.slack[i] = 0.0;
            }
        }
    }
}
