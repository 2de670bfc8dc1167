//! One run from its program to its folder, as `run` and `evaluate` do it. Nothing is printed here but the live line.
//!
//! Invariant: `run.json` says `done` only when every other file of the folder is whole.

use super::args::Job;
use super::best::best_draw;
use super::keypoints::Joints;
use super::{Failure, given, plain, progress};
use pcadlang::bank::BankFiles;
use pcadlang::infer::draws::{KernelStats, Sink, SiteStats};
use pcadlang::infer::{ChainResult, Progress};
use pcadlang::report::html::{MeshData, Page, page};
use pcadlang::report::{
    ChainDraws, Memory, Mode, Quantity, RunDir, Tee, csv::CsvSink, modes, quantities, seconds, table,
};
use pcadlang::vision::Photo;
use pcadlang::{Model, RunOptions};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Instant;

/// A program compiled with what it observes.
pub struct Ready {
    /// The program with its data.
    pub model: Model,
    photo: Option<Photo>,
    begun: Instant,
}

/// What a run gave.
pub struct Outcome {
    /// Every recorded quantity.
    pub quantities: Vec<Quantity>,
    /// What the kernels did, over all chains.
    pub kernels: Vec<KernelStats>,
    /// What single-site kernels did, by address, over all chains.
    pub sites: Vec<SiteStats>,
    /// The places that chains stay at, where there are several.
    pub modes: Vec<Mode>,
    /// What has not converged, and the like.
    pub warnings: Vec<String>,
    /// The chains.
    pub chains: Vec<ChainResult>,
    /// Wall time until everything but the page was written.
    pub seconds: f64,
    /// Whether the user ended it.
    pub interrupted: bool,
}

impl Outcome {
    /// The time of all kernels after warm-up, over all chains, in seconds.
    pub fn kernel_seconds(&self) -> f64 {
        kernel_seconds(&self.kernels)
    }
}

fn kernel_seconds(kernels: &[KernelStats]) -> f64 {
    kernels.iter().map(|k| k.seconds).sum()
}

/// The summary of each quantity, with its effective draws in a second of the kernels' time.
pub fn summaries(quantities: &[Quantity], seconds: f64) -> Map<String, Value> {
    let one = |q: &Quantity| {
        let mut s = json!(q.summary);
        s["ess_per_second"] = json!(table::per_second(q.summary.ess_bulk, seconds));
        (q.name.clone(), s)
    };
    quantities.iter().map(one).collect()
}

/// Reads and compiles; the time of a run begins here.
pub fn prepare(job: &Job, quiet: bool) -> Result<Ready, Failure> {
    let begun = Instant::now();
    let (program, photo) = given::observe(given::program(&job.given, quiet)?, job)?;
    Ok(Ready { model: program.compile()?, photo, begun })
}

/// Ctrl-C, for one run after the other.
#[derive(Default)]
pub struct Interrupt {
    asked: AtomicBool,
    run: Mutex<Weak<Progress>>,
}

impl Interrupt {
    /// Listens from now on, until the command ends.
    pub fn listen() -> Arc<Interrupt> {
        let interrupt = Arc::new(Interrupt::default());
        let heard = Arc::clone(&interrupt);
        // If no handler can be set, the system's own stays.
        let _ = ctrlc::set_handler(move || {
            heard.asked.store(true, Ordering::SeqCst);
            heard.pass_on();
        });
        interrupt
    }

    /// Whether the user has asked to end.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Ends this run at its next step when asked, or at once if that was before.
    pub fn ends(&self, run: &Arc<Progress>) {
        *self.run.lock().unwrap_or_else(PoisonError::into_inner) = Arc::downgrade(run);
        if self.asked() {
            self.pass_on();
        }
    }

    fn pass_on(&self) {
        if let Some(run) = self.run.lock().unwrap_or_else(PoisonError::into_inner).upgrade() {
            run.cancelled.store(true, Ordering::Relaxed);
        }
    }
}

/// The folder a program is in.
fn folder(program: &str) -> &Path {
    Path::new(program).parent().unwrap_or(Path::new(""))
}

/// The name of a program without folder and ending.
pub fn stem(path: &str) -> &str {
    Path::new(path).file_stem().and_then(|s| s.to_str()).unwrap_or("run")
}

