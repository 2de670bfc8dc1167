//! Measures the time to render and score a new pose, for the meshes and poses of a
//! folder, in comparison with a plain rasteriser.
//!
//!     cargo run --release -p pcadlang-benches --bin render_kit -- DATA_DIR [MESHES [SIZES [TASKS [PEERS]]]]     (lists with commas; all if left out)
//!
//! DATA_DIR holds `vase.bin`, `body.bin`, `dense.bin` (two u32 counts, float32 vertices,
//! u32 triangles) and `poses.bin` (row-major 4 x 4 float32). The camera is at the origin
//! and looks along -z, with a vertical field of view of 45 degrees. Each evaluation uses
//! another pose. Prints one JSON line for each mesh, size and task: `depth`, `contour`
//! (contour elements for pcadlang, contour pixels for the plain rasteriser), `likelihood`
//! (the mean distance of these from the contours of the last pose), and
//! `likelihood_newmesh` (also with new vertices each time, whose normals are recomputed;
//! pcadlang only).

mod clock;
#[path = "render_kit/plain.rs"]
mod plain;
#[path = "render_kit/raw.rs"]
mod raw;

use clock::processor_seconds;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use pcadlang_scene::geom::{Affine, Mesh, Solid};
use pcadlang_scene::render::{Camera, Channels, Contours, Frame, Projection};
use pcadlang_scene::vision::ContourMap;
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions, Scratch};
use plain::Plain;
use raw::{Pose, Raw, load, words};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [dir, choices @ ..] = &args[..] else {
        return Err("usage: render_kit DATA_DIR [MESHES [SIZES [TASKS [PEERS]]]]".into());
    };
    let chosen = |i: usize, name: &str| {
        choices.get(i).is_none_or(|list: &String| list.split(',').any(|n| n == name))
    };
    let dir = Path::new(dir);
    let poses: Vec<Pose> = words(&dir.join("poses.bin"))?
        .chunks_exact(16)
        .map(|c| std::array::from_fn(|i| f32::from_bits(c[i])))
        .collect();
    let last = *poses.last().ok_or("there are no poses")?;
    for name in ["vase", "body", "dense"].into_iter().filter(|m| chosen(0, m)) {
        let raw = load(&dir.join(name).with_extension("bin"))?;
        let mesh = Mesh::new(
            raw.vertices.iter().map(|v| Vec3::from_array(*v)).collect(),
            raw.triangles.clone(),
            vec![0; raw.triangles.len()],
        )?;
        let solid = Solid::new(Arc::new(mesh));
        for size in [64, 128, 256, 512].into_iter().filter(|size| chosen(1, &size.to_string())) {
            let case = Case {
                mesh: name,
                triangles: raw.triangles.len(),
                size,
                chosen: &|peer, task| chosen(2, task) && chosen(3, peer),
            };
            ours(&case, &solid, &raw, &poses, &last)?;
            theirs(&case, &raw, &poses, &last);
        }
    }
    Ok(())
}

/// A mesh and the size of its picture in pixels.
struct Case<'a> {
    mesh: &'static str,
    triangles: usize,
    size: u32,
    /// Whether a peer's task was selected.
    chosen: &'a dyn Fn(&str, &str) -> bool,
}

impl Case<'_> {
    /// Times evaluations until the result is precise enough, and prints the line.
    fn measure(&self, peer: &str, task: &str, extra: &str, mut evaluate: impl FnMut(usize)) {
        if !(self.chosen)(peer, task) {
            return;
        }
        let mut next = 0;
        let mut run = |n: usize| {
            let begun = processor_seconds();
            (next..next + n).for_each(&mut evaluate);
            next += n;
            1e3 * (processor_seconds() - begun)
        };
        // The resolution of the clock is some milliseconds.
        let (mut n, mut taken) = (1, 0.0);
        while taken < 50.0 {
            n *= 2;
            taken = run(n);
        }
        n = (n as f64 * 200.0 / taken) as usize + 1;
        let mut times: Vec<f64> = (0..5).map(|_| run(n) / n as f64).collect();
        times.sort_by(f64::total_cmp);
        let Case { mesh, triangles, size, .. } = self;
        println!(
            "{{\"peer\":\"{peer}\",\"mesh\":\"{mesh}\",\"tris\":{triangles},\"size\":{size},\"task\":\"{task}\",\"threads\":1,\
             \"cpu_ms_best\":{:.5},\"cpu_ms_median\":{:.5}{extra}}}",
            times[0], times[2]
        );
    }
}

