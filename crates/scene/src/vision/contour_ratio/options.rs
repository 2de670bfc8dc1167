//! The options of the contour score.

use crate::vision::elements::{ComparatorError, check};

/// Options of [`ContourRatio`](super::ContourRatio). Lengths are percent of the image
/// diagonal. The defaults were chosen on ten pictures of 256 x 256 pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct ContourRatioOptions {
    /// Fraction of pieces that have a matching observed edge, above 0 and below 1.
    /// Default 0.75.
    pub foreground: f64,
    /// Standard deviation of the half-normal distance of those pieces, above 0. Default
    /// 0.4.
    pub sd: f64,
    /// Distances from this value on count as "no edge nearby", above 0. Default 3.3.
    pub truncate: f64,
    /// Side of the window around a piece from which the background density is estimated,
    /// as a fraction of the picture's sides, above 0 and at most 2. Default 0.25.
    pub window: f64,
    /// Length of rendered contour that observed edges match at full score, as a multiple
    /// of their own length, above 0. Default 2.
    pub credit: f64,
    /// Power to which the likelihood ratio of a `unit` of contour is raised, at least 0.
    /// Default 0.5.
    pub weight: f64,
    /// Length of contour that counts as one observation, above 0. Default 0.5524: two
    /// pixels of a 256 x 256 picture.
    pub unit: f64,
    /// Length of contour in view (percent of the diagonal, above 0) below which a penalty
    /// applies, linear in the missing length. Default 10.
    pub least: f64,
    /// The penalty with nothing in view, as the length of contour far from every edge
    /// that has the same score; at least 0. Default 1000: ten diagonals.
    pub nothing: f64,
}

impl ContourRatioOptions {
    /// The defaults.
    pub const USUAL: ContourRatioOptions = ContourRatioOptions {
        foreground: 0.75,
        sd: 0.4,
        truncate: 3.3,
        window: 0.25,
        credit: 2.0,
        weight: 0.5,
        unit: 200.0 / (256.0 * std::f64::consts::SQRT_2),
        least: 10.0,
        nothing: 1000.0,
    };
}

impl Default for ContourRatioOptions {
    fn default() -> Self {
        ContourRatioOptions::USUAL
    }
}

impl ContourRatioOptions {
    pub(super) fn check(&self) -> Result<(), ComparatorError> {
        check(
            "foreground",
            "above 0 and below 1",
            self.foreground,
            self.foreground > 0.0 && self.foreground < 1.0,
        )?;
        check("sd", "above 0", self.sd, self.sd > 0.0)?;
        check("truncate", "above 0", self.truncate, self.truncate > 0.0)?;
        check(
            "window",
            "above 0 and at most 2",
            self.window,
            self.window > 0.0 && self.window <= 2.0,
        )?;
        check("credit", "above 0", self.credit, self.credit > 0.0)?;
        check("weight", "at least 0", self.weight, self.weight >= 0.0)?;
        check("unit", "above 0", self.unit, self.unit > 0.0)?;
        check("least", "above 0", self.least, self.least > 0.0)?;
        check("nothing", "at least 0", self.nothing, self.nothing >= 0.0)
    }
}
