//! Weights of other values of a choice by local densities (see
//! [`crate::lang::local_density`]), without changing the trace.
//!
//! The scores are computed by the same functions as in an update and quantised in the
//! same way, so the weights agree to the last bit. A case that a local density does not
//! cover is left to an update.

use crate::lang::builtins::Scalar;
use crate::lang::code::{Code, DistSpec, Op, Operand, Slot};
use crate::lang::index::index_value;
use crate::lang::local_density::{
    Input, Instruction, KeptAlternative, LocalDensity, PARAMETERS, REGISTERS,
};
use crate::lang::value::{Extent, Value};
use crate::trace::eval::Score;
use crate::trace::graph::Graph;
use crate::trace::node::*;
use crate::trace::propose::Weight;
use crate::trace::shortcuts::register::{Register, element, family};
use crate::trace::store::Store;
use crate::trace::{Target, Trace};
use pcadlang_numerics::dist::{Datum, Dist};
use pcadlang_numerics::num::ExactSum;
use smallvec::SmallVec;
use std::sync::Arc;

/// The local densities that together give the effect of another value of a choice.
pub(crate) type LocalDensities<'c> = SmallVec<[Placed<'c>; 4]>;

/// A local density in a frame.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'c> {
    /// The first node of the frame.
    pub base: NodeId,
    pub local_density: &'c LocalDensity,
}

/// The maximum number of other frames that may read the choice.
const READERS: usize = 4;

/// The maximum length of a value that is computed here.
const LARGEST: usize = 1024;

/// The evaluation of a local density on the nodes of one frame.
pub(crate) struct Evaluation<'a> {
    graph: &'a Store,
    code: &'a Code,
    base: NodeId,
    registers: [Register<'a>; REGISTERS],
    /// The values that are neither numbers nor part of the trace.
    made: SmallVec<[Value; 4]>,
    /// True if a selection takes its other alternative.
    turned: bool,
    prior: ExactSum,
    likelihood: ExactSum,
    /// Minus the scores that change: of the prior and the likelihood. They are the same for every
    /// value, so only the first one adds them up.
    removed: [ExactSum; 2],
    is_first: bool,
}

impl Trace {
    /// Passes to `weight` the log weights that the values of a choice with this
    /// distribution would have in an update, relative to the current state (that of the
    /// `current` value is 0), with the likelihood raised to a power. Returns false if
    /// updates are needed instead.
    pub fn weigh_values(
        &self,
        target: Target,
        dist: &Dist,
        (values, current): (&[Datum], usize),
        power: f64,
        mut weight: impl FnMut(f64),
    ) -> bool {
        if self.update.is_some() || target.element != NONE {
            return false;
        }
        let Some(local_densities) = self.graph.local_densities(&self.code, target.node) else {
            return false;
        };
        let mut evaluation = self.graph.evaluation(&self.code);
        values.iter().enumerate().all(|(i, value)| {
            let found = match i == current {
                true => Some(0.0),
                false => evaluation.weigh(target.node, &local_densities, dist, value, power),
            };
            found.map(&mut weight).is_some()
        })
    }
}

