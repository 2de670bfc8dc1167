//! Several who watch one run.

use super::plan::Watch;
use super::state::{StateError, pack, unpack};
use crate::trace::{Draws, Trace};
use std::sync::Arc;

/// Everybody who watches a run, each told of everything in turn.
#[derive(Clone, Debug, Default)]
pub struct Watches(pub Vec<Arc<dyn Watch>>);

impl Watch for Watches {
    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws) {
        self.0.iter().for_each(|w| w.draw(chain, trace, draws));
    }

    fn step(&self, chain: u32, steps: u64, trace: &Trace) {
        self.0.iter().for_each(|w| w.step(chain, steps, trace));
    }

    fn is_over(&self) -> bool {
        self.0.iter().any(|w| w.is_over())
    }

    fn save(&self, chain: u32) -> Vec<u8> {
        pack(&self.0.iter().map(|w| w.save(chain)).collect::<Vec<_>>())
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        let all: Vec<Vec<u8>> = unpack(state)?;
        if all.len() != self.0.len() {
            return Err(StateError::new("others watched this"));
        }
        self.0.iter().zip(all).try_for_each(|(w, state)| w.load(chain, &state))
    }
}
