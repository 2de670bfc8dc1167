//! The pieces of contour of one mesh, hidden or not: silhouettes, creases and boundaries,
//! clipped to the image.
//!
//! The other meshes of the solid and the depth image are not used; `visibility` decides
//! which pieces are visible. Invariant: every piece is finite, inside the image, at most
//! 1.5 pixels long, and a function of mesh, placement and camera alone.

use crate::geom::{Edge, Mesh};
use crate::render::Camera;
use crate::render::lines::silhouette::{self, Crossed};
use crate::render::lines::visibility::{Image, Piece, TestSides};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Fronts, Lens, Placement, Vertices, beyond_near};
use crate::render::rigid::Posed;
use crate::render::rigid::crossed::Found;
use crate::render::simd::vectorised;

/// The vertices of a mesh in the image, all of them or each when it is asked for.
pub(in crate::render) trait Points {
    /// A vertex, as [`Vertices::point`].
    fn point(&self, v: u32) -> Point;

    /// Whether a whole line of edges is too small to be seen, as its width plus height is
    /// less than [`SPECK`].
    fn is_speck(&self, line: &[Edge]) -> bool;
}

impl Points for Vertices<'_> {
    #[inline(always)]
    fn point(&self, v: u32) -> Point {
        Vertices::point(self, v)
    }

    fn is_speck(&self, line: &[Edge]) -> bool {
        self.whole && self.span(line.iter().flat_map(|e| e.vertices)) < SPECK
    }
}

/// Whether a point is usable and beyond the near plane.
fn usable(p: &Point) -> bool {
    p.nearness < f64::INFINITY
}

/// Where on the surface a piece comes from: a fraction of a segment between two points of
/// a face or edge. [`crate::render::derivatives::silhouette_derivative`] describes how silhouettes move
/// besides following these points.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Origin {
    /// Vertices of the mesh; for an edge, the second one twice.
    pub corners: [u32; 3],
    /// The segment's ends, as weights of the corners.
    pub ends: [[f64; 3]; 2],
    /// The position of the piece's middle on the segment's image, 0 at the first end and
    /// 1 at the second.
    pub at: f64,
    /// The fraction of the segment's image that the piece covers.
    pub share: f64,
    /// Whether the piece's tangent goes from the segment's first end to its second.
    pub forward: bool,
}

/// Scratch memory for the extraction. Reused from mesh to mesh.
#[derive(Default)]
pub(in crate::render) struct Room {
    fronts: Fronts,
    crossed: Crossed,
    /// Of meshes that keep their shape.
    pub found: Found,
}

/// Calls `out` for every piece of a mesh, in the order of its faces and then its edges.
/// `vertices` are the mesh's own in the image.
pub(in crate::render) fn extract_mesh(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    Room { fronts, crossed, .. }: &mut Room,
    out: impl FnMut(Piece, &Origin),
) {
    let Some(image) = Image::new(camera.width, camera.height) else { return };
    let size = [f64::from(camera.width), f64::from(camera.height)];
    fronts.find(mesh, placement);
    let lens = Lens::new(camera);
    let open = is_open(mesh, vertices);
    let mut tracer = Extractor { mesh, placement, vertices, open, lens, image, size, out };
    let signs = (&fronts.facing[..], &fronts.front[..]);
    vectorised(
        #[inline(always)]
        || {
            crossed.each(mesh, placement, &lens, vertices, signs, |batch, count| {
                tracer.silhouettes(batch, count)
            })
        },
    );
    tracer.edges();
}

/// As [`extract_mesh`] for a mesh that keeps its shape.
pub(in crate::render) fn extract_posed(
    posed: &Posed<'_>,
    camera: &Camera,
    Room { crossed, found, .. }: &mut Room,
    out: impl FnMut(Piece, &Origin),
) {
    let Some(image) = Image::new(camera.width, camera.height) else { return };
    let size = [f64::from(camera.width), f64::from(camera.height)];
    let (lens, Posed { mesh, placement, .. }) = (Lens::new(camera), posed);
    let open = is_open(mesh, posed);
    let mut tracer = Extractor { mesh, placement, vertices: posed, open, lens, image, size, out };
    vectorised(
        #[inline(always)]
        || {
            found.find(posed);
            crossed.each_of(&found.corners, mesh, placement, &lens, |batch, count| {
                tracer.silhouettes(batch, count)
            })
        },
    );
    tracer.edges();
}

