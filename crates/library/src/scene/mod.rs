//! The module `scene`: shapes, placements, cameras, and the likelihoods that compare a
//! view with an observation.
//!
//! The scene is a guest of the engine: it registers everything through [`pcadlang_inference::host`], as
//! any embedding program does. It is a thin layer: [`pcadlang_scene::geom`], [`pcadlang_scene::render`] and
//! [`pcadlang_scene::vision`] do the work; here their values become values of the language.

mod adjoints;
mod bodies;
pub mod camera_file;
mod candidates;
mod compare;
mod compare_depths;
mod compare_keypoints;
pub mod data;
mod examples;
mod found_objects;
pub mod hint;
mod inputs;
mod objects;
mod observed;
mod observed_maps;
mod people;
pub mod places;
mod pointed_out;
mod region;
mod scene_view;
mod seeing;
mod shapes;

pub use bodies::AUTORIG;
pub use data::DETECTOR;
pub use objects::{AffineValue, ArmatureValue, CameraValue, Remarks, SolidValue, ViewValue};
pub use observed::{DetectorValue, ImageValue, KeypointsValue};
pub use observed_maps::{DepthValue, MaskValue};
pub use scene_view::SceneView;

pub use pcadlang_engine::lang::builtins::{Arg, Args, Resume, Row, Type, function};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_inference::host::{Entry, Host};
use pcadlang_scene::geom::GeomError;
use std::sync::Arc;

const SOLID: Type = Type::Object("a solid");
const ARMATURE: Type = Type::Object("an armature");
const AFFINE: Type = Type::Object("a placement");
const CAMERA: Type = Type::Object("a camera");
const VIEW: Type = Type::Object("a view");
const IMAGE: Type = Type::Object("an image");

/// A pure function of this module.
const fn native(
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
    f: fn(&Args) -> Result<Value, Fault>,
) -> Row {
    Row { module: "scene", ..function(name, section, args, returns, doc, f) }
}

/// A function of this module that may start from its previous evaluation.
const fn incremental(
    name: &'static str,
    section: &'static str,
    args: &'static [Arg],
    returns: Type,
    doc: &'static str,
    f: Resume,
) -> Row {
    Row { module: "scene", ..Row::incremental(name, section, args, returns, doc, f) }
}

/// The scene as a host: its functions, its kinds of data, and how it prepares inputs.
pub fn host() -> Host {
    let tables = [
        data::TABLE,
        shapes::TABLE,
        bodies::TABLE,
        seeing::TABLE,
        compare::TABLE,
        region::TABLE,
        observed::TABLE,
        people::TABLE,
        hint::TABLE,
        found_objects::TABLE,
        candidates::TABLE,
        compare_keypoints::TABLE,
        compare_depths::TABLE,
    ];
    let host = Host::new().hook(Arc::new(inputs::Inputs));
    tables.into_iter().flatten().fold(host, |host, row| host.with(entry(row)))
}

/// A row of this module with its example. A crate apart takes a row that is declared here,
/// gives it what it does, and registers it as `replacing()`.
pub fn entry(row: &Row) -> Entry {
    let entry = Entry::from(row);
    match examples::of(row) {
        Some(text) => entry.example(text),
        None => entry,
    }
}

/// The error of what a crate apart brings, in a build without it.
fn left_out(what: &str, feature: &str) -> Fault {
    let f = format!("{what}: this build was made without the feature `{feature}`");
    Fault::new(FaultKind::Other, f)
        .with_hint(format!("build it with `cargo install --path . --features {feature}`"))
}

/// Converts the error of a shape that cannot be made: numbers outside their domain reject
/// a proposal, anything else ends the run.
pub fn fault(e: GeomError) -> Fault {
    match e {
        GeomError::Domain(m) => Fault::domain(m),
        GeomError::Invalid(m) => Fault::new(FaultKind::Other, m),
    }
}
