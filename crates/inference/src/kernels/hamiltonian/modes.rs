//! `modes(sel)`: independence Metropolis-Hastings from the Laplace approximations of
//! modes that were found before.
//!
//! The first step searches for modes. From then on the mixture of their approximations is
//! fixed, so that proposing from it is exact even if modes were missed: those are visited
//! by other kernels only. In warm-up the first step also moves the chain to one of the
//! modes, drawn by their evidence: the chain then begins where the mass is, and not in
//! the mode it happened to climb to.

use super::ascent::{Past, Scales, ascend};
use super::laplace::Laplace;
use super::memory::Memory;
use super::system::System;
use crate::kernel::{Kernel, Outcome, Registered, SiteSelection, StepContext, decide, recoverable};
use crate::kernels::row::{KernelRow, SEL, Type, int, number, opt};
use crate::state::{StateError, pack, unpack};
use pcadlang_engine::trace::{Change, Constraint, Selector, Target, Trace, TraceResult};
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::rng::Stream;
use serde::{Deserialize, Serialize};

pub(crate) const ROW: KernelRow = KernelRow::new(
    "modes",
    &[
        SEL,
        int(
            "tries",
            200,
            [1, 1_000_000],
            "The number of draws from the prior, from which starting points are chosen.",
        ),
        int("keep", 16, [1, 1000], "The number of these, the most probable, that climb to a mode."),
        int("steps", 60, [1, 1_000_000], "The maximum number of optimisation steps per climb."),
        opt(
            "first",
            Type::Selection,
            "none",
            "Choices that are optimised alone for some steps in each draw, before draws are \
             compared.",
        ),
        opt(
            "at",
            Type::Selection,
            "none",
            "Observations that are replaced by their coarse surrogates during the search for \
             modes.",
        ),
    ],
    "Jumps between modes. The first step searches for them: the most probable draws of the \
     selected choices climb by L-BFGS, in rounds that each keep the better half; in warm-up \
     the state then moves to one of the modes, drawn by the Laplace estimates of their \
     evidence, and with `at` it climbs further under the observations themselves (choices \
     that no surrogate depends on are left out). After that, all selected choices are \
     proposed jointly from a mixture of Laplace approximations at the modes (independent \
     Metropolis-Hastings, Tierney 1994).",
    number!("infer { warmup 20 { modes(@x); } repeat 100 { modes(@x); collect x; } }"),
    |call| {
        call.moving(|scope, call| {
            let tries = call.whole("tries")?;
            let keep = call.whole("keep")?;
            let steps = call.whole("steps")?;
            let modes = Modes::new(scope, tries, keep, steps).climbing_first(call.scope("first")?);
            Ok(modes.by_surrogates_of(call.selector("at")?))
        })
    },
);

/// The step of the finite differences for curvatures.
const STEP: f64 = 1e-4;
/// Modes that are this much less likely than the best, in nats, are dropped; and the most
/// modes that are kept.
const BEHIND: f64 = 30.0;
const MOST: usize = 6;
/// Climbs belong to the same mode if their heights differ by less, in nats, and each of
/// their coordinates by less.
const SAME: (f64, f64) = (1e-6, 1e-2);
/// The number of steps of the choices that climb first.
const FIRST: u32 = 8;
/// The number of steps of the chain from a mode under surrogates towards that of the
/// observations themselves.
const LAST: u32 = 40;
/// The fraction of a run's time after which a search ends with what it has: draws need
/// the rest.
const SEARCH: f64 = 0.75;
/// The fraction of proposals that is divided equally among the modes, since the evidence
/// is an estimate.
const ALIKE: f64 = 0.1;

/// A mode: the values of the discrete choices, a Gaussian for the others, and the log of
/// its weight.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Mode {
    discrete: Vec<Datum>,
    about: Laplace,
    log_share: f64,
}

/// The modes that were found, and for which choices.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Found {
    /// For each choice, its address and number of unconstrained coordinates; 0 for
    /// discrete ones.
    signature: Vec<(u64, usize)>,
    modes: Vec<Mode>,
}

/// Jumps between modes.
#[derive(Clone, Debug)]
pub struct Modes {
    scope: Registered,
    tries: u32,
    keep: u32,
    steps: u32,
    /// The choices that climb alone in each draw.
    first: Option<Registered>,
    /// The observations whose surrogates the search uses.
    coarse: Selector,
    found: Option<Found>,
}

/// The selected choices of a state: the values of discrete ones, and the coordinates of
/// the others.
struct Here {
    signature: Vec<(u64, usize)>,
    targets: Vec<Target>,
    discrete: Vec<Datum>,
    y: Vec<f64>,
    log_jacobian: f64,
}

