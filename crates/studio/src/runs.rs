//! The runs of the opened folder: those under way, and those that earlier commands left.

use super::protocol::Settings;
use super::run::Run;
use pcadlang_engine::lang::reach::path_within;
use pcadlang_report::RunDir;
use pcadlang_runs::args::{Job, QualityArg};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::job::{self, Interrupt};
use pcadlang_runs::quality;
use pcadlang_workbench::tradeoff::Quality;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Maximum unfinished runs.
const MOST: usize = 64;
/// The folder of new runs.
const RUNS: &str = "runs";

/// The runs of a folder.
pub struct Runs {
    folder: PathBuf,
    all: Mutex<BTreeMap<String, Arc<Run>>>,
    interrupt: Arc<Interrupt>,
    slots: Arc<Slots>,
}

impl Runs {
    /// Finds the runs of a folder. `working` is the number of runs that work at a time.
    pub fn new(folder: &Path, working: usize, interrupt: Arc<Interrupt>) -> Runs {
        let slots = Arc::new(Slots::new(working));
        let runs = Runs { folder: folder.to_owned(), all: Mutex::default(), interrupt, slots };
        runs.look();
        runs
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Arc<Run>>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes up runs that other commands have left in `runs/` since the last look.
    pub fn look(&self) {
        let entries = std::fs::read_dir(self.folder.join(RUNS)).into_iter().flatten().flatten();
        for name in entries.filter_map(|e| e.file_name().into_string().ok()) {
            let _ = self.get(&format!("{RUNS}/{name}"));
        }
    }

    /// Returns a run by its folder, which may be any folder of a run within the opened one.
    pub fn get(&self, name: &str) -> Result<Arc<Run>, Failure> {
        if let Some(run) = self.lock().get(name) {
            return Ok(Arc::clone(run));
        }
        let path = path_within(&self.folder, name).map_err(plain)?;
        let run = Arc::new(Run::left(name, &path)?);
        Ok(Arc::clone(self.lock().entry(name.to_owned()).or_insert(run)))
    }

    /// Returns the latest run of a session.
    pub fn of_session(&self, id: u64) -> Option<Arc<Run>> {
        self.all().into_iter().find(|r| r.session == Some(id))
    }

    /// Returns all runs, the latest first.
    pub fn all(&self) -> Vec<Arc<Run>> {
        let mut all: Vec<Arc<Run>> = self.lock().values().cloned().collect();
        all.sort_by_key(|r| std::cmp::Reverse(r.begun_at()));
        all
    }

    /// Begins a run of a job.
    pub fn begin(
        &self,
        mut job: Job,
        settings: &Settings,
        session: u64,
    ) -> Result<Arc<Run>, Failure> {
        apply(&mut job, settings)?;
        let keypoints = job.keypoints.is_some();
        quality::apply(&mut job, keypoints)?;
        let run = {
            // Folders are given out one at a time, so that two runs never share one.
            let mut all = self.lock();
            if all.values().filter(|r| r.is_active()).count() >= MOST {
                let problem = plain(format!("{MOST} runs are under way or waiting"));
                return Err(problem.hint("stop one of them first"));
            }
            let runs = self.folder.join(RUNS);
            let dir = RunDir::fresh(&runs, job::stem(&job.inputs.program))
                .map_err(|e| plain(e.to_string()))?;
            let folder = dir.path().file_name().unwrap_or_default().to_string_lossy();
            let name = format!("{RUNS}/{folder}");
            let run = Arc::new(Run::new(&name, dir, job, session));
            all.insert(name, Arc::clone(&run));
            run
        };
        self.start(&run, false)?;
        Ok(run)
    }

    /// Goes on with a paused run, or with one that was stopped or interrupted.
    pub fn go_on(&self, name: &str) -> Result<Arc<Run>, Failure> {
        let run = self.get(name)?;
        if !run.unpause()? {
            return Ok(run);
        }
        self.start(&run, true)?;
        Ok(run)
    }

    /// Forgets a run that has ended.
    pub fn remove(&self, name: &str) -> Result<(), Failure> {
        let run = self.get(name)?;
        if run.is_active() {
            return Err(plain(format!("{name} has not ended")).hint("stop it first"));
        }
        self.lock().remove(name);
        Ok(())
    }

    fn start(&self, run: &Arc<Run>, resume: bool) -> Result<(), Failure> {
        let (run, slots) = (Arc::clone(run), Arc::clone(&self.slots));
        let interrupt = Arc::clone(&self.interrupt);
        let thread = std::thread::Builder::new().name(run.name.clone());
        let spawned = thread.spawn(move || run.work(&slots, &interrupt, resume));
        spawned.map_err(|e| plain(format!("no thread can be started: {e}")))?;
        Ok(())
    }

    /// Returns the descriptions of all runs.
    pub fn described(&self) -> Vec<Value> {
        self.all().iter().map(|r| r.described()).collect()
    }
}

/// Fills in the settings of a run.
fn apply(job: &mut Job, settings: &Settings) -> Result<(), Failure> {
    let s = &mut job.sampling;
    if let Some(name) = &settings.quality {
        let known = Quality::ALL.into_iter().find(|q| q.name() == name);
        s.quality = match (known, name.as_str()) {
            (Some(q), _) => Some(QualityArg::Known(q)),
            (None, "own") => Some(QualityArg::Own),
            _ => return Err(plain(format!("there is no preset `{name}`"))),
        };
    }
    if let Some(time) = settings.time {
        let time = Duration::try_from_secs_f64(time).ok().filter(|t| !t.is_zero());
        let wrong = || plain("`time` must be a number of seconds above 0");
        s.time = Some(time.ok_or_else(wrong)?);
    }
    if settings.chains.is_some_and(|n| !(1..=1024).contains(&n)) {
        return Err(plain("`chains` must be from 1 to 1024"));
    }
    s.seed = settings.seed.unwrap_or(s.seed);
    s.chains = settings.chains.or(s.chains);
    s.steps = settings.steps.or(s.steps);
    s.warmup = settings.warmup.or(s.warmup);
    for (name, value) in &settings.set {
        job.inputs.sets.retain(|(n, _)| n != name);
        job.inputs.sets.push((name.clone(), value.clone()));
    }
    Ok(())
}

/// How often a waiting run looks whether it was stopped.
const PATIENCE: Duration = Duration::from_millis(100);

/// Places for runs to work.
pub struct Slots {
    free: Mutex<usize>,
    freed: Condvar,
}

/// A place that is taken until it is dropped.
pub struct Slot<'a>(&'a Slots);

impl Slots {
    /// Makes `count` places.
    pub fn new(count: usize) -> Slots {
        Slots { free: Mutex::new(count), freed: Condvar::new() }
    }

    /// Waits for a place; `None` if the run was stopped meanwhile.
    pub fn take(&self, is_over: impl Fn() -> bool) -> Option<Slot<'_>> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        while *free == 0 {
            if is_over() {
                return None;
            }
            let woken = self.freed.wait_timeout(free, PATIENCE);
            free = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
        *free -= 1;
        Some(Slot(self))
    }
}

impl Drop for Slot<'_> {
    fn drop(&mut self) {
        *self.0.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.0.freed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_free_again_when_it_is_left() {
        let slots = Slots::new(2);
        let one = slots.take(|| true).unwrap();
        let _two = slots.take(|| true).unwrap();
        assert!(slots.take(|| true).is_none(), "stopped while it waits");
        drop(one);
        assert!(slots.take(|| true).is_some());
    }
}
