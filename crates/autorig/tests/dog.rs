//! The shipped animal: this test makes its mesh, gives it an armature in both ways, and
//! checks that `autorig.pcad` draws it.
//!
//! `REGENERATE=1 cargo test --release -p pcadlang-autorig --test dog` rewrites
//! `programs/data/dog.obj`.

use glam::DVec3;
use pcadlang_engine::trace::Draws;
use pcadlang_inference::RunOptions;
use pcadlang_library::scene::ArmatureValue;
use pcadlang_library::{Program, shipped, standard};
use pcadlang_scene::geom::{MeshFile, obj};
use std::fmt::Write;

const SIDES: usize = 10;
/// Rings from one end of a limb to the other, without the two poles.
const RINGS: usize = 8;

/// A limb: its name, then position and radius of one end, then of the other.
struct Limb(&'static str, DVec3, f64, DVec3, f64);

fn limbs() -> Vec<Limb> {
    let p = DVec3::new;
    let mut all = vec![
        Limb("chest", p(0.28, 0.05, 0.0), 0.27, p(-0.05, 0.06, 0.0), 0.24),
        Limb("rump", p(-0.15, 0.08, 0.0), 0.21, p(-0.62, 0.1, 0.0), 0.21),
        Limb("neck", p(0.4, 0.15, 0.0), 0.17, p(0.68, 0.48, 0.0), 0.12),
        Limb("head", p(0.68, 0.55, 0.0), 0.17, p(1.05, 0.46, 0.0), 0.09),
        Limb("tail_1", p(-0.76, 0.18, 0.0), 0.09, p(-1.0, 0.42, 0.0), 0.065),
        Limb("tail_2", p(-1.0, 0.42, 0.0), 0.065, p(-1.12, 0.75, 0.0), 0.04),
    ];
    for (side, z) in [("l", 0.19), ("r", -0.19)] {
        let name = |s: &str| -> &'static str { Box::leak(format!("{s}_{side}").into_boxed_str()) };
        all.push(Limb(name("fore_upper"), p(0.3, -0.08, z), 0.13, p(0.24, -0.46, z), 0.085));
        all.push(Limb(name("fore_lower"), p(0.24, -0.46, z), 0.085, p(0.3, -0.88, z), 0.07));
        all.push(Limb(name("hind_upper"), p(-0.56, -0.02, z), 0.15, p(-0.48, -0.46, z), 0.09));
        all.push(Limb(name("hind_lower"), p(-0.48, -0.46, z), 0.09, p(-0.6, -0.88, z), 0.07));
    }
    all
}

/// Returns an OBJ file with a closed capsule around each limb.
fn dog() -> String {
    let mut s = String::from(
        "# A dog of capsules, made by crates/autorig/tests/dog.rs. MIT OR Apache-2.0.\n",
    );
    let mut first = 1;
    for Limb(name, a, ra, b, rb) in limbs() {
        let _ = writeln!(s, "g {name}");
        let axis = (b - a).normalize();
        let (u, v) = axis.any_orthonormal_pair();
        let mut put = |p: DVec3| {
            let _ = writeln!(s, "v {:.4} {:.4} {:.4}", p.x + 0.0, p.y + 0.0, p.z + 0.0);
        };
        put(a - axis * ra);
        for ring in 0..RINGS {
            // Half of the rings are around each end.
            let half = RINGS / 2;
            let (at, r, angle) = if ring < half {
                (a, ra, -90.0 + 90.0 * (ring + 1) as f64 / half as f64)
            } else {
                (b, rb, 90.0 * (ring - half) as f64 / half as f64)
            };
            let (along, out) =
                (r * libm::sin(angle.to_radians()), r * libm::cos(angle.to_radians()));
            for k in 0..SIDES {
                let turn = std::f64::consts::TAU * k as f64 / SIDES as f64;
                put(at + axis * along + (u * libm::cos(turn) + v * libm::sin(turn)) * out);
            }
        }
        put(b + axis * rb);
        let at = |ring: usize, k: usize| first + 1 + ring * SIDES + k % SIDES;
        let last = first + 1 + RINGS * SIDES;
        for k in 0..SIDES {
            let _ = writeln!(s, "f {first} {} {}", at(0, k + 1), at(0, k));
            for ring in 0..RINGS - 1 {
                let (lo, hi) = (ring, ring + 1);
                let _ = writeln!(
                    s,
                    "f {} {} {} {}",
                    at(lo, k),
                    at(lo, k + 1),
                    at(hi, k + 1),
                    at(hi, k)
                );
            }
            let _ = writeln!(s, "f {last} {} {}", at(RINGS - 1, k), at(RINGS - 1, k + 1));
        }
        first = last + 1;
    }
    s
}

#[test]
fn the_shipped_animal_is_the_one_made_here() {
    let made = dog();
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs/data/dog.obj"), &made)
            .unwrap();
        return;
    }
    assert!(made.len() < 60_000);
    assert!(
        shipped::file("data/dog.obj") == Some(&made),
        "programs/data/dog.obj: REGENERATE=1 cargo test --release -p pcadlang-autorig --test dog"
    );
    let mesh = obj::load(made.as_bytes()).unwrap();
    for t in &mesh.topology.triangles {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        let n =
            mesh.normals[t[0] as usize] + mesh.normals[t[1] as usize] + mesh.normals[t[2] as usize];
        assert!((b - a).cross(c - a).dot(n) > 0.0);
    }
}

