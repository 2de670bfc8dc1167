//! Traces: one execution of a program, with its choices by address.

use crate::errors::plain;
use crate::model::{Compiled, address_of};
use crate::posterior::predictive;
use crate::scene::View;
use crate::values::{datum, from_python, numbers, to_python};
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::trace;
use pcadlang_engine::trace::{Address, Change, Draws, Given, Target};
use pcadlang_inference::StepContext;
use pcadlang_library::scene::ImageValue;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_workbench::session::{self, observed_image};
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// One execution of a program: its choices by address (such as `@pose[arm_l]/bone`; the `@` may be
/// left out), and all that is computed from them.
///
/// A change costs what depends on it. `trace[address] = value` and `update` commit at once;
/// `propose` and `regenerate` leave the change pending until `commit` or `rollback`. A trace is for
/// one thread at a time; `fork` gives another one its own.
#[pyclass(module = "pcadlang")]
pub struct Trace {
    /// None while a kernel's step has ended that lent it to Python.
    trace: Option<trace::Trace>,
    compiled: Option<Arc<Compiled>>,
    seed: u64,
    /// The random numbers of the next operation that draws.
    next: Draws,
}

/// The effect of a pending change on the score.
#[pyclass(frozen, get_all, module = "pcadlang")]
pub struct Weight {
    /// The log acceptance ratio without the terms of a proposal of one's own.
    log_weight: f64,
    /// The change of the log joint density.
    log_joint: f64,
    /// The change of the log density of observations and factors.
    log_likelihood: f64,
    /// The log Jacobians of changes in unconstrained coordinates.
    log_jacobian: f64,
    /// How many choices appeared.
    appeared: u32,
    /// How many choices vanished.
    vanished: u32,
}

#[pymethods]
impl Weight {
    fn __repr__(&self) -> String {
        let (w, j) = (self.log_weight, self.log_joint);
        format!("<pcadlang.Weight: log_weight={w}, log_joint={j}>")
    }
}

impl From<trace::Weight> for Weight {
    fn from(w: trace::Weight) -> Weight {
        Weight {
            log_weight: w.log_weight,
            log_joint: w.log_joint,
            log_likelihood: w.log_likelihood,
            log_jacobian: w.log_jacobian,
            appeared: w.appeared,
            vanished: w.vanished,
        }
    }
}

/// What an update replaced: `Trace.undo` leads back, bit for bit.
#[pyclass(frozen, module = "pcadlang")]
pub struct Update {
    log_weight: f64,
    discarded: Vec<(Address, Given)>,
}

#[pymethods]
impl Update {
    /// The log importance weight of the new state relative to the old one.
    #[getter]
    fn log_weight(&self) -> f64 {
        self.log_weight
    }

    /// The values before, by address, of what was replaced and what vanished; Gaussian processes
    /// as their white noise.
    #[getter]
    fn discarded<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (address, given) in &self.discarded {
            let value = match given {
                Given::Value(v) => v.clone(),
                Given::Stored(d) => pcadlang::Value::from_datum(d),
            };
            all.set_item(address.to_string(), to_python(py, &value)?)?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        format!("<pcadlang.Update: log_weight={}>", self.log_weight)
    }
}

impl Trace {
    pub fn new(trace: trace::Trace, compiled: &Arc<Compiled>, seed: u64) -> Trace {
        let key = StreamKey::new(seed, u32::MAX - 1, Purpose::VALUES);
        let next = Draws { key, step: 0, substream: 0 };
        Trace { trace: Some(trace), compiled: Some(Arc::clone(compiled)), seed, next }
    }

    /// A trace that a chain lends to a kernel written in Python.
    pub fn lent(trace: trace::Trace, at: &StepContext) -> Trace {
        Trace { trace: Some(trace), compiled: None, seed: at.seed, next: at.draws(0) }
    }

    /// Takes the trace back; Python can do nothing with it any more.
    pub fn taken(&mut self) -> Option<trace::Trace> {
        self.trace.take()
    }

    fn here(&self) -> PyResult<&trace::Trace> {
        self.trace.as_ref().ok_or_else(gone)
    }

    fn change(&mut self) -> PyResult<&mut trace::Trace> {
        self.trace.as_mut().ok_or_else(gone)
    }

    /// Random numbers that no operation before had.
    fn draws(&mut self) -> Draws {
        self.next.substream = self.next.substream.wrapping_add(1);
        self.next
    }

