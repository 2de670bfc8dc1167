//! Local densities: how another value of a choice changes the scores of its block, as a
//! short program over single numbers.
//!
//! Most choices are single numbers that feed a little arithmetic and a few scores of the
//! same block. For those, the scores under another value can be computed without touching
//! the trace, by this code, which is compiled once per slot. Operations with a form on
//! single numbers (see [`Scalar`]) have instructions of their own; arrays, records and
//! calls of other built-ins are computed as in an update. It gives up on operations with
//! structure, at run time as well. An update then decides, so a local density must be
//! correct only where it returns a result.

use super::builtins::{Scalar, Table};
use super::code::{DistSpec, Op, Operand, Slot};
use smallvec::SmallVec;

/// The number of registers of a local density.
pub const REGISTERS: usize = 16;

/// The maximum number of parameters of a distribution in a local density.
pub const PARAMETERS: usize = 4;

/// The maximum number of instructions.
const LONGEST: usize = 96;

/// The maximum number of operands of `Compute`.
const MOST_INPUTS: usize = 256;

/// Where an instruction finds an input.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    /// A register; register 0 contains the value at which the density is evaluated.
    Register(u8),
    /// A constant or an evaluated slot.
    Operand(Operand),
}

/// An instruction of a local density.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub enum Instruction {
    /// Jumps to `to` if the slot is not evaluated, because nothing needs it.
    SkipUnevaluated { slot: Slot, to: u16 },
    /// If the slot is evaluated, takes its value and jumps to `to`.
    Recall { slot: Slot, into: u8, to: u16 },
    /// A function of single numbers; of arrays, it is the operation in the slot.
    Unary { slot: Slot, f: fn(f64) -> f64, x: Input, into: u8 },
    /// See `Unary`.
    Binary { slot: Slot, f: fn(f64, f64) -> f64, x: Input, y: Input, into: u8 },
    /// See `Unary`.
    Test { f: fn(f64, f64) -> bool, x: Input, y: Input, into: u8 },
    /// See `Unary`.
    Logic { f: fn(bool) -> bool, x: Input, into: u8 },
    /// An element of an array or record.
    Index { base: Input, key: Input, into: u8 },
    /// The operation in the slot, whose operands are `count` of the density's inputs from
    /// `first` on.
    Compute { slot: Slot, first: u16, count: u16, into: u8 },
    /// Jumps to `otherwise` if the condition of the selection in the slot does not hold.
    Branch { slot: Slot, cond: Input, otherwise: u16 },
    /// Jumps.
    Go { to: u16 },
    /// Copies a value.
    Copy { from: Input, into: u8 },
    /// Scores the choice in the slot under other parameters.
    Draw { slot: Slot, builtin: u32, parameters: [Input; PARAMETERS] },
    /// Scores the observation in the slot.
    Observe { slot: Slot, builtin: u32, parameters: [Input; PARAMETERS], value: Input },
    /// Scores the observation in the slot under a distribution or likelihood.
    ObserveUnder { slot: Slot, dist: Input, value: Input },
    /// Scores the factor in the slot.
    Factor { slot: Slot, weight: Input },
}

/// A node that an alternative of a selection holds.
#[derive(Clone, Copy, Debug)]
pub struct KeptAlternative {
    /// The selection.
    pub selection: Slot,
    /// True if it is the first alternative.
    pub first: bool,
    /// The operand that is held.
    pub operand: Operand,
    /// How often all alternatives together hold it.
    pub times: u32,
}

/// The scores of a block as a function of the value of one slot.
#[derive(Clone, Debug, Default)]
pub struct LocalDensity {
    /// The instructions.
    pub instructions: Box<[Instruction]>,
    /// The operands of `Compute`.
    pub inputs: Box<[Input]>,
    /// The computations that depend on the value; other blocks must not read them.
    pub computations: Box<[Slot]>,
    /// The operands that alternatives of its selections hold. When a selection switches, it must
    /// be kept by other holders.
    pub held: Box<[KeptAlternative]>,
    /// The computations of the alternatives; they must hold nothing besides their
    /// operands.
    pub computed: Box<[Slot]>,
}

