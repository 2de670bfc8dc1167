//! Expressions of inference blocks: each becomes a function of the program, whose
//! parameters are the values that the plan supplies.

use super::lowerer::{Lowerer, Lowering, PlanScope, Typed};
use super::scope::{Binding, Body, Meaning, Scope, ScopeKind};
use crate::lang::builtins::{Builtin, PlanForm, Type};
use crate::lang::code::{Block, BlockId, BlockKind, Op, Operand, Settled, Slot};
use crate::lang::plan::{Argument, Formula, FormulaKind, Given, Path, PathSegment, Selection};
use pcadlang_syntax::ast::{Arg, Expr};
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// The slots that a function reads.
struct Reads {
    /// Its own slots.
    own: Vec<Slot>,
    /// True if it reads nothing of the state.
    is_closed: bool,
    /// True if what it reads of the state depends on no choice.
    is_settled: bool,
}

impl Lowerer<'_> {
    /// Lowers an expression of an inference block.
    pub fn formula(&mut self, e: &Expr, around: &PlanScope) -> Formula {
        let block = BlockId::new(self.code.blocks.len());
        let kind = BlockKind::Function { name: Arc::from("infer"), params: [].into(), required: 0 };
        self.code.blocks.push(Block::new(kind, Some(BlockId::ROOT)));
        let mut scope = Scope::new(block, ScopeKind::Function);
        let mut given = Vec::with_capacity(around.names.len());
        for (i, name) in around.names.iter().enumerate() {
            let slot = self.parameter(block, i, e.span);
            given.push(Given::Variable(i));
            let meaning = Meaning::Value(Operand::Local(slot));
            scope.names.insert(name.clone(), Binding { meaning, ty: Type::Any, span: e.span });
        }
        // The expression sees the top level only, although it may be the key of an address
        // within another one.
        let scopes = self.scopes.split_off(1);
        self.scopes.push(scope);
        let bodies = std::mem::replace(&mut self.bodies, vec![Body::default(), Body::default()]);
        let lowering = Lowering { block, given, around: around.clone() };
        let outer = self.lowering.replace(lowering);
        let result = self.expr(e).at;
        let given = std::mem::replace(&mut self.lowering, outer).map_or(Vec::new(), |l| l.given);
        self.bodies = bodies;
        self.scopes.truncate(1);
        self.scopes.extend(scopes);
        self.code.blocks[block].result = Some(result);
        let formula = Formula { kind: self.finished(block, given), span: e.span };
        self.varying += usize::from(!formula.is_constant());
        formula
    }

    fn parameter(&mut self, block: BlockId, index: usize, span: Span) -> Slot {
        let op = Op::Param { index: index as u16, default: None };
        self.code.blocks[block].push(op, span)
    }

    /// The form of an expression whose function is lowered: parameters that it does not
    /// read go, and a function that only passes on a value is not needed.
    fn finished(&mut self, block: BlockId, given: Vec<Given>) -> FormulaKind {
        let Reads { own: read, is_closed, is_settled } = self.reads(block);
        // A block behind it may be that of a computed key.
        let is_last = self.code.blocks.len() == block.index() + 1;
        let b = &mut self.code.blocks[block];
        let param = |slot: Slot| match b.ops[slot] {
            Op::Param { index, .. } => Some(FormulaKind::Given(given[index as usize].clone())),
            _ => None,
        };
        let simple = match b.result {
            Some(Operand::Const(i)) => {
                Some(FormulaKind::Const(self.code.consts[i as usize].clone()))
            }
            Some(Operand::Local(slot)) => param(slot),
            _ => None,
        };
        if let Some(simple) = simple {
            if is_last {
                self.code.blocks.pop();
            }
            return simple;
        }
        let mut kept = Vec::new();
        for (slot, op) in b.ops.iter_mut().enumerate() {
            if let Op::Param { index, .. } = op
                && read.contains(&Slot::new(slot))
            {
                kept.push(given[*index as usize].clone());
                *index = kept.len() as u16 - 1;
            }
        }
        FormulaKind::Function { block, given: kept.into(), is_closed, is_settled }
    }

    /// Returns the slots that a function and the blocks inside of it read.
    fn reads(&self, function: BlockId) -> Reads {
        let mut reads = Reads {
            own: Vec::new(),
            is_closed: true,
            is_settled: Settled::default().function(&self.code, function),
        };
        for (id, block) in self.code.blocks.iter().enumerate().skip(function.index()) {
            let id = BlockId::new(id);
            let mut operand = |o: Operand| {
                let (at, slot) = match o {
                    Operand::Const(_) => return,
                    Operand::Local(slot) => (id, slot),
                    Operand::Outer { up, slot } => {
                        let out =
                            |b: BlockId, _| self.code.blocks[b].parent.unwrap_or(BlockId::ROOT);
                        ((0..up).fold(id, out), slot)
                    }
                };
                if at < function {
                    reads.is_closed = false;
                }
                if at == function {
                    reads.own.push(slot);
                }
            };
            block.ops.iter().for_each(|op| op.operands(&mut operand));
            block.result.into_iter().for_each(operand);
            // Functions that it calls may read the state.
            let calls = |op: &Op| matches!(op, Op::Call { .. } | Op::Map { .. } | Op::Fold { .. });
            let opens = |op: &Op| calls(op) || matches!(op, Op::Probe(_) | Op::Mem { .. });
            reads.is_closed &= !block.ops.iter().any(opens);
        }
        reads
    }

    /// Lowers a built-in of inference blocks within an expression: the plan supplies its
    /// value.
    pub fn given(
        &mut self,
        what: PlanForm,
        b: &Builtin,
        args: &[Arg],
        e: &Expr,
        callee: Span,
    ) -> Typed {
        let Some(lowering) = &self.lowering else {
            self.only_in_plans(&b.name, callee);
            return self.nothing();
        };
        let around = lowering.around.clone();
        let Some(args) = self.inference_args(b, args, e.span, &around) else {
            return self.nothing();
        };
        let given = match (what, args.first()) {
            (PlanForm::Steps, _) => Given::Steps,
            (PlanForm::Elapsed, _) => Given::Elapsed,
            (PlanForm::Value, Some(Argument::Choices(choices))) => match &choices.selection {
                Selection::Path(path) => Given::Choice(path.clone()),
                // Refused like any other address of several choices.
                _ => {
                    let segments = [PathSegment::Deep].into();
                    Given::Choice(Path { segments, span: e.span })
                }
            },
            _ => Given::Unavailable(Arc::from(&*b.name), e.span),
        };
        let Some(lowering) = &mut self.lowering else { return self.nothing() };
        lowering.given.push(given);
        let (block, index) = (lowering.block, lowering.given.len() - 1);
        let slot = self.parameter(block, index, e.span);
        let up = self.scopes.len() as u16 - 2;
        Typed { at: Self::reach(Operand::Local(slot), up), ty: Type::Any }
    }

    /// Reports an expression that the model may use but a plan may not; `true` if this is
    /// one of a plan.
    pub fn refused_in_plans(&mut self, span: Span) -> bool {
        if self.lowering.is_some() {
            self.error(
                "this expression cannot be used in an inference block",
                span,
                "a function, or statements",
            )
            .hint_also("bind it in the model, let name = …;, and use the name here");
        }
        self.lowering.is_some()
    }
}
