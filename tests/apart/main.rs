//! The command with crates apart and without them: `cargo test --release --features
//! autorig,contour_detectors --test apart` has them.

#[allow(dead_code)]
#[path = "../common/folder.rs"]
mod folder;
#[allow(dead_code)]
#[path = "../../crates/contour_detectors/src/forest/writer.rs"]
mod forests;

use folder::{Folder, disc, png};

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
    f.write("run.pcad", RUN);
    f
}

#[test]
#[cfg(not(feature = "contour_detectors"))]
fn contour_detectors_say_which_feature_they_need() {
    let f = folder("no_detectors");
    f.write("p.pcad", "data trees = detector(\"model.yml\");\nlet n = trees;\n");
    let run = ["run", "run.pcad", "--observe", "ball.png", "--edges", "model.yml"];
    for args in [&run[..], &["check", "p.pcad"], &["contours", "ball.png", "--edges", "model.yml"]]
    {
        let done = f.run(args);
        assert!(
            done.code != 0 && done.err.contains("made without the feature `contour_detectors`"),
            "{args:?}: {}",
            done.err
        );
        assert!(done.err.contains("cargo install --path . --features contour_detectors"));
    }
    f.write("q.pcad", "data none = detector();\nlet n = none;\n");
    f.succeeds(&["check", "q.pcad"]);
}

#[test]
#[cfg(not(feature = "autorig"))]
fn rigging_says_which_feature_it_needs() {
    let done =
        Folder::new("no_autorig").run(&["sample", "autorig.pcad", "-n", "2", "--out", "sheet.png"]);
    assert!(
        done.code != 0 && done.err.contains("made without the feature `autorig`"),
        "{}",
        done.err
    );
    assert!(done.err.contains("cargo install --path . --features autorig"), "{}", done.err);
}

#[test]
#[cfg(feature = "autorig")]
fn the_shipped_animal_is_drawn() {
    let f = Folder::new("autorig");
    f.succeeds(&["sample", "autorig.pcad", "-n", "2", "--size", "64", "--out", "sheet.png"]);
    assert!(f.exists("sheet.png"));
}

#[test]
#[cfg(feature = "contour_detectors")]
fn contour_detectors_are_given_by_edges() {
    let f = folder("detectors");
    f.write("model.yml.gz", forests::gzip(forests::small().yaml().as_bytes()));
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
