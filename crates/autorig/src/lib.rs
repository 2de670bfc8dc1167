//! `scene.autorig` for programs: armatures for meshes that have none. Built into the command by
//! the feature `autorig`; in Rust, `Program::host(&pcadlang_autorig::host())`.
#![warn(missing_docs)]
#![forbid(unsafe_code)]
#![warn(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

mod groups;
mod near;
mod rigging;
mod skeleton;
mod skin;
#[cfg(test)]
mod tests;
mod tree;
mod voxels;

pub use rigging::{MOST_BONES, MOST_GROUPED_TRIANGLES, MOST_GROUPS, by_groups, by_skeleton};

use pcadlang_engine::lang::builtins::Kind;
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::Value;
use pcadlang_inference::host::{Args, Host};
use pcadlang_library::scene::{self, ArmatureValue, Row, SolidValue, fault};

/// `scene.autorig` as it is declared in the module `scene`, with what it does.
pub fn host() -> Host {
    let row = Row { kind: Kind::Function(autorig), ..scene::AUTORIG };
    Host::new().with(scene::entry(&row).replacing())
}

fn autorig(a: &Args) -> Result<Value, Fault> {
    let solid = a.object::<SolidValue>(0, "a solid")?;
    let mesh = solid.0.to_mesh().map_err(fault)?;
    let most = a.int("bones")? as usize;
    let made = match a.word("from")? {
        "skeleton" => by_skeleton(&mesh, most).map_err(fault),
        _ => by_groups(&mesh).map_err(|e| {
            let one = mesh.topology.parts.windows(2).all(|p| p[0] == p[1]);
            let f = fault(e);
            if one { f.with_hint("for a mesh in one piece use `from = \"skeleton\"`") } else { f }
        }),
    };
    made.map(|b| Value::object(ArmatureValue::new(b)))
}
