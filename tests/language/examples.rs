//! The example of every built-in runs: expressions have the value stated beside them, and
//! programs can be simulated and scored, and their plans run.

use crate::common::folder::{Folder, disc, png};
use pcadlang::{Model, Program, RunOptions};
use pcadlang_engine::lang::builtins::examples::INCLUDE;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Draws;
use pcadlang_library::standard;
use pcadlang_syntax::format;
use pcadlang_workbench::session::as_view;

/// Writes the files that examples read.
fn files() -> Folder {
    let f = Folder::new("examples");
    let ball = png(disc(64, 64, 32.0, 32.0, 15.0));
    f.write("ball.png", &ball).write("mask.png", &ball);
    f.write("depth.npy", pcadlang_scene::vision::npy::f32_array(&[32, 32], [7.0; 32 * 32]));
    f.write(
        "transforms.json",
        r#"{ "camera_angle_x": 0.7, "w": 64, "h": 64, "frames": [{ "file_path": "./ball", "transform_matrix":
            [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 6], [0, 0, 0, 1]] }] }"#,
    );
    f.write("person.json", include_str!("../../examples/images/skier.keypoints.json"));
    f.succeeds(&["contours", "ball.png", "-o", "contours.png"]);
    // Shipped files are found by their names from the current folder alone, which tests of
    // one program share.
    for folder in ["data", "std/human"] {
        std::fs::create_dir_all(f.path().join(folder)).unwrap();
    }
    for name in SHIPPED {
        f.write(name, pcadlang_library::shipped::file(name).unwrap());
    }
    f
}

/// What crates apart do, whose own tests run its examples.
const APART: [&str; 2] = ["detector", "scene.autorig"];

/// The shipped files that examples read.
const SHIPPED: [&str; 6] = [
    "data/line.csv",
    "data/dog.obj",
    "std/human/pose_prior.json",
    "std/human/human.lod2.obj",
    "std/human/human.lod2.rig.json",
    "std/human/human.lod2.morphs.json",
];

/// Splits an example into an expression and its stated value; `None` if it is a program.
fn expression(example: &str) -> Option<(&str, &str)> {
    let (expression, value) = example.split_once("//").unwrap_or((example, "nothing said"));
    (!expression.contains(';')).then_some((expression.trim(), value.trim()))
}

/// Adds the scene module to a program that needs it.
fn whole(text: &str) -> String {
    if text.contains("scene.") { format!("{INCLUDE}\n{text}\n") } else { format!("{text}\n") }
}

fn compiled(f: &Folder, text: &str) -> Result<Model, String> {
    let path = f.write("example.pcad", whole(text)).path().join("example.pcad");
    Program::open(path.to_str().unwrap()).and_then(Program::compile).map_err(|e| e.to_string())
}

/// Returns the names that a program defines at its top level.
fn names(text: &str) -> impl Iterator<Item = &str> {
    let named =
        text.lines().filter_map(|line| line.strip_prefix("let ").or(line.strip_prefix("assume ")));
    named.filter_map(|rest| rest.split_whitespace().next())
}

/// Checks that a value is not empty, and that a shape or view is visible.
fn is_seen(value: &Value) -> Result<(), String> {
    match as_view(value, None) {
        Some(view) if view.contours(64).is_empty() => Err("nothing of it is seen".into()),
        _ if matches!(value, Value::Unit) => Err("it is nothing".into()),
        _ => Ok(()),
    }
}

/// Checks that an expression has the stated value.
fn evaluates(f: &Folder, text: &str, value: &str) -> Result<(), String> {
    let mut trace =
        compiled(f, &format!("let shown = {text};"))?.simulate(1, 0).map_err(|e| e.to_string())?;
    let shown = trace
        .global("shown", Draws::default())
        .ok_or("it has no value")?
        .map_err(|e| format!("{e:?}"))?;
    if shown.to_string() == value { is_seen(&shown) } else { Err(format!("{text} // {shown}")) }
}

/// Checks that a program can be simulated and scored, that its names have values, and
/// that its plan records draws.
fn runs(f: &Folder, text: &str) -> Result<(), String> {
    let model = compiled(f, text)?;
    let mut trace = model.simulate(1, 0).map_err(|e| e.to_string())?;
    if !trace.log_joint().is_finite() {
        return Err(format!("its score is {}", trace.log_joint()));
    }
    for name in names(text) {
        let value =
            trace.global(name, Draws::default()).ok_or_else(|| format!("there is no {name}"))?;
        is_seen(&value.map_err(|e| format!("{name}: {e:?}"))?)
            .map_err(|e| format!("{name}: {e}"))?;
    }
    if !text.contains("infer ") {
        return Ok(());
    }
    let options = RunOptions { seed: 1, ..RunOptions::default() };
    let drawn = model.run(&options, 1, 1).map_err(|e| e.to_string())?.quantities();
    let draws = drawn.iter().flat_map(|q| q.chains.iter().map(Vec::len)).min();
    if draws >= Some(10) { Ok(()) } else { Err(format!("it makes {draws:?} draws")) }
}

/// A bank belongs to one program, and is passed to the command.
fn runs_with_a_bank(f: &Folder, text: &str) {
    f.write("knn.pcad", whole(text));
    f.succeeds(&[
        "learn",
        "knn.pcad",
        "-n",
        "20",
        "--features-size",
        "32",
        "-o",
        "balls.bank",
        "--quiet",
    ]);
    f.succeeds(&["run", "knn.pcad", "--chains", "1", "--out", "knn", "--quiet"]);
    assert!(f.read("knn/chain-1.csv").lines().count() > 50);
}

#[test]
fn every_example_runs() {
    let f = files();
    let mut wrong = Vec::new();
    let (mut expressions, mut programs) = (0, 0);
    for b in standard::table().iter() {
        let name = b.full_name();
        let done = match b.example.as_deref().map(|example| (example, expression(example))) {
            None => Err("it has no example".to_owned()),
            Some((example, _))
                if b.name.starts_with(char::is_alphabetic)
                    && b.name != "neg"
                    && !example.contains(&name) =>
            {
                Err("its example does not use it".to_owned())
            }
            Some((_, Some((text, value)))) => {
                expressions += 1;
                evaluates(&f, text, value)
            }
            Some(_) if APART.contains(&&*name) => Ok(()),
            Some((example, None)) => {
                programs += 1;
                if b.name == "knn" {
                    runs_with_a_bank(&f, example);
                }
                if b.name == "knn" { Ok(()) } else { runs(&f, example) }
            }
        };
        wrong.extend(done.err().map(|why| format!("{name}: {why}")));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(expressions > 80 && programs > 70, "{expressions} {programs}");
}

#[test]
fn examples_are_written_as_the_formatter_writes_them() {
    let mut wrong = Vec::new();
    for b in standard::table().iter() {
        let Some(example) = b.example.as_deref() else { continue };
        let text = match expression(example) {
            Some((expression, value)) => format!("{expression}; // {value}\n"),
            None => format!("{example}\n"),
        };
        if format(&text).as_ref() != Ok(&text) {
            wrong.push(text);
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}