fn camera(size: u32) -> Camera {
    let half = 0.5 * f64::from(size);
    let projection =
        Projection::Pinhole { focal_px: half / 22.5f64.to_radians().tan(), cx: half, cy: half };
    let (right, up, forward) = (DVec3::X, DVec3::Y, DVec3::NEG_Z);
    Camera { eye: DVec3::ZERO, right, up, forward, width: size, height: size, projection }
}

fn placed(solid: &Solid, pose: &Pose) -> Solid {
    let p = pose.map(f64::from);
    let column = |i: usize| DVec3::new(p[i], p[4 + i], p[8 + i]);
    let matrix3 = DMat3::from_cols(column(0), column(1), column(2));
    solid.placed(Affine(DAffine3 { matrix3, translation: column(3) }))
}

fn ours(
    case: &Case<'_>,
    solid: &Solid,
    raw: &Raw,
    poses: &[Pose],
    last: &Pose,
) -> Result<(), Box<dyn Error>> {
    let camera = camera(case.size);
    let at = |i: usize| placed(solid, &poses[i % poses.len()]);
    let depth = |i: usize| Frame::render(&at(i), &camera, Channels::Depth);
    let mut reference = Plain::new(raw, case.size as usize);
    let agreement = agreement(&depth(0).depth, reference.depth(&poses[0]));
    case.measure("pcadlang", "depth", &agreement, |i| drop(std::hint::black_box(depth(i))));
    case.measure("pcadlang", "contour", "", |i| {
        drop(std::hint::black_box(Contours::of(&at(i), &camera)))
    });
    let seen = Contours::of(&placed(solid, last), &camera);
    let observed = ContourMap::of(&seen.slice());
    let chamfer = Chamfer::prepare(&observed, case.size, case.size, &ChamferOptions::default())?;
    let mut scratch = Scratch::default();
    let mut likelihood = |solid: &Solid| {
        let contours = Contours::of(solid, &camera);
        std::hint::black_box(chamfer.log_likelihood_with(&contours.slice(), &mut scratch));
    };
    case.measure("pcadlang", "likelihood", "", |i| likelihood(&at(i)));
    let Some(mesh) = solid.instances().first().map(|i| Arc::clone(&i.mesh)) else { return Ok(()) };
    let shapes: Vec<Vec<Vec3>> = (0..16).map(|k| deformed(&mesh, k)).collect();
    case.measure("pcadlang", "likelihood_newmesh", "", |i| {
        let positions = shapes[i % shapes.len()].clone();
        let normals = normals(&positions, &mesh.topology.triangles);
        let solid = Solid::new(Arc::new(Mesh::of(positions, normals, Arc::clone(&mesh.topology))));
        likelihood(&placed(&solid, &poses[i % poses.len()]));
    });
    Ok(())
}

/// Returns another shape of a mesh: narrower or wider depending on height.
fn deformed(mesh: &Mesh, k: usize) -> Vec<Vec3> {
    let scale = |p: &Vec3| 1.0 + 0.06 * libm::sinf(3.0 * p.y + k as f32);
    mesh.positions.iter().map(|p| Vec3::new(p.x * scale(p), p.y, p.z * scale(p))).collect()
}

/// Returns a normal for each vertex: the mean over the faces around it, weighted by area.
fn normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let normal = (b - a).cross(c - a);
        t.iter().for_each(|v| sums[*v as usize] += normal);
    }
    sums.iter().map(|n| n.normalize_or(Vec3::Y)).collect()
}

fn theirs(case: &Case<'_>, raw: &Raw, poses: &[Pose], last: &Pose) {
    let mut plain = Plain::new(raw, case.size as usize);
    plain.observe(last);
    case.measure("plain", "depth", "", |i| {
        std::hint::black_box(plain.depth(&poses[i % poses.len()]));
    });
    case.measure("plain", "contour", "", |i| {
        std::hint::black_box(plain.contour(&poses[i % poses.len()]));
    });
    case.measure("plain", "likelihood", "", |i| {
        std::hint::black_box(plain.likelihood(&poses[i % poses.len()]));
    });
}

/// Compares a depth picture with the reference: the number of pixels in which the masks
/// differ, and the median and maximum of relative differences.
fn agreement(depth: &[f32], reference: &[f32]) -> String {
    let pairs = || depth.iter().zip(reference);
    let mask = pairs().filter(|(a, b)| a.is_finite() != b.is_finite()).count();
    let both = pairs().filter(|(a, b)| a.is_finite() && b.is_finite());
    let mut errors: Vec<f32> = both.map(|(a, b)| (a - b).abs() / b).collect();
    errors.sort_by(f32::total_cmp);
    let median = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    let largest = errors.last().copied().unwrap_or(0.0);
    format!(
        ",\"mask_diff_px\":{mask},\"depth_err_median\":{median:e},\"depth_err_most\":{largest:e}"
    )
}
