//! The module `scene`: shapes, placements, cameras, and the likelihoods that compare a
//! view with an observation.
//!
//! A thin layer over [`crate::geom`], [`crate::render`] and [`crate::vision`], which
//! implement geometry, rendering and comparison; here their values become values of the
//! language.

mod adjoints;
mod bodies;
mod body_vjps;
mod candidates;
mod compare;
mod compare_depths;
mod compare_keypoints;
mod edges;
mod objects;
mod observed;
mod people;
mod region;
mod seeing;
mod shape_vjps;
mod shapes;

pub(crate) use compare::{by_contours, by_silhouette};
pub use objects::{AffineValue, ArmatureValue, CameraValue, SolidValue, ViewValue};
pub use observed::{DepthValue, DetectorValue, ImageValue, KeypointsValue, MaskValue};

use super::{Arg, Args, Row, Type, function};
use crate::geom::GeomError;
use crate::lang::error::{Fault, FaultKind};
use crate::lang::value::Value;

const SOLID: Type = Type::Object("a solid");
const ARMATURE: Type = Type::Object("an armature");
const AFFINE: Type = Type::Object("a placement");
const CAMERA: Type = Type::Object("a camera");
const VIEW: Type = Type::Object("a view");
const IMAGE: Type = Type::Object("an image");
const DETECTOR: Type = Type::Object("a detector");

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

/// All built-ins of the module.
pub(super) fn all() -> impl Iterator<Item = &'static Row> {
    let keypoints =
        [people::TABLE, candidates::TABLE, compare_keypoints::TABLE, compare_depths::TABLE];
    let comparing = [compare::TABLE, region::TABLE, edges::TABLE].into_iter().chain(keypoints);
    let tables = [shapes::TABLE, bodies::TABLE, seeing::TABLE].into_iter().chain(comparing);
    tables.flatten()
}

/// Converts the error of a shape that cannot be made: numbers outside their domain reject
/// a proposal, anything else ends the run.
fn fault(e: GeomError) -> Fault {
    match e {
        GeomError::Domain(m) => Fault::domain(m),
        GeomError::Invalid(m) => Fault::new(FaultKind::Other, m),
    }
}
