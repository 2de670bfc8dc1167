//! The proposals of `knn`: the latents of scenes whose pictures look like the observed
//! one, and the interface that finds them.
//!
//! This module does not depend on pictures or files: code that does implements [`Banks`].

use pcadlang_engine::trace::{Target, Trace};
use pcadlang_numerics::dist::Datum;
use rustc_hash::FxHashMap;
use std::fmt;
use std::sync::Arc;

/// The value of a choice in a scene of a bank.
#[derive(Clone, Debug, PartialEq)]
pub enum Latent {
    /// The stored value of a discrete choice.
    Discrete(Datum),
    /// The coordinates of a continuous choice in the unconstrained space, under the
    /// support it had in that scene. A proposal from them is thus the same in every
    /// state, even if the support depends on other choices.
    Free(Vec<f64>),
}

/// The latents of one scene, by the hashes of their addresses.
pub type Latents = FxHashMap<u64, Latent>;

impl Latent {
    /// The latent of a choice of a trace; `None` if it is neither discrete nor has
    /// coordinates.
    pub fn of(trace: &Trace, t: Target) -> Option<Latent> {
        match trace.free(t) {
            Some((y, _)) if y.is_empty() => None,
            Some((y, _)) => Some(Latent::Free(y)),
            None => trace.stored(t).map(Latent::Discrete),
        }
    }

    /// The latents of all choices of a trace.
    pub fn all(trace: &Trace) -> Latents {
        let targets = trace.all_targets().iter();
        targets.filter_map(|t| Some((trace.address_hash(*t), Latent::of(trace, *t)?))).collect()
    }
}

/// The nearest neighbours of an observation.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    /// The latents of each neighbour.
    pub entries: Vec<Latents>,
    /// The standard deviation of each unconstrained coordinate over the scenes of `among`
    /// (see [`Neighbours::new`]).
    spreads: FxHashMap<u64, Vec<f64>>,
}

impl Neighbours {
    /// Neighbours, with the scale of each coordinate taken from the scenes `among`: draws
    /// from the prior, or an empty slice if there are none. The neighbours need not be
    /// right: a bad neighbour lowers the acceptance rate, but the kernel stays correct.
    pub fn new(entries: Vec<Latents>, among: &[Latents]) -> Neighbours {
        Neighbours { spreads: spreads(among), entries }
    }

    /// The standard deviation of a coordinate over scenes in general; 1 if it is unknown.
    pub(crate) fn spread(&self, hash: u64, coordinate: usize) -> f64 {
        let known = self.spreads.get(&hash).and_then(|s| s.get(coordinate)).copied();
        known.filter(|s| *s > 0.0).unwrap_or(1.0)
    }

    /// The standard deviation of each coordinate over the neighbours, by the hash of its
    /// choice.
    pub(crate) fn local(&self) -> FxHashMap<u64, Vec<f64>> {
        spreads(&self.entries)
    }
}

/// Standard deviations by coordinate, over the scenes in which the choice is continuous;
/// 0 for fewer than two. Scenes in which a choice has another number of coordinates than
/// in the first one are skipped.
fn spreads(scenes: &[Latents]) -> FxHashMap<u64, Vec<f64>> {
    let mut sums: FxHashMap<u64, (f64, Vec<[f64; 2]>)> = FxHashMap::default();
    for scene in scenes {
        for (hash, latent) in scene {
            let Latent::Free(y) = latent else { continue };
            let (n, moments) = sums.entry(*hash).or_insert_with(|| (0.0, vec![[0.0; 2]; y.len()]));
            if moments.len() != y.len() {
                continue;
            }
            *n += 1.0;
            // Welford's update, which is stable for means far from 0.
            for ([mean, square], y) in moments.iter_mut().zip(y) {
                let d = y - *mean;
                *mean += d / *n;
                *square += d * (y - *mean);
            }
        }
    }
    let sd = |n: f64, square: f64| if n < 2.0 { 0.0 } else { (square / (n - 1.0)).max(0.0).sqrt() };
    sums.into_iter()
        .map(|(h, (n, m))| (h, m.into_iter().map(|[_, square]| sd(n, square)).collect()))
        .collect()
}

/// Finds the neighbours of a run's observations.
pub trait Banks: fmt::Debug + Send + Sync {
    /// Returns the `k` scenes of a bank whose pictures are most like the observed one.
    /// Called once per kernel and chain, so implementations should cache the answer.
    ///
    /// # Errors
    /// Why the bank cannot be used here, as a message for users.
    fn neighbours(&self, bank: &str, k: usize) -> Result<Arc<Neighbours>, String>;
}

/// Returns the same neighbours for any bank.
impl Banks for Neighbours {
    fn neighbours(&self, _bank: &str, k: usize) -> Result<Arc<Neighbours>, String> {
        let entries = self.entries.iter().take(k).cloned().collect();
        Ok(Arc::new(Neighbours { entries, spreads: self.spreads.clone() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_standard_deviations() {
        let scene = |x: f64, y: f64| -> Latents {
            [(1, Latent::Free(vec![x, y])), (2, Latent::Discrete(Datum::Num(x)))]
                .into_iter()
                .collect()
        };
        let n = Neighbours::new(
            vec![scene(0.0, 5.0)],
            &[scene(1e9, 5.0), scene(1e9 + 2.0, 5.0), scene(1e9 + 4.0, 5.0)],
        );
        assert_eq!(n.spread(1, 0), 2.0);
        assert_eq!(
            (n.spread(1, 1), n.spread(2, 0), n.spread(9, 0)),
            (1.0, 1.0, 1.0),
            "unknown or none: 1"
        );
        assert_eq!(n.local()[&1], [0.0, 0.0], "one scene has no spread");
        assert_eq!(n.neighbours("any", 0).unwrap().entries.len(), 0);
    }
}