impl Graph {
    /// Returns the local densities that together give the effect of another value of a
    /// choice; `None` if there are none in this state.
    pub fn local_densities<'c>(
        &self,
        code: &'c Code,
        target: NodeId,
    ) -> Option<LocalDensities<'c>> {
        let facts = &code.slots[self.store[target].op];
        let finite = self.score.prior.is_fine() && self.score.likelihood.is_fine();
        if !self.incremental
            || !finite
            || self.execution_log.is_some()
            || !self.is_plain_choice(target)
        {
            return None;
        }
        let mut all = LocalDensities::new();
        let own = facts.local_density.as_deref()?;
        self.add_local_density(target - facts.slot, own, &mut all)?;
        let readers = &self.outside(target).users;
        if readers.len() > READERS {
            return None;
        }
        for (i, m) in readers.iter().enumerate() {
            let node = &self.store[*m];
            if node.state != State::Clean || readers[..i].contains(m) {
                continue;
            }
            // An element of a container: its value is that of the choice.
            let Op::Index { .. } = self.op(*m) else { return None };
            let Some(Side::Deps(deps)) = node.side.as_deref() else { return None };
            if deps.as_slice() != [target] {
                return None;
            }
            let facts = &code.slots[node.op];
            if self.is_read_outside(*m) {
                return None;
            }
            self.add_local_density(*m - facts.slot, facts.local_density.as_deref()?, &mut all)?;
        }
        Some(all)
    }

    /// Adds a local density, if it covers everything that depends on its value.
    fn add_local_density<'c>(
        &self,
        base: NodeId,
        local_density: &'c LocalDensity,
        all: &mut LocalDensities<'c>,
    ) -> Option<()> {
        if local_density.computations.iter().any(|slot| self.is_read_outside(base + *slot)) {
            return None;
        }
        // Two local densities in one frame could change the same score.
        if !local_density.instructions.is_empty()
            && all.iter().any(|p| p.base == base && !p.local_density.instructions.is_empty())
        {
            return None;
        }
        all.push(Placed { base, local_density });
        Some(())
    }

    /// Returns an evaluation of local densities, for [`Evaluation::weigh`].
    pub fn evaluation<'a>(&'a self, code: &'a Code) -> Evaluation<'a> {
        Evaluation {
            graph: &self.store,
            code,
            base: NodeId::default(),
            registers: [Register::Num(0.0); REGISTERS],
            made: SmallVec::new(),
            turned: false,
            prior: ExactSum::default(),
            likelihood: ExactSum::default(),
            removed: Default::default(),
            is_first: true,
        }
    }
}

impl Store {
    /// True if a choice is a single number or boolean, stored as the program sees it.
    pub fn is_plain_choice(&self, n: NodeId) -> bool {
        let node = &self[n];
        let whole = match node.side.as_deref() {
            None => true,
            Some(Side::Choice(c)) => c.stored.is_none() && c.elements == NONE && c.deps.is_empty(),
            _ => false,
        };
        whole && matches!(node.value, Value::Num(_) | Value::Bool(_))
    }

    /// Returns the distribution of a choice whose parameters are single numbers or
    /// evaluated arrays.
    pub fn simple_dist(&self, n: NodeId) -> Option<Dist> {
        let Op::Draw { dist: DistSpec::Family { builtin, args }, .. } = self.op(n) else {
            return None;
        };
        let mut read = [Register::Num(0.0); PARAMETERS];
        let (read, frame) = (read.get_mut(..args.len())?, self[n].frame);
        for (to, o) in read.iter_mut().zip(args) {
            if self.unready(frame, *o).is_some() {
                return None;
            }
            *to = Register::of(self.value(frame, *o));
        }
        family(self.code.builtins.get(*builtin), read)
    }
}

impl<'a> Evaluation<'a> {
    /// Returns the log weight of a value of the choice relative to the current one, with
    /// the likelihood raised to a power; `None` if the local densities do not cover it.
    pub fn weigh(
        &mut self,
        target: NodeId,
        local_densities: &LocalDensities,
        dist: &Dist,
        value: &Datum,
        power: f64,
    ) -> Option<f64> {
        self.begin(Register::of_datum(value)?);
        if self.is_first {
            self.removed[0].sub(self.graph[target].score);
        }
        self.prior.add(dist.log_density_stored(value));
        local_densities
            .iter()
            .try_for_each(|placed| self.run(placed, local_densities.len() == 1))?;
        if std::mem::take(&mut self.is_first) {
            self.prior.merge(&self.removed[0]);
            self.likelihood.merge(&self.removed[1]);
        }
        Some(Weight::beside(&self.prior, &self.likelihood, power))
    }

