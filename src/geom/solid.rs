//! Solids: meshes placed in the world, alone or in groups. Cheap to clone and to move: meshes are shared.

use super::{Affine, Bounds, GeomError, Mesh};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A placed mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// Where it is.
    pub affine: Affine,
    /// What is added to its part numbers.
    pub first_part: u16,
}

/// Placed meshes.
#[derive(Clone, Debug)]
pub struct Solid {
    instances: Arc<[Instance]>,
}

impl Solid {
    /// A mesh as it is.
    pub fn new(mesh: Arc<Mesh>) -> Solid {
        Solid { instances: Arc::new([Instance { mesh, affine: Affine::IDENTITY, first_part: 0 }]) }
    }

    /// Its meshes.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Moved by an affine map.
    pub fn placed(&self, by: Affine) -> Solid {
        let instances = self.instances.iter().map(|i| Instance { affine: by * i.affine, ..i.clone() });
        Solid { instances: instances.collect() }
    }

    /// Several together; part numbers follow one another.
    pub fn group(solids: &[Solid]) -> Solid {
        let mut first: u16 = 0;
        let mut instances = Vec::new();
        for s in solids {
            for i in s.instances() {
                instances.push(Instance { first_part: first.saturating_add(i.first_part), ..i.clone() });
            }
            first = first.saturating_add(s.part_count());
        }
        Solid { instances: instances.into() }
    }

    /// The number of parts.
    pub fn part_count(&self) -> u16 {
        let after = |i: &Instance| i.first_part.saturating_add(i.mesh.topology.part_count);
        self.instances.iter().map(after).max().unwrap_or(0)
    }

    /// The smallest box around all vertices; `None` if there are none.
    pub fn bounds(&self) -> Option<Bounds> {
        let points = self.instances.iter().flat_map(|i| i.mesh.positions.iter().map(|p| i.affine.point(p.as_dvec3())));
        Bounds::around(points)
    }

    /// Moved so that the centre of its box is the origin; with `fit` also scaled so that half the box's longest edge is 1.
    pub fn centred(&self, fit: bool) -> Solid {
        let Some(b) = self.bounds() else { return self.clone() };
        let half = 0.5 * b.size().max_element();
        let scale = if fit && half > 0.0 { 1.0 / half } else { 1.0 };
        self.placed(Affine::new(-scale * b.centre(), DVec3::ZERO, DVec3::splat(scale)))
    }

    /// One mesh in world coordinates, for export.
    ///
    /// # Errors
    /// As [`Mesh::new`].
    pub fn to_mesh(&self) -> Result<Mesh, GeomError> {
        let (mut positions, mut triangles, mut parts) = (Vec::<Vec3>::new(), Vec::new(), Vec::new());
        for i in self.instances.iter() {
            let first = positions.len() as u32;
            positions.extend(i.mesh.positions.iter().map(|p| i.affine.point(p.as_dvec3()).as_vec3()));
            let mirrored = i.affine.is_mirrored();
            triangles.extend(i.mesh.topology.triangles.iter().map(|t| {
                let [a, b, c] = t.map(|v| v + first);
                if mirrored { [a, c, b] } else { [a, b, c] }
            }));
            parts.extend(i.mesh.topology.parts.iter().map(|p| p.saturating_add(i.first_part)));
        }
        Mesh::new(positions, triangles, parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{cuboid, sphere};

    #[test]
    fn groups_and_centring() {
        let a = Solid::new(Arc::new(cuboid(DVec3::new(1.0, 4.0, 2.0)).unwrap()));
        let b = Solid::new(Arc::new(sphere(1.0, 16).unwrap()));
        let shift = Affine::new(DVec3::new(3.0, 0.0, 0.0), DVec3::ZERO, DVec3::ONE);
        let g = Solid::group(&[a.clone(), b.placed(shift)]);
        assert_eq!((g.instances().len(), g.part_count()), (2, 2));
        let bounds = g.bounds().unwrap();
        assert!((bounds.max - DVec3::new(4.0, 2.0, 1.0)).length() < 1e-5);
        let c = g.centred(true).bounds().unwrap();
        assert!(c.centre().length() < 1e-6);
        assert!((c.size().max_element() - 2.0).abs() < 1e-6);
        let m = g.to_mesh().unwrap();
        assert_eq!(m.topology.triangles.len(), 12 + b.instances()[0].mesh.topology.triangles.len());
        assert_eq!(m.topology.part_count, 2);
    }
}
