//! One run: under way, with its chains in memory, or ended, with what its folder holds.

use super::results::finite;
use super::runs::Slots;
use pcadlang_inference::Progress;
use pcadlang_report::RunDir;
use pcadlang_runs::args::Job;
use pcadlang_runs::best::judged_so_far;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::inputs::{self, Ready};
use pcadlang_runs::job::{self, CHECKPOINT, Interrupt, RunMode};
use pcadlang_runs::reopening::reopened::Reopened;
use pcadlang_runs::verdict::sentence;
use pcadlang_runs::watched::Watched;
use pcadlang_runs::{record, resume};
use serde::Serialize;
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How many complete states a run keeps.
const KEEP: u32 = 100;

/// The status of a run; lower-case names in the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RunStatus {
    /// It waits for its turn.
    Waiting,
    /// Its chains run.
    Running,
    /// Its chains wait.
    Paused,
    /// It was stopped, and writes its files.
    Stopping,
    /// It has ended by itself.
    Done,
    /// It was stopped, and can go on.
    Stopped,
    /// It has failed.
    Failed,
    /// Another command began it, and did not end it.
    Interrupted,
}

/// A run.
pub struct Run {
    /// Its folder, relative to the opened one: its name in the protocol.
    pub name: String,
    /// Its folder.
    pub folder: PathBuf,
    /// Its inputs and settings; `None` if its folder does not record them.
    pub job: Option<Job>,
    /// The session from which it was begun.
    pub session: Option<u64>,
    stop: AtomicBool,
    inner: Mutex<Inner>,
    /// Pictures of its states, see `states`.
    pub(super) pictures: super::states::Pictures,
}

struct Inner {
    status: RunStatus,
    /// The contents of `run.json`.
    record: Value,
    error: Option<String>,
    ready: Option<Arc<Ready>>,
    watched: Option<Arc<Watched>>,
    /// What is said of the best state when the run was paused last.
    paused: Option<String>,
    clock: Clock,
}

/// A clock that is stopped while a run is paused.
#[derive(Clone, Copy, Debug, Default)]
struct Clock {
    before: Duration,
    since: Option<Instant>,
}

impl Clock {
    fn elapsed(&self) -> Duration {
        self.before + self.since.map_or(Duration::ZERO, |s| s.elapsed())
    }

    fn halt(&mut self) {
        *self = Clock { before: self.elapsed(), since: None };
    }

    fn go(&mut self) {
        self.since = self.since.or(Some(Instant::now()));
    }
}

impl Run {
    /// A run that is about to begin.
    pub fn new(name: &str, dir: RunDir, job: Job, session: u64) -> Run {
        let record = json!({ "begun": pcadlang_runs::reopening::reopened::now() });
        Run::of(name, dir.path(), Some(job), Some(session), RunStatus::Waiting, record)
    }

    /// A run that another command has left in a folder.
    pub fn left(name: &str, folder: &Path) -> Result<Run, Failure> {
        let record = resume::run(folder)?;
        let status = match record["state"].as_str() {
            Some("done") => RunStatus::Done,
            Some("interrupted") => RunStatus::Stopped,
            Some("failed") => RunStatus::Failed,
            _ => RunStatus::Interrupted,
        };
        let job = Reopened::open(folder).ok().map(|r| r.job);
        Ok(Run::of(name, folder, job, None, status, record))
    }

