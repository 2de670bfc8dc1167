//! Reading the arguments of shapes.

use glam::DVec3;
use pcadlang_engine::lang::builtins::Args;
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::{Caps, Profile, Wall};

/// Reads three numbers, or one for all three, or returns a default.
pub(in crate::scene) fn vector(a: &Args, i: usize, default: DVec3) -> Result<DVec3, Fault> {
    match a.get(i) {
        Value::Unit => Ok(default),
        Value::Num(x) => Ok(DVec3::splat(*x)),
        _ => match a.array(i)?[..] {
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            _ => Err(a.wrong_length(i, "3 numbers")),
        },
    }
}

/// Reads three numbers, one for all three, or a record of x, y and z.
pub(in crate::scene) fn vector_of(v: &Value) -> Option<DVec3> {
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
pub(super) struct LatheArgs {
    pub profiles: Vec<Profile>,
    pub sides: u32,
    /// Whether it is drawn without a mesh where it is the only object.
    pub round: bool,
    pub wall: Wall,
    pub caps: Caps,
}

pub(super) fn lathe_args(a: &Args) -> Result<LatheArgs, Fault> {
    let profiles = profiles(a)?;
    let round = matches!(a.get(1), Value::Num(0.0));
    let sides = match a.given(1) {
        _ if round => SIDES_OF_ROUND,
        true => a.int_in(1, 3, 1024)? as u32,
        false => 48,
    };
    let caps = match a.choice(3, &["both", "bottom", "top", "none"])? {
        "bottom" => Caps::Bottom,
        "top" => Caps::Top,
        "none" => Caps::None,
        _ => Caps::Both,
    };
    let wall = Wall { thickness: a.num_or(2, 0.0)?, floor: a.num_or(4, 0.0)? };
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
