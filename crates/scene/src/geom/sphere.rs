//! Spheres made of meridians and rings. Invariant: normals are exactly those of the
//! sphere.

use super::mesh::SMALLEST;
use super::revolve::{Strip, revolve};
use super::{GeomError, Mesh};
use glam::DVec3;

/// Returns a sphere around the origin with `sides` meridians and half as many rings.
///
/// # Errors
/// A radius outside 1e-30 to 1e6; fewer than 4 or more than 1024 sides.
pub fn sphere(radius: f64, sides: u32) -> Result<Mesh, GeomError> {
    if !(SMALLEST..=1e6).contains(&radius) {
        return Err(GeomError::domain(format!(
            "sphere: the radius must be from 1e-30 to 1e6, got {radius}"
        )));
    }
    if !(4..=1024).contains(&sides) {
        return Err(GeomError::domain(format!("sphere: 4 to 1024 sides, got {sides}")));
    }
    let rings = sides.div_ceil(2);
    let points = (0..=rings).map(|i| {
        let angle = core::f64::consts::PI * (f64::from(i) / f64::from(rings) - 0.5);
        let r = if i == 0 || i == rings { 0.0 } else { radius * libm::cos(angle) };
        (r, radius * libm::sin(angle))
    });
    let strip = Strip { points: points.collect(), parts: vec![0; rings as usize], blend: false };
    let mut mesh = revolve(&[strip], sides, false, 1);
    let outward =
        |(n, p): (&glam::Vec3, &glam::Vec3)| p.as_dvec3().normalize_or(n.as_dvec3()).as_vec3();
    mesh.normals = mesh.normals.iter().zip(&mesh.positions).map(outward).collect();
    Ok(mesh)
}

/// Pulls derivatives with respect to the vertices of a sphere of this radius back to the
/// radius.
pub fn vjp_sphere(radius: f64, mesh: &Mesh, by_vertex: &[DVec3]) -> f64 {
    mesh.positions.iter().zip(by_vertex).map(|(p, g)| p.as_dvec3().dot(*g)).sum::<f64>() / radius
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_and_normals_lie_on_the_sphere() {
        let s = sphere(2.0, 32).unwrap();
        for (p, n) in s.positions.iter().zip(&s.normals) {
            assert!((p.length() - 2.0).abs() < 1e-5);
            assert!((*p / 2.0 - *n).length() < 2e-7, "{p} {n}");
        }
        assert!(s.topology.edges.iter().all(|e| !e.crease && e.faces[1] != crate::geom::NO_FACE));
        let poles =
            s.normals.iter().filter(|n| n.x == 0.0 && n.z == 0.0).map(|n| n.y).collect::<Vec<_>>();
        assert_eq!(poles, [-1.0, 1.0]);
        assert!(
            sphere(0.0, 32).is_err() && sphere(f64::NAN, 32).is_err() && sphere(1.0, 3).is_err()
        );
    }
}
