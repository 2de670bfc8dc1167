//! The constants of a graph model.

use super::super::NetworkError;
use super::super::file::format;
use super::super::network::MOST_NUMBERS;
use super::file::Group;
use half::slice::HalfFloatSliceExt;
use std::collections::HashMap;

type Result<T> = core::result::Result<T, NetworkError>;

/// How a number is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Half,
    Float,
    Integer,
}

/// A constant, as stored.
#[derive(Debug)]
pub(super) struct Constant<'a> {
    pub shape: Vec<usize>,
    kind: Kind,
    bytes: &'a [u8],
}

/// Returns the constants by name. Their bytes follow each other without gaps.
pub(super) fn read<'a>(
    manifest: Vec<Group>,
    bytes: &'a [u8],
) -> Result<HashMap<String, Constant<'a>>> {
    let mut rest = bytes;
    let mut all = HashMap::new();
    for w in manifest.into_iter().flat_map(|g| g.weights) {
        let stored = w.quantization.as_ref().map_or(&*w.dtype, |q| &*q.dtype);
        let (kind, width) = match (&*w.dtype, stored) {
            ("float32", "float32") => (Kind::Float, 4),
            ("float32", "float16") => (Kind::Half, 2),
            ("int32", "int32") => (Kind::Integer, 4),
            (kind, stored) => {
                let (name, what) = (&w.name, "32- or 16-bit floats or 32-bit integers");
                let why = format!("the constant {name} is not of {what}: {kind} as {stored}");
                return Err(NetworkError::Format(why));
            }
        };
        let size = w.shape.iter().try_fold(1usize, |n, s| n.checked_mul(*s));
        let size = size.filter(|n| *n <= MOST_NUMBERS && w.shape.len() <= 8);
        let size = size.ok_or_else(|| {
            NetworkError::TooLarge(format!("the constant {} of shape {:?}", w.name, w.shape))
        })?;
        let (own, others) = rest.split_at_checked(size * width).ok_or_else(|| {
            format("the file of weights ends before the last constant: is it the model's?")
        })?;
        rest = others;
        if all.insert(w.name, Constant { shape: w.shape, kind, bytes: own }).is_some() {
            return Err(format("two constants have the same name"));
        }
    }
    if !rest.is_empty() {
        return Err(format(
            "the file of weights goes beyond the last constant: is it the model's?",
        ));
    }
    Ok(all)
}

impl Constant<'_> {
    pub fn len(&self) -> usize {
        self.bytes.len() / if self.kind == Kind::Half { 2 } else { 4 }
    }

    /// Returns its floats; `None` if it is of integers.
    pub fn floats(&self) -> Option<Vec<f32>> {
        let words = self.bytes.as_chunks::<4>().0.iter();
        match self.kind {
            Kind::Integer => None,
            Kind::Float => Some(words.map(|b| f32::from_le_bytes(*b)).collect()),
            Kind::Half => {
                let halves = self.bytes.as_chunks::<2>().0.iter();
                let halves: Vec<_> = halves.map(|b| half::f16::from_le_bytes(*b)).collect();
                Some(halves.to_f32_vec())
            }
        }
    }

    /// Returns its integers; `None` if it is of floats.
    pub fn integers(&self) -> Option<Vec<i32>> {
        let words = self.bytes.as_chunks::<4>().0.iter();
        (self.kind == Kind::Integer).then(|| words.map(|b| i32::from_le_bytes(*b)).collect())
    }
}
