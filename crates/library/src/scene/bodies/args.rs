//! Reading the arguments of bodies.

use crate::scene::shapes::vector_of;
use crate::scene::{AffineValue, ArmatureValue};
use glam::{DMat3, DVec3};
use pcadlang_engine::lang::builtins::Args;
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Record, Value};
use pcadlang_scene::geom::armature::{Armature, JointPose, Stretch, Turn};
use std::sync::Arc;

const BODY: &str = "an armature";
const FACTORS: &str = "a record of numbers, or of three numbers each";

pub(super) fn armature<'a>(a: &Args<'a>) -> Result<&'a Arc<Armature>, Fault> {
    a.object::<ArmatureValue>(0, BODY).map(|v| &v.0)
}

/// Returns the index of a joint in the armature's rig.
pub(super) fn joint(a: &Args, body: &Armature, name: &str) -> Result<usize, Fault> {
    body.rig().find(name).ok_or_else(|| {
        let f =
            Fault::type_error(format!("{}: the rig has no joint `{name}`", a.builtin.full_name()));
        f.with_nearest(name, "it has", body.rig().joints().iter().map(|j| &*j.name))
    })
}

pub(super) fn stops(a: &Args, body: &Armature) -> Result<Vec<bool>, Fault> {
    let mut stops = Vec::new();
    if !a.given(2) {
        return Ok(stops);
    }
    stops.resize(body.rig().joints().len(), false);
    for i in 0..a.get(2).len().unwrap_or(0) {
        match a.get(2).element(i).unwrap_or_default() {
            Value::Str(name) => stops[joint(a, body, &name)?] = true,
            v => return Err(a.element_wrong(2, "an array of joints' names", &v)),
        }
    }
    Ok(stops)
}

/// Reads the stretch of each joint, in the order given.
pub(super) fn stretches(a: &Args, body: &Armature) -> Result<Vec<(usize, Stretch)>, Fault> {
    let Value::Record(factors) = a.get(1) else { return Err(a.wrong(1, FACTORS)) };
    let mut list = Vec::with_capacity(factors.len());
    for (name, v) in factors.iter() {
        let stretch = match v {
            Value::Num(f) => Stretch::Along(*f),
            v => Stretch::Axes(vector_of(v).ok_or_else(|| a.element_wrong(1, FACTORS, v))?),
        };
        list.push((joint(a, body, name)?, stretch));
    }
    Ok(list)
}

pub(super) fn pose(a: &Args, body: &Armature) -> Result<Vec<JointPose>, Fault> {
    let count = body.rig().joints().len();
    match a.get(1) {
        Value::Array(xs) if xs.is_empty() => Ok(Vec::new()),
        Value::Array(xs) => {
            if xs.len() != 3 * count {
                return Err(
                    a.wrong_length(1, &format!("three numbers for each of the {count} joints"))
                );
            }
            Ok(xs.chunks_exact(3).map(|v| JointPose::turned(DVec3::from_slice(v))).collect())
        }
        Value::List(all) => {
            if all.len() != count {
                return Err(
                    a.wrong_length(1, &format!("one element for each of the {count} joints"))
                );
            }
            all.iter().map(|v| one(a, v)).collect()
        }
        Value::Record(by_name) => {
            let mut pose = vec![JointPose::REST; count];
            for (name, v) in by_name.iter() {
                pose[joint(a, body, name)?] = one(a, v)?;
            }
            Ok(pose)
        }
        _ => Err(a.wrong(1, "the poses of joints")),
    }
}

const WANTED: &str =
    "a placement, a rotation vector, or a record with `rotvec`, `rotate`, `location`, `scale`";

/// Reads the pose of one joint.
fn one(a: &Args, v: &Value) -> Result<JointPose, Fault> {
    if let Some(placement) = v.downcast::<AffineValue>() {
        return affine(a, placement);
    }
    match v {
        Value::Unit => Ok(JointPose::REST),
        Value::Array(_) => {
            vector_of(v).map(JointPose::turned).ok_or_else(|| a.element_wrong(1, WANTED, v))
        }
        Value::Record(fields) => record(a, fields),
        _ => Err(a.element_wrong(1, WANTED, v)),
    }
}

/// Decomposes a placement without shear into location, rotation and scale; the scale acts
/// first.
fn affine(a: &Args, placement: &AffineValue) -> Result<JointPose, Fault> {
    let m = placement.0.0.matrix3;
    let scale = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    let turn = DMat3::from_cols(m.x_axis / scale.x, m.y_axis / scale.y, m.z_axis / scale.z);
    let off = (turn.transpose() * turn - DMat3::IDENTITY)
        .to_cols_array()
        .iter()
        .fold(0.0, |m: f64, x| m.max(x.abs()));
    // Also rejects a scale of 0, for which `off` is NaN.
    if !(off < 1e-9 && turn.determinant() > 0.0) {
        let name = a.builtin.full_name();
        return Err(Fault::domain(format!(
            "{name}: a joint's placement may rotate and scale, but not shear or mirror"
        )));
    }
    Ok(JointPose { location: placement.0.0.translation, turn: Turn::Matrix(turn), scale })
}

fn record(a: &Args, fields: &Record) -> Result<JointPose, Fault> {
    let mut pose = JointPose::REST;
    for (name, v) in fields {
        let of = vector_of(v).ok_or_else(|| a.element_wrong(1, WANTED, v))?;
        match &**name {
            "rotvec" => pose.turn = Turn::Vector(of),
            "rotate" => pose.turn = Turn::Angles(of),
            "location" => pose.location = of,
            "scale" => pose.scale = of,
            _ => {
                let f =
                    Fault::type_error(format!("scene.skin: a joint's pose has no field `{name}`"));
                return Err(f.with_nearest(
                    name,
                    "it has",
                    ["rotvec", "rotate", "location", "scale"].into_iter(),
                ));
            }
        }
    }
    if fields.contains_key("rotvec") && fields.contains_key("rotate") {
        return Err(Fault::type_error(
            "scene.skin: a joint's pose has either `rotvec` or `rotate`",
        ));
    }
    Ok(pose)
}
