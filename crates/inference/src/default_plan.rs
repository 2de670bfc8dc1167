//! The plan of a program without an `infer` block. It depends on the program's choices and
//! on how its density behaves in several draws, and is printed so that it can be copied.

use super::init::{attempts, free_density, spread};
use super::kernels::approach;
use crate::StepContext;
use pcadlang_engine::lang::address::Address;
use pcadlang_engine::lang::code::Code;
use pcadlang_engine::trace::{
    Change, ChoiceKind, Draws, Limits, Selector, Tabulation, Target, Trace, TraceResult,
};
use pcadlang_numerics::elimination::{Elimination, Factor};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A gradient with choices summed out pays if it sums at most this many times as many
/// scores as a sweep of `gibbs` evaluates. On a tape a score takes a small part of the time
/// that `gibbs` takes for it, a transition needs several gradients, and a sum never mixes
/// worse than a sweep.
const SUM_PAYS: usize = 4;
/// The same for exact draws of finite choices that depend on each other, among others that
/// move: a sweep of `gibbs` may not mix at all.
const EXACT_PAYS: usize = 16;
/// The largest table of an exact draw.
const LARGEST: usize = 1 << 20;
/// The number of draws from the prior whose choices determine the plan, as another draw may
/// have choices that the first one lacks.
const DRAWS: u64 = 10;
/// The most draws from the prior until one succeeds.
const ATTEMPTS: u64 = 300;
/// The number of uniform starts that are compared with draws from the prior.
const UNIFORM: usize = 3;
/// Draws from the prior lie far below if it is by more nats than this, and by more than this
/// many per coordinate.
const FAR: (f64, f64) = (100.0, 20.0);
/// The most selections that `slice` has by name; with more it moves all continuous choices.
const NAMED: usize = 4;
/// The number of draws that are examined where that costs more.
const FEW_DRAWS: usize = 3;
/// The number of finite choices from which those of one draw are tabulated.
const MANY: usize = 1000;
/// The most choices that are examined one by one.
const FEW: usize = 50;

/// The plan for a program, as program text.
///
/// If the density has a gradient that informs, `nuts` moves all continuous choices together,
/// and `slice` those without one. If a tape can sum the finite choices out of the density at
/// a similar cost as that of a sweep of `gibbs`, `nuts` does so; otherwise `exact` draws
/// those that depend on each other, if its tables are small, and `gibbs` any others. `nuts`
/// stays within one structure: if that depends on its choices, `mh` is added.
///
/// # Errors
/// If no draw succeeds, so that the program's choices are unknown.
pub fn default_plan(code: &Arc<Code>, limits: &Limits) -> TraceResult<String> {
    let key = StreamKey::new(0, 0, Purpose::START);
    let started = |spread, step| {
        let draws = Draws { key, step, substream: 0 };
        Trace::started(Arc::clone(code), [], spread, draws, limits.clone()).map(|(t, _)| t)
    };
    let mut draws: Vec<Trace> = (0..DRAWS).filter_map(|i| started(None, i).ok()).collect();
    let uniform = |i| started(Some(spread(i)), i);
    let mut far = false;
    if draws.is_empty() {
        // Draws may fail, e.g. because a standard deviation is negative or overflows; the
        // plan is then made from the first draw that succeeds.
        let drawn = attempts(ATTEMPTS, |i| started(None, i));
        far = drawn.is_err();
        draws.push(drawn.or_else(|e| attempts(ATTEMPTS, uniform).map_err(|_| e))?);
    }
    let mut program = Program { draws };
    let (continuous, discrete) =
        (program.count(ChoiceKind::Continuous), program.count(ChoiceKind::Discrete));
    if continuous + discrete == 0 {
        return Ok("infer {\n  repeat 1000 { }\n}\n".into());
    }
    let finite = program.count(ChoiceKind::Finite);
    let rough = program.rough();
    let smooth = continuous > 0 && rough.as_ref().is_some_and(|r| r.len() < continuous);
    // Exact draws of all choices do not depend on where they begin.
    let independent = finite == continuous + discrete && program.exactly().is_some();
    let mut lines = Vec::new();
    if far || continuous > 0 && program.lies_far(uniform) {
        lines.push("  // Draws from the prior are impossible, or far from the data.".to_owned());
        lines.push("  init(unconstrained());".to_owned());
    } else if !independent {
        lines.push("  init(prior(20));".to_owned());
    }
    let mut pass = Vec::new();
    let mut left = finite > 0;
    if continuous > 0 && smooth {
        let rough = rough.unwrap_or_default();
        let minus: String = rough.iter().map(|r| format!(" - {r}")).collect();
        if finite > 0 && rough.is_empty() && program.sum_pays() {
            pass.push("nuts($continuous, marginal = $finite);".to_owned());
            left = false;
        } else {
            pass.push(format!("nuts($continuous{minus});"));
        }
        if !rough.is_empty() {
            lines.push(
                "  // The derivative of the density says nothing about what `slice` moves.".into(),
            );
            let rough: Vec<String> = rough.into_iter().collect();
            pass.push(format!("slice(each({}));", rough.join(" + ")));
        }
        if program.depends_on(ChoiceKind::Continuous) {
            pass.push("mh(each($continuous));".to_owned());
        }
    } else if continuous > 0 {
        lines.push("  // The derivative of the density says nothing, or does not exist.".into());
        pass.push("slice(each($continuous));".to_owned());
        if program.count(ChoiceKind::Gaussian) > 1 {
            pass.push("elliptical($gaussian);".to_owned());
        }
        if continuous > 1 {
            pass.push("repeat 5 { drift($continuous); }".to_owned());
        }
        if program.depends_on(ChoiceKind::Continuous) {
            pass.push("mh(each($continuous));".to_owned());
        }
    }
    if left {
        let exact = independent || program.exactly().is_some_and(|j| j.pays());
        pass.push(if exact { "exact($finite);" } else { "gibbs(each($finite));" }.to_owned());
    }
    if discrete > finite {
        pass.push("mh(each($discrete - $finite));".to_owned());
        pass.push("drift(each($discrete - $finite));".to_owned());
    }
    let pass = pass.join(" ");
    if !independent {
        lines.push(format!("  warmup 1000 {{ {pass} }}"));
    }
    lines.push(format!("  repeat 1000 {{ {pass} }}"));
    Ok(format!("infer {{\n{}\n}}\n", lines.join("\n")))
}

