//! Pictures of one run: kept, so that none is drawn twice, and drawn so rarely that the
//! chains do not slow down.

use serde_json::{Map, Value};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The least time between two pictures of a run whose chains are at work.
const BETWEEN: Duration = Duration::from_millis(200);
/// The part of the machine that may go to such pictures.
const SHARE: f64 = 0.025;
/// The longest time between two pictures, in seconds.
const MOST_REST: f64 = 2.0;
/// The number of pictures whose times are remembered.
const REMEMBERED: usize = 8;
/// The most pictures of a run that are kept.
const KEPT: usize = 24;
/// A picture file with its header.
pub type Encoded = (Map<String, Value>, Arc<Vec<u8>>);

/// The pictures of a run that were drawn last, and when the next one may be drawn.
#[derive(Default)]
pub struct Pictures {
    kept: Mutex<VecDeque<(String, Encoded)>>,
    turn: Mutex<Turn>,
    /// Held while one is drawn, so that many tabs do not draw the same one.
    drawing: Mutex<()>,
}

/// When the next picture of a run may be drawn.
#[derive(Default)]
struct Turn {
    next: Option<Instant>,
    /// How long the last pictures took. The least of these times is near to what one costs:
    /// beside chains that use the whole machine, a picture takes longer than that.
    took: VecDeque<Duration>,
}

impl Turn {
    fn done(&mut self, took: Duration) {
        self.took.push_back(took);
        if self.took.len() > REMEMBERED {
            self.took.pop_front();
        }
        let cost = self.took.iter().min().copied().unwrap_or_default();
        let threads = crate::cli::running::job::machine_threads() as f64;
        let rest = (cost.as_secs_f64() / (SHARE * threads)).min(MOST_REST);
        self.next = Some(Instant::now() + BETWEEN.max(Duration::from_secs_f64(rest)));
    }
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
        let next = turn().next.filter(|_| is_working);
        if let Some(wait) = next.and_then(|n| n.checked_duration_since(Instant::now())) {
            std::thread::sleep(wait);
        }
        let begun = Instant::now();
        let drawn = draw();
        turn().done(begun.elapsed());
        drawn
    }
}
