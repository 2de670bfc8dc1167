//! Keypoints of a distorted photograph in the pixels of the undistorted one.

use super::{Alternative, Keypoint, Keypoints};
use crate::vision::lens::Lens;

impl Keypoints {
    /// The joints as the pinhole of a lens sees them; those beyond what the lens shows are left
    /// out. They are in pixels of a picture of the lens's size if none is stated.
    #[must_use]
    pub fn undistorted(&self, lens: &Lens) -> Keypoints {
        let size = self.size.unwrap_or(lens.size());
        let Some(lens) = lens.scaled(size) else { return self.clone() };
        let to = lens.pinhole().size;
        let by = |side: u32| if self.normalised { f64::from(side) } else { 1.0 };
        let moved = |x: f64, y: f64| {
            let [x, y] = lens.undistorted(self.scaled([x, y], size))?;
            Some([x / by(to.0), y / by(to.1)])
        };
        let other = |o: &Alternative| {
            let [x, y] = moved(o.x, o.y)?;
            Some(Alternative { x, y, weight: o.weight })
        };
        let point = |p: &Keypoint| {
            let [x, y] = moved(p.x, p.y)?;
            let others = p.others.iter().filter_map(other).collect();
            Some(Keypoint { x, y, others, ..p.clone() })
        };
        let points = self.points.iter().filter_map(point).collect();
        Keypoints { points, size: Some(to), ..self.clone() }
    }
}
