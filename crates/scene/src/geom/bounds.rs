//! Axis-aligned boxes.

use glam::DVec3;

/// An axis-aligned box, both corners included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The corner with the smallest coordinates.
    pub min: DVec3,
    /// The corner with the largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// Returns the smallest box around some points; `None` if there are no points.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Option<Bounds> {
        points.into_iter().fold(None, |b: Option<Bounds>, p| {
            Some(match b {
                None => Bounds { min: p, max: p },
                Some(b) => Bounds { min: b.min.min(p), max: b.max.max(p) },
            })
        })
    }

    /// The centre.
    pub fn centre(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// The edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }
}
