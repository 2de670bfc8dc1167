//! Callbacks: observe the steps and draws of a run's chains, and may end the run.

use super::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Draws, Trace};
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Observes the state of a chain after each step and at each recorded draw. [`Callbacks`]
/// combines closures and other callbacks.
pub trait Callback: fmt::Debug + Send + Sync {
    /// Called when a draw of a chain has been recorded; `trace` is the state. Values that
    /// no observation depends on are drawn with `draws`. A callback must not change the
    /// state, unless that is its purpose ([`super::calibration::geweke()`]): the chain
    /// continues from the state that the callback leaves. Draws of one chain come in
    /// order, chains in any order.
    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws);

    /// The state of the callback for a chain, for a checkpoint.
    fn save(&self, chain: u32) -> Vec<u8> {
        let _ = chain;
        Vec::new()
    }

    /// Restores what was gathered from a chain.
    ///
    /// # Errors
    /// If the bytes are not those of [`Callback::save`].
    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        let _ = chain;
        match state.is_empty() {
            true => Ok(()),
            false => Err(StateError::new("another callback gathered this")),
        }
    }

    /// Called when a chain has made `steps` steps; `trace` is its state.
    fn step(&self, chain: u32, steps: u64, trace: &Trace) {
        let _ = (chain, steps, trace);
    }

    /// True if all chains of the run should end; called between steps.
    fn is_over(&self) -> bool {
        false
    }
}

/// Called after a step with the chain, the number of its steps so far and its state.
type OnStep = dyn Fn(u32, u64, &Trace) -> ControlFlow<()> + Send + Sync;
/// Called at a draw with the chain and its state.
type OnDraw = dyn Fn(u32, &mut Trace) -> ControlFlow<()> + Send + Sync;

/// Combines closures and other callbacks into one, for
/// [`RunOptions::callback`](super::RunOptions::callback). A closure ends the run by
/// returning `ControlFlow::Break`; the run keeps its draws. Closures are called from the
/// chains' threads.
#[derive(Default)]
pub struct Callbacks {
    all: Vec<Arc<dyn Callback>>,
    on_step: Vec<Box<OnStep>>,
    on_draw: Vec<Box<OnDraw>>,
    over: AtomicBool,
}

impl fmt::Debug for Callbacks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Callbacks")
            .field("all", &self.all)
            .field("over", &self.over)
            .finish_non_exhaustive()
    }
}

impl Callbacks {
    /// No callbacks.
    pub fn new() -> Callbacks {
        Callbacks::default()
    }

    /// Adds a callback.
    #[must_use]
    pub fn with(mut self, callback: Arc<dyn Callback>) -> Callbacks {
        self.all.push(callback);
        self
    }

    /// Adds a closure that is called after each step of a chain with the chain, the
    /// number of its steps so far and its state.
    #[must_use]
    pub fn on_step(
        mut self,
        call: impl Fn(u32, u64, &Trace) -> ControlFlow<()> + Send + Sync + 'static,
    ) -> Callbacks {
        self.on_step.push(Box::new(call));
        self
    }

    /// Adds a closure that is called at each draw with the chain and its state, which it
    /// must not change.
    #[must_use]
    pub fn on_draw(
        mut self,
        call: impl Fn(u32, &mut Trace) -> ControlFlow<()> + Send + Sync + 'static,
    ) -> Callbacks {
        self.on_draw.push(Box::new(call));
        self
    }

    fn heed(&self, flow: ControlFlow<()>) {
        if flow.is_break() {
            self.over.store(true, Ordering::Relaxed);
        }
    }
}

impl FromIterator<Arc<dyn Callback>> for Callbacks {
    fn from_iter<I: IntoIterator<Item = Arc<dyn Callback>>>(all: I) -> Callbacks {
        Callbacks { all: all.into_iter().collect(), ..Callbacks::default() }
    }
}

impl Callback for Callbacks {
    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws) {
        self.all.iter().for_each(|c| c.draw(chain, trace, draws));
        self.on_draw.iter().for_each(|call| self.heed(call(chain, trace)));
    }

    fn step(&self, chain: u32, steps: u64, trace: &Trace) {
        self.all.iter().for_each(|c| c.step(chain, steps, trace));
        self.on_step.iter().for_each(|call| self.heed(call(chain, steps, trace)));
    }

    fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed) || self.all.iter().any(|c| c.is_over())
    }

    fn save(&self, chain: u32) -> Vec<u8> {
        match self.all.is_empty() {
            true => Vec::new(),
            false => pack(&self.all.iter().map(|c| c.save(chain)).collect::<Vec<_>>()),
        }
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        let saved: Vec<Vec<u8>> = match state.is_empty() {
            true => Vec::new(),
            false => unpack(state)?,
        };
        if saved.len() != self.all.len() {
            return Err(StateError::new("other callbacks gathered this"));
        }
        self.all.iter().zip(saved).try_for_each(|(c, state)| c.load(chain, &state))
    }
}
