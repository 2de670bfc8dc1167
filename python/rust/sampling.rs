//! Runs of chains.

use crate::model::Compiled;
use crate::posterior::{Gathered, Posterior};
use crate::trace::Trace;
use crate::waiting::{PAUSE, wait};
use pcadlang::RunOptions;
use pcadlang_inference::draws::Sink;
use pcadlang_inference::{BestSoFar, Callback, Callbacks, Evidence, Progress};
use pcadlang_report::Memory;
use pcadlang_workbench::bank::BankFiles;
use pyo3::prelude::*;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// How many numbers are kept in memory over all chains, as by the command: 32 MiB.
const ROOM: usize = 4 << 20;

/// Who is told how far a run is.
pub struct ProgressCallback {
    /// The function of Python.
    pub call: Py<PyAny>,
    /// How often it also gets the best state so far.
    pub live: Option<Duration>,
}

/// What is run.
pub struct Run {
    pub compiled: Arc<Compiled>,
    pub chains: u32,
    pub steps: Option<u64>,
    pub warmup: Option<u64>,
    pub time: Option<Duration>,
    pub seed: u64,
    pub first_chain: u32,
    pub threads: usize,
    pub plan: Option<String>,
}

impl Run {
    /// Runs the chains, and tells a function of Python how far they are. The caller must not hold
    /// the interpreter's lock.
    ///
    /// # Errors
    /// Those of the program, of its hosts, and of the function.
    pub fn watched(&self, told: Option<&ProgressCallback>) -> PyResult<Posterior> {
        let model = &self.compiled.model;
        let (begun, progress) = (Instant::now(), Arc::new(Progress::default()));
        let best = Arc::new(BestSoFar::new(self.first_chain + self.chains, &progress));
        // A single chain has one mode, which needs no evidence.
        let evidence = Arc::new(Evidence::new(if self.chains > 1 {
            self.first_chain + self.chains
        } else {
            0
        }));
        let callbacks: Vec<Arc<dyn Callback>> = vec![best.clone(), evidence.clone()];
        let folder = Path::new(self.compiled.program.name()).parent().unwrap_or(Path::new(""));
        let options = RunOptions {
            seed: self.seed,
            steps: self.steps,
            warmup: self.warmup,
            time: self.time,
            limits: model.limits().clone(),
            callback: Some(Arc::new(Callbacks::from_iter(callbacks))),
            banks: Some(Arc::new(BankFiles::new(model, folder, None))),
            sites: true,
            pointwise: true,
            first_chain: self.first_chain,
            ..RunOptions::default()
        };
        let room = ROOM / self.chains as usize;
        let memories: Vec<Memory> = (0..self.chains).map(|_| Memory::bounded(room)).collect();
        let sinks = memories.iter().map(|m| Box::new(m.clone()) as Box<dyn Sink>).collect();
        let (mut told_at, mut drawn_at) = (begun, begun);
        let look = |py: Python<'_>| {
            let Some(told) = told.filter(|_| told_at.elapsed() >= 5 * PAUSE) else { return Ok(()) };
            told_at = Instant::now();
            let counts = self.counts(py, &progress, begun)?;
            if told.live.is_some_and(|every| drawn_at.elapsed() >= every)
                && let Some(best) = best.state()
            {
                let state = py.detach(|| self.compiled.rebuilt(&best, self.seed))?;
                counts.set_item("best", Trace::new(state, &self.compiled, self.seed))?;
                drawn_at = Instant::now();
            }
            told.call.call1(py, (counts,)).map(|_| ())
        };
        let run =
            || self.compiled.run(self.plan.as_deref(), &options, self.threads, &progress, sinks);
        let (results, interrupted) = wait(&self.compiled, &progress, look, run)?;
        let results = results.map_err(|e| self.compiled.raised(e));
        let started = model.started(results?).map_err(|e| self.compiled.raised(e))?;
        self.compiled.check()?;
        // Evidence is kept by the number of a chain, and modes ask by its place among all.
        let counted = self.first_chain == 0 && started.places.len() == memories.len();
        Ok(Posterior::new(Gathered {
            compiled: Arc::clone(&self.compiled),
            chains: started.chains,
            warnings: started.warnings,
            draws: started.places.iter().map(|i| memories[*i].draws()).collect(),
            best: best.state(),
            evidence: counted.then_some(evidence),
            seed: self.seed,
            seconds: begun.elapsed().as_secs_f64(),
            interrupted,
        }))
    }

    fn counts<'py>(
        &self,
        py: Python<'py>,
        progress: &Progress,
        begun: Instant,
    ) -> PyResult<Bound<'py, PyAny>> {
        let best = f64::from_bits(progress.best.load(Ordering::Relaxed));
        let started = progress.started.load(Ordering::Relaxed);
        let counts = serde_json::json!({
            "chains": self.chains,
            "steps": progress.steps.load(Ordering::Relaxed),
            "started": started,
            "warming": progress.warming.load(Ordering::Relaxed),
            "ended": progress.ended.load(Ordering::Relaxed),
            "pass": progress.pass.load(Ordering::Relaxed),
            "passes": progress.passes.load(Ordering::Relaxed),
            "best_log_joint": (started > 0 && best.is_finite()).then_some(best),
            "seconds": begun.elapsed().as_secs_f64(),
        });
        crate::values::json(py, &counts)
    }
}
