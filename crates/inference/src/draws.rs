//! The output of inference: draws, one row at a time, and statistics of the kernels.
//!
//! Draws flow into a [`Sink`], which decides where they go (a file, memory, a progress
//! line). Invariant: the number of values of every row is the [`width`] of the columns
//! announced last.

pub use super::columns::{Column, Layout, MOST_POINTS, POINTWISE, Shape, merged, width};
use super::plan::checkpoint::Checkpoint;
pub use super::stats::{KernelStats, SiteStats};
use std::io;

/// One recorded draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawRow {
    /// The chain, from 0.
    pub chain: u32,
    /// The draw within the chain, from 0.
    pub draw: u64,
    /// Kernel applications before it, including warm-up.
    pub step: u64,
    /// The natural logarithm of the joint density, up to a constant if the likelihood is
    /// unnormalised.
    pub log_joint: f64,
    /// The part of it from the random choices.
    pub log_prior: f64,
    /// The part of it from the observations.
    pub log_likelihood: f64,
    /// The acceptance rate since the previous draw; NaN if there were no proposals.
    pub acceptance: f64,
    /// Divergent trajectories since the previous draw.
    pub divergent: u64,
    /// The values of the columns, flattened.
    pub values: Vec<f64>,
}

/// Where the draws of one chain go.
pub trait Sink: Send {
    /// Announces the columns, before the first draw and again when a draw has more of
    /// them. Each earlier column is then among the new ones, possibly longer; earlier
    /// draws have NaN for what they lack ([`Layout`]).
    ///
    /// # Errors
    /// If they cannot be written.
    fn columns(&mut self, columns: &[Column]) -> io::Result<()>;

    /// Receives a draw.
    ///
    /// # Errors
    /// If it cannot be written.
    fn draw(&mut self, row: &DrawRow) -> io::Result<()>;

    /// Called when the chain has ended after `steps` kernel applications, with `warmup`
    /// before them, in `seconds` of wall time.
    ///
    /// # Errors
    /// If the sink cannot write this.
    fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()>;

    /// The checkpoint to resume from; called once, before all other methods. The sink
    /// already has the draws before it.
    ///
    /// # Errors
    /// If there is one that cannot be read.
    fn resume(&mut self) -> io::Result<Option<Checkpoint>> {
        Ok(None)
    }

    /// Whether the sink stores checkpoints.
    fn takes_checkpoints(&self) -> bool {
        false
    }

    /// Stores a checkpoint. All draws before it must be stored as durably.
    ///
    /// # Errors
    /// If it cannot be written; the previous one must then be kept.
    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        let _ = checkpoint;
        Ok(())
    }
}

/// Discards draws, for chains that are observed by a callback.
#[derive(Clone, Copy, Debug, Default)]
pub struct Discard;

impl Sink for Discard {
    fn columns(&mut self, _: &[Column]) -> io::Result<()> {
        Ok(())
    }

    fn draw(&mut self, _: &DrawRow) -> io::Result<()> {
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }
}
