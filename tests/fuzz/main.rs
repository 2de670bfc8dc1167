//! Runs the targets of `fuzz/` on seeds, on every input that once failed, and on seeds
//! with some bytes changed; and writes the seeds for longer fuzzing.

#[path = "../common/mod.rs"]
mod common;
#[allow(dead_code)]
#[path = "../../crates/detectors/src/nn/tests/graph.rs"]
mod graphs;
#[allow(dead_code)]
#[path = "../../crates/detectors/src/nn/tests/writer.rs"]
mod networks;
#[path = "../../fuzz/src/lib.rs"]
mod targets;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use common::{folder, gltf};
use image::{DynamicImage, GrayImage, ImageFormat, Luma, RgbImage, RgbaImage};
use pcadlang::Program;
use pcadlang_scene::vision::npy;
use pcadlang_workbench::bank::{Features, Learn, learn};
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::AtomicU64;

use serde_json::json;

/// Requests of the studio's page.
const REQUESTS: [&str; 6] = [
    r#"{"id":1,"method":"folder"}"#,
    r#"{"id":2,"method":"open","params":{"program":"lathe.pcad","observe":["a.png"],"set":{"size":"64"}}}"#,
    r#"{"id":3,"method":"picture","params":{"state":{"run":"runs/a","draw":2},"layer":"depth","size":128,
        "camera":{"eye":[0,0,8],"target":[0,0,0],"up":[0,1,0],"fov_y":30}}}"#,
    r#"{"id":4,"method":"assign","params":{"session":1,"address":"@x[0]","value":[1,true,"a"],"drag":true}}"#,
    r#"{"id":5,"method":"run","params":{"session":1,"settings":{"time":2.5,"chains":2,"set":{"a":"1"}}}}"#,
    r#"{"id":6,"method":"quantity","params":{"run":"runs/a","names":["x","log_joint"]}}"#,
];

type Target = fn(&[u8]);

/// The targets, and for each a test of its seeds: they run side by side.
macro_rules! targets {
    ($($name:ident)*) => {
        const TARGETS: &[(&str, Target)] = &[$((stringify!($name), targets::$name)),*];

        mod seeds {
            $(#[test]
            fn $name() {
                super::accepts_its_seeds(stringify!($name), super::targets::$name);
            })*
        }
    };
}

targets! { program_text program obj stl ply gltf rig image array camera trace bank checkpoint keypoints table network graph_model studio }

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns every file below a folder whose name has this ending, sorted.
fn files(dir: &Path, ending: &str) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            all.extend(files(&path, ending));
        } else if path.to_string_lossy().ends_with(ending) {
            all.push(path);
        }
    }
    all.sort();
    all
}

fn read(path: impl AsRef<Path>) -> Vec<u8> {
    std::fs::read(root().join(path.as_ref()))
        .unwrap_or_else(|e| panic!("{}: {e}", path.as_ref().display()))
}

fn encoded(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    picture.into().write_to(&mut Cursor::new(&mut bytes), format).unwrap();
    bytes
}

/// Two triangles, in a file whose header begins as a text's would.
fn binary_stl() -> Vec<u8> {
    let mut bytes = b"solid made by a program".to_vec();
    bytes.resize(80, 0);
    bytes.extend(2u32.to_le_bytes());
    for corners in [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0f32], [0.5; 9]] {
        let normal = [0.0, 0.0, 1.0];
        bytes.extend(normal.into_iter().chain(corners).flat_map(f32::to_le_bytes));
        bytes.extend([0, 0]);
    }
    bytes
}

/// A square of one polygon, and a strip.
fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\n\
         property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_indices\n\
         element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let number = |x: f32, size: usize| match (format, size) {
        ("ascii", _) => format!("{x} ").into_bytes(),
        (_, 1) => vec![x as u8],
        ("binary_little_endian", 4) => (x as i32).to_le_bytes().to_vec(),
        (_, 4) => (x as i32).to_be_bytes().to_vec(),
        ("binary_little_endian", _) => x.to_le_bytes().to_vec(),
        _ => x.to_be_bytes().to_vec(),
    };
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        bytes.extend([number(x, 0), number(y, 0), number(0.0, 0), number(200.0, 1)].concat());
    }
    bytes.extend(number(4.0, 1));
    for x in [0.0, 1.0, 2.0, 3.0, 5.0, 0.0, 1.0, 2.0, -1.0, 3.0] {
        bytes.extend(number(x, 4));
    }
    bytes
}