    /// Starts with a value of the choice.
    fn begin(&mut self, value: Register<'a>) {
        self.registers[0] = value;
        self.made.clear();
        self.turned = false;
        if self.is_first {
            self.removed = Default::default();
        }
        [self.prior, self.likelihood] = self.removed.clone();
    }

    /// Runs a local density. With `may_choose`, selections may take their other
    /// alternative.
    fn run(&mut self, placed: &Placed, may_choose: bool) -> Option<()> {
        let local_density = placed.local_density;
        self.base = placed.base;
        let mut next = 0;
        while let Some(instruction) = local_density.instructions.get(next) {
            next += 1;
            match *instruction {
                Instruction::SkipUnevaluated { slot, to } => {
                    if self.node(slot).state != State::Clean {
                        next = to as usize;
                    }
                }
                Instruction::Recall { slot, into, to } => {
                    let node = self.node(slot);
                    if node.state == State::Clean {
                        self.fill(into, Register::of(&node.value));
                        next = to as usize;
                    }
                }
                Instruction::Unary { slot, f, x, into } => match self.number(x) {
                    Some(x) => self.fill(into, Register::Num(f(x))),
                    None => self.compute(slot, &[x], into)?,
                },
                Instruction::Binary { slot, f, x, y, into } => {
                    match (self.number(x), self.number(y)) {
                        (Some(x), Some(y)) => self.fill(into, Register::Num(f(x, y))),
                        _ => self.compute(slot, &[x, y], into)?,
                    }
                }
                Instruction::Test { f, x, y, into } => {
                    self.fill(into, Register::Bool(f(self.number(x)?, self.number(y)?)));
                }
                Instruction::Logic { f, x, into } => {
                    self.fill(into, Register::Bool(f(self.truth(x)?)))
                }
                Instruction::Index { base, key, into } => {
                    let found = match (self.read(base)?, self.read(key)?) {
                        (Register::Other(base), Register::Num(key)) => element(base, key)?,
                        _ => self.make(index_value(&self.value(base)?, &self.value(key)?).ok()?)?,
                    };
                    self.fill(into, found);
                }
                Instruction::Compute { slot, first, count, into } => {
                    let from = first as usize;
                    let operands = &local_density.inputs[from..from + count as usize];
                    self.compute(slot, operands, into)?;
                }
                Instruction::Branch { slot, cond, otherwise } => {
                    let holds = self.truth(cond)?;
                    let node = self.node(slot);
                    let other =
                        node.state == State::Clean && holds != (node.flags & OTHERWISE == 0);
                    if other && !self.turned {
                        if !(may_choose && self.can_choose(local_density)) {
                            return None;
                        }
                        self.turned = true;
                    }
                    if !holds {
                        next = otherwise as usize;
                    }
                }
                Instruction::Go { to } => next = to as usize,
                Instruction::Copy { from, into } => self.fill(into, self.read(from)?),
                Instruction::Draw { slot, builtin, ref parameters } => {
                    if !self.graph.is_plain_choice(self.base + slot) {
                        return None;
                    }
                    let score = self.log_density(
                        builtin,
                        parameters,
                        Register::of(&self.node(slot).value),
                    )?;
                    if self.is_first {
                        self.removed[0].sub(self.node(slot).score);
                    }
                    self.prior.add(score);
                }
                Instruction::Observe { slot, builtin, ref parameters, value } => {
                    let n = self.base + slot;
                    let replaced = self.graph.replaced(n).map(Register::of);
                    let observed = replaced.map_or_else(|| self.read(value), Some)?;
                    match self.log_density(builtin, parameters, observed) {
                        Some(score) => {
                            self.remove_score(n);
                            self.likelihood.add(score);
                        }
                        None => {
                            let count = self.code.builtins.get(builtin).args.len();
                            self.observe(slot, parameters.get(..count)?, value)?;
                        }
                    }
                }
                Instruction::ObserveUnder { slot, dist, value } => {
                    self.observe(slot, &[dist], value)?;
                }
                Instruction::Factor { slot, weight } => {
                    let weight = self.number(weight).filter(|w| !w.is_nan())?;
                    self.remove_score(self.base + slot);
                    self.likelihood.add(weight);
                }
            }
        }
        Some(())
    }

