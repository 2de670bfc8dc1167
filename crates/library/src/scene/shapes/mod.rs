//! Shapes and placements.

mod args;
mod vjps;

pub(super) use args::{vector, vector_of};

use super::{AFFINE, AffineValue, SOLID, SolidValue, fault, native};
use args::{LatheArgs, lathe_args};
use glam::DVec3;
use pcadlang_engine::lang::builtins::{Row, Type, arg, opt};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::{Affine, Landmark, Solid, cuboid, lathe, sphere};
use std::sync::Arc;

const SECTION: &str = "Shapes";

/// The maximum number of meshes in a group.
const MOST_MESHES: usize = 100_000;

pub(super) const TABLE: &[Row] = &[
    native(
        "lathe",
        SECTION,
        &[
            arg("parts", Type::Any, "A profile `{ y: heights, r: radii }`, or an array of them, from the bottom up.")
                .unit("scene units"),
            opt(
                "sides",
                Type::Int,
                "48",
                "The number of flat sides, 3 to 1024; 0 for a round surface, drawn without a mesh where it is the \
                 only object.",
            ),
            opt(
                "thickness",
                Type::Num,
                "0",
                "The thickness of the wall, for a vessel open at the top; 0 for a solid body.",
            )
            .unit("scene units"),
            opt("caps", Type::Str, "\"both\"", "Which ends are closed: \"both\", \"bottom\", \"top\" or \"none\"."),
            opt(
                "floor",
                Type::Num,
                "0",
                "The height of a vessel's floor, or of its contents, above the lower end: at least the wall thickness.",
            )
            .unit("scene units"),
        ],
        SOLID,
        "A surface of revolution: profiles stacked and swept around the y axis; a step from one \
         profile to the next is closed by a ring.",
        |a| {
            let LatheArgs { profiles, sides, round, wall, caps } = lathe_args(a)?;
            let made = match round {
                true => Solid::exact_lathe(&profiles, sides, wall, caps),
                false => lathe(&profiles, sides, wall, caps).map(|m| Solid::new(Arc::new(m))),
            };
            made.map(solid).map_err(fault)
        },
    )
    .vjp(vjps::lathe),
    native(
        "sphere",
        SECTION,
        &[
            arg("radius", Type::Num, "The radius.").unit("scene units"),
            opt("sides", Type::Int, "32", "The number of meridians, 4 to 1024."),
        ],
        SOLID,
        "A sphere centred at the origin.",
        |a| {
            let sides = if a.given(1) { a.int_in(1, 4, 1024)? as u32 } else { 32 };
            sphere(a.num(0)?, sides).map(|m| solid(Solid::new(Arc::new(m)))).map_err(fault)
        },
    )
    .vjp(vjps::sphere),
    native(
        "box",
        SECTION,
        &[arg("size", Type::Nums, "The three edge lengths, or one number for a cube.").unit("scene units")],
        SOLID,
        "A box centred at the origin.",
        |a| cuboid(vector(a, 0, DVec3::ONE)?).map(|m| solid(Solid::new(Arc::new(m)))).map_err(fault),
    )
    .vjp(vjps::cuboid),
    native(
        "group",
        SECTION,
        &[arg("solids", Type::Array, "The solids.")],
        SOLID,
        "Several solids combined into one.",
        |a| {
            let n = a.get(0).len().unwrap_or(0);
            let members = (0..n).map(|i| {
                let v = a.get(0).element(i).unwrap_or_default();
                v.downcast::<SolidValue>()
                    .map(|s| s.0.clone())
                    .ok_or_else(|| a.element_wrong(0, "an array of solids", &v))
            });
            let members = members.collect::<Result<Vec<_>, _>>()?;
            if members.is_empty() {
                return Err(a.wrong(0, "an array of solids"));
            }
            let count: usize = members.iter().map(Solid::mesh_count).sum();
            if count > MOST_MESHES {
                let message = format!("scene.group: a group of {count} meshes; at most {MOST_MESHES}");
                return Err(Fault::new(FaultKind::Limit, message));
            }
            Ok(Value::object(SolidValue(Solid::group(&members))))
        },
    )
    .vjp(vjps::group),
    native(
        "centred",
        SECTION,
        &[
            arg("solid", SOLID, "A solid."),
            opt("fit", Type::Bool, "false", "Also scales it so that the longest edge of its bounding box is 2."),
        ],
        SOLID,
        "The solid moved so that the centre of its bounding box is at the origin.",
        |a| {
            let s = a.object::<SolidValue>(0, "a solid")?;
            Ok(Value::object(SolidValue(s.0.centred(a.bool_or(1, false)?))))
        },
    )
    .vjp(vjps::centred),
    native(
        "landmarks",
        SECTION,
        &[
            arg("solid", SOLID, "A solid."),
            arg("points", Type::Record, "Names and positions, as in `{ tip: [0, 2, 0] }`.").unit("scene units"),
        ],
        SOLID,
        "The solid with named points that move with it, replacing those it had; `solid.landmarks` returns them.",
        |a| {
            let s = a.object::<SolidValue>(0, "a solid")?;
            let point = |(name, v): (&Arc<str>, &Value)| match v {
                Value::Array(p) if p.len() == 3 && p.iter().all(|x| x.is_finite()) => {
                    Ok(Landmark { name: Arc::clone(name), position: DVec3::new(p[0], p[1], p[2]) })
                }
                Value::Array(p) if p.len() == 3 => {
                    Err(Fault::domain(format!("scene.landmarks: the point `{name}` must be finite")))
                }
                _ => Err(a.wrong(1, "a record of points [x, y, z]")),
            };
            let points = a.record(1)?.iter().map(point).collect::<Result<Vec<_>, _>>()?;
            Ok(Value::object(SolidValue(s.0.clone().with_landmarks(points))))
        },
    )
    .vjp(vjps::landmarks),
    native(
        "affine",
        SECTION,
        &[
            opt("translate", Type::Array, "[0, 0, 0]", "The translation.").unit("scene units"),
            opt("rotate", Type::Array, "[0, 0, 0]", "The rotations about x, then y, then z.").unit("radians"),
            opt("scale", Type::Nums, "1", "The scale factors along the axes, or one for all."),
        ],
        AFFINE,
        "An affine transformation (placement) p' = T Rz Ry Rx S p; `placement * solid` applies it \
         to a solid, and placements can be multiplied.",
        |a| {
            let placed = Affine::new(vector(a, 0, DVec3::ZERO)?, vector(a, 1, DVec3::ZERO)?, vector(a, 2, DVec3::ONE)?);
            if !placed.is_finite() {
                return Err(Fault::domain("scene.affine: its numbers must be finite"));
            }
            Ok(Value::object(AffineValue(placed)))
        },
    )
    .vjp(vjps::affine),
];

fn solid(solid: Solid) -> Value {
    Value::object(SolidValue(solid))
}
