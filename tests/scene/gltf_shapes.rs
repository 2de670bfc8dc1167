//! What a glTF file draws beside plain triangles: copies of a mesh, morph targets, sparse
//! accessors, bodies in another pose than their bind pose.

use crate::common::gltf as files;

use files::{Writer, glb, packed};
use glam::{DVec3, Vec3};
use pcadlang_scene::geom::gltf::{Loaded, Pose, load};
use pcadlang_scene::geom::{FileFrame, cuboid};
use serde_json::{Value, json};

fn read_in(bytes: &[u8], pose: Pose) -> Result<Loaded, String> {
    let none = |path: &str| Err(format!("cannot read {path}"));
    load(bytes, &FileFrame::default(), pose, &none).map_err(|e| e.to_string())
}

fn read(bytes: &[u8]) -> Loaded {
    read_in(bytes, Pose::File).unwrap_or_else(|e| panic!("{e}"))
}

fn size(all: &[Vec3]) -> DVec3 {
    let low = all.iter().fold(Vec3::MAX, |a, b| a.min(*b));
    let high = all.iter().fold(Vec3::MIN, |a, b| a.max(*b));
    (high - low).as_dvec3()
}

fn volume(m: &Loaded) -> f64 {
    let p = |v: u32| m.positions[v as usize].as_dvec3();
    m.triangles.iter().map(|t| p(t[0]).dot(p(t[1]).cross(p(t[2]))) / 6.0).sum()
}

/// Returns a cube of side 2 about the origin, with the numbers of its positions' and corners'
/// accessors.
fn cube() -> (Writer, usize, usize, Vec<Vec3>) {
    let m = cuboid(DVec3::splat(2.0)).unwrap();
    let mut w = Writer::default();
    let flat: Vec<f32> = m.positions.iter().flat_map(Vec3::to_array).collect();
    let at = w.floats("VEC3", &flat);
    let corners: Vec<u16> = m.topology.triangles.iter().flatten().map(|c| *c as u16).collect();
    let corners = w.shorts("SCALAR", &corners);
    (w, at, corners, m.positions.clone())
}

/// Blender's export of four cubes as copies: x from -0.5 to 6.5, the last three times as tall.
fn copies(turned: bool) -> (Writer, Value) {
    let (mut w, at, corners, _) = cube();
    let places = w.floats("VEC3", &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 4.0, 0.0, 0.0, 6.0, 0.0, 0.0]);
    let half = [0.5; 3];
    let scales = w.floats("VEC3", &[half, half, [-0.5, 0.5, 0.5], [0.5, 1.5, 0.5]].concat());
    let mut attributes = json!({ "TRANSLATION": places, "SCALE": scales });
    if turned {
        let turn = w.floats("VEC4", &[0.0, 0.6, 0.0, 0.8].repeat(4));
        attributes["ROTATION"] = turn.into();
    }
    let document = json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "E", "extensions": { "EXT_mesh_gpu_instancing": { "attributes": attributes } } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": at }, "indices": corners }] }],
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
    });
    (w, document)
}

#[test]
fn copies_of_a_mesh_are_parts() {
    let (w, d) = copies(false);
    let all = read(&glb(w, d));
    assert_eq!(all.names, ["E", "E#2", "E#3", "E#4"]);
    let mesh = all.clone().mesh().unwrap();
    assert!(mesh.topology.part_names.iter().map(|n| &**n).eq(["E", "E#2", "E#3", "E#4"]));
    assert_eq!((all.triangles.len(), all.parts[47], all.remarks.len()), (48, 3, 0));
    assert_eq!(size(&all.positions), DVec3::new(7.0, 3.0, 1.0));
    assert!((volume(&all) - 6.0).abs() < 1e-9, "a mirrored copy keeps its outside");

    // All are turned by the same angle about y, the quaternion's 2 atan(3/4).
    let (w, d) = copies(true);
    let all = read(&glb(w, d));
    let (sin, cos) = (2.0 * f64::atan(0.75)).sin_cos();
    let wide = sin.abs() + cos.abs();
    assert!((size(&all.positions) - DVec3::new(6.0 + wide, 3.0, wide)).length() < 1e-6);

    let (w, mut d) = copies(false);
    let bytes = w.document(&mut d);
    d["accessors"][2]["count"] = 3.into();
    let e = read_in(&packed(&d, &bytes), Pose::File).unwrap_err();
    assert!(
        e.starts_with("the translations, rotations and scales of the copies of mesh `E` differ"),
        "{e}"
    );
    for k in 2..4 {
        d["accessors"][k]["count"] = 70_000.into();
        d["accessors"][k].as_object_mut().unwrap().remove("bufferView");
    }
    let e = read_in(&packed(&d, &bytes), Pose::File).unwrap_err();
    assert_eq!(e, "mesh `E` has 70000 copies; at most 65535 are supported");
}

