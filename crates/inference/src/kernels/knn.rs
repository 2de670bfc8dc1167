//! Data-driven proposals: q_data of Kulkarni et al. 2014, section 3. Independence
//! Metropolis-Hastings from a kernel density estimate over the latents of K scenes whose
//! pictures look like the observed one.
//!
//! The proposal is a mixture, drawn for all selected choices jointly: with probability a
//! tenth the prior, otherwise one of the K scenes with one of two widths. A continuous
//! choice is then normal about the scene's value in the unconstrained space; a discrete
//! one is the scene's value or, with probability a tenth, drawn from its prior. A choice
//! that the scene lacks or has in another form is drawn from its prior. The acceptance
//! ratio has the density of the whole mixture, at the proposed and at the present state,
//! so the posterior is correct whatever the scenes are.
//!
//! Structure: choices that appear are drawn from the prior and, like those that vanish,
//! are accounted for in the acceptance ratio, whatever was proposed for them. Choices
//! that persist are selected both before and after, since selection is decided when a
//! choice appears; so the mixture is over the same choices in both directions. If one of
//! them changes its form (its number of coordinates, or from discrete to continuous), the
//! proposal is rejected, in either direction.
//!
//! Densities are relative to the prior's, which cancels the prior terms of
//! [`Weight::log_weight`](pcadlang_engine::trace::Weight).

use super::row::{KernelRow, SEL, Type, arg, int};
use crate::calls::call::Call;
use crate::calls::error::fail;
use crate::kernel::{
    Kernel, Outcome, Registered, SiteSelection, StepContext, accept_or_reject, recoverable,
};
use crate::neighbours::{Latent, Neighbours};
use crate::run::RunOptions;
use pcadlang_engine::lang::builtins::Domain;
use pcadlang_engine::lang::error::RunError;
use pcadlang_engine::lang::plan::{Argument, FormulaKind, KernelCall};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Target, Trace, TraceResult};
use pcadlang_numerics::dist::{Datum, Support};
use pcadlang_numerics::num::log_sum_exp;
use pcadlang_numerics::rng::Stream;
use pcadlang_syntax::span::Span;
use rustc_hash::FxHashMap;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "knn",
    &[
        SEL,
        arg("bank", Type::Str, "A file made by `pcadlang learn`."),
        int("k", USUAL, [1, MOST], "The number of neighbours."),
    ],
    "Data-driven independence proposal: a kernel density estimate over the latents of the \
     bank's pictures nearest to the observed one.",
    "\
data photo = image(\"ball.png\");
assume r ~ uniform(0.5, 1.5);
let view = scene.render(scene.sphere(r));
observe scene.chamfer(view, size = 32) = photo as picture;
infer { repeat 100 { knn(@**, bank = \"balls.bank\", k = 5); collect r; } }",
    |call| call.moving(|scope, call| Ok(Knn::new(scope, neighbours(call)?))),
)
.checked(check);

/// The default number of neighbours.
const USUAL: u32 = 10;
/// The most neighbours: more of them are no more informative than the prior.
const MOST: u32 = 10_000;

/// The weight of the prior in the mixture, so that the proposal covers the support of the
/// posterior.
const PRIOR: f64 = 0.1;
/// The probability that a discrete choice is drawn from its prior although the scene has
/// a value.
const REDRAWN: f64 = 0.1;
/// The widths of the components relative to the bandwidth: one for the region of the
/// neighbours, one close to a single neighbour.
const WIDTHS: [f64; 2] = [1.0, 0.25];
/// The smallest bandwidth, relative to the coordinate's standard deviation over scenes of
/// all kinds.
const FLOOR: f64 = 0.05;

/// `knn(sel, bank, k)`: an independence proposal from the latents of the nearest
/// neighbours.
#[derive(Clone, Debug)]
pub struct Knn {
    scope: Registered,
    neighbours: Arc<Neighbours>,
    bandwidths: FxHashMap<u64, Vec<f64>>,
}

impl Knn {
    /// A kernel for these choices and neighbours. Without neighbours it is equivalent to
    /// `block`.
    pub fn new(scope: SiteSelection, neighbours: Arc<Neighbours>) -> Self {
        let bandwidths = bandwidths(&neighbours);
        Knn { scope: Registered::new(scope), neighbours, bandwidths }
    }

    /// The components other than the prior: each scene with each width.
    fn components(&self) -> impl Iterator<Item = Component<'_>> {
        let count = self.neighbours.entries.len();
        (0..count * WIDTHS.len()).map(|i| self.component(i))
    }

    fn component(&self, i: usize) -> Component<'_> {
        Component { kernel: self, scene: i / WIDTHS.len(), width: WIDTHS[i % WIDTHS.len()] }
    }

    /// The log density of the mixture at these values, minus that of the prior.
    fn log_density(&self, places: &[Place]) -> f64 {
        let prior = if places.iter().any(|p| p.improper) { f64::NEG_INFINITY } else { 0.0 };
        let count = self.neighbours.entries.len() * WIDTHS.len();
        if count == 0 {
            return prior;
        }
        let share = libm::log((1.0 - PRIOR) / count as f64);
        let scenes =
            self.components().map(|c| share + places.iter().map(|p| c.log_density(p)).sum::<f64>());
        let terms: Vec<f64> = std::iter::once(libm::log(PRIOR) + prior).chain(scenes).collect();
        log_sum_exp(&terms)
    }

    /// Draws the change of each choice from a random component.
    fn draw(&self, places: &[Place], rng: &mut Stream) -> Vec<Change> {
        let count = self.neighbours.entries.len() * WIDTHS.len();
        if count == 0 || rng.uniform() < PRIOR {
            return vec![Change::Resample; places.len()];
        }
        let c = self.component(rng.index(count));
        places.iter().map(|p| c.draw(p, rng)).collect()
    }
}

