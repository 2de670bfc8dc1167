//! Statements of the model.

use super::lowerer::{Lowerer, Typed};
use super::scope::{Meaning, Scope, ScopeKind};
use super::types::shown;
use crate::lang::builtins::Type;
use crate::lang::code::{BlockKind, DistSpec, Force, Op, Operand, SiteTag};
use crate::lang::value::Value;
use pcadlang_syntax::ast::{Bind, Body, Expr, ExprKind, Name, Stmt, StmtKind, Tag};
use std::sync::Arc;

impl Lowerer<'_> {
    /// Lowers a body's statements and returns its value.
    pub fn body_of(&mut self, body: &Body) -> Option<Typed> {
        for s in &body.stmts {
            self.stmt(s);
        }
        body.result.as_ref().map(|e| self.expr(e))
    }

    pub fn stmt(&mut self, s: &Stmt) {
        let at_root = self.scopes.len() == 1;
        match &s.kind {
            StmtKind::Assume { name, bind, expr, tags } => {
                let value = match bind {
                    Bind::Random => self.named_draw(name, expr, tags),
                    Bind::Value => {
                        let tags = self.constant_tags(tags);
                        self.with_tags(tags, |l| l.below(&name.node, |l| l.expr(expr)))
                    }
                };
                self.bind_value(name, value);
                if at_root {
                    self.recorded(&name.node, value.at);
                }
            }
            StmtKind::Predict { name, bind, expr } => {
                let value = match bind {
                    Bind::Random => self.named_draw(name, expr, &[]),
                    Bind::Value => self.below(&name.node, |l| l.expr(expr)),
                };
                self.bind_value(name, value);
                if at_root {
                    let global = self.global_name(name);
                    self.code.predictions.push((global, value.at));
                } else {
                    self.error(
                        "`predict` is allowed only at the top level",
                        s.span,
                        "inside a function or loop",
                    )
                    .hint_also("return the value and predict the result of the call");
                }
            }
            StmtKind::Draw { target, dist, tags } => match &target.kind {
                ExprKind::Var(name) => {
                    let name = Name::new(Arc::clone(name), target.span);
                    let value = self.named_draw(&name, dist, tags);
                    self.bind_value(&name, value);
                    if at_root {
                        self.recorded(&name.node, value.at);
                    }
                }
                _ => self.keyed_draw(target, dist, tags),
            },
            StmtKind::Let { name, expr } => {
                let value = self.below(&name.node, |l| l.expr_named(expr, &name.node));
                self.bind_value(name, value);
            }
            StmtKind::Observe { dist, value, coarse, name } => {
                let spec = self.dist_spec(dist, true);
                let observed = self.expr(value);
                let coarse = coarse.as_ref().map(|e| {
                    let c = self.expr(e);
                    self.check_observable(c, e);
                    c.at
                });
                let label = name.as_ref().map_or_else(|| Arc::from("obs"), |n| Arc::clone(&n.node));
                let site = self.site(&label, Vec::new(), 0);
                self.push(Op::Observe { dist: spec, value: observed.at, coarse, site }, dist.span);
            }
            StmtKind::Factor { expr, name } => {
                let weight = self.expr(expr);
                self.check_type(weight, Type::Num, expr.span, "the log weight of a factor");
                let label =
                    name.as_ref().map_or_else(|| Arc::from("factor"), |n| Arc::clone(&n.node));
                let site = self.site(&label, Vec::new(), 0);
                self.push(Op::Factor { weight: weight.at, site }, expr.span);
            }
            StmtKind::Force { target, value } => {
                let value = self.expr(value);
                match &target.kind {
                    _ if !at_root => {
                        self.error(
                            "`force` is allowed only at the top level",
                            s.span,
                            "inside a function or loop",
                        );
                    }
                    ExprKind::Address(a) => {
                        self.code.forces.push(Force {
                            target: a.clone(),
                            value: value.at,
                            span: target.span,
                        });
                    }
                    _ => {
                        self.error("`force` takes an address", target.span, "not an address")
                            .hint_also("write it with an @, e.g. force @x = 1;");
                    }
                }
            }
            StmtKind::Freeze(sel) => {
                if at_root {
                    self.freezes.push(sel.clone());
                    self.code.has_freezes = true;
                } else {
                    self.error(
                        "`freeze` is allowed only at the top level",
                        s.span,
                        "inside a function or loop",
                    );
                }
            }
            StmtKind::Forget(_) => {
                self.error(
                    "`forget` is allowed only at the top level",
                    s.span,
                    "inside a function or loop",
                );
            }
            StmtKind::Sample(e) => {
                let label: Arc<str> = Arc::from("sample");
                let value = self.below(&label, |l| l.expr(e));
                if at_root {
                    self.code.samples.push(value.at);
                } else {
                    self.error(
                        "`sample` is allowed only at the top level",
                        s.span,
                        "inside a function or loop",
                    );
                }
            }
            StmtKind::For { var, iter, body } => self.for_loop(var, iter, body, s),
            StmtKind::Expr(e) => {
                self.expr(e);
            }
        }
    }

    /// Records a name of the main program with every draw, unless its plan determines
    /// what to collect.
    pub fn recorded(&mut self, name: &Arc<str>, value: Operand) {
        if self.modules[self.module].prefix.is_none() {
            self.code.assumed.push((Arc::clone(name), value));
        }
    }

    fn for_loop(&mut self, var: &Name, iter: &Expr, body: &[Stmt], s: &Stmt) {
        let over = self.expr(iter);
        if !matches!(over.ty, Type::Any | Type::Array | Type::Nums | Type::Record) {
            let message = format!(
                "`for` iterates over an array, a range or a record, not over {}",
                shown(over.ty)
            );
            let e = self.error(message, iter.span, format!("this is {}", shown(over.ty)));
            if matches!(over.ty, Type::Num | Type::Int) {
                e.hint_also("a range of whole numbers is written 0 .. n");
            }
        }
        self.declare_containers(std::slice::from_ref(s));
        let block = self.new_block(BlockKind::Loop);
        let at = self.push(Op::For { iter: over.at, body: block }, s.span);
        self.scopes.push(Scope::new(block, ScopeKind::Loop { var: Arc::clone(&var.node), at }));
        let item = self.push(Op::Item, var.span);
        self.bind(var, Meaning::Value(Operand::Local(item)), Type::Any);
        for inner in body {
            self.stmt(inner);
        }
        self.scopes.pop();
    }

    /// Lowers a distribution: a direct call of a family, or a value.
    pub fn dist_spec(&mut self, e: &Expr, observed: bool) -> DistSpec {
        if let Some((builtin, args)) = self.family_call(e) {
            // A node of its own keeps the factor of the matrix.
            if self.has_covariance(builtin) {
                let made = self.push(Op::Prim { builtin, args }, e.span);
                return DistSpec::Value(Operand::Local(made));
            }
            return DistSpec::Family { builtin, args };
        }
        let value = self.expr(e);
        if observed {
            self.check_observable(value, e);
        } else {
            self.check_drawable(value, e);
        }
        DistSpec::Value(value.at)
    }

    fn check_observable(&mut self, v: Typed, e: &Expr) {
        if !matches!(v.ty, Type::Any | Type::Dist | Type::Likelihood) {
            let message =
                format!("only a distribution or likelihood can be observed, not {}", shown(v.ty));
            self.error(message, e.span, format!("this is {}", shown(v.ty)))
                .hint_also("write `observe d = v;`: the distribution on the left, the observed value on the right");
        }
    }

    fn check_drawable(&mut self, v: Typed, e: &Expr) {
        match v.ty {
            Type::Any | Type::Dist => {}
            Type::Likelihood => {
                self.error("a likelihood cannot be drawn from", e.span, "this is a likelihood")
                    .hint_also(
                        "it scores an observed value and has no sampler: use it in `observe`",
                    );
            }
            ty => {
                let message = format!("`~` needs a distribution, got {}", shown(ty));
                self.error(message, e.span, format!("this is {}", shown(ty)))
                    .hint_also("use `=` to bind a value: `let x = …;` or `assume x = …;`");
            }
        }
    }

    /// Lowers the tags of a choice; their values may be variables in scope.
    pub fn tags(&mut self, tags: &[Tag]) -> Vec<SiteTag> {
        tags.iter()
            .map(|t| {
                let name = self.tag_index(&t.name.node);
                let value = t.value.as_ref().map(|e| self.tag_value(e));
                SiteTag { name, value }
            })
            .collect()
    }

    /// Lowers a tag's value: a bound name is that variable, and any other word is a
    /// string.
    fn tag_value(&mut self, e: &Expr) -> Operand {
        match &e.kind {
            ExprKind::Var(word) if self.lookup(word).is_none() => {
                self.code.constant(Value::Str(Arc::clone(word)))
            }
            _ => self.expr(e).at,
        }
    }

    /// Lowers the tags of an `assume`: its choices may be anywhere below, so values must
    /// be literals.
    fn constant_tags(&mut self, tags: &[Tag]) -> Vec<SiteTag> {
        let made = self.tags(tags);
        for (t, tag) in made.iter().zip(tags) {
            if let Some(o) = t.value
                && !matches!(o, Operand::Const(_))
            {
                self.error(
                    "the tag of an `assume x = …` needs a literal value",
                    tag.span,
                    "this is computed",
                )
                .hint_also("put the tag on the draw itself");
            }
        }
        made.into_iter().filter(|t| matches!(t.value, None | Some(Operand::Const(_)))).collect()
    }
}
