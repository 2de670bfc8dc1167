//! One run, from its program to its folder, for `run` and `evaluate`. Only the progress
//! line is printed here.
//!
//! Invariant: `run.json` has the state `done` only when all other files of the folder are
//! complete.

use crate::args::{Job, Live};
use crate::best::{
    disagreement, keep_best, outside, show_best, structure_warning, stuck_warning, whole_mask,
};
use crate::embedded::write_scene;
use crate::failure::{Failure, plain};
use crate::files::write_in;
use crate::inputs;
use crate::inputs::Ready;
use crate::keypoints::{Joints, coco, coco_mask, image_id};
use crate::people;
use crate::places::{best_of_each, show_places};
pub use crate::progress::Interrupt;
use crate::progress::{self, Ending};
use crate::record::{
    counts, identity, record_failure, recorded, write_json, write_record, write_run,
};
use crate::reopening::page::{PagePicture, write_page};
use crate::reopening::reopened::{PROGRAM, TRACES, TRAJECTORY};
use crate::reopening::seen;
use crate::stream::Streamed;
use crate::verdict::{Judgement, Verdict};
use crate::watched::Watched;
use pcadlang_engine::lang::plan::{Plan, Step, StepKind};
use pcadlang_inference::RunOptions;
use pcadlang_inference::draws::{KernelStats, MOST_POINTS, Sink, SiteStats};
use pcadlang_inference::{Callback, Callbacks, ChainResult, Evidence, KeptTraces, Trajectory};
use pcadlang_library::scene::ImageValue;
use pcadlang_library::{Model, Started};
use pcadlang_numerics::platform::threads::both;
use pcadlang_report::{
    ChainDraws, ChainFiles, Memory, Mode, Quantity, RunDir, align, mark_categories, modes,
    quantities, table, widen, zarr,
};
use pcadlang_workbench::bank::BankFiles;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// The results of a run.
pub struct Outcome {
    /// Whether the object of the photograph was found, where the program asks for places.
    pub judged: Option<Judgement>,
    /// Every recorded quantity.
    pub quantities: Vec<Quantity>,
    /// Statistics of the kernels, over all chains.
    pub kernels: Vec<KernelStats>,
    /// Statistics of single-site kernels by address, over all chains.
    pub sites: Vec<SiteStats>,
    /// The modes that the chains are in, if there are several.
    pub modes: Vec<Mode>,
    /// Warnings, for example of quantities that have not converged.
    pub warnings: Vec<String>,
    /// Approximations, apart from floating-point rounding and the finite number of draws.
    pub approximate: Vec<String>,
    /// The chains.
    pub chains: Vec<ChainResult>,
    /// The summary uses every n-th draw; n is 1 unless there are more draws than fit in
    /// memory.
    pub every: u64,
    /// Wall time until everything except the page was written.
    pub seconds: f64,
    /// True if the user interrupted the run.
    pub interrupted: bool,
}

impl Outcome {
    /// Returns the time of all kernels after warm-up, over all chains, in seconds.
    pub fn kernel_seconds(&self) -> f64 {
        self.kernels.iter().map(|k| k.seconds).sum()
    }
}

/// Returns the summary of each quantity, with its effective sample size per second of
/// kernel time.
pub fn summaries(quantities: &[Quantity], seconds: f64) -> Map<String, Value> {
    let one = |q: &Quantity| {
        let mut s = json!(q.summary);
        if let Some(reason) = q.why_no_r_hat() {
            s["r_hat_reason"] = json!(reason);
        }
        if let Some(frequent) = &q.frequent {
            s["most_frequent"] = json!(frequent);
        }
        s["ess_per_second"] = json!(table::per_second(q.summary.ess_bulk, seconds));
        (q.name.clone(), s)
    };
    quantities.iter().map(one).collect()
}

/// Returns the folder of a program.
fn folder(program: &str) -> &Path {
    Path::new(program).parent().unwrap_or(Path::new(""))
}

/// Returns the name of a program without folder and extension; `stdin` for the standard input.
pub fn stem(path: &str) -> &str {
    if path == inputs::STDIN {
        return "stdin";
    }
    Path::new(path).file_stem().and_then(|s| s.to_str()).unwrap_or("run")
}

/// Returns the number of threads of a run.
pub fn threads(job: &Job) -> usize {
    job.sampling.threads.map_or_else(machine_threads, |n| n as usize)
}