/// Returns a cube with a morph target that makes it half as large again; `sparse` stores the
/// target so that only vertices with x above 0 are in the file.
fn key(weights: &Value, sparse: bool) -> Vec<u8> {
    let (mut w, at, corners, positions) = cube();
    let moved: Vec<u16> = (0..positions.len() as u16)
        .filter(|v| !sparse || positions[usize::from(*v)].x > 0.0)
        .collect();
    let by: Vec<f32> =
        moved.iter().flat_map(|v| (positions[usize::from(*v)] * 0.5).to_array()).collect();
    let target = w.floats("VEC3", &by);
    let places = w.shorts("SCALAR", &moved);
    let mut d = json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "Cube" }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": at }, "indices": corners,
            "targets": [{ "POSITION": target }] }], "extras": { "targetNames": ["big"] } }],
    });
    for (place, weights) in weights.as_object().unwrap() {
        let (list, index) = if place == "mesh" { ("meshes", 0) } else { ("nodes", 0) };
        d[list][index]["weights"] = weights.clone();
    }
    let bytes = w.document(&mut d);
    if sparse {
        let view = |k: usize| d["accessors"][k]["bufferView"].clone();
        d["accessors"][target] = json!({ "componentType": 5126, "type": "VEC3", "count": positions.len(), "sparse": {
            "count": moved.len(), "indices": { "bufferView": view(places), "componentType": 5123 },
            "values": { "bufferView": view(target) } } });
    }
    packed(&d, &bytes)
}

#[test]
fn default_weights_of_morph_targets_are_drawn() {
    for (weights, side) in [
        (json!({}), 2.0),
        (json!({ "mesh": [1] }), 3.0),
        (json!({ "mesh": [1], "node": [0] }), 2.0),
        (json!({ "mesh": [0], "node": [0.5] }), 2.5),
    ] {
        let all = read(&key(&weights, false));
        assert_eq!(size(&all.positions), DVec3::splat(side), "{weights}");
    }
    let all = read(&key(&json!({ "mesh": [1] }), true));
    assert_eq!(size(&all.positions), DVec3::new(2.5, 3.0, 3.0), "a sparse target moves some");
}

#[test]
fn sparse_accessors_are_checked() {
    let good = key(&json!({ "mesh": [1] }), true);
    let text = |from: &str, to: &str| {
        let bytes = String::from_utf8_lossy(&good).into_owned();
        assert!(bytes.contains(from), "{from}");
        // The lengths of the chunks stay as they are.
        assert_eq!(from.len(), to.len());
        let at = good.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        let mut file = good.clone();
        file[at..at + to.len()].copy_from_slice(to.as_bytes());
        read_in(&file, Pose::File).unwrap_err()
    };
    let index = text("\"componentType\":5123},\"values\"", "\"componentType\":5126},\"values\"");
    assert_eq!(index, "accessor 2 of the glTF file has sparse indices of type 5126");
    let count = text("\"sparse\":{\"count\":12", "\"sparse\":{\"count\":99");
    assert_eq!(count, "accessor 2 of the glTF file extends beyond its buffer");
    let order = text("\"componentType\":5123},\"values\"", "\"componentType\":5121},\"values\"");
    assert!(order.contains("out of order or range"), "{order}");
    let few = text("\"count\":24,\"sparse\"", "\"count\":23,\"sparse\"");
    assert!(few.contains("out of order or range") || few.contains("morph target for 23"), "{few}");
}

