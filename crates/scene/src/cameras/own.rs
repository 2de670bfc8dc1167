//! This program's own cameras, as JSON.
//!
//! Keys: `model` (`pinhole` or `orthographic`), `position`, `looks_along`, `up`
//! (triples), `image` (width and height in pixels), `principal_point` (pixels), and
//! `focal_px` or `units_per_pixel`. A missing `principal_point` is the image centre; a
//! missing `position` of an orthographic camera is 8 units before the origin. `note` and `name`
//! are for remarks, `depth_scale` for the depth maps beside a camera; any other key is an error.
//! The result is always a valid [`Camera`].

use super::document::bare;
use crate::render::{Camera, CameraError, Projection};
use glam::DVec3;
use serde_json::{Map, Value};

/// Distance of an orthographic camera without a position, in scene units.
const DEFAULT_DISTANCE: f64 = 8.0;

/// Largest accepted magnitude of a number.
const LARGEST: f64 = 1e12;

/// The keys.
const KEYS: [&str; 11] = [
    "model",
    "position",
    "looks_along",
    "up",
    "image",
    "principal_point",
    "focal_px",
    "units_per_pixel",
    "note",
    "name",
    "depth_scale",
];

impl Camera {
    /// Parses the text of a camera file of this program's own; [`CameraFile`](super::CameraFile)
    /// reads those of others, too.
    ///
    /// # Errors
    /// The text is not a JSON object, a required key is missing or its value cannot be
    /// used, or a key is not known; the error names the key.
    pub fn from_json(text: &str) -> Result<Camera, CameraError> {
        let document: Value =
            serde_json::from_str(text).map_err(|e| CameraError::Json(e.to_string()))?;
        read(document.as_object().ok_or(CameraError::NotAnObject)?)
    }
}

pub(super) fn read(map: &Map<String, Value>) -> Result<Camera, CameraError> {
    if let Some(key) = map.keys().find(|k| !KEYS.contains(&k.as_str())) {
        return Err(CameraError::Unknown { key: key.clone(), nearest: nearest(key) });
    }
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

/// The known key that begins like another, or has the same letters but for a third; names of
/// other programs for the same things count, too.
fn nearest(key: &str) -> Option<&'static str> {
    const OTHERS: [(&str, &str); 12] = [
        ("width", "image"),
        ("height", "image"),
        ("size", "image"),
        ("resolution", "image"),
        ("eye", "position"),
        ("centre", "position"),
        ("center", "position"),
        ("forward", "looks_along"),
        ("direction", "looks_along"),
        ("lookat", "looks_along"),
        ("focal", "focal_px"),
        ("comment", "note"),
    ];
    let bare = bare(&key.chars().take(64).collect::<String>());
    let known = KEYS.iter().map(|k| (super::document::bare(k), *k));
    let all = known.chain(OTHERS.iter().map(|(a, b)| ((*a).to_owned(), *b)));
    let changed = |name: &str| match name.len() > 3 && bare.starts_with(name) {
        true => 0,
        false => letters_changed(&bare, name),
    };
    let near = all.map(|(name, k)| (changed(&name), name.len(), k));
    near.filter(|(d, n, _)| 3 * d <= *n.max(&bare.len())).min().map(|(_, _, k)| k)
}

/// The number of letters to insert, leave out or replace (Levenshtein).
fn letters_changed(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut before = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.bytes().enumerate() {
            let here = (before + usize::from(x != y)).min(row[j] + 1).min(row[j + 1] + 1);
            before = std::mem::replace(&mut row[j + 1], here);
        }
    }
    row[b.len()]
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
    use crate::render::cases;

    const GOOD: &str = r#"{"model": "pinhole", "position": [0, 0, 8.0], "looks_along": [0, 0, -1], "up": [0, 1, 0],
        "image": [256, 200], "focal_px": 465.5, "principal_point": [120.0, 90.5], "note": "for people"}"#;

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
                message(
                    &GOOD
                        .replace("\"note\"", "\"name\"")
                        .replace(&format!("\"{key}\""), "\"note\"")
                ),
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
    fn unknown_keys_are_errors_with_the_nearest() {
        for (key, nearest) in [
            ("focal", Some("focal_px")),
            ("focal_length_px", Some("focal_px")),
            ("Position", Some("position")),
            ("look_along", Some("looks_along")),
            ("width", Some("image")),
            ("principalPoint", Some("principal_point")),
            ("zzz", None),
        ] {
            let text = GOOD.replace("\"note\"", &format!("{key:?}"));
            let unknown = CameraError::Unknown { key: key.into(), nearest };
            assert_eq!(Camera::from_json(&text), Err(unknown), "{key}");
        }
        let said = Camera::from_json(&GOOD.replace("note", "focal")).unwrap_err().to_string();
        assert_eq!(said, "the camera file has an unknown key `focal`; did you mean `focal_px`?");
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
