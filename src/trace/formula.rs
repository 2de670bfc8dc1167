//! Weights of other values of a choice by formulas (see [`crate::lang::formula`]): nothing in the trace changes.
//!
//! The scores are computed by the same functions as in an update and quantised as there, so the weights are the same to the
//! last bit. Whatever a formula does not cover makes it give up; then [`super::peek`] or an update decides.

use super::graph::Graph;
use super::node::*;
use super::propose::Weight;
use crate::dist::{Datum, Dist};
use crate::lang::builtins::{Args, Kind};
use crate::lang::code::{Code, Op, Operand, Slot};
use crate::lang::formula::{Formula, PARAMETERS, REGISTERS, Source, Step};
use crate::lang::index::place;
use crate::lang::value::Value;
use crate::num::ExactSum;
use smallvec::SmallVec;

/// The formulas that tell what another value of a choice does: the first node of the frame of each, with the formula.
pub(crate) type Formulas<'c> = SmallVec<[(NodeId, &'c Formula); 4]>;

/// The most other frames that may read the choice.
const READERS: usize = 4;

/// A value in a formula.
#[derive(Clone, Copy)]
enum Register<'a> {
    Num(f64),
    Bool(bool),
    Other(&'a Value),
}

/// A formula at work on the nodes of one frame.
struct Evaluation<'a> {
    graph: &'a Graph,
    code: &'a Code,
    base: NodeId,
    registers: [Register<'a>; REGISTERS],
}

impl Graph {
    /// The formulas that together tell what another value of a choice does; `None` if there are none in this state.
    pub fn formulas<'c>(&self, code: &'c Code, target: NodeId) -> Option<Formulas<'c>> {
        let facts = self.slot_facts(code, target);
        let finite = self.prior.is_fine() && self.likelihood.is_fine();
        if !self.incremental || !finite || !self.is_plain_choice(target) {
            return None;
        }
        let mut all = Formulas::new();
        self.add_formula(target - facts.slot, facts.formula.as_deref()?, &mut all)?;
        let readers = &self.outside[self.nodes[target as usize].outside as usize].users;
        if readers.len() > READERS {
            return None;
        }
        for (i, m) in readers.iter().enumerate() {
            let node = &self.nodes[*m as usize];
            if node.state != State::Clean || readers[..i].contains(m) {
                continue;
            }
            // An element of a container: its value is that of the choice.
            let Op::Index { .. } = self.op(code, *m) else { return None };
            let Some(Side::Deps(deps)) = node.side.as_deref() else { return None };
            if deps.as_slice() != [target] {
                return None;
            }
            let facts = self.slot_facts(code, *m);
            if self.is_read_outside(*m) {
                return None;
            }
            self.add_formula(m - facts.slot, facts.formula.as_deref()?, &mut all)?;
        }
        Some(all)
    }

    /// Adds a formula, if it sees all that depends on its value.
    fn add_formula<'c>(&self, base: NodeId, formula: &'c Formula, all: &mut Formulas<'c>) -> Option<()> {
        let moves = |m: NodeId| !matches!(self.nodes[m as usize].state, State::Empty) && self.is_read_outside(m);
        if formula.computations.iter().any(|slot| moves(base + slot)) {
            return None;
        }
        if formula.steps.is_empty() {
            return Some(());
        }
        // Two in one frame could move the same score.
        if all.iter().any(|(other, _)| *other == base) {
            return None;
        }
        all.push((base, formula));
        Some(())
    }

    /// The weight of a value of the choice, relative to the present one; `None` if the formulas do not cover it.
    pub fn weigh(
        &self,
        code: &Code,
        target: NodeId,
        formulas: &Formulas,
        dist: &Dist,
        value: &Datum,
    ) -> Option<Weight> {
        let (mut prior, mut likelihood) = (ExactSum::default(), ExactSum::default());
        prior.sub(self.nodes[target as usize].score);
        prior.add(dist.log_density_stored(value));
        let at = match value {
            Datum::Num(x) => Register::Num(*x),
            Datum::Bool(b) => Register::Bool(*b),
            _ => return None,
        };
        let single = formulas.len() == 1;
        for (base, formula) in formulas {
            let registers = [at; REGISTERS];
            let mut e = Evaluation { graph: self, code, base: *base, registers };
            e.run(formula, single, &mut prior, &mut likelihood)?;
        }
        Some(Weight::beside(&prior, &likelihood))
    }
}

