//! COLMAP's models, text and binary: `cameras` has the lenses, `images` where each picture was
//! taken from. Either file may be given; the other one is read beside it. `cameras` alone is a
//! lens without a position.
//!
//! Source: COLMAP's "Output format" and `colmap/sensor/models.h`. A principal point is from the
//! corner of the first pixel, as here.

use super::intrinsics::UNDISTORT;
use super::pose::Pose;
use super::{Asked, Beside, CameraFile, Intrinsics, selected};
use crate::render::CameraError;
use crate::vision::Distortion;
use glam::{DMat3, DQuat, DVec3};

/// A file of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kind {
    images: bool,
    binary: bool,
}

/// The models, in the order of their numbers, with the number of their parameters; `None` for
/// those that are not supported.
const MODELS: [(&str, usize, Option<Read>); 18] = [
    ("SIMPLE_PINHOLE", 3, Some(|p| simple(p, &[]))),
    ("PINHOLE", 4, Some(|p| full(p, &[]))),
    ("SIMPLE_RADIAL", 4, Some(|p| simple(p, &p[3..]))),
    ("RADIAL", 5, Some(|p| simple(p, &p[3..]))),
    ("OPENCV", 8, Some(|p| full(p, &p[4..]))),
    ("OPENCV_FISHEYE", 8, None),
    ("FULL_OPENCV", 12, Some(|p| full(p, &p[4..]))),
    ("FOV", 5, None),
    ("SIMPLE_RADIAL_FISHEYE", 4, None),
    ("RADIAL_FISHEYE", 5, None),
    ("THIN_PRISM_FISHEYE", 12, None),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16, None),
    ("SIMPLE_DIVISION", 4, None),
    ("DIVISION", 5, None),
    ("SIMPLE_FISHEYE", 3, None),
    ("FISHEYE", 4, None),
    ("EUCM", 6, None),
    ("EQUIRECTANGULAR", 2, None),
];

/// Reads the parameters of a model.
type Read = fn(&[f64]) -> Numbers;

/// Focal lengths, principal point and distortion.
type Numbers = ([f64; 2], [f64; 2], Distortion);

/// Parameters f, cx, cy[, k1[, k2]].
fn simple(p: &[f64], k: &[f64]) -> Numbers {
    let c = |i: usize| k.get(i).copied().unwrap_or(0.0);
    let distortion = Distortion { radial: [c(0), c(1), 0.0, 0.0], ..Distortion::default() };
    ([p[0]; 2], [p[1], p[2]], distortion)
}

/// Parameters fx, fy, cx, cy, and OpenCV's k1, k2, p1, p2, k3, k4, k5, k6.
fn full(p: &[f64], k: &[f64]) -> Numbers {
    let c = |i: usize| k.get(i).copied().unwrap_or(0.0);
    let distortion = Distortion {
        radial: [c(0), c(1), c(4), 0.0],
        divisor: [c(5), c(6), c(7)],
        tangential: [c(2), c(3)],
        ..Distortion::default()
    };
    ([p[0], p[1]], [p[2], p[3]], distortion)
}

/// A lens, and where a picture was taken.
struct Camera {
    id: u32,
    model: usize,
    size: (u64, u64),
    parameters: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Taken {
    camera: u32,
    rotation: [f64; 4],
    translation: [f64; 3],
}

/// Recognises a file of a model by its name, and of a text by its head or first line, too.
pub(super) fn kind(name: &str, bytes: &[u8]) -> Option<Kind> {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name).to_ascii_lowercase();
    match &*file {
        "cameras.bin" => return Some(Kind { images: false, binary: true }),
        "images.bin" => return Some(Kind { images: true, binary: true }),
        "cameras.txt" => return Some(Kind { images: false, binary: false }),
        "images.txt" => return Some(Kind { images: true, binary: false }),
        _ => {}
    }
    let text = std::str::from_utf8(bytes).ok()?;
    if text.starts_with("# Camera list") {
        return Some(Kind { images: false, binary: false });
    }
    if text.starts_with("# Image list") {
        return Some(Kind { images: true, binary: false });
    }
    let first = text.lines().map(str::trim).find(|l| !l.is_empty() && !l.starts_with('#'))?;
    let model = first.split_whitespace().nth(1)?;
    MODELS.iter().any(|(m, ..)| *m == model).then_some(Kind { images: false, binary: false })
}

