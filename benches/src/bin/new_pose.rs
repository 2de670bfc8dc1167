//! Draws and scores a mesh in new poses, for counting instructions:
//!
//!     cargo build --release -p pcadlang-benches --bin new_pose
//!     valgrind --tool=callgrind target/release/new_pose DATA_DIR dense 128 100
//!
//! The data are those of `render_kit`; the difference of two counts of
//! evaluations is the cost of one. With a fifth argument each evaluation draws a copy of the
//! mesh, as if its vertices were new.

use glam::{DAffine3, DMat3, DVec3, Vec3};
use pcadlang_scene::geom::{Affine, Mesh, Solid};
use pcadlang_scene::render::{Camera, Contours, Projection};
use pcadlang_scene::vision::ContourMap;
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions, Scratch};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn words(path: &Path) -> Result<Vec<u32>, Box<dyn Error>> {
    let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(bytes.as_chunks().0.iter().map(|c| u32::from_le_bytes(*c)).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [dir, name, size, count, rest @ ..] = &args[..] else {
        return Err("usage: new_pose DATA_DIR MESH SIZE COUNT [copies]".into());
    };
    let (dir, size, count) = (Path::new(dir), size.parse::<u32>()?, count.parse::<usize>()?);
    let words_of = |name: &str| words(&dir.join(name).with_extension("bin"));
    let mesh = words_of(name)?;
    let [n, m, ..] = mesh[..] else { return Err("the mesh is too short".into()) };
    let (vertices, triangles) =
        mesh.get(2..).and_then(|w| w.split_at_checked(3 * n as usize)).ok_or("too short")?;
    let vertices: Vec<Vec3> = vertices
        .as_chunks()
        .0
        .iter()
        .map(|v: &[u32; 3]| Vec3::from(v.map(f32::from_bits)))
        .collect();
    let mesh = Mesh::new(vertices, triangles.as_chunks().0.to_vec(), vec![0; m as usize])?;
    let solid = Solid::new(Arc::new(mesh));
    let poses: Vec<Affine> = words_of("poses")?
        .chunks_exact(16)
        .map(|c| {
            let column = |i: usize| {
                DVec3::from([c[i], c[4 + i], c[8 + i]].map(|v| f64::from(f32::from_bits(v))))
            };
            let matrix3 = DMat3::from_cols(column(0), column(1), column(2));
            Affine(DAffine3 { matrix3, translation: column(3) })
        })
        .collect();
    let half = 0.5 * f64::from(size);
    let projection =
        Projection::Pinhole { focal_px: half / 22.5f64.to_radians().tan(), cx: half, cy: half };
    let (right, up, forward) = (DVec3::X, DVec3::Y, DVec3::NEG_Z);
    let camera =
        Camera { eye: DVec3::ZERO, right, up, forward, width: size, height: size, projection };
    let seen = Contours::of(&solid.placed(*poses.last().ok_or("no poses")?), &camera);
    let observed = ContourMap::of(&seen.slice());
    let chamfer = Chamfer::prepare(&observed, size, size, &ChamferOptions::default())?;
    let mut scratch = Scratch::default();
    let mut pieces = 0;
    let mut score = |i: usize| {
        let solid = match rest {
            [] => solid.placed(poses[i % poses.len()]),
            _ => {
                let mesh = Mesh::clone(&solid.instances()[0].mesh);
                Solid::new(Arc::new(mesh)).placed(poses[i % poses.len()])
            }
        };
        let contours = Contours::of(&solid, &camera);
        pieces += contours.len();
        chamfer.log_likelihood_with(&contours.slice(), &mut scratch)
    };
    // Long enough for what is computed once.
    (0..64).for_each(|i| {
        std::hint::black_box(score(i));
    });
    let begun = Instant::now();
    let total: f64 = (0..count).map(&mut score).sum();
    let each = 1e6 * begun.elapsed().as_secs_f64() / count as f64;
    println!(
        "{name} at {size}: {each:.1} us, total {total}, {} pieces each",
        pieces / (64 + count)
    );
    Ok(())
}
