//! The files of one chain in a run's folder: its draws, and the checkpoint from which it
//! can resume.
//!
//! Invariant: whenever the process or the machine stops, the checkpoint is complete, and
//! the file of draws holds all draws that precede the checkpoint.

use super::aligned::{draws_name, restore};
use super::checkpoint::SavedChain;
use super::csv::{CsvSink, DrawReader, as_written};
use super::rundir::RunDir;
use super::sinks::Memory;
use pcadlang_inference::Checkpoint;
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use std::fs::File;
use std::io::{self, BufReader, Seek, SeekFrom};

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
