//! Reads ground truth.

use indexmap::IndexMap;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{files, inputs};
use pcadlang_scene::cameras::Seen;
use pcadlang_scene::render::{Camera, Projection};
use pcadlang_scene::vision::npy::{self, NpyArray};
use pcadlang_workbench::score::{JointsTruth, Normal, Reference, Surface, SurfaceTruth};
use serde::Deserialize;
use std::io::{Cursor, Read};
use std::path::Path;

/// The ground truth of a case.
pub enum Truth {
    /// The visible surface of an object.
    Surface(SurfaceTruth),
    /// The joints of a person.
    Joints(JointsTruth),
    /// A reference posterior.
    Posterior(Reference),
}

impl Truth {
    /// Describes the error measure, for tables and plots.
    pub fn error_name(&self) -> &'static str {
        match self {
            Truth::Surface(_) => {
                "depth error over the union of estimated and true mask (Z-MAE-U, object heights)"
            }
            Truth::Joints(_) => "fraction of joints not within 0.2 torso lengths (1 - PCKt@0.2)",
            Truth::Posterior(_) => {
                "distance from the reference posterior (its standard deviations)"
            }
        }
    }
}

/// The files with the ground truth of an object's surface.
pub const SURFACE: [&str; 4] = ["gt.npz", "depth.npy", "normals.npy", "meta.json"];
/// The file with the labels of all people.
pub const LABELS: &str = "annotations.json";

/// The maximum size of an array, in bytes.
const MOST_BYTES: u64 = 1 << 30;

/// The size of the object in `meta.json`.
#[derive(Deserialize)]
struct Meta {
    object_height: f64,
    object_width: f64,
}

/// Reads the true surface of a case: `gt.npz` with `depth` and `normals`, or `depth.npy`
/// and `normals.npy`. Depth is along the viewing axis in scene units, and 0 or not finite
/// where there is no surface. The object's size is taken from `meta.json`
/// (`object_height` along its axis, `object_width`), or else from the visible surface.
/// Returns `None` if there is no ground truth.
pub fn surface(folder: &Path, camera: Option<&Path>) -> Result<Option<SurfaceTruth>, Failure> {
    let (archive, single) = (folder.join("gt.npz"), folder.join("depth.npy"));
    let (depth, normals) = if archive.is_file() {
        let bytes = files::read(&archive)?;
        let member = |name: &str| {
            member(&bytes, name).map_err(|e| plain(format!("{}: {e}", archive.display())))
        };
        (member("depth")?, member("normals")?)
    } else if single.is_file() {
        let read = |path: &Path| {
            let array = npy::parse(&files::read(path)?);
            array.map_err(|e| plain(format!("{}: {e}", path.display())))
        };
        let normals = Some(folder.join("normals.npy")).filter(|p| p.is_file());
        (Some(read(&single)?), normals.map(|p| read(&p)).transpose()?)
    } else {
        return Ok(None);
    };
    let wrong = |what: String| plain(format!("{}: {what}", folder.display()));
    let depth = depth.ok_or_else(|| wrong("gt.npz has no array `depth`".into()))?;
    let (width, height) = depth.picture_size().map_err(|e| wrong(e.to_string()))?;
    let normal = match normals {
        Some(n) if n.shape == [height as usize, width as usize, 3] => {
            n.into_f32().chunks_exact(3).map(|n| [n[0], n[1], n[2]]).collect()
        }
        Some(n) => {
            return Err(wrong(format!(
                "normals have the shape {:?}, depth {height} x {width}",
                n.shape
            )));
        }
        None => Vec::new(),
    };
    let surface = Surface { width: width as usize, depth: depth.into_f32(), normal };
    let meta = folder.join("meta.json");
    let (object_width, object_height) = if meta.is_file() {
        let meta: Meta = serde_json::from_slice(&files::read(&meta)?)
            .map_err(|e| plain(format!("{}: {e}", meta.display())))?;
        (meta.object_width, meta.object_height)
    } else {
        let camera = seen_by(camera, width, height)?;
        surface.extent(|depth| pixel(&camera, depth))
    };
    if !(object_height > 0.0 && object_width > 0.0) {
        return Err(wrong("the true depth map is empty".into()));
    }
    Ok(Some(SurfaceTruth { surface, width: object_width, height: object_height }))
}

