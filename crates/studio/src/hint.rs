//! A hint as the page sends and gets it, in the shape of the record of `scene.hint`.

use super::protocol::{AxisJson, HintJson};
use pcadlang_runs::failure::Failure;
use pcadlang_runs::hint::HintArgs;

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