impl<'a> Evaluation<'a> {
    /// Runs a formula. `may_choose`: selections may take their other alternative.
    fn run(
        &mut self,
        formula: &Formula,
        may_choose: bool,
        prior: &mut ExactSum,
        likelihood: &mut ExactSum,
    ) -> Option<()> {
        let mut next = 0;
        while let Some(step) = formula.steps.get(next) {
            next += 1;
            match *step {
                Step::SkipUnasked { slot, to } => {
                    if self.node(slot).state != State::Clean {
                        next = to as usize;
                    }
                }
                Step::Recall { slot, into, to } => {
                    let node = self.node(slot);
                    if node.state == State::Clean {
                        self.registers[into as usize] = Register::of(&node.value);
                        next = to as usize;
                    }
                }
                Step::Unary { f, x, into } => self.registers[into as usize] = Register::Num(f(self.number(x)?)),
                Step::Binary { f, x, y, into } => {
                    self.registers[into as usize] = Register::Num(f(self.number(x)?, self.number(y)?));
                }
                Step::Test { f, x, y, into } => {
                    self.registers[into as usize] = Register::Bool(f(self.number(x)?, self.number(y)?));
                }
                Step::Logic { f, x, into } => self.registers[into as usize] = Register::Bool(f(self.truth(x)?)),
                Step::Index { base, key, into } => {
                    self.registers[into as usize] = element(self.read(base)?, self.number(key)?)?;
                }
                Step::Branch { slot, cond, otherwise } => {
                    let holds = self.truth(cond)?;
                    let node = self.node(slot);
                    let other = node.state == State::Clean && holds != (node.flags & OTHERWISE == 0);
                    if other && !(may_choose && self.can_choose(formula)) {
                        return None;
                    }
                    if !holds {
                        next = otherwise as usize;
                    }
                }
                Step::Go { to } => next = to as usize,
                Step::Copy { from, into } => self.registers[into as usize] = self.read(from)?,
                Step::Draw { slot, builtin, ref parameters } => {
                    let n = self.base + slot;
                    let dist = self.dist(builtin, parameters)?;
                    let value = match (self.graph.is_plain_choice(n), &self.node(slot).value) {
                        (true, Value::Num(x)) => Datum::Num(*x),
                        (true, Value::Bool(b)) => Datum::Bool(*b),
                        _ => return None,
                    };
                    if dist.elements().is_some() || !dist.stored_support().fits(&value) {
                        return None;
                    }
                    prior.sub(self.node(slot).score);
                    prior.add(dist.log_density(&value));
                }
                Step::Observe { slot, builtin, ref parameters, value } => {
                    let n = self.base + slot;
                    let dist = self.dist(builtin, parameters)?;
                    let replaced = self.graph.replaced(self.code, n).map(Register::of);
                    let value = replaced.map_or_else(|| self.read(value), Some)?;
                    if dist.elements().is_some() {
                        return None;
                    }
                    self.graph.take_score(n, likelihood);
                    likelihood.add(match value {
                        Register::Num(x) if !x.is_nan() => dist.log_density_num(x),
                        Register::Bool(b) => dist.log_density_bool(b),
                        _ => return None,
                    });
                }
                Step::Factor { slot, weight } => {
                    let weight = self.number(weight).filter(|w| !w.is_nan())?;
                    likelihood.sub(self.node(slot).score);
                    likelihood.add(weight);
                }
            }
        }
        Some(())
    }

    /// Whether its selections can take their other alternatives without letting anything go but computations.
    fn can_choose(&self, formula: &Formula) -> bool {
        let is_held = |(o, times): &(Operand, u32)| {
            let Some(n) = self.graph.resolve(self.frame(), *o) else { return true };
            let node = &self.graph.nodes[n as usize];
            let holds_nothing = matches!(self.graph.op(self.code, n), Op::Item) && node.side.is_none();
            node.state != State::Clean || node.refs > *times || holds_nothing
        };
        formula.computed.iter().all(|slot| self.node(*slot).side.is_none()) && formula.held.iter().all(is_held)
    }

    /// A distribution with these parameters.
    #[inline]
    fn dist(&self, builtin: u32, parameters: &[Source; PARAMETERS]) -> Option<Dist> {
        let builtin = self.code.builtins.get(builtin);
        let Kind::Distribution(make) = builtin.kind else { return None };
        let count = builtin.args.len().min(PARAMETERS);
        let mut numbers: [Value; PARAMETERS] = Default::default();
        let mut read = [Register::Num(0.0); PARAMETERS];
        for i in 0..count {
            read[i] = self.read(parameters[i])?;
            match read[i] {
                Register::Num(x) => numbers[i] = Value::Num(x),
                Register::Bool(b) => numbers[i] = Value::Bool(b),
                Register::Other(_) => {}
            }
        }
        let values: [&Value; PARAMETERS] = std::array::from_fn(|i| match read[i] {
            Register::Other(v) => v,
            _ => &numbers[i],
        });
        make(&Args { builtin, values: &values[..count] }).ok()
    }

    fn node(&self, slot: Slot) -> &'a Node {
        &self.graph.nodes[(self.base + slot) as usize]
    }

    fn frame(&self) -> FrameId {
        self.graph.nodes[self.base as usize].frame
    }

    #[inline]
    fn read(&self, s: Source) -> Option<Register<'a>> {
        let node = match s {
            Source::Register(r) => return Some(self.registers[r as usize]),
            Source::Operand(Operand::Const(i)) => return Some(Register::of(self.code.const_value(i))),
            Source::Operand(Operand::Local(slot)) => self.node(slot),
            Source::Operand(o) => &self.graph.nodes[self.graph.resolve(self.frame(), o)? as usize],
        };
        (node.state == State::Clean).then(|| Register::of(&node.value))
    }

    fn number(&self, s: Source) -> Option<f64> {
        match self.read(s)? {
            Register::Num(x) => Some(x),
            _ => None,
        }
    }

    fn truth(&self, s: Source) -> Option<bool> {
        match self.read(s)? {
            Register::Bool(b) => Some(b),
            _ => None,
        }
    }
}

impl<'a> Register<'a> {
    fn of(v: &'a Value) -> Self {
        match v {
            Value::Num(x) => Register::Num(*x),
            Value::Bool(b) => Register::Bool(*b),
            v => Register::Other(v),
        }
    }
}

/// An element of an array that is there.
fn element(base: Register, key: f64) -> Option<Register> {
    let Register::Other(base) = base else { return None };
    match base {
        Value::Array(xs) => place(xs.len(), key).map(|i| Register::Num(xs[i])),
        Value::List(xs) => place(xs.len(), key).map(|i| Register::of(&xs[i])),
        _ => None,
    }
}