    fn failed(&self, e: Box<RunError>) -> PyErr {
        match &self.compiled {
            Some(c) => c.raised(c.model.run_error(*e)),
            None => plain(e),
        }
    }

    /// Raises what a host's code raised.
    fn checked(&self) -> PyResult<()> {
        self.compiled.as_ref().map_or(Ok(()), |c| c.check())
    }

    fn target(&self, address: &str) -> PyResult<Target> {
        let address = address_of(address)?;
        let trace = self.here()?;
        trace.find(&address).ok_or_else(|| match trace.get(&address.to_string()) {
            Ok(_) => PyKeyError::new_err(format!("{address} is an observation, not a choice")),
            Err(e) => PyKeyError::new_err(e.to_string()),
        })
    }

    fn targets(&self, addresses: Option<Vec<String>>) -> PyResult<Vec<Target>> {
        match addresses {
            Some(all) => all.iter().map(|a| self.target(a)).collect(),
            None => Ok(self.here()?.all_targets().to_vec()),
        }
    }

    fn propose_changes(
        &mut self,
        py: Python<'_>,
        changes: &[(Target, Change)],
    ) -> PyResult<Weight> {
        let draws = self.draws();
        let trace = self.change()?;
        let weight = py.detach(|| trace.propose(changes, draws));
        let weight = weight.map_err(|e| self.failed(e))?;
        self.checked()?;
        Ok(weight.into())
    }
}

fn gone() -> PyErr {
    PyRuntimeError::new_err(
        "this trace was lent for one step of a kernel, which is over; use `fork`",
    )
}

#[pymethods]
impl Trace {
    /// The log joint density of choices, observations and factors.
    #[getter]
    fn log_joint(&self) -> PyResult<f64> {
        self.here().map(trace::Trace::log_joint)
    }

    /// The part of it from the choices.
    #[getter]
    fn log_prior(&self) -> PyResult<f64> {
        self.here().map(trace::Trace::log_prior)
    }

    /// The part of it from observations and factors.
    #[getter]
    fn log_likelihood(&self) -> PyResult<f64> {
        self.here().map(trace::Trace::log_likelihood)
    }

    fn __len__(&self) -> PyResult<usize> {
        self.here().map(|t| t.all_targets().len())
    }

    fn __contains__(&self, address: &str) -> PyResult<bool> {
        let (trace, address) = (self.here()?, address_of(address)?);
        Ok(trace.find(&address).is_some() || trace.get(&address.to_string()).is_ok())
    }

