//! What an earlier run left in a folder, and whether it is of the same settings.

use super::{Failure, plain};
use pcadlang::report::{RunDir, RunDirError, evaluation};
use serde_json::{Map, Value};
use std::path::Path;

/// What must be the same for draws to be the same, and how it is called.
const KEYS: [(&str, &str); 7] = [
    ("version", "version"),
    ("program_hash", "program"),
    ("inputs_hash", "picture, camera or keypoints"),
    ("seed", "seed"),
    ("set", "--set"),
    ("edges", "--edges"),
    ("settings", ""),
];

/// The `run.json` of a folder, if a run was begun there.
pub fn left(folder: &Path) -> Option<Value> {
    let bytes = std::fs::read(folder.join("run.json")).ok()?;
    let run: Value = serde_json::from_slice(&bytes).unwrap_or_default();
    // Without a program, it was cleared away for the next one.
    run.get("program_hash").is_some().then_some(run)
}

/// The `run.json` of a folder.
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

/// What is another there than in the record of a run; empty if its draws are the same.
pub fn differences(there: &Value, record: &Map<String, Value>) -> Vec<String> {
    let mut all = Vec::new();
    for (key, called) in KEYS {
        let now = record.get(key).unwrap_or(&Value::Null);
        match now {
            Value::Object(settings) if key == "settings" => {
                let changed = settings.iter().filter(|(k, now)| there[key][k] != **now);
                all.extend(changed.map(|(k, now)| said(k, &there[key][k], now)));
            }
            // Hashes say nothing to people.
            now if there[key] != *now && key.ends_with("hash") => all.push(called.to_owned()),
            now if there[key] != *now => all.push(said(called, &there[key], now)),
            _ => {}
        }
    }
    all
}

/// The folder of a run to go on with: that of the same command, or a new one where there
/// is none yet. How long it runs may be another than before.
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