fn pictures() -> Vec<Vec<u8>> {
    let rgb = RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 128]));
    let deep = image::ImageBuffer::from_fn(9, 7, |x, y| Luma([(x * 4000 + y * 100) as u16]));
    vec![
        encoded(rgb.clone(), ImageFormat::Png),
        encoded(rgb, ImageFormat::Jpeg),
        encoded(GrayImage::from_fn(9, 7, |x, y| Luma([(x * y) as u8])), ImageFormat::Png),
        encoded(GrayImage::from_fn(9, 7, |x, y| Luma([(x * y) as u8])), ImageFormat::Jpeg),
        encoded(
            RgbaImage::from_fn(5, 3, |x, y| image::Rgba([9, 200, x as u8, y as u8 * 99])),
            ImageFormat::Png,
        ),
        encoded(DynamicImage::ImageLuma16(deep), ImageFormat::Png),
    ]
}

/// Made once, since its folder is shared by all tests.
static A_BANK: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let text = "include \"std/scene.pcad\" as scene; assume r ~ uniform(0.3, 1); assume w ~ iid(flip(0.5), 2);
        assume view = scene.render(scene.sphere(r, sides = 8));";
    let model = Program::parse(text).and_then(Program::compile).unwrap();
    let f = folder::Folder::new("fuzz_bank");
    let path = f.path().join("x.bank");
    let how = Learn {
        first: 0,
        name: "x",
        count: 3,
        seed: 1,
        threads: 1,
        features: Features::Contours { size: 16 },
    };
    learn(&model, &how, &path, &AtomicU64::new(0)).unwrap();
    std::fs::read(path).unwrap()
});

/// Returns a triangle on a joint, as `.glb`, and as `.gltf` with an embedded and an
/// external buffer; a file with what few have, and compressed ones.
fn bodies() -> Vec<Vec<u8>> {
    let document = || {
        let mut w = gltf::Writer::default();
        let positions = w.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        let indices = w.shorts("SCALAR", &[0, 1, 2]);
        let joints = w.bytes("VEC4", &[0; 12]);
        let weights = w.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(3));
        let binds = w.floats("MAT4", &[1.0, 0.0, 0.0, 0.0, 0.0].repeat(4)[..16]);
        let attributes = json!({ "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights });
        let mut document = json!({
            "scene": 0, "scenes": [{ "nodes": [0, 1] }],
            "nodes": [{ "mesh": 0, "skin": 0, "name": "n" }, { "name": "j", "translation": [0, 1, 0], "scale": [1, 2, 1] }],
            "meshes": [{ "primitives": [{ "attributes": attributes, "indices": indices, "mode": 4 }] }],
            "skins": [{ "joints": [1], "inverseBindMatrices": binds }],
        });
        let buffer = w.document(&mut document);
        (document, buffer)
    };
    let (mut within, buffer) = document();
    within["buffers"][0]["uri"] =
        format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&buffer)).into();
    let (mut beside, _) = document();
    beside["buffers"][0]["uri"] = "x.bin".into();
    let (inside, buffer) = document();
    let mut all =
        vec![gltf::packed(&inside, &buffer), within.to_string().into(), beside.to_string().into()];
    all.push(gltf::everything());
    let compressed = files(&root().join("tests/data/gltf"), ".glb");
    all.extend(compressed.iter().map(|path| std::fs::read(path).unwrap()));
    all
}

