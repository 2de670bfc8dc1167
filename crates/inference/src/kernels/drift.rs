//! Random walks in the unconstrained space, with scales adapted in warm-up.
//!
//! A continuous choice moves by a Gaussian step in the unconstrained space. The step is
//! taken in the coordinates of the present state, the new value is read in those of the
//! proposed state, and the ratio includes the log Jacobians of both. This is correct also
//! for a support that depends on another choice of the block. A finite discrete choice
//! moves to another of its values, an unbounded integer by a few units.

use super::row::{KernelRow, SEL, Type, number, opt};
use super::shape::{MOST, Shape};
use crate::kernel::{
    Kernel, Outcome, Pick, Registered, SiteSelection, StepContext, accept_or_reject, recoverable,
};
use crate::state::{StateError, holds, in_order, pack, unpack};
use pcadlang_engine::lang::key::mix;
use pcadlang_engine::trace::{Change, Target, Trace, TraceResult};
use pcadlang_numerics::dist::{Datum, Support};
use pcadlang_numerics::rng::Stream;
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

pub(crate) const ROW: KernelRow = KernelRow::new(
    "drift",
    &[
        SEL,
        opt(
            "scale",
            Type::Num,
            "learnt",
            "A fixed step size in the unconstrained space, instead of one adapted in warm-up.",
        ),
    ],
    "Gaussian random walk in the unconstrained space; discrete choices move to another value.",
    number!("infer { warmup 200 { drift(@x); } repeat 100 { drift(@x); collect x; } }"),
    |call| call.moving(|scope, call| Ok(Drift::new(scope, call.positive_if_given("scale")?))),
);

/// The target acceptance rates in one dimension and in many (Roberts & Rosenthal 2001).
const ONE_D: f64 = 0.44;
const MANY_D: f64 = 0.234;

/// The bound on the absolute logarithm of adapted scales.
const FARTHEST: f64 = 350.0;

/// `drift(sel, scale)`: a random walk in the unconstrained space.
#[derive(Clone, Debug)]
pub struct Drift {
    scope: Registered,
    initial: f64,
    adaptive: bool,
    /// By address if one choice moves at a time; under 0 if all move together.
    scales: FxHashMap<u64, Scale>,
    /// By address: the standard deviation of each choice in the unconstrained space, for
    /// joint moves.
    spreads: FxHashMap<u64, Spread>,
    /// By the hash of their addresses: the shape of choices that move together.
    shapes: FxHashMap<u64, Shape>,
    /// True if a joint move of warm-up made choices appear or vanish.
    structural: bool,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Scale {
    log: f64,
    steps: f64,
}

/// A running variance (Welford 1962), pooled over the coordinates of a choice.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Spread {
    count: f64,
    mean: Vec<f64>,
    square: f64,
}

impl Spread {
    fn add(&mut self, y: &[f64]) {
        if self.mean.len() != y.len() {
            *self = Spread { count: 0.0, mean: vec![0.0; y.len()], square: 0.0 };
        }
        self.count += 1.0;
        for (m, y) in self.mean.iter_mut().zip(y) {
            let d = y - *m;
            *m += d / self.count;
            self.square += d * (y - *m);
        }
    }

    fn sd(&self) -> f64 {
        let n = self.mean.len() as f64;
        if self.count < 20.0 || n == 0.0 {
            return 1.0;
        }
        (self.square / (n * (self.count - 1.0))).sqrt().clamp(1e-3, 1e3)
    }
}

/// The part of the proposal ratio that is known before the update.
struct Move {
    /// `None` for a choice that has only one value.
    change: Option<Change>,
    /// The log density of the move by itself: minus the log of the number of values it
    /// could have moved to, or the log Jacobian at the old point.
    old_term: f64,
    /// The old value of a choice with finitely many values.
    finite: Option<Datum>,
    dimensions: usize,
}

impl Move {
    /// The log density of the reverse move, without the terms of
    /// [`pcadlang_engine::trace::Weight`]; `None` if the move cannot be reversed.
    fn back(&self, trace: &Trace, t: Target) -> Option<f64> {
        let values = trace.dist(t)?.stored_support().finite_values();
        match (&self.finite, values) {
            (None, None) => Some(0.0),
            (Some(old), Some(v)) if self.change.is_some() => {
                (v.len() > 1 && v.contains(old)).then(|| -libm::log(v.len() as f64 - 1.0))
            }
            (Some(_), Some(v)) => (v.len() == 1).then_some(0.0),
            _ => None,
        }
    }
}

