//! The layout of a bank file. All numbers are little-endian:
//!
//! | bytes | content |
//! | --- | --- |
//! | 0..8 | `PCADBANK` |
//! | 8..12 | the format version, u32 |
//! | 12..16 | 0 |
//! | 16..24 | N, the number of entries, u64 |
//! | 24..32 | M, the number of features per entry, u64 |
//! | 32..40 | the offset of the table, u64 |
//! | 40..48 | the offset of the header, which extends to the end of the file, u64 |
//! | 48..56 | the FNV-1a hash of the header, u64 |
//! | 56..64 | 0 |
//! | 64.. | features: N rows of M f32 |
//! | … | latents of each entry (see `record.rs`) |
//! | … | the table: offsets of the entries' latents and the end of the last, N + 1 u64 |
//! | … | the header, JSON |

use super::{BankError, Features};
use serde::{Deserialize, Serialize};

/// The first bytes of every bank.
pub(super) const MAGIC: &[u8; 8] = b"PCADBANK";
/// The format version that is written, and the only one that can be read.
pub(super) const VERSION: u32 = 1;
/// The offset of the features.
pub(super) const START: u64 = 64;

/// Metadata of a bank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The program's file name.
    pub name: String,
    /// The hash of the program's text, includes and parameters.
    pub program: String,
    /// The seed with which the entries were drawn.
    pub seed: u64,
    /// How the features are computed.
    pub features: Features,
    /// Every address that occurs: its hash in hexadecimal, and its text.
    pub addresses: Vec<(String, String)>,
}

/// The fixed-size start of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Preamble {
    /// The number of entries.
    pub count: u64,
    /// The number of features per entry.
    pub width: u64,
    /// The offset of the table.
    pub table: u64,
    /// The offset of the header.
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

    /// Reads the preamble and checks it against the length of the file.
    ///
    /// # Errors
    /// If it does not belong to a complete bank of this version.
    pub fn decode(b: &[u8], length: u64) -> Result<Preamble, BankError> {
        let word = |i: usize| {
            b.get(i..i + 8).and_then(|w| w.try_into().ok()).map_or(0, u64::from_le_bytes)
        };
        if b.get(..8) != Some(MAGIC) {
            return Err(BankError::NotABank);
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
        assert!(matches!(Preamble::decode(b"PNG", 3), Err(BankError::NotABank)));
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
