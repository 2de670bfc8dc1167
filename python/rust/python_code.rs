//! Calls of Python from the engine.
//!
//! The engine's interfaces leave no room for exceptions in some places (a density, a kernel's
//! step): the first exception is kept in the host's [`Failure`], which ends the run and is raised.

use crate::errors::OutsideDomain;
use crate::trace::Trace;
use crate::values::{
    adjoint_from_python, adjoint_to_python, datum, elements, from_python, numbers, to_python,
};
use pcadlang::Value;
use pcadlang_engine::trace::{self, Limits, TraceResult};
use pcadlang_inference::host::{
    Adjoint, Args, Datum, Distribution, Fault, FaultKind, Gradient, KernelCall, Likelihood, Support,
};
use pcadlang_inference::{Kernel, Outcome, SiteSelection, StepContext};
use pcadlang_numerics::rng::Stream;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// The first exception that Python code of a host raised and nobody has seen yet.
#[derive(Default)]
pub struct Failure(Mutex<Option<PyErr>>);

impl Failure {
    fn keep(&self, e: PyErr) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.get_or_insert(e);
    }

    /// Whether there is one.
    pub fn is_some(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Takes the exception, so that it is raised once.
    pub fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Something to call, with the name under which the program knows it.
#[derive(Clone)]
pub struct Code {
    pub name: String,
    /// Shared, since a reference to a Python object is copied only under the interpreter's lock.
    pub call: Arc<Py<PyAny>>,
    pub failure: Arc<Failure>,
}

impl fmt::Debug for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in Python", self.name)
    }
}

/// The arguments of a call.
fn arguments(a: &Args, count: usize) -> Vec<Value> {
    (0..count).map(|i| a.get(i).clone()).collect()
}

impl Code {
    /// Calls it with objects of Python, and converts what it returns.
    fn run<T>(
        &self,
        arguments: impl for<'py> FnOnce(Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>>,
        read: impl for<'py> FnOnce(Bound<'py, PyAny>) -> PyResult<T>,
    ) -> PyResult<T> {
        Python::attach(|py| {
            let all = PyTuple::new(py, arguments(py)?)?;
            read(self.call.bind(py).call1(all)?)
        })
    }

    /// The same, for places that can only say that there is no result.
    fn kept<T>(&self, result: PyResult<T>) -> Option<T> {
        result.map_err(|e| self.failure.keep(e)).ok()
    }

    fn fault(&self, e: PyErr) -> Fault {
        Python::attach(|py| match e.is_instance_of::<OutsideDomain>(py) {
            true => Fault::new(FaultKind::Domain, format!("{}: {}", self.name, e.value(py))),
            false => {
                let fault = Fault::new(FaultKind::Other, format!("{}: {e}", self.name));
                self.failure.keep(e);
                fault
            }
        })
    }

    /// A function of the language.
    pub fn function(&self, a: &Args, count: usize) -> Result<Value, Fault> {
        let given = arguments(a, count);
        self.run(|py| given.iter().map(|v| to_python(py, v)).collect(), |out| from_python(&out))
            .map_err(|e| self.fault(e))
    }

    /// The vector-Jacobian product of a function.
    pub fn product(
        &self,
        a: &Args,
        count: usize,
        result: &Value,
        by: &Adjoint,
    ) -> Option<Vec<Adjoint>> {
        let given = arguments(a, count);
        let done = self.run(
            |py| {
                let given = given.iter().map(|v| to_python(py, v)).collect::<PyResult<Vec<_>>>()?;
                let given = PyTuple::new(py, given)?.into_any();
                Ok(vec![given, to_python(py, result)?, adjoint_to_python(py, by)?])
            },
            |out| adjoints(&out, count),
        );
        self.kept(done)
    }
}

/// The adjoints of arguments, one for each.
fn adjoints(out: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Adjoint>> {
    let wrong = || {
        PyTypeError::new_err(format!(
            "a gradient returns a list with the adjoint of each argument: {count} of them"
        ))
    };
    let all = elements(out).ok_or_else(wrong)??;
    let all = all.iter().map(adjoint_from_python).collect::<PyResult<Vec<_>>>()?;
    if all.len() == count { Ok(all) } else { Err(wrong()) }
}

/// numpy's generator, seeded by the engine's stream.
fn generator<'py>(py: Python<'py>, rng: &mut Stream) -> PyResult<Bound<'py, PyAny>> {
    let seed = [rng.next_u64(), rng.next_u64()];
    py.import("numpy.random")?.call_method1("default_rng", (seed.to_vec(),))
}

/// The space of the values of a distribution.
pub enum Space {
    /// The same for all parameters.
    Fixed(Support),
    /// A function of them.
    Moving(Code),
}

/// A family of distributions.
pub struct Family {
    pub name: String,
    pub log_density: Code,
    pub sample: Code,
    pub gradient: Option<Code>,
    pub space: Space,
}

