//! Values of the language as Python objects, and back.
//!
//! Numbers, truth values, strings, arrays and records cross by value: an array of numbers is a
//! numpy array of float64, an array of such arrays of one length a two-dimensional one. Scene
//! objects cross by reference.

use crate::scene::{Solid, View};
use numpy::{
    PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pcadlang::Value;
use pcadlang_inference::host::{Adjoint as Derivatives, Datum};
use pcadlang_library::scene::{SolidValue, ViewValue};
use pyo3::exceptions::{PyAttributeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyList, PyString, PyTuple};
use std::sync::Arc;

/// The nesting that is followed; the language allows no more.
const DEEPEST: u32 = 200;

/// A value of the language that Python has no type for: a solid's armature, a camera, a
/// distribution, a function. Fields are attributes.
#[pyclass(frozen, module = "pcadlang")]
pub struct Object(pub Value);

#[pymethods]
impl Object {
    fn __repr__(&self) -> String {
        format!("<pcadlang.Object: {}>", self.0)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let found = match &self.0 {
            Value::Object(o) => o.field(name),
            _ => None,
        };
        match found {
            Some(value) => to_python(py, &value),
            None => Err(PyAttributeError::new_err(format!("{} has no `{name}`", self.0))),
        }
    }

    /// The name of its type.
    #[getter]
    fn type_name(&self) -> &'static str {
        self.0.type_name()
    }

    /// Its numbers, flattened; empty if it has none.
    fn numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.0.numbers())
    }
}

/// The derivatives of a number with respect to a value that has no other form, such as a view.
#[pyclass(frozen, module = "pcadlang")]
pub struct Adjoint(pub Derivatives);

#[pymethods]
impl Adjoint {
    fn __repr__(&self) -> String {
        "<pcadlang.Adjoint>".to_owned()
    }
}

/// Converts a value for Python.
pub fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Unit => py.None().into_bound(py),
        Value::Num(x) => PyFloat::new(py, *x).into_any(),
        Value::Bool(b) => PyBool::new(py, *b).to_owned().into_any(),
        Value::Str(s) => PyString::new(py, s).into_any(),
        Value::Array(xs) => PyArray1::from_slice(py, xs).into_any(),
        Value::List(xs) => match matrix(xs) {
            Some((rows, columns)) => {
                let all = xs.iter().flat_map(Value::numbers).collect::<Vec<f64>>();
                PyArray1::from_vec(py, all).reshape([rows, columns])?.into_any()
            }
            None => {
                let all = xs.iter().map(|x| to_python(py, x)).collect::<PyResult<Vec<_>>>()?;
                PyList::new(py, all)?.into_any()
            }
        },
        Value::Record(fields) => {
            let out = PyDict::new(py);
            for (name, x) in fields.iter() {
                out.set_item(&**name, to_python(py, x)?)?;
            }
            out.into_any()
        }
        other => match (other.downcast::<ViewValue>(), other.downcast::<SolidValue>()) {
            (Some(view), _) => Bound::new(py, View::new(Arc::clone(&view.0)))?.into_any(),
            (_, Some(solid)) => Bound::new(py, Solid(solid.0.clone()))?.into_any(),
            _ => Bound::new(py, Object(other.clone()))?.into_any(),
        },
    })
}

/// The rows and columns of a matrix: arrays of one length.
fn matrix(rows: &[Value]) -> Option<(usize, usize)> {
    let length = |v: &Value| match v {
        Value::Array(xs) => Some(xs.len()),
        _ => None,
    };
    let columns = length(rows.first()?)?;
    (columns > 0 && rows.iter().all(|r| length(r) == Some(columns)))
        .then_some((rows.len(), columns))
}

/// Converts a Python object to a value.
///
/// # Errors
/// TypeError for an object without an equivalent, ValueError for one nested too deeply.
pub fn from_python(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    within(object, DEEPEST)
}

