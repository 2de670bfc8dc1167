//! Cameras from JSON.
//!
//! Keys: `model` (`pinhole` or `orthographic`), `position`, `looks_along`, `up`
//! (triples), `image` (width and height in pixels), `principal_point` (pixels), and
//! `focal_px` or `units_per_pixel`. A missing `principal_point` is the image centre; a
//! missing `position` of an orthographic camera is 8 units before the origin. Other keys
//! are ignored. This is not a general scene format. The result is always a valid
//! [`Camera`].

use super::{Camera, CameraError, Projection};
use glam::DVec3;
use serde_json::{Map, Value};

/// Distance of an orthographic camera without a position, in scene units.
const DEFAULT_DISTANCE: f64 = 8.0;

/// Largest accepted magnitude of a number.
const LARGEST: f64 = 1e12;

impl Camera {
    /// Parses the text of a camera file.
    ///
    /// # Errors
    /// The text is not a JSON object, or a required key is missing or its value cannot be
    /// used; the error names the key.
    pub fn from_json(text: &str) -> Result<Camera, CameraError> {
        let document: Value =
            serde_json::from_str(text).map_err(|e| CameraError::Json(e.to_string()))?;
        let map = document.as_object().ok_or(CameraError::NotAnObject)?;
        let pinhole = match map.get("model").ok_or(CameraError::Missing("model"))?.as_str() {
            Some("pinhole") => true,
            Some("orthographic") => false,
            _ => {
                return Err(CameraError::Invalid {
                    key: "model",
                    wanted: "\"pinhole\" or \"orthographic\"",
                });
            }
        };
        let forward = direction(map, "looks_along")?;
        let right = forward.cross(direction(map, "up")?);
        if right.length() < 1e-6 {
            return Err(CameraError::Invalid {
                key: "up",
                wanted: "a direction other than `looks_along`'s",
            });
        }
        let right = right.normalize();
        let eye = match triple(map, "position") {
            Err(CameraError::Missing(_)) if !pinhole => -DEFAULT_DISTANCE * forward,
            other => other?,
        };
        let (width, height) = image(map)?;
        let (cx, cy) = match map.get("principal_point") {
            None => (f64::from(width) / 2.0, f64::from(height) / 2.0),
            Some(value) => match numbers(value).as_deref() {
                Some([x, y]) => (*x, *y),
                _ => {
                    return Err(CameraError::Invalid {
                        key: "principal_point",
                        wanted: "two numbers (pixels)",
                    });
                }
            },
        };
        let projection = if pinhole {
            Projection::Pinhole { focal_px: positive(map, "focal_px")?, cx, cy }
        } else {
            Projection::Orthographic { units_per_pixel: positive(map, "units_per_pixel")?, cx, cy }
        };
        Ok(Camera { eye, right, up: right.cross(forward), forward, width, height, projection })
    }
}

/// The numbers of an array; `None` unless all are at most [`LARGEST`] in magnitude.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(|v| v.as_f64().filter(|x| x.abs() <= LARGEST)).collect()
}

fn triple(map: &Map<String, Value>, key: &'static str) -> Result<DVec3, CameraError> {
    match numbers(map.get(key).ok_or(CameraError::Missing(key))?).as_deref() {
        Some([x, y, z]) => Ok(DVec3::new(*x, *y, *z)),
        _ => Err(CameraError::Invalid { key, wanted: "three numbers" }),
    }
}

fn direction(map: &Map<String, Value>, key: &'static str) -> Result<DVec3, CameraError> {
    let v = triple(map, key)?;
    if v.length() < 1e-9 {
        return Err(CameraError::Invalid { key, wanted: "a direction other than zero" });
    }
    Ok(v.normalize())
}

fn positive(map: &Map<String, Value>, key: &'static str) -> Result<f64, CameraError> {
    match map.get(key).ok_or(CameraError::Missing(key))?.as_f64() {
        Some(x) if (1e-12..=LARGEST).contains(&x) => Ok(x),
        _ => Err(CameraError::Invalid { key, wanted: "a positive number" }),
    }
}

