//! Kernels declared by programs: Metropolis-Hastings with custom proposals.
//!
//! The body is executed on the present state and draws from each `propose @x ~ d` in
//! turn; then all choices change at once. The density of the reverse move is computed by
//! replay: the body is executed on the new state, with the old values as the ones to be
//! drawn, and with the same auxiliary variables (`propose u ~ d`), so that each value of
//! these defines a proposal. A choice that is stored as white noise is proposed by its
//! value, from which the noise follows. Bodies with maps are handled in `involution.rs`.
//! Every expression reads the state in which the execution began, never a value proposed
//! in it.

use crate::calls::error::fail;
use crate::calls::formula::{Moved, PlanEnv, address, evaluate};
use crate::kernel::{Kernel, Outcome, StepContext, accept_or_reject, accepts, recoverable};
use pcadlang_engine::lang::plan::{
    DeclaredKernel, Formula, FormulaKind, Given, Path, PathKey, PathSegment, Step, StepKind,
};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{
    Address, Change, Constraint, Draws, Limits, Target, Trace, TraceResult,
};
use pcadlang_numerics::dist::{Datum, Dist};
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};
use pcadlang_syntax::ast::Name;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// A kernel declared by the program, with its arguments.
#[derive(Clone, Debug)]
pub(crate) struct ProgramKernel {
    kernels: Arc<[DeclaredKernel]>,
    /// Its index in `kernels`.
    index: usize,
    arguments: Vec<Value>,
    started: Instant,
    /// A trace that evaluates expressions of maps and reverse moves.
    aside: Option<Trace>,
}

/// A choice that an execution proposes.
pub(super) struct Proposed {
    address: Address,
    pub target: Target,
    dist: Dist,
}

/// An auxiliary variable of an execution.
pub(super) struct Drawn {
    name: Arc<str>,
    pub dist: Dist,
    pub value: Value,
}

/// The target of a map's assignment.
#[derive(Clone, PartialEq)]
pub(super) enum Image {
    Choice(Address, Target),
    /// The auxiliary variable with this index in [`Played::drawn`].
    Auxiliary(usize),
}

/// The result of an execution of the body.
#[derive(Default)]
pub(super) struct Played {
    pub all: Vec<Proposed>,
    pub drawn: Vec<Drawn>,
    pub images: Vec<(Image, Value)>,
}

impl Played {
    /// The log density of drawing these values of the auxiliary variables.
    pub(super) fn log_density_of(&self, values: &[Value]) -> f64 {
        let one = |(d, v): (&Drawn, &Value)| match v.to_datum() {
            Some(x) if d.dist.support().fits(&x) => d.dist.log_density(&x),
            _ => f64::NEG_INFINITY,
        };
        self.drawn.iter().zip(values).map(one).sum()
    }
}