#[test]
fn its_groups_become_its_limbs() {
    let mesh = obj::load(dog().as_bytes()).unwrap();
    let body = pcadlang_autorig::by_groups(&mesh).unwrap();
    let joints = body.rig().joints();
    let parent =
        |name: &str| joints[body.rig().find(name).unwrap()].parent.map_or("", |p| &*joints[p].name);
    assert_eq!(joints.len(), 14);
    let expected = [
        ("neck", "chest"),
        ("head", "neck"),
        ("tail_1", "rump"),
        ("tail_2", "tail_1"),
        ("fore_upper_l", "chest"),
        ("fore_lower_l", "fore_upper_l"),
        ("hind_upper_r", "rump"),
        ("hind_lower_r", "hind_upper_r"),
    ];
    for (name, of) in expected {
        assert_eq!(parent(name), of, "{name}");
    }
    for Limb(name, a, ra, ..) in limbs().iter().filter(|l| !["chest", "rump"].contains(&l.0)) {
        let head = joints[body.rig().find(name).unwrap()].head;
        assert!((head - *a).length() < 1.2 * ra, "{name} turns at {head}, begins at {a}");
    }
}

#[test]
fn inside_out_it_is_the_same() {
    let flip = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["f", ref corners @ ..] => {
            format!("f {}\n", corners.iter().rev().copied().collect::<Vec<_>>().join(" "))
        }
        _ => format!("{line}\n"),
    };
    let flipped: String = dog().lines().map(flip).collect();
    let file = MeshFile::read("dog.obj", flipped.as_bytes()).unwrap().outward();
    assert!(
        file.remarks[0].starts_with("all 14 closed bodies are inside out"),
        "{:?}",
        file.remarks
    );
    let body = pcadlang_autorig::by_groups(&file.mesh().unwrap()).unwrap();
    let corner = |t: &[u32; 3]| t.map(|v| body.positions()[v as usize].as_dvec3());
    let volume = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
    assert!(body.triangles().iter().map(corner).map(volume).sum::<f64>() > 0.3);
}

#[test]
fn its_skeleton_reaches_its_ends() {
    let mesh = obj::load(dog().as_bytes()).unwrap();
    let body = pcadlang_autorig::by_skeleton(&mesh, 16).unwrap();
    let joints = body.rig().joints();
    assert!((8..=16).contains(&joints.len()), "{}", joints.len());
    for name in ["head", "tail_2", "fore_lower_l", "fore_lower_r", "hind_lower_l", "hind_lower_r"] {
        let all = limbs();
        let tip = all.iter().find(|l| l.0 == name).unwrap().3;
        let near = joints.iter().map(|j| (j.tail - tip).length()).fold(f64::INFINITY, f64::min);
        assert!(near < 0.12, "{name}: {near} {joints:#?}");
    }
}

