//! A bounded sample of a run's draws, and counts of all of them.

use pcadlang_inference::draws::{Column, DrawRow, Sink};
use pcadlang_report::{ChainDraws, Memory};
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// The maximum number of numbers kept.
const NUMBERS: usize = 4_000_000;

/// The draws so far. Clones share them: one belongs to the chain, another to the session.
#[derive(Clone, Debug)]
pub(super) struct SampledDraws {
    memory: Memory,
    counts: Arc<Mutex<DrawCounts>>,
}

/// A summary of all draws so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DrawCounts {
    pub draws: u64,
    /// Draws whose state differs from the one before, as judged by the log joint density.
    pub moved: u64,
    pub best: Option<f64>,
    /// The step after which the last draw was recorded, not counting warm-up.
    pub last_step: u64,
    last: Option<f64>,
}

impl Default for SampledDraws {
    fn default() -> Self {
        SampledDraws { memory: Memory::bounded(NUMBERS), counts: Arc::default() }
    }
}

impl SampledDraws {
    /// Returns the summary of all draws so far.
    pub fn counts(&self) -> DrawCounts {
        *self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the kept draws.
    pub fn draws(&self) -> ChainDraws {
        self.memory.draws()
    }
}

impl Sink for SampledDraws {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.memory.columns(columns)
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        counts.draws += 1;
        counts.last_step = row.step;
        counts.moved +=
            u64::from(counts.last.is_none_or(|l| l.to_bits() != row.log_joint.to_bits()));
        counts.last = Some(row.log_joint);
        counts.best = Some(counts.best.map_or(row.log_joint, |b| b.max(row.log_joint)));
        drop(counts);
        self.memory.draw(row)
    }

    fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()> {
        self.memory.chain_done(chain, steps, warmup, seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_draws_count_and_clones_see_them() {
        let sampled = SampledDraws::default();
        let mut sink = sampled.clone();
        sink.columns(&[Column::scalar("x")]).unwrap();
        for (draw, log_joint) in [-3.0, -1.0, -1.0, -2.0].into_iter().enumerate() {
            let draw = draw as u64;
            let row = DrawRow {
                chain: 1,
                draw,
                step: draw,
                log_joint,
                values: vec![0.5],
                ..DrawRow::default()
            };
            sink.draw(&row).unwrap();
        }
        let counts = sampled.counts();
        assert_eq!((counts.draws, counts.moved, counts.best), (4, 3, Some(-1.0)));
        assert_eq!(sampled.draws().rows.len(), 4);
    }
}