/// Where the values of auxiliary variables come from.
pub(super) enum AuxiliaryValues<'a> {
    Drawn(&'a mut Stream),
    Given(&'a [Value]),
    /// Given, when only the map is evaluated and proposals beside it are skipped.
    Moved(&'a [Value]),
}

impl ProgramKernel {
    /// A declared kernel, by its index, with the values of its parameters, in a chain
    /// that began at `started`.
    pub fn new(
        kernels: Arc<[DeclaredKernel]>,
        index: usize,
        arguments: Vec<Value>,
        started: Instant,
    ) -> Self {
        ProgramKernel { kernels, index, arguments, started, aside: None }
    }

    /// Its declaration.
    pub(super) fn declared(&self) -> &DeclaredKernel {
        &self.kernels[self.index]
    }

    /// Executes the body in a state. For a map, `moved` has values of choices that
    /// replace those in the state, and the trace that evaluates expressions.
    pub(super) fn play(
        &self,
        trace: &mut Trace,
        at: &StepContext,
        source: AuxiliaryValues,
        moved: Option<Moved>,
    ) -> TraceResult<Played> {
        let key = StreamKey::new(at.seed, at.chain, Purpose::PREDICT);
        let draws = Draws { key, step: at.step, substream: at.part };
        let (steps, variables, played) = (at.step, self.arguments.clone(), Played::default());
        let mut play = Play { own: self, trace, variables, draws, steps, source, moved, played };
        play.body(&self.declared().steps)?;
        Ok(play.played)
    }

    /// Executes the body in the pending state, if it depends on no part of that state but
    /// the proposed choices: the state then need not be committed and reverted.
    fn reverse(
        &self,
        (trace, aside): (&mut Trace, &mut Trace),
        at: &StepContext,
        all: &[Proposed],
        new: &[Option<Datum>],
        auxiliaries: &[Value],
    ) -> Option<Played> {
        let moved = all
            .iter()
            .zip(new)
            .map(|(p, x)| Some((p.address.clone(), Value::from_datum(x.as_ref()?))));
        let moved: Vec<(Address, Value)> = moved.collect::<Option<_>>()?;
        let moved = Moved { choices: &moved, aside };
        self.play(trace, at, AuxiliaryValues::Given(auxiliaries), Some(moved)).ok()
    }

    /// True if what the body proposes depends on its arguments alone, not on the state.
    pub fn ignores_the_state(&self) -> bool {
        fn given(g: &Given) -> bool {
            matches!(g, Given::Variable(_))
        }
        fn formula(f: &Formula) -> bool {
            match &f.kind {
                FormulaKind::Const(_) => true,
                FormulaKind::Given(g) => given(g),
                FormulaKind::Function { given: all, is_settled, .. } => {
                    *is_settled && all.iter().all(given)
                }
            }
        }
        fn path(p: &Path) -> bool {
            p.segments.iter().all(|s| match s {
                PathSegment::Deep => true,
                PathSegment::Named(_, _, keys) => keys.iter().all(|k| match k {
                    PathKey::Computed(f) => formula(f),
                    PathKey::Any | PathKey::Fixed(_) => true,
                }),
            })
        }
        fn step(s: &Step) -> bool {
            match &s.kind {
                StepKind::Let(_, f) | StepKind::Draw(_, _, f) => formula(f),
                StepKind::Propose(p, f) => path(p) && formula(f),
                StepKind::For(items, _, body) => formula(items) && body.iter().all(step),
                _ => false,
            }
        }
        self.declared().steps.iter().all(step)
    }

    /// Returns values that the body proposes, for choices that a trace has.
    ///
    /// # Errors
    /// As [`Kernel::step`].
    pub fn proposal(
        &self,
        trace: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<Vec<(u64, Constraint)>> {
        let mut rng = at.stream();
        let forth = self.play(trace, at, AuxiliaryValues::Drawn(&mut rng), None)?;
        let value = |p: &Proposed| {
            (trace.address_hash(p.target), Constraint::Value(p.dist.sample(&mut rng)))
        };
        Ok(forth.all.iter().map(value).collect())
    }

    /// Moves the trace to a proposal of the body without an acceptance test, for initial
    /// states. `None` if the program is undefined there.
    ///
    /// # Errors
    /// As [`Kernel::step`], and if the body has a map, which only maps one state to
    /// another.
    pub fn leap(&self, trace: &mut Trace, at: &StepContext) -> TraceResult<Option<()>> {
        if self.declared().maps {
            let message =
                "the kernel of a start must propose choices from distributions, not by a map";
            return Err(fail(self.declared().name.span, message.into()));
        }
        let mut rng = at.stream();
        let forth = self.play(trace, at, AuxiliaryValues::Drawn(&mut rng), None)?;
        let (_, changes) = sampled(&forth.all, &mut rng);
        let led = recoverable(trace.propose(&changes, at.draws(0)))?;
        if led.is_some() {
            trace.commit();
        }
        Ok(led.map(|_| ()))
    }
}

struct Play<'a> {
    own: &'a ProgramKernel,
    trace: &'a mut Trace,
    variables: Vec<Value>,
    draws: Draws,
    steps: u64,
    source: AuxiliaryValues<'a>,
    moved: Option<Moved<'a>>,
    played: Played,
}

impl Play<'_> {
    /// The environment of expressions.
    fn env(&mut self) -> PlanEnv<'_> {
        let (draws, started, steps) = (self.draws, self.own.started, self.steps);
        let moved = self.moved.as_mut();
        let moved = moved.map(|m| Moved { choices: m.choices, aside: &mut *m.aside });
        PlanEnv { trace: self.trace, variables: &self.variables, draws, started, steps, moved }
    }

    fn body(&mut self, body: &[Step]) -> TraceResult<()> {
        let depth = self.variables.len();
        for s in body {
            match &s.kind {
                StepKind::Let(_, value) => {
                    let v = evaluate(value, &mut self.env())?;
                    self.variables.push(v);
                }
                StepKind::For(items, _, body) => {
                    let over = evaluate(items, &mut self.env())?;
                    for item in over.passes() {
                        self.variables.push(item);
                        let done = self.body(body);
                        self.variables.pop();
                        done?;
                    }
                }
                StepKind::Map(target, value) => {
                    let image = self.image(target)?;
                    self.map(image, value, s.span)?;
                }
                StepKind::MapDrawn(name, value) => {
                    let image = self.auxiliary_image(name)?;
                    self.map(image, value, s.span)?;
                }
                StepKind::Draw(name, _, dist) => {
                    let value = self.auxiliary(&name.node, dist)?;
                    self.variables.push(value);
                }
                StepKind::Propose(..) if matches!(self.source, AuxiliaryValues::Moved(_)) => {}
                StepKind::Propose(target, dist) => {
                    let proposed = self.proposed(target, dist)?;
                    let mapped = |i: &(Image, Value)| matches!(i.0, Image::Choice(_, t) if t == proposed.target);
                    let twice = self.played.all.iter().any(|p| p.target == proposed.target);
                    if twice || self.played.images.iter().any(mapped) {
                        return Err(fail(
                            s.span,
                            "this choice is proposed twice in one kernel".into(),
                        ));
                    }
                    self.played.all.push(proposed);
                }
                _ => {
                    let message =
                        "a kernel with `propose` may contain only `let`, `for` and `propose`";
                    let mut e = fail(s.span, message.into());
                    e.hint = Some(
                        "kernels that apply other kernels are written without `propose`".into(),
                    );
                    return Err(e);
                }
            }
        }
        self.variables.truncate(depth);
        Ok(())
    }

    /// Assigns a new value by a map.
    fn map(&mut self, image: Image, value: &Formula, span: Span) -> TraceResult<()> {
        let proposed = |p: &Proposed| matches!(image, Image::Choice(_, t) if t == p.target);
        if self.played.images.iter().any(|(i, _)| *i == image)
            || self.played.all.iter().any(proposed)
        {
            return Err(fail(span, "this gets a new value twice in one kernel".into()));
        }
        let value = evaluate(value, &mut self.env())?;
        self.played.images.push((image, value));
        Ok(())
    }

    /// Draws an auxiliary variable, or uses the given value.
    fn auxiliary(&mut self, name: &Arc<str>, dist: &Formula) -> TraceResult<Value> {
        let dist = self.distribution(dist)?;
        let value = match &mut self.source {
            AuxiliaryValues::Drawn(rng) => Value::from_datum(&dist.sample(rng)),
            AuxiliaryValues::Given(values) | AuxiliaryValues::Moved(values) => {
                values.get(self.played.drawn.len()).cloned().unwrap_or_default()
            }
        };
        self.played.drawn.push(Drawn { name: Arc::clone(name), dist, value: value.clone() });
        Ok(value)
    }

    fn proposed(&mut self, target: &Path, dist: &Formula) -> TraceResult<Proposed> {
        let (address, found) = self.choice(target)?;
        if self.trace.elements(found).is_some() {
            return Err(fail(target.span, format!("{address} cannot be proposed as a whole")));
        }
        Ok(Proposed { address, target: found, dist: self.distribution(dist)? })
    }

    fn distribution(&mut self, dist: &Formula) -> TraceResult<Dist> {
        match evaluate(dist, &mut self.env())? {
            Value::Dist(d) => Ok(Dist::clone(&d)),
            v => Err(fail(
                dist.span,
                format!("`propose` needs a distribution, got {}", v.type_name()),
            )),
        }
    }

    /// Reads what a map assigns a new value to.
    fn image(&mut self, target: &Path) -> TraceResult<Image> {
        let (address, found) = self.choice(target)?;
        if self.trace.elements(found).is_some()
            || self.trace.dist(found).is_some_and(|d| d.is_stored_whitened())
        {
            return Err(fail(target.span, format!("{address} cannot be mapped as a whole")));
        }
        Ok(Image::Choice(address, found))
    }

    fn auxiliary_image(&self, name: &Name) -> TraceResult<Image> {
        let drawn = self.played.drawn.iter().rposition(|d| d.name == name.node);
        let not = || {
            let (name, span) = (&name.node, name.span);
            let message =
                format!("`{name}` is not an auxiliary variable; propose {name} ~ …; makes one");
            fail(span, message)
        };
        drawn.map(Image::Auxiliary).ok_or_else(not)
    }

    /// Finds a choice that can be proposed.
    fn choice(&mut self, target: &Path) -> TraceResult<(Address, Target)> {
        let at = address(target, &mut self.env())?;
        let Some(found) = self.trace.find(&at) else {
            let mut e = fail(target.span, format!("this state has no choice {at}"));
            e.hint = Some(
                "a kernel can propose only choices that exist in the current state; mh and block can create others"
                    .into(),
            );
            return Err(e);
        };
        Ok((at, found))
    }
}

