//! The draws of a chain in bounded memory: when they are too many, every other one goes.

use crate::infer::draws::{Column, DrawRow, Sink, width};
use crate::report::ChainDraws;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// Draws kept at most.
const DRAWS: usize = 16_384;
/// Numbers kept at most.
const NUMBERS: usize = 8_000_000;

/// The draws so far. Clones share them: one goes to the chain, the other is looked into.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept(Arc<Mutex<Inner>>);

#[derive(Debug, Default)]
struct Inner {
    columns: Vec<Column>,
    rows: Vec<DrawRow>,
    /// One of so many is kept.
    stride: u64,
    /// Draws that came.
    seen: u64,
    best: Option<f64>,
    last: Option<f64>,
    /// Draws that were another state than the one before.
    moved: u64,
}

/// What is known of the draws so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Seen {
    pub draws: u64,
    pub moved: u64,
    pub best: Option<f64>,
}

impl Kept {
    fn inner<T>(&self, f: impl FnOnce(&mut Inner) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What is known of the draws so far.
    pub fn seen(&self) -> Seen {
        self.inner(|i| Seen { draws: i.seen, moved: i.moved, best: i.best })
    }

    /// The draws that are kept.
    pub fn draws(&self) -> ChainDraws {
        self.inner(|i| ChainDraws { comments: Vec::new(), columns: i.columns.clone(), rows: i.rows.clone() })
    }
}

impl Sink for Kept {
    fn columns(&mut self, columns: &[Column]) -> io::Result<()> {
        self.inner(|i| {
            i.columns = columns.to_vec();
            i.stride = 1;
        });
        Ok(())
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        self.inner(|i| {
            i.moved += u64::from(i.last.is_none_or(|l| l.to_bits() != row.log_joint.to_bits()));
            i.last = Some(row.log_joint);
            i.best = Some(i.best.map_or(row.log_joint, |b| b.max(row.log_joint)));
            if i.seen.is_multiple_of(i.stride.max(1)) {
                let most = (NUMBERS / width(&i.columns).max(1)).clamp(2, DRAWS);
                if i.rows.len() >= most {
                    let mut at = 0;
                    i.rows.retain(|_| {
                        at += 1;
                        at % 2 == 1
                    });
                    i.stride *= 2;
                }
                if i.seen.is_multiple_of(i.stride) {
                    i.rows.push(row.clone());
                }
            }
            i.seen += 1;
        });
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_and_draws_stay_evenly_spaced() {
        let mut kept = Kept::default();
        kept.columns(&[Column::scalar("x")]).unwrap();
        for draw in 0..100_000 {
            let log_joint = -((draw / 2) as f64);
            let row =
                DrawRow { chain: 1, draw, step: draw, log_joint, log_prior: 0.0, log_likelihood: 0.0, values: vec![0.5] };
            kept.draw(&row).unwrap();
        }
        let rows = kept.draws().rows;
        assert!(rows.len() <= DRAWS && rows.len() > DRAWS / 2 - 2, "{}", rows.len());
        let step = rows[1].draw - rows[0].draw;
        assert!(rows.windows(2).all(|w| w[1].draw - w[0].draw == step) && rows[0].draw == 0, "every {step}th");
        assert_eq!(kept.seen(), Seen { draws: 100_000, moved: 50_000, best: Some(0.0) });
    }
}