/// Several draws of a program.
struct Program {
    draws: Vec<Trace>,
}

/// The choices of a kind.
fn of_kind(trace: &mut Trace, kind: ChoiceKind) -> Vec<Target> {
    let selection = trace.select(&Selector::Kind(kind));
    trace.targets(selection).to_vec()
}

impl Program {
    /// The most choices of a kind that a draw has.
    fn count(&mut self, kind: ChoiceKind) -> usize {
        self.draws.iter_mut().map(|t| of_kind(t, kind).len()).max().unwrap_or(0)
    }

    /// True if which choices exist depends on those of a kind.
    fn depends_on(&self, kind: ChoiceKind) -> bool {
        self.draws.iter().any(|t| t.structure_depends_on(kind))
    }

    /// The continuous choices about which a derivative of the density is uninformative, as
    /// selections; `None` if there is no derivative at all, or too many such choices.
    fn rough(&mut self) -> Option<BTreeSet<String>> {
        // Choices without a derivative, those whose derivative did not inform in some draw, and
        // those that one did inform about.
        let (mut rough, mut flat, mut informed) =
            (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
        let (mut any, mut asked) = (false, 0);
        for trace in &mut self.draws {
            let mut targets = of_kind(trace, ChoiceKind::Continuous);
            if let Err(e) = gradient(trace, &targets, 1.0) {
                // Another draw may have one.
                if e.is_recoverable() {
                    continue;
                }
                if targets.len() > FEW {
                    return None;
                }
                let (smooth, none): (Vec<_>, Vec<_>) =
                    targets.iter().partition(|t| gradient(trace, &[**t], 1.0).is_ok());
                rough.extend(none.into_iter().map(|t: Target| pattern(&trace.address(t))));
                targets = smooth;
            }
            let (Ok(with), Ok(without)) =
                (gradient(trace, &targets, 1.0), gradient(trace, &targets, 0.0))
            else {
                continue;
            };
            any |= !targets.is_empty();
            let mut begin = 0;
            for t in targets {
                let size = trace.free_to_move(t).map_or(0, |(y, _)| y.len());
                let own = begin..begin + size;
                begin += size;
                let name = pattern(&trace.address(t));
                if with.get(own.clone()) != without.get(own) {
                    informed.insert(name);
                } else if asked < FEW && !flat.contains(&name) {
                    asked += 1;
                    if responds(trace, t) {
                        flat.insert(name);
                    }
                }
            }
        }
        rough.extend(flat.difference(&informed).cloned());
        for trace in self.draws.iter_mut().take(FEW_DRAWS) {
            let stepped = trace.with_steps();
            if stepped.is_empty() {
                continue;
            }
            for t in of_kind(trace, ChoiceKind::Continuous) {
                let reach = trace.dependents(t);
                if reach.terms.iter().any(|d| stepped.contains(&d.address)) {
                    rough.insert(pattern(&trace.address(t)));
                }
            }
        }
        (any && rough.len() <= NAMED).then_some(rough)
    }

    /// True if draws from the prior are impossible, or a short ascent from the best of them
    /// ends so far below those from uniform starts in the unconstrained space that chains had
    /// better begin there.
    fn lies_far(&self, uniform: impl Fn(u64) -> TraceResult<Trace>) -> bool {
        let reached = |mut trace: Trace| {
            approach(&mut trace, &StepContext::new(0, 0, 0)).ok()?;
            Some((free_density(&trace), trace.choice_count() as f64))
        };
        let higher = |a: (f64, f64), b: (f64, f64)| if b.0 > a.0 { b } else { a };
        let none = (f64::NEG_INFINITY, 0.0);
        let by_density = |a: &&Trace, b: &&Trace| free_density(a).total_cmp(&free_density(b));
        let best = self.draws.iter().max_by(by_density).cloned();
        let prior = best.and_then(reached).map_or(none, |there| higher(none, there));
        // The first few that are possible.
        let possible = |t: &Trace| t.log_joint() > f64::NEG_INFINITY;
        let all = (0..ATTEMPTS).filter_map(|i| uniform(i).ok().filter(possible)).take(UNIFORM);
        let near = all.filter_map(reached).fold(none, higher);
        near.0 > f64::NEG_INFINITY && near.0 - prior.0 > FAR.0 + FAR.1 * near.1
    }

    /// True if all finite choices can be summed out on a tape, and that costs little compared
    /// with a sweep over them.
    fn sum_pays(&mut self) -> bool {
        let pays = |trace: &mut Trace| {
            let moving = of_kind(trace, ChoiceKind::Continuous);
            let sites = of_kind(trace, ChoiceKind::Finite);
            if moving.is_empty() || sites.is_empty() {
                return false;
            }
            let recording = trace.record_summed(&moving, &sites, Draws::default()).ok().flatten();
            recording.is_some_and(|r| {
                let (sum, sweep) = r.scores();
                sum <= SUM_PAYS * sweep
            })
        };
        self.draws.iter_mut().all(pays)
    }

    /// How the finite choices can be drawn jointly; `None` if they cannot.
    fn exactly(&mut self) -> Option<Joint> {
        let mut joint = Joint::default();
        // The states of one draw show all values, unless they depend on other choices.
        let finite = self.count(ChoiceKind::Finite);
        let others = self.count(ChoiceKind::Continuous) + self.count(ChoiceKind::Discrete) - finite;
        let draws = if others == 0 || finite > MANY { 1 } else { FEW_DRAWS };
        for trace in self.draws.iter_mut().take(draws) {
            let selection = trace.select(&Selector::Kind(ChoiceKind::Finite));
            let tables = match trace.tabulate(selection, 1.0, Draws::default()) {
                Ok(Tabulation::Tables(tables)) => tables,
                _ => return None,
            };
            let counts = tables.counts();
            let sweep = |f: &Factor| f.scope.iter().map(|x| counts[*x]).sum::<usize>();
            joint.sweep = joint.sweep.max(tables.factors.iter().map(sweep).sum());
            joint.coupled |= tables.factors.iter().any(|f| f.scope.len() > 1);
            let made = Elimination::new(&counts, tables.factors, LARGEST).ok()?;
            joint.entries = joint.entries.max(made.entries());
        }
        Some(joint)
    }
}

/// The cost of an exact draw of all finite choices.
#[derive(Default)]
struct Joint {
    /// The entries of all tables.
    entries: usize,
    /// The scores that a sweep of `gibbs` evaluates.
    sweep: usize,
    /// True if choices depend on each other.
    coupled: bool,
}

impl Joint {
    /// True if it is worth while each time that other choices have moved.
    fn pays(&self) -> bool {
        self.coupled && self.entries <= EXACT_PAYS * self.sweep
    }
}

/// The choices of an address, whatever its keys are.
fn pattern(address: &Address) -> String {
    let mut text = String::from("@");
    for (i, s) in address.segments.iter().enumerate() {
        let keys = if i + 1 < address.segments.len() { s.keys.len() } else { 0 };
        let mut name = s.clone();
        name.keys.clear();
        text += &format!("{}{name}{}", if i > 0 { "/" } else { "" }, "[*]".repeat(keys));
    }
    text
}

fn gradient(trace: &Trace, targets: &[Target], power: f64) -> TraceResult<Vec<f64>> {
    let mut g = Vec::new();
    trace.gradient(targets, power, &mut g).map(|()| g)
}

/// True if the likelihood changes with a choice.
fn responds(trace: &mut Trace, t: Target) -> bool {
    let key = StreamKey::new(0, 0, Purpose::MIX);
    (0..4).any(|substream| {
        let draws = Draws { key, step: 0, substream };
        let changed = trace.propose(&[(t, Change::Resample)], draws);
        let changed = changed.is_ok_and(|w| w.log_likelihood != 0.0 && !w.log_likelihood.is_nan());
        trace.rollback();
        changed
    })
}
