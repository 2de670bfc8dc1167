//! Reads the draws of a run from its folder, as they were in memory when it ended.
//!
//! Invariant: the draws that are kept and left out are those that the run itself kept and
//! left out for its summary.

use super::aligned::{all_name, draws_name, look};
use super::csv::{CsvError, DrawReader};
use super::draws::{ChainDraws, Quantity, widen};
use super::rundir::RunDir;
use super::sinks::Memory;
use pcadlang_inference::draws::{DrawRow, Sink};
use std::fs::File;
use std::io::{self, BufReader};

/// Reads the draws of each chain of a run, with room for `room` numbers in all of them
/// together; an incomplete line is left out.
///
/// # Errors
/// Returns an error if a file cannot be read, or is not a file of draws.
pub fn reread(dir: &RunDir, room: usize) -> io::Result<Vec<ChainDraws>> {
    let chains: Vec<u32> =
        (0..u32::MAX).take_while(|c| dir.file(&draws_name(*c)).is_file()).collect();
    let (mut all, mut even) = (Vec::new(), u64::MAX);
    for chain in &chains {
        let told = |name: &str, e: io::Error| {
            io::Error::new(e.kind(), format!("{}: {e}", dir.file(name).display()))
        };
        let (short, whole) = (draws_name(*chain), all_name(*chain));
        // If some chains got further than others, the summary uses only the draws that
        // all have.
        let name = match dir.file(&whole).is_file() {
            true => {
                even = even.min(look(&dir.file(&short)).map_err(|e| told(&short, e))?.draws);
                whole
            }
            false => short,
        };
        let memory = Memory::bounded(room / chains.len());
        read(dir, &name, *chain, memory.clone()).map_err(|e| told(&name, e))?;
        all.push(memory.draws());
    }
    all.iter_mut().for_each(|d| d.rows.retain(|r| r.draw < even));
    widen(&mut all);
    Ok(all)
}

fn read(dir: &RunDir, name: &str, chain: u32, mut memory: Memory) -> io::Result<()> {
    let path = dir.file(name);
    let columns = look(&path)?.columns;
    memory.columns(&columns)?;
    let mut reader = DrawReader::new(BufReader::new(File::open(&path)?), &columns, u64::MAX);
    let mut draw = 0;
    while let Some(row) = reader.next_row().map_err(CsvError::into_io)? {
        memory.draw(&DrawRow { chain, draw, ..row })?;
        draw += 1;
    }
    Ok(())
}

/// Restores the names that quantities had before they were written to files, in the same
/// order, because files cannot represent every name. If the numbers of names and
/// quantities differ, the names stay unchanged.
pub fn rename<'a>(quantities: &mut [Quantity], names: impl ExactSizeIterator<Item = &'a str>) {
    if names.len() == quantities.len() {
        quantities.iter_mut().zip(names).for_each(|(q, name)| name.clone_into(&mut q.name));
    }
}
