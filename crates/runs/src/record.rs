//! `run.json`: what a run was asked to do, in what state it is, and what came of it.

use crate::args::Job;
use crate::failure::Failure;
use crate::files::write_in;
use crate::reopening::reopened::{self, arguments};
use crate::{files, inputs};
use pcadlang_inference::{BestState, ChainResult};
use pcadlang_library::Model;
use pcadlang_report::{Quantity, RunDir, bytes_hash, text_hash};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Hashes the files named on the command line, and those that the program reads itself.
///
/// # Errors
/// If a file no longer exists.
pub fn inputs_hash(job: &Job, model: &Model) -> Result<String, Failure> {
    let mut all = model.data_hash().to_owned();
    let named = job
        .observe
        .iter()
        .map(|o| inputs::file_of(o))
        .chain(job.keypoints.as_deref().map(inputs::file_of));
    let plain = job.observe_contours.iter();
    for path in named.map(Path::new).chain(plain.map(|p| p.as_path())) {
        all.push_str(&bytes_hash(&files::read(path)?));
    }
    if let Some(spec) = &job.inputs.camera {
        all.push_str(&bytes_hash(&inputs::camera_bytes(spec)));
    }
    if job.inputs.edges.is_some() {
        all.push_str(&bytes_hash(&inputs::detector_bytes(job.inputs.edges.as_deref())?));
    }
    if job.inputs.hint.option().is_some() {
        all.push_str(&bytes_hash(&job.inputs.hint.bytes()?));
    }
    Ok(text_hash(&all))
}

/// Makes the record of a run for `run.json` before it begins, with everything that its
/// draws depend on.
pub fn of(job: &Job, program_hash: &str, inputs: &str) -> Map<String, Value> {
    let s = &job.sampling;
    let record = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "state": "running",
        "begun": reopened::now(),
        "program": job.inputs.program,
        "program_hash": program_hash,
        "inputs_hash": inputs,
        "seed": s.seed,
        "arguments": arguments(job),
        "observe": observed(job).collect::<Vec<_>>(),
        "set": job.inputs.sets.iter().map(|(k, v)| (k.clone(), json!(v))).collect::<Map<_, _>>(),
        "settings": {
            "chains": s.chains(), "steps": s.steps, "warmup": s.warmup,
            "time": s.time.map(|t| t.as_secs_f64()), "incremental": !s.no_incremental,
        },
    });
    match record {
        Value::Object(mut record) => {
            record.extend(job.inputs.edges.iter().map(|e| ("edges".to_owned(), json!(e))));
            record
        }
        _ => Map::new(),
    }
}

/// Writes `run.json`: the record, the state, and more fields.
pub fn write_record(
    dir: &RunDir,
    record: &Map<String, Value>,
    state: &str,
    more: Value,
) -> Result<(), Failure> {
    write_run(dir, &recorded(record, state, more))
}

/// Adds the state and more fields to a record.
pub(crate) fn recorded(record: &Map<String, Value>, state: &str, more: Value) -> Value {
    let mut record = record.clone();
    record.insert("state".into(), json!(state));
    if let Value::Object(more) = more {
        record.extend(more);
    }
    Value::Object(record)
}

pub(crate) fn write_run(dir: &RunDir, run: &Value) -> Result<(), Failure> {
    write_json(dir, "run.json", run)
}

pub(crate) fn write_json(dir: &RunDir, name: &str, value: &Value) -> Result<(), Failure> {
    write_in(dir, name, &serde_json::to_vec_pretty(value).unwrap_or_default())
}

/// Records in `run.json` that a run failed, and why.
pub fn record_failure(
    dir: &RunDir,
    record: &Map<String, Value>,
    failure: &Failure,
    seconds: f64,
) -> Result<(), Failure> {
    write_record(dir, record, "failed", json!({ "error": failure.to_string(), "seconds": seconds }))
}

/// Returns the statistics of the chains for `run.json`.
pub(crate) fn counts(
    chains: &[ChainResult],
    best: Option<&BestState>,
    quantities: &[Quantity],
) -> Map<String, Value> {
    let each: Vec<Value> = chains
        .iter()
        .map(|c| json!({ "steps": c.steps, "warmup": c.warmup, "draws": c.draws, "seconds": c.seconds }))
        .collect();
    let best = best.map(|b| b.log_joint);
    let r_hat =
        quantities.iter().map(|q| q.summary.r_hat).filter(|r| !r.is_nan()).max_by(f64::total_cmp);
    // R-hat is undefined if chains are stuck at different values, and the maximum over
    // other quantities would be misleading.
    let stuck = quantities.iter().find(|q| q.is_stuck());
    let r_hat = if stuck.is_some() { None } else { r_hat };
    let mut all =
        vec![("chains", json!(each)), ("best_log_joint", json!(best)), ("r_hat_max", json!(r_hat))];
    if let (None, Some(q)) = (r_hat, stuck.or(quantities.first())) {
        all.push((
            "r_hat_max_reason",
            json!(q.why_no_r_hat().map(|why| format!("{}: {why}", q.name))),
        ));
    }
    all.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

/// Returns a hash of everything that the draws of the chains depend on, which identifies
/// a run.
pub(crate) fn identity(record: &Map<String, Value>) -> String {
    let said = ["program_hash", "inputs_hash", "seed"]
        .map(|key| record.get(key).cloned().unwrap_or_default());
    let settings = ["warmup", "incremental"]
        .map(|key| record.get("settings").and_then(|s| s.get(key)).cloned());
    text_hash(&json!([said, settings]).to_string())
}

/// Returns the observations, as arguments of `--observe`.
fn observed(job: &Job) -> impl Iterator<Item = String> {
    job.observe.iter().cloned().chain(job.keypoints.iter().map(|k| format!("keypoints={k}")))
}