/// Opens a program with `scene.autorig`.
fn open(path: &str) -> Program {
    Program::open(path)
        .and_then(|p| p.host(&pcadlang_autorig::host()))
        .unwrap_or_else(|e| panic!("{e}"))
}

const PHOTO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/images/skier.jpg");

#[test]
fn the_shipped_program_draws_it_both_ways() {
    let joints = |from: &str| {
        let program = open("autorig.pcad").set("from", from).observe_file("photo", PHOTO).unwrap();
        let mut trace =
            program.compile().and_then(|m| m.simulate(1, 0)).unwrap_or_else(|e| panic!("{e}"));
        assert!(trace.log_joint().is_finite());
        let body = trace.global("body", Draws::default()).unwrap().unwrap();
        body.downcast::<ArmatureValue>().unwrap().0.rig().joints().len()
    };
    assert_ne!(joints("groups"), joints("skeleton"));
}

#[test]
fn its_example_runs() {
    let table = pcadlang_autorig::host().table(&standard::table()).unwrap();
    let example = table.get(table.find("scene", "autorig").unwrap()).example.clone().unwrap();
    let folder = concat!(env!("CARGO_TARGET_TMPDIR"), "/autorig_example");
    std::fs::create_dir_all(format!("{folder}/data")).unwrap();
    std::fs::write(format!("{folder}/data/dog.obj"), dog()).unwrap();
    let path = format!("{folder}/p.pcad");
    std::fs::write(&path, format!("include \"std/scene.pcad\" as scene;\n{example}\n")).unwrap();
    let model = open(&path).compile().unwrap_or_else(|e| panic!("{e}"));
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(trace.global("n", Draws::default()).unwrap().unwrap().to_string(), "14");
}

/// Incremental updates and full re-execution give bit-identical chains.
#[test]
#[ignore = "half a minute"]
fn increments_are_exact() {
    let chains = |incremental: bool| {
        let program = open("autorig.pcad").set("size", "48").observe_file("photo", PHOTO).unwrap();
        let (steps, warmup) = (Some(20), Some(20));
        let options = RunOptions { seed: 5, steps, warmup, incremental, ..RunOptions::default() };
        let drawn = program.compile().and_then(|m| m.run(&options, 2, 2));
        let bits = |xs: Vec<f64>| xs.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        let scalars = drawn.unwrap_or_else(|e| panic!("{e}")).scalars();
        scalars.into_iter().map(|(name, xs)| (name, bits(xs))).collect::<Vec<_>>()
    };
    assert_eq!(chains(true), chains(false));
}

#[test]
fn meshes_that_cannot_be_rigged_are_named_with_what_can_be_done() {
    let folder = concat!(env!("CARGO_TARGET_TMPDIR"), "/autorig_errors");
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(format!("{folder}/flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let path = format!("{folder}/p.pcad");
    std::fs::write(
        &path,
        "include \"std/scene.pcad\" as scene; param from: string = \"groups\"; data m: mesh = mesh(\"flat.obj\");\n\
         assume x ~ normal(0, 1); observe normal(x, 1) = len(scene.autorig(m, from = from).joints);",
    )
    .unwrap();
    for (from, says) in [
        ("groups", "needs 2 to 256 groups in the mesh; it has 1"),
        ("groups", "hint: for a mesh in one piece use `from = \"skeleton\"`"),
        ("skeleton", "a skeleton needs a closed mesh; this one has 3 open edges"),
        ("skin", "one of \"groups\", \"skeleton\""),
    ] {
        let done = open(&path).set("from", from).compile().and_then(|m| m.simulate(1, 0));
        let error = done.map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(says), "{from}: {error}");
    }
}
