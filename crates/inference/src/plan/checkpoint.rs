//! Checkpoints: all the state that a chain needs to resume, with the same draws as
//! without the interruption.
//!
//! Everything else is a function of that state and of the program: a trace is re-run from
//! its choices, with bit-for-bit equal scores and lists of choices in the same order;
//! random streams are determined by step and address; caches are rebuilt.

use super::place::PlanPosition;
use crate::draws::Column;
use crate::plain::Plain;
use crate::population::Population;
use crate::state::{StateError, holds, pack, unpack};
use crate::stats::{KernelStats, SiteStats};
use pcadlang_engine::trace::{CoarseState, Constraint, Selector};
use serde::{Deserialize, Serialize};

type State = Vec<(u64, Constraint)>;

/// A bound on counts: no chain gets this far.
const MOST: u64 = 1 << 60;
/// The most numbers that are recorded with a draw.
const MOST_NUMBERS: usize = 10_000_000;

/// The state of a chain at a step, with all it needs to resume. Valid only with the same
/// program, plan, data and seed; the code that stores it must check that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    pub(super) seed: u64,
    pub(super) chain: u32,
    pub(super) step: u64,
    pub(super) warmup_steps: u64,
    pub(super) draws: u64,
    pub(super) counted: [u64; 3],
    pub(super) seconds: f64,
    pub(super) finished: bool,
    pub(super) power: f64,
    /// The choices.
    pub(super) state: State,
    /// The coordinates of choices that their values do not tell.
    #[serde(default)]
    pub(super) coarse: CoarseState,
    pub(super) best: Option<(f64, State)>,
    pub(super) population: Population,
    pub(super) variables: Vec<Plain>,
    pub(super) path: Vec<PlanPosition>,
    pub(super) kernels: Vec<SavedKernel>,
    pub(super) sites: Vec<(u64, SiteStats)>,
    pub(super) columns: Vec<Column>,
    pub(super) observed: Option<Vec<(u64, usize)>>,
    pub(super) frozen: Selector,
    #[serde(rename = "watch")]
    pub(super) callback: Vec<u8>,
}

/// A kernel of a chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedKernel {
    pub signature: String,
    pub state: Vec<u8>,
    pub stats: KernelStats,
}

impl Checkpoint {
    /// Serialises the checkpoint.
    pub fn to_bytes(&self) -> Vec<u8> {
        pack(self)
    }

    /// Reads the bytes of [`Checkpoint::to_bytes`].
    ///
    /// # Errors
    /// If the bytes are not a valid checkpoint.
    pub fn from_bytes(bytes: &[u8]) -> Result<Checkpoint, StateError> {
        let c: Checkpoint = unpack(bytes)?;
        let sizes =
            c.columns.iter().try_fold(0usize, |sum, column| sum.checked_add(column.shape.len()));
        let counts = [c.step, c.draws].into_iter().chain(c.path.iter().map(PlanPosition::most));
        let fits = c.warmup_steps <= c.step
            && c.population.fits()
            && sizes.is_some_and(|n| n <= MOST_NUMBERS);
        holds(fits && counts.into_iter().all(|n| n < MOST), "a chain")?;
        Ok(c)
    }

    /// The chain, from 0.
    pub fn chain(&self) -> u32 {
        self.chain
    }

    /// The number of draws so far.
    pub fn draws(&self) -> u64 {
        self.draws
    }

    /// The columns of a draw; empty before the first one.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The number of steps, including warm-up.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// True if the plan is finished.
    pub fn is_finished(&self) -> bool {
        self.finished
    }
}
