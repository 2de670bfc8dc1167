//! `pcadlang._native`: the library for Python. Each module wraps one part of it; what is easier
//! to say in Python (plots, ArviZ, notebooks) is in the package around it.

mod errors;
mod host;
mod model;
mod posterior;
mod program;
mod python_code;
mod sampling;
mod scene;
mod trace;
mod values;
mod waiting;

use pyo3::prelude::*;

/// The library for Python.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::command;
    #[pymodule_export]
    use super::errors::{Error, OutsideDomain};
    #[pymodule_export]
    use super::host::Host;
    #[pymodule_export]
    use super::model::Model;
    #[pymodule_export]
    use super::posterior::Posterior;
    #[pymodule_export]
    use super::program::Program;
    #[pymodule_export]
    use super::scene::{Solid, View};
    #[pymodule_export]
    use super::trace::{Trace, Update, Weight};
    #[pymodule_export]
    use super::values::{Adjoint, Object};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        pcadlang_command::guests::register().map_err(super::errors::raised)?;
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

/// Runs the `pcadlang` command with these arguments and returns its exit code. It prints, and a
/// second Ctrl-C ends the process.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<String>) -> u8 {
    py.detach(|| {
        pcadlang::command(std::iter::once("pcadlang".to_owned()).chain(arguments).map(Into::into))
    })
}
