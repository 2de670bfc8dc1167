//! Camera files of this field's tools, read as cameras of scenes.
//!
//! [`CameraFile::read`] recognises a file by its content. Whatever a tool's axes are (OpenCV and
//! its kin: x right, y down, z forward; OpenGL, Blender, glTF: x right, y up, z backward), the
//! world stays that of the file: a point (x, y, z) there is (x, y, z) in the scene, unless an up
//! axis or a unit is asked for. A principal point of a tool whose first pixel has its centre at
//! (0, 0) is moved by half a pixel: here that centre is (0.5, 0.5).
//!
//! | format | centre of the first pixel | axes of the camera |
//! | --- | --- | --- |
//! | this program's own | 0.5 | by directions |
//! | OpenCV, ROS, RealSense, Kinect (`intrinsics`) | 0 | OpenCV |
//! | COLMAP, text and binary (`colmap`) | 0.5 | OpenCV |
//! | `transforms.json` of NeRFs (`nerf`) | 0.5 | OpenGL |
//! | BOP (`bop`), Open3D (`open3d`) | 0 | OpenCV |
//! | glTF, Exif | (the angle of view) | OpenGL, none |
//!
//! This is not a calibration: fisheye lenses, skewed pixels and tilted sensors are refused.

mod bop;
mod colmap;
mod document;
mod gltf;
mod intrinsics;
mod nerf;
mod open3d;
mod own;
mod pose;

use crate::geom::FileFrame;
use crate::render::{Camera, CameraError, Projection};
use crate::vision::{Distortion, Lens, Limits, Pinhole, photo};
use pose::Pose;

/// Reads a file named relative to the camera file; the error is a message.
pub type Beside<'a> = dyn Fn(&str) -> Result<Vec<u8>, String> + 'a;

/// What to read of a camera file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Asked<'a> {
    /// The picture, of a file with several: a name, the end of a path, or a number.
    pub picture: Option<&'a str>,
    /// The path of the photograph, which selects a picture if none is named.
    pub photo: Option<&'a str>,
    /// The up axis and the unit of the file's world.
    pub world: FileFrame,
    /// Where the camera stands; by default where the file says, or else at the default view.
    pub at: Option<Standpoint>,
}

/// Where a camera stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standpoint {
    /// Where the file says; a camera without a position is at the origin of its own frame.
    File,
    /// On the z axis, looking along -z, where the picture's longer side shows 4.4 units at z = 0.
    View,
}

/// The numbers of a lens.
#[derive(Clone, Debug, PartialEq)]
enum Intrinsics {
    /// A camera of this program's own.
    Own(Camera),
    /// Focal lengths and principal point in pixels, of a picture of a size that may be known.
    Pixels {
        size: Option<(u32, u32)>,
        focal: [f64; 2],
        /// From the corner of the first pixel.
        centre: [f64; 2],
        distortion: Distortion,
    },
    /// Half the extent of the picture at distance 1, across or down.
    Angle { half: f64, across: bool, aspect: Option<f64> },
}

/// A camera as a file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraFile {
    /// The format.
    pub format: &'static str,
    /// The model of the lens, as the file calls it.
    pub model: String,
    /// The picture that was selected.
    pub picture: Option<String>,
    /// What users should know of how it was read.
    pub remarks: Vec<String>,
    intrinsics: Intrinsics,
    pose: Option<Pose>,
    at: Option<Standpoint>,
}

/// A camera for pictures of a known size.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The camera, a pinhole with square pixels (or an orthographic one of this program's own).
    pub camera: Camera,
    /// The lens by which photographs must be undistorted to suit it, if they must.
    pub lens: Option<Lens>,
}

impl CameraFile {
    /// Reads a file. `name` is its path, `beside` reads the files that belong to it (COLMAP's).
    ///
    /// # Errors
    /// If the format is not known, the file is damaged, has several cameras of which none was
    /// asked for, or has a lens that is not of these models; the error names what is wrong.
    pub fn read(
        name: &str,
        bytes: &[u8],
        asked: &Asked,
        beside: &Beside,
    ) -> Result<CameraFile, CameraError> {
        let mut file = by_content(name, bytes, asked, beside)?;
        if let (Some(picture), None) = (asked.picture, &file.picture) {
            return Err(CameraError::other(format!(
                "the file has one camera, without a name, and none called `{picture}`"
            )));
        }
        file.at = asked.at;
        if asked.world != FileFrame::default() {
            match (&mut file.intrinsics, &mut file.pose) {
                (Intrinsics::Own(_), _) => {
                    return Err(CameraError::other(
                        "`up` and `unit` are for other programs' files; this one is in the scene's \
                         axes and units",
                    ));
                }
                (_, Some(pose)) => *pose = pose.within(&asked.world),
                // The camera's own frame is the world.
                (_, pose) => *pose = Some(Pose::own_frame().within(&asked.world)),
            }
            if file.at.is_none() && !file.has_position() {
                file.at = Some(Standpoint::File);
            }
        }
        Ok(file)
    }