/// The probability that a joint move has the shape of the posterior, if moves may change which
/// choices exist: those that do so must not have one, as the shape belongs to the choices.
const SHAPED: f64 = 0.75;

impl Drift {
    /// A kernel for these choices. Without a scale, one is adapted in warm-up.
    pub fn new(scope: SiteSelection, scale: Option<f64>) -> Self {
        Drift {
            scope: Registered::new(scope),
            initial: scale.unwrap_or(0.5),
            adaptive: scale.is_none(),
            scales: FxHashMap::default(),
            spreads: FxHashMap::default(),
            shapes: FxHashMap::default(),
            structural: false,
        }
    }

    /// Proposes a move of a choice that is at `free` in the unconstrained space, along
    /// `step` if that is given.
    fn propose_one(
        trace: &Trace,
        t: Target,
        free: Option<(Vec<f64>, f64)>,
        step: Option<&[f64]>,
        scale: f64,
        rng: &mut Stream,
    ) -> Option<Move> {
        let Some((mut y, old_term)) = free else {
            return discrete_move(&trace.dist(t)?.stored_support(), &trace.stored(t)?, scale, rng);
        };
        let dimensions = y.len();
        if let Some(step) = step {
            y.iter_mut().zip(step).for_each(|(y, d)| *y += scale * d);
            return Some(Move {
                change: Some(Change::Free(y)),
                old_term,
                finite: None,
                dimensions,
            });
        }
        // The scale is itself random, with occasional much longer or shorter steps, so
        // that chains leave narrow modes and settle in wide ones. It does not depend on
        // the state, so the proposal remains symmetric.
        let scale = scale * libm::exp(rng.standard_normal());
        for v in &mut y {
            *v += scale * rng.standard_normal();
        }
        Some(Move { change: Some(Change::Free(y)), old_term, finite: None, dimensions })
    }

    fn key(&self, trace: &Trace, targets: &[Target]) -> u64 {
        if self.scope.scope.pick != Pick::All { trace.address_hash(targets[0]) } else { 0 }
    }

    fn adapt(&mut self, key: u64, accepted: bool, dimensions: usize) {
        let aim = if dimensions <= 1 { ONE_D } else { MANY_D };
        let s = self
            .scales
            .entry(key)
            .or_insert_with(|| Scale { log: libm::log(self.initial), steps: 0.0 });
        s.steps += 1.0;
        // The gain is at least a twentieth, since the target changes throughout an
        // annealed warm-up.
        let gain = libm::pow(s.steps, -0.6).max(0.05);
        s.log += gain * (f64::from(u8::from(accepted)) - aim) * 2.0;
        s.log = s.log.clamp(-FARTHEST, FARTHEST);
    }
}

fn discrete_move(support: &Support, stored: &Datum, scale: f64, rng: &mut Stream) -> Option<Move> {
    if let Some(values) = support.finite_values() {
        let here = values.iter().position(|v| v == stored)?;
        let finite = Some(stored.clone());
        if values.len() < 2 {
            return Some(Move { change: None, old_term: 0.0, finite, dimensions: 0 });
        }
        let mut i = rng.index(values.len() - 1);
        if i >= here {
            i += 1;
        }
        let old_term = -libm::log(values.len() as f64 - 1.0);
        return Some(Move {
            change: Some(Change::Set(values[i].clone())),
            old_term,
            finite,
            dimensions: 1,
        });
    }
    let Datum::Num(x) = stored else { return None };
    let reach = 1 + libm::floor(scale.clamp(0.0, 1e6)) as usize;
    let jump = 1.0 + rng.index(reach) as f64;
    let to = if rng.uniform() < 0.5 { x + jump } else { x - jump };
    Some(Move {
        change: Some(Change::Set(Datum::Num(to))),
        old_term: 0.0,
        finite: None,
        dimensions: 1,
    })
}

impl Kernel for Drift {
    fn name(&self) -> String {
        "drift".into()
    }

