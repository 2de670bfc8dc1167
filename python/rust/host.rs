//! What Python brings to the language: functions, distributions, likelihoods and kernels.

use crate::python_code::{
    Code, Failure, PythonDistribution, PythonKernel, PythonLikelihood, Space,
};
use crate::values::from_python;
use pcadlang_inference::host::{self, Entry, Type};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

/// Functions, distributions, likelihoods and kernels written in Python, which programs call by
/// name. `Program.host` adds them to a program.
///
/// Arguments are declared by a dictionary of names and types: "number", "int", "bool", "string",
/// "array", "record", "view", "solid", "selection" (kernels only) or "any"; `(type, default)` makes
/// one optional. What is called must return the same for the same arguments, and is called from
/// the threads of the chains, one at a time. `OutsideDomain`, raised by a function, rejects the
/// proposal; any other exception ends the run and is the cause of its error.
#[pyclass(module = "pcadlang")]
#[derive(Default)]
pub struct Host {
    host: host::Host,
    failure: Arc<Failure>,
}

impl Host {
    pub fn parts(&self) -> (host::Host, Arc<Failure>) {
        (self.host.clone(), Arc::clone(&self.failure))
    }

    fn add(&mut self, entry: Entry) {
        self.host = std::mem::take(&mut self.host).with(entry);
    }

    fn code(&self, name: &str, call: Py<PyAny>) -> Code {
        Code { name: name.to_owned(), call: Arc::new(call), failure: Arc::clone(&self.failure) }
    }
}

#[pymethods]
impl Host {
    #[new]
    fn new() -> Host {
        Host::default()
    }

    /// Adds a function: `call(*arguments)` returns its value. `gradient(arguments, result, by)`
    /// returns the vector-Jacobian product: the adjoint of each argument (None for zero), given
    /// that of the result.
    #[pyo3(signature = (name, call, arguments, *, gradient = None, about = ""))]
    fn function(
        &mut self,
        name: &str,
        call: Py<PyAny>,
        arguments: &Bound<'_, PyDict>,
        gradient: Option<Py<PyAny>>,
        about: &str,
    ) -> PyResult<()> {
        let (code, count) = (self.code(name, call), arguments.len());
        let mut entry = Entry::function(name.to_owned(), move |a| code.function(a, count));
        if let Some(gradient) = gradient {
            let code = self.code(name, gradient);
            entry = entry.gradient(move |a, result, by| code.product(a, count, result, by));
        }
        self.add(declared(entry, arguments)?.about(described(about)));
        Ok(())
    }

    /// Adds a family of distributions: `log_density(x, *parameters)` and
    /// `sample(rng, *parameters)`, with numpy's generator. `gradient(x, *parameters)` returns a
    /// pair: the derivatives of the log density with respect to the numbers of `x`, and to those
    /// of the parameters. `support` is "real", "positive", "unit", "circle", "bool", "integers",
    /// or a tuple ("interval", lo, hi), ("at least", lo), ("at most", hi), ("integers", lo, hi),
    /// ("vector", n), ("simplex", n); or a function of the parameters that returns one.
    #[pyo3(signature = (name, arguments, *, log_density, sample, gradient = None, support = None, about = ""))]
    #[allow(clippy::too_many_arguments)] // They are the keywords of one Python function.
    fn distribution(
        &mut self,
        name: &str,
        arguments: &Bound<'_, PyDict>,
        log_density: Py<PyAny>,
        sample: Py<PyAny>,
        gradient: Option<Py<PyAny>>,
        support: Option<Bound<'_, PyAny>>,
        about: &str,
    ) -> PyResult<()> {
        let space = match support {
            None => Space::Fixed(host::Support::Real),
            Some(s) if s.is_callable() => Space::Moving(self.code(name, s.unbind())),
            Some(s) => Space::Fixed(crate::python_code::support(&s)?),
        };
        let family = Arc::new(crate::python_code::Family {
            name: name.to_owned(),
            log_density: self.code(name, log_density),
            sample: self.code(name, sample),
            gradient: gradient.map(|g| self.code(name, g)),
            space,
        });
        let count = arguments.len();
        let entry = Entry::distribution(name.to_owned(), move |a| {
            PythonDistribution::new(&family, a, count)
        });
        self.add(declared(entry, arguments)?.about(described(about)));
        Ok(())
    }

