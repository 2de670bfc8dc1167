//! The state of kernels and callbacks, as bytes of a checkpoint.

use rustc_hash::FxHashMap;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;

/// Bytes that are not a valid state of the kernel, callback or chain that reads them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct StateError(pub String);

impl StateError {
    /// A state that is invalid, with the reason.
    pub fn new(message: impl Into<String>) -> Self {
        StateError(message.into())
    }
}

/// Entries in order of their keys, so that equal states give equal bytes.
pub(crate) fn in_order<K: Ord + Copy, T>(map: &FxHashMap<K, T>) -> BTreeMap<K, &T> {
    map.iter().map(|(key, value)| (*key, value)).collect()
}

/// Serialises a value (as CBOR, RFC 8949, which is exact for all numbers and whose reader
/// bounds the depth of nesting).
pub fn pack<T: Serialize>(value: &T) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail, and all types used here can be serialised.
    let _ = ciborium::into_writer(value, &mut bytes);
    bytes
}

/// Restores the value given to [`pack`].
///
/// # Errors
/// If the bytes are not those of a value of this type.
pub fn unpack<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, StateError> {
    ciborium::from_reader(bytes).map_err(|e| StateError(e.to_string()))
}

/// Checks a condition that a valid state satisfies.
pub(crate) fn holds(condition: bool, what: &str) -> Result<(), StateError> {
    if condition {
        Ok(())
    } else {
        Err(StateError::new(format!("the state of {what} does not fit together")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_bit_for_bit() {
        let all = [
            0.0,
            -0.0,
            0.1,
            f64::MIN_POSITIVE / 3.0,
            f64::MAX,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        let back: Vec<f64> = unpack(&pack(&all.to_vec())).unwrap();
        assert!(all.iter().zip(&back).all(|(a, b)| a.to_bits() == b.to_bits()), "{back:?}");
        assert!(unpack::<Vec<f64>>(&[0xff, 0]).is_err());
    }

    #[test]
    fn what_is_too_deep_is_refused() {
        // Arrays of one element, nested a hundred thousand deep.
        let deep = vec![0x81; 100_000];
        assert!(unpack::<pcadlang_numerics::dist::Datum>(&deep).is_err());
    }
}