/// Returns a cube that one joint moves, with the same targets.
fn body(weights: &Value) -> Vec<u8> {
    let plain = key(weights, false);
    let length = u32::from_le_bytes(plain[12..16].try_into().unwrap()) as usize;
    let mut d: Value = serde_json::from_slice(&plain[20..20 + length]).unwrap();
    let mut bytes = plain[28 + length..].to_vec();
    let count = d["accessors"][0]["count"].as_u64().unwrap() as usize;
    let (joints, shares) = (vec![0u8; 4 * count], [1.0f32, 0.0, 0.0, 0.0].repeat(count));
    let shares: Vec<u8> = shares.iter().flat_map(|x| x.to_le_bytes()).collect();
    for (name, component, more) in [("JOINTS_0", 5121, joints), ("WEIGHTS_0", 5126, shares)] {
        let number = d["accessors"].as_array().unwrap().len();
        let view = d["bufferViews"].as_array().unwrap().len();
        let accessor = json!({ "bufferView": view, "componentType": component, "type": "VEC4", "count": count });
        d["accessors"].as_array_mut().unwrap().push(accessor);
        let place = json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": more.len() });
        d["bufferViews"].as_array_mut().unwrap().push(place);
        bytes.extend(more);
        d["meshes"][0]["primitives"][0]["attributes"][name] = number.into();
    }
    d["buffers"][0]["byteLength"] = bytes.len().into();
    d["nodes"][0]["skin"] = 0.into();
    d["nodes"].as_array_mut().unwrap().push(json!({ "name": "bone" }));
    d["scenes"][0]["nodes"] = json!([0, 1]);
    d["skins"] = json!([{ "joints": [1] }]);
    packed(&d, &bytes)
}

#[test]
fn morph_targets_are_the_morphs_of_a_body() {
    for (weights, rest) in [(json!({}), 2.0), (json!({ "mesh": [1] }), 3.0)] {
        let body = read_in(&body(&weights), Pose::Bind).unwrap().armature().unwrap();
        assert_eq!(body.morphs().collect::<Vec<_>>(), ["big"]);
        assert_eq!(body.positions().len(), 8, "corners that morphs move alike are one vertex");
        assert_eq!(size(body.positions()), DVec3::splat(rest));
        // A weight is that of the file's slider, whatever the file has at rest.
        for (weight, side) in [(0.0, 2.0), (1.0, 3.0), (2.0, 4.0)] {
            let shaped = body.shaped(&[("big", weight)]).unwrap();
            assert_eq!(size(shaped.positions()), DVec3::splat(side), "{weights} {weight}");
            let more = shaped.shaped(&[("big", 1.0)]).unwrap();
            assert_eq!(size(more.positions()), DVec3::splat(side + 1.0), "then they add up");
        }
    }
}

#[test]
fn a_posed_body_is_read_as_its_nodes_are_or_as_it_was_bound() {
    let file = files::everything();
    let at = |pose: Pose| {
        let all = read_in(&file, pose).unwrap();
        assert_eq!(all.names, ["body", "many", "many#2", "many#3"], "the hidden node is not there");
        all
    };
    // Lifted by half of 1, and vertex 2 moved by (0, 3, 0).
    let bind = at(Pose::Bind);
    let known = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 4.0, 0.5], [0.0, 1.0, 0.5]];
    assert_eq!(bind.positions[..4], known.map(Vec3::from));
    // The tip is turned by 2 atan(3/4) about z: cosine 0.28, sine 0.96.
    let posed = at(Pose::File);
    let turned = |p: DVec3| DVec3::new(0.28 * p.x - 0.96 * p.y, 0.96 * p.x + 0.28 * p.y, p.z);
    let rest = DVec3::new(1.0, 4.0, 0.5);
    let known = [
        DVec3::new(0.0, 0.0, 0.5),
        DVec3::new(1.0, 0.0, 0.5),
        rest * 0.25 + turned(rest) * 0.75,
        turned(DVec3::new(0.0, 1.0, 0.5)),
    ];
    for (found, known) in posed.positions.iter().zip(known) {
        assert!((found.as_dvec3() - known).length() < 1e-6, "{found} for {known}");
    }
    assert_eq!(bind.positions[4..], posed.positions[4..]);
    let said = |all: &Loaded| all.remarks.join("");
    let known = "the glTF file is posed: its bind pose is read; `pose = \"file\"` reads that of its \
                 nodes, where vertices are up to ";
    assert!(said(&bind).starts_with(known), "{}", said(&bind));
    let known = "the glTF file is posed: the pose of its nodes is read; `pose = \"bind\"` reads the \
                 bind pose, where";
    assert!(said(&posed).starts_with(known), "{}", said(&posed));

    // The morphs of the posed body are turned with it.
    let (bind, posed) = (bind.armature().unwrap(), posed.armature().unwrap());
    assert_eq!(posed.morphs().collect::<Vec<_>>(), ["lift", "point"]);
    let point = |body: &pcadlang_scene::geom::armature::Armature| {
        let flat = body.shaped(&[("point", 0.0)]).unwrap();
        body.positions()[2].as_dvec3() - flat.positions()[2].as_dvec3()
    };
    assert!((point(&bind) - DVec3::new(0.0, 3.0, 0.0)).length() < 1e-6);
    let by = DVec3::new(0.0, 3.0, 0.0);
    assert!((point(&posed) - (by * 0.25 + turned(by) * 0.75)).length() < 1e-6);
}

