//! Sinks that keep draws in memory, and that send them to several places.

use super::draws::ChainDraws;
use crate::infer::draws::{Column, DrawRow, Sink};
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// Keeps the draws of a chain in memory. Clones share them, so that one clone can be handed to the chain and the other
/// looked into.
#[derive(Clone, Debug, Default)]
pub struct Memory(Arc<Mutex<ChainDraws>>);

impl Memory {
    /// The draws so far.
    pub fn draws(&self) -> ChainDraws {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Sink for Memory {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).columns = columns.to_vec();
        Ok(())
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).rows.push(row.clone());
        Ok(())
    }

    fn chain_done(&mut self, _chain: u32, steps: u64, warmup: u64, _seconds: f64) -> io::Result<()> {
        let said = [("steps", steps), ("warmup_steps", warmup)].map(|(k, v)| (k.to_owned(), v.to_string()));
        self.0.lock().unwrap_or_else(PoisonError::into_inner).comments.extend(said);
        Ok(())
    }
}

/// Hands everything to each of its sinks, in order; an error stops the row there.
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
        };
        tee.columns(&[Column::scalar("x")]).unwrap();
        tee.draw(&row).unwrap();
        tee.chain_done(0, 1, 0, 0.1).unwrap();
        assert_eq!(a.draws(), b.draws());
        assert_eq!(a.draws().rows, [row]);
    }
}
