//! Runs that are killed, interrupted, or run out of disk space: the files stay readable,
//! and with `--resume` the draws are the same as without interruption.
#![cfg(unix)]

use crate::common::folder::Folder;
use pcadlang_report::{checkpoint, csv};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

const BINARY: &str = env!("CARGO_BIN_EXE_pcadlang");

/// A program with kernels that adapt, sweeps, and choices that appear and vanish.
const PROGRAM: &str = "
    let y = [1.2, -0.4, 3.1, 2.2, 0.3, 4.0, -1.1, 2.7];
    assume m ~ normal(0, 5); assume s ~ half_normal(2); assume c ~ flip(0.5);
    assume shift = if c { d ~ normal(0, 1); d } else { 0 };
    for i in 0 .. 8 { z[i] ~ flip(0.5); observe normal(m + shift + (if z[i] { 2 } else { 0 }), s) = y[i] as y; }
    infer {
        warmup 2000 { drift(@m + @s); mh(one(@**)); }
        repeat 1000000 { mix { 2 => gibbs(each(@z)); 1 => nuts(@m + @s, max_depth = 4); 1 => mh(one(@**)); } drift(@m + @s); collect m, s, shift; }
    }
";

fn run(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(BINARY);
    command.current_dir(folder).args([
        "run",
        "model.pcad",
        "--chains",
        "2",
        "--threads",
        "2",
        "--seed",
        "3",
    ]);
    command.args(["--checkpoint", "10ms", "--out", "out"]).args(more);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn with_program(name: &str) -> Folder {
    let folder = Folder::new(name);
    std::fs::write(folder.path().join("model.pcad"), PROGRAM).unwrap();
    folder
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

fn done(output: &Output) {
    assert!(output.status.success(), "{}", said(output));
}

/// Returns the lines of a chain's draws, without comments, one of which contains the
/// time.
fn draws(folder: &Path, chain: u32) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join(format!("out/chain-{chain}.csv"))).unwrap();
    text.lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect()
}

/// Asserts that the files of a run at any moment are readable, and returns the number of
/// checkpoints.
fn readable(folder: &Path) -> usize {
    let out = folder.join("out");
    let Ok(run) = std::fs::read(out.join("run.json")) else { return 0 };
    serde_json::from_slice::<serde_json::Value>(&run).unwrap();
    let mut checkpoints = 0;
    for file in std::fs::read_dir(&out).unwrap() {
        let path = file.unwrap().path();
        if path.is_dir() {
            continue;
        }
        let bytes = std::fs::read(&path).unwrap();
        match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => drop(csv::read(std::str::from_utf8(&bytes).unwrap()).unwrap()),
            Some("json") => drop(serde_json::from_slice::<serde_json::Value>(&bytes).unwrap()),
            Some("checkpoint") => {
                // The file is complete, although it belongs to another run than the one
                // given here.
                let error = checkpoint::SavedChain::read(&bytes, "").unwrap_err();
                assert!(matches!(error, checkpoint::CheckpointError::Run), "{error}");
                checkpoints += 1;
            }
            _ => {}
        }
    }
    checkpoints
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Kills a run at `kills` moments, resuming it each time, and asserts that the result
/// equals that of the uninterrupted run.
fn killed(name: &str, kills: usize, steps: &str) {
    let whole = with_program(&format!("{name}-whole"));
    done(&run(whole.path(), &["--steps", steps]).output().unwrap());
    let broken = with_program(name);
    let (mut left, mut with_checkpoints, mut pause) = (kills, 0, 7_u64);
    while left > 0 {
        let mut child = run(broken.path(), &["--steps", steps, "--resume"]).spawn().unwrap();
        // Moments without a pattern: the low bits of the high part of a linear
        // congruential generator.
        pause =
            pause.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        std::thread::sleep(Duration::from_millis(pause >> 33 & 127));
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        with_checkpoints += usize::from(readable(broken.path()) > 0);
        if output.status.success() {
            compare(whole.path(), broken.path());
            std::fs::remove_dir_all(broken.path().join("out")).unwrap();
        } else {
            assert_eq!(output.status.code(), None, "{}", said(&output));
            left -= 1;
        }
    }
    assert!(
        with_checkpoints * 2 > kills,
        "only {with_checkpoints} of {kills} kills came after a checkpoint"
    );
    done(&run(broken.path(), &["--steps", steps, "--resume"]).output().unwrap());
    compare(whole.path(), broken.path());
}