    /// Adds a likelihood: `log_density(observed, *arguments)`. `gradient(observed, *arguments)`
    /// returns the adjoint of each argument (None for zero); `sample(observed, rng, *arguments)`
    /// draws an observation of the same form. A comparator has a view among its arguments.
    #[pyo3(signature = (name, arguments, *, log_density, gradient = None, sample = None, proper = true, about = ""))]
    #[allow(clippy::too_many_arguments)] // They are the keywords of one Python function.
    fn likelihood(
        &mut self,
        name: &str,
        arguments: &Bound<'_, PyDict>,
        log_density: Py<PyAny>,
        gradient: Option<Py<PyAny>>,
        sample: Option<Py<PyAny>>,
        proper: bool,
        about: &str,
    ) -> PyResult<()> {
        let (density, count) = (self.code(name, log_density), arguments.len());
        let gradient = gradient.map(|g| self.code(name, g));
        let sample = sample.map(|s| self.code(name, s));
        let entry = Entry::likelihood(name.to_owned(), move |a| {
            Ok(PythonLikelihood {
                arguments: (0..count).map(|i| a.get(i).clone()).collect(),
                log_density: density.clone(),
                gradient: gradient.clone(),
                sample: sample.clone(),
                proper,
            })
        });
        self.add(declared(entry, arguments)?.about(described(about)));
        Ok(())
    }

    /// Adds a kernel for `infer` blocks: `step(trace, rng, *arguments)` moves the trace by one step
    /// that leaves the posterior invariant, and returns whether its proposal was accepted. Arguments
    /// of the type "selection" are lists of addresses.
    #[pyo3(signature = (name, step, arguments, *, about = ""))]
    fn kernel(
        &mut self,
        name: &str,
        step: Py<PyAny>,
        arguments: &Bound<'_, PyDict>,
        about: &str,
    ) -> PyResult<()> {
        let code = self.code(name, step);
        let mut selections = Vec::with_capacity(arguments.len());
        for (_, ty) in arguments.iter() {
            selections.push(kind(&ty)?.0 == Type::Selection);
        }
        let entry = Entry::kernel(name.to_owned(), move |call| {
            PythonKernel::new(code.clone(), &selections, call)
        });
        self.add(declared(entry, arguments)?.about(described(about)));
        Ok(())
    }

    /// What `pcadlang doc` says of a name: the host's own, or the engine's.
    fn doc(&self, name: &str) -> Option<String> {
        self.host.doc(name)
    }
}

fn described(about: &str) -> String {
    if about.is_empty() { "Written in Python.".to_owned() } else { about.to_owned() }
}

/// Declares the arguments of an entry.
fn declared(mut entry: Entry, arguments: &Bound<'_, PyDict>) -> PyResult<Entry> {
    for (name, ty) in arguments.iter() {
        let name = name.extract::<String>()?;
        entry = match kind(&ty)? {
            (ty, Some(default)) => entry.optional(name, ty, from_python(&default)?, ""),
            (ty, None) => entry.argument(name, ty, ""),
        };
    }
    Ok(entry)
}

/// The type of an argument, and its default.
fn kind<'py>(declared: &Bound<'py, PyAny>) -> PyResult<(Type, Option<Bound<'py, PyAny>>)> {
    if let Ok(pair) = declared.cast::<PyTuple>() {
        let (ty, default) = pair.extract::<(Bound<'py, PyAny>, Bound<'py, PyAny>)>()?;
        return Ok((kind(&ty)?.0, Some(default)));
    }
    let name = declared.extract::<String>()?;
    let ty = match name.as_str() {
        "number" => Type::Num,
        "int" => Type::Int,
        "bool" => Type::Bool,
        "string" => Type::Str,
        "array" => Type::Array,
        "record" => Type::Record,
        "view" => Type::Object("a view"),
        "solid" => Type::Object("a solid"),
        "selection" => Type::Selection,
        "any" => Type::Any,
        other => {
            return Err(PyValueError::new_err(format!(
                "{other:?} is no type of an argument: use number, int, bool, string, array, record, \
                 view, solid, selection or any"
            )));
        }
    };
    Ok((ty, None))
}
