//! Files that real tools wrote (`tests/data/gltf`), and what only unusual ones have.

use super::{Loaded, Pose, load};
use crate::geom::FileFrame;
use glam::DVec3;

fn read(bytes: &[u8], pose: Pose) -> Loaded {
    let none = |path: &str| Err(format!("cannot read {path}"));
    load(bytes, &FileFrame::default(), pose, &none).unwrap_or_else(|e| panic!("{e}"))
}

/// The triangles of the wave that `make.mjs` writes, where `place` puts its vertices.
fn wave(place: impl Fn(f64, f64, f64) -> DVec3, up: f64) -> Vec<[DVec3; 3]> {
    let at = |x: usize, y: usize| {
        let z = ((x * x + 3 * y) % 7) as f64 / 16.0 + (x % 2) as f64 * up;
        place(x as f64 / 8.0, y as f64 / 8.0, z)
    };
    let mut all = Vec::new();
    for y in 0..16 {
        for x in 0..16 {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            all.extend([[a, b, c], [a, c, d]]);
        }
    }
    all
}

/// Panics unless both have the same triangles, in any order and from any corner on.
#[track_caller]
fn same(loaded: &Loaded, known: Vec<[DVec3; 3]>, error: f64) {
    let middle = |t: &[DVec3; 3]| (t[0] + t[1] + t[2]) / 3.0;
    let mut found: Vec<[DVec3; 3]> = loaded
        .triangles
        .iter()
        .map(|t| t.map(|v| loaded.positions[v as usize].as_dvec3()))
        .collect();
    assert_eq!(found.len(), known.len());
    for k in known {
        let near = |t: &[DVec3; 3]| (middle(t) - middle(&k)).length();
        let best = (0..found.len()).min_by(|a, b| near(&found[*a]).total_cmp(&near(&found[*b])));
        let t = found.swap_remove(best.unwrap());
        let apart = (0..3)
            .map(|turn| (0..3).map(|c| (t[(c + turn) % 3] - k[c]).length()).fold(0.0, f64::max))
            .fold(f64::INFINITY, f64::min);
        assert!(apart < error, "{t:?} for {k:?}");
    }
}

#[test]
fn files_of_gltfpack_and_draco() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/gltf");
    let file = |name: &str| read(&std::fs::read(format!("{folder}/{name}")).unwrap(), Pose::File);
    let plain = |x, y, z| DVec3::new(x, y, z);
    // The morph target has the weight 0.5; positions have 14 bits, or floats a mantissa of 15.
    same(&file("meshopt_ext.glb"), wave(plain, 0.5), 2e-4);
    same(&file("meshopt_khr.glb"), wave(plain, 0.5), 2e-4);
    same(&file("draco.glb"), wave(plain, 0.0), 2e-4);
    let copies = file("meshopt_copies.glb");
    assert_eq!(copies.names, ["mesh_0", "mesh_0#2", "mesh_0#3"]);
    let mut known = Vec::new();
    for i in 0..3 {
        let i = f64::from(i);
        let (sin, cos) = (0.6 * i).sin_cos();
        let place = |x: f64, y: f64, z: f64| {
            let y = y * (1.0 + i);
            DVec3::new(x * cos - y * sin + 4.0 * i, x * sin + y * cos, z + i)
        };
        known.extend(wave(place, 0.0));
    }
    same(&copies, known, 2e-3);
    assert!(copies.remarks.is_empty(), "{:?}", copies.remarks);
    assert_eq!(copies.positions.len(), 3 * 289);
}
