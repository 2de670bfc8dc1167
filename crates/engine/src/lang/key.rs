//! Keys, which identify the elements of containers, the passes of loops and the entries
//! of `mem`.

use super::fault::Fault;
use super::value::Value;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// A key. Numbers are compared by their bits, with -0 replaced by 0; NaN is not a key.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Key {
    /// A number, by its bits.
    Num(u64),
    /// A string.
    Str(Arc<str>),
    /// A boolean.
    Bool(bool),
    /// Several keys: an array, or the arguments of a `mem` function.
    List(Arc<[Key]>),
}

impl Key {
    /// Returns a number's key; `None` for NaN.
    pub fn num(x: f64) -> Option<Key> {
        if x.is_nan() { None } else { Some(Key::Num((x + 0.0).to_bits())) }
    }

    /// Returns the key that a value stands for.
    ///
    /// # Errors
    /// If the value cannot be a key.
    pub fn of(v: &Value) -> Result<Key, Fault> {
        let other = || {
            Fault::type_error(format!(
                "a key must be a number, a string or a bool, got {}",
                v.type_name()
            ))
        };
        Key::from_value(v).ok_or_else(other)
    }

    /// Returns the key that a value stands for; `None` if it cannot be a key (a function,
    /// an object, NaN).
    pub fn from_value(v: &Value) -> Option<Key> {
        match v {
            Value::Num(x) => Key::num(*x),
            Value::Str(s) => Some(Key::Str(Arc::clone(s))),
            Value::Bool(b) => Some(Key::Bool(*b)),
            Value::Array(xs) => {
                xs.iter().map(|x| Key::num(*x)).collect::<Option<_>>().map(Key::List)
            }
            Value::List(xs) => xs.iter().map(Key::from_value).collect::<Option<_>>().map(Key::List),
            _ => None,
        }
    }

    /// Returns the value that the key was made from.
    pub fn to_value(&self) -> Value {
        match self {
            Key::Num(bits) => Value::Num(f64::from_bits(*bits)),
            Key::Str(s) => Value::Str(Arc::clone(s)),
            Key::Bool(b) => Value::Bool(*b),
            Key::List(ks) => Value::from_elements(ks.iter().map(Key::to_value).collect()),
        }
    }

    /// Returns the index, if the key is a whole number that is a valid index.
    pub fn as_index(&self) -> Option<usize> {
        match self {
            Key::Num(bits) => {
                let x = f64::from_bits(*bits);
                ((0.0..9e15).contains(&x) && x == libm::trunc(x)).then_some(x as usize)
            }
            _ => None,
        }
    }

    /// Folds the key into a running 64-bit hash; the same on every platform.
    pub fn hash_into(&self, h: u64) -> u64 {
        match self {
            Key::Num(bits) => mix(mix(h, 1), *bits),
            Key::Str(s) => hash_str(mix(h, 2), s),
            Key::Bool(b) => mix(mix(h, 3), u64::from(*b)),
            Key::List(ks) => ks.iter().fold(mix(mix(h, 4), ks.len() as u64), |h, k| k.hash_into(h)),
        }
    }
}

/// One step of the address hash: a multiply-xorshift mix (the finaliser of SplitMix64,
/// Steele et al. 2014).
pub fn mix(h: u64, x: u64) -> u64 {
    let mut z = (h ^ x.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Folds a string into a running hash.
pub fn hash_str(h: u64, s: &str) -> u64 {
    let mut h = mix(h, s.len() as u64);
    for chunk in s.as_bytes().chunks(8) {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        h = mix(h, u64::from_le_bytes(word));
    }
    h
}

/// True if a string can be written in an address without quotes and cannot be mistaken
/// for something else.
pub(crate) fn is_bare(s: &str) -> bool {
    !s.is_empty()
        && !matches!(s, "true" | "false")
        && s.parse::<f64>().is_err()
        && s.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && !s.starts_with(|c: char| c.is_ascii_digit())
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Key::Num(bits) => write!(f, "{}", f64::from_bits(*bits)),
            Key::Str(s) if is_bare(s) => write!(f, "{s}"),
            Key::Str(s) => write!(f, "{s:?}"),
            Key::Bool(b) => write!(f, "{b}"),
            Key::List(ks) => {
                for (i, k) in ks.iter().enumerate() {
                    write!(f, "{}{k}", if i > 0 { "," } else { "" })?;
                }
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_print_as_addresses_show_them() {
        let show = |v: Value| Key::from_value(&v).map(|k| k.to_string());
        assert_eq!(show(Value::Num(17.0)).as_deref(), Some("17"));
        assert_eq!(show(Value::Num(-0.0)).as_deref(), Some("0"));
        assert_eq!(show(Value::str("arm_l")).as_deref(), Some("arm_l"));
        assert_eq!(
            show(Value::str("a]/b")).as_deref(),
            Some("\"a]/b\""),
            "user names cannot forge separators"
        );
        assert_eq!(show(Value::array(vec![1.0, 2.5])).as_deref(), Some("1,2.5"));
        assert_eq!(show(Value::Num(f64::NAN)), None);
    }

    #[test]
    fn different_keys_hash_differently() {
        let keys = [
            Key::Num(1f64.to_bits()),
            Key::Num(2f64.to_bits()),
            Key::Str("1".into()),
            Key::Bool(true),
            Key::List([Key::Num(1f64.to_bits())].into()),
            Key::List([].into()),
        ];
        for (i, a) in keys.iter().enumerate() {
            for b in &keys[..i] {
                assert_ne!(a.hash_into(7), b.hash_into(7));
            }
        }
    }
}
