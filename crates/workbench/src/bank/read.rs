//! Reading a bank. Features are read block by block and latents of selected entries only,
//! so a bank need not fit into memory.

use super::format::{Header, Preamble, START};
use super::record::{decode, latents};
use super::{BankError, Named};
use pcadlang_inference::Neighbours;
use pcadlang_numerics::num::fnv1a;
use pcadlang_scene::vision::features::Query;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The approximate number of bytes of features that are read at a time.
const BLOCK: u64 = 1 << 20;
/// The largest accepted size of an entry, a header or a row of features, in bytes.
const LONGEST: u64 = 1 << 28;
/// The approximate number of entries from which the scale of each coordinate is
/// estimated.
const SAMPLE: u64 = 256;

/// A bank file, open for reading.
#[derive(Debug)]
pub struct Bank {
    file: Mutex<File>,
    preamble: Preamble,
    header: Header,
    addresses: Vec<(u64, String)>,
}

impl Bank {
    /// Opens a bank and reads its header.
    ///
    /// # Errors
    /// If it cannot be read, or is not a complete bank of this version.
    pub fn open(path: &Path) -> Result<Bank, BankError> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut start = Vec::new();
        (&mut file).take(START).read_to_end(&mut start)?;
        let preamble = Preamble::decode(&start, length)?;
        if length - preamble.header > LONGEST || preamble.width.saturating_mul(4) > LONGEST {
            return Err(BankError::Damaged("its header or its rows are too long".into()));
        }
        let text = bytes(&mut file, preamble.header, length - preamble.header)?;
        if fnv1a(&text) != preamble.hash {
            return Err(BankError::Damaged("its header is altered or truncated".into()));
        }
        let header: Header =
            serde_json::from_slice(&text).map_err(|e| BankError::Damaged(e.to_string()))?;
        let hash =
            |(h, name): &(String, String)| Some((u64::from_str_radix(h, 16).ok()?, name.clone()));
        let addresses: Option<Vec<_>> = header.addresses.iter().map(hash).collect();
        let addresses =
            addresses.ok_or_else(|| BankError::Damaged("an address has no hash".into()))?;
        Ok(Bank { file: Mutex::new(file), preamble, header, addresses })
    }

    /// Returns the metadata.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Returns the number of entries.
    pub fn len(&self) -> usize {
        self.preamble.count as usize
    }

    /// Returns whether there are no entries, which is never true of a bank that opens.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks that the bank was made from this program.
    ///
    /// # Errors
    /// If it was made from another program, another version of it, or with other
    /// parameters.
    pub fn check(&self, program: &str) -> Result<(), BankError> {
        if self.header.program == program {
            return Ok(());
        }
        let (name, found) = (self.header.name.clone(), self.header.program.clone());
        Err(BankError::Program { name, found, expected: program.to_owned() })
    }

    fn read(&self, at: u64, length: u64) -> Result<Vec<u8>, BankError> {
        Ok(bytes(&mut self.file.lock().unwrap_or_else(PoisonError::into_inner), at, length)?)
    }

    /// Reads the features of `count` entries from entry `i` on, concatenated.
    fn rows(&self, i: u64, count: u64) -> Result<Vec<f32>, BankError> {
        let width = 4 * self.preamble.width;
        let bytes = self.read(START + i * width, count * width)?;
        Ok(bytes.chunks_exact(4).map(|b| b.try_into().map_or(0.0, f32::from_le_bytes)).collect())
    }

    /// Reads the features of an entry.
    ///
    /// # Errors
    /// If the entry does not exist or cannot be read.
    pub fn features(&self, i: usize) -> Result<Vec<f32>, BankError> {
        self.place(i)?;
        self.rows(i as u64, 1)
    }

    /// Returns the offsets of the start and the end of an entry's latents.
    fn place(&self, i: usize) -> Result<(u64, u64), BankError> {
        if i >= self.len() {
            return Err(BankError::Damaged(format!("no entry {i} among {}", self.len())));
        }
        let both = self.read(self.preamble.table + 8 * i as u64, 16)?;
        let word = |k: usize| {
            both.get(k..k + 8).and_then(|b| b.try_into().ok()).map_or(0, u64::from_le_bytes)
        };
        let (from, to) = (word(0), word(8));
        if from > to || to > self.preamble.table || to - from > LONGEST {
            return Err(BankError::Damaged(format!("the offset of entry {i} is wrong")));
        }
        Ok((from, to))
    }

    /// Reads the choices of an entry.
    ///
    /// # Errors
    /// As [`Bank::features`].
    pub fn latents(&self, i: usize) -> Result<Vec<Named>, BankError> {
        let (from, to) = self.place(i)?;
        let bytes = self.read(from, to - from)?;
        decode(&bytes, &self.addresses)
            .ok_or_else(|| BankError::Damaged(format!("entry {i} cannot be read")))
    }

    /// Returns the `k` entries whose pictures are most similar to the query, nearest
    /// first, each with its squared distance.
    ///
    /// # Errors
    /// If the query has another number of features, or the file cannot be read.
    pub fn nearest(&self, query: &Query, k: usize) -> Result<Vec<(usize, f32)>, BankError> {
        let (width, count) = (self.preamble.width, self.preamble.count);
        if query.len() as u64 != width {
            let message = format!(
                "the observed picture has {} features, but those of the bank have {width}",
                query.len()
            );
            return Err(BankError::Command(message));
        }
        let rows = (BLOCK / (4 * width).max(1)).max(1);
        let mut best: Vec<(usize, f32)> = Vec::with_capacity(k + 1);
        let mut first = 0;
        while first < count && k > 0 {
            let n = rows.min(count - first);
            let block = self.rows(first, n)?;
            for (j, features) in block.chunks_exact(width.max(1) as usize).enumerate() {
                let d = query.distance(features);
                // Among equals, the earlier entry comes first.
                let at = best.partition_point(|(_, b)| *b <= d);
                if at < k {
                    best.insert(at, (first as usize + j, d));
                    best.truncate(k);
                }
            }
            first += n;
        }
        Ok(best)
    }

    /// Reads the latents of the `k` nearest entries, for proposals.
    ///
    /// # Errors
    /// As [`Bank::nearest`].
    pub fn neighbours(&self, query: &Query, k: usize) -> Result<Neighbours, BankError> {
        let near = self.nearest(query, k)?.into_iter().map(|(i, _)| i);
        let step = self.preamble.count.div_ceil(SAMPLE).max(1) as usize;
        let read = |i: usize| Ok::<_, BankError>(latents(&self.latents(i)?));
        let entries = near.map(read).collect::<Result<Vec<_>, _>>()?;
        let among = (0..self.len()).step_by(step).map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Neighbours::new(entries, &among))
    }
}

fn bytes(file: &mut File, at: u64, length: u64) -> std::io::Result<Vec<u8>> {
    let mut bytes = vec![0; length as usize];
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(&mut bytes)?;
    Ok(bytes)
}
