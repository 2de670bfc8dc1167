//! Tests that coarser meshes stay closed, keep their feature lines, and are within their
//! stated distances.

use super::*;
use crate::geom::edges::{pair_edges, smooth_normals, weld};
use crate::geom::{Caps, NO_FACE, Profile, Solid, lathe, obj, sphere};

/// A ball with bumps.
fn lumpy(sides: u32) -> Mesh {
    let ball = sphere(1.0, sides).unwrap();
    let lump = |p: &Vec3| {
        let lumps =
            libm::sinf(4.0 * p.x + 1.0) * libm::sinf(5.0 * p.y) * libm::sinf(3.0 * p.z + 2.0);
        *p * (1.0 + 0.1 * lumps)
    };
    let count = ball.topology.triangles.len();
    Mesh::new(
        ball.positions.iter().map(lump).collect(),
        ball.topology.triangles.clone(),
        vec![0; count],
    )
    .unwrap()
}

/// A cup: a crease around its bottom, a boundary around its mouth, two parts.
fn cup() -> Mesh {
    let y: Vec<f64> = (0..24).map(|i| f64::from(i) / 12.0).collect();
    let r = y.iter().map(|y| 0.5 + 0.1 * libm::sin(4.0 * y)).collect();
    lathe(&[Profile { y, r }], 40, 0.0, Caps::Bottom).unwrap()
}

fn corners(mesh: &Mesh, face: &[u32; 3]) -> [DVec3; 3] {
    face.map(|v| mesh.positions[v as usize].as_dvec3())
}

fn volume(mesh: &Mesh) -> f64 {
    mesh.topology
        .triangles
        .iter()
        .map(|t| corners(mesh, t))
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum()
}

/// Returns the largest distance of the points to a mesh, by exhaustive search.
fn farthest(points: &[Vec3], mesh: &Mesh) -> f64 {
    let distance = |p: &Vec3| {
        let p = p.as_dvec3();
        let to = |t: &[u32; 3]| {
            let [a, b, c] = corners(mesh, t);
            // The plane if the foot of the perpendicular is inside, else the edges.
            let n = (b - a).cross(c - a);
            let foot = p - n * (p - a).dot(n) / n.length_squared();
            let inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(u, v)| (*v - *u).cross(foot - *u).dot(n) >= 0.0);
            let edge = |u: DVec3, v: DVec3| {
                let t = ((p - u).dot(v - u) / (v - u).length_squared()).clamp(0.0, 1.0);
                p.distance(u + (v - u) * t)
            };
            if inside { p.distance(foot) } else { edge(a, b).min(edge(b, c)).min(edge(c, a)) }
        };
        mesh.topology.triangles.iter().map(to).fold(f64::INFINITY, f64::min)
    };
    points.iter().map(distance).fold(0.0, f64::max)
}

#[test]
fn a_closed_mesh_stays_closed_and_outward() {
    let mesh = lumpy(48);
    assert!(mesh.topology.edges.iter().all(|e| !e.crease));
    let levels = levels_of(&mesh.positions, &mesh.topology);
    let counts: Vec<usize> =
        levels.iter().map(|l| l.of(&mesh).mesh.topology.triangles.len()).collect();
    assert!(
        levels.len() > 5 && counts.windows(2).all(|w| w[1] < w[0]) && counts.last() < Some(&160),
        "{counts:?}"
    );
    for level in &levels {
        let coarse = level.of(&mesh).mesh;
        let t = &coarse.topology;
        assert!(t.edges.iter().all(|e| e.faces[1] != NO_FACE && !e.crease));
        // A single sphere with consistently oriented faces.
        let (v, e, f) = (coarse.positions.len(), t.edges.len(), t.triangles.len());
        assert_eq!(v + f, e + 2);
        for edge in t.edges.iter() {
            let [a, b] = edge.vertices;
            let runs = |f: u32, from: u32, to: u32| {
                let face = t.triangles[f as usize];
                (0..3).any(|c| face[c] == from && face[(c + 1) % 3] == to)
            };
            assert!(runs(edge.faces[0], a, b) && runs(edge.faces[1], b, a));
        }
        assert!((volume(&coarse) / volume(&mesh) - 1.0).abs() < 0.3 * level.deviation.sqrt());
        for (i, v) in level.vertices.iter().enumerate() {
            let at = *v as usize;
            assert_eq!(
                (coarse.positions[i], coarse.normals[i]),
                (mesh.positions[at], mesh.normals[at])
            );
        }
    }
    assert!(levels[0].deviation < 0.5 * levels[levels.len() - 1].deviation);
}