/// The present values of choices, as the program sees them.
pub(super) fn values(trace: &Trace, all: &[Proposed]) -> Vec<Option<Datum>> {
    all.iter().map(|p| trace.value(p.target).to_datum()).collect()
}

/// Draws values for all proposed choices; returns them and the changes.
pub(super) fn sampled(
    all: &[Proposed],
    rng: &mut Stream,
) -> (Vec<Option<Datum>>, Vec<(Target, Change)>) {
    let draw = |p: &Proposed| {
        let x = p.dist.sample(rng);
        (Some(x.clone()), (p.target, Change::Value(x)))
    };
    all.iter().map(draw).unzip()
}

/// The log Jacobian of the transform from the stored white noise to the values, summed
/// over these choices.
pub(super) fn log_volume(trace: &Trace, all: &[Proposed]) -> f64 {
    let one = |p: &Proposed| {
        let dist = trace.dist(p.target).filter(Dist::is_stored_whitened)?;
        let (noise, value) = (trace.stored(p.target)?, trace.value(p.target).to_datum()?);
        Some(dist.log_density_stored(&noise) - dist.centred().log_density(&value))
    };
    all.iter().filter_map(one).sum()
}

/// The log density of drawing these values; -infinity if a value is outside of a
/// proposal's support.
pub(super) fn log_density(all: &[Proposed], values: &[Option<Datum>]) -> f64 {
    let one = |(p, x): (&Proposed, &Option<Datum>)| match x {
        Some(x) if p.dist.support().fits(x) => p.dist.log_density(x),
        _ => f64::NEG_INFINITY,
    };
    all.iter().zip(values).map(one).sum()
}