/// Returns the number of hardware threads.
pub fn machine_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The file of joints in the photograph.
const KEYPOINTS: &str = "keypoints.json";

/// The default time between checkpoints.
pub const CHECKPOINT: Duration = Duration::from_secs(10);

/// How a run is carried out; its draws do not depend on this.
#[derive(Clone, Debug)]
pub struct RunMode {
    /// True if progress is shown.
    pub live: bool,
    /// The time between checkpoints.
    pub checkpoint: Duration,
    /// True to resume the run in the folder.
    pub resume: bool,
    /// How many complete states are kept.
    pub keep: u32,
    /// Where the best state is sent as it improves.
    pub follow: Option<Live>,
    /// True if draws are printed as they are made.
    pub stream: bool,
}

/// Runs the chains and fills the folder. A failure is recorded in the folder, too.
pub fn perform(
    job: &Job,
    ready: &Ready,
    dir: &RunDir,
    record: &Map<String, Value>,
    interrupt: &Interrupt,
    mode: RunMode,
) -> Result<Outcome, Failure> {
    let watched = Watched::new(job, &ready.model, mode.keep);
    perform_watched(job, ready, dir, record, interrupt, mode, &watched)
}

/// [`perform`] with something to look at meanwhile, made for the same job.
pub fn perform_watched(
    job: &Job,
    ready: &Ready,
    dir: &RunDir,
    record: &Map<String, Value>,
    interrupt: &Interrupt,
    mode: RunMode,
    watched: &Watched,
) -> Result<Outcome, Failure> {
    let source = ("source_hash".to_owned(), json!(ready.model.source_hash()));
    let record = &record.clone().into_iter().chain([source]).collect();
    write_record(dir, record, "running", json!({}))?;
    write_in(dir, PROGRAM, ready.model.text().as_bytes())?;
    let chains = job.sampling.chains();
    let fill = Fill {
        job,
        ready,
        dir,
        record,
        watched,
        joints: Joints::new(chains, ready.size()),
        // A single chain has one mode, which needs no evidence.
        evidence: Arc::new(Evidence::new(if chains > 1 { chains } else { 0 })),
    };
    fill.all(&mode, interrupt).inspect_err(|failure| {
        // An error in writing the record must not hide the first error.
        let _ = record_failure(dir, record, failure, ready.begun.elapsed().as_secs_f64());
    })
}

/// Returns the options of a job's chains.
pub fn options(job: &Job, ready: &Ready, callback: Option<Arc<dyn Callback>>) -> RunOptions {
    let (s, model) = (&job.sampling, &ready.model);
    RunOptions {
        seed: s.seed,
        steps: s.steps,
        warmup: s.warmup,
        // The time left after compilation.
        time: s.time.map(|t| t.saturating_sub(ready.begun.elapsed())),
        search: s.search,
        incremental: !s.no_incremental,
        limits: model.limits().clone(),
        callback,
        banks: Some(Arc::new(BankFiles::new(
            model,
            folder(&job.inputs.program),
            job.features_from.clone(),
        ))),
        sites: true,
        pointwise: true,
        first_chain: 0,
    }
}

/// A run's results, fields of its `run.json`, and pictures for its page.
type Summarised = (Outcome, Map<String, Value>, Vec<PagePicture>);

/// A run and where it is written.
struct Fill<'a> {
    job: &'a Job,
    ready: &'a Ready,
    dir: &'a RunDir,
    record: &'a Map<String, Value>,
    watched: &'a Watched,
    joints: Joints,
    evidence: Arc<Evidence>,
}