/// A body whose root moved a little is bound upright, as the mesh's node has it.
#[test]
fn the_bind_pose_of_a_posed_body_does_not_lean_with_its_root() {
    let mut w = Writer::default();
    let strip = [[0.0, 0.0], [0.2, 0.0], [0.2, 1.0], [0.0, 1.0], [0.2, 2.0], [0.0, 2.0]];
    let at = w.floats("VEC3", &strip.map(|[x, y]| [x, y, 0.0]).concat());
    let corners = w.bytes("SCALAR", &[0, 1, 2, 0, 2, 3, 3, 2, 4, 3, 4, 5]);
    let joints = w.bytes(
        "VEC4",
        &[[0; 4], [0; 4], [1, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]].concat(),
    );
    let shares = w.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(6));
    let mut binds = [[0.0f32; 16]; 2];
    for k in 0..4 {
        binds.iter_mut().for_each(|b| b[5 * k] = 1.0);
    }
    binds[1][13] = -1.0;
    let binds = w.floats("MAT4", &binds.concat());
    let d = |hip: Value, knee: f64| {
        let (sin, cos) = f64::to_radians(knee / 2.0).sin_cos();
        json!({
            "scenes": [{ "nodes": [0, 1] }],
            "nodes": [
                { "mesh": 0, "skin": 0 }, hip,
                { "name": "knee", "translation": [0, 1, 0], "rotation": [0, 0, sin, cos] },
            ],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": at, "JOINTS_0": joints, "WEIGHTS_0": shares }, "indices": corners }] }],
            "skins": [{ "joints": [1, 2], "inverseBindMatrices": binds }],
        })
    };
    let mut document = d(json!({}), 0.0);
    let bytes = w.document(&mut document);
    let mut file = |degrees: f64, up: f64, knee: f64| {
        let (sin, cos) = f64::to_radians(degrees / 2.0).sin_cos();
        let hip = json!({ "name": "hip", "children": [2], "rotation": [0, 0, sin, cos], "translation": [0, up, 0] });
        document["nodes"] = d(hip, knee)["nodes"].clone();
        packed(&document, &bytes)
    };
    let head = |all: &Loaded, name: &str| {
        let rig = all.rig.as_ref().unwrap();
        rig.joints()[rig.find(name).unwrap()].head
    };
    let upright = DVec3::new(f64::from(0.2f32), 2.0, 0.0);
    for (degrees, up, knee) in [(10.0, 0.0, 60.0), (40.0, 1.0, 0.0), (0.0, 0.0, 60.0)] {
        let file = file(degrees, up, knee);
        let (bind, posed) = (read_in(&file, Pose::Bind).unwrap(), read(&file));
        assert_eq!(size(&bind.positions), upright, "{degrees}, {up}, {knee}");
        assert!((head(&bind, "knee") - DVec3::Y).length() < 1e-6);
        let (sin, cos) = degrees.to_radians().sin_cos();
        assert!((head(&posed, "knee") - DVec3::new(-sin, cos + up, 0.0)).length() < 1e-6);
        assert!(bind.remarks[0].contains("posed") && posed.remarks[0].contains("posed"));
    }
    // A root turned by a right angle exchanges axes.
    let all = read_in(&file(90.0, 0.0, 0.0), Pose::Bind).unwrap();
    assert!((size(&all.positions) - DVec3::new(2.0, upright.x, 0.0)).length() < 1e-6);
    assert!(all.remarks.is_empty());
}

#[test]
fn extensions_that_are_not_read_are_named() {
    let (w, mut d) = copies(false);
    d["extensionsUsed"] =
        json!(["KHR_materials_unlit", "EXT_mesh_gpu_instancing", "NV_micro_mesh", "VRMC_vrm",]);
    d["animations"] = json!([{ "channels": [{ "sampler": 0, "target": { "node": 0, "path": "rotation" } }], "samplers": [] }]);
    let said = read(&glb(w, d)).remarks;
    assert_eq!(
        said[0],
        "NV_micro_mesh is not read; where it changed the shape, the shape here is another"
    );
    assert!(said[1].starts_with("the animations of the glTF file are not read"), "{}", said[1]);
    assert_eq!(said.len(), 2);
}
