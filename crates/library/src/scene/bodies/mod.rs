//! Bodies: shaping and posing armatures, and rigging meshes.

mod vjps;

use super::shapes::vector_of;
use super::{
    ARMATURE, AffineValue, ArmatureValue, SOLID, SolidValue, fault, incremental, left_out, native,
};
use glam::{DMat3, DVec3};
use pcadlang_engine::lang::builtins::{Args, Default, Row, Type, arg, flag, int, num, word};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Record, Value};
use pcadlang_scene::geom::armature::{Armature, JointPose, Posed, Rules, Stretch, Turn};
use std::sync::Arc;

const SECTION: &str = "Bodies";

/// Rigging, which the crate `autorig` does.
pub const AUTORIG: Row = native(
    "autorig",
    SECTION,
    &[
        arg("mesh", SOLID, "The mesh, as read by `data m: mesh`."),
        word(
            "from",
            &["groups", "skeleton"],
            "\"groups\": a joint for each object or group of the mesh, with its name; \
             \"skeleton\": `root`, `bone_1`, … along the medial axis of a closed mesh.",
        ),
        int("bones", 16, [1, 256], "The maximum number of joints of a skeleton."),
    ],
    ARMATURE,
    "An armature for a mesh without one: a tree with its root at the mesh's centre; its \
     joints are landmarks of the skinned solid from `scene.skin`. The surface is smoothed. If \
     it depends only on data it is computed once. Needs a build with the feature `autorig`.",
    |_| Err(left_out("scene.autorig", "autorig")),
);

pub(super) const TABLE: &[Row] = &[
    incremental(
        "skin",
        SECTION,
        &[
            arg("rig", ARMATURE, "The armature."),
            arg(
                "pose",
                Type::Any,
                "For each joint, in rig order or by name: a placement, a rotation vector, or a \
                 record with some of `rotvec`, `rotate`, `location`, `scale`; or one array with a \
                 rotation vector (three numbers) for each joint.",
            )
            .unit("radians; the mesh's units"),
            arg("stop_at", Type::Array, "Joints at which the effect of a location further down the chain ends.").or(Default::Nums(&[])),
            flag("inherit_scale", "Whether a joint's scale also applies to its child joints."),
        ],
        SOLID,
        "The armature's mesh in a pose (linear blend skinning): M[j] = M[parent] T(head + d) R S \
         T(-head). A location acts as an inverse kinematics handle: it turns the joint's \
         ancestors, up to the next joint in `stop_at`, by equal amounts towards it; the remainder \
         moves the joint itself.",
        |a, previous| {
            let body = armature(a)?;
            let rules = Rules { stops: stops(a, body)?, inherit_scale: a.bool("inherit_scale")? };
            let pose = pose(a, body)?;
            let before = previous.and_then(|p| p.state.downcast_ref::<Posed>());
            let (solid, posed) = body.posed_after(&pose, &rules, before).map_err(fault)?;
            Ok((Value::object(SolidValue::new(solid)), Arc::new(posed)))
        },
    )
    .vjp(vjps::skin),
    native(
        "shaped",
        SECTION,
        &[
            arg("rig", ARMATURE, "The armature."),
            arg("morphs", Type::Record, "The weight of each morph: 1 is the full morph; those not named \
                keep the weight that a glTF file has for them."),
            num("cloth", 0.0, "The distance of the surface (clothing) from the skin, \
                along the normals of the rest pose; joints are unchanged.")
            .unit("the mesh's units"),
        ],
        ARMATURE,
        "The armature with its rest shape changed by linear morphs, such as `{ tall: 0.5 }`.",
        |a| {
            let body = armature(a)?;
            let Value::Record(amounts) = a.get(1) else { return Err(a.wrong(1, "a record of numbers")) };
            let mut list = Vec::with_capacity(amounts.len());
            for (name, v) in amounts.iter() {
                let Value::Num(x) = v else { return Err(a.element_wrong(1, "a record of numbers", v)) };
                if !body.morphs().any(|m| *m == **name) {
                    let f = Fault::type_error(format!("scene.shaped: the armature has no morph `{name}`"));
                    return Err(f.with_nearest(name, "it has", body.morphs()));
                }
                list.push((&**name, *x));
            }
            body.clothed(&list, a.num("cloth")?).map(|b| Value::object(ArmatureValue::new(b))).map_err(fault)
        },
    )
    .vjp(vjps::shaped),
    native(
        "stretched",
        SECTION,
        &[
            arg("rig", ARMATURE, "The armature."),
            arg(
                "factors",
                Type::Record,
                "For each joint: the stretch factor of its bone, or three factors along the rest axes; each above 0.",
            ),
        ],
        ARMATURE,
        "The armature with longer or shorter bones in the rest pose, such as `{ thigh_l: 1.1 }`; \
         child joints move along.",
        |a| {
            let body = armature(a)?;
            body.stretched(&stretches(a, body)?).map(|b| Value::object(ArmatureValue::new(b))).map_err(fault)
        },
    )
    .vjp(vjps::stretched),
    AUTORIG,
];

const BODY: &str = "an armature";
const FACTORS: &str = "a record of numbers, or of three numbers each";

fn armature<'a>(a: &Args<'a>) -> Result<&'a Arc<Armature>, Fault> {
    a.object::<ArmatureValue>(0, BODY).map(|v| &v.0)
}

/// Returns the index of a joint in the armature's rig.
fn joint(a: &Args, body: &Armature, name: &str) -> Result<usize, Fault> {
    body.rig().find(name).ok_or_else(|| {
        let f =
            Fault::type_error(format!("{}: the rig has no joint `{name}`", a.builtin.full_name()));
        f.with_nearest(name, "it has", body.rig().joints().iter().map(|j| &*j.name))
    })
}

fn stops(a: &Args, body: &Armature) -> Result<Vec<bool>, Fault> {
    let names = a.elements("stop_at")?;
    if names.is_empty() {
        return Ok(Vec::new());
    }
    let mut stops = vec![false; body.rig().joints().len()];
    for name in names.iter() {
        match name {
            Value::Str(name) => stops[joint(a, body, name)?] = true,
            v => return Err(a.element_wrong("stop_at", "an array of joints' names", v)),
        }
    }
    Ok(stops)
}

/// Reads the stretch of each joint, in the order given.
fn stretches(a: &Args, body: &Armature) -> Result<Vec<(usize, Stretch)>, Fault> {
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

fn pose(a: &Args, body: &Armature) -> Result<Vec<JointPose>, Fault> {
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
