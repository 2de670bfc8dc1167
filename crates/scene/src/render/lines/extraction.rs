//! The pieces of contour of one mesh, hidden or not: silhouettes, creases and boundaries,
//! clipped to the image.
//!
//! The other meshes of the solid and the depth image are not used; `visibility` decides
//! which pieces are visible. Invariant: every piece is finite, inside the image, at most
//! 1.5 pixels long, and a function of mesh, placement and camera alone.

use crate::geom::{Edge, Mesh};
use crate::render::Camera;
use crate::render::lines::silhouette::{self, Crossed};
use crate::render::lines::visibility::{Image, LONGEST, Piece, TestSides};
use crate::render::pixels::place::Point;
use crate::render::pixels::project::{Fronts, Lens, Placement, Vertices, beyond_near};
use crate::render::simd::vectorised;

/// The vertices of a mesh in the image, all of them or each when it is asked for.
pub(in crate::render) trait Points {
    /// A vertex, as [`Vertices::point`].
    fn point(&self, v: u32) -> Point;

    /// True if all vertices are usable and beyond the near plane.
    fn whole(&self) -> bool;

    /// True if a whole line of edges is too small to be seen, as its width plus height is
    /// less than [`SPECK`].
    fn is_speck(&self, line: &[Edge]) -> bool;
}

impl Points for Vertices<'_> {
    #[inline(always)]
    fn point(&self, v: u32) -> Point {
        Vertices::point(self, v)
    }

    #[inline(always)]
    fn whole(&self) -> bool {
        self.whole
    }

    fn is_speck(&self, line: &[Edge]) -> bool {
        self.whole && self.span(line.iter().flat_map(|e| e.vertices)) < SPECK
    }
}

/// True if a point is usable and beyond the near plane.
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
    /// True if the piece's tangent goes from the segment's first end to its second.
    pub forward: bool,
}

/// Scratch memory for the extraction. Reused from mesh to mesh.
#[derive(Default)]
pub(in crate::render) struct Room {
    fronts: Fronts,
    pub crossed: Crossed,
}

/// Calls `out` for every piece of a mesh, in the order of its faces and then its edges.
/// `vertices` are the mesh's own in the image.
pub(in crate::render) fn extract_mesh(
    mesh: &Mesh,
    placement: &Placement,
    camera: &Camera,
    vertices: &Vertices<'_>,
    Room { fronts, crossed }: &mut Room,
    out: impl FnMut(Piece, &Origin),
) {
    let Some(mut tracer) = Extractor::new(mesh, placement, camera, vertices, out) else { return };
    fronts.find(mesh, placement);
    let lens = Lens::new(camera);
    let signs = (&fronts.facing[..], &fronts.front[..]);
    vectorised(
        #[inline(always)]
        || {
            crossed.each(
                mesh,
                placement,
                &lens,
                vertices,
                signs,
                #[inline(always)]
                |batch, count| tracer.silhouettes(batch, count),
            )
        },
    );
    tracer.edges();
}

/// True if a mesh has boundaries through which something can be seen, unlike holes that
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

/// A segment's corners and ends, as in [`Origin`].
type Segment = ([u32; 3], [[f64; 3]; 2]);

/// Makes the pieces of one mesh.
pub(in crate::render) struct Extractor<'a, V, F> {
    mesh: &'a Mesh,
    placement: &'a Placement,
    vertices: &'a V,
    /// True if the mesh has visible boundaries, so that the insides of faces may be
    /// visible.
    open: bool,
    lens: Lens,
    image: Image,
    /// Pixels across and down.
    size: [f64; 2],
    out: F,
}

impl<'a, V: Points, F: FnMut(Piece, &Origin)> Extractor<'a, V, F> {
    /// Calls `out` for every piece. `None` for an image without pixels.
    pub fn new(
        mesh: &'a Mesh,
        placement: &'a Placement,
        camera: &Camera,
        vertices: &'a V,
        out: F,
    ) -> Option<Self> {
        let image = Image::new(camera.width, camera.height)?;
        let (lens, open) = (Lens::new(camera), is_open(mesh, vertices));
        Some(Extractor { mesh, placement, vertices, open, lens, image, size: image.size(), out })
    }

    /// Makes the pieces of a batch of silhouettes.
    #[inline(always)]
    pub fn silhouettes(&mut self, batch: &silhouette::Batch, count: usize) {
        let located = silhouette::Located::new(batch, count, self.image.size(), self.open);
        for i in 0..count.min(silhouette::MOST) {
            if !batch.there[i] {
                continue;
            }
            if located.single[i] {
                // Nearly all segments are a single piece.
                let [tx, ty] = [batch.tangent[0][i], batch.tangent[1][i]];
                let shape = [batch.middle[0][i], batch.middle[1][i], tx, ty, batch.length[i]];
                let depth = (batch.depth[i], batch.slack[i]);
                let pixels = [located.pixels[0][i], located.pixels[1][i]];
                let inside = [located.inside[0][i], located.inside[1][i]];
                let piece = Image::located(shape, depth, pixels, inside, self.open);
                let (corners, ends) = (batch.corners[i], batch.weights(i));
                let [a, b] = batch.segment(i);
                let forward = (b.x - a.x) * tx + (b.y - a.y) * ty > 0.0;
                (self.out)(piece, &Origin { corners, ends, at: 0.5, share: 1.0, forward });
                continue;
            }
            let ([a, b], length) = (batch.segment(i), batch.length[i]);
            let [tangent, direction] =
                [&batch.tangent, &batch.outward].map(|pair| [pair[0][i], pair[1][i]]);
            let slack = batch.slack[i];
            let look = match self.open {
                false => TestSides::Outward { direction, slack },
                true => TestSides::BothSides { direction, slack: [slack; 2] },
            };
            let from = (batch.corners[i], batch.weights(i));
            self.cut(&a, &b, length, tangent, &look, false, from);
        }
    }

    /// Makes the pieces of creases and boundaries.
    pub fn edges(&mut self) {
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
        let mut ends = [placement.point(from.as_dvec3()), placement.point(to.as_dvec3())];
        if !points.whole() {
            let points = vertices.map(|v| points.point(v));
            if points.iter().any(|p| p.nearness.is_nan()) || !points.iter().any(usable) {
                return;
            }
            let Some(beyond) = beyond_near(ends) else { return };
            ends = beyond;
        }
        let [a, b] = [self.lens.point(ends[0]), self.lens.point(ends[1])];
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
            let corner = |i: usize| placement.point(mesh.positions[face[i] as usize].as_dvec3());
            let corners = [corner(0), corner(1), corner(2)];
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

    /// True if a point is in the image.
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
        // Truncated: positive.
        let pieces = if length < LONGEST { 1.0 } else { ((length + 0.5) as u64) as f64 };
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
