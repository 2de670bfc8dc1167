//! Meshes as programs read them: bodies that are inside out, other people's kinds of files, and
//! joints whose names are not names of the language.

use crate::common::folder::Folder;

use glam::DVec3;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::builtins::data::Options;
use pcadlang_library::scene::SolidValue;
use pcadlang_library::standard;
use pcadlang_scene::geom::{cuboid, glb, obj};

/// Compiles a program beside some files.
fn compile(folder: &Folder, text: &str) -> Result<Model, String> {
    let text = format!("include \"std/scene.pcad\" as scene;\n{text}\nassume x ~ normal(0, 1);");
    folder.write("p.pcad", text);
    let path = folder.path().join("p.pcad");
    Program::open(path.to_str().unwrap()).and_then(Program::compile).map_err(|e| e.to_string())
}

/// Checks that a program observes what is true: each of its observations, with a standard
/// deviation of 1, is at the mode.
fn is_true(folder: &Folder, text: &str, observations: usize) {
    let model = compile(folder, text).unwrap();
    let l = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}")).log_likelihood();
    let best = -0.5 * f64::ln(std::f64::consts::TAU) * observations as f64;
    assert!((l - best).abs() < 1e-9, "{text}: {l} for {best}");
}

/// What a model warns of.
fn warnings(model: &Model) -> String {
    model.warnings().1.iter().map(|w| w.message.clone()).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_mesh_that_is_inside_out_is_turned_over_and_said() {
    let folder = Folder::new("meshes");
    let cube = cuboid(DVec3::new(1.0, 2.0, 3.0)).unwrap();
    let mut wrong = cube.clone();
    for t in &mut std::sync::Arc::make_mut(&mut wrong.topology).triangles {
        t.swap(1, 2);
    }
    let weights = vec!["[[0, 1.0]]"; cube.positions.len()].join(",");
    let rig = format!(
        r#"{{"mesh": "wrong.obj", "joints": [{{"name": "a", "head": [0, 0, 0]}}], "weights": [{weights}]}}"#
    );
    folder
        .write("right.obj", obj::write(&[cube.clone().into()]))
        .write("wrong.obj", obj::write(&[wrong.clone().into()]));
    folder.write("wrong.glb", glb::write(&[wrong.clone().into()])).write("a.rig.json", rig);
    for read in ["mesh(\"wrong.obj\")", "mesh(\"wrong.glb\")", "armature(\"a.rig.json\")"] {
        let model = compile(&folder, &format!("data thing = {read};")).unwrap();
        assert!(warnings(&model).contains("the closed body is inside out"), "{read}");
    }
    let model = compile(&folder, "data thing = mesh(\"right.obj\");").unwrap();
    assert_eq!(warnings(&model), "");
    for (file, bytes) in [
        ("a.obj", obj::write(&[wrong.clone().into()]).into_bytes()),
        ("a.glb", glb::write(&[wrong.clone().into()])),
    ] {
        let beside = |_: &str| Err("no file".to_string());
        let read = standard::table().load("mesh", file, &bytes, &Options::default(), &beside);
        let read = read.unwrap_or_else(|e| panic!("{file}: {}", e.message));
        let mesh = read.downcast::<SolidValue>().unwrap().0.to_mesh().unwrap();
        let corner = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize].as_dvec3());
        let volume = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
        let sum: f64 = mesh.topology.triangles.iter().map(corner).map(volume).sum();
        assert!((sum - 6.0).abs() < 1e-5, "{file}: {sum}");
    }
}

#[test]
fn other_kinds_are_named_with_what_to_do() {
    let folder = Folder::new("kinds");
    folder.write("a.fbx", "Kaydara FBX Binary  \0").write("a.obj", "v 0 0 0\n");
    folder.write("a.step", "ISO-10303-21;\n").write("a.json", "{\"joints\": []}");
    let fails = |read: &str| compile(&folder, &format!("data thing = {read};")).unwrap_err();
    assert!(
        fails("mesh(\"a.fbx\")").contains("a.fbx: the file is FBX, which is not read as a mesh")
    );
    assert!(fails("armature(\"a.fbx\")").contains("export glTF 2.0"));
    assert!(fails("mesh(\"a.step\")").contains("gmsh FILE -2 -o FILE.stl"));
    assert!(fails("armature(\"a.obj\")").contains("an OBJ file has no joints"));
    assert!(fails("mesh(\"a.json\")").contains("a rig is read with armature(…)"));
}

#[test]
fn joints_of_any_name_are_posed() {
    let folder = Folder::new("joints");
    let joint = |name: &str, parent: &str, y: u8| {
        format!(r#"{{"name": "{name}"{parent}, "head": [0, {y}, 0], "tail": [0, {}, 0]}}"#, y + 1)
    };
    let rig = format!(
        r#"{{"mesh": "a.obj", "joints": [{}, {}], "weights": [[[0, 1.0]], [[0, 1.0]], [[1, 1.0]]],
            "keypoints": {{"tip/x": {{"joint": "mixamorig:LeftArm", "rest": [0, 2, 0]}}}}}}"#,
        joint("upperarm01.L", "", 0),
        joint("mixamorig:LeftArm", ", \"parent\": \"upperarm01.L\"", 1),
    );
    folder.write("a.rig.json", rig).write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n");
    is_true(
        &folder,
        r#"data body = armature("a.rig.json");
           fn tip(pose) { scene.skin(body, pose).landmarks["tip/x"] }
           let bent = { "mixamorig:LeftArm": [0, 0, deg(90)], "upperarm01.L": [0, 0, 0] };
           observe normal(tip({})[1], 1) = 2;
           observe normal(tip(bent)[0], 1) = -1;
           observe normal(bent["mixamorig:LeftArm"][2], 1) = pi / 2;
           observe normal(len(map(fn(p) { p }, {})), 1) = 0;"#,
        4,
    );
    let twice = compile(&folder, "let r = { \"a b\": 1, \"a b\": 2 };").unwrap_err();
    assert!(twice.contains("the field `a b` occurs twice"), "{twice}");
}
