//! Values of the language: immutable, cheap to clone, shared by pointer.
//!
//! Scene objects (solids, views, photographs) enter as [`Object`]s and comparators as
//! [`Likelihood`]s, so that neither the language nor the traces depend on how pictures
//! are represented.
//!
//! Values are shared, so a short program can build one with more elements than fit into any
//! memory (`[x, x]` of `[x, x]` of …), and deep nesting endangers every function that walks a
//! value recursively: size and depth are limited.

use super::adjoint::Adjoint;
use super::fault::Fault;
use super::ids::{BlockId, FrameId, NodeId};
use indexmap::IndexMap;
use pcadlang_numerics::dist::{Datum, Dist};
use pcadlang_numerics::rng::Stream;
use pcadlang_syntax::record_key;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// A value.
#[derive(Clone, Default)]
pub enum Value {
    /// No value: the result of a body without one.
    #[default]
    Unit,
    /// A number.
    Num(f64),
    /// A boolean.
    Bool(bool),
    /// A string.
    Str(Arc<str>),
    /// An array of numbers.
    Array(Arc<[f64]>),
    /// An array with at least one element that is not a number.
    List(Arc<[Value]>),
    /// A record, its fields in the order written.
    Record(Arc<Record>),
    /// A function, and the frame in which it was created.
    Closure(Closure),
    /// A function of the table of built-ins, by index.
    Builtin(u32),
    /// The result of `mem(f)`.
    Memo(NodeRef),
    /// Random choices by key, or the results of a `map`, by reference: indexing depends
    /// on one element only.
    Container(NodeRef),
    /// A distribution.
    Dist(Arc<Dist>),
    /// A log density in the scene without a sampler.
    Likelihood(Arc<dyn Likelihood>),
    /// Any object of the host or the scene.
    Object(Arc<dyn Object>),
}

/// The fields of a record.
pub type Record = IndexMap<Arc<str>, Value>;

/// A function value: a lowered body, and the frame whose names it can access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Closure {
    /// The function's block.
    pub block: BlockId,
    /// The frame in which it was created.
    pub frame: FrameId,
}

/// A reference to a node of the trace that holds structure rather than a value. The
/// version changes whenever the set of elements does, so equal references mean equal
/// structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeRef {
    /// The node.
    pub node: NodeId,
    /// Its version.
    pub version: u32,
}

/// A value that is opaque to the language itself: a solid, a camera, a view, a
/// photograph, a host's own type.
pub trait Object: Any + fmt::Debug + Send + Sync {
    /// The name of the type in errors and `doc`.
    fn type_name(&self) -> &'static str;
    /// Returns `self` for downcasting.
    fn as_any(&self) -> &dyn Any;
    /// Returns `self * other`, if the type defines it (a placement times a solid).
    fn multiply(&self, _other: &Value) -> Option<Result<Value, Fault>> {
        None
    }
    /// Returns the adjoints of both sides of `self * other`; `None` if they are not
    /// known.
    #[doc(hidden)]
    fn vjp_product(&self, _other: &Value, _by: &Adjoint) -> Option<[Adjoint; 2]> {
        None
    }
    /// Returns `self.name`, if the type has fields.
    fn field(&self, _name: &str) -> Option<Value> {
        None
    }
    /// Returns a one-line description of its contents for users, if the type has one.
    fn summary(&self) -> Option<String> {
        None
    }
    /// Returns what users should know of it if it was read from a file, such as that it is empty.
    #[doc(hidden)]
    fn remark(&self) -> Option<String> {
        None
    }
    /// Returns the approximate count of numbers that it alone holds, if that is large.
    #[doc(hidden)]
    fn own_numbers(&self) -> usize {
        0
    }
    /// Returns its contents as numbers, whose order and count depend only on its form;
    /// NaN for missing ones.
    fn numbers(&self) -> Option<Vec<f64>> {
        None
    }
}

/// The position of a named point of the scene in the observed picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// Its name.
    pub name: Arc<str>,
    /// The mean position, as fractions of the picture's width and height, from its upper
    /// left corner.
    pub at: [f64; 2],
    /// The variance along an axis, in units of the squared diagonal of the picture.
    pub variance: f64,
    /// The observed position, in the same fractions; the likeliest of several candidates.
    pub observed: [f64; 2],
    /// The position in the scene, in the same fractions.
    pub own: [f64; 2],
    /// The variance along an axis of the point around its position in the scene that no
    /// observation reduces (the systematic variance), in the units of `variance`.
    pub own_variance: f64,
}

