//! Callbacks of a run.

use super::plan::Watch;
use crate::trace::{Draws, Trace};
use std::fmt;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

/// After a step: the chain, how many steps it has made, its state.
type OnStep = dyn Fn(u32, u64, &Trace) -> ControlFlow<()> + Send + Sync;
/// At a draw: the chain, its state.
type OnDraw = dyn Fn(u32, &mut Trace) -> ControlFlow<()> + Send + Sync;

/// Callbacks of a run, for [`RunOptions::watch`](super::RunOptions::watch): they see what
/// chains do and may end the run, all chains of it, which then keeps its draws. They are
/// called from the chains' threads.
///
/// ```
/// use pcadlang::infer::Observer;
/// use pcadlang::{Model, RunOptions};
/// use std::ops::ControlFlow;
/// use std::sync::Arc;
/// use std::sync::atomic::{AtomicU64, Ordering};
/// let seen = Arc::new(AtomicU64::new(0));
/// let count = Arc::clone(&seen);
/// let observer = Observer::new()
///     .on_step(|_chain, steps, trace| match steps < 5000 && trace.log_joint().is_finite() {
///         true => ControlFlow::Continue(()),
///         false => ControlFlow::Break(()),
///     })
///     .on_draw(move |_chain, trace| match count.fetch_add(1, Ordering::Relaxed) {
///         99 => ControlFlow::Break(()),
///         _ => ControlFlow::Continue(assert!(trace.get("@x").is_ok())),
///     });
/// let model = Model::from_text("assume x ~ normal(0, 1); observe normal(x, 1) = 2; infer { repeat 1000 { mh(@x); } }")?;
/// let options = RunOptions { watch: Some(Arc::new(observer)), ..RunOptions::default() };
/// let posterior = model.run(&options, 1, 1)?;
/// assert_eq!(posterior.draws[0].rows.len(), 100);
/// # Ok::<(), pcadlang::Error>(())
/// ```
#[derive(Default)]
pub struct Observer {
    step: Option<Box<OnStep>>,
    draw: Option<Box<OnDraw>>,
    over: AtomicBool,
}

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Observer").field("over", &self.over).finish_non_exhaustive()
    }
}

impl Observer {
    /// Nothing is called yet.
    pub fn new() -> Observer {
        Observer::default()
    }

    /// Called after each step of a chain with the chain, its steps so far and its state.
    #[must_use]
    pub fn on_step(
        mut self,
        call: impl Fn(u32, u64, &Trace) -> ControlFlow<()> + Send + Sync + 'static,
    ) -> Observer {
        self.step = Some(Box::new(call));
        self
    }

    /// Called at each draw with the chain and its state, which is to be left as it is.
    #[must_use]
    pub fn on_draw(
        mut self,
        call: impl Fn(u32, &mut Trace) -> ControlFlow<()> + Send + Sync + 'static,
    ) -> Observer {
        self.draw = Some(Box::new(call));
        self
    }

    fn heed(&self, flow: ControlFlow<()>) {
        if flow.is_break() {
            self.over.store(true, Ordering::Relaxed);
        }
    }
}

impl Watch for Observer {
    fn draw(&self, chain: u32, trace: &mut Trace, _draws: Draws) {
        if let Some(call) = &self.draw {
            self.heed(call(chain, trace));
        }
    }

    fn step(&self, chain: u32, steps: u64, trace: &Trace) {
        if let Some(call) = &self.step {
            self.heed(call(chain, steps, trace));
        }
    }

    fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }
}
