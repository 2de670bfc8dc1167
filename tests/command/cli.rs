//! Sessions with the command, word for word.
//!
//! `INSTA_UPDATE=always cargo test --release --test command` accepts the current output:
//! read it first as a user would. Snapshots do not contain times: a session that prints
//! some has them replaced.

use crate::common::folder::Folder;
use crate::common::snapshots::assert_session;

fn sessions(name: &str, all: &[&[&str]]) {
    let f = Folder::new(name);
    let text: Vec<String> = all.iter().map(|args| f.session(args)).collect();
    assert!(f.files().is_empty(), "{:?}", f.files());
    assert_session(name, &text.join("\n"));
}

#[test]
fn check_of_every_shipped_program() {
    let all: Vec<Vec<&str>> =
        pcadlang_library::shipped::programs().map(|p| vec!["check", p]).collect();
    sessions("check", &all.iter().map(Vec::as_slice).collect::<Vec<_>>());
}

#[test]
fn check_of_mistakes() {
    let f = Folder::new("check_mistakes");
    f.write(
        "good.pcad",
        "param n: int = 3 \"how many\"; assume x ~ normal(0, n); observe normal(x, 1) = 2;",
    );
    f.write("bad.pcad", "assume x ~ nomal(0, 1);\nobserve normal(y, 1) = 2;\n");
    f.write("worse.pcad", "assume x = ;\nlet 3 = 4;\n");
    let text: Vec<String> =
        [&["check", "good.pcad", "bad.pcad", "worse.pcad"][..], &["check", "coin.pcat"]]
            .iter()
            .map(|a| f.session(a))
            .collect();
    assert_session("check_mistakes", &text.join("\n"));
}

#[test]
fn doc() {
    sessions(
        "doc",
        &[
            &["doc", "normal"],
            &["doc", "scene.lathe"],
            &["doc", "lathe"],
            &["doc", "pi"],
            &["doc", "mh"],
            &["doc", "nothing"],
            &["doc", "nomal"],
            &["doc", ""],
            &["doc", "--search", "mean", "direction"],
            &["doc", "--search", "gaussian", "random", "walk"],
            &["doc", "--search", "chamfr"],
            &["doc", "--search", "qqqqqq"],
        ],
    );
    let f = Folder::new("doc_all");
    let all = f.succeeds(&["doc"]).out;
    assert!(
        all.contains("**`normal(") && all.contains("## Constants") && all.lines().count() > 100
    );
}

#[test]
fn help() {
    let all: [&[&str]; 15] = [
        &["--help"],
        &["run", "--help"],
        &["evaluate", "--help"],
        &["sample", "--help"],
        &["learn", "--help"],
        &["check", "--help"],
        &["predict", "--help"],
        &["contours", "--help"],
        &["detect", "--help"],
        &["doc", "--help"],
        &["repl", "--help"],
        &["fmt", "--help"],
        &["completions", "--help"],
        &["man", "--help"],
        &["--version"],
    ];
    sessions("help", &all);
}

#[test]
fn programs_are_formatted_in_place() {
    let f = Folder::new("fmt");
    std::fs::create_dir(f.path().join("more")).unwrap();
    f.write("ugly.pcad", "let  a=1 ; // one\n")
        .write("good.pcad", "let a = 1;\n")
        .write("more/deep.pcad", "f( 1,2 );");
    f.write("bad.pcad", "let a = ;\n").write("notes.txt", "let  a=1 ;");
    let said: Vec<String> = [
        &["fmt", "--check", "."][..],
        &["fmt", "--check", "good.pcad"],
        &["fmt", "."],
        &["fmt", "ugly.pcad", "good.pcad", "more"],
        &["fmt", "--check", "more", "none.pcad"],
        &["fmt"],
    ]
    .iter()
    .map(|args| f.session(args))
    .collect();
    assert_session("fmt", &said.join("\n"));
    assert_eq!(f.read("ugly.pcad"), "let a = 1; // one\n");
    assert_eq!(f.read("more/deep.pcad"), "f(1, 2);\n");
    assert_eq!(
        (f.read("bad.pcad"), f.read("notes.txt")),
        ("let a = ;\n".into(), "let  a=1 ;".into())
    );
    assert_eq!(
        f.files(),
        ["bad.pcad", "good.pcad", "more/", "more/deep.pcad", "notes.txt", "ugly.pcad"]
    );
}

#[test]
fn standard_input_is_formatted() {
    let fmt = |text: &str, args: &[&str]| {
        let mut command = assert_cmd::Command::cargo_bin("pcadlang").unwrap();
        command.args(["fmt", "--stdin"]).args(args).write_stdin(text).output().unwrap()
    };
    assert_eq!(fmt("let  a=1 ;", &[]).stdout, b"let a = 1;\n");
    assert_eq!(fmt("let a = 1;\n", &["--check"]).status.code(), Some(0));
    assert_eq!(fmt("let  a=1 ;", &["--check"]).status.code(), Some(1));
    let bad = fmt("let a = ;", &[]);
    assert!(bad.status.code() == Some(1) && bad.stdout.is_empty());
    assert!(
        String::from_utf8_lossy(&bad.stderr).contains("<stdin>:1:9"),
        "{}",
        String::from_utf8_lossy(&bad.stderr)
    );
}

