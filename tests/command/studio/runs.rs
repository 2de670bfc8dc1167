//! Runs under the studio: paused, stopped, resumed, many at once, and after a crash.

use super::client::Studio;
use crate::common::folder::{disc, png};
use crate::report::{DISC, PLACED};
use assert_cmd::Command;
use serde_json::json;
use std::time::Duration;

/// A program that takes some seconds.
const SLOW: &str = "assume x ~ normal(0, 1); observe normal(x, 1) = 2;
infer { warmup 100 { mh(@x); } repeat 100000000 { mh(@x); collect x; } }";

fn draws(folder: &std::path::Path) -> String {
    let text = std::fs::read_to_string(folder.join("chain-1.csv")).unwrap();
    text.lines().filter(|l| !l.starts_with('#')).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_run_is_that_of_the_command() {
    let s = Studio::new(&[]);
    let mut page = s.page();
    let id = page.ask("open", json!({ "program": "linreg.pcad" }))["session"].clone();
    let settings = json!({ "steps": 400, "chains": 2, "seed": 7 });
    let run = page.ask("run", json!({ "session": id, "settings": settings }));
    assert_eq!((&run["run"], &run["program"]), (&json!("runs/linreg"), &json!("linreg.pcad")));
    let done = page.wait("runs/linreg", &["done", "failed"]);
    assert_eq!(done["state"], "done", "{done}");
    let other = s.folder.join("other");
    let said = Command::new(env!("CARGO_BIN_EXE_pcadlang"))
        .args([
            "run",
            "linreg.pcad",
            "--steps",
            "400",
            "--chains",
            "2",
            "--seed",
            "7",
            "--quiet",
            "--out",
        ])
        .arg(&other)
        .current_dir(&s.folder)
        .assert();
    said.success();
    assert_eq!(draws(&s.folder.join("runs/linreg")), draws(&other), "the same draws");

    let summary = page.ask("summary", json!({ "run": "runs/linreg" }));
    assert!(summary["quantities"]["slope"]["mean"].as_f64().is_some());
    assert!(summary["command"].as_str().unwrap().starts_with("pcadlang run linreg.pcad"));
    let q = page.ask("quantity", json!({ "run": "runs/linreg", "names": ["slope", "log_joint"] }));
    assert_eq!(q["quantities"][0]["chains"].as_array().unwrap().len(), 2);
    let kept = page.ask("draws", json!({ "run": "runs/linreg" }));
    assert!(
        kept["draws"].as_array().unwrap().len() > 10 && kept["film"].as_array().unwrap().len() > 10
    );
    let state = json!({ "run": "runs/linreg", "draw": 3 });
    let choices = page.ask("choices", json!({ "state": state }));
    assert_eq!(choices["log_joint"], kept["draws"][3]["log_joint"]);
    assert_eq!(choices["choices"][0]["address"], "@intercept");
    // It is compared with the command's own run, in another folder.
    let both = page.ask("compare", json!({ "a": "runs/linreg", "b": "other" }));
    assert_eq!((&both["same_program"], &both["same_data"]), (&json!(true), &json!(true)));
    assert!(both["quantities"].as_array().unwrap().iter().all(|q| q["apart"] == 0.0));
    assert!(
        page.refused("picture", json!({ "state": state, "layer": "depth", "size": 64 }))
            .contains("no view")
    );
    let file = page.ask("export", json!({ "run": "runs/linreg", "kind": "report.html" }));
    assert_eq!(file["file"], "runs/linreg/report.html");
    assert!(page.events.iter().any(|e| e["event"] == "run" && e["run"]["run"] == "runs/linreg"));
}

#[test]
fn a_run_is_paused_stopped_and_goes_on() {
    let s = Studio::new(&[]);
    std::fs::write(s.folder.join("slow.pcad"), SLOW).unwrap();
    let mut page = s.page();
    let id = page.ask("open", json!({ "program": "slow.pcad" }))["session"].clone();
    page.ask("run", json!({ "session": id, "settings": { "chains": 1 } }));
    page.wait("runs/slow", &["running"]);
    let steps = |page: &mut super::client::Page| {
        page.wait("runs/slow", &["running", "paused"])["steps"].as_u64().unwrap()
    };
    while steps(&mut page) < 1000 {}
    assert_eq!(page.ask("pause", json!({ "run": "runs/slow" }))["state"], "paused");
    std::thread::sleep(Duration::from_millis(100));
    let before = steps(&mut page);
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(steps(&mut page), before, "the chains wait");
    assert_eq!(page.ask("go_on", json!({ "run": "runs/slow" }))["state"], "running");
    while steps(&mut page) <= before {}
    assert!(page.refused("remove", json!({ "run": "runs/slow" })).contains("not ended"));
    // Stopped in a pause, too.
    page.ask("pause", json!({ "run": "runs/slow" }));
    page.ask("stop", json!({ "run": "runs/slow" }));
    let stopped = page.wait("runs/slow", &["stopped"]);
    assert!(page.refused("stop", json!({ "run": "runs/slow" })).contains("has ended"));
    // A closed page does not end a run.
    page.ask("go_on", json!({ "run": "runs/slow" }));
    drop(page);
    std::thread::sleep(Duration::from_millis(500));
    let mut page = s.page();
    let now = page.wait("runs/slow", &["running"]);
    assert!(now["elapsed"].as_f64() >= stopped["elapsed"].as_f64());
    page.ask("stop", json!({ "run": "runs/slow" }));
    let more = page.wait("runs/slow", &["stopped"]);
    assert!(more["draws"].as_u64() > stopped["draws"].as_u64(), "{more} {stopped}");
    page.ask("remove", json!({ "run": "runs/slow" }));
}

/// A paused run says whether the object was found, and an ended one says what its record does.
#[test]
fn a_run_says_whether_it_found_the_object() {
    let s = Studio::new(&[]);
    std::fs::write(s.folder.join("placed.pcad"), PLACED).unwrap();
    std::fs::write(s.folder.join("disc.png"), png(disc(160, 120, 84.0, 60.0, 20.0))).unwrap();
    let mut page = s.page();
    let opened = page.ask("open", json!({ "program": "placed.pcad", "observe": ["disc.png"] }));
    let id = &opened["session"];
    page.ask("hint", json!({ "session": id, "hint": { "outline": DISC } }));
    let settings = json!({ "chains": 2, "steps": 100_000_000 });
    let begun = page.ask("run", json!({ "session": id, "settings": settings }));
    assert_eq!(begun["found"], json!(null));
    while page.wait("runs/placed", &["running"])["draws"].as_u64() < Some(20) {}
    let is_found = |run: &serde_json::Value| {
        let said = run["found"].as_str().unwrap_or_default();
        said.starts_with("found: the object covers 9") && said.contains("chains agree on")
    };
    let paused = page.ask("pause", json!({ "run": "runs/placed" }));
    assert!(is_found(&paused), "{paused}");
    assert_eq!(page.wait("runs/placed", &["paused"])["found"], paused["found"]);
    assert_eq!(page.ask("go_on", json!({ "run": "runs/placed" }))["found"], json!(null));
    page.ask("stop", json!({ "run": "runs/placed" }));
    let ended = page.wait("runs/placed", &["stopped"]);
    let record = std::fs::read(s.folder.join("runs/placed/run.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    assert!(is_found(&ended) && ended["found"] == record["found"]["text"], "{ended}");
}

#[test]
fn a_killed_server_leaves_what_resume_needs() {
    let s = Studio::new(&[]);
    std::fs::write(s.folder.join("slow.pcad"), SLOW).unwrap();
    let mut page = s.page();
    let id = page.ask("open", json!({ "program": "slow.pcad" }))["session"].clone();
    page.ask("run", json!({ "session": id, "settings": { "chains": 1, "time": 60 } }));
    // The first checkpoint comes after ten seconds.
    let checkpoint = s.folder.join("runs/slow/chain-1.checkpoint");
    for _ in 0..300 {
        if checkpoint.exists() {
            break;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    assert!(checkpoint.exists());
    let folder = s.kill();

    let s = Studio::within(folder, &[]);
    let mut page = s.page();
    let left = page.wait("runs/slow", &["interrupted"]);
    assert_eq!(left["program"], "slow.pcad");
    page.ask("go_on", json!({ "run": "runs/slow" }));
    let went_on = page.wait("runs/slow", &["running"]);
    assert_eq!(went_on["error"], json!(null));
    page.ask("stop", json!({ "run": "runs/slow" }));
    page.wait("runs/slow", &["stopped"]);
    let run: serde_json::Value =
        serde_json::from_slice(&std::fs::read(s.folder.join("runs/slow/run.json")).unwrap())
            .unwrap();
    assert!(run["chains"][0]["draws"].as_u64().unwrap() > 10_000, "{run}");
}

#[test]
fn twenty_runs_at_once_from_ten_pages() {
    let s = Studio::new(&["--jobs", "20"]);
    let mut pages: Vec<_> = (0..10).map(|_| s.page()).collect();
    let mut names = Vec::new();
    for (i, page) in pages.iter_mut().enumerate() {
        let id = page.ask("open", json!({ "program": "coin.pcad" }))["session"].clone();
        for k in 0..2 {
            let settings = json!({ "time": 2, "chains": 2, "seed": 2 * i + k });
            let run = page.ask("run", json!({ "session": id, "settings": settings }));
            names.push(run["run"].as_str().unwrap().to_owned());
        }
    }
    names.sort();
    names.dedup();
    assert_eq!(names.len(), 20, "each has a folder of its own");
    // Half of the pages leave; their runs go on.
    pages.truncate(5);
    let mut page = s.page();
    for name in &names {
        let done = page.wait(name, &["done", "failed"]);
        assert_eq!((&done["state"], &done["error"]), (&json!("done"), &json!(null)), "{name}");
        assert!(done["draws"].as_u64().unwrap() > 0);
        assert!(s.folder.join(name).join("summary.json").is_file());
    }
    #[cfg(target_os = "linux")]
    {
        let memory = s.memory();
        eprintln!("after twenty runs the server holds {memory} MiB");
        assert!(memory < 1500, "{memory} MiB");
    }
    for page in &mut pages {
        page.ask("folder", json!({}));
    }
}

#[test]
fn runs_beyond_the_places_wait_in_turn() {
    let s = Studio::new(&["--jobs", "1"]);
    std::fs::write(s.folder.join("slow.pcad"), SLOW).unwrap();
    let mut page = s.page();
    let id = page.ask("open", json!({ "program": "slow.pcad" }))["session"].clone();
    let begin = json!({ "session": id, "settings": { "chains": 1 } });
    page.ask("run", begin.clone());
    page.wait("runs/slow", &["running"]);
    page.ask("run", begin.clone());
    page.ask("run", begin);
    page.wait("runs/slow-2", &["waiting"]);
    // One that waits is stopped at once, and can begin later.
    page.ask("stop", json!({ "run": "runs/slow-2" }));
    page.wait("runs/slow-2", &["stopped"]);
    page.ask("stop", json!({ "run": "runs/slow" }));
    page.wait("runs/slow-3", &["running"]);
    page.ask("stop", json!({ "run": "runs/slow-3" }));
    page.wait("runs/slow-3", &["stopped"]);
    page.ask("go_on", json!({ "run": "runs/slow-2" }));
    page.wait("runs/slow-2", &["running"]);
    page.ask("stop", json!({ "run": "runs/slow-2" }));
    page.wait("runs/slow-2", &["stopped"]);
}

#[test]
fn a_program_that_fails_fails_alone() {
    let s = Studio::new(&[]);
    // It compiles and starts, and fails where the chain goes.
    let text =
        "assume x ~ normal(0, 1); let y = if x > 0 { [1][2] } else { 0 }; observe normal(y, 1) = 0;
                infer { repeat 100000 { mh(@x); collect x; } }";
    std::fs::write(s.folder.join("bad.pcad"), text).unwrap();
    std::fs::write(
        s.folder.join("loop.pcad"),
        "fn f(n) { f(n + 1) } let x = f(0); assume z ~ normal(x, 1);",
    )
    .unwrap();
    let mut page = s.page();
    let said = page.refused("open", json!({ "program": "loop.pcad" }));
    assert!(said.contains("deep") || said.contains("limit"), "{said}");
    let opened = page.answer("open", json!({ "program": "bad.pcad" }));
    if let Some(id) = opened["result"].get("session") {
        page.ask("run", json!({ "session": id, "settings": { "chains": 1 } }));
        let failed = page.wait("runs/bad", &["failed"]);
        assert!(failed["error"].as_str().unwrap().contains("no element"), "{failed}");
    }
    page.ask("open", json!({ "program": "coin.pcad" }));
}