impl Here {
    fn of(trace: &Trace, targets: &[Target]) -> Option<Here> {
        let mut here = Here {
            signature: Vec::with_capacity(targets.len()),
            targets: targets.to_vec(),
            discrete: Vec::new(),
            y: Vec::new(),
            log_jacobian: 0.0,
        };
        for t in targets {
            let free = trace.free_to_move(*t).filter(|(own, _)| !own.is_empty());
            here.signature
                .push((trace.address_hash(*t), free.as_ref().map_or(0, |(own, _)| own.len())));
            match free {
                Some((own, log_jacobian)) => {
                    here.y.extend(own);
                    here.log_jacobian += log_jacobian;
                }
                None => here.discrete.push(trace.stored(*t)?),
            }
        }
        Some(here)
    }

    /// The changes that lead to another point of the same choices.
    fn changes(&self, discrete: &[Datum], mut y: &[f64]) -> Vec<(Target, Change)> {
        let mut discrete = discrete.iter();
        let mut changes = Vec::with_capacity(self.targets.len());
        for (t, (_, n)) in self.targets.iter().zip(&self.signature) {
            if *n == 0 {
                changes.extend(discrete.next().map(|x| (*t, Change::Set(x.clone()))));
            } else if let Some((own, rest)) = y.split_at_checked(*n) {
                changes.push((*t, Change::Free(own.to_vec())));
                y = rest;
            }
        }
        changes
    }
}

impl Found {
    /// The log density of proposing a point.
    fn log_density(&self, discrete: &[Datum], y: &[f64]) -> f64 {
        let near = self.modes.iter().filter(|m| m.discrete == discrete);
        let logs: Vec<f64> = near.map(|m| m.log_share + m.about.log_density(y)).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if most == f64::NEG_INFINITY {
            return most;
        }
        most + libm::log(logs.iter().map(|l| libm::exp(l - most)).sum())
    }

    fn draw(&self, rng: &mut Stream) -> Option<&Mode> {
        let mut left = rng.uniform();
        let one = self.modes.iter().find(|m| {
            left -= libm::exp(m.log_share);
            left < 0.0
        });
        one.or(self.modes.last())
    }

    /// Builds the mixture from modes with the logs of their evidence.
    fn new(signature: Vec<(u64, usize)>, mut modes: Vec<Mode>) -> Found {
        let most = modes.iter().map(|m| m.log_share).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = modes.iter().map(|m| libm::exp(m.log_share - most)).sum();
        let alike = ALIKE / modes.len().max(1) as f64;
        for m in &mut modes {
            m.log_share = libm::log((1.0 - ALIKE) * libm::exp(m.log_share - most) / sum + alike);
        }
        Found { signature, modes }
    }
}

type State = Vec<(u64, Constraint)>;

/// A climb in progress.
struct Climb {
    state: State,
    /// The values and coordinates of the choices.
    discrete: Vec<Datum>,
    y: Vec<f64>,
    /// The log density in the unconstrained space.
    height: f64,
    past: Past,
}

impl Climb {
    fn new(state: State, height: f64) -> Climb {
        Climb { state, discrete: Vec::new(), y: Vec::new(), height, past: Past::new() }
    }

    /// True if it ended at the same mode as a higher climb. Modes that are mirror images
    /// have equal heights but other coordinates.
    fn is_that_of(&self, higher: &Climb) -> bool {
        higher.height - self.height < SAME.0
            && self.discrete == higher.discrete
            && self.y.len() == higher.y.len()
            && self.y.iter().zip(&higher.y).all(|(a, b)| (a - b).abs() < SAME.1)
    }
}

impl Modes {
    /// For these choices: of `tries` draws from the prior, the best `keep` climb, by at
    /// most `steps` steps.
    pub fn new(scope: SiteSelection, tries: u32, keep: u32, steps: u32) -> Self {
        Modes {
            scope: Registered::new(scope),
            tries,
            keep,
            steps,
            first: None,
            coarse: Selector::Nothing,
            found: None,
        }
    }

    /// Adds choices that climb alone in each draw, for some steps, before draws are
    /// compared.
    #[must_use]
    pub fn climbing_first(self, first: Option<SiteSelection>) -> Self {
        Modes { first: first.map(Registered::new), ..self }
    }

    /// Adds observations that are replaced by their coarse surrogates during the search.
    #[must_use]
    pub fn by_surrogates_of(self, coarse: Selector) -> Self {
        Modes { coarse, ..self }
    }

