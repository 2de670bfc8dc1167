//! Observed masks and depth maps, with what users should know of them.

use super::observed::Prepared;
use pcadlang_engine::lang::value::Object;
use pcadlang_scene::vision::{DepthMap, Mask};
use std::any::Any;

/// An observed mask.
#[derive(Debug)]
pub struct MaskValue {
    /// The mask.
    pub mask: Mask,
    pub(super) prepared: Prepared,
}

impl MaskValue {
    /// Creates an observed mask.
    pub fn new(mask: Mask) -> Self {
        MaskValue { mask, prepared: Prepared::default() }
    }
}

impl Object for MaskValue {
    fn type_name(&self) -> &'static str {
        "a mask"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn remark(&self) -> Option<String> {
        let on = self.mask.data().iter().filter(|on| **on).count();
        let what = match on {
            0 => "empty: no pixel is on the object",
            n if n == self.mask.data().len() => "full: every pixel is on the object",
            _ => return None,
        };
        Some(format!("the mask is {what}"))
    }

    fn numbers(&self) -> Option<Vec<f64>> {
        Some(self.mask.data().iter().map(|m| f64::from(u8::from(*m))).collect())
    }
}

/// An observed depth map.
#[derive(Debug)]
pub struct DepthValue {
    /// The depth map.
    pub depth: DepthMap,
    pub(super) prepared: Prepared,
}

impl DepthValue {
    /// Creates an observed depth map.
    pub fn new(depth: DepthMap) -> Self {
        DepthValue { depth, prepared: Prepared::default() }
    }
}

impl Object for DepthValue {
    fn type_name(&self) -> &'static str {
        "a depth map"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn remark(&self) -> Option<String> {
        let all = self.depth.data();
        let missing = all.iter().filter(|d| d.is_nan()).count();
        (missing > 0).then(|| {
            let n = all.len();
            format!("{missing} of the {n} depths are taken as not measured: 0 (`missing`) or NaN")
        })
    }

    /// The depths; background is infinite, NaN is not measured.
    fn numbers(&self) -> Option<Vec<f64>> {
        Some(self.depth.data().iter().map(|d| f64::from(*d)).collect())
    }
}
