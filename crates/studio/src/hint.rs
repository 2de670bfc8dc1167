//! A hint as the page sends and gets it, in the shape of the record of `scene.hint`.

use pcadlang_runs::failure::Failure;
use pcadlang_runs::hint::HintArgs;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Where the object is in the photograph, pixels; everything is optional.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct HintJson {
    /// The file of a mask, in the opened folder.
    pub mask: Option<PathBuf>,
    /// The corners of an outline.
    pub outline: Vec<[f64; 2]>,
    /// Left, top, width and height.
    #[serde(rename = "box")]
    pub bounds: Option<[f64; 4]>,
    /// The object's axis.
    pub axis: Option<AxisJson>,
    /// Positions on the object.
    pub at: Vec<[f64; 2]>,
    /// Positions beside it.
    pub not: Vec<[f64; 2]>,
}

/// An axis, pixels.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AxisJson {
    /// The end on which the object stands.
    pub foot: [f64; 2],
    /// The other end.
    pub top: [f64; 2],
    /// The width across it.
    pub width: f64,
}

impl HintJson {
    /// Returns the arguments of a command that give this hint.
    pub fn arguments(self) -> HintArgs {
        HintArgs {
            mask: self.mask,
            outline: if self.outline.is_empty() { Vec::new() } else { vec![self.outline] },
            bounds: self.bounds,
            axis: self
                .axis
                .map_or(Vec::new(), |a| vec![a.foot.to_vec(), a.top.to_vec(), vec![a.width]]),
            at: self.at,
            not: self.not,
        }
    }

    /// Returns the hint of a command.
    ///
    /// # Errors
    /// If its axis is not two ends and a width.
    pub fn of(arguments: &HintArgs) -> Result<HintJson, Failure> {
        let axis = arguments.axis()?;
        Ok(HintJson {
            mask: arguments.mask.clone(),
            outline: arguments.outline.concat(),
            bounds: arguments.bounds,
            axis: axis.map(|a| AxisJson { foot: a.foot, top: a.top, width: a.width }),
            at: arguments.at.clone(),
            not: arguments.not.clone(),
        })
    }
}