#[test]
fn creases_boundaries_and_parts_stay_where_they_are() {
    let mesh = cup();
    let fine = levels_of(&mesh.positions, &mesh.topology);
    assert!(fine.len() > 4);
    for level in fine {
        let coarse = level.of(&mesh).mesh;
        let (t, at) = (&coarse.topology, |v: u32| coarse.positions[v as usize]);
        let open: Vec<_> = t.edges.iter().filter(|e| e.is_boundary()).collect();
        let creases: Vec<_> = t.edges.iter().filter(|e| e.crease).collect();
        let top = mesh.positions.iter().fold(0.0f32, |top, p| top.max(p.y));
        assert!(open.len() > 5 && open.iter().all(|e| e.vertices.iter().all(|v| at(*v).y == top)));
        assert!(creases.len() > 5);
        for e in &creases {
            assert!(
                e.vertices.iter().all(|v| at(*v).y == 0.0 && at(*v).length() > 0.49),
                "the rim of the bottom"
            );
            let up = |f: u32| t.triangles[f as usize].iter().any(|v| at(*v).y > 0.0);
            assert!(up(e.faces[0]) != up(e.faces[1]), "between bottom and wall");
        }
        // Each forms one closed ring, and the bottom keeps its part and its normals.
        for ring in [&open, &creases] {
            let points = weld(&coarse.positions);
            let mut ends: Vec<u32> =
                ring.iter().flat_map(|e| e.vertices).map(|v| points[v as usize]).collect();
            ends.sort_unstable();
            assert!(
                ends.chunks(2).all(|two| two[0] == two[1]) && ends.windows(3).all(|w| w[0] != w[2])
            );
        }
        for (face, part) in t.triangles.iter().zip(&t.parts) {
            assert_eq!(*part == 2, face.iter().all(|v| at(*v).y == 0.0));
            assert!(*part != 2 || face.iter().all(|v| coarse.normals[*v as usize].y == -1.0));
        }
    }
}

#[test]
fn no_vertex_is_farther_than_the_deviation() {
    for mesh in [lumpy(32), cup()] {
        let bent: Vec<Vec3> = mesh
            .positions
            .iter()
            .map(|p| {
                let (s, c) = libm::sincosf(0.7 * p.y);
                Vec3::new(c * p.x - s * p.z, p.y + 0.2 * p.x * p.x, s * p.x + c * p.z)
            })
            .collect();
        for level in levels_of(&mesh.positions, &mesh.topology) {
            let far = farthest(&mesh.positions, &level.of(&mesh).mesh);
            assert!(far <= level.deviation + 1e-6, "{far} {}", level.deviation);
            assert!(far > 0.3 * level.deviation, "a loose bound: {far} {}", level.deviation);
            assert!(!level.exceeds(&mesh.positions, level.deviation + 1e-6));
            assert!(level.exceeds(&mesh.positions, 0.9 * level.deviation));
            // The same vertices in another shape, for which the level was not made.
            let other = Mesh { positions: bent.clone(), ..mesh.clone() };
            let far = farthest(&bent, &level.of(&other).mesh);
            for most in [0.5, 0.8, 1.0, 1.2, 2.0, 4.0].map(|share| share * level.deviation) {
                assert!(level.exceeds(&bent, most) || far <= most + 1e-6);
            }
            assert!(!level.exceeds(&bent, 1.0));
        }
    }
}

#[test]
fn lathes_leave_out_meridians_and_rings() {
    let y: Vec<f64> = (0..33).map(|i| f64::from(i) / 16.0).collect();
    let r = y.iter().map(|y| 0.5 + 0.2 * libm::sin(3.0 * y)).collect();
    let solids = [
        Solid::lathe(&[Profile { y, r }], 48, 0.05, Caps::Bottom).unwrap(),
        Solid::sphere(0.8, 32).unwrap(),
        Solid::sphere(0.8, 7).unwrap(),
    ];
    for (solid, steps) in solids.iter().zip([3, 2, 0]) {
        let instance = &solid.instances()[0];
        let mut counts = Vec::new();
        for error in [0.0, 1e-3, 3e-3, 1e-2, 3e-2, 0.1] {
            let Some(coarse) = instance.coarse(error) else { continue };
            let t = &coarse.mesh.topology;
            assert!(farthest(&instance.mesh.positions, &coarse.mesh) <= error + 1e-6);
            assert_eq!(t.encloses, instance.mesh.topology.encloses);
            assert!(!t.edges.open() && t.part_count == instance.mesh.topology.part_count);
            for (i, v) in coarse.vertices.iter().enumerate() {
                assert_eq!(coarse.mesh.normals[i], instance.mesh.normals[*v as usize]);
            }
            assert!(Arc::ptr_eq(&coarse, &instance.coarse(error).unwrap()), "made once");
            counts.push(t.triangles.len());
        }
        assert!(counts.len() >= steps && counts.is_sorted_by(|a, b| a >= b), "{counts:?}");
    }
    assert!(solids[0].instances()[0].coarse(f64::NAN).is_none());
}

