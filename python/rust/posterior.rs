//! The draws of a run, its best state and its modes.

use crate::errors::plain;
use crate::model::Compiled;
use crate::trace::Trace;
use crate::values::json;
use numpy::{PyArray1, PyArrayMethods};
use pcadlang_engine::trace::Draws;
use pcadlang_inference::draws::{MOST_POINTS, SiteStats};
use pcadlang_inference::{BestState, ChainResult, Evidence};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::inference::{Group, Numbers, groups};
use pcadlang_report::{ChainDraws, Mode, Quantity, modes, quantities, table, warnings, widen};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, PoisonError};

/// What a run leaves.
pub struct Gathered {
    pub compiled: Arc<Compiled>,
    pub chains: Vec<ChainResult>,
    /// Sentences on the starts of chains.
    pub warnings: Vec<String>,
    pub draws: Vec<ChainDraws>,
    pub best: Option<Arc<BestState>>,
    /// None if it cannot be told whose it is.
    pub evidence: Option<Arc<Evidence>>,
    pub seed: u64,
    pub seconds: f64,
    pub interrupted: bool,
}

/// The results of `Model.sample`.
#[pyclass(frozen, module = "pcadlang")]
pub struct Posterior {
    compiled: Arc<Compiled>,
    chains: Mutex<Vec<ChainResult>>,
    of_starts: Vec<String>,
    groups: Vec<Group>,
    quantities: Vec<Quantity>,
    modes: Vec<Mode>,
    best: Option<Arc<BestState>>,
    seed: u64,
    seconds: f64,
    interrupted: bool,
    every: u64,
}

impl Posterior {
    pub fn new(g: Gathered) -> Posterior {
        let mut draws = g.draws;
        // Under a time limit some chains are longer: as in the files of the command, all are cut
        // to the length of the shortest.
        let lengths: Vec<usize> = draws.iter().map(|d| d.rows.len()).collect();
        let even = match g.interrupted {
            true => longest(&lengths),
            false => lengths.iter().copied().min().unwrap_or(0),
        };
        let mut step_sizes: Vec<Option<f64>> =
            g.chains.iter().map(|c| c.kernels.iter().find_map(|k| k.step_size)).collect();
        let mut kept = lengths.iter().map(|n| *n >= even);
        step_sizes.retain(|_| kept.next().unwrap_or(false));
        draws.retain(|d| d.rows.len() >= even);
        // With chains left out, places are no numbers of chains any more.
        let evidence = g.evidence.filter(|_| draws.len() == lengths.len());
        draws.iter_mut().for_each(|d| d.rows.truncate(even));
        widen(&mut draws);
        let points = g.chains.first().map_or_else(Vec::new, |c| c.last.points(MOST_POINTS));
        let quantities = quantities(&draws);
        Posterior {
            groups: groups(&draws, &step_sizes, &points),
            modes: modes(&quantities, evidence.as_deref()),
            every: draws.iter().map(|d| d.every).max().unwrap_or(1),
            quantities,
            compiled: g.compiled,
            chains: Mutex::new(g.chains),
            of_starts: g.warnings,
            best: g.best,
            seed: g.seed,
            seconds: g.seconds,
            interrupted: g.interrupted,
        }
    }

    /// The chains. The lock is held briefly, and never while Python runs.
    fn with_chains<T>(&self, read: impl FnOnce(&[ChainResult]) -> T) -> T {
        read(&self.chains.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[pymethods]
impl Posterior {
    /// The groups of ArviZ's format: for each, the arrays by name, as pairs of the names of their
    /// dimensions and their numbers. `posterior`, `sample_stats` and, with observations,
    /// `log_likelihood` and `observed_data`.
    fn groups<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for group in &self.groups {
            let arrays = PyDict::new(py);
            for a in &group.arrays {
                let dims: Vec<&str> = a.dims.iter().map(|(name, _)| name.as_str()).collect();
                arrays.set_item(&a.name, (dims, numbers(py, a)?))?;
            }
            all.set_item(&group.name, arrays)?;
        }
        Ok(all)
    }

    /// The names of the recorded quantities.
    #[getter]
    fn names(&self) -> Vec<&str> {
        let posterior = self.groups.first().map_or(&[][..], |g| &g.arrays[..]);
        posterior.iter().filter(|a| a.dims.len() > 1).map(|a| a.name.as_str()).collect()
    }

    /// The draws of a quantity: an array of chains x draws, and its own dimension if it is a
    /// vector.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let found = self.groups.first().and_then(|g| g.arrays.iter().find(|a| a.name == name));
        match found {
            Some(a) => numbers(py, a),
            None => {
                let known = self.names().join(", ");
                Err(PyKeyError::new_err(format!(
                    "no quantity {name:?} was recorded; there are: {known}"
                )))
            }
        }
    }

    fn __contains__(&self, name: &str) -> bool {
        self.names().contains(&name)
    }

    /// The summary of each scalar quantity: mean, sd, quantiles, Monte Carlo errors, effective
    /// sample sizes and R-hat, as ArviZ computes them. Elements of vectors are named `name[i]`.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let all = self.quantities.iter();
        let all = all.map(|q| (q.name.clone(), serde_json::json!(q.summary))).collect();
        json(py, &serde_json::Value::Object(all))
    }

