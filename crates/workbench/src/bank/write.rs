//! Writing a bank block by block. Memory holds only an offset for each entry, and the
//! addresses.

use super::format::{Header, Preamble, START};
use super::record::{Entry, encode};
use super::{BankError, Features};
use pcadlang_numerics::num::fnv1a;
use rustc_hash::FxHashMap;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A bank that is being written. If it is dropped before [`BankWriter::finish`], the
/// partial file is removed.
pub(super) struct BankWriter {
    file: File,
    partial: PathBuf,
    path: PathBuf,
    count: u64,
    width: u64,
    written: u64,
    /// The offset of the next latents.
    end: u64,
    places: Vec<u64>,
    addresses: Vec<(String, String)>,
    index: FxHashMap<u64, u32>,
    done: bool,
}

impl BankWriter {
    /// Starts a bank of `count` entries with `width` features each, in a temporary file
    /// beside its final path.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path, count: u64, width: usize) -> Result<BankWriter, BankError> {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let partial = path.with_file_name(format!(".{name}.partial"));
        let end = START + 4 * count * width as u64;
        Ok(BankWriter {
            file: File::create(&partial)?,
            partial,
            path: path.to_owned(),
            count,
            width: width as u64,
            written: 0,
            end,
            places: Vec::new(),
            addresses: Vec::new(),
            index: FxHashMap::default(),
            done: false,
        })
    }

    /// Adds entries, in order.
    ///
    /// # Errors
    /// If an entry has another number of features, or the file cannot be written.
    pub fn add(&mut self, entries: &[Entry]) -> Result<(), BankError> {
        let (mut features, mut latents) = (Vec::new(), Vec::new());
        let from = self.end;
        for e in entries {
            if e.features.len() as u64 != self.width {
                let (got, first) = (e.features.len(), self.width);
                let message = format!(
                    "a picture has {got} features, but the first had {first}; all must have the same number"
                );
                return Err(BankError::Command(message));
            }
            e.features.iter().for_each(|x| features.extend(x.to_le_bytes()));
            self.places.push(from + latents.len() as u64);
            let (index, addresses) = (&mut self.index, &mut self.addresses);
            let number = |c: &super::Named| {
                *index.entry(c.hash).or_insert_with(|| {
                    addresses.push((format!("{:016x}", c.hash), c.address.clone()));
                    addresses.len() as u32 - 1
                })
            };
            encode(&e.latents, number, &mut latents);
        }
        self.put(START + 4 * self.width * self.written, &features)?;
        self.put(from, &latents)?;
        self.end = from + latents.len() as u64;
        self.written += entries.len() as u64;
        Ok(())
    }

    fn put(&mut self, at: u64, bytes: &[u8]) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(at))?;
        self.file.write_all(bytes)
    }

    /// Completes the bank and moves it to its final path.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(
        mut self,
        name: &str,
        program: &str,
        seed: u64,
        features: Features,
    ) -> Result<(), BankError> {
        self.places.push(self.end);
        let table: Vec<u8> = self.places.iter().flat_map(|p| p.to_le_bytes()).collect();
        let addresses = std::mem::take(&mut self.addresses);
        let header = Header {
            name: name.to_owned(),
            program: program.to_owned(),
            seed,
            features,
            addresses,
        };
        let text = serde_json::to_vec(&header).map_err(std::io::Error::from)?;
        let at = self.end + table.len() as u64;
        self.put(self.end, &table)?;
        self.put(at, &text)?;
        let preamble = Preamble {
            count: self.count,
            width: self.width,
            table: self.end,
            header: at,
            hash: fnv1a(&text),
        };
        self.put(0, &preamble.encode())?;
        std::fs::rename(&self.partial, &self.path)?;
        self.done = true;
        Ok(())
    }
}

impl Drop for BankWriter {
    fn drop(&mut self) {
        if !self.done {
            // A failure to remove it is ignored: the original error is reported.
            let _ = std::fs::remove_file(&self.partial);
        }
    }
}
