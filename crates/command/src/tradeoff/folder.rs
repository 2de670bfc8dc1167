//! The folder of a trade-off: a journal of finished runs, and the table, front and plot
//! made from it.
//!
//! Invariant: every run in the journal is complete; all other files are rebuilt from it.

use pcadlang_report::write_file;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_workbench::tradeoff::RunRecord;
use serde_json::{Map, Value};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The file that marks a folder as that of a trade-off and lists what was run.
const MARK: &str = "tradeoff.json";
/// The journal: one run per line.
const JOURNAL: &str = "runs.jsonl";

/// The folder of a trade-off.
pub struct Folder {
    path: PathBuf,
    journal: Mutex<File>,
    /// The runs of earlier calls.
    pub before: Vec<RunRecord>,
    /// The time of earlier calls, in seconds of the budget.
    pub spent: f64,
}

impl Folder {
    /// Creates a folder, or reopens one if `head`, which describes the measurement, has
    /// not changed.
    pub fn open(path: &Path, head: &Map<String, Value>, fresh: bool) -> Result<Folder, Failure> {
        let fails = |e: std::io::Error| plain(format!("{}: {e}", path.display()));
        std::fs::create_dir_all(path).map_err(fails)?;
        let marked = std::fs::read(path.join(MARK))
            .ok()
            .and_then(|b| serde_json::from_slice::<Value>(&b).ok());
        let journal = path.join(JOURNAL);
        let mut before = Vec::new();
        let mut spent = 0.0;
        match marked {
            None if std::fs::read_dir(path).map_err(fails)?.next().is_some() => {
                return Err(plain(format!(
                    "{} contains other files; choose another folder with --out",
                    path.display()
                )));
            }
            Some(_) if fresh => whole(&journal, &[])?,
            Some(other) => {
                if let Some((key, _)) = head.iter().find(|(k, v)| !agrees(k, v, &other[k.as_str()]))
                {
                    let hint = "choose another folder with --out, or measure everything again with --fresh";
                    let message = format!("{}: {key} has changed", path.display());
                    return Err(Failure::Plain(message, Some(hint.into())));
                }
                let text = std::fs::read_to_string(&journal).unwrap_or_default();
                // A line cut off by an interruption does not parse and is skipped. Failed
                // runs are repeated.
                let runs = text.lines().filter_map(|l| serde_json::from_str(l).ok());
                before = runs.filter(|r: &RunRecord| r.failed.is_none()).collect();
                whole(&journal, &before)?;
                spent = other["seconds"].as_f64().unwrap_or(0.0);
            }
            None => {}
        }
        let journal = File::options().create(true).append(true).open(&journal).map_err(fails)?;
        Ok(Folder { path: path.to_owned(), journal: Mutex::new(journal), before, spent })
    }

    /// Appends a run to the journal.
    pub fn keep(&self, run: &RunRecord) -> Result<(), Failure> {
        let mut journal = self.journal.lock().unwrap_or_else(PoisonError::into_inner);
        let written = journal.write_all(line(run).as_bytes()).and_then(|()| journal.flush());
        written.map_err(|e| plain(format!("{}: {e}", self.path.join(JOURNAL).display())))
    }

    /// Writes a file atomically.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        written(&self.path.join(name), bytes)
    }

    /// Writes `tradeoff.json`: what was run, and the results.
    pub fn mark(&self, head: Map<String, Value>) -> Result<(), Failure> {
        self.write(MARK, &serde_json::to_vec_pretty(&Value::Object(head)).unwrap_or_default())
    }
}

/// Returns whether an entry of the head agrees with the earlier one. Programs may be
/// added, since settings may be.
fn agrees(key: &str, now: &Value, before: &Value) -> bool {
    match (now, before) {
        (Value::Object(now), Value::Object(before)) if key == "programs" => {
            now.iter().all(|(name, hash)| before.get(name).is_none_or(|known| known == hash))
        }
        _ => now == before,
    }
}

fn written(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_file(path, bytes).map_err(|e| plain(format!("{}: {e}", path.display())))
}

/// Replaces the journal by these runs.
fn whole(journal: &Path, runs: &[RunRecord]) -> Result<(), Failure> {
    written(journal, runs.iter().map(line).collect::<String>().as_bytes())
}

fn line(run: &RunRecord) -> String {
    serde_json::to_string(run).unwrap_or_default() + "\n"
}
