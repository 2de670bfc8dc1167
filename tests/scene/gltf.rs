//! glTF files: the shipped body written with a skin and read back, scenes with every kind
//! of primitive, and files that are refused.

use crate::armature::posed_vertices;
use crate::common::folder;
use crate::common::gltf as files;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use files::{Writer, glb, skinned};
use glam::{DMat3, DVec3, Vec3};
use pcadlang_library::shipped;
use pcadlang_scene::geom::armature::{Armature, JointPose, Rules, rig_from_json};
use pcadlang_scene::geom::gltf::{Loaded, load};
use pcadlang_scene::geom::{FileFrame, Mesh, UpAxis, cuboid, glb as glb_file, obj, sphere};
use serde_json::{Value, json};

fn none(path: &str) -> Result<Vec<u8>, String> {
    Err(format!("cannot read {path}"))
}

fn read(bytes: &[u8]) -> Result<Loaded, String> {
    load(bytes, &FileFrame::default(), &none).map_err(|e| e.to_string())
}

fn body() -> Armature {
    let file =
        |end: &str| shipped::file(&format!("std/human/human.lod2.{end}")).unwrap().as_bytes();
    let rig = rig_from_json(file("rig.json")).unwrap();
    let mesh = obj::indexed(file("obj")).unwrap();
    Armature::new(rig.rig, mesh.positions, mesh.triangles, rig.influences).unwrap()
}

/// Returns every corner of every triangle in a pose.
fn corners(body: &Armature, pose: &[JointPose]) -> Vec<DVec3> {
    let posed = posed_vertices(body, pose, &Rules::default());
    body.triangles().iter().flatten().map(|v| posed[*v as usize]).collect()
}

/// Returns a pose with a different rotation for each joint, determined by its name.
fn pose(body: &Armature) -> Vec<JointPose> {
    let turn = |name: &str| {
        let k = name.bytes().fold(7u32, |k, b| k.wrapping_mul(31).wrapping_add(u32::from(b)));
        let part = |shift: u32| f64::from(k >> shift & 255) / 255.0 - 0.5;
        JointPose::turned(DVec3::new(part(0), part(8), part(16)))
    };
    body.rig().joints().iter().map(|j| turn(&j.name)).collect()
}