    fn decides_in_stages(&mut self, _: &Trace) -> bool {
        true
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn save(&self, _: &Trace) -> Vec<u8> {
        let (scales, spreads) = (in_order(&self.scales), in_order(&self.spreads));
        pack(&(scales, spreads, in_order(&self.shapes), self.structural))
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        (self.scales, self.spreads, self.shapes, self.structural) = unpack(state)?;
        holds(self.shapes.values().all(Shape::fits), "drift")
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, ways) = self.scope.members(trace, &mut rng);
        if targets.is_empty() {
            return Ok(Outcome::default());
        }
        let key = self.key(trace, &targets);
        let scale = libm::exp(self.scales.get(&key).map_or(libm::log(self.initial), |s| s.log));
        let joint = targets.len() > 1;
        let mut changes = Vec::with_capacity(targets.len());
        let mut moves = Vec::with_capacity(targets.len());
        let (mut dimensions, mut dimensions_before) = (0, 0);
        let frees: Vec<_> = targets.iter().map(|t| trace.free_to_move(*t)).collect();
        let shape = joint.then(|| shape_key(trace, &targets, &frees));
        let dimension: usize = frees.iter().flatten().map(|(y, _)| y.len()).sum();
        let shaped = !self.structural || rng.uniform() < SHAPED;
        let along = shape.filter(|_| shaped).and_then(|k| self.shapes.get(&k));
        let along = along.and_then(|s| s.step(&mut rng));
        // A shape of another size can only come from a checkpoint.
        let along = along.filter(|a| a.len() == dimension);
        // A random length, independent of the state.
        let length = if along.is_some() { libm::exp(0.5 * rng.standard_normal()) } else { 1.0 };
        for (t, free) in targets.iter().zip(frees) {
            let size = free.as_ref().map_or(0, |(y, _)| y.len());
            let step = along.as_ref().map(|a| &a[dimensions_before..dimensions_before + size]);
            dimensions_before += size;
            let spread = if along.is_some() {
                length
            } else if joint {
                self.spreads.get(&trace.address_hash(*t)).map_or(1.0, Spread::sd)
            } else {
                1.0
            };
            let Some(m) = Self::propose_one(trace, *t, free, step, scale * spread, &mut rng) else {
                continue;
            };
            dimensions += m.dimensions;
            changes.extend(m.change.clone().map(|c| (*t, c)));
            moves.push((*t, m));
        }
        if changes.is_empty() {
            return Ok(Outcome::default());
        }
        let proposed = trace.propose(&changes, at.draws(0));
        let mut outcome = match recoverable(proposed)? {
            None => Outcome::failed(),
            Some(w) => {
                let mut ratio =
                    at.tempered(&w) + w.log_jacobian + ways - self.scope.reverse_selection(trace);
                // A choice that vanishes does so whatever its move was, and reappears
                // from its prior.
                for (t, m) in moves.iter().filter(|(t, _)| !trace.was_removed(*t)) {
                    ratio += m.back(trace, *t).unwrap_or(f64::NEG_INFINITY) - m.old_term;
                }
                let structural = w.appeared + w.vanished > 0;
                // The way back would have another shape.
                if structural && along.is_some() {
                    ratio = f64::NEG_INFINITY;
                }
                self.structural |= structural && joint && at.adapting && self.adaptive;
                accept_or_reject(trace, at, ratio, &mut rng)?
            }
        };
        outcome.site = (!joint).then_some(targets[0]);
        if at.adapting && self.adaptive {
            self.adapt(key, outcome.accepted > 0, dimensions);
            if joint {
                self.learn(trace, at);
            }
        }
        Ok(outcome)
    }
}

/// The key of the shape of a set of choices.
fn shape_key(trace: &Trace, targets: &[Target], frees: &[Option<(Vec<f64>, f64)>]) -> u64 {
    let one = |h, (t, free): (&Target, &Option<(Vec<f64>, f64)>)| {
        mix(mix(h, trace.address_hash(*t)), free.as_ref().map_or(0, |(y, _)| y.len() as u64))
    };
    targets.iter().zip(frees).fold(0, one)
}

impl Drift {
    /// Adapts the standard deviations and the shape of the choices that move together to
    /// the present state.
    fn learn(&mut self, trace: &mut Trace, at: &StepContext) {
        let selection = self.scope.selection(trace);
        let targets = trace.targets(selection);
        let frees: Vec<_> = targets.iter().map(|t| trace.free_to_move(*t)).collect();
        for (t, free) in targets.iter().zip(&frees) {
            if let Some((y, _)) = free {
                self.spreads.entry(trace.address_hash(*t)).or_default().add(y);
            }
        }
        let y: Vec<f64> = frees.iter().flatten().flat_map(|(y, _)| y.iter().copied()).collect();
        // An annealed posterior has another shape.
        if at.power == 1.0 && (2..=MOST).contains(&y.len()) {
            let key = shape_key(trace, targets, &frees);
            self.shapes.entry(key).or_insert_with(|| Shape::new(y.len())).add(&y);
        }
    }
}
