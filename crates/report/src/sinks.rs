//! Sinks that keep draws in memory, and that send draws to several sinks.

use super::draws::ChainDraws;
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use std::io;
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
                    chain: 0,
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
            chain: 0,
            draw: 0,
            step: 1,
            log_joint: -1.0,
            log_prior: -1.0,
            log_likelihood: 0.0,
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
