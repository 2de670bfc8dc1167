//! Complete states of chains at some of their draws, from which pictures, meshes and
//! other quantities can be computed after a run.

use crate::callback::Callback;
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Draws, SavedTrace, Trace};
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, PoisonError};

/// A state that was kept, with its chain and draw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeptTrace {
    /// The chain, from 1.
    pub chain: u32,
    /// The draw within the chain, from 1.
    pub draw: u64,
    /// The log joint density.
    pub log_joint: f64,
    /// The choices.
    pub trace: SavedTrace,
}

/// The kept part of a chain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Chain {
    draws: u64,
    every: u64,
    kept: Vec<KeptTrace>,
}

/// Keeps the states of draws at regular intervals. When there is no more room, every
/// second one is dropped and the interval doubles.
#[derive(Debug)]
pub struct KeptTraces {
    program: String,
    /// The most states kept per chain.
    room: usize,
    chains: Vec<Mutex<Chain>>,
}

impl KeptTraces {
    /// Keeps at most `most` states of all chains together. `program` is the hash of the
    /// program that the saved states carry.
    pub fn new(chains: u32, most: usize, program: &str) -> KeptTraces {
        let chain = || Mutex::new(Chain { draws: 0, every: 1, kept: Vec::new() });
        let room = most.div_ceil(chains.max(1) as usize);
        KeptTraces { program: program.into(), room, chains: (0..chains).map(|_| chain()).collect() }
    }

    /// The states kept of all chains, chain by chain.
    pub fn all(&self) -> Vec<KeptTrace> {
        let of = |c: &Mutex<Chain>| c.lock().unwrap_or_else(PoisonError::into_inner).kept.clone();
        self.chains.iter().flat_map(of).collect()
    }
}

impl Callback for KeptTraces {
    fn draw(&self, chain: u32, trace: &mut Trace, _draws: Draws) {
        let Some(cell) = self.chains.get(chain as usize).filter(|_| self.room > 0) else { return };
        let mut c = cell.lock().unwrap_or_else(PoisonError::into_inner);
        if c.draws.is_multiple_of(c.every) {
            let (draw, log_joint) = (c.draws + 1, trace.log_joint());
            c.kept.push(KeptTrace {
                chain: chain + 1,
                draw,
                log_joint,
                trace: trace.save(&self.program),
            });
            if c.kept.len() > self.room {
                c.every *= 2;
                let every = c.every;
                c.kept.retain(|k| (k.draw - 1).is_multiple_of(every));
            }
        }
        c.draws += 1;
    }

    fn save(&self, chain: u32) -> Vec<u8> {
        let cell = self.chains.get(chain as usize);
        pack(&cell.map(|c| c.lock().unwrap_or_else(PoisonError::into_inner).clone()))
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        if let (Some(state), Some(cell)) = (unpack(state)?, self.chains.get(chain as usize)) {
            *cell.lock().unwrap_or_else(PoisonError::into_inner) = state;
        }
        Ok(())
    }
}
