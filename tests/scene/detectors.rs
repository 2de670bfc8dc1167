//! Contour detectors from files: in programs, by `--edges`, and how they are recorded.

use crate::common::folder::{Folder, disc, png};
use crate::forests;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Draws;
use pcadlang_library::scene::{DetectorValue, ImageValue};
use pcadlang_scene::vision::{FileDetector, NetworkOptions, Photo};

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

/// A program whose comparator uses the photograph without preprocessing.
const RUN: &str = "
include \"std/scene.pcad\" as scene;
data photo: image;
assume r ~ uniform(0.5, 1.5);
let view = scene.render(scene.sphere(r));
observe scene.contour(view, size = 32) = photo as picture;
infer { repeat 20 { drift(@r); collect r; } }
";

fn folder(name: &str) -> Folder {
    let f = Folder::new(name);
    f.write("ball.png", png(disc(96, 96, 48.0, 48.0, 24.0)));
    f.write("model.yml", forests::small().yaml());
    f.write("model.yml.gz", forests::gzip(forests::small().yaml().as_bytes()));
    f.write("run.pcad", RUN);
    f
}

fn open(f: &Folder, text: &str) -> Program {
    f.write("p.pcad", text);
    Program::open(f.path().join("p.pcad").to_str().unwrap()).unwrap_or_else(|e| panic!("{e}"))
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
    let read = FileDetector::read(forests::small().yaml().as_bytes(), &NetworkOptions::default());
    DetectorValue(Some(read.unwrap().into()))
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
    f.write("model.yml", forests::small().yaml().replace("stride: 2", "stride: 4"));
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
    let grey = pcadlang_scene::vision::photo::decode(
        &png(disc(96, 96, 48.0, 48.0, 24.0)),
        &Default::default(),
    )
    .unwrap();
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
    f.write("cut.yml.gz", &forests::gzip(forests::small().yaml().as_bytes())[..300]);
    f.write("net.onnx", b"\x08\x08:\x02\x12\x00");
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
    if cfg!(not(feature = "onnx")) {
        assert!(error("detector(\"net.onnx\")").contains("--features onnx"));
    }
}

#[test]
fn the_command_takes_a_detector() {
    let f = folder("detectors_command");
    f.succeeds(&["contours", "ball.png", "-o", "plain.png"]);
    let said =
        f.succeeds(&["contours", "ball.png", "-o", "trees.png", "--edges", "model.yml.gz"]).out;
    assert!(said.contains("contour points in 96 x 96 pixels"), "{said}");
    assert_ne!(
        std::fs::read(f.path().join("plain.png")).unwrap(),
        std::fs::read(f.path().join("trees.png")).unwrap()
    );
    let run = ["run", "run.pcad", "--observe", "ball.png", "--chains", "1", "--quiet"];
    f.succeeds(&[&run[..], &["--out", "a"]].concat());
    f.succeeds(&[&run[..], &["--out", "b", "--edges", "model.yml.gz"]].concat());
    f.succeeds(&[&run[..], &["--out", "c", "--edges", "model.yml"]].concat());
    let record = |name: &str| {
        serde_json::from_str::<serde_json::Value>(&f.read(&format!("{name}/run.json"))).unwrap()
    };
    // Times are on lines that begin with `#`.
    let draws = |name: &str| {
        let text = f.read(&format!("{name}/chain-1.csv"));
        text.lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!((record("a").get("edges"), &record("b")["edges"]), (None, &"model.yml.gz".into()));
    assert_ne!(record("a")["inputs_hash"], record("b")["inputs_hash"]);
    assert_ne!(draws("a"), draws("b"));
    assert_eq!(draws("b"), draws("c"), "the same forest, packed and not");
    f.refuses(
        &[&run[..], &["--out", "d", "--edges", "model.yml, colours = 3"]].concat(),
        "must be \"rgb\" or \"bgr\"",
    );
    f.refuses(
        &[&run[..], &["--out", "d", "--edges", "model.yml, bgr"]].concat(),
        "give options by name",
    );
    f.refuses(
        &[&run[..], &["--out", "d", "--edges", "model.yml, bgr); data e = csv(\"x\""]].concat(),
        "options of a detector",
    );
    f.refuses(&["contours", "ball.png", "--edges", "model.yml", "--size", "5000"], "at most 2048");
}