/// One distribution of a family.
pub struct PythonDistribution {
    family: Arc<Family>,
    parameters: Vec<Value>,
    support: Support,
}

impl fmt::Debug for PythonDistribution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(", self.family.name)?;
        for (i, p) in self.parameters.iter().enumerate() {
            write!(f, "{}{p}", if i > 0 { ", " } else { "" })?;
        }
        f.write_str(")")
    }
}

impl PythonDistribution {
    pub fn new(family: &Arc<Family>, a: &Args, count: usize) -> Result<PythonDistribution, Fault> {
        let parameters = arguments(a, count);
        let support = match &family.space {
            Space::Fixed(support) => support.clone(),
            Space::Moving(code) => code
                .run(
                    |py| parameters.iter().map(|v| to_python(py, v)).collect(),
                    |out| support(&out),
                )
                .map_err(|e| code.fault(e))?,
        };
        Ok(PythonDistribution { family: Arc::clone(family), parameters, support })
    }

    /// `first` and the parameters.
    fn with<'py>(
        &self,
        py: Python<'py>,
        first: Bound<'py, PyAny>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let all = self.parameters.iter().map(|v| to_python(py, v));
        std::iter::once(Ok(first)).chain(all).collect()
    }
}

impl Distribution for PythonDistribution {
    fn name(&self) -> &str {
        &self.family.name
    }

    fn support(&self) -> Support {
        self.support.clone()
    }

    fn has_moving_support(&self) -> bool {
        matches!(self.family.space, Space::Moving(_))
    }

    fn sample(&self, rng: &mut Stream) -> Datum {
        let code = &self.family.sample;
        let drawn = code.run(
            |py| self.with(py, generator(py, rng)?),
            |out| {
                let x = datum(&out)?;
                match self.support.contains(&x) {
                    true => Ok(x),
                    false => Err(PyValueError::new_err(format!(
                        "{} drew a value outside of its support ({})",
                        self.family.name, self.support
                    ))),
                }
            },
        );
        code.kept(drawn).unwrap_or(Datum::Num(f64::NAN))
    }

    fn log_density(&self, x: &Datum) -> f64 {
        if !self.support.contains(x) {
            return f64::NEG_INFINITY;
        }
        let code = &self.family.log_density;
        let density = code.run(
            |py| self.with(py, to_python(py, &Value::from_datum(x))?),
            |out| out.extract::<f64>(),
        );
        code.kept(density).unwrap_or(f64::NEG_INFINITY)
    }

    fn gradient(&self, x: &Datum) -> Option<Gradient> {
        let code = self.family.gradient.as_ref()?;
        let slopes = code.run(
            |py| self.with(py, to_python(py, &Value::from_datum(x))?),
            |out| {
                let (x, params) = out.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
                Ok(Gradient { x: flat(&x)?, params: flat(&params)? })
            },
        );
        code.kept(slopes)
    }
}

/// The numbers of a number, an array, or a list of these.
fn flat(object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    if object.is_none() {
        return Ok(Vec::new());
    }
    if let Ok(x) = object.extract::<f64>() {
        return Ok(vec![x]);
    }
    let Some(parts) = elements(object) else { return numbers(object) };
    let each = parts?.into_iter().map(|x| match x.extract::<f64>() {
        Ok(x) => Ok(vec![x]),
        Err(_) => numbers(&x),
    });
    Ok(each.collect::<PyResult<Vec<_>>>()?.concat())
}

/// Reads a support by its name, or by a tuple of its name and bounds.
///
/// # Errors
/// If there is none of that name.
pub fn support(object: &Bound<'_, PyAny>) -> PyResult<Support> {
    if let Ok(name) = object.extract::<String>() {
        return Ok(match name.as_str() {
            "real" => Support::Real,
            "positive" => Support::Positive,
            "unit" => Support::Interval { lo: 0.0, hi: 1.0 },
            "circle" => Support::Circle,
            "bool" => Support::Boolean,
            "integers" => Support::Integers { lo: 0, hi: None },
            other => return Err(PyValueError::new_err(format!("{other:?} is no support"))),
        });
    }
    if let Ok((name, x, y)) = object.extract::<(String, f64, f64)>() {
        return match name.as_str() {
            "interval" if x < y => Ok(Support::Interval { lo: x, hi: y }),
            "integers" if x <= y => Ok(Support::Integers { lo: x as i64, hi: Some(y as i64) }),
            _ => Err(PyValueError::new_err(format!("({name:?}, {x}, {y}) is no support"))),
        };
    }
    let (name, x) = object.extract::<(String, f64)>()?;
    let count = || match (1.0..=1e6).contains(&x) && x == x.trunc() {
        true => Ok(x as usize),
        false => Err(PyValueError::new_err(format!("{name}: {x} is no number of elements"))),
    };
    match name.as_str() {
        "at least" => Ok(Support::AtLeast { lo: x }),
        "at most" => Ok(Support::AtMost { hi: x }),
        "integers" => Ok(Support::Integers { lo: x as i64, hi: None }),
        "vector" => Ok(Support::Vector(count()?)),
        "simplex" => Ok(Support::Simplex(count()?)),
        _ => Err(PyValueError::new_err(format!("({name:?}, {x}) is no support"))),
    }
}