const CAMERAS: [&str; 10] = [
    r#"{"model": "pinhole", "looks_along": [0, 0, -1], "up": [0, 1, 0], "position": [0, 0, 8], "image": [256, 256],
        "focal_px": 465.4, "principal_point": [128, 128]}"#,
    r#"{"model": "orthographic", "looks_along": [0, 1, -1], "up": [0, 0, 1], "image": [64, 48],
        "units_per_pixel": 0.02}"#,
    "%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
        data: [ 50., 0., 31.5, 0., 51., 23.5, 0., 0., 1. ]\ndistortion_coefficients: [ -0.2, 0.1, 1e-3, -1e-3, 0.01 ]\n\
        rvec: [ 1.5, 0, 0.1 ]\ntvec: [ 0, 0, 4 ]\n",
    r#"{"mtx": [[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1]], "dist": [0.1, 0, 0, 0, 0, 0.1, 0.2, 0.3]}"#,
    r#"{"camera_angle_x": 0.9, "k1": 0.01, "frames": [{"file_path": "./a/1", "transform_matrix":
        [[1, 0, 0, 0], [0, 0, -1, -4], [0, 1, 0, 1], [0, 0, 0, 1]]}]}"#,
    r#"{"1": {"cam_K": [50, 0, 32, 0, 50, 24, 0, 0, 1], "cam_R_w2c": [1, 0, 0, 0, -1, 0, 0, 0, -1], "cam_t_w2c": [0, 0, 400],
        "depth_scale": 0.1}}"#,
    r#"{"class_name": "PinholeCameraTrajectory", "parameters": [{"extrinsic": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 4, 1],
        "intrinsic": {"height": 48, "width": 64, "intrinsic_matrix": [50, 0, 0, 0, 50, 0, 31.5, 23.5, 1]}}]}"#,
    r#"{"color": {"fx": 50, "fy": 30, "ppx": 31, "ppy": 23, "width": 64, "height": 48, "model": "inverse_brown_conrady",
        "coeffs": [0.1, -0.1, 0.001, 0, 0.01]}}"#,
    r#"{"asset": {"version": "2.0"}, "nodes": [{"name": "1", "camera": 0, "translation": [0, 0, 5]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.5}}]}"#,
    "cam0:\n  camera_model: pinhole\n  intrinsics: [50, 50, 32, 24]\n  distortion_model: radtan\n  \
        distortion_coeffs: [0.1, 0, 0, 0]\n  resolution: [64, 48]\n",
];

/// Returns camera files, each behind its kind and the file beside it.
fn cameras() -> Vec<Vec<u8>> {
    let made = |kind: u8, other: &[u8], own: &[u8]| {
        [&[kind], &(other.len() as u16).to_le_bytes()[..], other, own].concat()
    };
    let lenses = "# Camera list\n1 OPENCV 64 48 50 51 32 24 -0.2 0.1 0.001 -0.001\n2 SIMPLE_RADIAL 64 48 50 32 24 0.1\n";
    let images = "# Image list\n1 1 0 0 0 0 0 4 1 a/1.png\n\n2 0 1 0 0 0 0 4 2 2.png\n1 2 -1\n";
    let mut binary =
        [1u64.to_le_bytes().as_slice(), &1u32.to_le_bytes(), &1u32.to_le_bytes()].concat();
    binary.extend([64u64.to_le_bytes(), 48u64.to_le_bytes()].concat());
    binary.extend([50.0f64, 51.0, 32.0, 24.0].map(f64::to_le_bytes).concat());
    let mut taken = [1u64.to_le_bytes().as_slice(), &1u32.to_le_bytes()].concat();
    taken.extend([1.0f64, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0].map(f64::to_le_bytes).concat());
    taken.extend([&1u32.to_le_bytes()[..], b"1.png\0", &1u64.to_le_bytes(), &[0; 24]].concat());
    let mut all: Vec<_> = CAMERAS.iter().map(|text| made(0, b"", text.as_bytes())).collect();
    all.extend([
        made(1, images.as_bytes(), lenses.as_bytes()),
        made(2, lenses.as_bytes(), images.as_bytes()),
        made(3, &taken, &binary),
        made(4, &binary, &taken),
    ]);
    all
}

const OBJ: &str = "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0 1\nv 1 1 0\nf 1 2 3\ng b c\nf 1/1/1 2/2/2 3 4\nf -1 -2 -3\nvt 0 0\nvn 0 0 1\n\
    usemtl x\nmtllib x.mtl\ns off\nl 1 2\np 1\n";

