//! Addresses: the path that leads to a random choice or observation.

use super::code::segment_hash;
use super::key::{Key, mix};
use std::fmt;
use std::sync::Arc;

/// The address of a choice, an observation or a factor: `@pose[upperarm_l]/bone/rot[z]`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Address {
    /// The segments between slashes.
    pub segments: Vec<AddressSegment>,
}

/// One segment of an [`Address`].
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AddressSegment {
    /// The name of a binding, function, or observation.
    pub name: Arc<str>,
    /// Which textual occurrence, from 1; 0 prints as nothing and equals 1.
    pub occurrence: u32,
    /// The keys of loops, containers, `map`, `iid` and `mem`.
    pub keys: Vec<Key>,
}

/// The hash of the empty address.
pub(crate) const ROOT_HASH: u64 = 0x7063_6164_6c61_6e67;

impl Address {
    /// A 64-bit hash, the same on every platform: it keys the random stream of the choice.
    pub fn hash64(&self) -> u64 {
        self.segments.iter().fold(ROOT_HASH, |h, s| {
            let h = mix(h, segment_hash(&s.name, s.occurrence));
            s.keys.iter().fold(h, |h, k| k.hash_into(h))
        })
    }

    /// Whether this address is `other` or lies below it: same segments, and at the last of them the same leading keys.
    pub fn starts_with(&self, other: &Address) -> bool {
        let Some((last, init)) = other.segments.split_last() else { return true };
        self.segments.len() >= other.segments.len() && self.segments[..init.len()] == *init && {
            let s = &self.segments[init.len()];
            s.name == last.name && s.occurrence == last.occurrence && s.keys.starts_with(&last.keys)
        }
    }
}

impl Address {
    /// The address as text for messages: of a long one the first and last segments.
    pub fn shortened(&self) -> String {
        let n = self.segments.len();
        if n <= 12 {
            return self.to_string();
        }
        let part = |s: &[AddressSegment]| s.iter().map(ToString::to_string).collect::<Vec<_>>().join("/");
        format!("@{}/… {} more …/{}", part(&self.segments[..4]), n - 7, part(&self.segments[n - 3..]))
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "@")?;
        for (i, s) in self.segments.iter().enumerate() {
            if i > 0 {
                write!(f, "/")?;
            }
            write!(f, "{s}")?;
        }
        Ok(())
    }
}

impl fmt::Display for AddressSegment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.name)?;
        if self.occurrence > 1 || (self.occurrence == 1 && is_numbered(&self.name)) {
            write!(f, "#{}", self.occurrence)?;
        }
        for k in &self.keys {
            write!(f, "[{k}]")?;
        }
        Ok(())
    }
}

/// Names given to observations and factors without one of their own; they always show their number.
pub(crate) fn is_numbered(name: &str) -> bool {
    name == "obs" || name == "factor"
}
