//! The latents of one entry, and their encoding in a file (little-endian).
//!
//! The number of choices (u32) is followed, for each choice, by the index of its address
//! in the header's table (u32), its stored value, and its unconstrained coordinates:
//! their number (u32; the largest u32 means that they equal the stored numbers) and the
//! numbers (f64). A value is a tag (u8) followed by its content: 0, a truth value (u8);
//! 1, a number (f64); 2, numbers (their count, u32, then f64 each); 3, values (their
//! count, u32, then each value).

use pcadlang_inference::{Latent, Latents};
use pcadlang_numerics::dist::Datum;
use std::sync::Arc;

/// Stands for the number of coordinates if they equal the stored numbers.
const SAME: u32 = u32::MAX;
/// The deepest nesting of values that is accepted: no distribution draws more deeply
/// nested values.
const DEEPEST: u32 = 8;

/// A choice of a scene, with its address.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// The hash of its address.
    pub hash: u64,
    /// Its address as text.
    pub address: String,
    /// Its stored value.
    pub stored: Datum,
    /// Its unconstrained coordinates, if it is continuous.
    pub free: Option<Vec<f64>>,
}

/// A scene in a bank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// The choices on which its picture depends.
    pub latents: Vec<Named>,
    /// The features of its picture.
    pub features: Vec<f32>,
}

/// Converts choices to the form that proposals use.
pub(super) fn latents(choices: &[Named]) -> Latents {
    let latent = |c: &Named| match &c.free {
        Some(y) => Latent::Free(y.clone()),
        None => Latent::Discrete(c.stored.clone()),
    };
    choices.iter().map(|c| (c.hash, latent(c))).collect()
}

/// Appends the encoded choices; `index` returns the position of an address in the table.
pub(super) fn encode(choices: &[Named], mut index: impl FnMut(&Named) -> u32, out: &mut Vec<u8>) {
    out.extend((choices.len() as u32).to_le_bytes());
    for c in choices {
        out.extend(index(c).to_le_bytes());
        encode_datum(&c.stored, out);
        match &c.free {
            None => out.extend(0u32.to_le_bytes()),
            Some(y) if is_same(&c.stored, y) => out.extend(SAME.to_le_bytes()),
            Some(y) => {
                out.extend((y.len() as u32).to_le_bytes());
                y.iter().for_each(|x| out.extend(x.to_le_bytes()));
            }
        }
    }
}

fn is_same(stored: &Datum, y: &[f64]) -> bool {
    match stored {
        Datum::Num(x) => y.len() == 1 && x.to_bits() == y[0].to_bits(),
        Datum::Vec(xs) => {
            xs.len() == y.len() && xs.iter().zip(y).all(|(a, b)| a.to_bits() == b.to_bits())
        }
        _ => false,
    }
}

fn encode_datum(d: &Datum, out: &mut Vec<u8>) {
    match d {
        Datum::Bool(b) => out.extend([0, u8::from(*b)]),
        Datum::Num(x) => {
            out.push(1);
            out.extend(x.to_le_bytes());
        }
        Datum::Vec(xs) => {
            out.push(2);
            out.extend((xs.len() as u32).to_le_bytes());
            xs.iter().for_each(|x| out.extend(x.to_le_bytes()));
        }
        Datum::List(xs) => {
            out.push(3);
            out.extend((xs.len() as u32).to_le_bytes());
            xs.iter().for_each(|x| encode_datum(x, out));
        }
    }
}

/// Decodes choices; `None` if the bytes are not a valid entry. `addresses` holds the
/// hashes and texts of the header's table.
pub(super) fn decode(mut bytes: &[u8], addresses: &[(u64, String)]) -> Option<Vec<Named>> {
    let b = &mut bytes;
    let count = u32(b)?;
    let mut choices = Vec::new();
    for _ in 0..count {
        let (hash, address) = addresses.get(u32(b)? as usize)?;
        let stored = datum(b, DEEPEST)?;
        let free = match (u32(b)?, &stored) {
            (0, _) => None,
            (SAME, Datum::Num(x)) => Some(vec![*x]),
            (SAME, Datum::Vec(xs)) => Some(xs.to_vec()),
            (SAME, _) => return None,
            (n, _) => Some(numbers(b, n)?),
        };
        choices.push(Named { hash: *hash, address: address.clone(), stored, free });
    }
    b.is_empty().then_some(choices)
}

fn datum(b: &mut &[u8], depth: u32) -> Option<Datum> {
    Some(match take::<1>(b)? {
        [0] => Datum::Bool(take::<1>(b)? != [0]),
        [1] => Datum::Num(f64::from_le_bytes(take(b)?)),
        [2] => {
            let n = u32(b)?;
            Datum::Vec(numbers(b, n)?.into())
        }
        [3] if depth > 0 => {
            let n = u32(b)?;
            let all: Option<Vec<Datum>> = (0..n).map(|_| datum(b, depth - 1)).collect();
            Datum::List(Arc::from(all?))
        }
        _ => return None,
    })
}

fn numbers(b: &mut &[u8], n: u32) -> Option<Vec<f64>> {
    (0..n).map(|_| take(b).map(f64::from_le_bytes)).collect()
}

fn u32(b: &mut &[u8]) -> Option<u32> {
    take(b).map(u32::from_le_bytes)
}

fn take<const N: usize>(b: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = b.split_first_chunk::<N>()?;
    *b = rest;
    Some(*first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_come_back_to_the_last_bit() {
        let named = |hash: u64, stored: Datum, free: Option<Vec<f64>>| Named {
            hash,
            address: format!("@{hash}"),
            stored,
            free,
        };
        let nested =
            Datum::List(Arc::from([Datum::Bool(true), Datum::List(Arc::from([Datum::Num(1.0)]))]));
        let all = [
            named(0, Datum::Num(-0.0), Some(vec![-0.0])),
            named(1, Datum::Num(0.3), Some(vec![-0.8472978603872037])),
            named(2, vec![1.0, 5e-324].into(), Some(vec![1.0, 5e-324])),
            named(3, Datum::Bool(true), None),
            named(4, nested, None),
            named(5, Datum::Vec(Arc::from([])), None),
        ];
        let addresses: Vec<(u64, String)> =
            all.iter().map(|c| (c.hash, c.address.clone())).collect();
        let mut bytes = Vec::new();
        encode(&all, |c| c.hash as u32, &mut bytes);
        assert_eq!(decode(&bytes, &addresses).as_deref(), Some(&all[..]));
        assert!((0..bytes.len()).all(|n| decode(&bytes[..n], &addresses).is_none()), "cut short");
        assert!(decode(&bytes, &addresses[..3]).is_none(), "an address that is not there");
        assert_eq!(latents(&all)[&3], Latent::Discrete(Datum::Bool(true)));
        assert_eq!(latents(&all)[&1], Latent::Free(vec![-0.8472978603872037]));
    }

    #[test]
    fn absurd_counts_do_not_take_memory() {
        let mut bytes = 1u32.to_le_bytes().to_vec();
        bytes.extend(0u32.to_le_bytes());
        bytes.push(2);
        bytes.extend(u32::MAX.to_le_bytes());
        assert_eq!(decode(&bytes, &[(0, String::new())]), None);
        let deep: Vec<u8> =
            [1, 0, 0, 0, 0, 0, 0, 0].into_iter().chain([3, 1, 0, 0, 0].repeat(100_000)).collect();
        assert_eq!(decode(&deep, &[(0, String::new())]), None);
    }
}