/// The number of threads of a run.
pub fn threads(job: &Job) -> usize {
    job.sampling.threads.map_or_else(machine_threads, |n| n as usize)
}

/// The number of threads this machine runs at once.
pub fn machine_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// What `run.json` says of a run before it begins: all that its draws depend on.
pub fn record(job: &Job, program_hash: &str) -> Map<String, Value> {
    let s = &job.sampling;
    let record = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "state": "running",
        "program": job.given.program,
        "program_hash": program_hash,
        "seed": s.seed,
        "observe": observed(job).collect::<Vec<_>>(),
        "set": job.given.sets.iter().map(|(k, v)| (k.clone(), json!(v))).collect::<Map<_, _>>(),
        "settings": {
            "chains": s.chains, "steps": s.steps, "warmup": s.warmup,
            "time": s.time.map(|t| t.as_secs_f64()), "incremental": !s.no_incremental,
        },
    });
    match record {
        Value::Object(record) => record,
        _ => Map::new(),
    }
}

/// Writes `run.json`: the record with its state, and more.
pub fn write_record(dir: &RunDir, record: &Map<String, Value>, state: &str, more: Value) -> Result<(), Failure> {
    let mut record = record.clone();
    record.insert("state".into(), json!(state));
    if let Value::Object(more) = more {
        record.extend(more);
    }
    write(dir, "run.json", &serde_json::to_vec_pretty(&record).unwrap_or_default())
}

/// Writes a file of a run.
pub fn write(dir: &RunDir, name: &str, bytes: &[u8]) -> Result<(), Failure> {
    dir.write(name, bytes).map_err(|e| plain(format!("{e}; what was written before is kept")))
}

/// Says in `run.json` that a run failed, and why.
pub fn record_failure(
    dir: &RunDir,
    record: &Map<String, Value>,
    failure: &Failure,
    seconds: f64,
) -> Result<(), Failure> {
    write_record(dir, record, "failed", json!({ "error": failure.to_string(), "seconds": seconds }))
}

/// Runs the chains and fills the folder; `live` shows progress on a terminal. A failure is recorded there too.
pub fn perform(
    job: &Job,
    ready: &Ready,
    dir: &RunDir,
    record: &Map<String, Value>,
    interrupt: &Interrupt,
    live: bool,
) -> Result<Outcome, Failure> {
    write_record(dir, record, "running", json!({}))?;
    fill(job, ready, dir, record, interrupt, live).inspect_err(|failure| {
        // The error that is told is the first one.
        let _ = record_failure(dir, record, failure, ready.begun.elapsed().as_secs_f64());
    })
}

