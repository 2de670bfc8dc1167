//! Addresses: the path that leads to a random choice or observation, as a value and as
//! text.
//!
//! An address that is printed reads back as the same address, except if keys are arrays
//! of one element or of arrays, which print as their elements. Patterns with wildcards
//! and the address literals of programs are in other modules.

use super::key::{Key, hash_str, mix};
use std::fmt;
use std::str::FromStr;
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
    /// The textual occurrence, from 1; 0 prints as nothing and is equivalent to 1.
    pub occurrence: u32,
    /// The keys of loops, containers, `map`, `iid` and `mem`.
    pub keys: Vec<Key>,
}

/// The hash of the empty address.
pub(crate) const ROOT_HASH: u64 = 0x7063_6164_6c61_6e67;

/// Returns the hash of a segment without its keys.
pub(super) fn segment_hash(name: &str, occurrence: u32) -> u64 {
    mix(hash_str(0x5e67_3a11, name), u64::from(occurrence))
}

impl Address {
    /// Returns a 64-bit hash, the same on every platform, which keys the random stream of
    /// the choice.
    pub fn hash64(&self) -> u64 {
        self.segments.iter().fold(ROOT_HASH, |h, s| {
            let h = mix(h, segment_hash(&s.name, s.occurrence));
            s.keys.iter().fold(h, |h, k| k.hash_into(h))
        })
    }

    /// True if this address is `other` or below it: the same segments, with the same
    /// leading keys at the last of them.
    pub fn starts_with(&self, other: &Address) -> bool {
        let Some((last, init)) = other.segments.split_last() else { return true };
        self.segments.len() >= other.segments.len() && self.segments[..init.len()] == *init && {
            let s = &self.segments[init.len()];
            s.name == last.name && s.occurrence == last.occurrence && s.keys.starts_with(&last.keys)
        }
    }
}

impl Address {
    /// Returns the address as text for messages; a long one is shortened to its first and
    /// last segments.
    pub fn shortened(&self) -> String {
        let n = self.segments.len();
        if n <= 12 {
            return self.to_string();
        }
        let part =
            |s: &[AddressSegment]| s.iter().map(ToString::to_string).collect::<Vec<_>>().join("/");
        format!(
            "@{}/… {} more …/{}",
            part(&self.segments[..4]),
            n - 7,
            part(&self.segments[n - 3..])
        )
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

/// True if a name is one given to unnamed observations or factors, which always show
/// their number.
pub(crate) fn is_numbered(name: &str) -> bool {
    name == "obs" || name == "factor"
}

/// The error for a text that is not an address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is not an address: expected {expected} at byte {at}; an example of an address \
         is @pose[arm_l]/bone#2/rot[0]"
)]
pub struct AddressTextError {
    /// The text.
    pub text: String,
    /// The byte offset at which reading stopped.
    pub at: usize,
    /// The expected text.
    pub expected: &'static str,
}

impl FromStr for Address {
    type Err = AddressTextError;

    /// Reads an address in its printed form; the `@` may be omitted.
    fn from_str(text: &str) -> Result<Self, AddressTextError> {
        let mut rest = text.strip_prefix('@').unwrap_or(text);
        let wrong = |rest: &str, expected| AddressTextError {
            text: text.to_owned(),
            at: text.len() - rest.len(),
            expected,
        };
        let mut segments = Vec::new();
        loop {
            let name = take(&mut rest, |c| c.is_alphanumeric() || c == '_');
            if name.is_empty() {
                return Err(wrong(rest, "a name"));
            }
            let mut segment =
                AddressSegment { name: Arc::from(name), occurrence: 1, keys: Vec::new() };
            if let Some(after) = rest.strip_prefix('#') {
                rest = after;
                let digits = take(&mut rest, |c| c.is_ascii_digit());
                segment.occurrence = digits
                    .parse()
                    .ok()
                    .filter(|n| *n > 0)
                    .ok_or(wrong(after, "a number from 1"))?;
            }
            while let Some(after) = rest.strip_prefix('[') {
                rest = after;
                segment.keys.push(read_key(&mut rest).ok_or_else(|| wrong(rest, "a key and `]`"))?);
            }
            segments.push(segment);
            match rest.strip_prefix('/') {
                Some(after) => rest = after,
                None if rest.is_empty() => return Ok(Address { segments }),
                None => return Err(wrong(rest, "`/`, `#`, `[` or the end")),
            }
        }
    }
}

