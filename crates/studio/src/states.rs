//! States of runs: which trace a name stands for, and its picture. Pictures are cached, and
//! drawn so rarely that the chains do not slow down.

use super::app::{no_view, picture};
use super::protocol::{StateName, Viewpoint};
use super::run::{Run, revision};
use pcadlang_engine::trace::{SavedTrace, Trace};
use pcadlang_inference::{KeptTrace, TrajectoryState};
use pcadlang_report::Mode;
use pcadlang_runs::drawing_budget::DrawingBudget;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::inputs::Ready;
use pcadlang_runs::reopening::film::best_chain;
use pcadlang_runs::reopening::reopened::Reopened;
use pcadlang_runs::scene;
use pcadlang_workbench::session::Layer;
use serde_json::{Map, Value, json};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// A trace of a run, with the program it belongs to.
pub struct RunState {
    /// The compiled program.
    pub ready: Arc<Ready>,
    /// The trace.
    pub trace: Trace,
}

impl Run {
    /// Returns the kept draws, chain by chain.
    pub fn kept(&self) -> Result<Vec<KeptTrace>, Failure> {
        match self.watched() {
            Some(w) => Ok(w.kept.all()),
            // It waits, or is being prepared.
            None if self.is_active() => Ok(Vec::new()),
            None => Ok(Reopened::open(&self.folder)?.traces().unwrap_or_default()),
        }
    }

    /// Returns the states on the way of the chain that ended best.
    pub fn film(&self) -> Result<Vec<TrajectoryState>, Failure> {
        let all = match self.watched() {
            Some(w) => w.trajectory.all(),
            None if self.is_active() => Vec::new(),
            None => Reopened::open(&self.folder)?.trajectory().unwrap_or_default(),
        };
        Ok(best_chain(&all).into_iter().cloned().collect())
    }

    /// Returns the modes, once the run has ended.
    pub fn modes(&self) -> Vec<Mode> {
        serde_json::from_value(self.summary_file()["modes"].clone()).unwrap_or_default()
    }

    /// Builds the trace of a state.
    pub fn state(&self, name: &StateName) -> Result<RunState, Failure> {
        let ready = self.ready()?;
        let missing = |what: &str, n: usize| plain(format!("{} has no {what} {n}", self.name));
        let saved: SavedTrace = match *name {
            // Kept draws are thinned while a run goes on: a page may know of more.
            StateName { draw: Some(n), .. } => {
                let mut kept = self.kept()?;
                let last = kept.len().checked_sub(1).ok_or_else(|| missing("kept draw", n))?;
                kept.swap_remove(n.min(last)).trace
            }
            StateName { film: Some(n), .. } => {
                self.film()?.into_iter().nth(n).ok_or_else(|| missing("film state", n))?.trace
            }
            StateName { mode: Some(n), .. } => {
                let modes = self.modes();
                let mode = modes.get(n).ok_or_else(|| missing("mode", n))?;
                let of = |k: &KeptTrace| mode.chains.contains(&(k.chain as usize));
                let best = self.kept()?.into_iter().filter(of);
                let best = best.max_by(|a, b| a.log_joint.total_cmp(&b.log_joint));
                best.ok_or_else(|| missing("kept draw of mode", n))?.trace
            }
            _ => match self.watched() {
                Some(w) => {
                    let state = w.best.state().ok_or_else(|| plain("the run has no state yet"))?;
                    let draws = scene::predictive(0, 0);
                    let trace = scene::rebuilt(&ready.model, &state.choices, draws)?;
                    return Ok(RunState { ready, trace });
                }
                None => Reopened::open(&self.folder)?.best()?,
            },
        };
        let trace = scene::loaded(&ready.model, &saved).map_err(|e| plain(e.to_string()))?;
        Ok(RunState { ready, trace })
    }

    /// Draws a picture of a state, or returns the one that was drawn before.
    pub fn picture(
        &self,
        name: &StateName,
        layer: Layer,
        size: u32,
        camera: Option<Viewpoint>,
    ) -> Result<Encoded, Failure> {
        let is_best = name.draw.or(name.film).or(name.mode).is_none();
        let watched = self.watched().filter(|_| is_best);
        let (best, is_working) = match &watched {
            Some(w) => (w.best.state().map(|b| b.log_joint), !w.progress.pause.is_on()),
            None => (None, false),
        };
        let key = format!("{name:?} {layer:?} {size} {camera:?} {best:?}");
        let _drawing = watched.as_ref().map(|_| self.pictures.alone());
        if let Some(picture) = self.pictures.get(&key) {
            return Ok(picture);
        }
        let picture = self.pictures.in_turn(is_working, || {
            let mut state = self.state(name)?;
            let log_joint = state.trace.log_joint();
            let draws = scene::predictive(0, 0);
            let view = scene::view(&mut state.trace, draws, None).ok_or_else(no_view)?;
            let located = state.trace.located();
            let (mut header, data) =
                picture(&view, state.ready.image(), &located, layer, size, camera)?;
            header.insert("log_joint".into(), super::results::finite(log_joint));
            header.insert("revision".into(), json!(revision(log_joint)));
            Ok::<_, Failure>((header, Arc::new(data)))
        })?;
        self.pictures.keep(key, &picture);
        Ok(picture)
    }
}

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
