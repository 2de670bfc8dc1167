//! Vector-Jacobian products of bodies: from surfaces and keypoints to poses, shapes and
//! proportions.

use super::{armature, joint, pose, stops, stretches};
use crate::scene::adjoints::{BySolid, armature_adjoint, by_armature, from_points, shaped as like};
use crate::scene::objects::affine_adjoint;
use crate::scene::{AffineValue, SolidValue};
use glam::{DMat3, DVec3};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{ArgAdjoints, Args};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::armature::{Armature, JointGradient, Rules, Stretch};
use smallvec::smallvec;
use std::sync::Arc;

/// For `scene.skin`. The adjoint of the armature is known only for poses that consist of
/// rotation vectors.
pub(super) fn skin(a: &Args, posed: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let body = armature(a).ok()?;
    let solid = &posed.downcast::<SolidValue>()?.0;
    let by = BySolid::read(by, solid);
    let vertices = body.vjp_parts(&by.vertices);
    let rules = Rules { stops: stops(a, body).ok()?, inherit_scale: a.bool("inherit_scale").ok()? };
    let pose = pose(a, body).ok()?;
    if let Some(g) = body.vjp_posed(&pose, &rules, &by.landmarks, &vertices, solid.joints()).ok()? {
        let turned = |turn: DVec3| JointGradient { turn, ..JointGradient::default() };
        let by_pose = by_pose(a, body, &g.turns.into_iter().map(turned).collect::<Vec<_>>())?;
        return Some(smallvec![armature_adjoint(&g.rest), by_pose]);
    }
    let by_transform = body.transforms_gradient(&vertices, &by.landmarks);
    let g = body.rig().transforms_vjp(&pose, &rules, &by_transform).ok()?;
    Some(smallvec![Adjoint::Unknown, by_pose(a, body, &g)?])
}

/// Converts to the shape in which the pose was given.
fn by_pose(a: &Args, body: &Armature, by: &[JointGradient]) -> Option<Adjoint> {
    Some(match a.get(1) {
        Value::Array(xs) if xs.is_empty() => Adjoint::Zero,
        Value::Array(_) => from_points(&by.iter().map(|g| g.turn).collect::<Vec<_>>()),
        Value::List(all) => {
            Adjoint::List(all.iter().zip(by).map(|(v, g)| by_joint(v, g)).collect())
        }
        Value::Record(all) => {
            let one = |(name, v): (&Arc<str>, &Value)| {
                Some((Arc::clone(name), by_joint(v, by.get(joint(a, body, name).ok()?)?)))
            };
            Adjoint::Record(all.iter().map(one).collect::<Option<_>>()?)
        }
        _ => return None,
    })
}

fn by_joint(v: &Value, by: &JointGradient) -> Adjoint {
    if let Some(placement) = v.downcast::<AffineValue>() {
        // The columns are s_k R_k: they are proportional to s_k, and a small rotation
        // vector w changes them by w x s_k R_k.
        let m = placement.0.0.matrix3;
        let column = |c: DVec3, by_scale: f64| {
            let scale = c.length();
            c * (by_scale / scale) + by.turn.cross(c) * (0.5 / (scale * scale))
        };
        let [x, y, z] = by.scale.to_array();
        let linear =
            DMat3::from_cols(column(m.x_axis, x), column(m.y_axis, y), column(m.z_axis, z));
        return affine_adjoint(linear, by.location);
    }
    match v {
        Value::Record(fields) => {
            let one = |(name, v): (&Arc<str>, &Value)| {
                let g = match &**name {
                    "location" => by.location,
                    "scale" => by.scale,
                    _ => by.turn,
                };
                (Arc::clone(name), like(v, g))
            };
            Adjoint::Record(fields.iter().map(one).collect())
        }
        v => like(v, by.turn),
    }
}

/// For `scene.shaped`: offsets are added, so the adjoint of the original armature is that
/// of the result.
pub(super) fn shaped(a: &Args, _: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let body = armature(a).ok()?;
    let Value::Record(amounts) = a.get(1) else { return None };
    let rest = by_armature(by, body);
    let slope = |k: &Arc<str>| Some((Arc::clone(k), Adjoint::Num(body.vjp_morph(k, &rest)?)));
    let by_amounts = Adjoint::Record(amounts.keys().map(slope).collect::<Option<_>>()?);
    Some(smallvec![by.clone(), by_amounts, Adjoint::Num(body.vjp_cloth(&rest))])
}

/// For `scene.stretched`.
pub(super) fn stretched(a: &Args, _: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let body = armature(a).ok()?;
    let Value::Record(factors) = a.get(1) else { return None };
    let list = stretches(a, body).ok()?;
    let (by_factor, rest) = body.vjp_stretched(&list, &by_armature(by, body)).ok()?;
    let mut by_factors = Vec::with_capacity(list.len());
    for (((name, v), (_, stretch)), g) in factors.iter().zip(&list).zip(by_factor) {
        let by = match stretch {
            Stretch::Along(_) => Adjoint::Num(g.x),
            Stretch::Axes(_) => like(v, g),
        };
        by_factors.push((Arc::clone(name), by));
    }
    Some(smallvec![armature_adjoint(&rest), Adjoint::Record(by_factors)])
}