    /// The value of a choice, of an element of one, or of an observation.
    fn __getitem__<'py>(&self, py: Python<'py>, address: &str) -> PyResult<Bound<'py, PyAny>> {
        let (trace, address) = (self.here()?, address_of(address)?);
        let value = match trace.find(&address) {
            Some(target) => trace.value(target),
            None => {
                trace.get(&address.to_string()).map_err(|e| PyKeyError::new_err(e.to_string()))?
            }
        };
        to_python(py, &value)
    }

    fn __setitem__(
        &mut self,
        py: Python<'_>,
        address: &str,
        value: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let given = vec![(address_of(address)?, Given::Value(from_python(value)?))];
        self.updated(py, &given).map(|_| ())
    }

    /// Every choice with its value, by address.
    fn choices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (address, value, _) in self.here()?.choices() {
            all.set_item(address.to_string(), to_python(py, &value)?)?;
        }
        Ok(all)
    }

    /// The log density of every choice under its prior given the rest, by address.
    fn scores<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for (address, _, score) in self.here()?.choices() {
            all.set_item(address.to_string(), score)?;
        }
        Ok(all)
    }

    /// Every observation with its value, by address.
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for o in self.here()?.observed() {
            all.set_item(o.address.to_string(), to_python(py, &o.value)?)?;
        }
        Ok(all)
    }

    /// The sum of the log densities of some choices (of all by default).
    #[pyo3(signature = (addresses = None))]
    fn score(&self, addresses: Option<Vec<String>>) -> PyResult<f64> {
        let targets = self.targets(addresses)?;
        let trace = self.here()?;
        Ok(targets.iter().map(|t| trace.score_of(*t)).sum())
    }

    /// The value of a top-level name of the program.
    fn value<'py>(&mut self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let draws = predictive(self.seed);
        let trace = self.change()?;
        let found = py.detach(|| trace.global(name, draws));
        match found {
            Some(value) => to_python(py, &value.map_err(|e| self.failed(e))?),
            None => Err(PyKeyError::new_err(format!("the program has no top-level name {name:?}"))),
        }
    }

    /// Gives choices and observations values, by address, and commits. Choices that appear without
    /// one are drawn from their prior.
    fn update(&mut self, py: Python<'_>, values: &Bound<'_, PyDict>) -> PyResult<Update> {
        let mut given = Vec::with_capacity(values.len());
        for (address, value) in values.iter() {
            given.push((
                address_of(&address.extract::<String>()?)?,
                Given::Value(from_python(&value)?),
            ));
        }
        self.updated(py, &given)
    }

    /// Leads back to the state before an update.
    fn undo(&mut self, py: Python<'_>, update: PyRef<'_, Update>) -> PyResult<Update> {
        self.updated(py, &update.discarded)
    }

    /// Proposes values for choices, by address. The change is pending; a second proposal rolls the
    /// first one back.
    fn propose(&mut self, py: Python<'_>, values: &Bound<'_, PyDict>) -> PyResult<Weight> {
        let mut changes = Vec::with_capacity(values.len());
        for (address, value) in values.iter() {
            let target = self.target(&address.extract::<String>()?)?;
            changes.push((target, Change::Value(datum(&value)?)));
        }
        self.propose_changes(py, &changes)
    }

    /// Proposes new draws from the prior for choices (for all by default).
    #[pyo3(signature = (addresses = None))]
    fn regenerate(&mut self, py: Python<'_>, addresses: Option<Vec<String>>) -> PyResult<Weight> {
        let targets = self.targets(addresses)?;
        let changes: Vec<_> = targets.iter().map(|t| (*t, Change::Resample)).collect();
        self.propose_changes(py, &changes)
    }

    /// Applies kernels, written as in an `infer` block, such as `drift(one(@**)); slice(@x);`, and
    /// returns what they did. Ctrl-C ends them, and what they moved stays moved.
    #[pyo3(signature = (kernels, *, times = 1))]
    fn apply<'py>(
        &mut self,
        py: Python<'py>,
        kernels: &str,
        times: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let Some(compiled) = self.compiled.clone() else {
            return Err(PyRuntimeError::new_err("a trace that a kernel was lent has no program"));
        };
        let chain = self.draws().substream as u32 | 1 << 31;
        let (seed, trace) = (self.seed, self.change()?);
        trace.rollback();
        let done = py.detach(|| compiled.applied(trace, kernels, times, (seed, chain)))?;
        self.trace = Some(done.last);
        crate::values::json(py, &serde_json::json!(done.kernels))
    }

    /// The unconstrained coordinates of continuous choices, one choice after the other.
    fn coordinates<'py>(
        &self,
        py: Python<'py>,
        addresses: Vec<String>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let trace = self.here()?;
        let mut all = Vec::new();
        for address in &addresses {
            all.extend(free(trace, self.target(address)?, address)?);
        }
        Ok(PyArray1::from_vec(py, all))
    }

    /// Proposes unconstrained coordinates for continuous choices.
    fn propose_coordinates(
        &mut self,
        py: Python<'_>,
        addresses: Vec<String>,
        coordinates: &Bound<'_, PyAny>,
    ) -> PyResult<Weight> {
        let all = numbers(coordinates)?;
        let mut changes = Vec::with_capacity(addresses.len());
        let mut at = 0;
        for address in &addresses {
            let target = self.target(address)?;
            let n = free(self.here()?, target, address)?.len();
            let Some(own) = all.get(at..at + n) else { break };
            changes.push((target, Change::Free(own.to_vec())));
            at += n;
        }
        if changes.len() < addresses.len() || at != all.len() {
            let what = "as many coordinates as `coordinates` returns for these addresses";
            return Err(PyValueError::new_err(format!("{} numbers, not {what}", all.len())));
        }
        self.propose_changes(py, &changes)
    }

    /// The gradient of the log joint density with respect to the unconstrained coordinates of
    /// continuous choices, log Jacobians included; `power` is that of the likelihood.
    #[pyo3(signature = (addresses, *, power = 1.0))]
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        addresses: Vec<String>,
        power: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let targets = self.targets(Some(addresses))?;
        let trace = self.here()?;
        let mut out = Vec::new();
        let done = py.detach(|| trace.gradient(&targets, power, &mut out));
        done.map_err(|e| self.failed(e))?;
        self.checked()?;
        Ok(PyArray1::from_vec(py, out))
    }

    /// Keeps the pending change.
    fn commit(&mut self) -> PyResult<()> {
        self.change().map(trace::Trace::commit)
    }

    /// Undoes the pending change.
    fn rollback(&mut self) -> PyResult<()> {
        self.change().map(trace::Trace::rollback)
    }

    /// An independent copy.
    fn fork(&self) -> PyResult<Trace> {
        let trace = Some(self.here()?.clone());
        Ok(Trace { trace, compiled: self.compiled.clone(), seed: self.seed, next: self.next })
    }

    fn __copy__(&self) -> PyResult<Trace> {
        self.fork()
    }

    /// The trace as text (JSON), exact to the last bit; `Model.load` reads it.
    fn save(&self) -> PyResult<String> {
        let Some(compiled) = &self.compiled else {
            return Err(PyRuntimeError::new_err("a trace that a kernel was lent cannot be saved"));
        };
        let saved = self.here()?.save(compiled.model.hash());
        serde_json::to_string(&saved).map_err(plain)
    }

    /// What a choice depends on and what a change of it would affect: a dictionary of `origins`
    /// (addresses), `terms` (address, kind, effect, log density), `names` and `values`.
    fn why<'py>(&mut self, py: Python<'py>, address: &str) -> PyResult<Bound<'py, PyAny>> {
        let target = self.target(address)?;
        let trace = self.change()?;
        let origins: Vec<String> = trace.origins(target).iter().map(ToString::to_string).collect();
        let affected = trace.dependents(target);
        let terms: Vec<_> = affected
            .terms
            .iter()
            .map(|t| {
                serde_json::json!({
                    "address": t.address.to_string(),
                    "kind": format!("{:?}", t.term).to_lowercase(),
                    "effect": format!("{:?}", t.effect).to_lowercase(),
                    "log_density": t.log_density,
                })
            })
            .collect();
        let names: Vec<&str> = affected.names.iter().map(|n| &**n).collect();
        let all = serde_json::json!({
            "origins": origins, "terms": terms, "names": names, "values": affected.values,
        });
        crate::values::json(py, &all)
    }

    /// The photograph that the program observes: height x width x 3 bytes; None if there is none.
    #[getter]
    fn photo<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<u8>>>> {
        let image = observed_image(self.here()?.code());
        let photo = image.as_ref().and_then(|v| v.downcast::<ImageValue>()?.as_photo());
        let array = photo.map(|p| {
            let shape = [p.height() as usize, p.width() as usize, 3];
            PyArray1::from_slice(py, p.rgb().as_raw()).reshape(shape)
        });
        array.transpose()
    }

    /// The view of the program: its last top-level name that is one, or the one named.
    #[pyo3(signature = (name = None))]
    fn view(&mut self, py: Python<'_>, name: Option<&str>) -> PyResult<View> {
        let draws = predictive(self.seed);
        let trace = self.change()?;
        let view = py.detach(|| match name {
            Some(name) => trace.global(name, draws)?.ok().and_then(|v| session::as_view(&v, None)),
            None => session::view(trace, draws, None),
        });
        view.map(View::new).ok_or_else(|| {
            plain(match name {
                Some(name) => format!("{name} is no view"),
                None => "the program has no view".to_owned(),
            })
        })
    }

    fn __repr__(&self) -> String {
        match &self.trace {
            Some(t) => {
                format!(
                    "<pcadlang.Trace: {} choices, log joint {}>",
                    t.all_targets().len(),
                    t.log_joint()
                )
            }
            None => "<pcadlang.Trace: lent for a step that is over>".to_owned(),
        }
    }
}

impl Trace {
    fn updated(&mut self, py: Python<'_>, given: &[(Address, Given)]) -> PyResult<Update> {
        let draws = self.draws();
        let trace = self.change()?;
        let update = py.detach(|| {
            let update = trace.update(given, draws);
            trace.commit();
            update
        });
        match update {
            Ok(u) => {
                self.checked()?;
                Ok(Update { log_weight: u.log_weight, discarded: u.discarded })
            }
            Err(e) => Err(self.failed(e)),
        }
    }
}

/// The coordinates of a continuous choice.
fn free(trace: &trace::Trace, target: Target, address: &str) -> PyResult<Vec<f64>> {
    let found = trace.free(target).map(|(coordinates, _)| coordinates);
    found.ok_or_else(|| {
        PyValueError::new_err(format!("{address} is discrete: it has no coordinates"))
    })
}