impl Fill<'_> {
    /// Runs the chains, and writes what was found.
    fn all(&self, mode: &RunMode, interrupt: &Interrupt) -> Result<Outcome, Failure> {
        if let Some(nobody) = people::nobody(self.job, self.ready)? {
            write_json(self.dir, KEYPOINTS, &json!({ "found": nobody.json() }))?;
            return Err(plain(nobody.text).hint(people::ANYWAY));
        }
        let started = self.sample(mode, interrupt)?;
        let sampled = self.ready.begun.elapsed();
        let interrupted = self.watched.progress.cancelled.load(Ordering::Relaxed);
        let draws = self.draws(&started, interrupted)?;
        let points = started.chains.first().map_or_else(Vec::new, |c| c.last.points(MOST_POINTS));
        let mut step_sizes = vec![None; draws.len()];
        for (c, i) in started.chains.iter().zip(&started.places) {
            step_sizes[*i] = c.kernels.iter().find_map(|k| k.step_size);
        }
        // Small files: writing them is mostly waiting.
        let (written, summarised) = both(
            || self.write_draws(&draws, &step_sizes, &points),
            || self.summarise(started, &draws, interrupted),
        );
        written?;
        let (outcome, more, pictures) = summarised?;
        self.finish(outcome, more, pictures, sampled)
    }

    /// Runs the chains; what is on the disk stays complete meanwhile.
    fn sample(&self, mode: &RunMode, interrupt: &Interrupt) -> Result<Started, Failure> {
        let Fill { job, ready, dir, record, watched, .. } = self;
        let Watched { progress, best, kept, trajectory, memories } = watched;
        let (model, s) = (&ready.model, &job.sampling);
        let callbacks: Vec<Arc<dyn Callback>> = vec![
            Arc::new(self.joints.clone()),
            best.clone(),
            self.evidence.clone(),
            kept.clone(),
            trajectory.clone(),
        ];
        let options = options(job, ready, Some(Arc::new(Callbacks::from_iter(callbacks))));
        if mode.resume {
            let lines = std::fs::read_to_string(dir.file(TRAJECTORY)).unwrap_or_default();
            let states = lines.lines().filter_map(|line| serde_json::from_str(line).ok());
            trajectory.restore(states.collect());
        }
        let sinks = sinks(dir, job, model, memories, record, mode)?;
        let ending = Ending::default();
        interrupt.ends(progress);
        let chains = (s.chains(), "chains");
        let results = std::thread::scope(|scope| {
            scope.spawn(|| progress::watch(progress, chains, &ending, options.time, !mode.live));
            scope.spawn(|| progress::ask_for_checkpoints(progress, &ending, mode.checkpoint));
            scope.spawn(|| keep_best(dir, model, best, &ending, mode.checkpoint));
            scope.spawn(|| keep_states(dir, kept, trajectory, &ending, mode.checkpoint));
            scope.spawn(|| mode.follow.iter().for_each(|l| l.follow(ready, watched, &ending)));
            ending.of(|| model.run_into(&options, threads(job), progress, sinks))
        })?;
        Ok(model.started(results)?)
    }

    /// Returns the draws; chains that were not interrupted end with the same one.
    fn draws(&self, ran: &Started, interrupted: bool) -> Result<Vec<ChainDraws>, Failure> {
        let Fill { dir, watched, .. } = self;
        let mut draws: Vec<ChainDraws> = watched.memories.iter().map(Memory::draws).collect();
        // A run that may be resumed keeps all its draws.
        let mut observed = ran.chains.iter().filter(|c| c.draws > 0).map(|c| &c.observed);
        let same = observed.next().is_none_or(|first| observed.all(|other| other == first));
        let even = align(dir.path(), self.job.sampling.chains(), !interrupted, same)
            .map_err(|e| plain(format!("{}: {e}; its draws are kept", dir.path().display())))?;
        if let Some(even) = even {
            draws.iter_mut().for_each(|d| d.rows.retain(|r| r.draw < even));
        }
        widen(&mut draws);
        if !same {
            draws.iter_mut().for_each(ChainDraws::drop_pointwise);
        }
        Ok(draws)
    }

    /// Writes the states that were kept, and the draws as arrays.
    fn write_draws(
        &self,
        draws: &[ChainDraws],
        step_sizes: &[Option<f64>],
        points: &[(String, f64)],
    ) -> Result<(), Failure> {
        let Fill { dir, watched, .. } = self;
        write_traces(dir, &watched.kept)?;
        write_lines(dir, TRAJECTORY, &watched.trajectory.all())?;
        zarr::write(dir.path(), draws, step_sizes, points).map_err(|e| {
            plain(format!("{}: {e}; earlier output is kept", dir.file(zarr::ZARR).display()))
        })
    }

    /// Summarises the draws, and writes pictures of the best state and of each mode.
    fn summarise(
        &self,
        ran: Started,
        draws: &[ChainDraws],
        interrupted: bool,
    ) -> Result<Summarised, Failure> {
        let Fill { job, ready, dir, watched, .. } = self;
        let Started { chains, mut warnings, .. } = ran;
        let (seed, image) = (job.sampling.seed, &ready.named_image);
        let mut quantities = quantities(draws);
        let last = chains.first().map(|c| &c.last);
        let categories: HashSet<String> =
            last.map_or_else(Vec::new, |s| s.categories()).into_iter().collect();
        mark_categories(&mut quantities, |name| categories.contains(name));
        let kernels = table::merged(chains.iter().map(|c| &c.kernels[..]));
        let modes = modes(&quantities, Some(&self.evidence));
        let places = best_of_each(&modes, &watched.best);
        let best = watched.best.state();
        let drawn = show_best(
            dir,
            seed,
            &ready.model,
            best.as_deref(),
            &chains,
            ready.image(),
            job.full_size,
        )?;
        show_places(dir, seed, &ready.model, &places, ready.image().and_then(ImageValue::shown))?;
        let log_joint = best.as_ref().map_or(f64::NAN, |b| b.log_joint);
        write_scene(dir, seed, ready, (log_joint, &drawn), &watched.kept.all())?;
        let places = ready.image().and_then(ImageValue::known_places);
        let judged = drawn.mask.as_ref().zip(places);
        let judged = judged.and_then(|(mask, all)| Judgement::of(mask, &all, drawn.agreement));
        let judged = judged.or_else(|| people::judged(job, ready, drawn.mask.as_ref()?));
        // Where nothing was found, there is nothing to converge to.
        if judged.as_ref().is_none_or(|j| j.verdict != Verdict::NotFound) {
            warnings.extend(pcadlang_report::warnings(&quantities, &modes, &kernels, chains.len()));
        }
        warnings.extend(people::several(job, ready));
        let named = image.as_ref().map(|(name, _)| name.as_str()).zip(ready.image());
        let sites = SiteStats::total(chains.iter().flat_map(|c| &c.sites));
        warnings.extend(last.and_then(|state| structure_warning(state, &sites)));
        warnings.extend(last.and_then(|state| stuck_warning(state, &sites)));
        let located = last.map_or_else(Vec::new, |state| state.located());
        warnings.extend(seen::warnings(named, job.keypoints.as_deref(), &located));
        if judged.is_none() {
            warnings.extend(disagreement(&drawn));
        }
        warnings.extend(outside(&drawn));
        let seconds = ready.begun.elapsed().as_secs_f64();
        let picture = job.observe.first().map_or("", |o| stem(inputs::file_of(o)));
        let image = image_id(job.coco.image_id, picture);
        // Without a photograph there is nothing that the results could be of.
        let of_picture = ready.size().is_some() || job.coco.image_id.is_some();
        let view = drawn.view.as_ref().filter(|_| of_picture);
        let whole = view.and_then(|v| whole_mask(&v.0, ready.size()));
        if let Some(mask) = &whole {
            let category = job.coco.category_id.unwrap_or(1);
            write_json(dir, "mask.coco.json", &coco_mask(mask, &image, category))?;
        }
        if let Some(found) =
            drawn.view.as_ref().and_then(|v| self.joints.report(v, &modes, seconds))
        {
            let mut said = found.clone();
            if let Some(judged) = &judged {
                said["found"] = judged.json();
            }
            write_json(dir, KEYPOINTS, &said)?;
            if let Some(coco) = coco(&found, &image, whole.as_ref()) {
                write_in(dir, "keypoints.coco.json", coco.to_string().as_bytes())?;
            }
        }
        let mut more = counts(&chains, best.as_deref(), &quantities);
        more.extend(drawn.size.map(|size| ("size".into(), json!(size))));
        more.extend(drawn.metre.map(|metre| ("metre".into(), json!(metre))));
        more.extend(drawn.agreement.map(|a| ("agreement".into(), json!(a))));
        more.extend(judged.as_ref().map(|j| ("found".into(), j.json())));
        let outcome = Outcome {
            judged,
            approximate: approximate(job, &chains),
            every: draws.iter().map(|d| d.every).max().unwrap_or(1),
            quantities,
            kernels,
            sites,
            modes,
            warnings,
            chains,
            seconds,
            interrupted,
        };
        Ok((outcome, more, drawn.pictures))
    }

    /// Writes the summary, the page, and last the record.
    fn finish(
        &self,
        outcome: Outcome,
        mut more: Map<String, Value>,
        pictures: Vec<PagePicture>,
        sampled: Duration,
    ) -> Result<Outcome, Failure> {
        let o = &outcome;
        let summary = json!({
            "quantities": summaries(&o.quantities, o.kernel_seconds()), "kernels": o.kernels,
            "choices": o.sites, "modes": o.modes, "warnings": o.warnings,
            "approximate": o.approximate, "every": o.every,
        });
        let text = serde_json::to_vec_pretty(&summary).unwrap_or_default();
        write_in(self.dir, "summary.json", &text)?;
        more.insert("sampling_seconds".into(), json!(sampled.as_secs_f64()));
        more.insert("seconds".into(), json!(o.seconds));
        let state = if o.interrupted { "interrupted" } else { "done" };
        let run = recorded(self.record, state, Value::Object(more));
        write_page(self.dir, &run, &summary, &o.quantities, pictures)?;
        write_run(self.dir, &run)?;
        Ok(outcome)
    }
}

