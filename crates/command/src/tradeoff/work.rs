//! One run of one setting on one case, with snapshots while it runs, and its scores.

use super::cases::Case;
use super::running::{Running, RunningSums};
use super::truth::Truth;
use crate::args::{Inputs, Job, QualityArg, Sampling, Tradeoff};
use indexmap::IndexMap;
use pcadlang_inference::draws::Sink;
use pcadlang_inference::{BestSoFar, BestState, Callback, Callbacks, Progress};
use pcadlang_library::scene::ViewValue;
use pcadlang_report::{Memory, Moments, Tee, quantities};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::inputs::{self, Ready};
use pcadlang_runs::job::{self, Interrupt};
use pcadlang_runs::keypoints::Joints;
use pcadlang_runs::progress::Ending;
use pcadlang_runs::scene;
use pcadlang_scene::render::View;
use pcadlang_workbench::score::Surface;
use pcadlang_workbench::tradeoff::{Mark, RunRecord, Setting, marks};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How many numbers are kept of a chain's draws, for effective sample sizes.
const ROOM: usize = 1 << 20;

/// The results of a run at some time.
struct Snapshot {
    at: Option<f64>,
    seconds: f64,
    best: Option<Arc<BestState>>,
    joints: Moments,
    sums: RunningSums,
}

/// The quantities that are monitored while chains run.
struct Watched {
    begun: Instant,
    best: Arc<BestSoFar>,
    joints: Joints,
    running: Vec<Running>,
}

impl Watched {
    fn look(&self, at: Option<f64>) -> Snapshot {
        let mut sums = RunningSums::default();
        self.running.iter().for_each(|r| sums.merge(&r.sums()));
        let seconds = self.begun.elapsed().as_secs_f64();
        Snapshot { at, seconds, best: self.best.state(), joints: self.joints.moments(), sums }
    }
}

/// A run to be done.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// The setting.
    pub setting: &'a Setting,
    /// The case.
    pub case: &'a Case,
    /// The seed.
    pub seed: u64,
}

/// Runs a task on a number of threads. A program that fails gives a record with the
/// message; an interrupted run gives `None`.
pub fn run(a: &Tradeoff, task: Task, threads: u32, interrupt: &Interrupt) -> Option<RunRecord> {
    let Task { setting, case, seed } = task;
    let record = RunRecord {
        setting: setting.name(),
        case: case.name.clone(),
        seed,
        ..RunRecord::default()
    };
    match measure(a, task, threads, interrupt, record.clone()) {
        _ if interrupt.asked() => None,
        Ok(record) => Some(record),
        Err(failure) => {
            let said = failure.to_string();
            Some(RunRecord {
                failed: Some(said.trim_start_matches("error: ").to_owned()),
                ..record
            })
        }
    }
}

/// Returns the equivalent arguments of `pcadlang run`.
fn job(a: &Tradeoff, Task { setting, case, seed }: Task, threads: u32) -> Job {
    let set = setting.set.iter().map(|(k, v)| (k.clone(), v.clone()));
    let inputs = Inputs {
        program: setting.program.clone().unwrap_or_else(|| a.inputs.program.clone()),
        sets: a.inputs.sets.iter().cloned().chain(set).collect(),
        camera: case.camera.clone(),
        edges: a.inputs.edges.clone(),
        who: a.inputs.who.clone(),
        allowed: a.inputs.allowed.clone(),
        hint: Default::default(),
    };
    let sampling = Sampling {
        seed,
        chains: setting.chains,
        quality: Some(QualityArg::Own),
        threads: Some(threads),
        steps: setting.steps,
        warmup: setting.warmup,
        time: setting.time.map(Duration::from_secs_f64),
        search: Default::default(),
        no_incremental: false,
    };
    Job { observe: case.observe.clone(), ..Job::of(inputs, sampling) }
}