pub(super) fn read(
    kind: Kind,
    bytes: &[u8],
    asked: &Asked,
    beside: &Beside,
) -> Result<CameraFile, CameraError> {
    let ending = if kind.binary { "bin" } else { "txt" };
    let other = format!("{}.{ending}", if kind.images { "cameras" } else { "images" });
    let further = beside(&other);
    let (cameras, images) = match (kind.images, &further) {
        (false, Ok(images)) => (bytes, Some(images.as_slice())),
        (false, Err(_)) => (bytes, None),
        (true, Ok(cameras)) => (cameras.as_slice(), Some(bytes)),
        (true, Err(why)) => {
            return Err(CameraError::other(format!("COLMAP's lenses are in {other}: {why}")));
        }
    };
    let within = |file: &str, why: String| CameraError::other(format!("{file}.{ending}: {why}"));
    let lenses = match kind.binary {
        true => binary_cameras(cameras).ok_or_else(|| "it is truncated or damaged".to_owned()),
        false => text_cameras(cameras),
    };
    let lenses = lenses.map_err(|why| within("cameras", why))?;
    let taken = match (images, kind.binary) {
        (None, _) => None,
        (Some(b), true) => {
            Some(binary_images(b).ok_or_else(|| "it is truncated or damaged".to_owned()))
        }
        (Some(b), false) => Some(text_images(b)),
    };
    let taken = taken.transpose().map_err(|why| within("images", why))?;
    let format = if kind.binary { "COLMAP (binary)" } else { "COLMAP (text)" };
    let Some(taken) = taken else {
        let all: Vec<_> = lenses.iter().map(|c| (c.id.to_string(), c)).collect();
        let (number, camera) = selected(&all, asked, "camera")?;
        let mut file = lens(format, camera)?;
        file.picture = asked.picture.map(|_| number.clone());
        file.remarks.push(format!("there is no {other} beside it, so no position"));
        return Ok(file);
    };
    let (name, taken) = selected(&taken, asked, "picture")?;
    let camera = lenses.iter().find(|c| c.id == taken.camera).ok_or_else(|| {
        CameraError::other(format!(
            "picture `{name}` is of camera {}, which is missing",
            taken.camera
        ))
    })?;
    let mut file = lens(format, camera)?;
    file.picture = Some(name.clone());
    let [w, x, y, z] = taken.rotation;
    let q = DQuat::from_xyzw(x, y, z, w);
    if q.length().is_nan() || q.length() <= 1e-9 {
        return Err(CameraError::other(format!("picture `{name}` has no rotation")));
    }
    let rotation = DMat3::from_quat(q.normalize());
    file.pose = Some(Pose::from_world(rotation, DVec3::from(taken.translation))?);
    Ok(file)
}

fn lens(format: &'static str, c: &Camera) -> Result<CameraFile, CameraError> {
    let (model, count, numbers) = MODELS[c.model];
    let Some(numbers) = numbers else {
        return Err(CameraError::other(format!(
            "camera {} has the model {model}, which is not supported: {UNDISTORT}",
            c.id
        )));
    };
    if c.parameters.len() != count {
        return Err(CameraError::other(format!(
            "camera {} has {} parameters, but {model} has {count}",
            c.id,
            c.parameters.len()
        )));
    }
    let size = super::document::size(c.size.0 as f64, c.size.1 as f64).ok_or_else(|| {
        CameraError::other(format!(
            "camera {} is of pictures of {} x {} pixels; a side is 1 to 16384",
            c.id, c.size.0, c.size.1
        ))
    })?;
    let (focal, centre, distortion) = numbers(&c.parameters);
    let intrinsics = Intrinsics::Pixels { size: Some(size), focal, centre, distortion };
    Ok(CameraFile::new(format, model, intrinsics))
}