const RIG: &str = r#"{"mesh": "a.obj", "joints": [{"name": "a", "head": [0, 0, 0], "tail": [0, 1, 0]},
    {"name": "b", "parent": "a", "head": [0, 1, 0]}], "weights": [[[0, 1.0]], [[0, 0.5], [1, 0.5]], [[1, 1.0]]],
    "keypoints": {"k": {"joint": "b", "rest": [0, 1, 0]}}}"#;

const MORPHS: &str = r#"{"morphs": {"m": {"vertices": [[0,0,0],[0,0,1],[0,0,0]], "heads": [[0,0,0],[0,0,0]], "tails": [[0,0,0],[0,0,0]]}}}"#;

const PEOPLE: [&str; 3] = [
    r#"{"keypoints": {"nose": [1, 2, 0.5], "hand": [3, 4]}, "width": 64, "height": 48}"#,
    r#"{"seven": {"keypoints": {"nose": [10, 20, 0.9], "left_wrist": null}}, "eight": {"keypoints": {"nose": [1, 2]}}}"#,
    "{\"nose\": [1, 2, 0.5], \"hand\": null}",
];

/// Returns people in every file layout.
fn people() -> Vec<Vec<u8>> {
    let landmarks = [r#"{"x": 0.1, "y": 0.2, "z": 0, "visibility": 0.9}"#; 33].join(", ");
    let coco = ["10, 20, 0.9"; 17].join(", ");
    let one = format!(
        "{{\"image_id\": 1, \"category_id\": 1, \"id\": 7, \"keypoints\": [{coco}], \"score\": 0.5}}"
    );
    let images = r#"[{"id": 1, "file_name": "000001.jpg", "width": 64, "height": 48}]"#;
    let made = [
        format!("[{one}]"),
        format!("{{\"images\": {images}, \"annotations\": [{one}, {one}]}}"),
        format!("{{\"pose_landmarks\": [{landmarks}]}}"),
    ];
    let positions = ["[10, 20]"; 17].join(", ");
    let columns = ["10.5"; 17].join(", ");
    let hand = ["1, 2, 0.5"; 21].join(", ");
    let line = format!("0 0.5 0.5 0.2 0.4{}", " 0.25 0.5 0.9".repeat(17));
    let tools = [
        format!(
            "{{\"people\": [{{\"pose_keypoints_2d\": [{coco}, 1, 1, 1], \
             \"hand_left_keypoints_2d\": [{hand}]}}]}}"
        ),
        format!("{{\"a/000001.jpg\": {{\"bodies\": [{{\"joints\": [{coco}]}}]}}}}"),
        r#"{"meta_info": {"keypoint_id2name": {"0": "nose"}}, "instance_info":
            [{"frame_id": 1, "instances": [{"keypoints": [[1, 2]], "keypoint_scores": [1.2]}]}]}"#
            .to_owned(),
        format!("[{{\"keypoints\": {{\"x\": [{columns}], \"y\": [{columns}]}}, \"track_id\": 3}}]"),
        format!(
            "{{\"keypoints\": [[{positions}], [{positions}]], \"scores\": [[{columns}], [{columns}]]}}"
        ),
        format!("{{\"poseLandmarks\": [{landmarks}]}}"),
        "[{\"keypoints\": [{\"name\": \"leftEye\", \"x\": 1, \"y\": 2, \"score\": 0.5}]}]"
            .to_owned(),
        format!("{line}\n{line} 0.9 4\n"),
        DEEPLABCUT.to_owned(),
        SLEAP.to_owned(),
    ];
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, shape) in [("keypoints.npy", &[1, 17, 2][..]), ("scores.npy", &[1, 17])] {
        let count = shape.iter().product();
        archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        let array = npy::f32_array(shape, (0..count).map(|i| 1.0 + i as f32));
        archive.write_all(&array).unwrap();
    }
    let arrays = [
        archive.finish().unwrap().into_inner(),
        npy::f32_array(&[17, 3], (0..51).map(|i| i as f32)),
    ];
    let texts = PEOPLE.iter().map(|t| t.as_bytes().to_vec());
    texts.chain(made.into_iter().chain(tools).map(String::into_bytes)).chain(arrays).collect()
}