    fn of(
        name: &str,
        folder: &Path,
        job: Option<Job>,
        session: Option<u64>,
        status: RunStatus,
        record: Value,
    ) -> Run {
        let error = record["error"].as_str().map(str::to_owned);
        let before = Duration::try_from_secs_f64(record["seconds"].as_f64().unwrap_or(0.0));
        let clock = Clock { before: before.unwrap_or_default(), since: None };
        let inner =
            Inner { status, record, error, ready: None, watched: None, paused: None, clock };
        Run {
            name: name.to_owned(),
            folder: folder.to_owned(),
            job,
            session,
            stop: AtomicBool::new(false),
            inner: Mutex::new(inner),
            pictures: Default::default(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns its status.
    pub fn status(&self) -> RunStatus {
        self.lock().status
    }

    /// Returns whether it has begun, or waits, and has not ended.
    pub fn is_active(&self) -> bool {
        use RunStatus::{Paused, Running, Stopping, Waiting};
        matches!(self.status(), Waiting | Running | Paused | Stopping)
    }

    /// Returns what its `run.json` says.
    pub fn record(&self) -> Value {
        self.lock().record.clone()
    }

    /// Returns what its `summary.json` says; null while its chains run.
    pub fn summary_file(&self) -> Value {
        let bytes = match self.watched() {
            Some(_) => None,
            None => std::fs::read(self.folder.join("summary.json")).ok(),
        };
        bytes.and_then(|b| serde_json::from_slice(&b).ok()).unwrap_or_default()
    }

    /// Returns the time at which it began, as text that sorts.
    pub fn begun_at(&self) -> String {
        self.lock().record["begun"].as_str().unwrap_or_default().to_owned()
    }

    /// Returns the compiled program, which is compiled now if it was not before.
    pub fn ready(&self) -> Result<Arc<Ready>, Failure> {
        if let Some(ready) = &self.lock().ready {
            return Ok(Arc::clone(ready));
        }
        if self.is_active() {
            return Err(plain("the run has not begun yet"));
        }
        let run = Reopened::open(&self.folder)?;
        let ready = Arc::new(inputs::prepare_program(run.program()?, &run.job, Instant::now())?);
        self.lock().ready = Some(Arc::clone(&ready));
        Ok(ready)
    }

    /// Returns what can be watched while its chains run.
    pub fn watched(&self) -> Option<Arc<Watched>> {
        self.lock().watched.clone()
    }

    /// Makes its chains wait, and judges their best state.
    pub fn pause(&self) -> Result<(), Failure> {
        self.halt()?;
        let (ready, watched) = {
            let inner = self.lock();
            (inner.ready.clone(), inner.watched.clone())
        };
        let both = ready.zip(watched);
        let judged = both.zip(self.job.as_ref());
        let judged =
            judged.and_then(|((ready, watched), job)| judged_so_far(job, &ready, &watched));
        self.lock().paused = judged.map(|judged| judged.to_string());
        Ok(())
    }

    fn halt(&self) -> Result<(), Failure> {
        let mut inner = self.lock();
        match inner.status {
            RunStatus::Paused => {}
            RunStatus::Running => {
                if let Some(w) = &inner.watched {
                    w.progress.pause.begin();
                }
                inner.clock.halt();
                inner.status = RunStatus::Paused;
            }
            _ => return Err(plain(format!("{} is not running", self.name))),
        }
        Ok(())
    }

    /// Ends a pause. Returns whether the run must be started again instead.
    pub fn unpause(&self) -> Result<bool, Failure> {
        let mut inner = self.lock();
        match inner.status {
            RunStatus::Waiting | RunStatus::Running => {}
            RunStatus::Paused => {
                if let Some(w) = &inner.watched {
                    w.progress.pause.end();
                }
                inner.clock.go();
                inner.status = RunStatus::Running;
            }
            RunStatus::Stopped | RunStatus::Interrupted if self.job.is_some() => {
                inner.status = RunStatus::Waiting;
                self.stop.store(false, Ordering::SeqCst);
                return Ok(true);
            }
            RunStatus::Stopping => {
                return Err(plain("the run is still writing its files"));
            }
            _ => return Err(plain(format!("{} has ended", self.name))),
        }
        Ok(false)
    }

    /// Ends it at its next step; its draws and a checkpoint are kept.
    pub fn stop(&self) -> Result<(), Failure> {
        let mut inner = self.lock();
        if !matches!(
            inner.status,
            RunStatus::Waiting | RunStatus::Running | RunStatus::Paused | RunStatus::Stopping
        ) {
            return Err(plain(format!("{} has ended", self.name)));
        }
        self.stop.store(true, Ordering::SeqCst);
        if let Some(w) = &inner.watched {
            w.progress.cancelled.store(true, Ordering::SeqCst);
            w.progress.pause.end();
        }
        inner.status = RunStatus::Stopping;
        Ok(())
    }

    /// Does the run, on a thread of its own.
    pub fn work(&self, slots: &Slots, interrupt: &Interrupt, resume: bool) {
        let is_over = || self.stop.load(Ordering::SeqCst) || interrupt.asked();
        let Some(_slot) = slots.take(is_over) else {
            return self.end(RunStatus::Stopped, None);
        };
        let done = catch_unwind(AssertUnwindSafe(|| self.perform(interrupt, resume)));
        match done {
            Ok(Ok(true)) => self.end(RunStatus::Stopped, None),
            Ok(Ok(false)) => self.end(RunStatus::Done, None),
            Ok(Err(failure)) => self.end(RunStatus::Failed, Some(failure.to_string())),
            Err(_) => self.end(RunStatus::Failed, Some("an internal error".to_owned())),
        }
    }

    /// Returns whether the run was stopped.
    fn perform(&self, interrupt: &Interrupt, resume: bool) -> Result<bool, Failure> {
        let Some(job) = &self.job else {
            return Err(plain("the folder does not record its command"));
        };
        self.lock().clock.go();
        // A run that was stopped while it waited has left nothing.
        let resume = resume && resume::left(&self.folder).is_some();
        let ready = match resume {
            true => {
                let run = Reopened::open(&self.folder)?;
                inputs::prepare_program(run.program()?, job, Instant::now())?
            }
            false => inputs::prepare(job, true)?,
        };
        let watched = Arc::new(Watched::new(job, &ready.model, KEEP));
        let ready = Arc::new(ready);
        let inputs = record::inputs_hash(job, &ready.model)?;
        let record = record::of(job, ready.model.hash(), &inputs);
        let dir = match resume {
            true => resume::resumed(&self.folder, &record)?,
            false => RunDir::create(&self.folder).map_err(|e| plain(e.to_string()))?,
        };
        {
            let mut inner = self.lock();
            (inner.ready, inner.watched) = (Some(Arc::clone(&ready)), Some(Arc::clone(&watched)));
            if inner.status == RunStatus::Waiting {
                inner.status = RunStatus::Running;
            }
            watched.progress.cancelled.store(self.stop.load(Ordering::SeqCst), Ordering::SeqCst);
            inner.record = Value::Object(record.clone());
        }
        let mode = RunMode {
            live: false,
            checkpoint: CHECKPOINT,
            resume,
            keep: KEEP,
            follow: None,
            stream: false,
        };
        let done = job::perform_watched(job, &ready, &dir, &record, interrupt, mode, &watched)?;
        Ok(done.interrupted)
    }

    /// Notes how it ended, and gives up the memory of its chains.
    fn end(&self, status: RunStatus, error: Option<String>) {
        let left = resume::left(&self.folder);
        let mut inner = self.lock();
        inner.clock.halt();
        inner.watched = None;
        // A run that never wrote its folder keeps the record of its beginning.
        if let Some(record) = left {
            inner.record = record;
        }
        (inner.status, inner.error) = (status, error);
        drop(inner);
        self.pictures.forget();
    }

    /// Describes it, for the page.
    pub fn described(&self) -> Value {
        let inner = self.lock();
        let record = &inner.record;
        let elapsed = inner.clock.elapsed().as_secs_f64();
        let chains = self.job.as_ref().map(|j| j.sampling.chains());
        let limit = self.job.as_ref().and_then(|j| j.sampling.time).map(|t| t.as_secs_f64());
        let mut out = json!({
            "run": self.name,
            "folder": self.name,
            "program": self.job.as_ref().map(|j| &j.inputs.program),
            "observe": self.job.as_ref().map(|j| &j.observe),
            "set": self.job.as_ref().map(|j| j.inputs.sets.iter().cloned().collect::<std::collections::BTreeMap<_, _>>()),
            "seed": self.job.as_ref().map(|j| j.sampling.seed),
            "state": inner.status,
            "chains": chains,
            "elapsed": elapsed,
            "limit": limit,
            "error": inner.error,
            "begun": record["begun"],
            "r_hat": record["r_hat_max"],
            "session": self.session,
        });
        let found = match inner.status {
            RunStatus::Paused => inner.paused.as_deref(),
            _ => sentence(record),
        };
        out["found"] = json!(found);
        let more = match &inner.watched {
            Some(w) => live(w, inner.status, chains.unwrap_or(1), elapsed, limit),
            None => {
                let of = |key: &str| -> u64 {
                    let each = record["chains"].as_array();
                    each.into_iter().flatten().filter_map(|c| c[key].as_u64()).sum()
                };
                json!({
                    "phase": inner.status, "ended": chains, "steps": of("steps") + of("warmup"), "draws": of("draws"),
                    "best": record["best_log_joint"], "done": null, "left": null, "rate": null,
                    "revision": record["best_log_joint"].as_f64().map_or(0, revision), "film": null,
                })
            }
        };
        if let (Value::Object(out), Value::Object(more)) = (&mut out, more) {
            out.extend(more);
        }
        out
    }
}

/// Describes the chains of a run that is under way.
fn live(w: &Watched, status: RunStatus, chains: u32, elapsed: f64, limit: Option<f64>) -> Value {
    let p: &Progress = &w.progress;
    let number = |n: &AtomicU32| n.load(Ordering::Relaxed);
    let count = |n: &AtomicU64| n.load(Ordering::Relaxed);
    let (started, ended) = (number(&p.started), number(&p.ended));
    let phase = match status {
        RunStatus::Paused | RunStatus::Stopping => json!(status),
        _ if started == ended && ended < chains => json!("starting"),
        _ if started == ended => json!("writing"),
        _ if number(&p.warming) > 0 => json!("warm-up"),
        _ => json!("sampling"),
    };
    let (pass, passes) = (count(&p.pass), count(&p.passes));
    let done = match (limit, passes) {
        (Some(limit), _) => json!((elapsed / limit).min(1.0)),
        (None, 0) => Value::Null,
        (None, _) => json!((pass as f64 / passes as f64).min(1.0)),
    };
    let steps = count(&p.steps);
    let best = w.best.state();
    let draws: u64 = w.memories.iter().map(|m| m.count()).sum();
    json!({
        "phase": phase,
        "ended": ended,
        "steps": steps,
        "rate": finite(steps as f64 / elapsed),
        "left": limit.map(|l| (l - elapsed).max(0.0)),
        "done": done,
        "best": best.as_ref().map(|b| finite(b.log_joint)),
        "revision": best.map_or(0, |b| revision(b.log_joint)),
        "draws": draws,
        "film": w.trajectory.of_chain(0).len(),
    })
}

/// Returns a whole number that grows with a log density, and that JSON keeps exactly.
pub(super) fn revision(log_joint: f64) -> u64 {
    let bits = log_joint.to_bits();
    // The order of floating-point numbers as whole numbers (IEEE 754: sign and magnitude).
    let ordered = if bits >> 63 == 1 { !bits } else { bits | 1 << 63 };
    ordered >> 11
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_revision_grows_with_the_log_density() {
        let all = [f64::NEG_INFINITY, -1e9, -20.5, -20.25, -0.0, 0.0, 1e-9, 3.0, 1e300];
        let all = all.map(revision);
        assert!(all.windows(2).all(|w| w[0] < w[1]), "{all:?}");
        assert!(all.iter().all(|r| *r < 1 << 53));
    }

    #[test]
    fn a_clock_stands_still_in_a_pause() {
        let mut clock = Clock { before: Duration::from_secs(3), since: None };
        assert_eq!(clock.elapsed(), Duration::from_secs(3));
        clock.go();
        std::thread::sleep(Duration::from_millis(2));
        clock.halt();
        let then = clock.elapsed();
        assert!(then > Duration::from_secs(3));
        assert_eq!(clock.elapsed(), then);
    }
}