/// Writes the states kept so far, one per line, at intervals until the chains end.
fn keep_states(
    dir: &RunDir,
    kept: &KeptTraces,
    trajectory: &Trajectory,
    ending: &Ending,
    every: Duration,
) {
    let mut written = 0;
    while !ending.within(every) {
        // Errors are reported at the end of the run.
        let _ = write_traces(dir, kept);
        let count = trajectory.count();
        if count != written {
            written = count;
            let _ = write_lines(dir, TRAJECTORY, &trajectory.all());
        }
    }
}

fn write_traces(dir: &RunDir, kept: &KeptTraces) -> Result<(), Failure> {
    write_lines(dir, TRACES, &kept.all())
}

/// Writes states as JSON, one per line.
fn write_lines(dir: &RunDir, name: &str, states: &[impl Serialize]) -> Result<(), Failure> {
    let lines = states
        .iter()
        .filter_map(|k| serde_json::to_string(k).ok())
        .fold(String::new(), |s, k| s + &k + "\n");
    if lines.is_empty() { Ok(()) } else { write_in(dir, name, lines.as_bytes()) }
}

/// Lists the approximations of a run, in its likelihoods and by its time limit.
fn approximate(job: &Job, chains: &[ChainResult]) -> Vec<String> {
    let mut all = chains.first().map_or_else(Vec::new, |c| c.last.approximations());
    if job.sampling.time.is_some() {
        all.push("the time limit: the number of steps taken depends on the machine".into());
    }
    all
}

