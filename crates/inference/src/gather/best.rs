//! The best state of each chain so far, including warm-up, to show during and after a
//! run.

use crate::callback::Callback;
use crate::run::Progress;
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Constraint, Draws, Trace};
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// After the first few steps, states between draws are examined every `EVERY` steps: the
/// cost of keeping a state is proportional to its number of choices.
const EVERY: u64 = 8;

/// A state that is the best so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BestState {
    /// Its log joint density at the full likelihood, even if the chain is annealed.
    pub log_joint: f64,
    /// The number of steps before it, including warm-up.
    pub step: u64,
    /// Its choices.
    pub choices: Vec<(u64, Constraint)>,
}

/// Keeps the best state of each chain, and updates [`Progress::best`]. The chains' draws
/// are not affected.
#[derive(Debug)]
pub struct BestSoFar {
    chains: Vec<Mutex<Option<Arc<BestState>>>>,
    /// The log joint densities of `chains`, as bits, which can be read without locking.
    known: Vec<AtomicU64>,
    progress: Arc<Progress>,
}

impl BestSoFar {
    /// For a run of `chains` chains.
    pub fn new(chains: u32, progress: &Arc<Progress>) -> BestSoFar {
        BestSoFar {
            chains: (0..chains).map(|_| Mutex::default()).collect(),
            known: (0..chains).map(|_| AtomicU64::new(f64::NEG_INFINITY.to_bits())).collect(),
            progress: Arc::clone(progress),
        }
    }

    /// The best state of all chains; `None` before the first step.
    pub fn state(&self) -> Option<Arc<BestState>> {
        let each = (0..self.chains.len()).filter_map(|c| self.of_chain(c));
        each.max_by(|a, b| a.log_joint.total_cmp(&b.log_joint))
    }

    /// The best state of one chain, numbered from 0; `None` before its first step.
    pub fn of_chain(&self, chain: usize) -> Option<Arc<BestState>> {
        self.chains.get(chain)?.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn look(&self, chain: u32, step: u64, trace: &Trace) {
        let chain = chain as usize;
        let Some(known) = self.known.get(chain) else { return };
        let log_joint = trace.log_joint();
        if log_joint > f64::from_bits(known.load(Ordering::Relaxed)) {
            self.keep(chain, BestState { log_joint, step, choices: trace.constraints() });
        }
    }

    fn keep(&self, chain: usize, state: BestState) {
        let (Some(cell), Some(known)) = (self.chains.get(chain), self.known.get(chain)) else {
            return;
        };
        known.store(state.log_joint.to_bits(), Ordering::Relaxed);
        *cell.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(state));
        let best = self
            .known
            .iter()
            .map(|k| f64::from_bits(k.load(Ordering::Relaxed)))
            .fold(f64::MIN, f64::max);
        self.progress.best.store(best.to_bits(), Ordering::Relaxed);
    }
}

impl Callback for BestSoFar {
    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws) {
        self.look(chain, draws.step, trace);
    }

    fn step(&self, chain: u32, steps: u64, trace: &Trace) {
        if steps < EVERY || steps.is_multiple_of(EVERY) {
            self.look(chain, steps, trace);
        }
    }

    fn save(&self, chain: u32) -> Vec<u8> {
        pack(&self.of_chain(chain as usize).as_deref())
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        if let Some(state) = unpack(state)? {
            self.keep(chain as usize, state);
        }
        Ok(())
    }
}
