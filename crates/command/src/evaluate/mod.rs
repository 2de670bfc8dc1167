//! `pcadlang evaluate`: runs a program on every case of a dataset, and writes files for
//! scoring.
//!
//! Invariant: after each case all files are complete and describe the progress so far; a
//! case counts as done only if its `run.json` says so, with these settings.

mod dataset;
mod observed;

use super::args::{Evaluate, Inputs, Job};
use dataset::Case;
pub use dataset::{Dataset, Layout, known};
pub use observed::{Detections, Items, observations_for};
use pcadlang_report::evaluation::{MARK, PREDICTIONS, Row, TABLE, markdown, open, prediction};
use pcadlang_report::{RunDir, bytes_hash, r_hat_text, seconds};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::job::{CHECKPOINT, Interrupt, RunMode};
use pcadlang_runs::term;
use pcadlang_runs::{inputs, job, quality, record, resume};
use serde_json::{Map, Value, json};
use std::sync::Arc;
use std::time::Instant;

/// A case and the state of its run.
struct Task {
    case: Case,
    job: Job,
    record: Map<String, Value>,
    /// True if the case is selected by `--only`, or by default.
    chosen: bool,
    /// The result so far; `None` for a case that is neither selected nor done.
    row: Option<Row>,
}

/// The state of an evaluation.
struct Evaluation<'a> {
    a: &'a Evaluate,
    layout: Layout,
    dir: RunDir,
    tasks: Vec<Task>,
    /// The fields of `evaluation.json` before `cases`.
    head: Map<String, Value>,
    interrupt: Arc<Interrupt>,
}

/// Runs a program over a dataset.
pub fn evaluate(a: &Evaluate) -> Result<(), Failure> {
    let mut e = Evaluation::prepare(a)?;
    e.save()?;
    let chosen: Vec<usize> = (0..e.tasks.len()).filter(|&i| e.tasks[i].chosen).collect();
    let mut failed = Vec::new();
    let mut interrupted = false;
    for (n, &i) in chosen.iter().enumerate() {
        let place = format!("{}/{} {}", n + 1, chosen.len(), e.tasks[i].case.name);
        if e.tasks[i].row.as_ref().is_some_and(|r| r.status == "done") {
            e.say(&format!("{place}: already done"));
            continue;
        }
        let (row, failure) = e.run(i);
        e.say(&format!("{place}: {}", line(&row)));
        e.tasks[i].row = Some(row);
        if let Some(failure) = failure {
            term::fail(failure);
            failed.push(e.tasks[i].case.name.clone());
        }
        e.save()?;
        interrupted = e.interrupt.asked();
        if interrupted {
            break;
        }
    }
    if a.json {
        print_line!("{}", e.summary());
    } else if !a.quiet {
        print_text!("{}", markdown(&e.rows()));
    }
    match failed.len() {
        _ if interrupted => Err(Failure::Interrupted),
        0 => Ok(()),
        n => Err(plain(format!("{n} of {} cases failed: {}", chosen.len(), failed.join(", ")))),
    }
}

/// Formats a result in one line.
fn line(row: &Row) -> String {
    if row.status == "failed" {
        return row.status.clone();
    }
    let mut s = row.seconds.map_or(String::new(), seconds);
    if row.status != "done" {
        s = format!("{} after {s}", row.status);
    }
    if let Some(best) = row.best_log_joint {
        s.push_str(&format!(", best log joint {best:.1}"));
    }
    if let Some(r) = row.r_hat_max {
        s.push_str(&format!(", R-hat {}", r_hat_text(r)));
    }
    s + &row.draws.map_or(String::new(), |n| format!(", {n} draws"))
}

