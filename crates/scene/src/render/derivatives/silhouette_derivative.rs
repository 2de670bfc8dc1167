//! How smooth silhouettes slide over the faces of a mesh when the faces rotate.
//!
//! A silhouette is where the interpolated normal is perpendicular to the line of sight.
//! On a smooth surface sliding is invisible: the line of sight is tangent to the surface
//! there. It is not tangent to a flat face, so on coarse meshes sliding also moves the
//! contour sideways. Invariant: exact (except for `steady`) where the vertices move
//! together as a rigid body.

use crate::geom::{Instance, Solid};
use crate::render::lines::extraction::Origin;
use crate::render::{Camera, Projection};
use glam::{DMat3, DVec3};

/// The angle between the normals of a face's corners, in radians, below which sliding is
/// damped: a rotation that moves limbs by about a pixel takes silhouettes over such faces
/// and on to the next, and what one face adds another takes away.
pub(in crate::render) const STEADY: f64 = 0.1;

/// Derivatives with respect to rotations of normals, collected before they are mapped to
/// vertices.
pub(in crate::render) struct SilhouetteDerivative {
    /// With respect to a rotation of each vertex's normal about the world axes.
    turns: Vec<DVec3>,
    /// The square of [`STEADY`].
    steady: f64,
    /// The first vertex of a mesh among all, and the matrix that transforms the mesh's
    /// normals.
    normals: (usize, DMat3),
}

impl SilhouetteDerivative {
    /// For a solid with a number of vertices.
    pub fn new(vertices: usize, steady: f64) -> SilhouetteDerivative {
        SilhouetteDerivative {
            turns: vec![DVec3::ZERO; vertices],
            steady: steady * steady,
            normals: (usize::MAX, DMat3::ZERO),
        }
    }

    /// Adds the contribution of one piece, from the derivatives with respect to its
    /// segment's ends. `out` begins at the first vertex of its mesh, which is number
    /// `base` among all.
    pub fn add(
        &mut self,
        instance: &Instance,
        camera: &Camera,
        base: usize,
        origin: &Origin,
        by_ends: &[DVec3; 2],
        out: &mut [DVec3],
    ) {
        let [odd, others @ ..] = origin.corners;
        // The ends of an edge are vertices and do not slide.
        if others[0] == others[1] {
            return;
        }
        if self.normals.0 != base {
            self.normals = (base, instance.affine.normal_matrix());
        }
        let normals = self.normals.1;
        let pinhole = matches!(camera.projection, Projection::Pinhole { .. });
        let corner = |v: u32| {
            let (p, n) =
                (instance.mesh.positions.get(v as usize)?, instance.mesh.normals.get(v as usize)?);
            let (p, n) = (instance.affine.point(p.as_dvec3()), normals * n.as_dvec3());
            Some((p, n, if pinhole { camera.eye - p } else { -camera.forward }))
        };
        let Some((p0, n0, to_eye0)) = corner(odd) else { return };
        let facing0 = n0.dot(to_eye0);
        for (v, g) in others.into_iter().zip(by_ends) {
            let Some((p1, n1, to_eye1)) = corner(v) else { continue };
            let facing1 = n1.dot(to_eye1);
            // The end is at p0 + (p1 - p0) u with u = facing0 / (facing0 - facing1).
            let square = (facing0 - facing1) * (facing0 - facing1);
            let size = n0.length_squared() * to_eye0.length_squared() * self.steady;
            let by = g.dot(p1 - p0) / (square + size);
            for (v, n, to_eye, by) in
                [(odd, n0, to_eye0, -by * facing1), (v, n1, to_eye1, by * facing0)]
            {
                let (turn, shift) = (n.cross(to_eye) * by, n * by);
                if !(turn.is_finite() && shift.is_finite()) {
                    continue;
                }
                if let Some(place) = self.turns.get_mut(base + v as usize) {
                    *place += turn;
                }
                if let Some(place) = out.get_mut(v as usize).filter(|_| pinhole) {
                    *place -= shift;
                }
            }
        }
    }

