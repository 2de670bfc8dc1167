//! A fingerprint of a program's text.

/// The 64-bit FNV-1a hash of a text as 16 hexadecimal digits: tells programs apart, keeps no secrets (Fowler, Noll & Vo;
/// IETF draft-eastlake-fnv).
pub fn text_hash(text: &str) -> String {
    bytes_hash(text.as_bytes())
}

/// As [`text_hash`](super::text_hash), of any bytes.
pub fn bytes_hash(bytes: &[u8]) -> String {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_values() {
        assert_eq!(text_hash(""), "cbf29ce484222325");
        assert_eq!(text_hash("a"), "af63dc4c8601ec8c");
        assert_eq!(text_hash("foobar"), "85944171f73967e8");
    }
}