    #[inline(always)]
    fn fill(&mut self, into: u8, value: Register<'a>) {
        self.registers[into as usize] = value;
    }

    /// Runs the operation in a slot on these operands, as an update would.
    fn compute(&mut self, slot: Slot, operands: &[Input], into: u8) -> Option<()> {
        // Containers that it reads are held by its node.
        if self.node(slot).side.is_some() {
            return None;
        }
        let values = self.values(operands)?;
        let value = match self.graph.op(self.base + slot) {
            Op::Prim { builtin, .. } => {
                let values: SmallVec<[&Value; 4]> = values.iter().collect();
                self.code.builtins.get(*builtin).apply(&values).ok()?
            }
            Op::Array(_) => Value::from_elements(values.into_vec()),
            Op::Record { names, .. } => {
                Value::Record(Arc::new(names.iter().cloned().zip(values).collect()))
            }
            Op::Index { .. } => {
                let (base, keys) = values.split_first()?;
                keys.iter().try_fold(base.clone(), |v, key| index_value(&v, key)).ok()?
            }
            _ => return None,
        };
        let made = self.make(value)?;
        self.fill(into, made);
        Some(())
    }

    /// Returns the contents of a register for a value; `None` for one that limits may
    /// apply to.
    fn make(&mut self, value: Value) -> Option<Register<'a>> {
        let is_small = match &value {
            Value::Num(x) => return Some(Register::Num(*x)),
            Value::Bool(b) => return Some(Register::Bool(*b)),
            Value::Array(xs) => xs.len() <= LARGEST,
            Value::List(_) | Value::Record(_) => {
                value.len() <= Some(LARGEST) && value.extent() == Extent::Fits
            }
            Value::Dist(_) | Value::Likelihood(_) => true,
            _ => false,
        };
        self.made.push(value);
        is_small.then_some(Register::Made((self.made.len() - 1).try_into().ok()?))
    }

    /// Scores an observation of any kind, as an update would.
    fn observe(&mut self, slot: Slot, parameters: &[Input], observed: Input) -> Option<()> {
        let n = self.base + slot;
        let Op::Observe { dist, .. } = self.graph.op(n) else { return None };
        let values = self.values(parameters)?;
        let values: SmallVec<[&Value; 4]> = values.iter().collect();
        let observed = match self.graph.replaced(n) {
            Some(value) => value.clone(),
            None => self.value(observed)?,
        };
        let score = self.graph.score_of_values(n, dist, &values, &observed).ok()?;
        self.remove_score(n);
        match score {
            Score::One(score) => self.likelihood.add(score),
            Score::Sum(sum) => self.likelihood.merge(&sum),
        }
        Some(())
    }

    /// Removes the present score of an observation or factor.
    #[inline(always)]
    fn remove_score(&mut self, n: NodeId) {
        if self.is_first {
            self.graph.take_score(n, &mut self.removed[1]);
        }
    }

    /// True if its selections can take their other alternatives without releasing
    /// anything except computations.
    fn can_choose(&self, local_density: &LocalDensity) -> bool {
        let is_taken = |h: &KeptAlternative| {
            let node = self.node(h.selection);
            node.state == State::Clean && h.first == (node.flags & OTHERWISE == 0)
        };
        let is_kept = |h: &KeptAlternative| {
            let Some(n) = self.graph.resolve(self.frame(), h.operand) else { return true };
            let node = &self.graph[n];
            if node.refs > h.times || !is_taken(h) {
                return true;
            }
            let now = local_density
                .held
                .iter()
                .filter(|other| other.operand == h.operand && is_taken(other))
                .count();
            let holds_nothing = matches!(self.graph.op(n), Op::Item) && node.side.is_none();
            node.refs as usize > now || holds_nothing
        };
        local_density.computed.iter().all(|slot| self.node(*slot).side.is_none())
            && local_density.held.iter().all(is_kept)
    }

    /// The log density of a single number or boolean.
    fn log_density(
        &self,
        builtin: u32,
        parameters: &[Input; PARAMETERS],
        x: Register,
    ) -> Option<f64> {
        let builtin = self.code.builtins.get(builtin);
        let parameters = parameters.get(..builtin.args.len())?;
        match (builtin.scalar, x) {
            (_, Register::Num(x)) if x.is_nan() => None,
            (Some(Scalar::Family(family)), Register::Num(x)) => {
                let mut space = [0.0; PARAMETERS];
                let numbers = &mut space[..parameters.len()];
                for ((to, from), arg) in numbers.iter_mut().zip(parameters).zip(&*builtin.args) {
                    *to = self.read(*from)?.number_or_default(arg)?;
                }
                (family.log_density)(numbers, x)
            }
            (Some(Scalar::Weights { log_probability, .. }), Register::Num(x)) => {
                match self.read(*parameters.first()?)? {
                    Register::Other(Value::Array(weights)) if parameters.len() == 1 => {
                        log_probability(weights, x)
                    }
                    _ => None,
                }
            }
            _ => {
                let mut space = [Register::Num(0.0); PARAMETERS];
                let read = &mut space[..parameters.len()];
                for (to, from) in read.iter_mut().zip(parameters) {
                    *to = self.read(*from)?;
                }
                let dist = family(builtin, read)?;
                match x {
                    _ if !dist.is_scalar() => None,
                    Register::Num(x) => Some(dist.log_density_num(x)),
                    Register::Bool(b) => Some(dist.log_density_bool(b)),
                    _ => None,
                }
            }
        }
    }

    #[inline(always)]
    fn node(&self, slot: Slot) -> &'a Node {
        &self.graph[self.base + slot]
    }

    fn frame(&self) -> FrameId {
        self.graph[self.base].frame
    }

    #[inline(always)]
    fn read(&self, s: Input) -> Option<Register<'a>> {
        let node = match s {
            Input::Register(r) => return Some(self.registers[r as usize]),
            Input::Operand(Operand::Const(i)) => {
                return Some(Register::of(self.code.const_value(i)));
            }
            Input::Operand(Operand::Local(slot)) => self.node(slot),
            Input::Operand(o) => &self.graph[self.graph.resolve(self.frame(), o)?],
        };
        (node.state == State::Clean).then(|| Register::of(&node.value))
    }

    #[inline(always)]
    fn number(&self, s: Input) -> Option<f64> {
        match self.read(s)? {
            Register::Num(x) => Some(x),
            _ => None,
        }
    }

    fn truth(&self, s: Input) -> Option<bool> {
        match self.read(s)? {
            Register::Bool(b) => Some(b),
            _ => None,
        }
    }

    fn to_value(&self, r: Register) -> Value {
        match r {
            Register::Num(x) => Value::Num(x),
            Register::Bool(b) => Value::Bool(b),
            Register::Other(v) => v.clone(),
            Register::Made(i) => self.made[i as usize].clone(),
        }
    }

    /// Returns a value as an operation reads it.
    fn value(&self, s: Input) -> Option<Value> {
        match self.read(s)? {
            Register::Other(Value::Container(_)) => None,
            r => Some(self.to_value(r)),
        }
    }

    fn values(&self, all: &[Input]) -> Option<SmallVec<[Value; 4]>> {
        all.iter().map(|s| self.value(*s)).collect()
    }
}

#[cfg(test)]
#[path = "local_density_tests.rs"]
mod tests;