/// Looks up the neighbours that a call will need, so that an unusable bank is an error
/// before the chain begins. A bank whose name is computed is looked up when the kernel is
/// made.
fn check(call: &KernelCall, options: &RunOptions) -> Result<(), Box<RunError>> {
    let Some(Argument::Value(bank)) = call.args.get(1) else { return Ok(()) };
    let k = match call.args.get(2) {
        Some(Argument::Value(f)) => match &f.kind {
            FormulaKind::Const(Value::Num(x)) if Domain::Whole([1, MOST]).holds(*x) => *x as u32,
            _ => return Ok(()),
        },
        _ => USUAL,
    };
    match &bank.kind {
        FormulaKind::Const(Value::Str(name)) => find(options, call.span, name, k).map(|_| ()),
        _ => Ok(()),
    }
}

fn find(
    options: &RunOptions,
    span: Span,
    bank: &str,
    k: u32,
) -> Result<Arc<Neighbours>, Box<RunError>> {
    match &options.banks {
        Some(banks) => banks.neighbours(bank, k as usize).map_err(|message| fail(span, message)),
        None => Err(fail(span, format!("knn: the bank {bank:?} is not known to this run"))),
    }
}

/// Looks up the neighbours for a call.
///
/// # Errors
/// If its arguments are wrong, or the bank cannot be used.
fn neighbours(call: &mut Call) -> Result<Arc<Neighbours>, Box<RunError>> {
    let bank = match call.value("bank")? {
        (Value::Str(bank), _) => bank,
        (v, span) => return Err(fail(span, format!("knn: `bank` must be a string, got {v}"))),
    };
    let k = call.whole("k")?;
    find(call.setting.options, call.span(), &bank, k)
}

/// The bandwidth of each coordinate: Silverman's rule (1986, equation 3.28) over the
/// neighbours, and at least a fraction of its standard deviation over scenes of all
/// kinds.
fn bandwidths(n: &Neighbours) -> FxHashMap<u64, Vec<f64>> {
    let rule = 1.06 * libm::pow(n.entries.len().max(1) as f64, -0.2);
    let local = n.local();
    let widths = |h: u64, sds: Vec<f64>| -> Vec<f64> {
        let width = |(i, sd): (usize, f64)| (rule * sd).max(FLOOR * n.spread(h, i));
        sds.into_iter().enumerate().map(width).collect()
    };
    local.into_iter().map(|(h, sds)| (h, widths(h, sds))).collect()
}

