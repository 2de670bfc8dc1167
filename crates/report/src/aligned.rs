//! Brings the chains of a run that has ended to the same columns and the same number of
//! draws, as ArviZ and CmdStan's tools require.
//!
//! A chain's file grows while it runs; under a time limit some chains get further than
//! others, and columns are added when the structure of a scene changes. A file that has
//! to be changed is kept in its original form as `draws-N.csv` beside `chain-N.csv`, so
//! that the chain can resume from it.
//!
//! Invariant: whenever the process stops, one of the two files holds all draws of the
//! chain.

use super::atomic_write::begin;
use super::csv::{Contents, CsvError, CsvSink, DrawReader, with_counts};
use super::draws::{ChainDraws, Quantity, widen};
use super::rundir::RunDir;
use super::sinks::Memory;
use pcadlang_inference::draws::{Column, DrawRow, Layout, POINTWISE, Sink, merged};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;

/// Returns the name of the file of a chain's draws; chains are counted from 0.
pub(super) fn draws_name(chain: u32) -> String {
    format!("chain-{}.csv", u64::from(chain) + 1)
}

/// Returns the name of the file that keeps all draws of a chain, if its main file was
/// changed.
pub(super) fn all_name(chain: u32) -> String {
    format!("draws-{}.csv", u64::from(chain) + 1)
}

/// Brings the files of `chains` chains to the same columns and, if `even`, to the same
/// number of draws: that of the shortest chain with any draws. Returns that number if
/// draws were left out. Without `pointwise`, the log densities of single observed values are
/// left out: they are of other observations in other chains.
///
/// The heads of all files then say how many draws they hold, and how many steps the warm-up
/// had; where a time limit made these differ, the most of any chain, since readers want one
/// number.
///
/// # Errors
/// Returns an error if a file cannot be read or written.
pub fn align(dir: &Path, chains: u32, even: bool, pointwise: bool) -> io::Result<Option<u64>> {
    let found =
        (0..chains).map(|c| look(&dir.join(draws_name(c)))).collect::<io::Result<Vec<_>>>()?;
    let counts = || found.iter().map(|f| f.draws).filter(|n| *n > 0);
    let (fewest, most) = (counts().min().unwrap_or(0), counts().max().unwrap_or(0));
    let keep = if even { fewest } else { most };
    let all = found.iter().fold(Vec::new(), |all, f| merged(&all, &f.columns));
    let mut columns = all.clone();
    columns.retain(|c| pointwise || c.name != POINTWISE);
    let warmup = found.iter().filter_map(Contents::warmup).max().unwrap_or(0);
    for (chain, f) in (0..chains).zip(&found).filter(|(_, f)| f.draws > 0) {
        let draws = f.draws.min(keep);
        if f.draws > keep || f.heads != 1 || f.columns != columns {
            let head = with_counts(&f.settings(), warmup, draws);
            rewrite(dir, chain, (&head, &f.tail), (&all, &columns), draws)?;
        } else {
            fill_in(&dir.join(draws_name(chain)), f, &with_counts(&f.head, warmup, draws))?;
        }
    }
    Ok((keep < most).then_some(keep))
}

/// Replaces the comments at the head of a file by others of the same length.
fn fill_in(path: &Path, found: &Contents, head: &str) -> io::Result<()> {
    if head == found.head || head.len() as u64 != found.head_end {
        return Ok(());
    }
    File::options().write(true).open(path)?.write_all(head.as_bytes())
}