/// Returns the camera scaled to a picture's size, or the default camera.
fn seen_by(camera: Option<&Path>, width: u32, height: u32) -> Result<Camera, Failure> {
    let Some(path) = camera else { return Ok(Camera::default_for(width, height)) };
    let seen = inputs::camera(path, None, None)?.seen(Some((width, height)));
    let Seen { camera, .. } = seen.map_err(|e| plain(format!("{}: {e}", path.display())))?;
    Ok(camera.scaled_to(width.max(height)))
}

/// Returns the width of a pixel at a depth, in scene units.
fn pixel(camera: &Camera, depth: f64) -> f64 {
    match camera.projection {
        Projection::Pinhole { focal_px, .. } => depth / focal_px,
        Projection::Orthographic { units_per_pixel, .. } => units_per_pixel,
    }
}

/// Reads an array of an archive, or `None` if the archive does not contain it.
fn member(archive: &[u8], name: &str) -> Result<Option<NpyArray>, String> {
    let mut zip = zip::ZipArchive::new(Cursor::new(archive)).map_err(|e| e.to_string())?;
    let Some(index) = zip.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
    let file = zip.by_index(index).map_err(|e| e.to_string())?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    npy::parse(&bytes).map(Some).map_err(|e| format!("{name}: {e}"))
}

/// The fields of `annotations.json` that scores need.
#[derive(Deserialize)]
struct Annotations {
    people: Vec<Person>,
}

#[derive(Deserialize)]
struct Person {
    id: String,
    #[serde(default)]
    keypoints: IndexMap<String, Vec<f64>>,
}

/// Reads the labelled joints of the people of a dataset: `{NAME: [x, y, v], …}`, where v
/// is 0 if the joint is not labelled. People with too few labels for a score are left
/// out.
pub fn people(dataset: &Path) -> Result<IndexMap<String, JointsTruth>, Failure> {
    let path = dataset.join(LABELS);
    let all: Annotations = serde_json::from_slice(&files::read(&path)?)
        .map_err(|e| plain(format!("{}: {e}", path.display())))?;
    let labelled = |k: &Vec<f64>| match k[..] {
        [x, y] => Some([x, y]),
        [x, y, v, ..] if v > 0.0 => Some([x, y]),
        _ => None,
    };
    let joints = |p: Person| {
        let joints: IndexMap<_, _> =
            p.keypoints.iter().filter_map(|(n, k)| Some((n.clone(), labelled(k)?))).collect();
        Some((p.id, JointsTruth { joints })).filter(|(_, truth)| truth.is_enough())
    };
    Ok(all.people.into_iter().filter_map(joints).collect())
}

/// Reads a reference posterior: `{QUANTITY: {"mean": …, "sd": …}, …}`.
pub fn reference(text: &[u8]) -> Result<Reference, String> {
    #[derive(Deserialize)]
    struct Moments {
        mean: f64,
        sd: f64,
    }
    let all: IndexMap<String, Moments> = serde_json::from_slice(text).map_err(|e| e.to_string())?;
    if all.is_empty() {
        return Err("it contains no quantities".into());
    }
    if let Some((name, _)) =
        all.iter().find(|(_, m)| !(m.mean.is_finite() && m.sd > 0.0 && m.sd.is_finite()))
    {
        return Err(format!("{name}: expected a mean and a positive standard deviation"));
    }
    let normal = |m: Moments| Normal { mean: m.mean, sd: m.sd };
    Ok(Reference { quantities: all.into_iter().map(|(k, m)| (k, normal(m))).collect() })
}
