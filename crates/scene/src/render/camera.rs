//! The camera: its position and orientation, its projection, and the same view at another
//! image size.
//!
//! It is not a lens model (no distortion) and holds no exposure. Invariant of every
//! camera made here: the axes are orthonormal and right-handed (`right x up = -forward`),
//! the image is 1 to [`Camera::MAX_SIDE`] pixels a side, and the focal length or pixel
//! size is finite and positive.

use glam::DVec3;
use thiserror::Error;

/// Why a camera cannot be constructed.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CameraError {
    /// The text is not JSON.
    #[error("the camera file is not valid JSON: {0}")]
    Json(String),
    /// The document is JSON, but not an object.
    #[error("a camera file holds one JSON object")]
    NotAnObject,
    /// A key that is not one of this program's cameras.
    #[error("the camera file has an unknown key `{key}`; {}", near(.nearest))]
    Unknown {
        /// The key.
        key: String,
        /// The known key nearest to it, if one is near.
        nearest: Option<&'static str>,
    },
    /// Another program's file that cannot be read, and why.
    #[error("{0}")]
    Other(String),
    /// A key that this model needs is missing.
    #[error("the camera file has no `{0}`")]
    Missing(&'static str),
    /// A key's value cannot be used.
    #[error("`{key}` in the camera file must be {wanted}")]
    Invalid {
        /// The key.
        key: &'static str,
        /// The values that are accepted.
        wanted: &'static str,
    },
}

impl CameraError {
    /// An error in a file of another program.
    pub(crate) fn other(why: impl Into<String>) -> CameraError {
        CameraError::Other(why.into())
    }
}

fn near(key: &Option<&str>) -> String {
    match key {
        Some(key) => format!("did you mean `{key}`?"),
        None => "`note` and `name` are for remarks".to_owned(),
    }
}

/// How camera coordinates become pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective: `x = cx + focal_px * X / depth`.
    Pinhole {
        /// Focal length in pixels.
        focal_px: f64,
        /// Principal point, pixels from the left edge.
        cx: f64,
        /// Principal point, pixels from the top edge.
        cy: f64,
    },
    /// Parallel: `x = cx + X / units_per_pixel`.
    Orthographic {
        /// Scene units that one pixel shows.
        units_per_pixel: f64,
        /// The camera position's pixel, from the left edge.
        cx: f64,
        /// The camera position's pixel, from the top edge.
        cy: f64,
    },
}

/// A camera and the size of its image.
///
/// Pixel (0, 0) is the top left one and has its centre at (0.5, 0.5); y runs down in the
/// image, up in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position in scene units; for a parallel projection, a point of the plane of depth
    /// 0.
    pub eye: DVec3,
    /// Unit vector to the right of the image.
    pub right: DVec3,
    /// Unit vector to the top of the image.
    pub up: DVec3,
    /// Unit viewing direction.
    pub forward: DVec3,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// From camera coordinates to pixels.
    pub projection: Projection,
}

impl Camera {
    /// The longest image side in pixels.
    pub const MAX_SIDE: u32 = 16384;

    /// The near plane: nothing at less than this depth (scene units) is drawn, in either
    /// projection.
    pub const NEAR: f64 = 1e-3;

    /// The default camera: a pinhole at (0, 0, 8) looking along -z, whose longer side
    /// shows 4.4 units at z = 0. Sides of 0 pixels count as 1, sides longer than
    /// [`Camera::MAX_SIDE`] as that.
    pub fn default_for(width: u32, height: u32) -> Camera {
        let (width, height) = (width.clamp(1, Self::MAX_SIDE), height.clamp(1, Self::MAX_SIDE));
        Camera {
            eye: DVec3::new(0.0, 0.0, 8.0),
            right: DVec3::X,
            up: DVec3::Y,
            forward: DVec3::NEG_Z,
            width,
            height,
            projection: Projection::Pinhole {
                focal_px: 8.0 / 4.4 * f64::from(width.max(height)),
                cx: f64::from(width) / 2.0,
                cy: f64::from(height) / 2.0,
            },
        }
    }

    /// A pinhole at `eye` that looks at `target` in a picture of this width and height, with
    /// `up` towards its top edge; `None` if the viewing direction is zero or parallel to `up`.
    pub fn looking_at(
        [eye, target, up]: [DVec3; 3],
        focal_px: f64,
        (width, height): (u32, u32),
    ) -> Option<Camera> {
        let forward = (target - eye).try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let projection = Projection::Pinhole { focal_px, cx, cy };
        Some(Camera { eye, right, up: right.cross(forward), forward, width, height, projection })
    }

    /// The same view with the longer side at `longer_side` pixels (1 to
    /// [`Camera::MAX_SIDE`]); the shorter side is rounded to whole pixels, at least 1.
    pub fn scaled_to(&self, longer_side: u32) -> Camera {
        let longer_side = longer_side.clamp(1, Self::MAX_SIDE);
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        let by = f64::from(longer_side) / w.max(h);
        let width = ((w * by).round() as u32).clamp(1, longer_side);
        let height = ((h * by).round() as u32).clamp(1, longer_side);
        self.sized(width, height, by)
    }

    /// The same view with each pixel cut into `by` by `by` pixels, `by` at least 1.
    pub(super) fn finer(&self, by: u32) -> Camera {
        let by = by.max(1);
        let (width, height) = (self.width.saturating_mul(by), self.height.saturating_mul(by));
        self.sized(width, height, f64::from(by))
    }

