//! How contours move with the surface: from derivatives with respect to their pieces to
//! derivatives with respect to the vertices.
//!
//! A piece moves with the points of the surface at the ends of its segment. That is exact
//! for creases; smooth silhouettes also slide over faces that rotate
//! (`silhouette_derivative`), and contours that pass behind others become longer or
//! shorter there (`junctions`). Nothing is drawn: the pieces of the meshes are extracted
//! again, and the visible ones are recognised by their values.

use crate::geom::{Instance, Solid};
use crate::render::derivatives::junctions::{End, Extracted, moved_ends};
use crate::render::derivatives::silhouette_derivative::{STEADY, SilhouetteDerivative};
use crate::render::lines::extraction::{Origin, Room, extract_mesh};
use crate::render::lines::visibility::{Depths, Piece};
use crate::render::pixels::project::{Lens, Placement, Projected, project};
use crate::render::{Camera, Contours};
use glam::DVec3;

impl Contours {
    /// The vector-Jacobian product of [`Contours::of`] for the same solid and camera:
    /// from the derivatives of a function with respect to each piece's x, y, length
    /// (pixels) and angle (radians, from right to down) to those with respect to each
    /// vertex of the solid's meshes in turn, in world coordinates. Pieces beyond the end
    /// of `by_piece` count as 0.
    ///
    /// Normals are assumed to rotate with the faces around them. Pieces that appear or
    /// disappear by themselves are not accounted for.
    pub fn vjp(&self, solid: &Solid, camera: &Camera, by_piece: &[[f64; 4]]) -> Vec<DVec3> {
        self.vjp_with(solid, camera, by_piece, STEADY)
    }

    /// As [`Contours::vjp`], with another angle than [`STEADY`].
    pub(in crate::render) fn vjp_with(
        &self,
        solid: &Solid,
        camera: &Camera,
        by_piece: &[[f64; 4]],
        steady: f64,
    ) -> Vec<DVec3> {
        if solid.revolution().is_some() {
            let meshes = Solid::of(solid.instances().into());
            let contours = Contours::of(&meshes, camera);
            let by_piece = self.handed_over(&contours, by_piece);
            return contours.vjp_with(&meshes, camera, &by_piece, steady);
        }
        let mut extracted = Vec::with_capacity(self.len() + self.len() / 4);
        self.each(solid, camera, |t| extracted.push(t));
        let by_piece = moved_ends(&extracted, camera, by_piece);
        let mut out = vec![DVec3::ZERO; solid.vertex_count()];
        let mut silhouette_derivative = SilhouetteDerivative::new(out.len(), steady);
        for t in &extracted {
            let Some(by) = t.seen.and_then(|i| by_piece.get(i)) else { continue };
            if let (Some(by_ends), Some(own)) =
                (by_ends(t.instance, &t.origin, camera, by), out.get_mut(t.base..))
            {
                vjp_ends(&t.origin, &by_ends, own);
                silhouette_derivative.add(t.instance, camera, t.base, &t.origin, &by_ends, own);
            }
        }
        silhouette_derivative.vjp(solid, &mut out);
        out
    }

    /// As [`Contours::vjp`], with each piece fixed to its points of the surface.
    #[cfg(test)]
    pub(in crate::render) fn vjp_fixed(
        &self,
        solid: &Solid,
        camera: &Camera,
        by_piece: &[[f64; 4]],
    ) -> Vec<DVec3> {
        let mut out = vec![DVec3::ZERO; solid.vertex_count()];
        self.each(solid, camera, |t| {
            let by = t.seen.and_then(|i| by_piece.get(i));
            if let (Some(by), Some(own)) = (
                by.and_then(|by| by_ends(t.instance, &t.origin, camera, by)),
                out.get_mut(t.base..),
            ) {
                vjp_ends(&t.origin, &by, own);
            }
        });
        out
    }

