//! Bodies: shaping and posing armatures, and rigging meshes.

mod args;
mod vjps;

use super::{ARMATURE, ArmatureValue, SOLID, SolidValue, fault, incremental, left_out, native};
use args::{armature, pose, stops, stretches};
use pcadlang_engine::lang::builtins::{Row, Type, arg, opt};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::armature::{Posed, Rules};
use std::sync::Arc;

const SECTION: &str = "Bodies";

/// Rigging, which the crate `autorig` does.
pub const AUTORIG: Row = native(
    "autorig",
    SECTION,
    &[
        arg("mesh", SOLID, "The mesh, as read by `data m: mesh`."),
        opt(
            "from",
            Type::Str,
            "\"groups\"",
            "\"groups\": a joint for each object or group of the mesh, with its name; \
             \"skeleton\": `root`, `bone_1`, … along the medial axis of a closed mesh.",
        ),
        opt("bones", Type::Int, "16", "The maximum number of joints of a skeleton, 1 to 256."),
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
            opt("stop_at", Type::Array, "[]", "Joints at which the effect of a location further down the chain ends."),
            opt("inherit_scale", Type::Bool, "false", "Whether a joint's scale also applies to its child joints."),
        ],
        SOLID,
        "The armature's mesh in a pose (linear blend skinning): M[j] = M[parent] T(head + d) R S \
         T(-head). A location acts as an inverse kinematics handle: it turns the joint's \
         ancestors, up to the next joint in `stop_at`, by equal amounts towards it; the remainder \
         moves the joint itself.",
        |a, previous| {
            let body = armature(a)?;
            let rules = Rules { stops: stops(a, body)?, inherit_scale: a.bool_or(3, false)? };
            let pose = pose(a, body)?;
            let before = previous.and_then(|p| p.state.downcast_ref::<Posed>());
            let (solid, posed) = body.posed_after(&pose, &rules, before).map_err(fault)?;
            Ok((Value::object(SolidValue(solid)), Arc::new(posed)))
        },
    )
    .vjp(vjps::skin),
    native(
        "shaped",
        SECTION,
        &[
            arg("rig", ARMATURE, "The armature."),
            arg("morphs", Type::Record, "The weight of each morph: 1 is the full morph."),
            opt(
                "cloth",
                Type::Num,
                "0",
                "The distance of the surface (clothing) from the skin, \
                along the normals of the rest pose; joints are unchanged.",
            )
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
            body.clothed(&list, a.num_or(2, 0.0)?).map(|b| Value::object(ArmatureValue(Arc::new(b)))).map_err(fault)
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
            body.stretched(&stretches(a, body)?).map(|b| Value::object(ArmatureValue(Arc::new(b)))).map_err(fault)
        },
    )
    .vjp(vjps::stretched),
    AUTORIG,
];
