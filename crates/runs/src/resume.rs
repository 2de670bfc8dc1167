//! Earlier runs in a folder, and whether their settings are the same.

use crate::failure::{Failure, plain};
use pcadlang_report::{RunDir, RunDirError, evaluation};
use serde_json::{Map, Value};
use std::path::Path;

/// The fields of `run.json` on which draws depend, and their names in messages.
const KEYS: [(&str, &str); 7] = [
    ("version", "version"),
    ("program_hash", "program"),
    ("inputs_hash", "picture, hint, camera or keypoints"),
    ("seed", "seed"),
    ("set", "--set"),
    ("edges", "--edges"),
    ("settings", ""),
];

/// Returns the `run.json` of a folder, or `None` if no run was begun there.
pub fn left(folder: &Path) -> Option<Value> {
    let bytes = std::fs::read(folder.join("run.json")).ok()?;
    let run: Value = serde_json::from_slice(&bytes).unwrap_or_default();
    // Without a program hash, the folder was cleared for another run.
    run.get("program_hash").is_some().then_some(run)
}

/// Returns the program of the run in a folder, if that is another one than `program`, by
/// their file names.
pub fn other_program(folder: &Path, program: &str) -> Option<String> {
    let there = left(folder)?["program"].as_str()?.to_owned();
    (Path::new(&there).file_name() != Path::new(program).file_name()).then_some(there)
}

/// Returns the `run.json` of a folder.
///
/// # Errors
/// If no run was begun there.
pub fn run(folder: &Path) -> Result<Value, Failure> {
    left(folder).ok_or_else(|| {
        let hint = match folder {
            _ if !folder.exists() => "there is no such folder",
            _ if !folder.is_dir() => "it is a file; the folder that it is in may be one of a run",
            _ if folder.join(evaluation::MARK).is_file() => {
                "an evaluation has a run in each folder of a case"
            }
            _ => "`pcadlang run` leaves a run in runs/PROG, or in the folder of --out",
        };
        Failure::Plain(RunDirError::NoRun(folder.to_owned()).to_string(), Some(hint.into()))
    })
}

/// Returns what differs between a `run.json` and the record of a run; empty if both have
/// the same draws.
pub fn differences(there: &Value, record: &Map<String, Value>) -> Vec<String> {
    let mut all = Vec::new();
    for (key, called) in KEYS {
        let now = record.get(key).unwrap_or(&Value::Null);
        match now {
            Value::Object(settings) if key == "settings" => {
                let changed = settings.iter().filter(|(k, now)| there[key][k] != **now);
                all.extend(changed.map(|(k, now)| said(k, &there[key][k], now)));
            }
            // Hashes are not shown, since they mean nothing to people.
            now if there[key] != *now && key.ends_with("hash") => all.push(called.to_owned()),
            now if there[key] != *now => all.push(said(called, &there[key], now)),
            _ => {}
        }
    }
    all
}

/// Opens the folder of a run to resume, which must be of the same command, or makes a new
/// one if no run was begun there. Steps and time may differ from before.
///
/// # Errors
/// If a run with other settings was begun there, or the folder cannot be used.
pub fn resumed(folder: &Path, record: &Map<String, Value>) -> Result<RunDir, Failure> {
    let Some(there) = left(folder) else {
        return RunDir::create(folder).map_err(|e| plain(e.to_string()));
    };
    let mut now = record.clone();
    if let Some(Value::Object(settings)) = now.get_mut("settings") {
        settings.remove("steps");
        settings.remove("time");
    }
    match &differences(&there, &now)[..] {
        [] => RunDir::open(folder).map_err(|e| plain(e.to_string())),
        different => Err(Failure::Plain(
            format!(
                "the run in {} cannot be resumed: it has a different {}",
                folder.display(),
                different.join(", ")
            ),
            Some("repeat the command that began it, or choose another folder with --out".into()),
        )),
    }
}

fn said(what: &str, there: &Value, now: &Value) -> String {
    let text = |v: &Value| match v {
        Value::Null => "none".to_owned(),
        Value::String(s) => s.clone(),
        Value::Object(m) if m.is_empty() => "none".to_owned(),
        v => v.to_string(),
    };
    format!("{what} (was {}, now {})", text(there), text(now))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn differences_are_named() {
        let record = json!({
            "version": "1", "program_hash": "a", "inputs_hash": "b", "seed": 1, "set": { "x": "2", "y": "3" },
            "settings": { "chains": 4, "time": null }, "observe": ["a"],
        });
        let Value::Object(record) = record else { panic!() };
        let mut there = Value::Object(record.clone());
        there["observe"] = json!(["elsewhere"]);
        there["state"] = json!("done");
        there["set"] = json!({ "y": "3", "x": "2" });
        assert_eq!(differences(&there, &record), [""; 0]);
        there["seed"] = json!(2);
        there["settings"]["time"] = json!(3.5);
        there["program_hash"] = json!("c");
        there["set"] = json!({});
        let expected =
            ["program", "seed (was 2, now 1)", r#"--set (was none, now {"x":"2","y":"3"})"#];
        assert_eq!(differences(&there, &record)[..3], expected);
        assert_eq!(differences(&there, &record)[3..], ["time (was 3.5, now none)"]);
        assert_eq!(differences(&json!([]), &record).len(), 6);
    }
}