fn within(object: &Bound<'_, PyAny>, depth: u32) -> PyResult<Value> {
    let depth = depth.checked_sub(1).ok_or_else(too_deep)?;
    if object.is_none() {
        return Ok(Value::Unit);
    }
    if let Ok(b) = object.cast::<PyBool>() {
        return Ok(Value::Bool(b.is_true()));
    }
    if let Ok(x) = object.cast::<PyFloat>() {
        return Ok(Value::Num(x.value()));
    }
    if let Ok(s) = object.cast::<PyString>() {
        return Ok(Value::str(&s.to_cow()?));
    }
    if let Ok(fields) = object.cast::<PyDict>() {
        let mut all = Vec::with_capacity(fields.len());
        for (name, x) in fields.iter() {
            all.push((name.extract::<String>()?, within(&x, depth)?));
        }
        return Ok(Value::record(all.iter().map(|(name, x)| (&**name, x.clone()))));
    }
    if let Ok(array) = object.cast::<PyUntypedArray>() {
        return of_array(array, depth);
    }
    if let Ok(items) = object.cast::<PyList>() {
        return of_items(items.iter(), depth);
    }
    if let Ok(items) = object.cast::<PyTuple>() {
        return of_items(items.iter(), depth);
    }
    if let Ok(view) = object.cast::<View>() {
        return Ok(Value::object(ViewValue(Arc::clone(&view.get().view))));
    }
    if let Ok(solid) = object.cast::<Solid>() {
        return Ok(Value::object(SolidValue::new(solid.get().0.clone())));
    }
    if let Ok(other) = object.cast::<Object>() {
        return Ok(other.get().0.clone());
    }
    // Whole numbers, numpy's scalars, and what else is a number.
    match object.extract::<f64>() {
        Ok(x) => Ok(Value::Num(x)),
        Err(_) => Err(PyTypeError::new_err(format!(
            "`{}` is no value of the language: use numbers, truth values, strings, lists, \
             dictionaries, numpy arrays, or objects of pcadlang",
            object.get_type().name()?
        ))),
    }
}

fn of_items<'py>(items: impl Iterator<Item = Bound<'py, PyAny>>, depth: u32) -> PyResult<Value> {
    let all = items.map(|x| within(&x, depth)).collect::<PyResult<Vec<_>>>()?;
    Ok(Value::from_elements(all))
}

/// An array: one of numbers as such, others element by element.
fn of_array(array: &Bound<'_, PyUntypedArray>, depth: u32) -> PyResult<Value> {
    let kind = array.dtype().getattr("kind")?.extract::<char>()?;
    match array.ndim() {
        0 => within(&array.call_method0("item")?, depth),
        1 if "iuf".contains(kind) => Ok(Value::array(numbers(array.as_any())?)),
        _ => of_items(array.try_iter()?.collect::<PyResult<Vec<_>>>()?.into_iter(), depth),
    }
}

/// The numbers of an array or list of any shape, row by row.
///
/// # Errors
/// TypeError unless all are numbers.
pub fn numbers(object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    // Plain float64 arrays are read in place.
    if let Ok(array) = object.cast::<PyArrayDyn<f64>>() {
        let array = array.try_readonly().map_err(|e| PyValueError::new_err(e.to_string()))?;
        return Ok(array.as_array().iter().copied().collect());
    }
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (object, numpy.getattr("float64")?))?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    let array = array.try_readonly().map_err(|e| PyValueError::new_err(e.to_string()))?;
    Ok(array.as_array().iter().copied().collect())
}

/// The value of a choice, as distributions need it.
///
/// # Errors
/// TypeError if no distribution can have that value.
pub fn datum(object: &Bound<'_, PyAny>) -> PyResult<Datum> {
    let value = from_python(object)?;
    value.to_datum().ok_or_else(|| {
        PyTypeError::new_err(format!("{} is no value of a random choice", value.type_name()))
    })
}