fn measure(
    a: &Tradeoff,
    task: Task,
    threads: u32,
    interrupt: &Interrupt,
    mut record: RunRecord,
) -> Result<RunRecord, Failure> {
    let job = job(a, task, threads);
    let begun = Instant::now();
    let ready = inputs::prepare(&job, true)?;
    let chains = job.sampling.chains();
    let progress = Arc::new(Progress::default());
    let watched = Watched {
        begun,
        best: Arc::new(BestSoFar::new(chains, &progress)),
        joints: Joints::new(chains, ready.size()),
        running: (0..chains).map(|_| Running::default()).collect(),
    };
    let mut callbacks: Vec<Arc<dyn Callback>> = vec![watched.best.clone()];
    if matches!(task.case.truth, Truth::Joints(_)) {
        callbacks.push(Arc::new(watched.joints.clone()));
    }
    let options = job::options(&job, &ready, Some(Arc::new(Callbacks::from_iter(callbacks))));
    let memories: Vec<Memory> = (0..chains).map(|_| Memory::bounded(ROOM)).collect();
    let sink = |(r, m): (&Running, &Memory)| -> Box<dyn Sink> {
        Box::new(Tee(vec![Box::new(r.clone()), Box::new(m.clone())]))
    };
    let sinks = watched.running.iter().zip(&memories).map(sink).collect();
    interrupt.ends(&progress);
    let (ending, times) = (Ending::default(), marks(task.setting.time));
    let (results, mut snapshots) = std::thread::scope(|scope| {
        let looking = scope.spawn(|| {
            let ahead = |t: f64| Duration::from_secs_f64(t).saturating_sub(begun.elapsed());
            let looks = times
                .iter()
                .map_while(|&t| (!ending.within(ahead(t))).then(|| watched.look(Some(t))));
            looks.collect::<Vec<_>>()
        });
        let results =
            ending.of(|| ready.model.run_into(&options, threads as usize, &progress, sinks));
        (results, looking.join().unwrap_or_default())
    });
    snapshots.push(watched.look(None));
    let chains = ready.model.started(results?)?.chains;
    record.steps = chains.iter().map(|c| c.steps + c.warmup).sum();
    if let Truth::Posterior(reference) = &task.case.truth {
        let found = snapshots.last().map(|s| s.sums.normals()).unwrap_or_default();
        if let Some(name) =
            reference.quantities.keys().find(|name| !found.is_empty() && !found.contains_key(*name))
        {
            return Err(plain(format!(
                "the reference has `{name}`, which the program does not collect"
            )));
        }
        let draws: Vec<_> = memories.iter().map(Memory::draws).collect();
        let of =
            quantities(&draws).into_iter().filter(|q| reference.quantities.contains_key(&q.name));
        let smallest =
            of.map(|q| q.summary.ess_bulk).filter(|e| e.is_finite()).min_by(f64::total_cmp);
        let seconds = snapshots.last().map_or(f64::NAN, |s| s.seconds);
        record.ess_per_second = smallest.map(|ess| ess / seconds);
    }
    for s in &snapshots {
        record.scores = scores(&task.case.truth, &ready, s, &watched.joints);
        let error = record.scores.get("error").copied();
        record.marks.push(Mark { at: s.at, seconds: s.seconds, error });
    }
    Ok(record)
}

/// Computes all finite scores of a snapshot, `error` first.
fn scores(truth: &Truth, ready: &Ready, s: &Snapshot, joints: &Joints) -> IndexMap<String, f64> {
    let all: Vec<(&str, f64)> = match truth {
        Truth::Surface(truth) => {
            let found = best_view(ready, s).map(|view| {
                let frame = view.frame(
                    ready
                        .size()
                        .map_or(view.camera().width.max(view.camera().height), |(w, h)| w.max(h)),
                );
                Surface {
                    width: frame.width as usize,
                    depth: frame.depth.clone(),
                    normal: frame.normal.clone(),
                }
            });
            let e = truth.error(found.as_ref());
            vec![
                ("error", e.z_mae_u),
                ("z_mae", e.z_mae),
                ("n_mse", e.n_mse),
                ("n_mse_u", e.n_mse_u),
                ("iou", e.iou),
            ]
        }
        Truth::Joints(truth) => {
            let mut found: IndexMap<String, [f64; 2]> = s
                .joints
                .iter()
                .filter_map(|(name, p)| Some((name.to_owned(), *p.mean.first_chunk()?)))
                .collect();
            // Before the first draw, the best state is scored.
            if let Some(view) = best_view(ready, s).filter(|_| found.is_empty()) {
                let at = joints.positions(&ViewValue(view)).into_iter();
                found = at.filter_map(|(name, at)| Some((name.to_string(), at?))).collect();
            }
            let e = truth.error(&found);
            let share = e.missed as f64 / e.labelled.max(1) as f64;
            vec![
                ("error", share),
                ("pixels", e.pixels),
                ("joints", e.labelled as f64),
                ("missed", e.missed as f64),
            ]
        }
        Truth::Posterior(truth) => vec![("error", truth.error(&s.sums.normals()))],
    };
    all.into_iter().filter(|(_, x)| x.is_finite()).map(|(k, x)| (k.to_owned(), x)).collect()
}

/// Returns the view of the best state.
fn best_view(ready: &Ready, s: &Snapshot) -> Option<Arc<View>> {
    let best = s.best.as_ref()?;
    let draws = scene::predictive(1, 0);
    let mut trace = scene::rebuilt(&ready.model, &best.choices, draws).ok()?;
    scene::view(&mut trace, draws, None)
}