fn apart(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

#[test]
fn the_shipped_body_comes_back_and_moves_alike() {
    let body = body();
    let identity = json!({});
    // Files with other axes and units, and one that an exporter has corrected by a root
    // node.
    let turned = json!({ "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0, 0, std::f64::consts::FRAC_1_SQRT_2], "scale": [0.01, 0.01, 0.01] });
    let to_z = DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y);
    let to_x = DMat3::from_cols(-DVec3::Y, DVec3::X, DVec3::Z);
    let cases = [
        ("as glTF says", DMat3::IDENTITY, &identity, UpAxis::Y, 1.0),
        ("z up", to_z, &identity, UpAxis::Z, 1.0),
        ("x up", to_x, &identity, UpAxis::X, 1.0),
        ("centimetres", DMat3::IDENTITY * 100.0, &identity, UpAxis::Y, 0.01),
        ("z up in centimetres", to_z * 100.0, &identity, UpAxis::Z, 0.01),
        ("put right by its root", to_z * 100.0, &turned, UpAxis::Y, 1.0),
    ];
    for (what, to_file, root, up, unit) in cases {
        let file = skinned(&body, to_file, root);
        let frame = FileFrame::new(up, unit).unwrap();
        let back = load(&file, &frame, &none)
            .unwrap_or_else(|e| panic!("{what}: {e}"))
            .armature()
            .unwrap();
        let (rig, known) = (back.rig(), body.rig());
        assert_eq!(rig.joints().len(), known.joints().len());
        for j in known.joints() {
            let found = &rig.joints()[rig.find(&j.name).unwrap()];
            let name = |rig: &pcadlang_scene::geom::armature::Rig, j: Option<usize>| {
                j.map(|p| rig.joints()[p].name.clone())
            };
            assert!(
                (found.head - j.head).length() < 1e-5,
                "{what}: {} is at {}, not {}",
                j.name,
                found.head,
                j.head
            );
            assert_eq!(name(rig, found.parent), name(known, j.parent), "{what}");
            let children = known
                .joints()
                .iter()
                .filter(|c| c.parent.map(|p| &known.joints()[p].name) == Some(&j.name));
            let heads: Vec<DVec3> = children.map(|c| c.head).collect();
            if !heads.is_empty() {
                let mean = heads.iter().sum::<DVec3>() / heads.len() as f64;
                assert!((found.tail - mean).length() < 1e-5, "{what}: {}", j.name);
            }
            let point = rig.keypoints().iter().find(|k| k.name == j.name).unwrap();
            assert_eq!((point.rest, &*rig.joints()[point.joint].name), (found.head, &*j.name));
        }
        let far = apart(&corners(&back, &pose(&back)), &corners(&body, &pose(&body)));
        assert!(far < 1e-5, "{what}: {far}");
    }
}

/// Returns the corners of all triangles, sorted.
fn faces(m: &Mesh) -> Vec<[u32; 9]> {
    let corner = |v: u32| m.positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
    let face = |t: &[u32; 3]| {
        let c = t.map(corner);
        std::array::from_fn(|i| c[i / 3][i % 3])
    };
    let mut all: Vec<[u32; 9]> = m.topology.triangles.iter().map(face).collect();
    all.sort_unstable();
    all
}

#[test]
fn what_is_written_here_reads_back() {
    for m in [cuboid(DVec3::new(1.0, 2.0, 3.0)).unwrap(), sphere(0.7, 6).unwrap()] {
        let loaded = read(&glb_file::write(&[m.clone().into()])).unwrap();
        assert_eq!((&loaded.names[..], loaded.rig.is_none()), (&["object".to_owned()][..], true));
        assert_eq!(faces(&loaded.mesh().unwrap()), faces(&m));
    }
    let m = sphere(0.5, 5).unwrap();
    let frame = FileFrame::new(UpAxis::Z, 0.5).unwrap();
    let by_gltf =
        load(&glb_file::write(&[m.clone().into()]), &frame, &none).unwrap().mesh().unwrap();
    assert_eq!(
        faces(&by_gltf),
        faces(&obj::load_in(obj::write(&[m.into()]).as_bytes(), &frame).unwrap())
    );
}

/// Returns a square in the plane z = 0, as a primitive of the given mode.
fn square(mode: u32, order: &[u8]) -> (Writer, Value) {
    let mut w = Writer::default();
    let at = w.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let mut primitive = json!({ "attributes": { "POSITION": at }, "mode": mode });
    if !order.is_empty() {
        primitive["indices"] = w.bytes("SCALAR", order).into();
    }
    let document = json!({ "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }], "meshes": [{ "name": "sq", "primitives": [primitive] }] });
    (w, document)
}

#[test]
fn strips_fans_and_the_rest() {
    let area = |m: &Loaded| -> f32 {
        let p = |v: u32| m.positions[v as usize];
        m.triangles.iter().map(|t| (p(t[1]) - p(t[0])).cross(p(t[2]) - p(t[0])).z / 2.0).sum()
    };
    for (mode, order) in
        [(5, &[][..]), (5, &[0, 1, 2, 3]), (6, &[0, 1, 3, 2]), (4, &[0, 1, 2, 2, 1, 3])]
    {
        let (w, d) = square(mode, order);
        let m = read(&glb(w, d)).unwrap();
        assert_eq!((m.triangles.len(), area(&m), &*m.names[0]), (2, 1.0, "sq"), "mode {mode}");
    }
    let (w, d) = square(1, &[]);
    assert_eq!(read(&glb(w, d)).unwrap_err(), "the scene of the glTF file has no triangles");
    let (w, d) = square(9, &[]);
    assert_eq!(read(&glb(w, d)).unwrap_err(), "mesh `sq` has mode 9, which glTF does not define");
    let (w, d) = square(4, &[0, 1, 9]);
    assert_eq!(read(&glb(w, d)).unwrap_err(), "mesh `sq` uses vertex 9, but it has 4");

    // Node transforms are composed, a mirrored mesh keeps its outside, and nodes outside
    // of the scene are left out.
    let (w, mut d) = square(5, &[]);
    d["nodes"] = json!([
        { "children": [1], "translation": [0, 0, 5] },
        { "mesh": 0, "name": "flat", "scale": [-2, 1, 1] },
        { "mesh": 0, "translation": [9, 9, 9] },
    ]);
    let m = read(&glb(w, d)).unwrap();
    assert_eq!((area(&m), m.positions.len()), (2.0, 4), "counter-clockwise still");
    assert_eq!((m.positions[3], &*m.names[0]), (Vec3::new(-2.0, 1.0, 5.0), "flat"));
}

#[test]
fn buffers_lie_anywhere() {
    let (w, d) = square(5, &[]);
    let inside = read(&glb(w, d)).unwrap();
    let (w, mut d) = square(5, &[]);
    let bytes = w.document(&mut d);
    d["buffers"][0]["uri"] = "a%20b.bin".into();
    let beside = |path: &str| if path == "a b.bin" { Ok(bytes.clone()) } else { none(path) };
    assert_eq!(load(d.to_string().as_bytes(), &FileFrame::default(), &beside).unwrap(), inside);
    assert_eq!(read(d.to_string().as_bytes()).unwrap_err(), "cannot read a b.bin");
    d["buffers"][0]["uri"] =
        format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&bytes)).into();
    assert_eq!(read(d.to_string().as_bytes()).unwrap(), inside);
    d["buffers"][0]["uri"] = "https://example.org/a.bin".into();
    assert!(read(d.to_string().as_bytes()).unwrap_err().ends_with("only files are supported"));
    d["buffers"][0] = json!({ "byteLength": 7 });
    assert_eq!(read(d.to_string().as_bytes()).unwrap_err(), "buffer 0 of the glTF file has no URI");
}

#[test]
fn what_cannot_be_read_is_said() {
    let fails = |change: &dyn Fn(&mut Value)| {
        let (w, mut d) = square(5, &[0, 1, 2, 3]);
        let bytes = w.document(&mut d);
        change(&mut d);
        read(&files::packed(&d, &bytes)).unwrap_err()
    };
    assert_eq!(
        fails(&|d| d["accessors"][0]["sparse"] = json!({ "count": 1 })),
        "accessor 0 of the glTF file is sparse, which is not supported; export without sparse \
         accessors"
    );
    assert_eq!(
        fails(&|d| d["accessors"][0]["count"] = 5.into()),
        "accessor 0 of the glTF file extends beyond its buffer"
    );
    assert_eq!(
        fails(&|d| d["accessors"][0]["count"] = 4_000_000_000u64.into()),
        "accessor 0 of the glTF file has 4000000000 elements; at most 15000000"
    );
    assert_eq!(
        fails(&|d| d["buffers"][0]["byteLength"] = 999.into()),
        "buffer 0 of the glTF file has 52 bytes, but declares 999"
    );
    assert_eq!(
        fails(&|d| d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
        "the glTF file is compressed (KHR_draco_mesh_compression), which is not supported; export \
         without compression"
    );
    assert_eq!(
        fails(&|d| d["asset"]["version"] = "1.0".into()),
        "only glTF version 2 is \
        supported, not 1.0"
    );
    assert_eq!(
        fails(
            &|d| d["nodes"] = json!([{ "mesh": 0 }, { "name": "a", "children": [2] }, { "name": "b", "children": [1] }])
        ),
        "the glTF file's nodes have a cycle: b -> a -> b"
    );
    assert_eq!(
        fails(&|d| d["nodes"][0]["mesh"] = 4.into()),
        "node `node_0` refers to the missing \
        mesh 4"
    );
    assert!(
        fails(&|d| d["nodes"][0]["scale"] = json!([1e200, 1e200, 1e200])).contains("is not finite")
    );
    assert!(read(b"glTF").unwrap_err().contains("truncated"));
    assert!(read(b"{").unwrap_err().starts_with("cannot read the glTF file: EOF"));
}

/// Returns a square with these weights on the joints, and a hat on the second joint.
fn two(weights: &[[f32; 8]; 4]) -> (Vec<u8>, Value) {
    let (mut w, mut d) = square(5, &[]);
    let half =
        |from: usize| weights.iter().flat_map(|v| v[from..from + 4].to_vec()).collect::<Vec<f32>>();
    let joints = w.bytes("VEC4", &[0, 1, 2, 0].repeat(4));
    let more = w.bytes("VEC4", &[3, 4, 0, 0].repeat(4));
    let (first, second) = (w.floats("VEC4", &half(0)), w.floats("VEC4", &half(4)));
    let attributes = &mut d["meshes"][0]["primitives"][0]["attributes"];
    for (name, a) in
        [("JOINTS_0", joints), ("JOINTS_1", more), ("WEIGHTS_0", first), ("WEIGHTS_1", second)]
    {
        attributes[name] = a.into();
    }
    d["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [7, 7, 7] },
        { "name": "a", "children": [2, 4, 5, 6] },
        { "name": "between", "children": [3] },
        { "name": "a", "children": [7] },
        {}, { "name": "a" }, { "name": "a#2" },
        { "mesh": 1, "name": "hat", "translation": [0, 2, 0] }, { "mesh": 1, "name": "floor" },
    ]);
    d["scenes"][0]["nodes"] = json!([0, 1, 8]);
    d["skins"] = json!([{ "joints": [1, 3, 4, 5, 6] }]);
    let plain = json!({ "primitives": [{ "attributes": { "POSITION": 0 }, "mode": 5 }] });
    d["meshes"].as_array_mut().unwrap().push(plain);
    (w.document(&mut d), d)
}

/// The node of a skinned mesh places no vertex, but a mirrored one turns its faces.
#[test]
fn a_mirrored_node_turns_a_skinned_mesh() {
    let row = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (bytes, mut d) = two(&[row; 4]);
    let plain = read(&files::packed(&d, &bytes)).unwrap();
    d["nodes"][0]["scale"] = json!([1, -1, 1]);
    let mirrored = read(&files::packed(&d, &bytes)).unwrap();
    assert_eq!(mirrored.positions, plain.positions);
    let turned: Vec<[u32; 3]> = plain.triangles[..2].iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    assert_eq!(mirrored.triangles[..2], turned);
    assert_eq!(mirrored.triangles[2..], plain.triangles[2..], "the hat and the floor as before");
}

#[test]
fn skins_are_put_in_order() {
    let row = [0.1, 0.2, 0.3, 0.0, 0.25, 0.15, 0.0, 0.0];
    let (bytes, d) = two(&[row; 4]);
    let loaded = read(&files::packed(&d, &bytes)).unwrap();
    assert_eq!(loaded.names, ["sq", "hat", "floor"]);
    assert_eq!(loaded.positions[3], Vec3::new(1.0, 1.0, 0.0), "a skin's own node places nothing");
    let body = loaded.armature().unwrap();
    let names: Vec<&str> = body.rig().joints().iter().map(|j| &*j.name).collect();
    assert_eq!(names, ["a", "a#3", "joint_2", "a#4", "a#2"]);
    assert_eq!(body.rig().joints()[1].parent, Some(0), "over a node that is no joint");
    // The four largest weights, normalised to sum to 1.
    assert_eq!(body.influences()[0].joints, [2, 3, 1, 4]);
    let sum = 0.3 + 0.25 + 0.2 + 0.15;
    for (w, known) in body.influences()[0].weights.iter().zip([0.3, 0.25, 0.2, 0.15]) {
        assert!((w - known / sum).abs() < 1e-6);
    }
    // The hat hangs on the second joint; the floor is left out.
    assert_eq!((body.positions().len(), body.triangles().len()), (8, 4));
    assert_eq!((body.influences()[4].joints[0], body.influences()[4].weights[0]), (1, 1.0));
}

#[test]
fn broken_skins_are_refused() {
    let whole = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let fails = |rows: &[[f32; 8]; 4], change: &dyn Fn(&mut Value)| {
        let (bytes, mut d) = two(rows);
        change(&mut d);
        let loaded = read(&files::packed(&d, &bytes));
        loaded.and_then(|l| l.armature().map_err(|e| e.to_string())).unwrap_err()
    };
    let keep = |_: &mut Value| {};
    let mut rows = [whole; 4];
    rows[2] = [0.0; 8];
    assert_eq!(fails(&rows, &keep), "the skin weights of vertex 2 sum to 0, not to 1");
    rows[2] = [2.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(fails(&rows, &keep), "vertex 2 has a skin weight of -1");
    let rows = [whole; 4];
    assert_eq!(
        fails(&rows, &|d| d["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0 })),
        "mesh `sq` has a skin, but no weights (JOINTS_0 and WEIGHTS_0)"
    );
    assert_eq!(
        fails(&[[0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]; 4], &|d| d["skins"][0]["joints"] =
            json!([1])),
        "vertex 0 of mesh `sq` is moved by joint 1, but its skin has 1 joints"
    );
    assert_eq!(
        fails(&rows, &|d| d["skins"][0]["joints"] = json!([])),
        "skin 0 of the glTF file has no joints"
    );
    assert_eq!(fails(&rows, &|d| d["skins"] = json!([])), "the glTF file has no skin 0");
    assert!(fails(&rows, &|d| d["nodes"][2]["children"] = json!([3, 1])).contains("a cycle: "));
    assert_eq!(
        fails(&rows, &|d| d["skins"][0]["inverseBindMatrices"] = 0.into()),
        "accessor 0 of the glTF file must be of type MAT4, not VEC3"
    );
    let flat = read(&glb_file::write(&[cuboid(DVec3::ONE).unwrap().into()]))
        .unwrap()
        .armature()
        .unwrap_err()
        .to_string();
    assert!(flat.contains("has no skin"), "{flat}");
}

#[test]
fn programs_read_them_with_options() {
    let folder = folder::Folder::new("gltf");
    let file = |name: &str, bytes: &[u8]| {
        folder.write(name, bytes);
    };
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    file("a.rig.json", b"{}");
    let body = body();
    let to_z = DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y) * 100.0;
    file("body.glb", &skinned(&body, to_z, &json!({})));
    file("box.glb", &glb_file::write(&[cuboid(DVec3::new(100.0, 200.0, 300.0)).unwrap().into()]));
    file(
        "other.obj",
        obj::write(&[cuboid(DVec3::new(100.0, 200.0, 500.0)).unwrap().into()]).as_bytes(),
    );
    let head = body.rig().joints()[body.rig().find("hand_l").unwrap()].head;
    let text = r#"include "std/scene.pcad" as scene;
        data body = armature("body.glb", up = "z", unit = 0.01);
        data crate = mesh("box.glb", unit = 0.01, up = "z");
        observe normal(scene.skin(body, { hand_l: [0, 0, 0] }).landmarks.hand_l[0], 1) = HAND;
        observe normal(crate.height, 1) = TALL;
        assume x ~ normal(0, 1);"#;
    let program = |text: &str| {
        file("p.pcad", text.as_bytes());
        pcadlang::Program::open(&path("p.pcad")).unwrap()
    };
    let likelihood = |p: pcadlang::Program| {
        let model = p.compile().unwrap_or_else(|e| panic!("{e}"));
        model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}")).log_likelihood()
    };
    let best = -f64::ln(std::f64::consts::TAU);
    let filled = |tall: &str| text.replace("HAND", &head.x.to_string()).replace("TALL", tall);
    assert!((likelihood(program(&filled("3"))) - best).abs() < 1e-9);
    // Another file in its place is read in the same way.
    let other = program(&filled("5")).observe_file("crate", &path("other.obj")).unwrap();
    assert!((likelihood(other) - best).abs() < 1e-9);

    let fails = |data: &str| match program(&format!("data d = {data};\nassume x ~ normal(0, 1);"))
        .compile()
    {
        Ok(_) => panic!("{data} compiles"),
        Err(e) => e.to_string(),
    };
    for (data, says) in [
        (r#"mesh("box.glb", up = "w")"#, "`up` must be \"x\", \"y\" or \"z\", not \"w\""),
        (
            r#"mesh("box.glb", unit = 0)"#,
            "the unit of a file must be a positive number of metres, got 0",
        ),
        (r#"mesh("box.glb", unit = 1, unit = 2)"#, "`unit` is given twice"),
        (r#"mesh("box.glb", scale = 2)"#, "mesh has no option `scale`"),
        (r#"csv("box.glb", up = "z")"#, "csv has no option `up`"),
        (r#"mesh("box.glb", "z")"#, "mesh takes one path; give options by name"),
        (
            r#"armature("box.glb")"#,
            "the glTF file has no skin, so it does not define which joint \
                                    moves which vertices",
        ),
        (r#"armature("a.rig.json", up = "z")"#, "`up` and `unit` are for glTF files"),
    ] {
        let said = fails(data);
        assert!(said.contains(says), "{data}: {said}");
    }
    // Options are checked even if another file is given.
    let wrong = program("data d = mesh(\"box.glb\", unit = -1);\nassume x ~ normal(0, 1);");
    let said = wrong.observe_file("d", &path("other.obj")).unwrap().compile().unwrap_err();
    assert!(
        said.to_string().contains("`unit`") || said.to_string().contains("the unit of a file"),
        "{said}"
    );
}

/// Returns the next number of a xorshift stream, so that the mutations are reproducible.
fn next(state: &mut u64) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 20) as usize
}

#[test]
fn no_bytes_make_it_stumble() {
    let (bytes, d) = two(&[[0.1, 0.2, 0.3, 0.0, 0.25, 0.15, 0.0, 0.0]; 4]);
    let originals =
        [files::packed(&d, &bytes), glb_file::write(&[cuboid(DVec3::ONE).unwrap().into()])];
    let mut state = 0x1234_5678_9abc_def1u64;
    let (mut good, mut bad) = (0, 0);
    for round in 0..2000 {
        let mut file = originals[round % 2].clone();
        for _ in 0..1 + next(&mut state) % 3 {
            let at = next(&mut state) % file.len();
            match next(&mut state) % 6 {
                0 => file[at] = next(&mut state) as u8,
                1 => file[at] ^= 1 << (next(&mut state) % 8),
                2 => file.truncate(at.max(1)),
                // Digits of the document are changed, which keeps it valid JSON.
                _ => {
                    let digits: Vec<usize> =
                        (20..file.len()).filter(|i| file[*i].is_ascii_digit()).collect();
                    if let Some(i) = digits.get(next(&mut state) % digits.len().max(1)) {
                        file[*i] = b'0' + (next(&mut state) % 10) as u8;
                    }
                }
            }
        }
        match read(&file) {
            Ok(loaded) => {
                good += 1;
                assert!(loaded.positions.iter().all(|p| p.is_finite()));
                assert_eq!(
                    (loaded.parts.len(), loaded.influences.len()),
                    (loaded.triangles.len(), loaded.positions.len())
                );
                let _ = loaded.clone().armature();
                let _ = loaded.mesh();
            }
            Err(e) => {
                bad += 1;
                assert!(!e.is_empty());
            }
        }
    }
    assert!(good > 100 && bad > 100, "{good} read, {bad} refused");
}