/// A likelihood with its arguments.
#[derive(Debug)]
pub struct PythonLikelihood {
    pub arguments: Vec<Value>,
    pub log_density: Code,
    pub gradient: Option<Code>,
    pub sample: Option<Code>,
    pub proper: bool,
}

impl PythonLikelihood {
    fn with<'py>(
        &self,
        py: Python<'py>,
        first: Vec<Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let all = self.arguments.iter().map(|v| to_python(py, v));
        first.into_iter().map(Ok).chain(all).collect()
    }

    fn said(code: &Code, e: PyErr) -> Fault {
        let text = format!("{}: {e}", code.name);
        code.failure.keep(e);
        Fault::type_error(text)
    }
}

impl Likelihood for PythonLikelihood {
    fn name(&self) -> &str {
        &self.log_density.name
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let code = &self.log_density;
        let density = code
            .run(|py| self.with(py, vec![to_python(py, observed)?]), |out| out.extract::<f64>());
        // A density that is not a number is impossible.
        let defined = |x: f64| if x.is_nan() { f64::NEG_INFINITY } else { x };
        density.map(defined).map_err(|e| Self::said(code, e))
    }

    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let code = self.gradient.as_ref()?;
        let done = code.run(
            |py| self.with(py, vec![to_python(py, observed)?]),
            |out| adjoints(&out, self.arguments.len()),
        );
        code.kept(done).map(Adjoint::List)
    }

    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, Fault>> {
        let code = self.sample.as_ref()?;
        let drawn = code.run(
            |py| self.with(py, vec![to_python(py, observed)?, generator(py, rng)?]),
            |out| from_python(&out),
        );
        Some(drawn.map_err(|e| Self::said(code, e)))
    }

    fn is_proper(&self) -> bool {
        self.proper
    }
}

/// An argument of a kernel.
enum Given {
    Value(Value),
    Selection(SiteSelection),
}

/// A kernel of a chain.
pub struct PythonKernel {
    code: Code,
    arguments: Vec<Given>,
}

impl PythonKernel {
    pub fn new(
        code: Code,
        selections: &[bool],
        call: &mut KernelCall,
    ) -> Result<PythonKernel, Fault> {
        let each = selections.iter().enumerate().map(|(i, is_selection)| match is_selection {
            true => call.scope(i).map(Given::Selection),
            false => Ok(Given::Value(call.args().get(i).clone())),
        });
        let arguments = each.collect::<Result<Vec<_>, Fault>>()?;
        Ok(PythonKernel { code, arguments })
    }

    /// Calls Python with the trace itself, which it gives back.
    fn called(&self, py: Python<'_>, trace: &mut trace::Trace, at: &StepContext) -> PyResult<bool> {
        let mut all = vec![py.None().into_bound(py), generator(py, &mut at.stream())?];
        for given in &self.arguments {
            all.push(match given {
                Given::Value(v) => to_python(py, v)?,
                Given::Selection(s) => {
                    let selection = trace.select(&s.selector);
                    let targets = trace.in_program_order(selection);
                    let addresses = targets.iter().map(|t| trace.address(*t).to_string());
                    PyList::new(py, addresses.collect::<Vec<_>>())?.into_any()
                }
            });
        }
        let empty = trace::Trace::prior(Arc::clone(trace.code()), Limits::default());
        let lent = Py::new(py, Trace::lent(std::mem::replace(trace, empty), at))?;
        all[0] = lent.bind(py).clone().into_any();
        let done = self.code.call.bind(py).call1(PyTuple::new(py, all)?);
        let back = lent.try_borrow_mut(py).ok().and_then(|mut t| t.taken());
        match back {
            Some(back) => *trace = back,
            None => return Err(PyValueError::new_err("another thread still works on the trace")),
        }
        // What it left pending was not accepted.
        trace.rollback();
        done?.is_truthy()
    }
}

impl Kernel for PythonKernel {
    fn name(&self) -> String {
        self.code.name.clone()
    }

    fn step(&mut self, trace: &mut trace::Trace, at: &StepContext) -> TraceResult<Outcome> {
        let done = Python::attach(|py| self.called(py, trace, at));
        Ok(match self.code.kept(done) {
            Some(accepted) => Outcome::one(accepted),
            // The run ends; see the module.
            None => Outcome::failed(),
        })
    }
}