fn compare(whole: &Path, broken: &Path) {
    for chain in [1, 2] {
        let (a, b) = (draws(whole, chain), draws(broken, chain));
        assert_eq!(a.len(), b.len(), "chain {chain}");
        assert_eq!(
            a.iter().zip(&b).position(|(a, b)| a != b),
            None,
            "chain {chain}: the first line that differs"
        );
    }
    let summary = |folder: &Path| -> serde_json::Value {
        let mut all: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("out/summary.json")).unwrap())
                .unwrap();
        let object = all.as_object_mut().unwrap();
        for q in object["quantities"].as_object_mut().unwrap().values_mut() {
            q.as_object_mut().unwrap().remove("ess_per_second");
        }
        for k in object["kernels"].as_array_mut().unwrap() {
            k.as_object_mut().unwrap().remove("seconds");
        }
        all
    };
    assert_eq!(summary(whole), summary(broken));
}

#[test]
fn killed_at_a_few_moments() {
    killed("killed", 10, "60000");
}

/// Takes about a minute and a half.
#[test]
#[ignore = "slow"]
fn killed_at_two_hundred_moments() {
    killed("killed-often", 200, "150000");
}

#[test]
fn interrupted_by_a_signal() {
    let whole = with_program("signal-whole");
    done(&run(whole.path(), &["--steps", "30000"]).output().unwrap());
    for name in ["-INT", "-TERM", "-HUP"] {
        let folder = with_program(&format!("signal{name}"));
        let child = run(folder.path(), &["--steps", "30000"]).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(120));
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        let text = said(&output);
        if !output.status.success() {
            assert_eq!(output.status.code(), Some(3), "{text}");
            assert!(
                text.contains("to resume, repeat the command with --resume --out out"),
                "{text}"
            );
            assert_eq!(readable(folder.path()), 2);
        }
        done(&run(folder.path(), &["--steps", "30000", "--resume"]).output().unwrap());
        compare(whole.path(), folder.path());
    }
}

#[test]
fn longer_than_before() {
    let whole = with_program("longer-whole");
    done(&run(whole.path(), &["--steps", "9000"]).output().unwrap());
    let folder = with_program("longer");
    for steps in ["2000", "2001", "9000", "9000"] {
        done(&run(folder.path(), &["--steps", steps, "--resume"]).output().unwrap());
    }
    compare(whole.path(), folder.path());
}

#[test]
fn what_belongs_to_another_run_is_refused() {
    let folder = with_program("another");
    done(&run(folder.path(), &["--steps", "500"]).output().unwrap());
    let before = draws(folder.path(), 1);
    let refused = |more: &[&str], reason: &str| {
        let output = run(folder.path(), more).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        assert!(said(&output).contains(reason), "{}", said(&output));
        assert_eq!(draws(folder.path(), 1), before, "what was there is kept");
    };
    refused(&["--resume", "--warmup", "7"], "it has a different warmup (was none, now 7)");
    let file = folder.path().join("out/chain-2.checkpoint");
    let mut bytes = std::fs::read(&file).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&file, bytes).unwrap();
    refused(&["--resume", "--steps", "600"], "chain-2.checkpoint: the checkpoint is damaged");
    std::fs::write(folder.path().join("model.pcad"), PROGRAM.replace("flip(0.5)", "flip(0.4)"))
        .unwrap();
    refused(&["--resume", "--steps", "600"], "it has a different program");
}