fn image(map: &Map<String, Value>) -> Result<(u32, u32), CameraError> {
    let side = |x: f64| {
        (x >= 1.0 && x <= f64::from(Camera::MAX_SIDE) && x.fract() == 0.0).then_some(x as u32)
    };
    let value = numbers(map.get("image").ok_or(CameraError::Missing("image"))?);
    if let Some([w, h]) = value.as_deref()
        && let (Some(w), Some(h)) = (side(*w), side(*h))
    {
        return Ok((w, h));
    }
    Err(CameraError::Invalid {
        key: "image",
        wanted: "a width and a height, whole pixels from 1 to 16384",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::testing::cases;

    const GOOD: &str = r#"{"model": "pinhole", "position": [0, 0, 8.0], "looks_along": [0, 0, -1], "up": [0, 1, 0],
        "image": [256, 200], "focal_px": 465.5, "principal_point": [120.0, 90.5], "note": "ignored"}"#;

    #[test]
    fn reads_a_pinhole() {
        let camera = Camera::from_json(GOOD).unwrap();
        assert_eq!((camera.width, camera.height), (256, 200));
        assert_eq!(camera.eye, DVec3::new(0.0, 0.0, 8.0));
        assert_eq!((camera.right, camera.up, camera.forward), (DVec3::X, DVec3::Y, DVec3::NEG_Z));
        assert_eq!(camera.projection, Projection::Pinhole { focal_px: 465.5, cx: 120.0, cy: 90.5 });
    }

    #[test]
    fn pictures_have_at_most_so_many_pixels_a_side() {
        let sized = |side: &str| Camera::from_json(&GOOD.replace("256, 200", side));
        for side in ["16384, 1", "1, 16384"] {
            assert!(sized(side).is_ok(), "{side}");
        }
        for side in ["16385, 1", "1, 16385", "0, 1", "1.5, 1"] {
            assert!(sized(side).is_err(), "{side}");
        }
    }

    #[test]
    fn an_orthographic_camera_needs_no_position() {
        let text = r#"{"model": "orthographic", "looks_along": [0, 0, -2], "up": [0, 1, 1], "image": [192, 256],
            "units_per_pixel": 0.0171875}"#;
        let camera = Camera::from_json(text).unwrap();
        assert_eq!(camera.eye, DVec3::new(0.0, 0.0, 8.0));
        assert_eq!(
            camera.projection,
            Projection::Orthographic { units_per_pixel: 0.0171875, cx: 96.0, cy: 128.0 }
        );
    }

    #[test]
    fn bad_files_are_named() {
        let message = |text: &str| Camera::from_json(text).unwrap_err().to_string();
        for key in ["model", "position", "looks_along", "up", "image", "focal_px"] {
            assert_eq!(
                message(&GOOD.replace(&format!("\"{key}\""), "\"x\"")),
                format!("the camera file has no `{key}`")
            );
        }
        for (from, to, key) in [
            ("pinhole", "fisheye", "`model`"),
            ("[0, 0, 8.0]", "[0, 0]", "`position`"),
            ("[0, 0, 8.0]", "[0, 0, \"a\"]", "`position`"),
            ("[0, 0, 8.0]", "[0, 0, 1e300]", "`position`"),
            ("[0, 0, -1]", "[0, 0, 0]", "`looks_along`"),
            ("[0, 1, 0]", "[0, 0, 3]", "`up`"),
            ("[256, 200]", "[0, 200]", "`image`"),
            ("[256, 200]", "[256.5, 200]", "`image`"),
            ("[256, 200]", "[256, 9999999]", "`image`"),
            ("465.5", "-3", "`focal_px`"),
            ("465.5", "0", "`focal_px`"),
            ("[120.0, 90.5]", "[1, 2, 3]", "`principal_point`"),
        ] {
            assert!(message(&GOOD.replace(from, to)).contains(key), "{from} -> {to}");
        }
        assert!(message("{").starts_with("the camera file is not valid JSON"));
        assert_eq!(Camera::from_json("[1]"), Err(CameraError::NotAnObject));
        assert!(message(&GOOD.replace("465.5", "1e999")).len() > 5);
    }

    #[test]
    fn reads_the_files_of_the_data_set() {
        for (name, folder) in cases() {
            let text = std::fs::read_to_string(folder.join("camera.json")).unwrap();
            let camera = Camera::from_json(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(camera.forward, DVec3::NEG_Z, "{name}");
            if let Projection::Pinhole { focal_px, .. } = camera.projection {
                let Projection::Pinhole { focal_px: ours, .. } =
                    Camera::default_for(camera.width, camera.height).projection
                else {
                    unreachable!()
                };
                assert!((focal_px - ours).abs() < 1e-9, "{name}");
            }
        }
    }
}