/// A log density of an observed value given the scene. It scores; some can sample
/// observations, but none can be drawn from with `~`.
///
/// Data that can be prepared from the observed value alone (such as a distance transform)
/// are prepared once by the implementation and stored with the value.
pub trait Likelihood: fmt::Debug + Send + Sync {
    /// The name used in errors.
    fn name(&self) -> &str;
    /// Returns the log density; never NaN.
    ///
    /// # Errors
    /// If the observed value has the wrong type or cannot be compared ([`Fault::type_error`]);
    /// a state that is impossible may be a [`Fault::domain`], which rejects it.
    fn log_density(&self, observed: &Value) -> Result<f64, Fault>;
    /// Returns the derivatives of the log density with respect to the arguments of the
    /// likelihood, in the form that the derivative of the built-in that makes it expects;
    /// `None` if they are not known.
    fn gradient(&self, _observed: &Value) -> Option<Adjoint> {
        None
    }

    /// True if the density has steps, so that [`Likelihood::gradient`] is that of a smoothed
    /// one: trajectories that follow it are mostly rejected.
    fn has_steps(&self) -> bool {
        false
    }
    /// Samples an observation given the scene, in the form of the observed one and with
    /// the same parts missing. `None` if it has no sampler.
    ///
    /// # Errors
    /// The inner result fails as [`Likelihood::log_density`].
    fn sample(&self, _observed: &Value, _rng: &mut Stream) -> Option<Result<Value, Fault>> {
        None
    }
    /// Returns named points of the scene at the positions that the observation gives
    /// them, if it is more informative than the scene alone.
    fn located(&self, _observed: &Value) -> Vec<Located> {
        Vec::new()
    }
    /// False if the likelihood is unnormalised, so that its scale is a modelling
    /// decision; the run then reports that its posterior is a pseudo-posterior.
    fn is_proper(&self) -> bool {
        true
    }
    /// Describes what is approximate under its settings: single precision, coarser
    /// meshes, truncated distances. The run reports it.
    fn approximations(&self) -> Vec<String> {
        Vec::new()
    }
}

/// The maximum number of elements of a value, including those of its elements, and of an
/// array that a function builds at once.
pub const MOST_ELEMENTS: usize = 10_000_000;
/// The maximum nesting depth of arrays and records, distributions, and covariances.
pub const MOST_NESTED: u32 = 200;

/// True if a value is within the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// It is.
    Fits,
    /// It has more than [`MOST_ELEMENTS`] elements.
    TooLarge,
    /// It is nested more deeply than [`MOST_NESTED`].
    TooDeep,
}

impl Value {
    /// Returns the items that a `for` over it iterates over: its elements, or the names
    /// of a record.
    #[doc(hidden)]
    pub fn passes(&self) -> Vec<Value> {
        match self {
            Value::Record(r) => r.keys().map(|k| Value::Str(Arc::clone(k))).collect(),
            v => (0..v.len().unwrap_or(0)).filter_map(|i| v.element(i)).collect(),
        }
    }

    /// Returns an array of numbers.
    pub fn array(xs: impl Into<Arc<[f64]>>) -> Self {
        Value::Array(xs.into())
    }

    /// Returns a string.
    pub fn str(s: &str) -> Self {
        Value::Str(Arc::from(s))
    }