    /// The draws of the choices with the highest likelihood; in warm-up the present state
    /// is among them.
    fn starts(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Vec<Climb>> {
        let mut best = Vec::new();
        if at.adapting {
            best.push((trace.constraints(), trace.log_likelihood()));
        }
        for i in 0..self.tries {
            if trace.stop().has_used(SEARCH) && !best.is_empty() {
                break;
            }
            let at = at.within(u64::from(i));
            let (targets, _) = self.scope.members(trace, &mut at.stream());
            if recoverable(trace.regenerate(&targets, at.draws(0)))?.is_none() {
                continue;
            }
            trace.commit();
            if let Some(first) = &mut self.first {
                let (targets, _) = first.members(trace, &mut at.stream());
                let (past, scales) = (&mut Past::new(), &mut Scales::default());
                climb(trace, &at, &targets, FIRST, (past, scales))?;
            }
            let likely = trace.log_likelihood();
            let place = best.partition_point(|(_, l)| *l >= likely);
            if likely > f64::NEG_INFINITY && place < self.keep as usize {
                best.insert(place, (trace.constraints(), likely));
                best.truncate(self.keep as usize);
            }
        }
        Ok(best.into_iter().map(|(state, likely)| Climb::new(state, likely)).collect())
    }

    /// The ends of climbs, the highest first. Half of them continue after an eighth of the
    /// steps, and half of those after each doubling of the steps (successive halving: Jamieson &
    /// Talwalkar 2016).
    fn tops(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        scales: &mut Scales,
    ) -> TraceResult<Vec<Climb>> {
        let mut climbs = self.starts(trace, at)?;
        let mut gone = 0;
        for (round, share) in [8, 4, 2, 1].into_iter().enumerate() {
            let steps = self.steps / share - gone;
            gone += steps;
            let mut climbed = 0;
            for c in &mut climbs {
                if trace.stop().has_used(SEARCH) && (round > 0 || climbed > 0) {
                    break;
                }
                climbed += 1;
                trace.restore(&c.state, at.draws(0))?;
                let (targets, _) = self.scope.members(trace, &mut at.stream());
                climb(trace, at, &targets, steps, (&mut c.past, scales))?;
                let mut log_jacobian = 0.0;
                if let Some(here) = Here::of(trace, &targets) {
                    (c.discrete, c.y, log_jacobian) = (here.discrete, here.y, here.log_jacobian);
                }
                (c.state, c.height) = (trace.constraints(), trace.log_joint() + log_jacobian);
            }
            if round == 0 {
                // Climbs that were not begun are dropped: their initial heights are not
                // comparable.
                climbs.truncate(climbed);
            }
            climbs.sort_by(|a, b| b.height.total_cmp(&a.height));
            climbs.dedup_by(|b, a| b.is_that_of(a));
            climbs.truncate((self.keep as usize).div_ceil(2 << round).max(MOST));
        }
        Ok(climbs)
    }

    /// Searches for modes, and in warm-up leaves the trace in one of them.
    fn begin(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<()> {
        let coarse = if self.coarse == Selector::Nothing {
            None
        } else {
            trace.under_surrogates(&self.coarse)?
        };
        let mut scales = Scales::default();
        let Some(mut surrogate) = coarse else { return self.search(trace, at, &mut scales) };
        surrogate.observe_as(trace)?;
        self.search(&mut surrogate, at, &mut scales)?;
        trace.propose_choices_of(&surrogate)?;
        trace.commit();
        if at.adapting {
            // The mode is that of the surrogates; that of the observations is near it.
            let (targets, _) = self.scope.members(trace, &mut at.stream());
            let at = StepContext { power: 1.0, ..*at };
            climb(trace, &at, &targets, LAST, (&mut Past::new(), &mut scales))?;
        }
        Ok(())
    }

    /// Searches for modes of a trace, and in warm-up leaves it in one of them.
    fn search(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
        scales: &mut Scales,
    ) -> TraceResult<()> {
        let at = &StepContext { power: 1.0, ..*at };
        let begun = trace.constraints();
        let tops = self.tops(trace, at, scales)?;
        let highest = tops.first().map_or(0.0, |t| t.height);
        let mut signature = None;
        let mut modes: Vec<Mode> = Vec::new();
        for Climb { state, height, .. } in
            tops.into_iter().filter(|t| t.height > highest - BEHIND).take(MOST)
        {
            trace.restore(&state, at.draws(0))?;
            let (targets, _) = self.scope.members(trace, &mut at.stream());
            let Some(here) = Here::of(trace, &targets) else { continue };
            let known = |m: &Mode| {
                m.discrete == here.discrete
                    && m.about.distance(&here.y) < 0.25 * here.y.len() as f64
            };
            if *signature.get_or_insert_with(|| here.signature.clone()) != here.signature
                || modes.iter().any(known)
            {
                continue;
            }
            if trace.stop().has_used(SEARCH) && !modes.is_empty() {
                break;
            }
            let Some(about) = curved(trace, at, &targets, here.y)? else { continue };
            modes.push(Mode {
                discrete: here.discrete,
                log_share: height + about.log_volume(),
                about,
            });
        }
        let found = Found::new(signature.unwrap_or_default(), modes);
        trace.restore(&begun, at.draws(0))?;
        let (targets, _) = self.scope.members(trace, &mut at.stream());
        if at.adapting
            && let (Some(here), Some(mode)) =
                (Here::of(trace, &targets), found.draw(&mut at.stream()))
            && here.signature == found.signature
            && recoverable(
                trace.propose(&here.changes(&mode.discrete, &mode.about.mean), at.draws(1)),
            )?
            .is_some()
        {
            trace.commit();
        }
        self.found = Some(found);
        Ok(())
    }
}

/// Moves the continuous choices among `targets` uphill by `steps` steps; without a
/// gradient they stay.
fn climb(
    trace: &mut Trace,
    at: &StepContext,
    targets: &[Target],
    steps: u32,
    (past, scales): (&mut Past, &mut Scales),
) -> TraceResult<()> {
    let mut memory = Memory::default();
    if let Some((mut system, here)) = System::begin(trace, at, targets, None, &mut memory)? {
        let top = ascend(&mut system, &here, steps, past, scales)?;
        system.finish_at(Some(&top))?;
    }
    Ok(())
}

/// The Laplace approximation at the present state of the trace.
fn curved(
    trace: &mut Trace,
    at: &StepContext,
    targets: &[Target],
    y: Vec<f64>,
) -> TraceResult<Option<Laplace>> {
    let mut memory = Memory::default();
    let Some((mut system, here)) = System::begin(trace, at, targets, None, &mut memory)? else {
        return Ok(Laplace::new(y, &[]));
    };
    let mut curvature = Vec::with_capacity(y.len() * y.len());
    for i in 0..y.len() {
        let moved = y.iter().enumerate().map(|(j, y)| if i == j { y + STEP } else { *y });
        match system.go(moved)? {
            Some(there) => curvature
                .extend(here.gradient.iter().zip(&there.gradient).map(|(a, b)| (a - b) / STEP)),
            None => curvature.extend((0..y.len()).map(|j| f64::from(u8::from(i == j)))),
        }
    }
    system.finish_at(None)?;
    Ok(Laplace::new(y, &curvature))
}

impl Kernel for Modes {
    fn name(&self) -> String {
        "modes".into()
    }

    fn save(&self, _trace: &Trace) -> Vec<u8> {
        pack(&self.found)
    }

    fn load(&mut self, state: &[u8]) -> Result<(), StateError> {
        let found: Option<Found> = unpack(state)?;
        let sound = |f: &Found| {
            let n: usize = f.signature.iter().map(|(_, n)| n).sum();
            f.modes
                .iter()
                .all(|m| m.about.is_sound() && m.about.mean.len() == n && !m.log_share.is_nan())
        };
        if !found.as_ref().is_none_or(sound) {
            return Err(StateError::new("the modes of the checkpoint are damaged"));
        }
        self.found = found;
        Ok(())
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        trace.rollback();
        if self.found.is_none() {
            self.begin(trace, at)?;
            return Ok(Outcome::default());
        }
        let mut rng = at.stream();
        let (targets, _) = self.scope.members(trace, &mut rng);
        let (Some(found), Some(here)) = (&self.found, Here::of(trace, &targets)) else {
            return Ok(Outcome::default());
        };
        let Some(mode) = found.draw(&mut rng).filter(|_| here.signature == found.signature) else {
            return Ok(Outcome::default());
        };
        let y = mode.about.sample(&mut rng);
        let proposed = trace.propose(&here.changes(&mode.discrete, &y), at.draws(0));
        let Some(w) = recoverable(proposed)? else { return Ok(Outcome::failed()) };
        if w.appeared + w.vanished > 0 {
            trace.rollback();
            return Ok(Outcome::one(false));
        }
        let ways =
            found.log_density(&here.discrete, &here.y) - found.log_density(&mode.discrete, &y);
        let ratio = at.tempered(&w) + w.log_jacobian - here.log_jacobian + ways;
        // If no mode leads to a state, there is no reverse move.
        Ok(decide(trace, ratio, &mut rng))
    }
}