/// Restores all draws of a chain's file, if some were set aside.
///
/// # Errors
/// Returns an error if the file cannot be renamed.
pub(super) fn restore(dir: &Path, chain: u32) -> io::Result<()> {
    match std::fs::rename(dir.join(all_name(chain)), dir.join(draws_name(chain))) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Reads the comments, the columns and the number of draws of a chain's file.
///
/// # Errors
/// Returns an error if it cannot be read.
pub(super) fn look(path: &Path) -> io::Result<Contents> {
    Contents::of(BufReader::new(File::open(path)?)).map_err(CsvError::into_io)
}

/// Rewrites a chain's file with its first draws, and keeps the old file. The columns are
/// those of all chains, and those that stay.
fn rewrite(
    dir: &Path,
    chain: u32,
    (head, tail): (&str, &str),
    (all, columns): (&[Column], &[Column]),
    draws: u64,
) -> io::Result<()> {
    let path = dir.join(draws_name(chain));
    let layout = Layout::new(all, columns);
    let mut reader = DrawReader::new(BufReader::new(File::open(&path)?), all, u64::MAX);
    let new = begin(dir, &draws_name(chain), true, |file| {
        let mut out = BufWriter::new(file);
        out.write_all(head.as_bytes())?;
        let mut sink = CsvSink::bare(out);
        sink.columns(columns)?;
        for draw in 0..draws {
            let Some(row) = reader.next_row().map_err(CsvError::into_io)? else { break };
            let values = layout.apply(&row.values);
            sink.draw(&DrawRow { chain, draw, values, ..row })?;
        }
        sink.end(tail)
    })?;
    std::fs::rename(&path, dir.join(all_name(chain)))?;
    new.end()
}

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

#[cfg(test)]
mod tests {
    use super::super::csv::read;
    use super::*;
    use std::path::PathBuf;

    const NAMES: &str = "lp__,accept_stat__,divergent__,log_prior__,log_likelihood__,step__";

    fn folder(name: &str) -> PathBuf {
        let dir =
            std::env::temp_dir().join(format!("pcadlang-aligned-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&dir);
        std::fs::create_dir_all(&dir).unwrap();
        dir
    }

    #[test]
    fn chains_come_to_one_form_and_back() {
        let dir = folder("form");
        let one = format!(
            "# id = 1\n{NAMES},k,w.1\n-1,1,0,0,-1,1,1,0.1\n{NAMES},k,w.1,w.2\n-2,1,0,0,-2,2,2,0.1,0.2\n# steps = 2\n"
        );
        let two = format!(
            "# id = 2\n{NAMES},k,w.1,e\n-1,1,0,0,-1,1,1,0.3,7\n-1,1,0,0,-1,2,1,0.3,8\n-1,1,0,0,-1,3,1,0.4,9\n"
        );
        std::fs::write(dir.join("chain-1.csv"), &one).unwrap();
        std::fs::write(dir.join("chain-2.csv"), &two).unwrap();
        // A chain that was stopped before it began.
        std::fs::write(dir.join("chain-3.csv"), "# id = 3\n").unwrap();
        assert_eq!(align(&dir, 3, true, true).unwrap(), Some(2));
        let chain = |name: &str| read(&std::fs::read_to_string(dir.join(name)).unwrap()).unwrap();
        let (a, b) = (chain("chain-1.csv"), chain("chain-2.csv"));
        assert_eq!(a.columns, b.columns);
        assert_eq!((a.rows.len(), b.rows.len()), (2, 2));
        assert!(
            a.rows[0].values[..2] == [1.0, 0.1] && a.rows[0].values[2..].iter().all(|x| x.is_nan())
        );
        assert!(
            b.rows[1].values[..2] == [1.0, 0.3]
                && b.rows[1].values[2].is_nan()
                && b.rows[1].values[3] == 8.0
        );
        assert!(a.comments.contains(&("steps".into(), "2".into())));
        // All draws are still there, and are restored.
        assert_eq!(chain("draws-2.csv").rows.len(), 3);
        assert_eq!(align(&dir, 3, true, true).unwrap(), None, "nothing is left to do");
        (0..3).for_each(|c| restore(&dir, c).unwrap());
        assert_eq!(std::fs::read_to_string(dir.join("chain-1.csv")).unwrap(), one);
        assert_eq!(std::fs::read_to_string(dir.join("chain-2.csv")).unwrap(), two);
        assert!(!dir.join("draws-1.csv").exists());
        // Log densities of different observations in different chains are left out.
        let observed = |k: &str| format!("# id = 1\n{NAMES},log_lik.1,k\n-1,1,0,0,-1,1,-3,{k}\n");
        std::fs::write(dir.join("chain-1.csv"), observed("5")).unwrap();
        std::fs::write(dir.join("chain-2.csv"), observed("6")).unwrap();
        assert_eq!(align(&dir, 2, true, false).unwrap(), None);
        let (a, b) = (chain("chain-1.csv"), chain("chain-2.csv"));
        assert_eq!(
            (a.columns.len(), &a.rows[0].values, &b.rows[0].values),
            (1, &vec![5.0], &vec![6.0])
        );
        (0..2).for_each(|c| restore(&dir, c).unwrap());
        assert_eq!(chain("chain-1.csv").columns.len(), 2);
        std::fs::write(dir.join("chain-1.csv"), &one).unwrap();
        std::fs::write(dir.join("chain-2.csv"), &two).unwrap();
        // No draws of an interrupted run are left out.
        assert_eq!(align(&dir, 3, false, true).unwrap(), None);
        assert_eq!((chain("chain-1.csv").rows.len(), chain("chain-2.csv").rows.len()), (2, 3));
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
