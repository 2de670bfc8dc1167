//! The constants of a graph model.

use super::super::NetworkError;
use super::super::file::format;
use super::super::network::MOST_NUMBERS;
use super::super::weights::{Kind, Numbers};
use super::file::Group;
use std::collections::HashMap;

type Result<T> = core::result::Result<T, NetworkError>;

/// A constant, as stored.
#[derive(Clone, Debug)]
pub(super) struct Constant<'a> {
    pub shape: Vec<usize>,
    /// `None` if it is of integers.
    kind: Option<Kind>,
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
            ("float32", "float32") => (Some(Kind::Float), 4),
            ("float32", "float16") => (Some(Kind::Half), 2),
            ("int32", "int32") => (None, 4),
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

impl<'a> Constant<'a> {
    pub fn len(&self) -> usize {
        self.bytes.len() / if self.kind == Some(Kind::Half) { 2 } else { 4 }
    }

    /// Returns its floats; `None` if it is of integers.
    pub fn floats(&self) -> Option<Numbers<'a>> {
        self.kind.map(|kind| Numbers::new(kind, self.bytes))
    }

    /// Returns its integers; `None` if it is of floats.
    pub fn integers(&self) -> Option<Vec<i32>> {
        let words = self.bytes.as_chunks::<4>().0.iter();
        self.kind.is_none().then(|| words.map(|b| i32::from_le_bytes(*b)).collect())
    }
}