const DEEPLABCUT: &str = "scorer,s,s,s,s,s,s\nindividuals,a,a,a,b,b,b\nbodyparts,nose,nose,nose,nose,nose,nose\n\
    coords,x,y,likelihood,x,y,likelihood\nlabeled-data/v/000001.png,1,2,0.5,3,4,\n7,,,,5,6,0.1\n";

const SLEAP: &str =
    "track,frame_idx,instance.score,nose.x,nose.y,nose.score\na,0,0.8,1,2,1.1\nb,0,,3,,\n";

/// Returns the seeds of a target.
fn seeds_of(target: &str) -> Vec<Vec<u8>> {
    let texts = |all: &[&str]| all.iter().map(|t| t.as_bytes().to_vec()).collect::<Vec<_>>();
    match target {
        "program_text" | "program" => {
            let folders = ["programs", "tests/syntax", "tests/posteriordb"];
            folders.iter().flat_map(|d| files(&root().join(d), ".pcad")).map(read).collect()
        }
        "obj" => texts(&[OBJ, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"]),
        "stl" => vec![
            b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\n\
              endloop\nendfacet\nendsolid a\n"
                .to_vec(),
            binary_stl(),
        ],
        "ply" => ["ascii", "binary_little_endian", "binary_big_endian"].map(ply).to_vec(),
        "gltf" => bodies(),
        "rig" => vec![
            RIG.into(),
            [
                RIG.replace("\"joints\"", "\"morphs\": \"m\", \"joints\"").as_bytes(),
                b"\0",
                MORPHS.as_bytes(),
            ]
            .concat(),
        ],
        "image" => pictures(),
        "array" => {
            let npy = |descr: &str, shape: &str, body: &[u8]| {
                let header =
                    format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
                let length = (header.len() as u16).to_le_bytes();
                [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), body].concat()
            };
            vec![
                npy::f32_array(&[2, 3], [1.0, 0.0, f32::NAN, f32::INFINITY, -1.0, 2.0]),
                npy("|u1", "(2, 3)", &[0, 1, 2, 3, 128, 255]),
                npy("|b1", "(2, 3, 1)", &[0, 1, 1, 0, 0, 1]),
                npy("<f8", "(1, 2)", &[0; 16]),
            ]
        }
        "camera" => cameras(),
        "studio" => texts(&REQUESTS),
        "trace" => {
            let model = targets::traced();
            (0..5)
                .map(|i| {
                    serde_json::to_vec(&model.simulate(i, 0).unwrap().save(model.hash())).unwrap()
                })
                .collect()
        }
        "bank" => vec![A_BANK.clone()],
        "checkpoint" => {
            // A chain is run from each; twenty are of every loop of the program.
            let all = targets::checkpoints(None);
            let every = (all.len() / 20).max(1);
            all.into_iter().step_by(every).collect()
        }
        "keypoints" => people(),
        "table" => texts(&[
            "\0{\"a\": [1, 2, {\"b\": null}], \"c\": \"x\"}",
            "\u{1}x,y\n1,2.5\n-3e2, \"4\"\"\"\n",
            "\u{1}x;ok\n1;true\n",
        ]),
        "network" => vec![networks::file(b"TFL3", &networks::small())],
        "graph_model" => {
            let files = [graphs::small(), graphs::split()].map(|g| g.files());
            files.map(|(json, weights)| [json, vec![0], weights].concat()).to_vec()
        }
        _ => Vec::new(),
    }
}

/// Returns the next number of a stream (xorshift).
fn next(x: &mut u64) -> usize {
    *x ^= *x << 13;
    *x ^= *x >> 7;
    *x ^= *x << 17;
    *x as usize
}

/// Applies one to four mutations: bytes are changed, removed or duplicated.
fn changed(seed: &[u8], x: &mut u64) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..next(x) % 4 + 1 {
        let at = next(x) % bytes.len().max(1);
        match next(x) % 5 {
            _ if bytes.is_empty() => {}
            0 => bytes.truncate(at),
            1 => drop(bytes.remove(at)),
            2 => bytes[at] = next(x) as u8,
            3 => bytes[at] ^= 1 << (next(x) % 8),
            _ => {
                let piece = bytes[at..(at + next(x) % 12).min(seed.len().max(at)).min(bytes.len())]
                    .to_vec();
                let to = next(x) % bytes.len();
                bytes.splice(to..to, piece);
            }
        }
    }
    bytes
}

