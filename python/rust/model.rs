//! Compiled programs.

use crate::errors::{plain, raised};
use crate::posterior::{Posterior, predictive};
use crate::python_code::Failure;
use crate::sampling::{ProgressCallback, Run};
use crate::trace::Trace;
use crate::values::datum;
use crate::waiting::wait;
use pcadlang::{RunOptions, Value};
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::trace;
use pcadlang_engine::trace::{Address, Constraint, Draws, SavedTrace};
use pcadlang_inference::draws::Discard;
use pcadlang_inference::host::Datum;
use pcadlang_inference::{BestState, ChainResult, Progress, run_chains, run_from};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;
use std::time::Duration;

/// A model and the program it was compiled from.
pub struct Compiled {
    pub model: pcadlang::Model,
    pub program: pcadlang::Program,
    /// Where the hosts of the program keep the exceptions of their Python code.
    pub failures: Vec<Arc<Failure>>,
}

/// A compiled program with its data. It does not change, and threads may share it.
#[pyclass(frozen, module = "pcadlang")]
pub struct Model(pub Arc<Compiled>);

impl Model {
    pub fn new(program: pcadlang::Program, failures: Vec<Arc<Failure>>) -> PyResult<Model> {
        let model = program.clone().compile().map_err(|e| caused(&failures, e))?;
        Ok(Model(Arc::new(Compiled { model, program, failures })))
    }
}

/// An error, caused by the exception of a host's code if there is one.
fn caused(failures: &[Arc<Failure>], e: pcadlang::Error) -> PyErr {
    let error = raised(e);
    if let Some(cause) = failures.iter().find_map(|f| f.take()) {
        Python::attach(|py| error.set_cause(py, Some(cause)));
    }
    error
}

impl Compiled {
    /// Converts an error of the program.
    pub fn raised(&self, e: pcadlang::Error) -> PyErr {
        caused(&self.failures, e)
    }

    /// Whether a host's code raised an exception that nobody has seen.
    pub fn has_failed(&self) -> bool {
        self.failures.iter().any(|f| f.is_some())
    }

    /// The exception that a host's code raised where the engine has no place for one.
    ///
    /// # Errors
    /// That exception.
    pub fn check(&self) -> PyResult<()> {
        self.failures.iter().find_map(|f| f.take()).map_or(Ok(()), Err)
    }

    /// Builds a state that a run kept. The caller must not hold the interpreter's lock.
    ///
    /// # Errors
    /// Those of the program and of its hosts.
    pub fn rebuilt(&self, kept: &BestState, seed: u64) -> PyResult<trace::Trace> {
        let (code, limits) = (Arc::clone(self.model.code()), self.model.limits().clone());
        let choices = kept.choices.iter().cloned();
        let built = trace::Trace::generate(code, choices, predictive(seed), limits);
        built.map(|(trace, _)| trace).map_err(|e| self.raised(self.model.run_error(*e)))
    }

    /// Applies kernels to a state, with the seed and the number of a chain. The caller must not
    /// hold the interpreter's lock.
    ///
    /// # Errors
    /// Those of the kernels as written, of the program and of its hosts.
    pub fn applied(
        &self,
        from: &trace::Trace,
        kernels: &str,
        times: u64,
        (seed, chain): (u64, u32),
    ) -> PyResult<ChainResult> {
        let block = format!("infer {{ repeat {times} {{\n{kernels}\n}} }}");
        let model = self.program.and("<kernels>", &block).and_then(pcadlang::Program::compile);
        let model = model.map_err(|e| self.raised(e))?;
        let plan = model.last_plan().ok_or_else(|| plain("this is no kernel"))?;
        let observed: Vec<(u64, Value)> =
            from.observed().into_iter().map(|o| (o.hash, o.value)).collect();
        // The kernels belong to a program with one more block, the state to the one without.
        let moved = |code: &Arc<Code>, state: &trace::Trace| {
            let (code, limits) = (Arc::clone(code), self.model.limits().clone());
            let mut there =
                trace::Trace::generate(code, state.constraints(), Draws::default(), limits)?.0;
            there.set_observed(&observed)?;
            there.commit();
            Ok(there)
        };
        let failed = |e: Box<RunError>| self.raised(model.run_error(*e));
        let there = moved(model.code(), from).map_err(failed)?;
        let limits = self.model.limits().clone();
        let options = RunOptions { seed, limits, ..RunOptions::default() };
        let progress = Progress::default();
        let run = || run_from(model.code(), &plan, &options, &progress, &mut Discard, chain, there);
        let (done, _) = wait(self, &progress, |_| Ok(()), run)?;
        let mut done = done.map_err(|e| self.raised(model.chain_error(e)))?;
        self.check()?;
        done.last = moved(from.code(), &done.last).map_err(failed)?;
        Ok(done)
    }

    /// Runs chains by the program's own plan, or by another one written as in a program.
    pub fn run(
        &self,
        plan: Option<&str>,
        options: &RunOptions,
        threads: usize,
        progress: &Progress,
        sinks: Vec<Box<dyn pcadlang_inference::draws::Sink>>,
    ) -> Result<Vec<Result<ChainResult, pcadlang_inference::ChainError>>, pcadlang::Error> {
        let Some(plan) = plan else {
            return self.model.run_into(options, threads, progress, sinks);
        };
        let model = self.program.and("<plan>", plan)?.compile()?;
        let Some(plan) = model.last_plan() else {
            return self.model.run_into(options, threads, progress, sinks);
        };
        Ok(run_chains(model.code(), &plan, options, threads, progress, sinks))
    }
}