#[test]
fn parts_of_a_body_still_meet() {
    let mesh =
        obj::indexed(include_bytes!("../../../../../programs/std/human/human.lod1.obj")).unwrap();
    // Slices by height, each with its own vertices.
    let slice = |t: &[u32; 3]| ((mesh.positions[t[0] as usize].y * 5.0) as usize).min(8);
    let mut parts: Vec<(Vec<u32>, Topology)> = vec![Default::default(); 9];
    for t in &mesh.triangles {
        let (own, topology) = &mut parts[slice(t)];
        let mut local = |v: u32| match own.iter().position(|o| *o == v) {
            Some(i) => i as u32,
            None => {
                own.push(v);
                own.len() as u32 - 1
            }
        };
        topology.triangles.push(t.map(&mut local));
        topology.parts.push(0);
    }
    let open = |faces: &[[u32; 3]]| {
        pair_edges(faces, |_, _| false).iter().filter(|e| e.2 == NO_FACE).count()
    };
    let lists: Vec<(&[u32], &Topology)> = parts.iter().map(|(own, t)| (&own[..], t)).collect();
    let all = levels_of_parts(&mesh.positions, &lists);
    assert!(
        all.len() == 9 && all.iter().all(|levels| levels.len() == all[0].len() && levels.len() > 3)
    );
    let normals = smooth_normals(&mesh.positions, &mesh.triangles);
    for k in 0..all[0].len() {
        let mut faces = Vec::new();
        for ((own, topology), levels) in parts.iter().zip(&all) {
            let pick = |list: &[Vec3]| own.iter().map(|v| list[*v as usize]).collect::<Vec<_>>();
            let (positions, normals) = (pick(&mesh.positions), pick(&normals));
            let part = Mesh::of(positions, normals, Arc::new(topology.clone()));
            let coarse = levels[k].of(&part).mesh;
            let name = |v: u32| own[levels[k].vertices[v as usize] as usize];
            faces.extend(coarse.topology.triangles.iter().map(|t| t.map(name)));
            assert!(coarse.topology.edges.is_empty());
            assert!(farthest(&part.positions, &coarse) <= levels[k].deviation + 1e-6);
        }
        assert!(open(&faces) <= open(&mesh.triangles), "no cracks");
    }
}

#[test]
fn poor_meshes_do_no_harm() {
    let raw = |positions: Vec<Vec3>, triangles: Vec<[u32; 3]>| {
        let topology = Topology {
            parts: vec![0; triangles.len()],
            triangles,
            part_count: 1,
            ..Topology::default()
        };
        Mesh::of(positions.clone(), vec![Vec3::Y; positions.len()], Arc::new(topology))
    };
    let mut state = 1u32;
    let mut random = |n: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    };
    let some: Vec<Vec3> =
        (0..60).map(|_| Vec3::new(random(9) as f32, random(9) as f32, random(3) as f32)).collect();
    let soup: Vec<[u32; 3]> = (0..900).map(|_| [random(60), random(60), random(60)]).collect();
    let mut holed = lumpy(32);
    holed.positions[100] = Vec3::NAN;
    holed.positions[200] = Vec3::INFINITY;
    let big = lumpy(32);
    let huge = Mesh { positions: big.positions.iter().map(|p| *p * 1e30).collect(), ..big.clone() };
    let flat = Mesh {
        positions: big.positions.iter().map(|p| Vec3::new(p.x, 0.0, 0.0)).collect(),
        ..big.clone()
    };
    let meshes = [
        raw(Vec::new(), Vec::new()),
        raw(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]),
        raw(vec![Vec3::ZERO; 60], soup.clone()),
        raw(some.clone(), soup.clone()),
        Mesh::new(some, soup.clone(), vec![0; soup.len()]).unwrap(),
        raw(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; 500]),
        holed,
        huge,
        flat,
    ];
    for mesh in meshes {
        let solid = Solid::lasting(mesh);
        let instance = &solid.instances()[0];
        for error in [0.0, 0.01, 1.0, f64::INFINITY, f64::NAN] {
            if let Some(coarse) = instance.coarse(error) {
                assert_eq!(coarse.vertices.len(), coarse.mesh.positions.len());
                let most = coarse.vertices.len() as u32;
                assert!(coarse.mesh.topology.triangles.iter().flatten().all(|v| *v < most));
            }
        }
        assert!(instance.ball().is_some());
    }
}