    /// Returns a record of these fields.
    pub fn record<'a>(fields: impl IntoIterator<Item = (&'a str, Value)>) -> Self {
        Value::Record(Arc::new(fields.into_iter().map(|(k, v)| (Arc::from(k), v)).collect()))
    }

    /// Returns a host or scene object.
    pub fn object(o: impl Object) -> Self {
        Value::Object(Arc::new(o))
    }

    /// Returns the most compact array of these elements: numbers are packed.
    pub fn from_elements(xs: Vec<Value>) -> Self {
        if xs.iter().all(|x| matches!(x, Value::Num(_))) {
            Value::Array(xs.iter().map(|x| if let Value::Num(v) = x { *v } else { 0.0 }).collect())
        } else {
            Value::List(xs.into())
        }
    }

    /// Returns the object inside, if it is a `T`.
    pub fn downcast<T: Object>(&self) -> Option<&T> {
        match self {
            Value::Object(o) => o.as_any().downcast_ref(),
            _ => None,
        }
    }

    /// Returns the name of its type in errors, with an article where appropriate.
    pub fn type_name(&self) -> &'static str {
        match self {
            Value::Unit => "nothing",
            Value::Num(_) => "a number",
            Value::Bool(_) => "a bool",
            Value::Str(_) => "a string",
            Value::Array(_) | Value::List(_) => "an array",
            Value::Record(_) => "a record",
            Value::Closure(_) | Value::Builtin(_) | Value::Memo(_) => "a function",
            Value::Container(_) => "a keyed container",
            Value::Dist(_) => "a distribution",
            Value::Likelihood(_) => "a likelihood",
            Value::Object(o) => o.type_name(),
        }
    }

    /// True if it refers to no frame or node of a trace.
    pub(crate) fn is_portable(&self) -> bool {
        match self {
            Value::Closure(_) | Value::Memo(_) | Value::Container(_) => false,
            Value::List(items) => items.iter().all(Value::is_portable),
            Value::Record(fields) => fields.values().all(Value::is_portable),
            _ => true,
        }
    }

    /// Returns the numbers in it, flattened: bools as 0 and 1, arrays and records element
    /// by element, objects by [`Object::numbers`]; none for anything else.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Value::Num(x) => vec![*x],
            Value::Bool(b) => vec![f64::from(u8::from(*b))],
            Value::Array(xs) => xs.to_vec(),
            Value::List(xs) => xs.iter().flat_map(Value::numbers).collect(),
            Value::Record(r) => r.values().flat_map(Value::numbers).collect(),
            Value::Object(o) => o.numbers().unwrap_or_default(),
            _ => Vec::new(),
        }
    }

    /// Returns the number of elements, for arrays and records.
    pub fn len(&self) -> Option<usize> {
        match self {
            Value::Array(xs) => Some(xs.len()),
            Value::List(xs) => Some(xs.len()),
            Value::Record(r) => Some(r.len()),
            _ => None,
        }
    }

    /// True if it is an array or record without elements.
    pub fn is_empty(&self) -> bool {
        self.len() == Some(0)
    }

    /// Returns element `i` of an array.
    pub fn element(&self, i: usize) -> Option<Value> {
        match self {
            Value::Array(xs) => xs.get(i).map(|x| Value::Num(*x)),
            Value::List(xs) => xs.get(i).cloned(),
            _ => None,
        }
    }

    /// True if two values are the same to the last bit. Shared data are compared by
    /// pointer first, objects only by pointer. It is used to stop propagation, so a false
    /// negative costs time but is never wrong.
    pub fn same(&self, other: &Value) -> bool {
        match (self, other) {
            (Value::Unit, Value::Unit) => true,
            (Value::Num(a), Value::Num(b)) => a.to_bits() == b.to_bits(),
            (Value::Bool(a), Value::Bool(b)) => a == b,
            (Value::Str(a), Value::Str(b)) => a == b,
            (Value::Array(a), Value::Array(b)) => {
                Arc::ptr_eq(a, b)
                    || (a.len() == b.len()
                        && a.iter().zip(b.iter()).all(|(x, y)| x.to_bits() == y.to_bits()))
            }
            (Value::List(a), Value::List(b)) => {
                Arc::ptr_eq(a, b)
                    || (a.len() == b.len() && a.iter().zip(b.iter()).all(|(x, y)| x.same(y)))
            }
            (Value::Record(a), Value::Record(b)) => {
                Arc::ptr_eq(a, b)
                    || (a.len() == b.len()
                        && a.iter().zip(b.iter()).all(|((ka, x), (kb, y))| ka == kb && x.same(y)))
            }
            (Value::Closure(a), Value::Closure(b)) => a == b,
            (Value::Builtin(a), Value::Builtin(b)) => a == b,
            (Value::Memo(a), Value::Memo(b)) | (Value::Container(a), Value::Container(b)) => a == b,
            (Value::Dist(a), Value::Dist(b)) => Arc::ptr_eq(a, b),
            (Value::Likelihood(a), Value::Likelihood(b)) => Arc::ptr_eq(a, b),
            (Value::Object(a), Value::Object(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }

    /// Returns the value of a random choice.
    pub fn from_datum(d: &Datum) -> Self {
        match d {
            Datum::Num(x) => Value::Num(*x),
            Datum::Bool(b) => Value::Bool(*b),
            Datum::Vec(xs) => Value::Array(Arc::clone(xs)),
            Datum::List(xs) => Value::List(xs.iter().map(Value::from_datum).collect()),
        }
    }

    /// Returns the datum of a value that a distribution can generate.
    pub fn to_datum(&self) -> Option<Datum> {
        match self {
            Value::Num(x) => Some(Datum::Num(*x)),
            Value::Bool(b) => Some(Datum::Bool(*b)),
            Value::Array(xs) => Some(Datum::Vec(Arc::clone(xs))),
            Value::List(xs) => {
                xs.iter().map(Value::to_datum).collect::<Option<Arc<[_]>>>().map(Datum::List)
            }
            _ => None,
        }
    }

    /// Returns whether it is within the limits. The time is proportional to its elements,
    /// but does not depend on the numbers in arrays of numbers, and the search stops as
    /// soon as a limit is exceeded.
    #[doc(hidden)]
    pub fn extent(&self) -> Extent {
        let mut left = MOST_ELEMENTS;
        extent(self, MOST_NESTED, &mut left)
    }
}

fn extent(v: &Value, depth: u32, left: &mut usize) -> Extent {
    let elements = match v {
        Value::Array(xs) => xs.len(),
        Value::List(xs) => xs.len(),
        Value::Record(r) => r.len(),
        _ => return Extent::Fits,
    };
    let Some(depth) = depth.checked_sub(1) else { return Extent::TooDeep };
    match left.checked_sub(elements) {
        Some(rest) => *left = rest,
        None => return Extent::TooLarge,
    }
    let mut all = |parts: &mut dyn Iterator<Item = &Value>| {
        parts.map(|p| extent(p, depth, left)).find(|e| *e != Extent::Fits).unwrap_or(Extent::Fits)
    };
    match v {
        Value::List(xs) => all(&mut xs.iter()),
        Value::Record(r) => all(&mut r.values()),
        _ => Extent::Fits,
    }
}

impl From<f64> for Value {
    fn from(x: f64) -> Self {
        Value::Num(x)
    }
}

impl From<bool> for Value {
    fn from(x: bool) -> Self {
        Value::Bool(x)
    }
}

impl From<&str> for Value {
    fn from(x: &str) -> Self {
        Value::str(x)
    }
}

impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// The maximum number of elements of an array that are printed.
const PRINTED: usize = 8;

fn write_list<T>(
    f: &mut fmt::Formatter<'_>,
    xs: &[T],
    mut each: impl FnMut(&mut fmt::Formatter<'_>, &T) -> fmt::Result,
) -> fmt::Result {
    write!(f, "[")?;
    for (i, x) in xs.iter().take(PRINTED).enumerate() {
        if i > 0 {
            write!(f, ", ")?;
        }
        each(f, x)?;
    }
    if xs.len() > PRINTED {
        write!(f, ", … {} in all", xs.len())?;
    }
    write!(f, "]")
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Unit => write!(f, "nothing"),
            Value::Num(x) => write!(f, "{x}"),
            Value::Bool(b) => write!(f, "{b}"),
            Value::Str(s) => write!(f, "{s:?}"),
            Value::Array(xs) => write_list(f, xs, |f, x| write!(f, "{x}")),
            Value::List(xs) => write_list(f, xs, |f, x| write!(f, "{x}")),
            Value::Record(r) if r.is_empty() => write!(f, "{{}}"),
            Value::Record(r) => {
                write!(f, "{{ ")?;
                for (i, (k, v)) in r.iter().enumerate() {
                    write!(f, "{}{}: {v}", if i > 0 { ", " } else { "" }, record_key(k))?;
                }
                write!(f, " }}")
            }
            Value::Closure(_) | Value::Builtin(_) | Value::Memo(_) => write!(f, "a function"),
            Value::Container(_) => write!(f, "a keyed container"),
            Value::Dist(d) => write!(f, "{d:?}"),
            Value::Likelihood(l) => write!(f, "the likelihood {}", l.name()),
            Value::Object(o) => match o.summary() {
                Some(s) => write!(f, "{} ({s})", o.type_name()),
                None => write!(f, "{}", o.type_name()),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_are_no_names_are_shown_in_quotes() {
        let record = |k: &str| Value::Record(Arc::new([(Arc::from(k), Value::Num(1.0))].into()));
        assert_eq!(record("upperarm01.L").to_string(), "{ \"upperarm01.L\": 1 }");
        assert_eq!(record("if").to_string(), "{ if: 1 }");
        assert_eq!(Value::Record(Arc::default()).to_string(), "{}");
    }

    #[test]
    fn depth_and_size_are_bounded_where_they_are_said_to_be() {
        let wrap = |v: Value| Value::List(vec![v, Value::Unit].into());
        let nested = |n: u32| (0..n).fold(Value::Num(1.0), |v, _| wrap(v));
        assert_eq!(nested(MOST_NESTED).extent(), Extent::Fits);
        assert_eq!(nested(MOST_NESTED + 1).extent(), Extent::TooDeep);
        let shared = |n: u32| {
            (0..n).fold(Value::array(vec![1.0; 10]), |v, _| Value::List(vec![v.clone(), v].into()))
        };
        assert_eq!(shared(15).extent(), Extent::Fits);
        assert_eq!(shared(60).extent(), Extent::TooLarge);
        assert_eq!(Value::Num(1.0).extent(), Extent::Fits);
    }
}