impl<'a> Evaluation<'a> {
    /// Prepares all cases, and reports errors in the program, dataset or folder before
    /// the first case is run.
    fn prepare(a: &'a Evaluate) -> Result<Evaluation<'a>, Failure> {
        let Dataset { layout, cases, skipped } = Dataset::open(&a.dataset)?;
        dataset::known(&a.dataset, &a.only, cases.iter().map(|c| c.name.as_str()))?;
        let program = inputs::without_camera(&a.inputs, a.quiet)?;
        let hash = program.hash();
        let detections = a.keypoints.clone().map(Detections::open).transpose()?;
        let items = Items::of(&program, detections.is_some())?;
        program.without_data().compile()?;
        let dir = open(&a.out).map_err(|e| plain(e.to_string()))?;
        let same = [inputs::detector_bytes(a.inputs.edges.as_deref())?, a.inputs.hint.bytes()?];
        let same = same.concat();
        let mut said = None;
        let task = |case: Case| {
            let camera = case.camera.clone().or_else(|| a.inputs.camera.clone());
            let case = Case { camera: camera.clone(), ..case };
            let observe = observations_for(&case, detections.as_ref())
                .iter()
                .map(|o| items.spec(o))
                .collect();
            let inputs = Inputs { camera, ..a.inputs.clone() };
            let mut job = Job { observe, ..Job::of(inputs, a.sampling.clone()) };
            said = quality::apply(&mut job, detections.is_some())?;
            let inputs =
                bytes_hash(&[observed::bytes(&case, detections.as_ref()), same.clone()].concat());
            let record = record::of(&job, &hash, &inputs);
            let chosen = a.only.is_empty() || a.only.contains(&case.name);
            Ok(Task { case, job, record, chosen, row: None })
        };
        let tasks = cases.into_iter().map(task).collect::<Result<_, Failure>>()?;
        let mut e =
            Evaluation { a, layout, dir, tasks, head: Map::new(), interrupt: Interrupt::listen() };
        e.take_up()?;
        e.head = e.head();
        if let Some(said) = said {
            e.say(&format!("note: {said}"));
        }
        for name in skipped {
            e.say(&format!("note: {name} has no image and is skipped"));
        }
        for t in
            e.tasks.iter().filter(|t| detections.is_some() && t.chosen && t.job.observe.len() < 2)
        {
            e.say(&format!("note: no keypoints for {}: it runs on its picture alone", t.case.name));
        }
        Ok(e)
    }

    /// Takes over the results of an earlier evaluation. Results with other settings are
    /// an error without `--fresh`.
    fn take_up(&mut self) -> Result<(), Failure> {
        let mut other = None;
        for t in &mut self.tasks {
            t.row = t.chosen.then(|| Row::pending(&t.case.name));
            let folder = self.dir.file(&t.case.name);
            let Some(run) = resume::left(&folder) else { continue };
            let differences = resume::differences(&run, &t.record);
            if differences.is_empty() && !(self.a.fresh && t.chosen) {
                t.row = Some(Row::of(&t.case.name, &run));
            } else if !differences.is_empty() && run["state"] != "failed" {
                other = other.or(Some((folder, differences)));
            }
        }
        match other {
            Some((folder, differences)) if !self.a.fresh => Err(Failure::Plain(
                format!(
                    "{} was run with different settings: {}",
                    folder.display(),
                    differences.join(", ")
                ),
                Some("choose another folder with --out, or redo all cases with --fresh".into()),
            )),
            _ => Ok(()),
        }
    }

    /// Returns the settings that all cases share.
    fn head(&self) -> Map<String, Value> {
        let a = self.a;
        let mut head: Map<String, Value> = Map::new();
        let Some(first) = self.tasks.first() else { return head };
        for key in ["version", "program", "program_hash", "seed", "set", "settings"] {
            head.insert(key.into(), first.record.get(key).cloned().unwrap_or_default());
        }
        let layout = if self.layout == Layout::People { "people" } else { "folders" };
        let more = [
            ("threads", json!(job::threads(&first.job))),
            ("machine_threads", json!(job::machine_threads())),
            ("dataset", json!(a.dataset)),
            ("layout", json!(layout)),
            ("keypoints", json!(a.keypoints)),
        ];
        head.extend(more.map(|(k, v)| (k.to_owned(), v)));
        head
    }

    /// Runs a case. The result is read from its folder, as for a case that was done
    /// earlier.
    fn run(&self, i: usize) -> (Row, Option<Failure>) {
        let t = &self.tasks[i];
        let begun = Instant::now();
        match self.fill(t) {
            Ok(()) => {
                let run = resume::left(&self.dir.file(&t.case.name)).unwrap_or_default();
                (Row::of(&t.case.name, &run), None)
            }
            // The folder itself may be the cause, so nothing is read from it.
            Err(failure) => {
                let row = Row {
                    status: "failed".into(),
                    wall_seconds: Some(begun.elapsed().as_secs_f64()),
                    error: Some(failure.to_string()),
                    ..Row::pending(&t.case.name)
                };
                (row, Some(failure))
            }
        }
    }

    fn fill(&self, t: &Task) -> Result<(), Failure> {
        let dir = RunDir::create(&self.dir.file(&t.case.name)).map_err(|e| plain(e.to_string()))?;
        let begun = Instant::now();
        let ready = inputs::prepare(&t.job, true).inspect_err(|failure| {
            // An error in writing the record must not hide the first error.
            let _ = record::record_failure(&dir, &t.record, failure, begun.elapsed().as_secs_f64());
        })?;
        let live = !(self.a.quiet || self.a.json);
        let mode = RunMode {
            live,
            checkpoint: CHECKPOINT,
            resume: false,
            keep: 0,
            follow: None,
            stream: false,
        };
        job::perform(&t.job, &ready, &dir, &t.record, &self.interrupt, mode).map(|_| ())
    }

    fn rows(&self) -> Vec<Row> {
        self.tasks.iter().filter_map(|t| t.row.clone()).collect()
    }

    fn summary(&self) -> Value {
        let mut all = self.head.clone();
        all.insert("cases".into(), json!(self.rows()));
        Value::Object(all)
    }

    /// Writes all summaries of the results so far.
    fn save(&self) -> Result<(), Failure> {
        let write = |name: &str, bytes: &[u8]| {
            self.dir.write(name, bytes).map_err(|e| plain(e.to_string()))
        };
        let json = |v: &Value| serde_json::to_vec_pretty(v).unwrap_or_default();
        // Written first, since it marks the folder as an evaluation's.
        write(MARK, &json(&self.summary()))?;
        write(TABLE, markdown(&self.rows()).as_bytes())?;
        if self.layout == Layout::People {
            write(PREDICTIONS, &json(&Value::Object(self.predictions())))?;
        }
        Ok(())
    }

    /// Returns the predicted joints of each person whose run has ended: null where the
    /// run failed or its scene has no joints.
    fn predictions(&self) -> Map<String, Value> {
        let ended = self
            .tasks
            .iter()
            .filter_map(|t| t.row.as_ref())
            .filter(|r| ["done", "failed"].contains(&&*r.status));
        let entry = |row: &Row| {
            let file = self.dir.file(&row.case).join("keypoints.json");
            let found =
                std::fs::read(file).ok().and_then(|b| serde_json::from_slice::<Value>(&b).ok());
            let found = found.filter(|_| row.status == "done");
            (row.case.clone(), prediction(found.as_ref(), row.seconds.or(row.wall_seconds)))
        };
        ended.map(entry).collect()
    }

    /// Prints a progress message, unless `--quiet` is set.
    fn say(&self, text: &str) {
        if !self.a.quiet {
            error_line!("{text}");
        }
    }
}
