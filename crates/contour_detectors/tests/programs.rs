//! Contour detectors from files, in programs.

#[allow(dead_code)]
#[path = "../src/forest/writer.rs"]
mod forests;

use image::{GrayImage, ImageFormat, Luma};
use pcadlang_contour_detectors::{NetworkOptions, host, read};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Draws;
use pcadlang_library::scene::{DetectorValue, ImageValue};
use pcadlang_library::{Model, Program, standard};
use pcadlang_scene::vision::Photo;
use std::io::Cursor;
use std::path::{Path, PathBuf};

const PROGRAM: &str = "
include \"std/scene.pcad\" as scene;
data photo = image(\"ball.png\");
data trees = detector(\"model.yml\");
data none = detector();
let plain = scene.edges(photo);
let by_trees = scene.edges(photo, detector = trees);
let by_none = scene.edges(photo, detector = none);
let smoother = scene.edges(photo, detector = trees, smooth = 4, strength = 0.05);
";

/// A picture of a disc.
fn ball() -> Vec<u8> {
    let disc = GrayImage::from_fn(96, 96, |x, y| {
        Luma([if (x as f32 - 47.5).hypot(y as f32 - 47.5) < 24.0 { 255 } else { 0 }])
    });
    let mut bytes = Cursor::new(Vec::new());
    disc.write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn folder(name: &str) -> PathBuf {
    let f = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&f).unwrap();
    let yaml = forests::small().yaml();
    std::fs::write(f.join("ball.png"), ball()).unwrap();
    std::fs::write(f.join("model.yml.gz"), forests::gzip(yaml.as_bytes())).unwrap();
    std::fs::write(f.join("model.yml"), yaml).unwrap();
    f
}

fn open(f: &Path, text: &str) -> Program {
    std::fs::write(f.join("p.pcad"), text).unwrap();
    let program = Program::open(f.join("p.pcad").to_str().unwrap());
    program.and_then(|p| p.host(&host())).unwrap_or_else(|e| panic!("{e}"))
}

/// Returns the number of contour points of a program's value, and the sum of their
/// coordinates.
fn contours(model: &Model, name: &str) -> (usize, f32) {
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    let value = trace.global(name, Draws::default()).unwrap().unwrap();
    seen(&value)
}

fn seen(image: &Value) -> (usize, f32) {
    let map = image.downcast::<ImageValue>().unwrap().map().unwrap();
    (map.len(), map.x.iter().chain(&map.y).sum())
}

fn forest() -> DetectorValue {
    let read = read(forests::small().yaml().as_bytes(), &NetworkOptions::default());
    DetectorValue(Some(read.unwrap()))
}

#[test]
fn programs_name_their_detector() {
    let f = folder("detectors_named");
    let model = open(&f, PROGRAM).compile().unwrap_or_else(|e| panic!("{e}"));
    let [plain, by_trees, by_none, smoother] =
        ["plain", "by_trees", "by_none", "smoother"].map(|name| contours(&model, name));
    assert!(
        plain.0 > 50 && by_trees.0 > 15 && smoother.0 > 20,
        "{plain:?} {by_trees:?} {smoother:?}"
    );
    assert!(plain == by_none && plain != by_trees && by_trees != smoother);
    // Another file is another input, with another hash.
    let hash = model.data_hash().to_owned();
    let other = forests::small().yaml().replace("stride: 2", "stride: 4");
    std::fs::write(f.join("model.yml"), other).unwrap();
    let other = open(&f, PROGRAM).compile().unwrap_or_else(|e| panic!("{e}"));
    assert_ne!(other.data_hash(), hash);
    assert_ne!(contours(&other, "by_trees"), by_trees);
}

#[test]
fn a_run_has_a_detector_where_the_program_names_none() {
    let f = folder("detectors_chosen");
    let plain = open(&f, PROGRAM).compile().unwrap_or_else(|e| panic!("{e}"));
    let chosen = open(&f, PROGRAM).detector(forest()).compile().unwrap_or_else(|e| panic!("{e}"));
    let by_trees = contours(&plain, "by_trees");
    for (name, expected) in
        [("plain", by_trees), ("by_trees", by_trees), ("by_none", contours(&plain, "by_none"))]
    {
        assert_eq!(contours(&chosen, name), expected, "{name}");
    }
    // The photograph itself, and one given by a host; the given value does not change
    // once its contours have been computed.
    assert_eq!(contours(&chosen, "photo"), by_trees);
    let grey = pcadlang_scene::vision::photo::decode(&ball(), &Default::default()).unwrap();
    let given = Value::object(ImageValue::photo(Photo::from_rgb(grey.rgb().clone()).unwrap()));
    let before = seen(&given);
    let model =
        open(&f, PROGRAM).detector(forest()).observe("photo", given.clone()).compile().unwrap();
    assert_eq!((contours(&model, "photo"), seen(&given)), (by_trees, before));
    assert_ne!(by_trees, before);
}

#[test]
fn mistakes_are_shown() {
    let f = folder("detectors_wrong");
    let error = |item: &str| {
        let text = format!("data d = {item};\nlet n = d;\n");
        open(&f, &text).compile().map(|_| ()).unwrap_err().to_string()
    };
    let packed = forests::gzip(forests::small().yaml().as_bytes());
    std::fs::write(f.join("cut.yml.gz"), &packed[..300]).unwrap();
    std::fs::write(f.join("net.onnx"), b"\x08\x08:\x02\x12\x00").unwrap();
    for (item, says) in [
        ("detector(\"cut.yml.gz\")", "cut.yml.gz: line"),
        ("detector(\"ball.png\")", "neither a structured forest"),
        ("detector(\"nothing.onnx\")", "cannot read"),
        ("detector(\"model.yml\", logits = true)", "a structured forest has no options"),
        ("detector(\"net.onnx\", spread = 0)", "`spread` must be above 0"),
        (
            "detector(\"net.onnx\", output = 0)",
            "`output` must be a name in quotes or a number from 1",
        ),
        (
            "detector(\"net.onnx\", mean = [1, 2])",
            "`mean` must be a literal number or a list of three",
        ),
        ("detector(\"net.onnx\", colours = \"grey\")", "`colours` must be \"rgb\" or \"bgr\""),
        ("detector(\"net.onnx\", white = 1, white = 2)", "`white` is given twice"),
        ("detector(\"net.onnx\", size = 2)", "detector has no option `size`"),
    ] {
        let why = error(item);
        assert!(why.contains(says), "{item}: {why}");
    }
    let why = error("detector(\"net.onnx\")");
    assert!(why.contains("net.onnx: the network"), "{why}");
}

#[test]
fn its_example_runs() {
    let f = folder("detectors_example");
    let table = host().table(&standard::table()).unwrap();
    let example = table.get(table.find("", "detector").unwrap()).example.clone().unwrap();
    let model = open(&f, &format!("include \"std/scene.pcad\" as scene;\n{example}\n"));
    assert!(contours(&model.compile().unwrap_or_else(|e| panic!("{e}")), "found").0 > 15);
}

/// Writes the seeds to the folder that `fuzz/seeds.sh` sets.
#[test]
#[ignore = "writes files: see fuzz/seeds.sh"]
fn write_seeds() {
    let Some(to) = std::env::var_os("SEEDS").map(|f| Path::new(&f).join("forest")) else { return };
    std::fs::create_dir_all(&to).unwrap();
    let text = forests::small().yaml();
    std::fs::write(to.join("seed-0"), forests::gzip(text.as_bytes())).unwrap();
    std::fs::write(to.join("seed-1"), text).unwrap();
}