    /// The same view in a picture of another size, with lengths in it `by` times as long.
    fn sized(&self, width: u32, height: u32, by: f64) -> Camera {
        let bx = f64::from(width) / f64::from(self.width);
        let by_y = f64::from(height) / f64::from(self.height);
        let projection = match self.projection {
            Projection::Pinhole { focal_px, cx, cy } => {
                Projection::Pinhole { focal_px: focal_px * by, cx: cx * bx, cy: cy * by_y }
            }
            Projection::Orthographic { units_per_pixel, cx, cy } => Projection::Orthographic {
                units_per_pixel: units_per_pixel / by,
                cx: cx * bx,
                cy: cy * by_y,
            },
        };
        Camera { width, height, projection, ..*self }
    }

    /// The pixel position of a scene point and its depth: the distance along the viewing
    /// axis, in scene units. At a depth of 0 or less a pinhole's position is meaningless
    /// (it may be infinite or NaN).
    pub fn project(&self, point: DVec3) -> (f64, f64, f64) {
        let from = point - self.eye;
        let (x, y, depth) = (from.dot(self.right), from.dot(self.up), from.dot(self.forward));
        match self.projection {
            Projection::Pinhole { focal_px, cx, cy } => {
                (cx + focal_px * x / depth, cy - focal_px * y / depth, depth)
            }
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                (cx + x / units_per_pixel, cy - y / units_per_pixel, depth)
            }
        }
    }

    /// The derivative of a function of a scene point's image position with respect to the
    /// point, from that with respect to its two pixel coordinates.
    pub fn vjp_point(&self, point: DVec3, [by_x, by_y]: [f64; 2]) -> DVec3 {
        let from = point - self.eye;
        let (x, y, depth) = (from.dot(self.right), from.dot(self.up), from.dot(self.forward));
        match self.projection {
            Projection::Pinhole { focal_px, .. } => {
                let k = focal_px / depth;
                self.right * (by_x * k) - self.up * (by_y * k)
                    + self.forward * ((by_y * y - by_x * x) * k / depth)
            }
            Projection::Orthographic { units_per_pixel, .. } => {
                self.right * (by_x / units_per_pixel) - self.up * (by_y / units_per_pixel)
            }
        }
    }

    /// The scene point at a pixel position and depth; the inverse of [`Camera::project`].
    pub fn unproject(&self, x_px: f64, y_px: f64, depth: f64) -> DVec3 {
        let (x, y) = match self.projection {
            Projection::Pinhole { focal_px, cx, cy } => {
                ((x_px - cx) / focal_px * depth, (cy - y_px) / focal_px * depth)
            }
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                ((x_px - cx) * units_per_pixel, (cy - y_px) * units_per_pixel)
            }
        };
        self.eye + self.right * x + self.up * y + self.forward * depth
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_shows_four_point_four_units() {
        let camera = Camera::default_for(200, 100);
        let (x, y, d) = camera.project(DVec3::new(-2.2, 1.1, 0.0));
        assert!(x.abs() < 1e-9 && y.abs() < 1e-9 && (d - 8.0).abs() < 1e-12);
        let (x, y, _) = camera.project(DVec3::new(2.2, -1.1, 0.0));
        assert!((x - 200.0).abs() < 1e-9 && (y - 100.0).abs() < 1e-9);
    }

    #[test]
    fn scaling_keeps_the_view() {
        let mut camera = Camera::default_for(300, 200);
        camera.projection = Projection::Pinhole { focal_px: 410.0, cx: 130.0, cy: 120.0 };
        let small = camera.scaled_to(90);
        assert_eq!((small.width, small.height), (90, 60));
        let p = DVec3::new(0.3, -0.7, 1.2);
        let (a, b) = (camera.project(p), small.project(p));
        assert!((a.0 * 0.3 - b.0).abs() < 1e-9 && (a.1 * 0.3 - b.1).abs() < 1e-9 && a.2 == b.2);
        assert_eq!(camera.scaled_to(0).width, 1);
        let thin = Camera::default_for(1000, 2).scaled_to(10);
        assert_eq!((thin.width, thin.height), (10, 1));
    }

    #[test]
    fn derivatives_of_a_projection_are_those_of_differences() {
        let mut camera = Camera::default_for(64, 48);
        for orthographic in [false, true] {
            if orthographic {
                camera.projection =
                    Projection::Orthographic { units_per_pixel: 0.05, cx: 32.0, cy: 24.0 };
            }
            let (p, by) = (DVec3::new(0.4, 0.9, -1.5), [0.7, -1.3]);
            let f = |p: DVec3| {
                let (x, y, _) = camera.project(p);
                by[0] * x + by[1] * y
            };
            let g = camera.vjp_point(p, by);
            for (axis, g) in DVec3::AXES.into_iter().zip(g.to_array()) {
                let slope = (f(p + axis * 1e-6) - f(p - axis * 1e-6)) / 2e-6;
                assert!((g - slope).abs() < 1e-6, "{g} {slope}");
            }
        }
    }

    #[test]
    fn unproject_undoes_project() {
        let mut camera = Camera::default_for(64, 48);
        let p = DVec3::new(0.4, 0.9, -1.5);
        let (x, y, d) = camera.project(p);
        assert!((camera.unproject(x, y, d) - p).length() < 1e-12);
        camera.projection = Projection::Orthographic { units_per_pixel: 0.03, cx: 20.0, cy: 30.0 };
        let (x, y, d) = camera.project(p);
        assert!((x - (20.0 + 0.4 / 0.03)).abs() < 1e-9);
        assert!((camera.unproject(x, y, d) - p).length() < 1e-12);
    }
}
