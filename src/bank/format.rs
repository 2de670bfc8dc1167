//! The layout of a bank file. All numbers are little-endian:
//!
//! | bytes | what |
//! | --- | --- |
//! | 0..8 | `PCADBANK` |
//! | 8..12 | the version of the format, u32 |
//! | 12..16 | 0 |
//! | 16..24 | N, the number of entries, u64 |
//! | 24..32 | M, the number of features of each, u64 |
//! | 32..40 | where the table of places is, u64 |
//! | 40..48 | where the header is, u64; it ends with the file |
//! | 48..56 | the FNV-1a hash of the header, u64 |
//! | 56..64 | 0 |
//! | 64.. | features: N rows of M f32 |
//! | … | latents of each entry (see `record.rs`) |
//! | … | the table: where each entry's latents begin, and where the last end, N + 1 u64 |
//! | … | the header, JSON |

use super::{BankError, Features};
use serde::{Deserialize, Serialize};

/// What a bank begins with.
pub(super) const MAGIC: &[u8; 8] = b"PCADBANK";
/// The version this code writes, and the only one it reads.
pub(super) const VERSION: u32 = 1;
/// Where the features begin.
pub(super) const START: u64 = 64;

/// What a bank is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The program's file, as it was called.
    pub name: String,
    /// The hash of the program's text, includes and parameters.
    pub program: String,
    /// The seed the entries were drawn with.
    pub seed: u64,
    /// How features are found.
    pub features: Features,
    /// Every address that occurs: its hash, in hexadecimal, and its text.
    pub addresses: Vec<(String, String)>,
}

/// The first bytes of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Preamble {
    /// Entries.
    pub count: u64,
    /// Features of each.
    pub width: u64,
    /// Where the table is.
    pub table: u64,
    /// Where the header is.
    pub header: u64,
    /// The hash of the header.
    pub hash: u64,
}

impl Preamble {
    pub fn encode(&self) -> [u8; START as usize] {
        let mut b = [0; START as usize];
        b[..8].copy_from_slice(MAGIC);
        b[8..12].copy_from_slice(&VERSION.to_le_bytes());
        for (i, x) in
            [self.count, self.width, self.table, self.header, self.hash].iter().enumerate()
        {
            b[16 + 8 * i..24 + 8 * i].copy_from_slice(&x.to_le_bytes());
        }
        b
    }

    /// Reads it, and checks it against the length of the file.
    ///
    /// # Errors
    /// If it is not that of a whole bank of this version.
    pub fn decode(b: &[u8], length: u64) -> Result<Preamble, BankError> {
        let word = |i: usize| {
            b.get(i..i + 8).and_then(|w| w.try_into().ok()).map_or(0, u64::from_le_bytes)
        };
        if b.get(..8) != Some(MAGIC) {
            return Err(BankError::NoBank);
        }
        if b.len() < START as usize {
            return Err(BankError::Damaged("it is truncated".into()));
        }
        let found = word(8) as u32;
        if found != VERSION {
            return Err(BankError::Version { found, expected: VERSION });
        }
        let p = Preamble {
            count: word(16),
            width: word(24),
            table: word(32),
            header: word(40),
            hash: word(48),
        };
        let features = p
            .count
            .checked_mul(p.width)
            .and_then(|n| n.checked_mul(4))
            .and_then(|n| n.checked_add(START));
        let table = p
            .count
            .checked_add(1)
            .and_then(|n| n.checked_mul(8))
            .and_then(|n| n.checked_add(p.table));
        let fits = features.is_some_and(|end| end <= p.table)
            && table == Some(p.header)
            && p.header < length;
        if !fits || p.count == 0 {
            return Err(BankError::Damaged(
                "it is truncated, or its parts are inconsistent".into(),
            ));
        }
        Ok(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preambles_come_back_and_nonsense_is_refused() {
        let p =
            Preamble { count: 3, width: 5, table: 64 + 60 + 7, header: 64 + 60 + 7 + 32, hash: 9 };
        assert_eq!(Preamble::decode(&p.encode(), 1000).unwrap(), p);
        assert!(
            matches!(Preamble::decode(&p.encode(), 163), Err(BankError::Damaged(_))),
            "no room for a header"
        );
        assert!(matches!(Preamble::decode(&p.encode()[..40], 40), Err(BankError::Damaged(_))));
        assert!(matches!(Preamble::decode(b"PNG", 3), Err(BankError::NoBank)));
        let huge = Preamble { count: u64::MAX, width: u64::MAX, ..p };
        assert!(matches!(Preamble::decode(&huge.encode(), 1000), Err(BankError::Damaged(_))));
        let mut other = p.encode();
        other[8] = 7;
        assert!(matches!(
            Preamble::decode(&other, 1000),
            Err(BankError::Version { found: 7, expected: VERSION })
        ));
    }
}
