//! The adjoints of scene objects: derivatives with respect to landmarks and vertices, as
//! points.
//!
//! They are passed as lists of arrays of numbers, and of points for vertices. A part on which
//! nothing depends is zero, whatever its length, and costs nothing.

use glam::DVec3;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::armature::{Armature, RestGradient};
use pcadlang_scene::geom::{ByVertex, Solid};

/// The adjoint of a solid, in the layout of [`super::SolidValue`]. An empty list of landmarks
/// stands for zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct BySolid {
    /// With respect to each landmark.
    pub landmarks: Vec<DVec3>,
    /// With respect to vertices.
    pub vertices: ByVertex,
}

impl BySolid {
    pub fn read(by: &Adjoint, solid: &Solid) -> BySolid {
        let landmarks = points(part(by, 0), solid.landmarks().len());
        BySolid { landmarks, vertices: vertices(part(by, 1)) }
    }

    /// Of derivatives with respect to each vertex.
    pub fn of_all(by_vertex: impl IntoIterator<Item = DVec3>) -> BySolid {
        let vertices = (0..).zip(by_vertex).filter(|(_, by)| *by != DVec3::ZERO).collect();
        BySolid { vertices, ..BySolid::default() }
    }

    /// Returns those with respect to each of a number of vertices.
    pub fn each_vertex(&self, count: usize) -> Vec<DVec3> {
        let mut all = vec![DVec3::ZERO; count];
        for (v, by) in &self.vertices {
            if let Some(place) = all.get_mut(*v as usize) {
                *place += *by;
            }
        }
        all
    }

    pub fn into_adjoint(self) -> Adjoint {
        Adjoint::List(vec![from_points(&self.landmarks), from_vertices(&self.vertices)])
    }
}

/// The adjoint of an armature, in the layout of [`super::ArmatureValue`].
pub(super) fn by_armature(by: &Adjoint, body: &Armature) -> RestGradient {
    let rig = body.rig();
    RestGradient {
        heads: points(part(by, 0), rig.joints().len()),
        tails: points(part(by, 1), rig.joints().len()),
        keypoints: points(part(by, 2), rig.keypoints().len()),
        vertices: vertices(part(by, 3)),
    }
}

/// The inverse of [`by_armature`].
pub(super) fn armature_adjoint(by: &RestGradient) -> Adjoint {
    let mut parts = [&by.heads, &by.tails, &by.keypoints].map(|p| from_points(p)).to_vec();
    parts.push(from_vertices(&by.vertices));
    Adjoint::List(parts)
}

fn part(by: &Adjoint, i: usize) -> &Adjoint {
    match by {
        Adjoint::List(all) => all.get(i).unwrap_or(&Adjoint::Zero),
        _ => &Adjoint::Zero,
    }
}

fn vertices(by: &Adjoint) -> ByVertex {
    match by {
        Adjoint::Points(all) => all.iter().map(|(v, by)| (*v, DVec3::from_array(*by))).collect(),
        // Those of all vertices, from a host.
        Adjoint::Array(gs) => (0..).zip(gs.chunks_exact(3).map(DVec3::from_slice)).collect(),
        _ => ByVertex::new(),
    }
}

fn from_vertices(by: &[(u32, DVec3)]) -> Adjoint {
    match by {
        [] => Adjoint::Zero,
        by => Adjoint::Points(by.iter().map(|(v, by)| (*v, by.to_array())).collect()),
    }
}

/// Converts an adjoint of `3 n` numbers to points.
fn points(by: &Adjoint, n: usize) -> Vec<DVec3> {
    match by {
        Adjoint::Array(gs) if gs.len() == 3 * n => {
            gs.chunks_exact(3).map(DVec3::from_slice).collect()
        }
        by => by.numbers(3 * n).chunks_exact(3).map(DVec3::from_slice).collect(),
    }
}

/// Converts points to an adjoint; zero if all of them are.
pub(super) fn from_points(points: &[DVec3]) -> Adjoint {
    if points.iter().all(|p| *p == DVec3::ZERO) {
        return Adjoint::Zero;
    }
    let mut numbers = Vec::with_capacity(3 * points.len());
    points.iter().for_each(|p| numbers.extend_from_slice(p.as_ref()));
    Adjoint::Array(numbers)
}

/// Converts to the shape of a value that stands for a vector: three numbers, one number
/// for all three, or a record of x, y and z.
pub(super) fn shaped(v: &Value, g: DVec3) -> Adjoint {
    match v {
        Value::Unit => Adjoint::Zero,
        Value::Num(_) => Adjoint::Num(g.element_sum()),
        Value::Record(_) => Adjoint::Record(
            ["x", "y", "z"]
                .into_iter()
                .zip(g.to_array())
                .map(|(k, g)| (k.into(), Adjoint::Num(g)))
                .collect(),
        ),
        _ => Adjoint::Array(g.to_array().to_vec()),
    }
}