/// Takes the leading characters of a given kind.
fn take<'t>(rest: &mut &'t str, of_kind: impl Fn(char) -> bool) -> &'t str {
    let (taken, left) = rest.split_at(rest.find(|c| !of_kind(c)).unwrap_or(rest.len()));
    *rest = left;
    taken
}

/// Takes a key up to its closing bracket: a single one, or several separated by commas.
fn read_key(rest: &mut &str) -> Option<Key> {
    let mut keys = Vec::new();
    loop {
        keys.push(match rest.strip_prefix('"') {
            Some(after) => {
                *rest = after;
                Key::Str(quoted(rest)?.into())
            }
            None => {
                let word = take(rest, |c| !matches!(c, ',' | ']'));
                match (word, word.parse::<f64>()) {
                    ("true", _) => Key::Bool(true),
                    ("false", _) => Key::Bool(false),
                    (_, Ok(x)) => Key::num(x)?,
                    _ if super::key::is_bare(word) => Key::Str(word.into()),
                    _ => return None,
                }
            }
        });
        if let Some(after) = rest.strip_prefix(',') {
            *rest = after;
            continue;
        }
        *rest = rest.strip_prefix(']')?;
        return if keys.len() == 1 { keys.pop() } else { Some(Key::List(keys.into())) };
    }
}

/// Takes the rest of a string printed with escapes, and its closing quote.
fn quoted(rest: &mut &str) -> Option<String> {
    let mut text = String::new();
    let mut chars = rest.chars();
    loop {
        text.push(match chars.next()? {
            '"' => break,
            '\\' => match chars.next()? {
                'n' => '\n',
                'r' => '\r',
                't' => '\t',
                '0' => '\0',
                'u' => {
                    let (code, after) = chars.as_str().strip_prefix('{')?.split_once('}')?;
                    chars = after.chars();
                    char::from_u32(u32::from_str_radix(code, 16).ok()?)?
                }
                c => c,
            },
            c => c,
        });
    }
    *rest = chars.as_str();
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_reads_back() {
        let key = |s: &str| Key::Str(s.into());
        let number = |x: f64| Key::Num(x.to_bits());
        let keys = [
            vec![],
            vec![number(17.0), number(-2.5)],
            vec![number(1e300), number(f64::INFINITY)],
            vec![key("arm_l"), key("a]/b"), key("é \"\\\n\u{7}"), key("")],
            vec![Key::Bool(true), key("true"), key("inf"), key("nan"), key("Infinity")],
            vec![Key::List([number(1.0), key("x,y"), Key::Bool(false)].into())],
        ];
        let names = ["x", "obs", "factor", "été_2"];
        let segment = |i: usize, keys: &Vec<Key>| AddressSegment {
            name: names[i % 4].into(),
            occurrence: 1 + (i % 3) as u32,
            keys: keys.clone(),
        };
        let segments: Vec<_> = keys.iter().enumerate().map(|(i, k)| segment(i, k)).collect();
        for n in 1..=segments.len() {
            for start in 0..=segments.len() - n {
                let address = Address { segments: segments[start..start + n].to_vec() };
                let text = address.to_string();
                assert_eq!(text.parse().as_ref(), Ok(&address), "{text}");
                assert_eq!(text[1..].parse().as_ref(), Ok(&address), "{text} without its @");
            }
        }
    }

    #[test]
    fn what_is_no_address_is_told() {
        for text in [
            "", "@", "@a/", "@a[", "@a[1", "@a[]", "@a[a b]", "@a#0", "@a#x", "@a b", "@a[\"b]",
            "@a[nan]", "@**",
        ] {
            let e = text.parse::<Address>().unwrap_err();
            assert!(
                e.at <= text.len() && e.to_string().contains("is not an address"),
                "{text}: {e}"
            );
        }
        assert_eq!("@a/b c".parse::<Address>().unwrap_err().at, 4);
    }
}