    /// The derivatives with respect to the pieces of a mesh's contours, given those with
    /// respect to the pieces of the surface that it stands for: each takes those, per unit
    /// of length, of the nearest one that runs the same way.
    fn handed_over(&self, to: &Contours, by_piece: &[[f64; 4]]) -> Vec<[f64; 4]> {
        let one = |k: usize| {
            let apart = |i: &usize| {
                let (dx, dy) = (self.x[*i] - to.x[k], self.y[*i] - to.y[k]);
                let along = self.tx[*i] * to.tx[k] + self.ty[*i] * to.ty[k];
                dx * dx + dy * dy + 4.0 * (1.0 - along)
            };
            let nearest = (0..self.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)));
            let by = nearest.and_then(|i| Some((i, by_piece.get(i)?)));
            by.map_or([0.0; 4], |(i, [x, y, length, angle])| {
                let share = f64::from(to.length[k] / self.length[i]);
                [x * share, y * share, *length, angle * share]
            })
        };
        (0..to.len()).map(one).collect()
    }

    /// Calls `f` for each piece in turn, hidden or not.
    fn each<'a>(&self, solid: &'a Solid, camera: &Camera, mut f: impl FnMut(Extracted<'a>)) {
        let (mut projected, mut room) = (Projected::default(), Room::default());
        let (mut next, mut base) = (0, 0);
        for instance in solid.instances() {
            let placement = Placement::new(camera, &instance.affine);
            projected.clear();
            projected.add(&instance.mesh, &placement, &Lens::new(camera));
            let vertices = projected.mesh(0);
            extract_mesh(
                &instance.mesh,
                &placement,
                camera,
                &vertices,
                &mut room,
                |piece, origin| {
                    let seen = self.is(next, &piece).then_some(next);
                    next += usize::from(seen.is_some());
                    let ends = End::both(origin, &vertices);
                    f(Extracted { piece, origin: *origin, ends, seen, instance, base });
                },
            );
            base += vertices.len();
        }
    }

    /// True if piece `i` equals this one, bit for bit.
    fn is(&self, i: usize, piece: &Piece) -> bool {
        let same = |list: &[f32], x: f32| list.get(i).is_some_and(|y| y.to_bits() == x.to_bits());
        same(&self.x, piece.x)
            && same(&self.y, piece.y)
            && same(&self.tx, piece.tx)
            && same(&self.ty, piece.ty)
            && same(&self.length, piece.length)
    }
}

/// The vector-Jacobian product of the contours of a solid whose depth was drawn, with each
/// piece fixed to its points of the surface. `by` gives the derivatives with respect to a
/// piece's x and y; pieces for which it gives none cost little, so this is cheap for
/// functions of few pieces, such as those of the outline.
pub(in crate::render) fn vjp_some(
    solid: &Solid,
    camera: &Camera,
    depth: &[f32],
    mut by: impl FnMut(&Piece) -> Option<[f64; 2]>,
) -> Vec<DVec3> {
    let mut out = vec![DVec3::ZERO; solid.vertex_count()];
    let (mut projected, mut room) = (Projected::default(), Room::default());
    let range = project(solid, camera, &mut projected);
    let Some(depths) = Depths::new(depth, camera.width, camera.height, range.extent()) else {
        return out;
    };
    let mut rest = &mut out[..];
    for (i, instance) in solid.instances().iter().enumerate() {
        let (placement, vertices) = (Placement::new(camera, &instance.affine), projected.mesh(i));
        let (own, after) = rest.split_at_mut(vertices.len().min(rest.len()));
        rest = after;
        if vertices.outside(camera) {
            continue;
        }
        extract_mesh(&instance.mesh, &placement, camera, &vertices, &mut room, |piece, origin| {
            if let Some([x, y]) = by(&piece).filter(|_| depths.visible(&piece))
                && let Some(by) = by_ends(instance, origin, camera, &[x, y, 0.0, 0.0])
            {
                vjp_ends(origin, &by, own);
            }
        });
    }
    out
}

/// Maps the derivatives with respect to a piece to those with respect to the ends of its
/// segment, in world coordinates.
fn by_ends(
    instance: &Instance,
    origin: &Origin,
    camera: &Camera,
    &[gx, gy, by_length, by_angle]: &[f64; 4],
) -> Option<[DVec3; 2]> {
    let corners = origin.corners.map(|v| instance.mesh.positions.get(v as usize));
    let [Some(p), Some(q), Some(r)] = corners else { return None };
    let ends = origin.ends.map(|[a, b, c]| {
        instance.affine.point(p.as_dvec3() * a + q.as_dvec3() * b + r.as_dvec3() * c)
    });
    let [(ax, ay, a_depth), (bx, by, b_depth)] = ends.map(|e| camera.project(e));
    let (dx, dy) = (bx - ax, by - ay);
    let length = (dx * dx + dy * dy).sqrt();
    // If the near plane cut the segment, these are not its ends.
    if !(a_depth >= Camera::NEAR && b_depth >= Camera::NEAR && length > 1e-9) {
        return None;
    }
    let (tx, ty) = (dx / length, dy / length);
    let (stretch, turn) = (by_length * origin.share, by_angle / length);
    let along = [stretch * tx - turn * ty, stretch * ty + turn * tx];
    let vjp = |end: DVec3, share: f64, sign: f64| {
        let g = camera.vjp_point(end, [share * gx + sign * along[0], share * gy + sign * along[1]]);
        if g.is_finite() { g } else { DVec3::ZERO }
    };
    Some([vjp(ends[0], 1.0 - origin.at, -1.0), vjp(ends[1], origin.at, 1.0)])
}

