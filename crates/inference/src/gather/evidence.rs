//! The evidence of the modes that disagreeing chains are in, gathered draw by draw.

use crate::callback::Callback;
use crate::diagnostics::{Clouds, LogEvidence, log_density, log_evidence, shares};
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Draws, Trace};
use rustc_hash::FxHasher;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::hash::{Hash, Hasher};
use std::sync::{Mutex, PoisonError};

/// The most choices of a program whose modes are weighed, and the most configurations of
/// a chain that are distinguished.
const MOST: (usize, usize) = (256, 32);
/// The standard error in nats up to which an evidence counts as known.
const KNOWN: f64 = 3.0;
/// All of the first draws up to this number are used, and then every n-th.
const LOOKED_AT: (u64, u64) = (1000, 8);

/// Gathers the draws of chains, as a run's callback.
#[derive(Debug, Default)]
pub struct Evidence(Vec<Mutex<Gathered>>);

/// A chain's draws by configuration: the set of choices and the values of the discrete
/// ones.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Gathered {
    /// Draws so far, and the number of them that were used.
    draws: u64,
    looked: u64,
    clouds: BTreeMap<u64, Clouds>,
}

impl Evidence {
    /// For a run of `chains` chains.
    pub fn new(chains: u32) -> Evidence {
        Evidence((0..chains).map(|_| Mutex::default()).collect())
    }

    /// Estimates the evidence of the mode that these chains, numbered from 0, are in:
    /// that of their most frequent configuration, divided by the fraction of draws in it.
    /// `None` if there are too few draws, or too many choices to be worth the time.
    pub fn of(&self, chains: &[usize]) -> Option<Weighed> {
        let chains = chains.iter().filter_map(|c| self.0.get(*c));
        let locked: Vec<_> =
            chains.map(|c| c.lock().unwrap_or_else(PoisonError::into_inner)).collect();
        let mut counts: BTreeMap<u64, u64> = BTreeMap::new();
        for (key, clouds) in locked.iter().flat_map(|c| &c.clouds) {
            *counts.entry(*key).or_default() += clouds.count();
        }
        let (key, count) = counts.into_iter().max_by_key(|(_, n)| *n)?;
        let looked: u64 = locked.iter().map(|c| c.looked).sum();
        let clouds: Vec<&Clouds> = locked.iter().filter_map(|c| c.clouds.get(&key)).collect();
        let over = |e: LogEvidence| LogEvidence {
            value: e.value - libm::log(count as f64 / looked as f64),
            ..e
        };
        Some(Weighed {
            evidence: log_evidence(&clouds).map(over),
            density: over(log_density(&clouds)?),
        })
    }
}

/// The estimates for a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighed {
    /// Its evidence, if it can be estimated.
    pub evidence: Option<LogEvidence>,
    /// Its mean log density: the evidence without the term for the mode's width.
    pub density: LogEvidence,
}

impl Weighed {
    /// The probabilities of modes: by their evidences if all are known to within
    /// [`KNOWN`], else as if all modes were equally wide. The flag says whether the
    /// evidences are known.
    pub fn probabilities(all: &[Weighed]) -> (Vec<f64>, bool) {
        let known =
            all.iter().map(|w| w.evidence.filter(|e| e.error <= KNOWN)).collect::<Option<Vec<_>>>();
        match known {
            Some(evidences) => (shares(&evidences), true),
            None => (shares(&all.iter().map(|w| w.density).collect::<Vec<_>>()), false),
        }
    }
}

/// The configuration of a state, its continuous choices in the unconstrained space, and
/// its log density there.
fn free(trace: &Trace) -> Option<(u64, Vec<f64>, f64)> {
    let targets = trace.all_targets();
    if targets.len() > MOST.0 {
        return None;
    }
    let (mut key, mut y, mut log_density) = (FxHasher::default(), Vec::new(), trace.log_joint());
    for t in targets {
        trace.address_hash(*t).hash(&mut key);
        match trace.free_to_move(*t) {
            Some((own, log_jacobian)) => {
                own.len().hash(&mut key);
                y.extend(own);
                log_density += log_jacobian;
            }
            None => pack(&trace.stored(*t)).hash(&mut key),
        }
    }
    (y.len() <= MOST.0).then(|| (key.finish(), y, log_density))
}

impl Callback for Evidence {
    fn draw(&self, chain: u32, trace: &mut Trace, _: Draws) {
        let Some(cell) = self.0.get(chain as usize) else { return };
        let mut chain = cell.lock().unwrap_or_else(PoisonError::into_inner);
        chain.draws += 1;
        if chain.draws > LOOKED_AT.0 && !chain.draws.is_multiple_of(LOOKED_AT.1) {
            return;
        }
        let Some((key, y, log_density)) = free(trace) else { return };
        chain.looked += 1;
        if chain.clouds.len() < MOST.1 || chain.clouds.contains_key(&key) {
            chain.clouds.entry(key).or_default().add(&y, log_density);
        }
    }

    fn save(&self, chain: u32) -> Vec<u8> {
        let Some(cell) = self.0.get(chain as usize) else { return Vec::new() };
        pack(&*cell.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        if let Some(cell) = self.0.get(chain as usize) {
            *cell.lock().unwrap_or_else(PoisonError::into_inner) = unpack(state)?;
        }
        Ok(())
    }
}
