//! Shapes and placements.

mod vjps;

use super::{AFFINE, AffineValue, SOLID, SolidValue, fault, native};
use glam::DVec3;
use pcadlang_engine::lang::builtins::{Args, Default, Row, Type, arg, flag, int, num, word};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::{Affine, Caps, Landmark, Profile, Solid, Wall, cuboid, lathe, sphere};
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
            int("sides", 48, [0, 1024], "The number of flat sides, 3 to 1024; 0 for a round surface, drawn without a mesh where it is the \
                 only object."),
            num("thickness", 0.0, "The thickness of the wall, for a vessel open at the top; 0 for a solid body.")
            .unit("scene units"),
            word("caps", &["both", "bottom", "top", "none"], "Which ends are closed."),
            num("floor", 0.0, "The height of a vessel's floor, or of its contents, above the lower end: at least the wall thickness.")
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
            int("sides", 32, [4, 1024], "The number of meridians."),
        ],
        SOLID,
        "A sphere centred at the origin.",
        |a| {
            let made = sphere(a.num("radius")?, a.int("sides")?);
            made.map(|m| solid(Solid::new(Arc::new(m)))).map_err(fault)
        },
    )
    .vjp(vjps::sphere),
    native(
        "box",
        SECTION,
        &[arg("size", Type::Nums, "The three edge lengths, or one number for a cube.").unit("scene units")],
        SOLID,
        "A box centred at the origin.",
        |a| cuboid(vector(a, "size")?).map(|m| solid(Solid::new(Arc::new(m)))).map_err(fault),
    )
    .vjp(vjps::cuboid),
    native(
        "group",
        SECTION,
        &[arg(
            "solids",
            Type::Any,
            "The solids: an array, or a record, which names them in the files of a run: \
             `{ cup: a, saucer: b }`.",
        )],
        SOLID,
        "Several solids combined into one.",
        |a| {
            let wanted = "an array or record of solids";
            let member = |v: &Value| {
                let solid = v.downcast::<SolidValue>().map(|s| s.0.clone());
                solid.ok_or_else(|| a.element_wrong(0, wanted, v))
            };
            let (names, members): (Vec<Arc<str>>, Vec<Solid>) = match a.get(0) {
                Value::Record(all) => {
                    let named = |(name, v): (&Arc<str>, &Value)| Ok((Arc::clone(name), member(v)?));
                    all.iter().map(named).collect::<Result<Vec<_>, Fault>>()?.into_iter().unzip()
                }
                array => {
                    let all = (0..array.len().unwrap_or(0)).map(|i| array.element(i).unwrap_or_default());
                    (Vec::new(), all.map(|v| member(&v)).collect::<Result<_, _>>()?)
                }
            };
            if members.is_empty() {
                return Err(a.wrong(0, wanted));
            }
            let count: usize = members.iter().map(Solid::mesh_count).sum();
            if count > MOST_MESHES {
                let message = format!("scene.group: a group of {count} meshes; at most {MOST_MESHES}");
                return Err(Fault::new(FaultKind::Limit, message));
            }
            Ok(Value::object(SolidValue::new(Solid::named_group(&members, names))))
        },
    )
    .vjp(vjps::group),
    native(
        "centred",
        SECTION,
        &[
            arg("solid", SOLID, "A solid."),
            flag("fit", "Also scales it so that the longest edge of its bounding box is 2."),
        ],
        SOLID,
        "The solid moved so that the centre of its bounding box is at the origin.",
        |a| {
            let s = a.object::<SolidValue>(0, "a solid")?;
            Ok(Value::object(SolidValue::new(s.0.centred(a.bool("fit")?))))
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
            Ok(Value::object(SolidValue::new(s.0.clone().with_landmarks(points))))
        },
    )
    .vjp(vjps::landmarks),
    native(
        "affine",
        SECTION,
        &[
            arg("translate", Type::Array, "The translation.").or(Default::Nums(&[0.0, 0.0, 0.0])).unit("scene units"),
            arg("rotate", Type::Array, "The rotations about x, then y, then z.").or(Default::Nums(&[0.0, 0.0, 0.0])).unit("radians"),
            arg("scale", Type::Nums, "The scale factors along the axes, or one for all.").or(Default::Num(1.0)),
        ],
        AFFINE,
        "An affine transformation (placement) p' = T Rz Ry Rx S p; `placement * solid` applies it \
         to a solid, and placements can be multiplied.",
        |a| {
            let placed = Affine::new(vector(a, "translate")?, vector(a, "rotate")?, vector(a, "scale")?);
            if !placed.is_finite() {
                return Err(Fault::domain("scene.affine: its numbers must be finite"));
            }
            Ok(Value::object(AffineValue(placed)))
        },
    )
    .vjp(vjps::affine),
];

