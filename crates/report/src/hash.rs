//! A fingerprint of a program's text.

use pcadlang_numerics::num::fnv1a;

/// Returns the 64-bit FNV-1a hash of a text as 16 hexadecimal digits. It distinguishes
/// programs, but is not cryptographic.
pub fn text_hash(text: &str) -> String {
    bytes_hash(text.as_bytes())
}

/// Does the same as [`text_hash`](super::text_hash) for arbitrary bytes.
pub fn bytes_hash(bytes: &[u8]) -> String {
    format!("{:016x}", fnv1a(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_digits() {
        assert_eq!(text_hash("foobar"), "85944171f73967e8");
        assert!((0..200u8).all(|b| bytes_hash(&[b]).len() == 16));
    }
}