    fn new(format: &'static str, model: impl Into<String>, intrinsics: Intrinsics) -> CameraFile {
        let model = model.into();
        CameraFile {
            format,
            model,
            picture: None,
            remarks: Vec::new(),
            intrinsics,
            pose: None,
            at: None,
        }
    }

    /// True if the file says where the camera is.
    pub fn has_position(&self) -> bool {
        self.pose.is_some() || matches!(self.intrinsics, Intrinsics::Own(_))
    }

    /// Returns the camera for a photograph of this size, or without one. A size that the file
    /// states stays; without any, the principal point is the centre of the picture.
    ///
    /// # Errors
    /// If the numbers cannot be those of a lens.
    pub fn seen(&self, picture: Option<(u32, u32)>) -> Result<Seen, CameraError> {
        let (pinhole, lens) = match &self.intrinsics {
            Intrinsics::Own(camera) => {
                let camera = match (self.at, camera.projection) {
                    (Some(Standpoint::View), Projection::Pinhole { focal_px, cx, cy }) => {
                        let size = (camera.width, camera.height);
                        viewing(Pinhole { size, focal_px, centre: [cx, cy] })
                    }
                    _ => *camera,
                };
                return Ok(Seen { camera, lens: None });
            }
            Intrinsics::Pixels { size, focal, centre, distortion } => {
                let middle = || {
                    let side = |c: f64| (2.0 * c).round().clamp(1.0, 16384.0) as u32;
                    (side(centre[0]), side(centre[1]))
                };
                let size = size.or(picture).unwrap_or_else(middle);
                let lens = Lens::new(size, *focal, *centre, *distortion).ok_or_else(|| {
                    CameraError::other(format!(
                        "focal lengths {focal:?} and principal point {centre:?} pixels cannot be \
                         those of a picture of {} x {} pixels",
                        size.0, size.1
                    ))
                })?;
                (lens.pinhole(), (!lens.is_pinhole()).then_some(lens))
            }
            Intrinsics::Angle { half, across, aspect } => {
                let usual = || {
                    let aspect = aspect.unwrap_or(1.0);
                    let side = |n: f64| n.round().clamp(1.0, 256.0) as u32;
                    (side(256.0 * aspect.min(1.0)), side(256.0 / aspect.max(1.0)))
                };
                let size = picture.unwrap_or_else(usual);
                let side = f64::from(if *across { size.0 } else { size.1 });
                let centre = [f64::from(size.0) / 2.0, f64::from(size.1) / 2.0];
                (Pinhole { size, focal_px: side / 2.0 / half, centre }, None)
            }
        };
        let pose = match (self.at, &self.pose) {
            (Some(Standpoint::View), _) | (None, None) => {
                return Ok(Seen { camera: viewing(pinhole), lens });
            }
            (_, Some(pose)) => *pose,
            (Some(Standpoint::File), None) => Pose::own_frame(),
        };
        Ok(Seen { camera: placed(pinhole, pose), lens })
    }
}

impl Camera {
    /// The default view by another lens, in longer sides of the picture: from where the longer
    /// side shows 4.4 units at z = 0, too. [`Camera::default_for`] has a lens of 8 / 4.4.
    pub fn default_by(width: u32, height: u32, focal: f64) -> Camera {
        let Camera { width, height, .. } = Camera::default_for(width, height);
        let focal_px = focal * f64::from(width.max(height));
        let centre = [f64::from(width) / 2.0, f64::from(height) / 2.0];
        viewing(Pinhole { size: (width, height), focal_px, centre })
    }
}

fn placed(
    Pinhole { size: (width, height), focal_px, centre: [cx, cy] }: Pinhole,
    p: Pose,
) -> Camera {
    let Pose { eye, right, up, forward } = p;
    let projection = Projection::Pinhole { focal_px, cx, cy };
    Camera { eye, right, up, forward, width, height, projection }
}

/// The camera of the default view by a pinhole.
fn viewing(pinhole: Pinhole) -> Camera {
    let usual = Camera::default_for(pinhole.size.0, pinhole.size.1);
    let (w, h) = pinhole.size;
    let eye = usual.eye * (pinhole.focal_px / (usual.eye.z / 4.4 * f64::from(w.max(h))));
    let Camera { right, up, forward, .. } = usual;
    placed(pinhole, Pose { eye, right, up, forward })
}

/// What is read, for messages.
const KNOWN: &str = "this program's own JSON, OpenCV or ROS (YAML, JSON), COLMAP (cameras and images, \
    .txt or .bin), NeRF's transforms.json, BOP's scene_camera.json, Open3D, RealSense or Kinect \
    intrinsics (JSON), glTF, a photograph with Exif";