/// Each target accepts its seeds, and each seed is valid, so that its mutations get
/// beyond the first check.
fn accepts_its_seeds(name: &str, target: Target) {
    use pcadlang_scene::cameras::{Asked, CameraFile};
    use pcadlang_scene::geom::{FileFrame, gltf::load, obj, ply, stl};
    use pcadlang_scene::vision::{Limits, depth, keypoints::People, photo};
    let all = seeds_of(name);
    assert!(!all.is_empty(), "{name}");
    for seed in &all {
        target(seed);
        let good = match name {
            "obj" => obj::load(seed).is_ok(),
            "stl" => stl::indexed(seed).is_ok(),
            "ply" => ply::indexed(seed).is_ok(),
            // One of them has an external buffer.
            "gltf" => {
                load(seed, &FileFrame::default(), Default::default(), &|_| Err("beside".into()))
                    .map_or_else(
                        |e| e.to_string().contains("beside"),
                        |loaded| loaded.mesh().is_ok(),
                    )
            }
            "image" => photo::decode(seed, &Limits::default()).is_ok(),
            "array" => depth::decode(seed, Some(1.0), 0.0, &Limits::default()).is_ok(),
            "camera" => {
                let names = ["camera", "cameras.txt", "images.txt", "cameras.bin", "images.bin"];
                let (other, own) =
                    seed[3..].split_at(usize::from(u16::from_le_bytes([seed[1], seed[2]])));
                let asked = Asked { photo: Some("a/1.png"), ..Asked::default() };
                let name = names[usize::from(seed[0])];
                CameraFile::read(name, own, &asked, &|_| Ok(other.to_vec())).is_ok()
            }
            "keypoints" => People::parse(seed).is_ok(),
            "network" => pcadlang_detectors::nn::Network::read(seed).is_ok(),
            "graph_model" => {
                let (json, weights) = seed.split_at(seed.iter().position(|b| *b == 0).unwrap());
                pcadlang_detectors::nn::Network::read_graph_model(json, &weights[1..], None).is_ok()
            }
            "checkpoint" => pcadlang_inference::Checkpoint::from_bytes(seed).is_ok(),
            _ => true,
        };
        assert!(good, "a seed of {name} is refused: {}", String::from_utf8_lossy(seed));
    }
}

#[test]
#[ignore = "half a minute"]
fn seeds_with_bytes_changed() {
    for (name, target) in TARGETS.iter().filter(|(name, _)| *name != "program") {
        let mut x = 0x9e37_79b9_7f4a_7c15;
        for seed in seeds_of(name) {
            // A chain is run from each checkpoint, which takes longer.
            for _ in 0..if *name == "checkpoint" { 10 } else { 30 } {
                target(&changed(&seed, &mut x));
            }
        }
    }
}

/// Inputs that fuzzing found, by target.
#[test]
fn findings() {
    for (name, target) in TARGETS {
        for path in files(&root().join("tests/data/fuzz").join(name), "") {
            eprintln!("{}", path.display());
            target(&read(path));
        }
    }
}

/// Writes the seeds to the folder that `fuzz/seeds.sh` sets.
#[test]
#[ignore = "writes files: see fuzz/seeds.sh"]
fn write_seeds() {
    let Some(to) = std::env::var_os("SEEDS").map(PathBuf::from) else { return };
    for (name, _) in TARGETS {
        let folder = to.join(name);
        std::fs::create_dir_all(&folder).unwrap();
        for (i, seed) in seeds_of(name).iter().enumerate() {
            std::fs::write(folder.join(format!("seed-{i}")), seed).unwrap();
        }
    }
}
