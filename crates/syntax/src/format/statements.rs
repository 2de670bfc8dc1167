//! Prints items, and statements of models and plans.

use super::expressions::{POSTFIX, in_brackets, lacks_else};
use super::printer::{Printer, Share};
use crate::ast::*;
use crate::span::Spanned;
use crate::string::quote;
use std::sync::Arc;

impl Printer<'_> {
    /// Prints a whole file.
    pub fn program(&mut self, program: &Program) {
        self.lines(program.items.len(), |p, i| {
            program.items.get(i).map_or((), |item| p.item(item))
        });
    }

    fn name(&mut self, name: &Name) {
        self.token(&name.node);
    }

    fn string(&mut self, text: &Spanned<Arc<str>>) {
        self.token(&quote(&text.node));
    }

    fn item(&mut self, item: &Item) {
        match &item.kind {
            ItemKind::Include { path, alias } => {
                self.text("include ");
                self.string(path);
                self.maybe(" as ", alias.as_ref(), Self::name);
            }
            ItemKind::Param(declaration) => self.declaration("param ", declaration),
            ItemKind::Data(declaration) => self.declaration("data ", declaration),
            ItemKind::Fn(FnDecl { name, lambda }) => {
                self.text("fn ");
                self.name(name);
                return self.lambda(lambda);
            }
            ItemKind::Kernel(KernelDecl { name, params, body }) => {
                self.text("kernel ");
                self.name(name);
                self.params(params);
                self.text(" ");
                return self.plan(body);
            }
            ItemKind::Infer { name, body } => {
                self.text("infer ");
                if let Some(name) = name {
                    self.name(name);
                    self.text(" ");
                }
                return self.plan(body);
            }
            ItemKind::Report { exprs, file } => {
                self.text("report ");
                self.list(exprs, Self::expr);
                self.maybe(" as ", file.as_ref(), Self::string);
            }
            ItemKind::Export { expr, file } => {
                self.text("export ");
                self.expr(expr);
                self.text(" to ");
                self.string(file);
            }
            ItemKind::Stmt(stmt) => return self.stmt(stmt, false),
        }
        self.text(";");
    }

    fn declaration(
        &mut self,
        keyword: &str,
        Declaration { name, ty, default, help }: &Declaration,
    ) {
        self.text(keyword);
        self.name(name);
        self.maybe(": ", ty.as_ref(), Self::name);
        if default.is_some() {
            self.text(" ");
            self.stop();
        }
        self.group(|p| {
            p.maybe("= ", default.as_ref(), Self::expr);
            if let Some(help) = help {
                p.continued(|p| {
                    p.stop();
                    p.string(help);
                });
            }
        });
    }

    fn params(&mut self, params: &[Param]) {
        self.brackets(("(", "", ")"), params, Share::Nothing, |p, param| {
            p.name(&param.name);
            p.maybe(": ", param.ty.as_ref(), Self::name);
            p.maybe(" = ", param.default.as_ref(), Self::expr);
        });
    }

    /// Prints the parameters and body after `fn` or the name of a function.
    pub fn lambda(&mut self, lambda: &Lambda) {
        self.params(&lambda.params);
        self.text(" ");
        self.body(&lambda.body);
    }

    /// Prints the body of a function.
    pub fn body(&mut self, body: &Body) {
        let broken = self.opens_lines(!body.stmts.is_empty());
        self.blocks(broken, |p| p.body_lines(body));
    }

    /// Prints a body whose lines are broken if its enclosing group is.
    pub fn body_lines(&mut self, Body { stmts, result, .. }: &Body) {
        self.braces(stmts.len() + usize::from(result.is_some()), |p, i| {
            match (stmts.get(i), result) {
                (Some(stmt), _) => p.stmt(stmt, result.is_none() && i + 1 == stmts.len()),
                (None, Some(result)) => p.expr(result),
                (None, None) => {}
            }
        });
    }

    /// Prints a statement. `last` means that it ends a body without a value, so that a
    /// last `if` must not become the value.
    fn stmt(&mut self, stmt: &Stmt, last: bool) {
        match &stmt.kind {
            StmtKind::Assume { name, bind, expr, tags } => {
                self.text("assume ");
                self.binding(name, *bind, expr, tags);
            }
            StmtKind::Draw { target, dist, tags } => {
                self.operand(target, POSTFIX);
                self.bound("~ ", dist, tags);
            }
            StmtKind::Let { name, expr } => {
                self.text("let ");
                self.binding(name, Bind::Value, expr, &[]);
            }
            StmtKind::Observe { dist, value, coarse, name } => {
                self.text("observe ");
                self.group(|p| p.observed(dist, value, coarse.as_ref()));
                self.maybe(" as ", name.as_ref(), Self::name);
            }
            StmtKind::Predict { name, bind, expr } => {
                self.text("predict ");
                self.binding(name, *bind, expr, &[]);
            }
            StmtKind::Factor { expr, name } => {
                self.text("factor");
                self.text("(");
                self.expr(expr);
                self.text(")");
                self.maybe(" as ", name.as_ref(), Self::name);
            }
            StmtKind::Force { target, value } => self.pair("force ", target, " = ", value),
            StmtKind::Freeze(expr) => self.verb("freeze ", expr),
            StmtKind::Forget(expr) => self.verb("forget ", expr),
            StmtKind::Sample(expr) => self.verb("sample ", expr),
            StmtKind::For { var, iter, body } => {
                self.for_each(var, iter);
                return self
                    .block(body.len(), |p, i| body.get(i).map_or((), |stmt| p.stmt(stmt, false)));
            }
            StmtKind::Expr(expr) => return self.expr_stmt(expr, last),
        }
        self.text(";");
    }

    fn for_each(&mut self, var: &Name, iter: &Expr) {
        self.text("for ");
        self.name(var);
        self.text(" in ");
        self.expr(iter);
        self.text(" ");
    }

    /// Prints the parts of an observation. The value goes on a new line if there is no
    /// room, unless it is in brackets.
    fn observed(&mut self, dist: &Expr, value: &Expr, coarse: Option<&Expr>) {
        self.expr(dist);
        if in_brackets(value) {
            self.text(" = ");
            self.expr(value);
        } else {
            self.continued(|p| {
                p.stop();
                p.verb("= ", value);
            });
        }
        if let Some(coarse) = coarse {
            self.continued(|p| p.verb("with coarse = ", coarse));
        }
    }

    fn expr_stmt(&mut self, expr: &Expr, last: bool) {
        match &expr.kind {
            ExprKind::If { .. } if self.source.is_some() => {
                self.expr(expr);
                if self.next_is(";") == Some(true) {
                    self.text(";");
                }
            }
            ExprKind::If { .. } if lacks_else(expr) => self.if_else(expr, true),
            ExprKind::If { .. } if !last => self.expr(expr),
            _ => {
                self.expr(expr);
                self.text(";");
            }
        }
    }

    fn binding(&mut self, name: &Name, bind: Bind, expr: &Expr, tags: &[Tag]) {
        self.name(name);
        self.bound(if bind == Bind::Random { "~ " } else { "= " }, expr, tags);
    }

    /// Prints the part of a statement from `~` or `=` on.
    fn bound(&mut self, bind: &str, expr: &Expr, tags: &[Tag]) {
        self.text(" ");
        self.stop();
        self.text(bind);
        self.group(|p| {
            p.expr(expr);
            for tag in tags {
                p.continued(|p| {
                    p.stop();
                    p.text("#");
                    p.name(&tag.name);
                    p.maybe(":", tag.value.as_ref(), Self::expr);
                });
            }
        });
    }

    fn pair(&mut self, verb: &str, left: &Expr, between: &str, right: &Expr) {
        self.verb(verb, left);
        self.verb(between, right);
    }

    fn verb(&mut self, verb: &str, expr: &Expr) {
        self.text(verb);
        self.expr(expr);
    }

    fn plan(&mut self, body: &[KStmt]) {
        self.block(body.len(), |p, i| body.get(i).map_or((), |stmt| p.kstmt(stmt)));
    }

    fn kstmt(&mut self, stmt: &KStmt) {
        let mut counted = |word: &str, count: &Expr, body: &[KStmt]| {
            self.verb(word, count);
            self.text(" ");
            self.plan(body);
        };
        match &stmt.kind {
            KStmtKind::Warmup { count, body } => return counted("warmup ", count, body),
            KStmtKind::Repeat { count, body } => return counted("repeat ", count, body),
            KStmtKind::Every { count, body } => return counted("every ", count, body),
            KStmtKind::For { var, iter, body } => {
                self.for_each(var, iter);
                return self.plan(body);
            }
            KStmtKind::Mix(arms) => {
                self.text("mix ");
                return self.block(arms.len(), |p, i| arms.get(i).map_or((), |arm| p.arm(arm)));
            }
            KStmtKind::Expr(expr) => return self.expr_stmt(expr, false),
            KStmtKind::StopWhen(expr) => self.verb("stop when ", expr),
            KStmtKind::Collect(exprs) => {
                self.text("collect ");
                self.list(exprs, Self::expr);
            }
            KStmtKind::Propose { target, dist } => self.pair("propose ", target, " ~ ", dist),
            KStmtKind::Map { target, value } => self.pair("propose ", target, " = ", value),
            KStmtKind::Let { name, expr } => {
                self.text("let ");
                self.binding(name, Bind::Value, expr, &[]);
            }
        }
        self.text(";");
    }

    fn arm(&mut self, arm: &MixArm) {
        self.expr(&arm.weight);
        self.text(" ");
        self.stop();
        self.verb("=> ", &arm.kernel);
        self.text(";");
    }
}
