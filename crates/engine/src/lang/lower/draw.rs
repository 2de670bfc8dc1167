//! Random choices: `x ~ d`, and `t[k] ~ d` with the container `t` of its elements.

use super::lowerer::{Lowerer, Typed};
use super::scope::{Meaning, ScopeKind};
use crate::lang::builtins::Type;
use crate::lang::code::{BlockId, DistSpec, ElementDraw, ElementKey, Op, Operand, Slot};
use crate::lang::value::Value;
use pcadlang_numerics::dist::Drawn;
use pcadlang_syntax::ast::{Expr, ExprKind, Name, Stmt, StmtKind, Tag};
use pcadlang_syntax::print_expr;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

impl Lowerer<'_> {
    /// Lowers `x ~ d` and returns the choice.
    pub fn named_draw(&mut self, name: &Name, dist: &Expr, tags: &[Tag]) -> Typed {
        let spec = self.below(&name.node, |l| l.dist_spec(dist, false));
        let tags = self.tags(tags);
        let ty = self.drawn_type(&spec);
        let site = self.site(&name.node, tags, 0);
        let slot = self.push(Op::Draw { dist: spec, site, keys: Box::default() }, dist.span);
        Typed { at: Operand::Local(slot), ty }
    }

    /// Returns the static type of a draw of a family, as far as it is known.
    fn drawn_type(&self, d: &DistSpec) -> Type {
        match d {
            DistSpec::Family { builtin, args } => match self.code.builtins.get(*builtin).drawn {
                Drawn::Elementwise if args.iter().all(|a| self.is_number(*a)) => Type::Num,
                Drawn::Elementwise => Type::Nums,
                Drawn::Array | Drawn::Correlated => Type::Array,
                Drawn::Unknown => Type::Any,
            },
            DistSpec::Value(o) if self.makes_arrays(*o) => Type::Array,
            DistSpec::Value(_) => Type::Any,
        }
    }

    /// True if a distribution is a multivariate normal that this block makes.
    fn makes_arrays(&self, dist: Operand) -> bool {
        let Operand::Local(slot) = dist else { return false };
        match self.code.blocks[self.block()].ops.get(slot.index()) {
            Some(Op::Prim { builtin, .. }) => self.has_covariance(*builtin),
            _ => false,
        }
    }

    /// True if a built-in is a family with a covariance matrix.
    pub fn has_covariance(&self, builtin: u32) -> bool {
        self.code.builtins.get(builtin).drawn == Drawn::Correlated
    }

    fn is_number(&self, o: Operand) -> bool {
        matches!(o, Operand::Const(i) if matches!(self.code.const_value(i), Value::Num(_)))
    }

    /// Lowers `t[k] ~ d`.
    pub fn keyed_draw(&mut self, target: &Expr, dist: &Expr, tags: &[Tag]) {
        let Some((name, keys)) = keyed_target(target) else {
            self.error(
                "a choice is drawn into a name or an element",
                target.span,
                "expected `x` or `t[k]`",
            );
            return;
        };
        if !self.in_loop() {
            self.declare_container(&name);
        }
        let Some((binding, up)) = self.lookup(&name.node) else { return };
        let Meaning::Container(container) = binding.meaning else {
            self.not_a_container(&name, binding.span);
            return;
        };
        let spec = self.below(&name.node, |l| l.dist_spec(dist, false));
        let operands: Vec<Operand> = keys.iter().map(|k| self.expr(k).at).collect();
        let tags = self.tags(tags);

        // Which enclosing loops have their variable among the keys.
        let loops = self.loops_here();
        let variables: Vec<Arc<str>> = loops
            .iter()
            .filter_map(|i| match &self.scopes[*i].kind {
                ScopeKind::Loop { var, .. } => Some(Arc::clone(var)),
                _ => None,
            })
            .collect();
        let loop_of = |k: &Expr| match &k.kind {
            ExprKind::Var(v) => variables.iter().rposition(|x| x == v),
            _ => None,
        };
        let plain = keys.len() == loops.len()
            && keys.iter().enumerate().all(|(i, k)| loop_of(k) == Some(i));
        let carried = if plain {
            0
        } else {
            let n = loops.len();
            keys.iter()
                .filter_map(|k| loop_of(k))
                .fold(0u32, |bits, i| bits | 1u32.checked_shl((n - 1 - i) as u32).unwrap_or(0))
        };
        let own: Box<[Operand]> = if plain { Box::default() } else { operands.clone().into() };
        let outside = self.scopes.len() - 1 - up as usize;
        let occurrence = self.occurrence_of((self.scopes[outside].block, container), &name.node);
        let site = self.site_of(&name.node, occurrence, tags, carried);
        let slot = self.push(Op::Draw { dist: spec, site, keys: own }, dist.span);
        let written = keys.iter().map(|k| format!("[{}]", print_expr(k))).collect::<String>();

        // The loops between the container and the draw.
        let inner: Vec<usize> = loops.iter().copied().filter(|i| *i > outside).collect();
        let through: Box<[Slot]> = inner
            .iter()
            .filter_map(|i| match self.scopes[*i].kind {
                ScopeKind::Loop { at, .. } => Some(at),
                _ => None,
            })
            .collect();
        let skipped = loops.len() - inner.len();
        let source_keys = keys
            .iter()
            .zip(&operands)
            .map(|(k, o)| match loop_of(k) {
                Some(i) if i >= skipped => ElementKey::Loop((i - skipped) as u32),
                _ => ElementKey::Operand(*o),
            })
            .collect();
        let source = ElementDraw { loops: through, draw: slot, keys: source_keys };
        let home = self.scopes[outside].block;
        if let Op::Container { sources, .. } = &mut self.code.blocks[home].ops[container] {
            let mut all = std::mem::take(sources).into_vec();
            all.push(source);
            *sources = all.into();
        }
        let last = self.scopes.len() - 1;
        let scope = &mut self.scopes[last];
        if scope.drawn.iter().any(|(n, w, _)| *n == name.node && *w == written) {
            self.error(
                format!("`{}{written}` is drawn twice", name.node),
                target.span,
                "a second draw at one address",
            )
            .hint_also("every choice needs its own address: use another key, or another name");
            return;
        }
        scope.drawn.push((name.node, written, slot));
    }

    /// Returns the occurrence of a container's name.
    /// `z[0] ~ d; for t in 1 .. n { z[t] ~ e; }` draws `@z[0]`, `@z[1]`, …; two elements
    /// with the same address are detected when they are drawn.
    fn occurrence_of(&mut self, container: (BlockId, Slot), name: &Arc<str>) -> u32 {
        if let Some(n) = self.bodies.last().and_then(|b| b.containers.get(&container)) {
            return *n;
        }
        let n = self.next_occurrence(name);
        if let Some(body) = self.bodies.last_mut() {
            body.containers.insert(container, n);
        }
        n
    }

    /// Declares the containers that statements of this block, including loops in it, draw
    /// into.
    pub fn declare_containers(&mut self, stmts: &[Stmt]) {
        if self.in_loop() {
            return;
        }
        let mut names = Vec::new();
        find_targets(stmts, &mut names);
        for name in names {
            self.declare_container(&name);
        }
    }

    /// True if the innermost block is a loop, whose containers belong to a block further
    /// out.
    fn in_loop(&self) -> bool {
        self.scopes.last().is_some_and(|s| matches!(s.kind, ScopeKind::Loop { .. }))
    }

    fn declare_container(&mut self, name: &Name) {
        let here = if self.scopes.len() == 1 {
            self.modules[self.module].names.get(&name.node)
        } else {
            self.scopes.last().and_then(|s| s.names.get(&name.node))
        };
        match here.copied() {
            None => {
                let op = Op::Container { name: Arc::clone(&name.node), sources: Box::default() };
                let slot = self.push(op, name.span);
                self.push(Op::Gather, name.span);
                self.bind(name, Meaning::Container(slot), Type::Any);
                if self.scopes.len() == 1 {
                    let global = self.global_name(name);
                    self.code.globals.insert(global, Operand::Local(slot));
                    self.recorded(&name.node, Operand::Local(slot));
                }
            }
            Some(b) if matches!(b.meaning, Meaning::Container(_)) => {}
            Some(b) => self.not_a_container(name, b.span),
        }
    }

    fn not_a_container(&mut self, name: &Name, bound: Span) {
        let message =
            format!("`{}` is already bound and cannot also hold keyed choices", name.node);
        let e = self.error(message, name.span, "used as a container here");
        e.point_at(bound, "bound here");
        e.hint_also("give the container another name");
    }

    /// Returns the slot that an element was drawn into, if `base[keys]` is written
    /// exactly as where it was drawn, in the same pass.
    pub fn drawn_here(&self, name: &str, written: &str) -> Option<Operand> {
        for (up, scope) in self.scopes.iter().rev().enumerate() {
            if let Some((_, _, slot)) =
                scope.drawn.iter().find(|(n, w, _)| &**n == name && w == written)
            {
                return Some(Self::reach(Operand::Local(*slot), up as u16));
            }
            let bound = match scope.kind {
                ScopeKind::Root => self.modules[self.module].names.contains_key(name),
                _ => scope.names.contains_key(name),
            };
            if bound {
                return None;
            }
        }
        None
    }
}

/// Returns the name and keys of `t[a][b]`.
fn keyed_target(e: &Expr) -> Option<(Name, Vec<&Expr>)> {
    match &e.kind {
        ExprKind::Var(name) => Some((Name::new(Arc::clone(name), e.span), Vec::new())),
        ExprKind::Index { base, index } => {
            let (name, mut keys) = keyed_target(base)?;
            keys.push(index);
            Some((name, keys))
        }
        _ => None,
    }
}

fn find_targets(stmts: &[Stmt], names: &mut Vec<Name>) {
    for s in stmts {
        match &s.kind {
            StmtKind::Draw { target, .. } if matches!(target.kind, ExprKind::Index { .. }) => {
                if let Some((name, _)) = keyed_target(target)
                    && !names.iter().any(|n| n.node == name.node)
                {
                    names.push(name);
                }
            }
            StmtKind::For { body, .. } => find_targets(body, names),
            _ => {}
        }
    }
}