#[test]
fn draws_that_are_gone_are_told() {
    let folder = with_program("gone");
    done(&run(folder.path(), &["--steps", "500"]).output().unwrap());
    let file = folder.path().join("out/chain-1.csv");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, &text[..text.len() / 2]).unwrap();
    let output = run(folder.path(), &["--steps", "600", "--resume"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("chain-1.csv: it has"), "{}", said(&output));
}

/// A limit on file sizes stands in for a full disk: writing fails in the middle of a
/// line.
#[test]
fn a_full_disk() {
    let whole = with_program("full-whole");
    done(&run(whole.path(), &["--steps", "20000"]).output().unwrap());
    let folder = with_program("full");
    let command = run(folder.path(), &["--steps", "20000", "--resume"]);
    let words: Vec<String> = std::iter::once(command.get_program())
        .chain(command.get_args())
        .map(|a| a.to_str().unwrap().to_owned())
        .collect();
    let script = format!("trap '' XFSZ; ulimit -f 64; exec {}", words.join(" "));
    let output =
        Command::new("sh").args(["-c", &script]).current_dir(folder.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("cannot write draws"), "{}", said(&output));
    readable(folder.path());
    done(&run(folder.path(), &["--steps", "20000", "--resume"]).output().unwrap());
    compare(whole.path(), folder.path());
}

#[test]
fn a_vanished_input() {
    let folder = Folder::new("vanished");
    let image = format!("{}/examples/images/coffee_cup.png", env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(image, folder.path().join("cup.png")).unwrap();
    let command = |more: &[&str]| {
        let mut c = Command::new(BINARY);
        c.current_dir(folder.path()).args([
            "run",
            "lathe.pcad",
            "--observe",
            "cup.png",
            "--out",
            "out",
            "--chains",
            "1",
        ]);
        c.args(["--warmup", "4", "--steps", "4"]).args(more).output().unwrap()
    };
    done(&command(&[]));
    std::fs::rename(folder.path().join("cup.png"), folder.path().join("elsewhere.png")).unwrap();
    let output = command(&["--resume"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("cannot read cup.png"), "{}", said(&output));
    assert!(folder.path().join("out/overlay.png").exists(), "what was there is kept");
    std::fs::copy(folder.path().join("out/overlay.png"), folder.path().join("cup.png")).unwrap();
    let output = command(&["--resume"]);
    assert!(
        said(&output).contains("it has a different picture, hint, camera or keypoints"),
        "{}",
        said(&output)
    );
}

/// Returns the largest resident memory of a run with this number of draws, in KiB.
#[cfg(target_os = "linux")]
fn peak(name: &str, draws: u32) -> u64 {
    let folder = Folder::new(name);
    let text = "assume x ~ normal(0, 1); assume c ~ flip(0.5); assume d = if c { e ~ normal(0, 1); e } else { 0 };
                observe normal(x + d, 1) = 1; infer { repeat 10000000 { mh(one(@**)); } }";
    std::fs::write(folder.path().join("model.pcad"), text).unwrap();
    let mut child = run(folder.path(), &["--steps", &(draws / 2).to_string()]).spawn().unwrap();
    let mut peak = 0;
    while child.try_wait().unwrap().is_none() {
        let status =
            std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
        peak = line.and_then(|l| l.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(peak);
        std::thread::sleep(Duration::from_millis(20));
    }
    // The last pass of each chain ends before its draw.
    assert_eq!(draws_in(folder.path()) + 2, draws);
    peak
}

#[cfg(target_os = "linux")]
fn draws_in(folder: &Path) -> u32 {
    (draws(folder, 1).len() + draws(folder, 2).len() - 2) as u32
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "slow"]
fn memory_is_flat() {
    let (some, many) = (peak("flat-some", 250_000), peak("flat-many", 1_000_000));
    println!("largest resident memory: {some} KiB with 250,000 draws, {many} KiB with 1,000,000");
    assert!(many < some + 8 * 1024, "{some} KiB, then {many} KiB");
}