/// The lines that are not remarks, with their numbers.
fn lines(bytes: &[u8]) -> Result<impl Iterator<Item = (usize, &str)>, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| "it is not text".to_owned())?;
    let all = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim()));
    Ok(all.filter(|(_, l)| !l.starts_with('#')))
}

fn text_cameras(bytes: &[u8]) -> Result<Vec<Camera>, String> {
    let mut all = Vec::new();
    for (n, line) in lines(bytes)?.filter(|(_, l)| !l.is_empty()) {
        let wrong = || format!("line {n}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS…");
        let mut words = line.split_whitespace();
        let mut word = || words.next().ok_or_else(wrong);
        let id = word()?.parse().map_err(|_| wrong())?;
        let name = word()?;
        let model = MODELS
            .iter()
            .position(|(m, ..)| *m == name)
            .ok_or_else(|| format!("line {n}: the model {name} is not known"))?;
        let size = (word()?.parse().map_err(|_| wrong())?, word()?.parse().map_err(|_| wrong())?);
        let parameters = words.map(|w| w.parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
        all.push(Camera { id, model, size, parameters });
    }
    Ok(all)
}

/// Two lines a picture; the second one has its points, and may be empty.
fn text_images(bytes: &[u8]) -> Result<Vec<(String, Taken)>, String> {
    let mut all = Vec::new();
    let mut lines = lines(bytes)?;
    while let Some((n, line)) = lines.next() {
        if line.is_empty() {
            continue;
        }
        let wrong = || format!("line {n}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
        let mut rest = line;
        let mut word = || {
            let (word, after) = rest.split_once(char::is_whitespace).ok_or_else(wrong)?;
            rest = after.trim_start();
            word.parse::<f64>().map_err(|_| wrong())
        };
        let _id = word()?;
        let rotation = [word()?, word()?, word()?, word()?];
        let translation = [word()?, word()?, word()?];
        let camera = word()? as u32;
        // Names may have spaces.
        all.push((rest.to_owned(), Taken { camera, rotation, translation }));
        lines.next();
    }
    Ok(all)
}

/// Little-endian numbers in a row.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits)
    }
}

fn binary_cameras(bytes: &[u8]) -> Option<Vec<Camera>> {
    let mut b = Bytes(bytes);
    let mut all = Vec::new();
    for _ in 0..b.u64()? {
        let id = b.u32()?;
        let model = usize::try_from(b.u32()?).ok().filter(|m| *m < MODELS.len())?;
        let size = (b.u64()?, b.u64()?);
        let parameters = (0..MODELS[model].1).map(|_| b.f64()).collect::<Option<_>>()?;
        all.push(Camera { id, model, size, parameters });
    }
    Some(all)
}

fn binary_images(bytes: &[u8]) -> Option<Vec<(String, Taken)>> {
    let mut b = Bytes(bytes);
    let mut all = Vec::new();
    for _ in 0..b.u64()? {
        let _id = b.u32()?;
        let rotation = [b.f64()?, b.f64()?, b.f64()?, b.f64()?];
        let translation = [b.f64()?, b.f64()?, b.f64()?];
        let camera = b.u32()?;
        let length = b.0.iter().position(|c| *c == 0)?;
        let name = String::from_utf8_lossy(b.take(length)?).into_owned();
        b.take(1)?;
        let points = usize::try_from(b.u64()?).ok()?;
        b.take(points.checked_mul(24)?)?;
        all.push((name, Taken { camera, rotation, translation }));
    }
    Some(all)
}
