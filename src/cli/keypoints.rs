//! Where the landmarks of a program's view are in the photograph, over all draws: `keypoints.json`.

use super::scene::view_operand;
use pcadlang::infer::{StateError, Watch};
use pcadlang::lang::builtins::scene::ViewValue;
use pcadlang::lang::code::Operand;
use pcadlang::report::Moments;
use pcadlang::trace::{Draws, Trace};
use serde_json::{Map, Value, json};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The landmarks of the chains, as their draws come. Clones share them.
#[derive(Clone, Debug)]
pub struct Joints {
    /// Width and height of the photograph in pixels; without one, positions are in pixels of the camera.
    size: Option<(u32, u32)>,
    chains: Arc<[Mutex<Chain>]>,
}

#[derive(Debug, Default)]
struct Chain {
    /// Where the view is: looked for once.
    view: Option<Option<Operand>>,
    moments: Moments,
}

impl Joints {
    /// For so many chains, over a photograph of this size.
    pub fn new(chains: u32, size: Option<(u32, u32)>) -> Joints {
        Joints { size, chains: (0..chains).map(|_| Mutex::default()).collect() }
    }

    fn chain(&self, chain: u32) -> Option<MutexGuard<'_, Chain>> {
        Some(self.chains.get(chain as usize)?.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The width and height of the picture that positions are in.
    fn pixels(&self, view: &ViewValue) -> (u32, u32) {
        self.size.unwrap_or((view.0.camera().width, view.0.camera().height))
    }

    /// Means and spreads over all draws of all chains so far.
    pub fn moments(&self) -> Moments {
        let mut all = Moments::default();
        for chain in self.chains.iter() {
            all.merge(&chain.lock().unwrap_or_else(PoisonError::into_inner).moments);
        }
        all
    }

    /// The landmarks of a view; none before the camera.
    pub fn positions(&self, view: &ViewValue) -> Vec<(Arc<str>, Option<[f64; 2]>)> {
        let (width, height) = self.pixels(view);
        view.landmarks(width, height).map(|(name, at)| (Arc::clone(name), at)).collect()
    }

    /// The file: means and spreads over all draws of all chains, and the best state, that of `view`. None if it has no
    /// landmarks.
    pub fn report(&self, view: &ViewValue, seconds: f64) -> Option<Value> {
        let best = self.positions(view);
        if best.is_empty() {
            return None;
        }
        let all = self.moments();
        let numbers = |xs: &[f64]| xs.iter().map(|x| rounded(*x)).collect::<Value>();
        let keypoints: Map<String, Value> =
            all.iter().map(|(name, p)| (name.to_owned(), numbers(&[p.mean[0], p.mean[1], p.sd()]))).collect();
        let best: Map<String, Value> =
            best.iter().filter_map(|(name, at)| Some((name.to_string(), numbers(&(*at)?)))).collect();
        Some(json!({ "keypoints": keypoints, "best": best, "seconds": rounded(seconds) }))
    }
}

/// A number of pixels or seconds to a thousandth.
fn rounded(x: f64) -> Value {
    json!((x * 1000.0).round() / 1000.0)
}

impl Watch for Joints {
    fn save(&self, chain: u32) -> Vec<u8> {
        self.chain(chain).and_then(|c| serde_json::to_vec(&c.moments).ok()).unwrap_or_default()
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        if let Some(mut chain) = self.chain(chain) {
            chain.moments = serde_json::from_slice(state).map_err(|e| StateError(e.to_string()))?;
        }
        Ok(())
    }

    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws) {
        let Some(mut chain) = self.chain(chain) else { return };
        let Some(at) = *chain.view.get_or_insert_with(|| view_operand(trace, draws)) else { return };
        let Ok(values) = trace.query(&[at], draws) else { return };
        let Some(view) = values.first().and_then(|v| v.downcast::<ViewValue>()) else { return };
        let found = trace.located();
        let (width, height) = self.pixels(view);
        let (width, height) = (f64::from(width), f64::from(height));
        for (name, at) in self.positions(view) {
            match (found.iter().find(|l| l.name == name), at) {
                (Some(l), _) => {
                    let diagonal = width * width + height * height;
                    chain.moments.add(&name, [l.at[0] * width, l.at[1] * height], l.variance * diagonal);
                }
                (None, Some(at)) => chain.moments.add(&name, at, 0.0),
                (None, None) => {}
            }
        }
    }
}
