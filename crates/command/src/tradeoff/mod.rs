//! `pcadlang tradeoff`: measures the trade-off of speed and accuracy over settings, on
//! cases with ground truth.
//!
//! Invariant: a run is on the disk before it is used; table, front, plot and presets are
//! made from the runs alone, so that interrupted and uninterrupted measurements write the
//! same files.

mod cases;
mod folder;
mod running;
mod settings;
mod truth;
mod work;

use super::args::Tradeoff;
use super::evaluate::known;
use cases::Case;
use folder::Folder;
use pcadlang_report::{bytes_hash, seconds, text_hash};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::inputs;
use pcadlang_runs::job::{self, Interrupt};
use pcadlang_workbench::tradeoff::{
    Preset, Presets, Quality, Round, Row, RunRecord, Setting, plot, rounds, rows, survivors, to_csv,
};
use serde_json::{Map, Value, json};
use settings::Settings;
use std::collections::{BTreeSet, HashSet};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use work::Task;

/// Threads per run; few, since the presets are for small machines.
const THREADS: usize = 2;

/// The time of a run, with compilation and scoring, relative to its own time limit.
const OVERHEAD: f64 = 1.1;

/// The settings and cases to be measured, and the results so far.
struct Measurement<'a> {
    a: &'a Tradeoff,
    settings: Vec<Setting>,
    /// The settings that may become presets.
    candidates: Vec<Setting>,
    cases: Vec<Case>,
    folder: Folder,
    head: Map<String, Value>,
    runs: Mutex<Vec<RunRecord>>,
    begun: Instant,
    jobs: usize,
    threads: usize,
}

/// Measures all settings within the budget.
pub fn tradeoff(a: &Tradeoff) -> Result<(), Failure> {
    let interrupt = Interrupt::listen();
    let mut s = Measurement::prepare(a)?;
    let each = s.settings.iter().map(|x| x.time.unwrap_or(10.0)).sum::<f64>()
        / s.settings.len().max(1) as f64;
    let each = OVERHEAD * each * f64::from(a.seeds) / s.jobs as f64;
    let plan = rounds(s.settings.len(), s.cases.len(), each, a.budget.as_secs_f64());
    let (mut names, mut out_of_time) =
        (s.settings.iter().map(Setting::name).collect::<Vec<_>>(), false);
    for (i, round) in plan.iter().enumerate() {
        // Settings are compared by their means over the same cases.
        let before = i.checked_sub(1).and_then(|i| plan.get(i)).map_or(0, |r| r.cases);
        names = survivors(&names, &s.done_on(before), round.settings);
        let Round { settings, cases } = *round;
        s.say(&format!("round {} of {}: {settings} settings on {cases} cases", i + 1, plan.len()));
        out_of_time = !s.round(&names, cases, &interrupt)?;
        s.write()?;
        if out_of_time || interrupt.asked() {
            break;
        }
    }
    let runs = s.done();
    let failed: Vec<&str> = runs.iter().filter_map(|r| r.failed.as_deref()).collect();
    if let (Some(first), true) = (failed.first(), failed.len() == runs.len()) {
        return Err(plain(format!("all {} runs failed; the first: {first}", runs.len())));
    }
    s.show();
    if let Some(first) = failed.first() {
        s.say(&format!(
            "warning: {} of {} runs failed; the first: {first}",
            failed.len(),
            runs.len()
        ));
    }
    match (interrupt.asked(), out_of_time) {
        (true, _) => Err(Failure::Interrupted),
        (_, true) => Err(Failure::Plain(
            "the budget ran out before all runs were made; the results so far are written".into(),
            Some("run the same command with a larger --budget to go on".into()),
        )),
        _ => Ok(()),
    }
}

