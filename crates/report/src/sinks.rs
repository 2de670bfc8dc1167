//! Sinks of draws: the file of a chain, draws in memory, and several sinks at once.
//!
//! The files of one chain in a run's folder: its draws, and the checkpoint from which it
//! can resume.
//!
//! Invariant: whenever the process or the machine stops, the checkpoint is complete, and
//! the file of draws holds all draws that precede the checkpoint.

use super::aligned::{draws_name, restore};
use super::checkpoint::SavedChain;
use super::csv::{CsvSink, DrawReader, as_written};
use super::draws::ChainDraws;
use super::rundir::RunDir;
use pcadlang_inference::Checkpoint;
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use std::fs::File;
use std::io::{self, BufReader, Seek, SeekFrom};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Keeps the draws of a chain in memory. Clones share them, so that the chain can write
/// to one clone while another is read.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    draws: Arc<Mutex<ChainDraws>>,
    /// The maximum number of numbers to keep; 0 means no bound.
    room: usize,
}

/// The size of a draw in numbers, in addition to its recorded values.
const OVERHEAD: usize = 14;

impl Memory {
    /// Creates a sink with room for `room` numbers. When it is full, every second draw is
    /// dropped, and from then on only every second draw is kept; then every fourth, and
    /// so on.
    pub fn bounded(room: usize) -> Memory {
        Memory { room, ..Memory::default() }
    }

    fn lock(&self) -> MutexGuard<'_, ChainDraws> {
        self.draws.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the number of draws so far, up to the interval at which they are kept.
    pub fn count(&self) -> u64 {
        let kept = self.lock();
        kept.rows.len() as u64 * kept.every
    }

    /// Returns the draws so far.
    pub fn draws(&self) -> ChainDraws {
        self.lock().clone()
    }
}

impl Sink for Memory {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.lock().widen(columns.to_vec());
        Ok(())
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        let mut kept = self.lock();
        if row.draw.is_multiple_of(kept.every) {
            kept.rows.push(row.clone());
            if self.room > 0 && kept.rows.len() * (row.values.len() + OVERHEAD) > self.room {
                kept.every *= 2;
                let every = kept.every;
                kept.rows.retain(|r| r.draw.is_multiple_of(every));
            }
        }
        Ok(())
    }

    fn chain_done(
        &mut self,
        _chain: u32,
        steps: u64,
        warmup: u64,
        _seconds: f64,
    ) -> io::Result<()> {
        let said = [("steps", steps), ("warmup_steps", warmup)]
            .map(|(k, v)| (k.to_owned(), v.to_string()));
        self.lock().comments.extend(said);
        Ok(())
    }
}

/// Passes everything to each of its sinks, in order; after an error, the remaining sinks
/// are skipped.
#[derive(Default)]
pub struct Tee(pub Vec<Box<dyn Sink>>);

impl Sink for Tee {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.0.iter_mut().try_for_each(|s| s.columns(columns))
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        self.0.iter_mut().try_for_each(|s| s.draw(row))
    }

    fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()> {
        self.0.iter_mut().try_for_each(|s| s.chain_done(chain, steps, warmup, seconds))
    }
}

/// A sink that writes a chain's draws to its file, keeps as many of them in memory as
/// there is room for, and writes checkpoints.
pub struct ChainFile {
    dir: RunDir,
    chain: u32,
    /// The identity of the run.
    run: String,
    draws: CsvSink,
    memory: Memory,
    from: Option<Checkpoint>,
}

/// The parts that the files of all chains of a run have in common.
pub struct ChainFiles<'a> {
    /// The run's folder.
    pub dir: &'a RunDir,
    /// The identity of the run.
    pub run: &'a str,
    /// The comments at the head of the files of draws.
    pub comments: &'a [(&'a str, String)],
}

fn checkpoint_name(chain: u32) -> String {
    format!("chain-{}.checkpoint", u64::from(chain) + 1)
}

/// Adds the name of the affected file to an error.
fn about(name: &str, error: impl std::fmt::Display, kind: io::ErrorKind) -> io::Error {
    io::Error::new(kind, format!("{name}: {error}"))
}

