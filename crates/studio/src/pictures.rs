//! Pictures of one run: kept, so that none is drawn twice, and drawn so rarely that the
//! chains do not slow down.

use pcadlang_runs::drawing_budget::DrawingBudget;
use serde_json::{Map, Value};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Maximum cached pictures per run.
const KEPT: usize = 24;

/// A picture file with its header.
pub type Encoded = (Map<String, Value>, Arc<Vec<u8>>);

/// The pictures of a run that were drawn last, and when the next one may be drawn.
#[derive(Default)]
pub struct Pictures {
    kept: Mutex<VecDeque<(String, Encoded)>>,
    turn: Mutex<DrawingBudget>,
    /// Held while one is drawn, so that many tabs do not draw the same one.
    drawing: Mutex<()>,
}

impl Pictures {
    /// Returns a picture that was drawn before.
    pub fn get(&self, key: &str) -> Option<Encoded> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.iter().find(|(k, _)| k == key).map(|(_, e)| e.clone())
    }

    /// Keeps a picture, in place of the oldest one.
    pub fn keep(&self, key: String, picture: &Encoded) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push_back((key, picture.clone()));
        while kept.len() > KEPT {
            kept.pop_front();
        }
    }

    /// Waits until nobody else draws this run: many tabs then share one picture.
    pub fn alone(&self) -> MutexGuard<'_, ()> {
        self.drawing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives up the memory of all pictures.
    pub fn forget(&self) {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// Waits until a picture may be drawn beside the chains, draws it, and keeps account
    /// of what that cost.
    pub fn in_turn<T>(&self, is_working: bool, draw: impl FnOnce() -> T) -> T {
        let turn = || self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        if is_working {
            let rest = turn().rest();
            std::thread::sleep(rest);
        }
        let begun = Instant::now();
        let drawn = draw();
        turn().took(begun.elapsed());
        drawn
    }
}