fn fill(
    job: &Job,
    ready: &Ready,
    dir: &RunDir,
    record: &Map<String, Value>,
    interrupt: &Interrupt,
    live: bool,
) -> Result<Outcome, Failure> {
    let Ready { model, photo, begun } = ready;
    let s = &job.sampling;
    let joints = Joints::new(s.chains, photo.as_ref().map(|p| (p.width(), p.height())));
    let options = RunOptions {
        seed: s.seed,
        steps: s.steps,
        warmup: s.warmup,
        // What is left of the time after compiling.
        time: s.time.map(|t| t.saturating_sub(begun.elapsed())),
        incremental: !s.no_incremental,
        watch: Some(Arc::new(joints.clone())),
        banks: Some(Arc::new(BankFiles::new(model, folder(&job.given.program), job.features_from.clone()))),
        sites: true,
        ..RunOptions::default()
    };
    let memories: Vec<Memory> = (0..s.chains).map(|_| Memory::default()).collect();
    let sinks = sinks(dir, job, model, &memories)?;
    let (progress, done) = (Arc::new(Progress::default()), AtomicBool::new(false));
    interrupt.ends(&progress);
    let results = std::thread::scope(|scope| {
        scope.spawn(|| progress::watch(&progress, &done, options.time, !live));
        let results = model.run_into(&options, threads(job), &progress, sinks);
        done.store(true, Ordering::Relaxed);
        results
    })?;
    let interrupted = progress.cancelled.load(Ordering::Relaxed);
    let sampled = begun.elapsed().as_secs_f64();

    let chains = results.into_iter().collect::<Result<Vec<_>, _>>().map_err(|e| model.chain_error(e))?;
    let draws: Vec<ChainDraws> = memories.iter().map(Memory::draws).collect();
    let quantities = quantities(&draws);
    let kernels = table::merged(chains.iter().map(|c| &c.kernels[..]));
    let warnings = table::warnings(&quantities, &kernels, chains.len());
    let modes = modes(&quantities);
    let sites = SiteStats::total(chains.iter().flat_map(|c| &c.sites));
    let summary = json!({
        "quantities": summaries(&quantities, kernel_seconds(&kernels)), "kernels": kernels, "choices": sites,
        "modes": modes, "warnings": warnings,
    });
    write(dir, "summary.json", &serde_json::to_vec_pretty(&summary).unwrap_or_default())?;
    let drawn = best_draw(dir, s.seed, model, &chains, photo.as_ref())?;
    let elapsed = begun.elapsed().as_secs_f64();
    if let Some(found) = drawn.view.as_ref().and_then(|v| joints.report(v, elapsed)) {
        write(dir, "keypoints.json", &serde_json::to_vec_pretty(&found).unwrap_or_default())?;
    }
    let html = page(&Page {
        title: &job.given.program,
        settings: settings(job, model, elapsed),
        pictures: drawn.pictures,
        quantities: &quantities,
        kernels: &kernels,
        warnings: &warnings,
        mesh: drawn.mesh.as_ref().map(|m| MeshData { positions: &drawn.positions, triangles: &m.topology.triangles }),
        program: model.text(),
    });
    write(dir, "report.html", html.as_bytes())?;
    let mut more = counts(&chains, &quantities);
    more.extend([("sampling_seconds".into(), json!(sampled)), ("seconds".into(), json!(elapsed))]);
    write_record(dir, record, if interrupted { "interrupted" } else { "done" }, Value::Object(more))?;
    Ok(Outcome { quantities, kernels, sites, modes, warnings, chains, seconds: elapsed, interrupted })
}

/// What `run.json` says of the chains at the end.
fn counts(chains: &[ChainResult], quantities: &[Quantity]) -> Map<String, Value> {
    let each: Vec<Value> = chains
        .iter()
        .map(|c| json!({ "steps": c.steps, "warmup": c.warmup, "draws": c.draws, "seconds": c.seconds }))
        .collect();
    let best = chains.iter().filter_map(|c| c.best.as_ref().map(|b| b.0)).max_by(f64::total_cmp);
    let r_hat = quantities.iter().map(|q| q.summary.r_hat).filter(|r| !r.is_nan()).max_by(f64::total_cmp);
    let all = [("chains", json!(each)), ("best_log_joint", json!(best)), ("r_hat_max", json!(r_hat))];
    all.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

/// One file of draws a chain, and the draws in memory for the summary.
fn sinks(dir: &RunDir, job: &Job, model: &Model, memories: &[Memory]) -> Result<Vec<Box<dyn Sink>>, Failure> {
    let comments = [
        ("program", job.given.program.clone()),
        ("program_hash", model.hash().to_owned()),
        ("seed", job.sampling.seed.to_string()),
    ];
    let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
    for (i, memory) in memories.iter().enumerate() {
        let path = dir.file(&format!("chain-{}.csv", i + 1));
        let csv = CsvSink::create(&path, i as u32, &comments).map_err(|e| plain(format!("{}: {e}", path.display())))?;
        sinks.push(Box::new(Tee(vec![Box::new(csv), Box::new(memory.clone())])));
    }
    Ok(sinks)
}

/// What is given to observe, as `--observe` has it.
fn observed(job: &Job) -> impl Iterator<Item = String> {
    job.observe.iter().cloned().chain(job.keypoints.iter().map(|k| format!("keypoints={k}")))
}

fn settings(job: &Job, model: &Model, elapsed: f64) -> Vec<(&'static str, String)> {
    let mut all = vec![
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("program hash", model.hash().to_owned()),
        ("seed", job.sampling.seed.to_string()),
        ("chains", job.sampling.chains.to_string()),
        ("time", seconds(elapsed)),
    ];
    all.extend(job.given.sets.iter().map(|(k, v)| ("set", format!("{k} = {v}"))));
    all.extend(observed(job).map(|o| ("observe", o)));
    all
}
