//! Follows the README like a newcomer: types its commands in a folder that contains only
//! the pictures that they name, writes and runs its program, and tries the listed
//! commands on the resulting runs.
//!
//! The guide's chapters and the recorded session of docs/reference/prompt.md are replayed
//! by `guide` and `repl`.

use crate::common::folder::Folder;

const README: &str = include_str!("../../README.md");

/// Returns the indented lines of the page that begin with this prefix, without indent and
/// prefix.
fn lines_after<'a>(prefix: &str) -> Vec<&'a str> {
    let typed = README.lines().filter_map(|l| l.strip_prefix("    "));
    typed.filter_map(|l| l.strip_prefix(prefix)).collect()
}

/// Splits a command into words; a time limit is shortened for the test.
fn words(line: &str) -> Vec<&str> {
    let mut cut = false;
    let word = |w| {
        let is_time = std::mem::replace(&mut cut, w == "--time");
        if is_time { "3s" } else { w }
    };
    line.split_whitespace().map(word).collect()
}

#[test]
fn the_commands_run_as_they_are_written() {
    let f = Folder::new("readme");
    for command in lines_after("cargo run --release -- ") {
        let words = words(command);
        // The studio serves until it is ended; `studio` tests it.
        if words.first().is_some_and(|w| *w == "studio") {
            continue;
        }
        let picture = words.iter().find(|w| w.starts_with("examples/")).expect("a picture");
        std::fs::create_dir_all(f.path().join("examples/images")).unwrap();
        let from = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(picture);
        std::fs::copy(from, f.path().join(picture)).unwrap();
        let done = f.succeeds(&words);
        assert!(done.out.contains("r_hat"), "{}", done.out);
    }
    // The files that a run leaves according to the page, and the commands that use them
    // later.
    for part in ["report.html", "chain-1.csv", "inference.zarr", "run.json", "keypoints.json"] {
        assert!(f.path().join("runs/human").join(part).exists(), "{part}: {:?}", f.files());
    }
    let left = std::fs::read_dir(f.path().join("runs/human")).unwrap();
    let names: Vec<String> = left.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    for ending in [".obj", ".glb", "depth.npy", "normals.npy", "mask.png"] {
        assert!(names.iter().any(|n| n.ends_with(ending)), "{ending}: {names:?}");
    }
    for run in ["runs/human", "runs/lathe"] {
        std::fs::remove_file(f.path().join(run).join("report.html")).unwrap();
        f.succeeds(&["report", run]);
        assert!(f.read(&format!("{run}/report.html")).contains("</html>"));
        f.succeeds(&["show", run, "--draw", "3", "-o", "draw.png"]);
        f.succeeds(&["show", run, "-o", "best.glb"]);
    }
    let table = f.succeeds(&["compare", "runs/human", "runs/lathe"]);
    assert!(!table.out.is_empty());
}

#[test]
fn the_first_program_does_what_is_shown() {
    let f = Folder::new("readme-line");
    let start = README.find("    // line.pcad").expect("the page shows line.pcad");
    let text: Vec<&str> = README[start..]
        .lines()
        .map_while(|l| l.strip_prefix("    ").or(l.is_empty().then_some("")))
        .collect();
    f.write("line.pcad", text.join("\n"));
    let done = f.succeeds(&["run", "line.pcad", "--seed", "1"]);
    // Means and intervals are as on the page; times depend on the machine.
    let shown = lines_after("slope ").into_iter().next().expect("the table of the page");
    let said = done.out.lines().find_map(|l| l.strip_prefix("slope ")).expect("a table");
    let numbers = |l: &str| l.split_whitespace().take(4).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(numbers(shown), numbers(said));
    assert!(done.err.contains("infer {"), "the plan that is used is shown: {}", done.err);
    // The prompt resumes the run; docs/reference/prompt.md has commands to type there.
    let prompt = f.succeeds(&["repl", "runs/line"]);
    assert!(prompt.out.contains("log joint"), "{}", prompt.out);
    for command in [
        &["sample", "line.pcad", "-n", "3"][..],
        &["check", "line.pcad"],
        &["fmt", "line.pcad"],
        &["predict", "line.pcad", "--seed", "1", "--out", "checked"],
        &["doc", "observe"],
        &["doc", "--search", "logistic"],
        &["completions", "bash"],
        &["man"],
    ] {
        f.succeeds(command);
    }
}
