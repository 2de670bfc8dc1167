//! Axis-aligned boxes: one part, with a crease at every edge.

use super::mesh::SMALLEST;
use super::{GeomError, Mesh};
use glam::{DVec3, Vec3};

/// Returns a box centred at the origin with these edge lengths.
///
/// # Errors
/// An edge length outside 1e-30 to 1e6.
pub fn cuboid(size: DVec3) -> Result<Mesh, GeomError> {
    if !size.to_array().iter().all(|x| (SMALLEST..=1e6).contains(x)) {
        return Err(GeomError::domain(format!(
            "box: the edge lengths must be from 1e-30 to 1e6, got {size}"
        )));
    }
    let half = (0.5 * size).as_vec3();
    let corner = |i: u32| {
        Vec3::from_array([0, 1, 2].map(|a| if i >> a & 1 == 1 { half[a] } else { -half[a] }))
    };
    let positions: Vec<Vec3> = (0..8).map(corner).collect();
    // Bit 0 is x, bit 1 y, bit 2 z; quads counter-clockwise from outside.
    let quads =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[u32; 3]> =
        quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    Mesh::new(positions, triangles, vec![0; 12])
}

/// Pulls derivatives with respect to the vertices of a box of this size back to its edge
/// lengths.
pub fn vjp_cuboid(size: DVec3, mesh: &Mesh, by_vertex: &[DVec3]) -> DVec3 {
    mesh.positions.iter().zip(by_vertex).map(|(p, g)| p.as_dvec3() * *g).sum::<DVec3>() / size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_flat_sides_and_twelve_creases() {
        let m = cuboid(DVec3::new(1.0, 2.0, 3.0)).unwrap();
        assert_eq!((m.positions.len(), m.topology.triangles.len()), (24, 12));
        assert_eq!(m.topology.edges.iter().filter(|e| e.crease).count(), 12);
        for t in &m.topology.triangles {
            let p = t.map(|v| m.positions[v as usize]);
            let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
            assert!(n.dot(p[0]) > 0.0, "faces outwards");
            assert!(t.iter().all(|v| (m.normals[*v as usize] - n).length() < 1e-6));
        }
        assert!(
            cuboid(DVec3::new(1.0, 0.0, 1.0)).is_err()
                && cuboid(DVec3::splat(f64::INFINITY)).is_err()
        );
    }
}