impl<'a> Measurement<'a> {
    /// Prepares a measurement, and reports all errors in its input before the first run.
    fn prepare(a: &'a Tradeoff) -> Result<Measurement<'a>, Failure> {
        a.inputs.hint.none_for("tradeoff")?;
        let program = inputs::without_camera(&a.inputs, a.quiet)?;
        let Settings { all: settings, candidates } = settings::read(a)?;
        let hashes = settings::programs(a, &settings)?;
        let mut cases = cases::open(a, &program)?;
        known(&a.cases, &a.only, cases.iter().map(|c| c.name.as_str()))?;
        cases.retain(|c| a.only.is_empty() || a.only.contains(&c.name));
        // In order of hash, so that the first few cases are of all kinds whatever their
        // names.
        cases.sort_by_key(|c| text_hash(&c.name));
        let machine = job::machine_threads();
        let threads = a.threads.map_or(THREADS.min(machine), |n| n as usize);
        let jobs = a.jobs.map_or((machine / threads).max(1), |n| n as usize);
        // People share files: each file is read once.
        let files: BTreeSet<PathBuf> = cases.iter().flat_map(Case::files).collect();
        let inputs: String = files
            .iter()
            .map(|path| std::fs::read(path).map(|b| bytes_hash(&b)).unwrap_or_default())
            .collect();
        let head = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "program": a.inputs.program,
            "programs": hashes,
            "set": a.inputs.sets.iter().map(|(k, v)| (k.clone(), json!(v))).collect::<Map<_, _>>(),
            "cases": cases.iter().map(|c| c.name.clone()).collect::<Vec<_>>(),
            "inputs": text_hash(&inputs),
            "threads": threads,
            "jobs": jobs,
            "machine_threads": machine,
        });
        let Value::Object(head) = head else { return Err(plain("no settings")) };
        let mut folder = Folder::open(&a.out, &head, a.fresh)?;
        // A call that was killed has not recorded its time, but its runs have.
        let ran =
            folder.before.iter().filter_map(|r| r.marks.last()).map(|m| m.seconds).sum::<f64>();
        folder.spent = folder.spent.max(ran / jobs as f64);
        let runs = Mutex::new(folder.before.clone());
        let s = Measurement {
            a,
            settings,
            candidates,
            cases,
            folder,
            head,
            runs,
            begun: Instant::now(),
            jobs,
            threads,
        };
        s.write()?;
        Ok(s)
    }

    /// Returns all runs of the present settings and cases.
    fn done(&self) -> Vec<RunRecord> {
        let names: HashSet<String> = self.settings.iter().map(Setting::name).collect();
        let cases: HashSet<&str> = self.cases.iter().map(|c| c.name.as_str()).collect();
        let runs = self.runs.lock().unwrap_or_else(PoisonError::into_inner);
        runs.iter()
            .filter(|r| names.contains(&r.setting) && cases.contains(r.case.as_str()))
            .cloned()
            .collect()
    }

    /// Returns the runs on the first `cases` cases, with the present seeds.
    fn done_on(&self, cases: usize) -> Vec<RunRecord> {
        let first: HashSet<&str> = self.cases.iter().take(cases).map(|c| c.name.as_str()).collect();
        let mut runs = self.done();
        runs.retain(|r| first.contains(r.case.as_str()) && r.seed <= u64::from(self.a.seeds));
        runs
    }

    /// Returns the used part of the budget, in seconds.
    fn spent(&self) -> f64 {
        self.folder.spent + self.begun.elapsed().as_secs_f64()
    }

    /// Runs settings on the first `cases` cases, unless they have been run already.
    /// Returns whether all runs were made, rather than stopped by the budget or an
    /// interrupt.
    fn round(
        &mut self,
        names: &[String],
        cases: usize,
        interrupt: &Interrupt,
    ) -> Result<bool, Failure> {
        let known: HashSet<(String, String, u64)> =
            self.done().into_iter().map(|r| (r.setting, r.case, r.seed)).collect();
        let settings: Vec<&Setting> =
            self.settings.iter().filter(|s| names.contains(&s.name())).collect();
        let mut tasks = Vec::new();
        for case in &self.cases[..cases.min(self.cases.len())] {
            for seed in 1..=u64::from(self.a.seeds) {
                let new = |s: &&&Setting| !known.contains(&(s.name(), case.name.clone(), seed));
                tasks.extend(settings.iter().filter(new).map(|setting| Task {
                    setting,
                    case,
                    seed,
                }));
            }
        }
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let failure: Mutex<Option<Failure>> = Mutex::default();
        let over = || interrupt.asked() || self.spent() > self.a.budget.as_secs_f64();
        std::thread::scope(|scope| {
            for _ in 0..self.jobs.min(tasks.len()) {
                scope.spawn(|| {
                    while !over() {
                        let Some(task) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) else {
                            break;
                        };
                        let Some(run) = work::run(self.a, *task, self.threads as u32, interrupt)
                        else {
                            break;
                        };
                        if let Err(e) = self.folder.keep(&run) {
                            *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(e);
                            break;
                        }
                        let n = done.fetch_add(1, Ordering::Relaxed) + 1;
                        self.say(&format!("{n}/{} {}", tasks.len(), told(&run)));
                        self.runs.lock().unwrap_or_else(PoisonError::into_inner).push(run);
                    }
                });
            }
        });
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(e) => Err(e),
            None => Ok(done.into_inner() == tasks.len()),
        }
    }

    /// Returns the table of all runs.
    fn rows(&self) -> Vec<Row> {
        rows(&self.settings, &self.done())
    }

    fn error_name(&self) -> &'static str {
        self.cases.first().map_or("error", |c| c.truth.error_name())
    }

    fn presets(&self, rows: &[Row]) -> Presets {
        let about = format!(
            "the front of {} settings on {} cases, {} threads per run; chosen by pcadlang tradeoff",
            self.candidates.len(),
            self.cases.len(),
            self.threads,
        );
        let needs =
            if self.a.keypoints.is_some() { vec!["keypoints".to_owned()] } else { Vec::new() };
        let mut front = Preset::front(&self.candidates, rows);
        for preset in &mut front {
            // Parameters that were set for all runs are part of what was measured.
            let inputs = self.a.inputs.sets.iter().cloned();
            preset.setting.set = inputs.chain(std::mem::take(&mut preset.setting.set)).collect();
        }
        Presets { about, error: self.error_name().into(), needs, front }
    }

    /// Writes everything that is derived from the runs.
    fn write(&self) -> Result<(), Failure> {
        let (rows, mut head) = (self.rows(), self.head.clone());
        let presets = self.presets(&rows);
        head.insert("seconds".into(), json!(self.spent()));
        head.insert("error".into(), json!(self.error_name()));
        head.insert("rows".into(), json!(rows));
        self.folder.mark(head)?;
        self.folder.write("table.csv", to_csv(&rows).as_bytes())?;
        let mut named: Vec<(String, String)> = Vec::new();
        for (quality, choice) in
            Quality::ALL.iter().filter_map(|q| Some((q.name(), presets.of_quality(*q)?)))
        {
            let setting = choice.preset.setting.name();
            match named.iter_mut().find(|n| n.0 == setting) {
                Some((_, label)) => *label += &format!(", {quality}"),
                None => named.push((setting, quality.to_owned())),
            }
        }
        self.folder.write("plot.svg", plot(&rows, self.error_name(), &named).as_bytes())?;
        let text = serde_json::to_vec_pretty(&presets).unwrap_or_default();
        if let Some(path) = &self.a.presets
            && !presets.front.is_empty()
        {
            pcadlang_report::write_file(path, &text)
                .map_err(|e| plain(format!("{}: {e}", path.display())))?;
        }
        Ok(())
    }

    /// Prints the front, and the presets chosen from it.
    fn show(&self) {
        if self.a.quiet {
            return;
        }
        let rows = self.rows();
        let presets = self.presets(&rows);
        print_line!("the front, error: {}", self.error_name());
        let mut front: Vec<&Row> = rows.iter().filter(|r| r.front).collect();
        front.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        for r in front {
            print_line!(
                "{:>9}  {:.4} ({:.4} to {:.4})  {}",
                seconds(r.seconds),
                r.error,
                r.low,
                r.high,
                r.setting
            );
        }
        for q in Quality::ALL {
            if let Some(c) = presets.of_quality(q) {
                print_line!("{:>9}: {}", q.name(), c.preset.setting.name());
            }
        }
        print_line!("{}", self.a.out.display());
    }

    fn say(&self, text: &str) {
        if !self.a.quiet {
            error_line!("{text}");
        }
    }
}

/// Formats a run in one line.
fn told(run: &RunRecord) -> String {
    let end = match (&run.failed, run.error_at(None)) {
        (Some(failed), _) => format!("failed: {}", failed.lines().next().unwrap_or_default()),
        (None, Some(error)) => format!("{error:.4}"),
        (None, None) => "nothing to score".into(),
    };
    format!("{} on {}: {end}", run.setting, run.case)
}
