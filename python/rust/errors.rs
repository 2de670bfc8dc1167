//! Errors of programs as Python exceptions.

use pcadlang_syntax::diag::Severity;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

create_exception!(
    pcadlang,
    Error,
    PyException,
    "A mistake in a program, its data or a run of it. Its text shows the place in the source;\n\
     `diagnostics` has the same as dictionaries with `severity`, `message`, `file`, `line`,\n\
     `column` (from 1; None without a place), `hints` and `notes`."
);

create_exception!(
    pcadlang,
    OutsideDomain,
    PyException,
    "Raised by a function written in Python: it is undefined for these arguments, and a proposal\n\
     that leads to them is rejected."
);

/// Converts an error of the library.
pub fn raised(e: pcadlang::Error) -> PyErr {
    let error = Error::new_err(e.to_string());
    Python::attach(|py| {
        // If this fails, the text is still there.
        if let Ok(all) = diagnostics(py, &e) {
            let _ = error.value(py).setattr("diagnostics", all);
        }
    });
    error
}

/// An error without a place in a program.
pub fn plain(message: impl std::fmt::Display) -> PyErr {
    let error = Error::new_err(message.to_string());
    Python::attach(|py| {
        let _ = error.value(py).setattr("diagnostics", PyList::empty(py));
    });
    error
}

fn diagnostics<'py>(py: Python<'py>, e: &pcadlang::Error) -> PyResult<Bound<'py, PyList>> {
    let all = PyList::empty(py);
    for d in &e.diagnostics {
        let one = PyDict::new(py);
        let severity = match d.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        let label = d.labels.iter().find(|l| l.primary).or(d.labels.first());
        let file = label.and_then(|l| e.sources.get(l.span.file).map(|f| (f, l.span.start)));
        let at = file.map(|(f, start)| f.location(start as usize));
        one.set_item("severity", severity)?;
        one.set_item("message", &d.message)?;
        one.set_item("file", file.map(|(f, _)| f.name()))?;
        one.set_item("line", at.map(|(line, _)| line))?;
        one.set_item("column", at.map(|(_, column)| column))?;
        one.set_item("hints", &d.hints)?;
        one.set_item("notes", &d.notes)?;
        all.append(one)?;
    }
    Ok(all)
}