/// The sampler of a plan in CmdStan's words: its own where it is one of Stan's, else the names of
/// the kernels that make draws.
fn sampler(plan: &Plan) -> Vec<(&'static str, String)> {
    fn gather<'a>(steps: &'a [Step], all: &mut Vec<&'a str>) {
        for step in steps.iter().filter(|s| !matches!(s.kind, StepKind::Warmup(..))) {
            all.extend(step.calls().filter_map(|c| c.text.split('(').next()));
            gather(step.body(), all);
        }
    }
    let mut kernels = Vec::new();
    gather(&plan.steps, &mut kernels);
    kernels.sort_unstable();
    kernels.dedup();
    let names = kernels.join("+");
    let engine = match names.as_str() {
        "nuts" => "nuts",
        "hmc" => "static",
        // rstan prints `sampler_t`; the name must not be missing.
        _ => {
            let names = if names.is_empty() { "none".into() } else { names };
            return vec![("algorithm", names.clone()), ("sampler_t", names)];
        }
    };
    [("algorithm", "hmc"), ("engine", engine), ("metric", "diag_e")]
        .map(|(key, value)| (key, value.to_owned()))
        .to_vec()
}

/// Returns sinks for each chain: its files, and its draws in memory for the summary.
fn sinks(
    dir: &RunDir,
    job: &Job,
    model: &Model,
    memories: &[Memory],
    record: &Map<String, Value>,
    mode: &RunMode,
) -> Result<Vec<Box<dyn Sink>>, Failure> {
    let run = identity(record);
    let mut comments = vec![
        ("program", job.inputs.program.clone()),
        ("program_hash", model.hash().to_owned()),
        ("seed", job.sampling.seed.to_string()),
    ];
    comments.extend(sampler(&model.plan()?.0));
    let files = ChainFiles { dir, run: &run, comments: &comments };
    let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
    for (i, memory) in memories.iter().enumerate() {
        let chain = match mode.resume {
            true => files.resume(i as u32, memory),
            false => files.begin(i as u32, memory),
        };
        let chain = chain.map_err(|e| plain(format!("{}: {e}", dir.path().display())))?;
        sinks.push(match mode.stream {
            true => Box::new(Streamed::new(chain)),
            false => Box::new(chain),
        });
    }
    Ok(sinks)
}