impl ChainFiles<'_> {
    /// Begins the files of a chain.
    ///
    /// # Errors
    /// Returns an error if they cannot be written.
    pub fn begin(&self, chain: u32, memory: &Memory) -> io::Result<ChainFile> {
        let name = draws_name(chain);
        let told = |e: io::Error| about(&name, &e, e.kind());
        // An earlier checkpoint must not outlive its draws.
        let checkpoint = self.dir.file(&checkpoint_name(chain));
        if checkpoint.exists() {
            std::fs::remove_file(checkpoint)?;
        }
        restore(self.dir.path(), chain).map_err(told)?;
        let draws = CsvSink::create(&self.dir.file(&name), chain, self.comments).map_err(told)?;
        Ok(self.file(chain, draws, memory.clone(), None))
    }

    /// Resumes the files of a chain at its last checkpoint, or begins them if there is no
    /// checkpoint. Later draws are cut off; the chain repeats them.
    ///
    /// # Errors
    /// Returns an error if the checkpoint is from another run or version, or draws before
    /// it are missing.
    pub fn resume(&self, chain: u32, memory: &Memory) -> io::Result<ChainFile> {
        let name = checkpoint_name(chain);
        let bytes = match std::fs::read(self.dir.file(&name)) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return self.begin(chain, memory);
            }
            Err(e) => return Err(about(&name, &e, e.kind())),
        };
        let read = SavedChain::read(&bytes, self.run);
        let (saved, checkpoint) = read.map_err(|e| about(&name, e, io::ErrorKind::InvalidData))?;
        let name = draws_name(chain);
        let told = |e: io::Error| about(&name, &e, e.kind());
        restore(self.dir.path(), chain).map_err(told)?;
        let mut file =
            File::options().read(true).write(true).open(self.dir.file(&name)).map_err(told)?;
        let mut memory = memory.clone();
        memory.columns(checkpoint.columns())?;
        let mut rows = 0;
        let columns = as_written(checkpoint.columns());
        let mut reader = DrawReader::new(BufReader::new(&file), &columns, saved.draws_end);
        while let Some(row) =
            reader.next_row().map_err(|e| about(&name, e, io::ErrorKind::InvalidData))?
        {
            memory.draw(&DrawRow { chain, draw: rows, ..row })?;
            rows += 1;
        }
        if rows != checkpoint.draws() || reader.position() != saved.draws_end {
            let message =
                format!("it has {rows} draws, not the {} of the checkpoint", checkpoint.draws());
            return Err(about(&name, message, io::ErrorKind::InvalidData));
        }
        file.set_len(saved.draws_end).map_err(told)?;
        file.seek(SeekFrom::End(0)).map_err(told)?;
        let columns = (checkpoint.draws() > 0).then(|| checkpoint.columns());
        let draws = CsvSink::resume(file, saved.draws_end, columns);
        Ok(self.file(chain, draws, memory, Some(checkpoint)))
    }

    fn file(
        &self,
        chain: u32,
        draws: CsvSink,
        memory: Memory,
        from: Option<Checkpoint>,
    ) -> ChainFile {
        ChainFile { dir: self.dir.clone(), chain, run: self.run.into(), draws, memory, from }
    }
}

impl Sink for ChainFile {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.draws.columns(columns)?;
        self.memory.columns(columns)
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        self.draws.draw(row)?;
        self.memory.draw(row)
    }

    fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()> {
        self.draws.chain_done(chain, steps, warmup, seconds)?;
        self.memory.chain_done(chain, steps, warmup, seconds)
    }

    fn resume(&mut self) -> io::Result<Option<Checkpoint>> {
        Ok(self.from.take())
    }

    fn takes_checkpoints(&self) -> bool {
        true
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        // Draws must reach the disk before the checkpoint that depends on them.
        self.draws.sync()?;
        let saved = SavedChain::new(&self.run, self.draws.written(), checkpoint);
        self.dir.write(&checkpoint_name(self.chain), &saved.to_bytes()).map_err(io::Error::other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_memory_keeps_draws_at_even_distances() {
        let mut memory = Memory::bounded(100 * (2 + OVERHEAD));
        for draw in 0..100_000 {
            let x = draw as f64;
            let (log_prior, log_likelihood, values) = (0.0, -x, vec![x, 2.0 * x]);
            memory
                .draw(&DrawRow {
                    draw,
                    step: draw,
                    log_joint: -x,
                    log_prior,
                    log_likelihood,
                    values,
                    ..DrawRow::default()
                })
                .unwrap();
            let kept = memory.lock();
            assert!(kept.rows.len() <= 100);
            assert!(
                kept.rows.iter().zip(0..).all(|(r, i)| r.draw == i * kept.every),
                "draw {draw}"
            );
        }
        assert_eq!((memory.draws().every, memory.draws().rows.len()), (1024, 98));
    }

    #[test]
    fn a_tee_feeds_both() {
        let (a, b) = (Memory::default(), Memory::default());
        let mut tee = Tee(vec![Box::new(a.clone()), Box::new(b.clone())]);
        let row = DrawRow {
            step: 1,
            log_joint: -1.0,
            log_prior: -1.0,
            values: vec![3.0],
            ..DrawRow::default()
        };
        tee.columns(&[Column::scalar("x")]).unwrap();
        tee.draw(&row).unwrap();
        tee.chain_done(0, 1, 0, 0.1).unwrap();
        assert_eq!(a.draws(), b.draws());
        assert_eq!(a.draws().rows, [row]);
    }
}