/// Whether a mesh has boundaries through which something can be seen, unlike holes that
/// are too small to be visible.
fn is_open(mesh: &Mesh, vertices: &impl Points) -> bool {
    let edges = &mesh.topology.edges;
    let hole =
        |line: &[Edge]| line.first().is_some_and(Edge::is_boundary) && !vertices.is_speck(line);
    edges.open() && edges.lines().any(hole)
}

/// Lines of edges, such as the rims of holes, are left out if their width plus height is
/// less than this, in pixels.
pub(in crate::render) const SPECK: f32 = 0.1;

/// Segments of this length or longer, in pixels, are divided.
pub(in crate::render) const LONGEST: f64 = 1.5;

/// A segment's corners and ends, as in [`Origin`].
type Segment = ([u32; 3], [[f64; 3]; 2]);

struct Extractor<'a, V, F> {
    mesh: &'a Mesh,
    placement: &'a Placement,
    vertices: &'a V,
    /// Whether the mesh has visible boundaries, so that the insides of faces may be
    /// visible.
    open: bool,
    lens: Lens,
    image: Image,
    /// Pixels across and down.
    size: [f64; 2],
    out: F,
}

impl<V: Points, F: FnMut(Piece, &Origin)> Extractor<'_, V, F> {
    /// Makes the pieces of a batch of silhouettes.
    #[inline(always)]
    fn silhouettes(&mut self, batch: &silhouette::Batch, count: usize) {
        for i in 0..count.min(silhouette::MOST) {
            if !batch.there[i] {
                continue;
            }
            let ([a, b], length) = (batch.segment(i), batch.length[i]);
            let [tangent, direction, middle] = [&batch.tangent, &batch.outward, &batch.middle]
                .map(|pair| [pair[0][i], pair[1][i]]);
            let slack = batch.slack[i];
            let look = match self.open {
                false => TestSides::Outward { direction, slack },
                true => TestSides::BothSides { direction, slack: [slack; 2] },
            };
            if length < LONGEST && self.inside(&a) && self.inside(&b) && batch.depth[i].is_finite()
            {
                // Nearly all segments are a single piece.
                let piece = self.image.piece(middle, batch.depth[i], tangent, length, &look, false);
                let (corners, ends) = (batch.corners[i], batch.weights(i));
                let forward = (b.x - a.x) * tangent[0] + (b.y - a.y) * tangent[1] > 0.0;
                (self.out)(piece, &Origin { corners, ends, at: 0.5, share: 1.0, forward });
            } else {
                self.cut(
                    &a,
                    &b,
                    length,
                    tangent,
                    &look,
                    false,
                    (batch.corners[i], batch.weights(i)),
                );
            }
        }
    }

    /// Makes the pieces of creases and boundaries.
    fn edges(&mut self) {
        for line in self.mesh.topology.edges.lines() {
            if !self.vertices.is_speck(line) {
                line.iter().for_each(|edge| self.edge(edge.vertices, edge.faces));
            }
        }
    }

    /// Makes the pieces of a crease or boundary edge.
    fn edge(&mut self, vertices: [u32; 2], faces: [u32; 2]) {
        let Extractor { mesh, placement, vertices: points, open, .. } = *self;
        let [Some(from), Some(to)] = vertices.map(|v| mesh.positions.get(v as usize)) else {
            return;
        };
        let ends = vertices.map(|v| points.point(v));
        if ends.iter().any(|p| p.nearness.is_nan()) || !ends.iter().any(usable) {
            return;
        }
        let segment = beyond_near([from, to].map(|p| placement.point(p.as_dvec3())));
        let Some([a, b]) = segment.map(|ends| ends.map(|p| self.lens.point(p))) else { return };
        let Some([tx, ty, length]) = tangent(&a, &b) else { return };
        let direction = [ty, -tx];
        let steep = (b.nearness - a.nearness) / length;
        let mut slack = [0.0f64; 2];
        let (mut any_front, mut side) = (false, 0.0f64);
        for face in faces {
            let Some(face) = mesh.topology.triangles.get(face as usize) else { continue };
            // The corner opposite to the edge; the vertices of a crease are split, so
            // positions are compared.
            let opposite = face
                .iter()
                .find(|&&v| mesh.positions.get(v as usize).is_some_and(|p| p != from && p != to));
            let Some(&opposite) = opposite else { continue };
            let corners = face.map(|v| placement.point(mesh.positions[v as usize].as_dvec3()));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let towards = if self.lens.pinhole { -normal.dot(corners[0]) } else { normal.z };
            let front = (towards > 0.0) != placement.mirrored;
            any_front |= front;
            let p = points.point(opposite);
            if !usable(&p) {
                continue;
            }
            let away = (p.x - a.x) * direction[0] + (p.y - a.y) * direction[1];
            if front || open {
                side -= away.signum();
                if away.abs() > 1e-3 {
                    let along = (p.x - a.x) * tx + (p.y - a.y) * ty;
                    let per_pixel = (p.nearness - a.nearness - steep * along) / away.abs();
                    let i = usize::from(away < 0.0);
                    slack[i] = slack[i].max(self.in_depth(2.0 * per_pixel, &a));
                }
            }
        }
        if any_front || open {
            let look = TestSides::BothSides { direction, slack };
            let corners = [vertices[0], vertices[1], vertices[1]];
            let ends = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
            self.cut(
                &a,
                &b,
                length,
                if side < 0.0 { [-tx, -ty] } else { [tx, ty] },
                &look,
                true,
                (corners, ends),
            );
        }
    }

    /// Converts a difference of nearness at a point to a difference of depth, at least 0.
    fn in_depth(&self, nearness: f64, at: &Point) -> f64 {
        let depth =
            if self.lens.pinhole { nearness / (at.nearness * at.nearness) } else { nearness };
        depth.max(0.0)
    }

    /// Whether a point is in the image.
    #[inline(always)]
    fn inside(&self, p: &Point) -> bool {
        p.x >= 0.0 && p.y >= 0.0 && p.x <= self.size[0] && p.y <= self.size[1]
    }

    /// Clips a segment to the image and divides it into pieces.
    #[allow(clippy::too_many_arguments)]
    fn cut(
        &mut self,
        a: &Point,
        b: &Point,
        length: f64,
        tangent: [f64; 2],
        look: &TestSides,
        edge: bool,
        from: Segment,
    ) {
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let part = if self.inside(a) && self.inside(b) {
            Some((0.0, 1.0))
        } else {
            clip(a, [dx, dy], self.size)
        };
        let Some((t0, t1)) = part else { return };
        let length = length * (t1 - t0);
        if !(length > 1e-9 && length.is_finite()) {
            return;
        }
        let pieces = if length < LONGEST { 1.0 } else { (length + 0.5).floor() };
        let step = (t1 - t0) / pieces;
        let forward = dx * tangent[0] + dy * tangent[1] > 0.0;
        for i in 0..pieces as usize {
            let t = t0 + step * (i as f64 + 0.5);
            let at = [a.x + dx * t, a.y + dy * t];
            let depth = self.lens.depth(a.nearness + (b.nearness - a.nearness) * t);
            if depth.is_finite() {
                let origin = Origin { corners: from.0, ends: from.1, at: t, share: step, forward };
                (self.out)(
                    self.image.piece(at, depth, tangent, length / pieces, look, edge),
                    &origin,
                );
            }
        }
    }
}

/// Unit direction and length in pixels; `None` for a segment too short or too long to
/// have one.
fn tangent(a: &Point, b: &Point) -> Option<[f64; 3]> {
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let length = (dx * dx + dy * dy).sqrt();
    (length > 1e-9 && length.is_finite()).then(|| [dx / length, dy / length, length])
}

/// The part of `a + t d`, t in 0..1, inside the image (Liang and Barsky 1984).
pub(in crate::render) fn clip(a: &Point, d: [f64; 2], size: [f64; 2]) -> Option<(f64, f64)> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for (start, delta, limit) in [(a.x, d[0], size[0]), (a.y, d[1], size[1])] {
        if delta == 0.0 {
            if start < 0.0 || start > limit {
                return None;
            }
            continue;
        }
        let (u, v) = (-start / delta, (limit - start) / delta);
        t0 = t0.max(u.min(v));
        t1 = t1.min(u.max(v));
    }
    (t0 < t1).then_some((t0, t1))
}