    /// What the kernels did over all chains: proposals, acceptances, time.
    #[getter]
    fn kernels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let merged = self.with_chains(|all| table::merged(all.iter().map(|c| &c.kernels[..])));
        json(py, &serde_json::json!(merged))
    }

    /// What single-site kernels did over all chains, by address.
    #[getter]
    fn sites<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let total = self.with_chains(|all| SiteStats::total(all.iter().flat_map(|c| &c.sites)));
        json(py, &serde_json::json!(total))
    }

    /// The modes that the chains are in, the most probable first; empty if they agree.
    #[getter]
    fn modes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json(py, &serde_json::json!(self.modes))
    }

    /// Warnings, for example of quantities that have not converged.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.with_chains(|all| {
            let kernels = table::merged(all.iter().map(|c| &c.kernels[..]));
            let more = warnings(&self.quantities, &self.modes, &kernels, all.len());
            self.of_starts.iter().cloned().chain(more).collect()
        })
    }

    /// What is approximate about the posterior: settings of the likelihoods, a time limit.
    #[getter]
    fn approximations(&self) -> Vec<String> {
        self.with_chains(|all| all.first().map_or_else(Vec::new, |c| c.last.approximations()))
    }

    /// The state with the highest log joint density of all chains.
    #[getter]
    fn best(&self, py: Python<'_>) -> PyResult<Trace> {
        let Some(best) = &self.best else { return Err(plain("the run made no step")) };
        let trace = py.detach(|| self.compiled.rebuilt(best, self.seed))?;
        Ok(Trace::new(trace, &self.compiled, self.seed))
    }

    /// The last state of each chain.
    #[getter]
    fn last(&self) -> Vec<Trace> {
        self.with_chains(|all| {
            all.iter().map(|c| Trace::new(c.last.clone(), &self.compiled, self.seed)).collect()
        })
    }

    /// The seed.
    #[getter]
    fn seed(&self) -> u64 {
        self.seed
    }

    /// Wall time, in seconds.
    #[getter]
    fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Whether Ctrl-C ended the run early.
    #[getter]
    fn interrupted(&self) -> bool {
        self.interrupted
    }

    /// Every n-th draw is kept; n is 1 unless there are more than fit in memory.
    #[getter]
    fn every(&self) -> u64 {
        self.every
    }

    fn __repr__(&self) -> String {
        let arrays = self.groups.first().map_or(&[][..], |g| &g.arrays[..]);
        let dims = arrays.iter().map(|a| &a.dims).find(|d| d.len() > 1);
        let size = |i: usize| dims.and_then(|d| d.get(i)).map_or(0, |(_, n)| *n);
        let count = self.names().len();
        format!(
            "<pcadlang.Posterior: {} chains x {} draws of {count} quantities>",
            size(0),
            size(1)
        )
    }
}

/// The length to which the chains of an interrupted run are cut: some may hardly have begun, so
/// shorter ones are left out where more draws are kept that way.
fn longest(lengths: &[usize]) -> usize {
    let kept = |n: &usize| lengths.iter().filter(|l| *l >= n).count() * n;
    lengths.iter().copied().max_by_key(|n| (kept(n), std::cmp::Reverse(*n))).unwrap_or(0)
}

/// The random numbers of values that no observation depends on, as the command draws them.
pub fn predictive(seed: u64) -> Draws {
    Draws { key: StreamKey::new(seed, u32::MAX, Purpose::PREDICT), step: 0, substream: 0 }
}

fn numbers<'py>(
    py: Python<'py>,
    array: &pcadlang_report::inference::Array,
) -> PyResult<Bound<'py, PyAny>> {
    let shape: Vec<usize> = array.dims.iter().map(|(_, n)| *n).collect();
    Ok(match &array.numbers {
        Numbers::Floats(xs) => PyArray1::from_slice(py, xs).reshape(shape)?.into_any(),
        Numbers::Integers(xs) => PyArray1::from_slice(py, xs).reshape(shape)?.into_any(),
        Numbers::Truths(xs) => PyArray1::from_slice(py, xs).reshape(shape)?.into_any(),
        Numbers::Texts(xs) => py.import("numpy")?.call_method1("array", (xs.clone(),))?,
    })
}