impl Kernel for ProgramKernel {
    fn name(&self) -> String {
        self.declared().name.node.to_string()
    }

    fn decides_in_stages(&mut self, _: &Trace) -> bool {
        true
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let new = || Trace::prior(Arc::clone(trace.code()), Limits::default());
        let mut aside = self.aside.take().unwrap_or_else(new);
        let done = match self.declared().maps {
            true => self.involve(trace, &mut aside, at),
            false => self.sample(trace, &mut aside, at),
        };
        self.aside = Some(aside);
        done
    }
}

impl ProgramKernel {
    /// Makes one step by proposals from distributions.
    fn sample(
        &self,
        trace: &mut Trace,
        aside: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<Outcome> {
        let mut rng: Stream = at.stream();
        let forth = self.play(trace, at, AuxiliaryValues::Drawn(&mut rng), None)?;
        if forth.all.is_empty() {
            return Ok(Outcome::default());
        }
        let (old, volume) = (values(trace, &forth.all), log_volume(trace, &forth.all));
        let undo: Vec<_> = forth
            .all
            .iter()
            .filter_map(|p| Some((p.target, Change::Set(trace.stored(p.target)?))))
            .collect();
        let (new, changes) = sampled(&forth.all, &mut rng);
        let Some(w) = recoverable(trace.propose(&changes, at.draws(0)))? else {
            return Ok(Outcome::failed());
        };
        if forth.all.iter().any(|p| trace.was_removed(p.target))
            || w.log_weight == f64::NEG_INFINITY
        {
            trace.rollback();
            return Ok(Outcome::one(false));
        }
        let auxiliaries: Vec<Value> = forth.drawn.iter().map(|d| d.value.clone()).collect();
        let log_forth = log_density(&forth.all, &new) + forth.log_density_of(&auxiliaries);
        let ratio = |trace: &Trace, back: Option<Played>| {
            let back = back.filter(|back| {
                back.drawn.len() == forth.drawn.len()
                    && back.all.iter().map(|p| p.target).eq(forth.all.iter().map(|p| p.target))
            });
            let log_back = back.map_or(f64::NEG_INFINITY, |back| {
                log_density(&back.all, &old) + back.log_density_of(&auxiliaries)
            });
            at.tempered(&w) + log_back - log_forth + volume - log_volume(trace, &forth.all)
        };
        if w.appeared + w.vanished == 0
            && let Some(back) = self.reverse((trace, aside), at, &forth.all, &new, &auxiliaries)
        {
            return accept_or_reject(trace, at, ratio(trace, Some(back)), &mut rng);
        }
        // The replay reads the new state, which must be committed for that.
        let mut later = Vec::new();
        while let Some(change) = trace.next_stage() {
            match recoverable(change)? {
                Some(c) if c > f64::NEG_INFINITY => later.push(at.tempered_change(c)),
                Some(_) => {
                    trace.rollback();
                    return Ok(Outcome::one(false));
                }
                None => return Ok(Outcome::failed()),
            }
        }
        let removed = trace.removed();
        trace.commit();
        let back = recoverable(self.play(trace, at, AuxiliaryValues::Given(&auxiliaries), None))?;
        let first = ratio(trace, back);
        if [first].into_iter().chain(later).all(|ratio| accepts(ratio, &mut rng)) {
            return Ok(Outcome::one(true));
        }
        trace.propose_constrained(&undo, &removed, at.draws(1))?;
        while let Some(change) = trace.next_stage() {
            change?;
        }
        trace.commit();
        Ok(Outcome::one(false))
    }
}