/// A watched program is checked again when an included file changes, until the user ends
/// it.
#[cfg(unix)]
#[test]
fn watched_programs_are_checked_again() {
    use std::process::{Command, Stdio};
    use std::time::Duration;
    let f = Folder::new("watch");
    f.write("main.pcad", "include \"part.pcad\"; assume x ~ normal(width, 1);")
        .write("part.pcad", "let with = 1;");
    let out = std::fs::File::create(f.path().join("out")).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_pcadlang"))
        .args(["check", "--watch", "main.pcad"])
        .current_dir(f.path())
        .stdout(out)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let comes = |text: &str| {
        (0..300).any(|_| {
            std::thread::sleep(Duration::from_millis(100));
            f.read("out").contains(text)
        })
    };
    assert!(
        comes("Watching 2 files") && !f.read("out").contains("no mistakes"),
        "{}",
        f.read("out")
    );
    f.write("part.pcad", "let width = 1;");
    assert!(comes("main.pcad: no mistakes found"), "{}", f.read("out"));
    assert!(f.read("out").contains("Changed: part.pcad"));
    assert!(
        Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success()
    );
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let f = Folder::new("manual");
    let help = f.succeeds(&["--help"]).out;
    let commands = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty());
    let commands: Vec<&str> = commands
        .filter_map(|line| line.split_whitespace().next())
        .filter(|c| *c != "help")
        .collect();
    assert!(
        commands.contains(&"run") && commands.contains(&"fmt") && commands.len() > 10,
        "{commands:?}"
    );
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = f.succeeds(&["completions", shell]).out;
        assert!(
            commands.iter().all(|c| script.contains(c)) && script.contains("observe"),
            "{shell}:\n{script}"
        );
    }
    // Program arguments are completed with file names.
    let zsh = f.succeeds(&["completions", "zsh"]).out;
    assert!(
        zsh.lines().any(|line| line.contains(":program -- ") && line.contains(":_files")),
        "{zsh}"
    );
    let page = f.succeeds(&["man"]).out;
    assert!(
        page.contains(".TH pcadlang 1")
            && commands.iter().all(|c| page.contains(&format!("pcadlang\\-{c}(1)"))),
        "{page}"
    );
    f.succeeds(&["man", "--out", "pages"]);
    for command in &commands {
        let page = f.read(&format!("pages/pcadlang-{command}.1"));
        assert!(
            page.contains(&format!(".TH pcadlang-{command} 1"))
                && page.contains(".SH SYNOPSIS")
                && page.contains("pcadlang 0."),
            "{page}"
        );
        assert!(
            page.contains(&format!("pcadlang {command}")),
            "the synopsis says how it is called: {page}"
        );
    }
    assert_eq!(f.files().len(), commands.len() + 2, "{:?}", f.files());
}

/// Checks plans on data simulated from their programs: exit code 0 if they pass, 1 if
/// they fail or if the data cannot be simulated.
#[test]
fn checks_by_simulation() {
    let f = Folder::new("simulation");
    let args = ["--replicates", "20", "--steps", "200", "--seed", "3", "--threads", "2"];
    let both = f.succeeds(&[&["check", "--sbc", "--geweke", "coin.pcad"][..], &args].concat());
    for says in [
        "coin.pcad: simulation-based calibration",
        "coin.pcad: Geweke's joint",
        "@heads",
        "log joint",
        "seed 3",
    ] {
        assert!(both.out.contains(says), "{says:?} is not in\n{}", both.out);
    }
    assert!(both.err.contains("this takes about "), "{}", both.err);
    // A plan that never moves keeps the prior, which is wrong whenever the data are
    // informative.
    f.write(
        "stuck.pcad",
        "assume x ~ normal(0, 1); observe normal(x, 0.1) = [1, 1, 1] as y;
         infer { repeat 100 { drift(@x, 1000000); collect x; } }",
    );
    let d = f.run(&[
        "check",
        "--sbc",
        "stuck.pcad",
        "--replicates",
        "60",
        "--steps",
        "100",
        "--seed",
        "3",
    ]);
    assert!(
        d.code == 1 && d.out.contains("FAILS") && d.err.contains("1 of 1 programs fail"),
        "{}{}",
        d.out,
        d.err
    );
    f.write("soft.pcad", "assume x ~ normal(0, 1); factor(-x * x) as soft;");
    let soft = f.run(&["check", "--geweke", "soft.pcad"]);
    assert!(
        soft.code == 1 && soft.err.contains("@soft is a factor, which has no sampler"),
        "{}",
        soft.err
    );
    assert_eq!(f.files(), ["soft.pcad", "stuck.pcad"]);
}