impl LocalDensity {
    /// Returns the local density of a slot of a block, if there is one; `dependents` are
    /// the slots that depend on it, in an order of evaluation.
    pub(super) fn new(
        ops: &[Op],
        dependents: Vec<Slot>,
        from: Slot,
        builtins: &Table,
    ) -> Option<LocalDensity> {
        let mut compiler = Compiler {
            ops,
            builtins,
            from,
            dependent: vec![false; ops.len()],
            instructions: Vec::new(),
            inputs: Vec::new(),
            known: vec![None; ops.len()],
            registers: 1,
            inside: false,
            held: Vec::new(),
            computed: Vec::new(),
        };
        dependents.iter().for_each(|s| compiler.dependent[*s] = true);
        let is_score =
            |s: &Slot| matches!(ops[*s], Op::Draw { .. } | Op::Observe { .. } | Op::Factor { .. });
        let (scores, computations): (Vec<Slot>, Vec<Slot>) =
            dependents.into_iter().partition(is_score);
        scores.into_iter().try_for_each(|slot| compiler.score(slot))?;
        let Compiler { instructions, inputs, mut held, computed, .. } = compiler;
        let operands: Vec<Operand> = held.iter().map(|h| h.operand).collect();
        held.iter_mut()
            .for_each(|h| h.times = operands.iter().filter(|o| **o == h.operand).count() as u32);
        Some(LocalDensity {
            instructions: instructions.into(),
            inputs: inputs.into(),
            computations: computations.into(),
            held: held.into(),
            computed: computed.into(),
        })
    }
}

struct Compiler<'a> {
    ops: &'a [Op],
    builtins: &'a Table,
    from: Slot,
    /// By slot: whether it depends on the value.
    dependent: Vec<bool>,
    instructions: Vec<Instruction>,
    inputs: Vec<Input>,
    /// By slot: the register that contains its value whenever the next instruction runs.
    known: Vec<Option<u8>>,
    registers: usize,
    /// True if the next instruction is inside an alternative, so that what it reads may
    /// not be evaluated.
    inside: bool,
    held: Vec<KeptAlternative>,
    computed: Vec<Slot>,
}

