//! The coordinate frame of a mesh file: which axis points up, and the length of its unit.
//!
//! Only rotations and scales, no mirrors. Invariant: the unit is positive and finite.

use super::GeomError;
use glam::DVec3;

/// The axis of a file that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// +x.
    X,
    /// +y, as in scenes.
    #[default]
    Y,
    /// +z.
    Z,
    /// -y, as in a camera's own frame with y down and z forward.
    MinusY,
}

/// The map from a file's coordinates to the scene's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FileFrame {
    up: UpAxis,
    unit: f64,
}

impl Default for FileFrame {
    fn default() -> FileFrame {
        FileFrame { up: UpAxis::Y, unit: 1.0 }
    }
}

impl FileFrame {
    /// Makes a frame with this axis up and a unit of this many scene units (metres).
    ///
    /// # Errors
    /// A unit that is not positive and finite.
    pub fn new(up: UpAxis, unit: f64) -> Result<FileFrame, GeomError> {
        if unit > 0.0 && unit.is_finite() {
            Ok(FileFrame { up, unit })
        } else {
            Err(GeomError::invalid(format!(
                "the unit of a file must be a positive number of metres, got {unit}"
            )))
        }
    }

    /// Maps a file's point to the scene. With z up, x stays and the file's +y becomes -z;
    /// with x up, z stays; with -y up, x stays.
    pub fn apply(&self, p: DVec3) -> DVec3 {
        let turned = match self.up {
            UpAxis::X => DVec3::new(-p.y, p.x, p.z),
            UpAxis::Y => p,
            UpAxis::Z => DVec3::new(p.x, p.z, -p.y),
            UpAxis::MinusY => DVec3::new(p.x, -p.y, -p.z),
        };
        turned * self.unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_becomes_y_and_hands_stay() {
        for (up, axis) in [
            (UpAxis::X, DVec3::X),
            (UpAxis::Y, DVec3::Y),
            (UpAxis::Z, DVec3::Z),
            (UpAxis::MinusY, -DVec3::Y),
        ] {
            let f = FileFrame::new(up, 0.5).unwrap();
            assert_eq!(f.apply(axis), DVec3::Y * 0.5);
            let [x, y, z] = DVec3::AXES.map(|a| f.apply(a) * 2.0);
            assert_eq!(x.cross(y), z, "right-handed");
        }
        for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(FileFrame::new(UpAxis::Y, unit).is_err());
        }
    }
}