fn by_content(
    name: &str,
    bytes: &[u8],
    asked: &Asked,
    beside: &Beside,
) -> Result<CameraFile, CameraError> {
    if bytes.starts_with(b"glTF") {
        return gltf::read(bytes, asked);
    }
    if bytes.starts_with(b"\xff\xd8\xff") || bytes.starts_with(b"\x89PNG") {
        return exif(bytes);
    }
    if let Some(kind) = colmap::kind(name, bytes) {
        return colmap::read(kind, bytes, asked, beside);
    }
    let text = std::str::from_utf8(bytes)
        .map_err(|_| CameraError::other(format!("not a camera file: known are {KNOWN}")))?;
    let text = text.trim_start_matches('\u{feff}');
    if text.trim_start().starts_with('<') {
        return Err(CameraError::other(
            "XML is not read; OpenCV writes the same as YAML or JSON: cv::FileStorage with a name \
             that ends in .yml or .json",
        ));
    }
    let document = document::parse(text)?;
    let Some(map) = document.as_object() else { return Err(CameraError::NotAnObject) };
    if map.contains_key("asset") {
        return gltf::read(bytes, asked);
    }
    let readers = [nerf::read, open3d::read, bop::read, intrinsics::read];
    for read in readers {
        if let Some(file) = read(map, asked)? {
            return Ok(file);
        }
    }
    if !map.contains_key("model") {
        return Err(CameraError::other(format!(
            "the camera file has no `model`, and is not of another known kind: {KNOWN}"
        )));
    }
    let camera = own::read(map)?;
    let model = match camera.projection {
        Projection::Pinhole { .. } => "pinhole",
        Projection::Orthographic { .. } => "orthographic",
    };
    Ok(CameraFile::new("this program's own", model, Intrinsics::Own(camera)))
}

/// The lens that a photograph states.
fn exif(bytes: &[u8]) -> Result<CameraFile, CameraError> {
    let unreadable = |e: crate::vision::VisionError| CameraError::other(e.to_string());
    let photo = photo::decode(bytes, &Limits::default()).map_err(unreadable)?;
    let focal = photo.focal().ok_or_else(|| {
        CameraError::other(
            "the photograph states no focal length in its Exif data, or its size is not the one \
             stated there, as after cropping",
        )
    })?;
    let (w, h) = (photo.width(), photo.height());
    let focal_px = focal * f64::from(w.max(h));
    Ok(CameraFile::new(
        "Exif of a photograph",
        "pinhole",
        Intrinsics::Pixels {
            size: Some((w, h)),
            focal: [focal_px; 2],
            centre: [f64::from(w) / 2.0, f64::from(h) / 2.0],
            distortion: Distortion::default(),
        },
    ))
}

/// Selects the camera of a picture: the one that was asked for, that of the photograph, or the
/// only one. Numbers are compared as numbers (`000012` is 12).
fn selected<'a, T>(
    all: &'a [(String, T)],
    asked: &Asked,
    what: &str,
) -> Result<&'a (String, T), CameraError> {
    let ways: [fn(&str, &str) -> bool; 4] = [
        |have, want| have == want,
        |have, want| ends(want, have) || ends(have, want),
        |have, want| stem(have) == stem(want),
        |have, want| stem(have).parse::<u64>().is_ok_and(|n| Ok(n) == stem(want).parse()),
    ];
    let find = |want: &str| {
        for is in ways {
            let found: Vec<_> = all.iter().filter(|(have, _)| is(have, want)).collect();
            match found[..] {
                [] => {}
                [one] => return Some(Ok(one)),
                _ => {
                    let names: Vec<&str> = found.iter().map(|(n, _)| &**n).take(8).collect();
                    return Some(Err(CameraError::other(format!(
                        "`{want}` is not one {what}: {}",
                        names.join(", ")
                    ))));
                }
            }
        }
        None
    };
    let listed = || {
        let names: Vec<&str> = all.iter().map(|(n, _)| &**n).take(8).collect();
        let more = if all.len() > names.len() { ", …" } else { "" };
        format!("{}{more}", names.join(", "))
    };
    match (asked.picture.map(|p| (p, find(p))), asked.photo.and_then(find), all) {
        (Some((_, Some(found))), ..) => found,
        (Some((want, None)), ..) => {
            Err(CameraError::other(format!("there is no {what} `{want}`, but {}", listed())))
        }
        (None, Some(found), _) => found,
        (None, None, [one]) => Ok(one),
        (None, None, []) => Err(CameraError::other(format!("the file has no {what}"))),
        (None, None, _) => Err(CameraError::other(format!(
            "the file has {} {what}s; say which: FILE#NAME, one of {}",
            all.len(),
            listed()
        ))),
    }
}

/// True if a path ends with another, at a folder's border.
fn ends(path: &str, with: &str) -> bool {
    let (path, with) = (path.replace('\\', "/"), with.trim_start_matches("./").replace('\\', "/"));
    path == with || path.strip_suffix(&*with).is_some_and(|rest| rest.ends_with('/'))
}

/// The name of a path's file, without its ending.
fn stem(path: &str) -> &str {
    let file = path.rsplit(['/', '\\']).next().unwrap_or(path);
    match file.rsplit_once('.') {
        Some((stem, ending)) if !stem.is_empty() && ending.len() <= 5 => stem,
        _ => file,
    }
}

#[cfg(test)]
mod tests;