/// Posterior predictive checks: the table, the file, and the same draws on any number of
/// threads.
#[test]
fn predictive_checks() {
    let f = Folder::new("predictive");
    let args = ["predict", "linreg.pcad", "--steps", "300", "--seed", "2", "--out"];
    let one = f.succeeds(&[&args[..], &["a", "--threads", "1"]].concat());
    f.succeeds(&[&args[..], &["b", "--threads", "2"]].concat());
    assert_eq!(f.read("a/predictive.csv"), f.read("b/predictive.csv"));
    assert!(
        one.out.contains("@y")
            && one.out.contains("tail")
            && one.out.contains("from the posterior"),
        "{}",
        one.out
    );
    let csv = f.read("a/predictive.csv");
    let mut lines = csv.lines();
    let head = lines.next().unwrap();
    assert!(head.starts_with("chain,draw,@y.mean,@y.sd,@y.min,@y.max,@y[0],"), "{head}");
    assert!(lines.all(|l| l.split(',').count() == head.split(',').count()));
    let prior = f.succeeds(&["predict", "linreg.pcad", "--prior", "-n", "50", "--out", "c"]);
    assert!(
        prior.out.contains("50 draws from the prior")
            && f.read("c/predictive.csv").lines().count() == 51
    );
    f.write("soft.pcad", "assume x ~ normal(0, 1); factor(-x * x) as soft;");
    let soft = f.run(&["predict", "soft.pcad", "--prior"]);
    assert!(
        soft.code == 1 && soft.err.contains("none of the program's observations has a sampler"),
        "{}",
        soft.err
    );
}

/// Exit code 2 is for errors in the command line itself.
#[test]
fn usage() {
    sessions(
        "usage",
        &[
            &[],
            &["rum"],
            &["completions", "tcsh"],
            &["run"],
            &["check"],
            &["run", "coin.pcad", "--step", "3"],
            &["run", "coin.pcad", "--chains", "0"],
            &["run", "coin.pcad", "--chains", "many"],
            &["run", "coin.pcad", "--set", "a"],
            &["run", "coin.pcad", "--time", "soon"],
            &["run", "coin.pcad", "--seed", "-1"],
            &["sample", "coin.pcad", "-n", "0"],
            &["contours", "x.png", "--size", "3"],
        ],
    );
}

const CAMERAS_TXT: &str = "# Camera list
1 OPENCV 640 480 520.5 518.75 321.75 240 -0.28 0.09 0.0012 -0.0007
2 SIMPLE_PINHOLE 640 480 500 320 240
3 OPENCV_FISHEYE 640 480 500 500 320 240 0.1 0 0 0
";

/// Pictures before, behind and at the origin; the last one is by a fisheye.
const IMAGES_TXT: &str = "# Image list
1 0.610243744639777 0.7625216441014687 -0.049258217842845925 -0.20913379062160758 0.1 -0.2 4 1 left/a.jpg

2 1 0 0 0 0 0 -3 2 right/b.jpg

3 1 0 0 0 0 0 4 3 right/c.jpg

";

#[test]
fn cameras() {
    let f = Folder::new("camera_files");
    f.write("cameras.txt", CAMERAS_TXT).write("images.txt", IMAGES_TXT);
    f.write(
        "lens.json",
        "{\"fx\": 600, \"fy\": 600, \"cx\": 319.5, \"cy\": 239.5, \"width\": 640, \"height\": 480}",
    );
    f.write("own.json", "{\"model\": \"pinhole\", \"focal\": 3}");
    let all: [&[&str]; 8] = [
        &["camera", "cameras.txt#a.jpg"],
        &["camera", "images.txt", "--picture", "right/b.jpg", "--out", "axes.png"],
        &["camera", "cameras.txt"],
        &["camera", "cameras.txt#c.jpg"],
        &["camera", "lens.json"],
        &["camera", "lens.json, at = \"file\", up = \"-y\""],
        &["camera", "lens.json, at = \"here\""],
        &["camera", "own.json"],
    ];
    let text: Vec<String> = all.iter().map(|args| f.session(args)).collect();
    assert_session("camera", &text.join("\n"));
    assert!(f.files().contains(&"axes.png".to_owned()));
}

/// A constant of another crate's bytes had one of them twice, 7.5 MB.
#[test]
fn the_program_has_each_network_once() {
    let program = std::fs::read(env!("CARGO_BIN_EXE_pcadlang")).unwrap();
    for name in [
        "nanodet/nanodet.bin",
        "detectors/pose_detection.tflite",
        "detectors/pose_landmark_full.tflite",
    ] {
        let network = std::fs::read(format!("crates/{name}")).unwrap();
        let part = &network[network.len() / 2..][..64];
        assert_eq!(program.windows(64).filter(|w| *w == part).count(), 1, "{name}");
    }
}