#[pymethods]
impl Model {
    /// Draws a trace from the prior. The same seed and index give the same trace.
    #[pyo3(signature = (*, seed = 0, index = 0))]
    fn simulate(&self, py: Python<'_>, seed: u64, index: u64) -> PyResult<Trace> {
        let trace = py.detach(|| self.0.model.simulate(seed, index));
        let trace = trace.map_err(|e| self.0.raised(e))?;
        self.0.check()?;
        Ok(Trace::new(trace, &self.0, seed))
    }

    /// Runs the program with the values of some choices given by address, and draws the rest.
    /// Returns the trace and its log importance weight.
    #[pyo3(signature = (choices, *, seed = 0, index = 0))]
    fn generate(
        &self,
        py: Python<'_>,
        choices: &Bound<'_, PyDict>,
        seed: u64,
        index: u64,
    ) -> PyResult<(Trace, f64)> {
        let mut given: Vec<(Address, Datum)> = Vec::new();
        for (address, value) in choices.iter() {
            given.push((address_of(&address.extract::<String>()?)?, datum(&value)?));
        }
        let draws =
            Draws { key: StreamKey::new(seed, 0, Purpose::START), step: index, substream: 0 };
        let constraints: Vec<(u64, Constraint)> =
            given.iter().map(|(a, d)| (a.hash64(), Constraint::Value(d.clone()))).collect();
        let model = &self.0.model;
        let (trace, weight) = py
            .detach(|| {
                let (code, limits) = (Arc::clone(model.code()), model.limits().clone());
                trace::Trace::generate(code, constraints, draws, limits)
                    .map_err(|e| model.run_error(*e))
            })
            .map_err(|e| self.0.raised(e))?;
        self.0.check()?;
        if let Some((a, _)) = given.iter().find(|(a, _)| trace.find(a).is_none()) {
            // The message names the nearest address.
            let wrong = trace.get(&a.to_string()).err().map(|e| self.0.raised(model.run_error(*e)));
            return Err(wrong.unwrap_or_else(|| plain(format!("{a} is no choice"))));
        }
        Ok((Trace::new(trace, &self.0, seed), weight.log_weight))
    }

    /// Loads a trace from the text that `Trace.save` returned.
    #[pyo3(signature = (text, *, seed = 0))]
    fn load(&self, py: Python<'_>, text: &str, seed: u64) -> PyResult<Trace> {
        let saved: SavedTrace =
            serde_json::from_str(text).map_err(|e| plain(format!("not a saved trace: {e}")))?;
        let model = &self.0.model;
        let loaded = py.detach(|| {
            let code = Arc::clone(model.code());
            trace::Trace::load(code, model.hash(), &saved, model.limits().clone())
        });
        Ok(Trace::new(loaded.map_err(plain)?, &self.0, seed))
    }

    /// Runs chains and returns their draws.
    ///
    /// The draws depend on the seed and the steps alone, and are those of the command, bit for bit.
    /// `time` in seconds ends a run early; `plan` is an `infer` block in place of the program's
    /// own. Chains are numbered from `first_chain`: one with the same seed and number has the same
    /// draws in any run. `progress` is called about ten times a second with a dictionary of counts,
    /// and every `live` seconds the best state so far in it as `best`. Ctrl-C ends the run and
    /// keeps the draws.
    #[pyo3(signature = (*, chains = 4, steps = None, warmup = None, time = None, seed = 0, first_chain = 0, threads = None, plan = None, progress = None, live = None))]
    #[allow(clippy::too_many_arguments)] // They are the keywords of one Python function.
    fn sample(
        &self,
        py: Python<'_>,
        chains: u32,
        steps: Option<u64>,
        warmup: Option<u64>,
        time: Option<f64>,
        seed: u64,
        first_chain: u32,
        threads: Option<usize>,
        plan: Option<String>,
        progress: Option<Py<PyAny>>,
        live: Option<f64>,
    ) -> PyResult<Posterior> {
        if chains == 0 {
            return Err(PyValueError::new_err("at least one chain is needed"));
        }
        if first_chain.checked_add(chains).is_none() {
            return Err(PyValueError::new_err("chains are numbered below 2^32"));
        }
        let (time, live) = (seconds("time", time)?, seconds("live", live)?);
        let machine = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or_else(machine).max(1);
        let compiled = Arc::clone(&self.0);
        let run = Run { compiled, chains, steps, warmup, time, seed, first_chain, threads, plan };
        let told = progress.map(|call| ProgressCallback { call, live });
        py.detach(|| run.watched(told.as_ref()))
    }

    /// The text of the main file.
    #[getter]
    fn text(&self) -> &str {
        self.0.model.text()
    }

    /// A hash of the program's text and settings, and of the data it reads itself.
    #[getter]
    fn hash(&self) -> &str {
        self.0.model.hash()
    }

    /// The text of the default plan; None if the program has an `infer` block.
    #[getter]
    fn default_plan(&self, py: Python<'_>) -> PyResult<Option<String>> {
        py.detach(|| self.0.model.plan()).map(|(_, text)| text).map_err(|e| self.0.raised(e))
    }

    fn __repr__(&self) -> String {
        format!("<pcadlang.Model of {:?}>", self.0.program.name())
    }
}

/// Reads an address, with or without its `@`.
///
/// # Errors
/// If it is none.
pub fn address_of(text: &str) -> PyResult<Address> {
    let whole = if text.starts_with('@') { text.to_owned() } else { format!("@{text}") };
    whole.parse().map_err(|e| plain(format!("{text:?}: {e}")))
}

fn seconds(name: &str, given: Option<f64>) -> PyResult<Option<Duration>> {
    let read = given.map(Duration::try_from_secs_f64).transpose();
    read.map_err(|_| PyValueError::new_err(format!("{name} is a positive number of seconds")))
}
