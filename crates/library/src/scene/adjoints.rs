//! The adjoints of scene objects: derivatives with respect to landmarks and vertices, as
//! points.
//!
//! They are passed as lists of arrays of numbers. A part on which nothing depends is
//! zero, whatever its length, and costs nothing.

use glam::DVec3;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::Solid;
use pcadlang_scene::geom::armature::{Armature, RestGradient};

/// The adjoint of a solid, in the layout of [`super::SolidValue`]. An empty list stands
/// for zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct BySolid {
    /// With respect to each landmark.
    pub landmarks: Vec<DVec3>,
    /// With respect to each vertex.
    pub vertices: Vec<DVec3>,
}

impl BySolid {
    pub fn read(by: &Adjoint, solid: &Solid) -> BySolid {
        let vertices = match part(by, 1) {
            // Counting the vertices would build the meshes.
            Adjoint::Zero => Vec::new(),
            by => points(by, solid.vertex_count()),
        };
        BySolid { landmarks: points(part(by, 0), solid.landmarks().len()), vertices }
    }

    pub fn into_adjoint(self) -> Adjoint {
        Adjoint::List(vec![from_points(&self.landmarks), from_points(&self.vertices)])
    }
}

/// The adjoint of an armature, in the layout of [`super::ArmatureValue`].
pub(super) fn by_armature(by: &Adjoint, body: &Armature) -> RestGradient {
    let rig = body.rig();
    RestGradient {
        heads: points(part(by, 0), rig.joints().len()),
        tails: points(part(by, 1), rig.joints().len()),
        keypoints: points(part(by, 2), rig.keypoints().len()),
        vertices: match part(by, 3) {
            Adjoint::Zero => Vec::new(),
            by => points(by, body.influences().len()),
        },
    }
}

/// The inverse of [`by_armature`].
pub(super) fn armature_adjoint(by: &RestGradient) -> Adjoint {
    Adjoint::List(
        [&by.heads, &by.tails, &by.keypoints, &by.vertices].map(|p| from_points(p)).to_vec(),
    )
}

fn part(by: &Adjoint, i: usize) -> &Adjoint {
    match by {
        Adjoint::List(all) => all.get(i).unwrap_or(&Adjoint::Zero),
        _ => &Adjoint::Zero,
    }
}

/// Converts an adjoint of `3 n` numbers to points.
pub(super) fn points(by: &Adjoint, n: usize) -> Vec<DVec3> {
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