/// The properties of a choice in a state that the mixture depends on.
struct Place {
    hash: u64,
    form: Form,
    /// The log density of its prior.
    score: f64,
    improper: bool,
}

enum Form {
    Discrete {
        value: Datum,
        support: Support,
    },
    /// Coordinates, the log Jacobian of the transform there, and which coordinates are
    /// angles.
    Free {
        y: Vec<f64>,
        jacobian: f64,
        angles: Vec<bool>,
    },
    /// Partly discrete: always drawn from the prior.
    Mixed,
}

impl Place {
    fn of(trace: &Trace, t: Target) -> Option<Place> {
        let dist = trace.dist(t)?;
        let support = dist.stored_support();
        let mut angles = Vec::new();
        let form = match trace.free(t) {
            None => Form::Discrete { value: trace.stored(t)?, support },
            Some((y, jacobian))
                if is_continuous(&support, &mut angles) && angles.len() == y.len() =>
            {
                Form::Free { y, jacobian, angles }
            }
            Some(_) => Form::Mixed,
        };
        Some(Place {
            hash: trace.address_hash(t),
            form,
            score: trace.score_of(t),
            improper: dist.is_improper(),
        })
    }

    /// True if the mixture is defined in the same way for this choice in another state.
    fn is_alike(&self, other: &Place) -> bool {
        match (&self.form, &other.form) {
            (Form::Discrete { .. }, Form::Discrete { .. }) | (Form::Mixed, Form::Mixed) => true,
            (Form::Free { angles: a, .. }, Form::Free { angles: b, .. }) => a == b,
            _ => false,
        }
    }
}

/// True if every part of a support is continuous; records which of its coordinates are
/// angles.
fn is_continuous(support: &Support, angles: &mut Vec<bool>) -> bool {
    match support {
        Support::Circle => angles.push(true),
        Support::Product(one, n) => {
            let mut each = Vec::new();
            if !is_continuous(one, &mut each) {
                return false;
            }
            (0..*n).for_each(|_| angles.extend_from_slice(&each));
        }
        Support::Each(all) => return all.iter().all(|s| is_continuous(s, angles)),
        other if other.is_discrete() => return false,
        other => angles.resize(angles.len() + other.free_dim(), false),
    }
    true
}

/// A component of the mixture: a scene and a width.
struct Component<'a> {
    kernel: &'a Knn,
    scene: usize,
    width: f64,
}

