//! Positions in a JSON document, so that errors can name their path, and the errors of
//! keypoints, with hints.

use serde_json::Value;
use std::fmt;

/// An error in keypoints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeypointsError {
    /// The fault, with the path in the file.
    pub message: String,
    /// How to fix it.
    pub hint: Option<String>,
}

impl KeypointsError {
    pub(super) fn new(message: impl Into<String>) -> KeypointsError {
        KeypointsError { message: message.into(), hint: None }
    }

    pub(super) fn hint(self, hint: impl Into<String>) -> KeypointsError {
        KeypointsError { hint: Some(hint.into()), ..self }
    }
}

impl fmt::Display for KeypointsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)?;
        self.hint.as_ref().map_or(Ok(()), |h| write!(f, "; {h}"))
    }
}

impl std::error::Error for KeypointsError {}

/// Joins the first few of some names, for messages.
pub(super) fn first<'a>(names: impl ExactSizeIterator<Item = &'a str>, most: usize) -> String {
    let all = names.len();
    let mut text = names.take(most).collect::<Vec<_>>().join(", ");
    if all > most {
        text.push_str(&format!(", … {all} in all"));
    }
    text
}

/// A value and its path.
#[derive(Clone, Debug)]
pub(super) struct Node<'a> {
    pub value: &'a Value,
    path: String,
}

impl<'a> Node<'a> {
    pub fn root(value: &'a Value) -> Node<'a> {
        Node { value, path: String::new() }
    }

    /// Returns the field of an object; `None` if it is absent or this is not an object.
    pub fn get(&self, field: &str) -> Option<Node<'a>> {
        self.value.get(field).map(|value| self.field(field, value))
    }

    fn field(&self, field: &str, value: &'a Value) -> Node<'a> {
        let dot = if self.path.is_empty() { "" } else { "." };
        Node { value, path: format!("{}{dot}{field}", self.path) }
    }

    /// The fields of an object.
    pub fn fields(&self) -> impl Iterator<Item = (&'a str, Node<'a>)> {
        self.value.as_object().into_iter().flatten().map(|(k, v)| (k.as_str(), self.field(k, v)))
    }

    /// The elements of a list.
    pub fn items(&self) -> impl Iterator<Item = Node<'a>> {
        let path = &self.path;
        let items = self.value.as_array().into_iter().flatten().enumerate();
        items.map(move |(i, value)| Node { value, path: format!("{path}[{i}]") })
    }

    /// The number of elements of a list; 0 for anything else.
    pub fn len(&self) -> usize {
        self.value.as_array().map_or(0, Vec::len)
    }

    /// The place in the file, for messages.
    pub fn place(&self) -> String {
        if self.path.is_empty() { "the file".to_owned() } else { format!("`{}`", self.path) }
    }

    /// Returns the error that this is not the expected value.
    pub fn wrong(&self, wanted: &str) -> KeypointsError {
        let got = match self.value {
            Value::Null => "null".to_owned(),
            Value::Bool(b) => b.to_string(),
            Value::Number(n) => n.to_string(),
            Value::String(s) if s.chars().count() <= 40 => format!("{s:?}"),
            Value::String(_) => "a string".to_owned(),
            Value::Array(a) => format!("a list of {}", a.len()),
            Value::Object(_) => "an object".to_owned(),
        };
        KeypointsError::new(format!("{} must be {wanted}, got {got}", self.place()))
    }

    /// Returns a finite number.
    pub fn number(&self, wanted: &str) -> Result<f64, KeypointsError> {
        self.value.as_f64().filter(|x| x.is_finite()).ok_or_else(|| self.wrong(wanted))
    }

    /// Returns the numbers of a list, NaN for null.
    pub fn numbers(&self, wanted: &str) -> Result<Vec<f64>, KeypointsError> {
        let Value::Array(values) = self.value else { return Err(self.wrong(wanted)) };
        let number = |(i, v): (usize, &Value)| match v {
            Value::Null => Ok(f64::NAN),
            _ => v
                .as_f64()
                .filter(|x| x.is_finite())
                .ok_or_else(|| self.items().nth(i).unwrap_or_else(|| self.clone()).wrong(wanted)),
        };
        values.iter().enumerate().map(number).collect()
    }

    /// Returns a string, or a number as it is written.
    pub fn id(&self) -> Result<String, KeypointsError> {
        match self.value {
            Value::String(s) => Ok(s.clone()),
            Value::Number(n) => Ok(n.to_string()),
            _ => Err(self.wrong("a number or a string")),
        }
    }

    /// Returns `width` and `height` of an object if both are positive integers.
    pub fn size(&self) -> Option<(u32, u32)> {
        let side = |name: &str| {
            let x = self.value.get(name)?.as_u64()?;
            u32::try_from(x).ok().filter(|x| *x > 0)
        };
        Some((side("width")?, side("height")?))
    }
}