impl Compiler<'_> {
    /// Emits the instructions that score a slot.
    fn score(&mut self, slot: Slot) -> Option<()> {
        let known = self.known.clone();
        let skip = self.push(Instruction::SkipUnevaluated { slot, to: 0 })?;
        let instruction = match &self.ops[slot] {
            Op::Draw { dist: DistSpec::Family { builtin, args }, keys, .. } => {
                if keys.iter().any(|k| self.depends(*k)) {
                    return None;
                }
                Instruction::Draw { slot, builtin: *builtin, parameters: self.parameters(args)? }
            }
            Op::Observe { dist: DistSpec::Family { builtin, args }, value, .. } => {
                let (parameters, value) = (self.parameters(args)?, self.input(*value)?);
                Instruction::Observe { slot, builtin: *builtin, parameters, value }
            }
            Op::Observe { dist: DistSpec::Value(dist), value, .. } => {
                let (dist, value) = (self.input(*dist)?, self.input(*value)?);
                Instruction::ObserveUnder { slot, dist, value }
            }
            Op::Factor { weight, .. } => Instruction::Factor { slot, weight: self.input(*weight)? },
            _ => return None,
        };
        self.push(instruction)?;
        self.land(skip);
        // If the score is skipped, so is everything computed for it.
        self.known = known;
        Some(())
    }

    fn parameters(&mut self, args: &[Operand]) -> Option<[Input; PARAMETERS]> {
        if args.len() > PARAMETERS {
            return None;
        }
        let mut all = [Input::Register(0); PARAMETERS];
        for (to, o) in all.iter_mut().zip(args) {
            *to = self.input(*o)?;
        }
        Some(all)
    }

    fn depends(&self, o: Operand) -> bool {
        matches!(o, Operand::Local(s) if s == self.from || self.dependent[s])
    }

    /// Returns where the value of an operand is.
    fn input(&mut self, o: Operand) -> Option<Input> {
        let Operand::Local(slot) = o else { return Some(Input::Operand(o)) };
        if slot == self.from {
            return Some(Input::Register(0));
        }
        if let Some(r) = self.known[slot] {
            return Some(Input::Register(r));
        }
        if self.dependent[slot] {
            let r = self.compute(slot)?;
            self.known[slot] = Some(r);
            return Some(Input::Register(r));
        }
        if !self.inside || !self.is_computed(slot) {
            return Some(Input::Operand(o));
        }
        let into = self.register()?;
        let recall = self.push(Instruction::Recall { slot, into, to: 0 })?;
        let known = self.known.clone();
        let r = self.compute(slot)?;
        self.push(Instruction::Copy { from: Input::Register(r), into })?;
        self.known = known;
        self.land(recall);
        self.known[slot] = Some(into);
        Some(Input::Register(into))
    }

    fn is_computed(&self, slot: Slot) -> bool {
        match &self.ops[slot] {
            // A host's functions may be costly, or keep a state in the node.
            Op::Prim { builtin, .. } => self.builtins.get(*builtin).host.is_none(),
            Op::Index { .. } | Op::Select { .. } | Op::Array(_) | Op::Record { .. } => true,
            _ => false,
        }
    }

    /// Emits the instructions that compute a slot; returns the register of its value.
    fn compute(&mut self, slot: Slot) -> Option<u8> {
        match &self.ops[slot] {
            Op::Prim { builtin, args } if self.is_on_numbers(*builtin) => {
                let mut arg = |i: usize| self.input(*args.get(i)?);
                let (x, y) = (arg(0)?, arg(1));
                let into = self.register()?;
                let instruction = match (self.builtins.get(*builtin).scalar?, y) {
                    (Scalar::Unary(f), _) => Instruction::Unary { slot, f, x, into },
                    (Scalar::Logic(f), _) => Instruction::Logic { f, x, into },
                    (Scalar::Binary(f), Some(y)) => Instruction::Binary { slot, f, x, y, into },
                    (Scalar::Test(f), Some(y)) => Instruction::Test { f, x, y, into },
                    _ => return None,
                };
                self.push(instruction)?;
                Some(into)
            }
            Op::Index { base, keys } if keys.len() == 1 => {
                let (base, key) = (self.input(*base)?, self.input(keys[0])?);
                let into = self.register()?;
                self.push(Instruction::Index { base, key, into })?;
                Some(into)
            }
            Op::Select { cond, then, otherwise } => {
                let (cond, then, otherwise) = (*cond, *then, *otherwise);
                let chosen = self.depends(cond);
                let cond = self.input(cond)?;
                let into = self.register()?;
                let branch = self.push(Instruction::Branch { slot, cond, otherwise: 0 })?;
                self.alternative(then, into)?;
                let go = self.push(Instruction::Go { to: 0 })?;
                self.land(branch);
                self.alternative(otherwise, into)?;
                self.land(go);
                if chosen {
                    self.hold(slot, true, then)?;
                    self.hold(slot, false, otherwise)?;
                }
                Some(into)
            }
            op if self.is_computed(slot) => {
                let mut operands: SmallVec<[Operand; 8]> = SmallVec::new();
                op.operands(|o| operands.push(o));
                let found = operands.iter().map(|o| self.input(*o));
                let found: SmallVec<[Input; 8]> = found.collect::<Option<_>>()?;
                let (first, count) = (self.inputs.len() as u16, found.len() as u16);
                self.inputs.extend(found);
                let into = self.register()?;
                self.push(Instruction::Compute { slot, first, count, into })?;
                (self.inputs.len() <= MOST_INPUTS).then_some(into)
            }
            _ => None,
        }
    }

    /// True if a built-in is a function of single numbers.
    fn is_on_numbers(&self, builtin: u32) -> bool {
        let scalar = &self.builtins.get(builtin).scalar;
        matches!(
            scalar,
            Some(Scalar::Unary(_) | Scalar::Binary(_) | Scalar::Test(_) | Scalar::Logic(_))
        )
    }

    fn alternative(&mut self, o: Operand, into: u8) -> Option<()> {
        let (known, inside) = (self.known.clone(), std::mem::replace(&mut self.inside, true));
        let from = self.input(o)?;
        self.push(Instruction::Copy { from, into })?;
        (self.known, self.inside) = (known, inside);
        Some(())
    }

    /// Records what an alternative of a selection holds.
    fn hold(&mut self, selection: Slot, first: bool, o: Operand) -> Option<()> {
        let inner = match o {
            Operand::Const(_) => return Some(()),
            Operand::Local(s) => self.computation(s),
            Operand::Outer { .. } => None,
        };
        let Some((slot, inner)) = inner else {
            self.held.push(KeptAlternative { selection, first, operand: o, times: 1 });
            return (self.held.len() <= LONGEST).then_some(());
        };
        self.computed.push(slot);
        if self.computed.len() > LONGEST {
            return None;
        }
        inner.into_iter().try_for_each(|o| self.hold(selection, first, o))
    }

    /// Returns a slot that only computes, with its operands.
    fn computation(&self, slot: Slot) -> Option<(Slot, Vec<Operand>)> {
        let op = &self.ops[slot];
        let mut operands = Vec::new();
        match op {
            Op::Prim { .. } | Op::Array(_) | Op::Record { .. } | Op::Index { .. } => {}
            Op::Select { then, otherwise, .. } => operands.extend([*then, *otherwise]),
            _ => return None,
        }
        op.operands(|o| operands.push(o));
        (slot != self.from).then_some((slot, operands))
    }

    fn register(&mut self) -> Option<u8> {
        self.registers += 1;
        (self.registers <= REGISTERS).then(|| self.registers as u8 - 1)
    }

    fn push(&mut self, instruction: Instruction) -> Option<usize> {
        self.instructions.push(instruction);
        (self.instructions.len() <= LONGEST).then(|| self.instructions.len() - 1)
    }

    /// Makes the jump at an instruction lead to the next one.
    fn land(&mut self, jump: usize) {
        let here = self.instructions.len() as u16;
        if let Instruction::SkipUnevaluated { to, .. }
        | Instruction::Recall { to, .. }
        | Instruction::Go { to }
        | Instruction::Branch { otherwise: to, .. } = &mut self.instructions[jump]
        {
            *to = here;
        }
    }
}