/// Maps the derivatives with respect to the ends of a segment to those with respect to
/// the vertices of its face or edge.
fn vjp_ends(origin: &Origin, by_ends: &[DVec3; 2], out: &mut [DVec3]) {
    for (g, shares) in by_ends.iter().zip(origin.ends) {
        for (v, share) in origin.corners.into_iter().zip(shares) {
            if let Some(place) = out.get_mut(v as usize) {
                *place += *g * share;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Affine;
    use crate::render::testing::{Uniform, cuboid, lathe, sphere};
    use glam::Vec3;

    /// A piece's position, length and angle in double precision, from the vertices in
    /// world coordinates.
    fn piece(camera: &Camera, vertices: &[DVec3], base: usize, o: &Origin) -> [f64; 4] {
        let ends = o.ends.map(|w| {
            let at = o
                .corners
                .iter()
                .zip(w)
                .map(|(v, w)| vertices[base + *v as usize] * w)
                .sum::<DVec3>();
            camera.project(at)
        });
        let (dx, dy) = (ends[1].0 - ends[0].0, ends[1].1 - ends[0].1);
        let at = [ends[0].0 + o.at * dx, ends[0].1 + o.at * dy];
        [at[0], at[1], dx.hypot(dy) * o.share, dy.atan2(dx)]
    }

    #[test]
    fn derivatives_are_those_of_differences_for_the_same_pieces() {
        let place = |x: f64, turn: f64| {
            Affine::new(DVec3::new(x, 0.1, -0.3), DVec3::new(turn, 0.4, 0.2), DVec3::ONE)
        };
        let vase = lathe(&[(0.3, -0.8), (0.7, -0.2), (0.4, 0.5), (0.6, 0.9)], 24, true);
        let group = Solid::group(&[
            vase.placed(place(-0.8, 0.3)),
            sphere(20, 12).placed(place(0.9, 0.0)),
            cuboid(Vec3::new(0.8, 1.1, 0.6)).placed(place(0.2, -0.7)),
        ]);
        let mut parallel = Camera::default_for(96, 80);
        parallel.projection =
            crate::render::Projection::Orthographic { units_per_pixel: 0.04, cx: 47.0, cy: 41.0 };
        for camera in [Camera::default_for(96, 80), parallel] {
            let contours = Contours::of(&group, &camera);
            let mut rng = Uniform(3);
            // Angles are weighted by length, as those of short pieces change fast.
            let one = |length: &f32| {
                [1.0, 1.0, 1.0, f64::from(*length)].map(|by| by * (rng.next() - 0.5))
            };
            let by: Vec<[f64; 4]> = contours.length.iter().map(one).collect();
            let found = contours.vjp_fixed(&group, &camera, &by);
            let mut origins = Vec::new();
            contours
                .each(&group, &camera, |t| origins.extend(t.seen.map(|i| (i, t.base, t.origin))));
            assert!(
                origins.iter().map(|o| o.0).eq(0..contours.len()),
                "every piece was found again"
            );
            let vertices: Vec<DVec3> = group.vertices().collect();
            for (i, base, o) in &origins {
                let [x, y, length, _] = piece(&camera, &vertices, *base, o);
                let (cx, cy) = (f64::from(contours.x[*i]), f64::from(contours.y[*i]));
                assert!((x - cx).abs() < 1e-3 && (y - cy).abs() < 1e-3);
                assert!((length - f64::from(contours.length[*i])).abs() < 1e-3);
            }
            let sum = |vertices: &[DVec3]| -> f64 {
                let one = |(i, base, o): &(usize, usize, Origin)| {
                    piece(&camera, vertices, *base, o)
                        .iter()
                        .zip(by[*i])
                        .map(|(x, g)| x * g)
                        .sum::<f64>()
                };
                origins.iter().map(one).sum()
            };
            for _ in 0..20 {
                let way: Vec<DVec3> = vertices
                    .iter()
                    .map(|_| DVec3::from_array(std::array::from_fn(|_| rng.next() - 0.5)))
                    .collect();
                let moved = |h: f64| {
                    vertices.iter().zip(&way).map(|(p, d)| *p + *d * h).collect::<Vec<_>>()
                };
                let slope = (sum(&moved(1e-6)) - sum(&moved(-1e-6))) / 2e-6;
                let along: f64 = found.iter().zip(&way).map(|(g, d)| g.dot(*d)).sum();
                let scale: f64 = found.iter().zip(&way).map(|(g, d)| g.dot(*d).abs()).sum();
                assert!((along - slope).abs() < 1e-5 * scale, "{along} {slope}");
            }
        }
    }
}