    /// Adds the derivatives with respect to the vertices: a normal rotates as the faces
    /// around it do, weighted by their areas.
    pub fn vjp(&self, solid: &Solid, out: &mut [DVec3]) {
        let mut base = 0;
        let mut faces = Vec::new();
        for instance in solid.instances() {
            let mesh = &instance.mesh;
            let past = base + mesh.positions.len();
            if let (Some(turns), Some(out)) = (self.turns.get(base..past), out.get_mut(base..past))
            {
                faces.clear();
                let mut areas = vec![0.0; turns.len()];
                let turned = |v: &u32| turns.get(*v as usize).is_some_and(|t| *t != DVec3::ZERO);
                for corners in mesh.topology.triangles.iter().filter(|t| t.iter().any(turned)) {
                    let Some(face) = Face::new(instance, *corners) else { continue };
                    corners
                        .iter()
                        .filter_map(|v| areas.get_mut(*v as usize).map(|a| *a += face.area))
                        .for_each(drop);
                    faces.push(face);
                }
                faces.iter().for_each(|face| face.vjp(turns, &areas, out));
            }
            base = past;
        }
    }
}

/// A face whose corners' normals rotate.
struct Face {
    corners: [u32; 3],
    /// The edge opposite to each corner.
    opposite: [DVec3; 3],
    /// Of unit length.
    normal: DVec3,
    /// Twice its area.
    area: f64,
}

impl Face {
    fn new(instance: &Instance, corners: [u32; 3]) -> Option<Face> {
        let [Some(a), Some(b), Some(c)] = corners.map(|v| instance.mesh.positions.get(v as usize))
        else {
            return None;
        };
        let [a, b, c] = [a, b, c].map(|p| instance.affine.point(p.as_dvec3()));
        let across = (b - a).cross(c - a);
        let area = across.length();
        let normal = across / area;
        normal.is_finite().then_some(Face {
            corners,
            opposite: [c - b, a - c, b - a],
            normal,
            area,
        })
    }

    /// Maps this face's share of the derivatives with respect to the rotations of its
    /// corners' normals to the corners.
    fn vjp(&self, turns: &[DVec3], areas: &[f64], out: &mut [DVec3]) {
        let by = |v: &u32| Some(*turns.get(*v as usize)? * (self.area / areas.get(*v as usize)?));
        let by: DVec3 = self.corners.iter().filter_map(by).sum();
        for (v, o) in self.corners.iter().zip(self.opposite) {
            if let Some(place) = out.get_mut(*v as usize) {
                // A corner that moves along the normal tips the face about the opposite
                // edge; one that moves along that edge rotates the face in its plane.
                *place += self.normal * (by.dot(o) / self.area)
                    - o * (by.dot(self.normal) / (2.0 * self.area));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::geom::{Affine, Solid};
    use crate::render::testing::{along, lathe, sphere, weighted};
    use crate::render::{Camera, Contours, Projection};
    use glam::DVec3;

    #[test]
    fn contours_of_coarse_meshes_move_as_differences_say() {
        let mut parallel = Camera::default_for(128, 128);
        parallel.projection =
            Projection::Orthographic { units_per_pixel: 0.03, cx: 63.0, cy: 65.0 };
        for camera in [Camera::default_for(128, 128), parallel] {
            for solid in [
                sphere(12, 8),
                lathe(&[(0.0, -0.8), (0.5, -0.6), (0.7, 0.0), (0.5, 0.6), (0.0, 0.8)], 9, false),
            ] {
                let at = |p: [f64; 7]| -> Solid {
                    let scale = DVec3::new(0.9, 1.0, 1.2) * (1.0 + p[6]);
                    let inner = Affine::new(DVec3::ZERO, DVec3::new(0.3, 0.2, 0.1), scale);
                    let outer = Affine::new(
                        DVec3::new(p[0], p[1], p[2]),
                        DVec3::new(p[3], p[4], p[5]),
                        DVec3::ONE,
                    );
                    solid.placed(inner).placed(outer)
                };
                let contours = |solid: &Solid| Contours::of(solid, &camera);
                let here = at([0.0; 7]);
                let by = weighted(&contours(&here)).1;
                let exact = contours(&here).vjp_with(&here, &camera, &by, 0.0);
                let fixed = contours(&here).vjp_fixed(&here, &camera, &by);
                let (mut wrong, mut without) = (0.0f64, 0.0f64);
                for k in 0..7 {
                    let h = 2e-4;
                    let moved = |h: f64| at(std::array::from_fn(|i| if i == k { h } else { 0.0 }));
                    let (before, after) = (moved(-h), moved(h));
                    let slope = (weighted(&contours(&after)).0 - weighted(&contours(&before)).0)
                        / (2.0 * h);
                    wrong = wrong.max((along(&exact, &before, &after, 2.0 * h) - slope).abs());
                    without = without.max((along(&fixed, &before, &after, 2.0 * h) - slope).abs());
                }
                assert!(wrong < 0.05 && without > 1.0, "{wrong} {without}");
            }
        }
    }
}