/// Converts derivatives for Python: None for zero, numbers, arrays, lists and dictionaries.
pub fn adjoint_to_python<'py>(py: Python<'py>, by: &Derivatives) -> PyResult<Bound<'py, PyAny>> {
    Ok(match by {
        Derivatives::Zero => py.None().into_bound(py),
        Derivatives::Num(x) => PyFloat::new(py, *x).into_any(),
        Derivatives::Array(xs) => PyArray1::from_slice(py, xs).into_any(),
        Derivatives::List(xs) => {
            let all = xs.iter().map(|x| adjoint_to_python(py, x)).collect::<PyResult<Vec<_>>>()?;
            PyList::new(py, all)?.into_any()
        }
        Derivatives::Record(fields) => {
            let out = PyDict::new(py);
            for (name, x) in fields {
                out.set_item(&**name, adjoint_to_python(py, x)?)?;
            }
            out.into_any()
        }
        Derivatives::Points(_) | Derivatives::Unknown => {
            Bound::new(py, Adjoint(by.clone()))?.into_any()
        }
    })
}

/// Converts derivatives from Python, as [`adjoint_to_python`] gives them.
///
/// # Errors
/// TypeError for anything else, ValueError for what is nested too deeply.
pub fn adjoint_from_python(object: &Bound<'_, PyAny>) -> PyResult<Derivatives> {
    adjoint_within(object, DEEPEST)
}

fn adjoint_within(object: &Bound<'_, PyAny>, depth: u32) -> PyResult<Derivatives> {
    let depth = depth.checked_sub(1).ok_or_else(too_deep)?;
    if object.is_none() {
        return Ok(Derivatives::Zero);
    }
    if let Ok(by) = object.cast::<Adjoint>() {
        return Ok(by.get().0.clone());
    }
    if let Ok(fields) = object.cast::<PyDict>() {
        let mut all = Vec::with_capacity(fields.len());
        for (name, x) in fields.iter() {
            all.push((Arc::from(name.extract::<String>()?), adjoint_within(&x, depth)?));
        }
        return Ok(Derivatives::Record(all));
    }
    if let Ok(x) = object.extract::<f64>() {
        return Ok(Derivatives::Num(x));
    }
    if let Ok(array) = object.cast::<PyUntypedArray>()
        && array.ndim() < 2
    {
        return Ok(Derivatives::Array(numbers(object)?));
    }
    let items = elements(object).ok_or_else(|| {
        PyTypeError::new_err(
            "derivatives are None, numbers, lists, dictionaries, arrays, or adjoints of pcadlang",
        )
    })??;
    match items.iter().map(|x| x.extract::<f64>()).collect::<PyResult<Vec<f64>>>() {
        Ok(all) => Ok(Derivatives::Array(all)),
        Err(_) => {
            let all = items.iter().map(|x| adjoint_within(x, depth));
            Ok(Derivatives::List(all.collect::<PyResult<_>>()?))
        }
    }
}

/// The elements of a list, tuple or array; `None` for anything else.
pub fn elements<'py>(object: &Bound<'py, PyAny>) -> Option<PyResult<Vec<Bound<'py, PyAny>>>> {
    let known = object.is_instance_of::<PyList>()
        || object.is_instance_of::<PyTuple>()
        || object.cast::<PyUntypedArray>().is_ok_and(|a| a.ndim() > 0);
    known.then(|| object.try_iter()?.collect())
}

fn too_deep() -> PyErr {
    PyValueError::new_err(format!("nested more than {DEEPEST} levels deep"))
}

/// A picture or matrix of numbers with `width` columns.
pub fn picture<'py, T: numpy::Element>(
    py: Python<'py>,
    pixels: Vec<T>,
    height: usize,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_vec(py, pixels).reshape([height, width])
}

/// Converts serialisable statistics to dictionaries and lists.
pub fn json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}