impl Component<'_> {
    /// The scene's value of a choice, if it has one in the choice's form.
    fn latent(&self, place: &Place) -> Option<&Latent> {
        let latent = self.kernel.neighbours.entries.get(self.scene)?.get(&place.hash)?;
        let fits = match (latent, &place.form) {
            (Latent::Discrete(x), Form::Discrete { support, .. }) => support.fits(x),
            (Latent::Free(m), Form::Free { y, .. }) => {
                m.len() == y.len()
                    && self.kernel.bandwidths.get(&place.hash).is_some_and(|b| b.len() == y.len())
            }
            _ => false,
        };
        fits.then_some(latent)
    }

    fn bandwidths(&self, place: &Place) -> impl Iterator<Item = f64> {
        let rule = self.kernel.bandwidths.get(&place.hash).map_or(&[][..], |b| &b[..]);
        rule.iter().map(|b| b * self.width)
    }

    fn draw(&self, place: &Place, rng: &mut Stream) -> Change {
        match self.latent(place) {
            Some(Latent::Discrete(x)) if rng.uniform() >= REDRAWN => Change::Set(x.clone()),
            Some(Latent::Free(m)) => Change::Free(
                m.iter()
                    .zip(self.bandwidths(place))
                    .map(|(m, b)| m + b * rng.standard_normal())
                    .collect(),
            ),
            _ => Change::Resample,
        }
    }

    /// The log density of [`Component::draw`] at the choice's value, minus that of the
    /// prior.
    fn log_density(&self, place: &Place) -> f64 {
        match (self.latent(place), &place.form) {
            (Some(Latent::Discrete(x)), Form::Discrete { value, .. }) => {
                let copied = if x == value {
                    libm::log(1.0 - REDRAWN) - place.score
                } else {
                    f64::NEG_INFINITY
                };
                let redrawn = if place.improper { f64::NEG_INFINITY } else { libm::log(REDRAWN) };
                log_sum_exp(&[copied, redrawn])
            }
            (Some(Latent::Free(m)), Form::Free { y, jacobian, angles }) => {
                let at = y.iter().zip(m).zip(self.bandwidths(place)).zip(angles);
                let normal = |(((y, m), b), angle): (((&f64, &f64), f64), &bool)| {
                    if *angle { log_wrapped(y - m, b) } else { log_normal(y - m, b) }
                };
                at.map(normal).sum::<f64>() - jacobian - place.score
            }
            _ if place.improper => f64::NEG_INFINITY,
            _ => 0.0,
        }
    }
}

fn log_normal(x: f64, sd: f64) -> f64 {
    let z = x / sd;
    -0.5 * z * z - libm::log(sd) - 0.5 * libm::log(TAU)
}

/// The log density of a normal distribution wrapped around the circle.
fn log_wrapped(x: f64, sd: f64) -> f64 {
    if sd > 9.0 {
        // Uniform to the last bit: the amplitude of the first harmonic is exp(-sd^2 / 2).
        return -libm::log(TAU);
    }
    let nearest = x - TAU * libm::round(x / TAU);
    // Terms beyond nine standard deviations are negligible.
    let turns = libm::ceil((9.0 * sd + PI) / TAU) as i32;
    let terms: Vec<f64> =
        (-turns..=turns).map(|k| log_normal(nearest + TAU * f64::from(k), sd)).collect();
    log_sum_exp(&terms)
}

impl Kernel for Knn {
    fn name(&self) -> String {
        "knn".into()
    }

    fn scope(&mut self) -> Option<&mut Registered> {
        Some(&mut self.scope)
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let mut rng = at.stream();
        let (targets, ways) = self.scope.members(trace, &mut rng);
        let here: Vec<Place> = targets.iter().filter_map(|t| Place::of(trace, *t)).collect();
        if targets.is_empty() || here.len() != targets.len() {
            return Ok(Outcome::default());
        }
        let changes: Vec<(Target, Change)> =
            targets.iter().copied().zip(self.draw(&here, &mut rng)).collect();
        let Some(w) = recoverable(trace.propose(&changes, at.draws(0)))? else {
            return Ok(Outcome::failed());
        };
        let mut ratio = at.tempered(&w) + ways - self.scope.reverse_selection(trace);
        let (mut before, mut after) =
            (Vec::with_capacity(here.len()), Vec::with_capacity(here.len()));
        for ((t, change), old) in changes.iter().zip(here) {
            if trace.was_removed(*t) {
                continue;
            }
            let Some(new) = Place::of(trace, *t).filter(|new| new.is_alike(&old)) else {
                trace.rollback();
                return Ok(Outcome::one(false));
            };
            if *change != Change::Resample {
                ratio -= new.score - old.score;
            }
            before.push(old);
            after.push(new);
        }
        ratio += self.log_density(&before) - self.log_density(&after);
        // A state of zero density is rejected, also if infinite terms of both signs made
        // the ratio NaN.
        if w.log_joint == f64::NEG_INFINITY {
            ratio = f64::NEG_INFINITY;
        }
        accept_or_reject(trace, at, ratio, &mut rng)
    }
}

#[cfg(test)]
#[path = "knn_tests.rs"]
mod tests;
