//! The way of each chain from the prior to the posterior: some of its states from the
//! first step on, warm-up included, for a film.

use crate::callback::Callback;
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Draws, SavedTrace, Trace};
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, PoisonError};

/// The step of a state is at least this much larger than that of the state before, since
/// a chain moves farthest in its first steps.
const GROWTH: f64 = 1.12;

/// A state on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrajectoryState {
    /// The chain, from 1.
    pub chain: u32,
    /// The number of steps before it, including warm-up.
    pub step: u64,
    /// The log joint density.
    pub log_joint: f64,
    /// The choices.
    pub trace: SavedTrace,
}

/// Keeps states of each chain at steps that grow geometrically: about 120 in a million
/// steps.
#[derive(Debug)]
pub struct Trajectory {
    program: String,
    chains: Vec<Mutex<Vec<TrajectoryState>>>,
}

impl Trajectory {
    /// For a run of `chains` chains. `program` is the hash of the program that the saved
    /// states carry.
    pub fn new(chains: u32, program: &str) -> Trajectory {
        let chains = (0..chains).map(|_| Mutex::default()).collect();
        Trajectory { program: program.into(), chains }
    }

    /// Takes up the states of a run that is resumed. Checkpoints hold only how many there
    /// were: they are written often, and the states do not change.
    pub fn restore(&self, states: Vec<TrajectoryState>) {
        for state in states {
            let chain = (state.chain as usize).checked_sub(1).and_then(|c| self.chains.get(c));
            if let Some(chain) = chain {
                chain.lock().unwrap_or_else(PoisonError::into_inner).push(state);
            }
        }
    }

    /// The number of states so far of all chains.
    pub fn count(&self) -> usize {
        let of = |c: &Mutex<Vec<_>>| c.lock().unwrap_or_else(PoisonError::into_inner).len();
        self.chains.iter().map(of).sum()
    }

    /// The states so far of all chains, chain by chain.
    pub fn all(&self) -> Vec<TrajectoryState> {
        (0..self.chains.len()).flat_map(|c| self.of_chain(c)).collect()
    }

    /// The states so far of one chain, numbered from 0.
    pub fn of_chain(&self, chain: usize) -> Vec<TrajectoryState> {
        let states = self.chains.get(chain);
        states.map_or_else(Vec::new, |s| s.lock().unwrap_or_else(PoisonError::into_inner).clone())
    }
}

impl Callback for Trajectory {
    fn draw(&self, _chain: u32, _trace: &mut Trace, _draws: Draws) {}

    fn step(&self, chain: u32, steps: u64, trace: &Trace) {
        let Some(states) = self.chains.get(chain as usize) else { return };
        let mut states = states.lock().unwrap_or_else(PoisonError::into_inner);
        let next = states.last().map_or(0, |s| (s.step as f64 * GROWTH).ceil() as u64);
        if steps > next || states.is_empty() {
            let (chain, log_joint) = (chain + 1, trace.log_joint());
            let trace = trace.save(&self.program);
            states.push(TrajectoryState { chain, step: steps, log_joint, trace });
        }
    }

    fn save(&self, chain: u32) -> Vec<u8> {
        let states = self.chains.get(chain as usize);
        let count = |s: &Mutex<Vec<_>>| s.lock().unwrap_or_else(PoisonError::into_inner).len();
        pack(&states.map_or(0, count))
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        let count: usize = unpack(state)?;
        if let Some(states) = self.chains.get(chain as usize) {
            states.lock().unwrap_or_else(PoisonError::into_inner).truncate(count);
        }
        Ok(())
    }
}