fn solid(solid: Solid) -> Value {
    Value::object(SolidValue::new(solid))
}

/// Reads three numbers, or one for all three.
fn vector(a: &Args, name: &str) -> Result<DVec3, Fault> {
    a.vec3(name).map(DVec3::from)
}

/// Reads three numbers, one for all three, or a record of x, y and z.
pub(super) fn vector_of(v: &Value) -> Option<DVec3> {
    match v {
        Value::Num(x) => Some(DVec3::splat(*x)),
        Value::Array(xs) => <[f64; 3]>::try_from(&**xs).ok().map(DVec3::from_array),
        Value::Record(r) => {
            let part = |name: &str| match r.get(name) {
                Some(Value::Num(x)) => Some(*x),
                _ => None,
            };
            Some(DVec3::new(part("x")?, part("y")?, part("z")?))
        }
        _ => None,
    }
}

/// The number of flat sides of a round lathe's mesh, which is made for export and for
/// pictures of several objects.
const SIDES_OF_ROUND: u32 = 96;

/// The arguments of `lathe`.
struct LatheArgs {
    profiles: Vec<Profile>,
    sides: u32,
    /// It is drawn without a mesh where it is the only object.
    round: bool,
    wall: Wall,
    caps: Caps,
}

fn lathe_args(a: &Args) -> Result<LatheArgs, Fault> {
    let profiles = profiles(a)?;
    let round = matches!(a.get("sides"), Value::Num(0.0));
    let sides = if round { SIDES_OF_ROUND } else { a.int_in("sides", 3, 1024)? as u32 };
    let caps = match a.word("caps")? {
        "bottom" => Caps::Bottom,
        "top" => Caps::Top,
        "none" => Caps::None,
        _ => Caps::Both,
    };
    let wall = Wall { thickness: a.num("thickness")?, floor: a.num("floor")? };
    Ok(LatheArgs { profiles, sides, round, wall, caps })
}

/// Reads one profile or an array of them.
fn profiles(a: &Args) -> Result<Vec<Profile>, Fault> {
    let wanted = "profiles such as { y: [0, 1], r: [0.5, 0.4] }";
    let one = |v: &Value| {
        let Value::Record(record) = v else { return Err(a.element_wrong(0, wanted, v)) };
        let numbers = |name: &str| match record.get(name) {
            Some(Value::Array(xs)) => Ok(xs.to_vec()),
            Some(Value::Num(x)) => Ok(vec![*x]),
            Some(v) => Err(a.element_wrong(0, wanted, v)),
            None => Err(Fault::type_error(format!(
                "scene.lathe: a profile needs the field `{name}`: {wanted}"
            ))),
        };
        let (y, mut r) = (numbers("y")?, numbers("r")?);
        if r.len() == 1 {
            r.resize(y.len(), r[0]);
        }
        Ok(Profile { y, r })
    };
    match a.get(0) {
        v @ Value::Record(_) => Ok(vec![one(v)?]),
        Value::List(all) => all.iter().map(one).collect(),
        _ => Err(a.wrong(0, wanted)),
    }
}
