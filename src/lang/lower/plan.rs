//! Inference blocks, user kernels, reports and exports: all checks, and the lowering of
//! the model expressions in them.

use super::types::shown;
use super::{AddHint, Lowerer};
use crate::lang::builtins::{Kind, Type};
use crate::syntax::ast::{Arg, Expr, ExprKind, KStmt, KStmtKind};
use crate::syntax::span::Span;
use std::sync::Arc;

/// The context of a statement of an inference block.
#[derive(Clone, Default)]
struct Around {
    /// Variables of the block.
    names: Vec<Arc<str>>,
    in_loop: bool,
    in_warmup: bool,
    in_kernel: bool,
}

impl Lowerer<'_> {
    /// Checks everything except the model.
    pub fn inference(&mut self) {
        self.module = 0;
        for f in self.code.freezes.clone() {
            self.selection(&f, &[]);
        }
        for f in self.code.forces.clone() {
            self.address(&f.target, f.span, &[]);
        }
        for k in self.kernels.values().cloned().collect::<Vec<_>>() {
            let names = k.params.iter().map(|p| Arc::clone(&p.name.node)).collect();
            let mut around = Around { names, in_kernel: true, ..Around::default() };
            self.plan_body(&k.body, &mut around);
        }
        for p in self.plans.clone() {
            self.plan_body(&p.body, &mut Around::default());
        }
        for r in self.reports.clone() {
            r.exprs.iter().for_each(|e| self.reported(e));
        }
        for x in self.exports.clone() {
            self.reported(&x.expr);
        }
    }

    fn plan_body(&mut self, body: &[KStmt], around: &mut Around) {
        let depth = around.names.len();
        for s in body {
            self.plan_stmt(s, around);
        }
        around.names.truncate(depth);
    }

    fn plan_stmt(&mut self, s: &KStmt, around: &mut Around) {
        match &s.kind {
            KStmtKind::Warmup { count, body } => {
                if around.in_loop || around.in_kernel {
                    self.error(
                        "`warmup` is allowed only at the top level of an inference block",
                        s.span,
                        "inside a loop or kernel",
                    )
                    .hint_also("infer { warmup 1000 { … } repeat 1000 { … collect x; } }");
                }
                self.count(count, around);
                let mut inner = Around { in_loop: true, in_warmup: true, ..around.clone() };
                self.plan_body(body, &mut inner);
            }
            KStmtKind::Repeat { count, body } | KStmtKind::Every { count, body } => {
                if matches!(s.kind, KStmtKind::Every { .. }) && !around.in_loop {
                    self.error("`every` is allowed only in a loop", s.span, "not in a loop")
                        .hint_also("repeat 1000 { … every 10 { … } }");
                }
                self.count(count, around);
                let mut inner = Around { in_loop: true, ..around.clone() };
                self.plan_body(body, &mut inner);
            }
            KStmtKind::Mix(arms) => {
                for a in arms {
                    self.count(&a.weight, around);
                    self.kernel(&a.kernel, around);
                }
            }
            KStmtKind::For { var, iter, body } => {
                self.plan_expr(iter, around);
                let mut inner = around.clone();
                inner.names.push(Arc::clone(&var.node));
                inner.in_loop = true;
                self.plan_body(body, &mut inner);
            }
            KStmtKind::StopWhen(e) => {
                if !around.in_loop {
                    self.error(
                        "`stop when` is allowed only in a loop, which it ends",
                        s.span,
                        "not in a loop",
                    )
                    .hint_also("repeat 1000 { … stop when …; }");
                }
                self.plan_expr(e, around);
            }
            KStmtKind::Collect(exprs) => {
                if around.in_warmup {
                    self.error("draws in warm-up are discarded", s.span, "cannot collect here")
                        .hint_also("put `collect` into the `repeat` that follows");
                }
                for e in exprs {
                    if let ExprKind::Var(v) = &e.kind
                        && around.names.contains(v)
                    {
                        self.error(
                            format!("`{v}` is not a quantity of the model"),
                            e.span,
                            "a variable of this block",
                        );
                        continue;
                    }
                    self.query(e);
                }
            }
            KStmtKind::Propose { target, dist } => {
                if !around.in_kernel {
                    self.error("`propose` is allowed only in a kernel", s.span, "outside a kernel")
                        .hint_also("kernel name(…) { … propose @x ~ d; … }");
                }
                self.plan_expr(dist, around);
                match &target.kind {
                    // An auxiliary variable of a map.
                    ExprKind::Var(name) if around.in_kernel && !self.roots.contains(name) => {
                        around.names.push(Arc::clone(name))
                    }
                    _ => self.selection(target, &around.names.clone()),
                }
            }
            KStmtKind::Map { target, value } => {
                if !around.in_kernel {
                    self.error("`propose` is allowed only in a kernel", s.span, "outside a kernel")
                        .hint_also("kernel name(…) { … propose @x = e; … }");
                }
                self.selection(target, &around.names.clone());
                self.plan_expr(value, around);
            }
            KStmtKind::Let { name, expr } => {
                self.plan_expr(expr, around);
                around.names.push(Arc::clone(&name.node));
            }
            KStmtKind::Expr(e) => self.kernel(e, around),
        }
    }

    /// Checks a number of repetitions, or a weight.
    fn count(&mut self, e: &Expr, around: &Around) {
        match &e.kind {
            ExprKind::Str(_) | ExprKind::Bool(_) | ExprKind::Array(_) | ExprKind::Record(_) => {
                let got = match &e.kind {
                    ExprKind::Str(_) => Type::Str,
                    ExprKind::Bool(_) => Type::Bool,
                    ExprKind::Array(_) => Type::Array,
                    _ => Type::Record,
                };
                let label = format!("this is {}", shown(got));
                self.error(format!("expected a number, got {}", shown(got)), e.span, label);
            }
            _ => self.plan_expr(e, around),
        }
    }

    /// Checks a kernel applied to a selection.
    fn kernel(&mut self, e: &Expr, around: &Around) {
        let ExprKind::Call { callee, args } = &e.kind else {
            self.error("expected a kernel", e.span, "not a call of a kernel")
                .hint_also("for example mh(one(@**)); or drift($tag);");
            return;
        };
        let ExprKind::Var(name) = &callee.kind else {
            self.error("expected a kernel", callee.span, "not the name of a kernel");
            return;
        };
        if let Some(k) = self.kernels.get(name).cloned() {
            let required = k.params.iter().filter(|p| p.default.is_none()).count();
            if args.len() < required || args.len() > k.params.len() {
                let takes = match k.params.len() {
                    0 => "no arguments".to_owned(),
                    1 => "1 argument".to_owned(),
                    n => format!("{n} arguments"),
                };
                let message = format!("the kernel `{name}` takes {takes}, got {}", args.len());
                self.error(message, e.span, "in this call").point_at(k.name.span, "declared here");
            }
            for a in args {
                self.plan_expr(&a.value, around);
            }
            return;
        }
        let table = Arc::clone(&self.code.builtins);
        match table.find("", name).map(|i| table.get(i)) {
            Some(b) if matches!(b.kind, Kind::Inference) => {
                if b.returns != Type::Kernel {
                    self.error(
                        format!("`{name}` is not a kernel"),
                        callee.span,
                        format!("it returns {}", shown(b.returns)),
                    );
                    return;
                }
                if &**name == "init" && around.in_loop {
                    self.error(
                        "`init` is allowed only at the top level of an inference block",
                        e.span,
                        "inside a loop",
                    )
                    .hint_also("infer { init(best_of(100)); repeat 1000 { … } }");
                }
                if &**name == "anneal" && !around.in_warmup {
                    self.error(
                        "`anneal` is allowed only in `warmup`",
                        e.span,
                        "draws are kept here",
                    )
                    .hint_also("draws must be collected under the unmodified likelihood");
                }
                self.inference_args(b, args, e.span, around);
            }
            found => {
                let other = match found.map(|b| b.kind) {
                    Some(Kind::Distribution(_)) => Some("a distribution"),
                    Some(_) => Some("a function"),
                    None => {
                        self.modules[0].names.contains_key(name).then_some("a name of the model")
                    }
                };
                let known = table
                    .iter()
                    .filter(|b| {
                        matches!(b.kind, Kind::Inference)
                            && b.returns == Type::Kernel
                            && b.name != "prior"
                    })
                    .map(|b| &*b.name);
                let own: Vec<Arc<str>> = self.kernels.keys().cloned().collect();
                let near = crate::diag::nearest(name, known.chain(own.iter().map(|n| &**n)))
                    .map(str::to_owned);
                let message = match other {
                    Some(what) => format!("expected a kernel, but `{name}` is {what}"),
                    None => format!("unknown kernel `{name}`"),
                };
                let e = self.error(message, callee.span, "not a kernel");
                match near {
                    Some(n) => e.hint_also(format!("did you mean `{n}`?")),
                    None => e.hint_also(
                        "kernels are mh, block, drift, gibbs, elliptical; see `pcadlang doc`",
                    ),
                }
            }
        }
    }

    /// Checks the arguments of a built-in of inference blocks, by their types.
    fn inference_args(
        &mut self,
        b: &crate::lang::builtins::Builtin,
        args: &[Arg],
        span: Span,
        around: &Around,
    ) {
        let order = match b.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node))) {
            Ok(order) => order,
            Err(message) => {
                let e = self.mismatch(b, message, args, span);
                if args.is_empty() && b.args.first().is_some_and(|a| a.ty == Type::Selection) {
                    e.hints.clear();
                    e.hint_also(format!("the selection comes first: {}(@**)", b.name));
                }
                return;
            }
        };
        for (p, from) in order.iter().enumerate() {
            let (Some(j), Some(arg)) = (from, b.args.get(p)) else { continue };
            let value = &args[*j].value;
            match arg.ty {
                Type::Selection => self.selection(value, &around.names.clone()),
                Type::Kernel => self.kernel_or_start(&b.name, value, around),
                Type::Num | Type::Int | Type::Nums
                    if matches!(
                        value.kind,
                        ExprKind::Address(_) | ExprKind::TagSel { .. } | ExprKind::Str(_)
                    ) =>
                {
                    let message = format!("{}: `{}` must be {}", b.name, arg.name, shown(arg.ty));
                    let label = if matches!(value.kind, ExprKind::Str(_)) {
                        "this is a string"
                    } else {
                        "a selection"
                    };
                    self.error(message, value.span, label).hint_also(b.signature());
                }
                _ => self.plan_expr(value, around),
            }
        }
    }

    fn kernel_or_start(&mut self, outer: &str, e: &Expr, around: &Around) {
        if outer == "delayed"
            && let ExprKind::Call { callee, .. } = &e.kind
            && let ExprKind::Var(inner) = &callee.kind
            && ["temper", "smc", "abc", "optimize"].contains(&&**inner)
        {
            self.error(
                format!("`delayed` does not take `{inner}`"),
                e.span,
                "not a reversible move of one state",
            )
            .hint_also("for example delayed(drift(@x), @obs)");
        }
        if outer != "init" {
            return self.kernel(e, around);
        }
        match &e.kind {
            ExprKind::Call { callee, args } if matches!(&callee.kind, ExprKind::Var(n) if &**n == "prior" || &**n == "best_of") =>
            {
                let ExprKind::Var(n) = &callee.kind else { return };
                if let Some(i) = self.code.builtins.find("", n) {
                    let table = Arc::clone(&self.code.builtins);
                    let b = table.get(i);
                    self.inference_args(b, args, e.span, around);
                }
            }
            _ => {
                self.error("`init` takes prior() or best_of(n)", e.span, "not a start").hint_also(
                    "init(best_of(100)); starts at the best of 100 draws from the prior",
                );
            }
        }
    }

    /// Checks an expression that the inference block itself evaluates: its names must be
    /// known.
    fn plan_expr(&mut self, e: &Expr, around: &Around) {
        match &e.kind {
            ExprKind::Var(name) => {
                let known = around.names.contains(name)
                    || self.modules[0].names.contains_key(name)
                    || self.code.builtins.constant(name).is_some();
                if !known {
                    self.unbound(name, e.span);
                }
            }
            ExprKind::Address(_) | ExprKind::TagSel { .. } => {
                self.selection(e, &around.names.clone())
            }
            ExprKind::Array(xs) => xs.iter().for_each(|x| self.plan_expr(x, around)),
            ExprKind::Record(fields) => fields.iter().for_each(|(_, x)| self.plan_expr(x, around)),
            ExprKind::Call { callee, args } => {
                if let ExprKind::Var(name) = &callee.kind {
                    let table = Arc::clone(&self.code.builtins);
                    let found = table.find("", name).map(|i| table.get(i));
                    match found {
                        Some(b) if matches!(b.kind, Kind::Inference) => {
                            return self.inference_args(b, args, e.span, around);
                        }
                        Some(b) => {
                            if let Err(message) = b
                                .match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node)))
                            {
                                self.mismatch(b, message, args, e.span);
                            }
                        }
                        None if self.modules[0].names.contains_key(name) => {}
                        None => self.unbound(name, callee.span),
                    }
                }
                args.iter().for_each(|a| self.plan_expr(&a.value, around));
            }
            ExprKind::Index { base, index } => {
                self.plan_expr(base, around);
                self.plan_expr(index, around);
            }
            ExprKind::Field { base, .. } => self.plan_expr(base, around),
            ExprKind::Unary { expr, .. } => self.plan_expr(expr, around),
            ExprKind::Binary { left, right, .. } => {
                self.plan_expr(left, around);
                self.plan_expr(right, around);
            }
            ExprKind::If { cond, then, otherwise } => {
                self.plan_expr(cond, around);
                for body in [then, otherwise] {
                    match (&body.stmts[..], &body.result) {
                        ([], Some(result)) => self.plan_expr(result, around),
                        _ => self.not_in_a_plan(e.span),
                    }
                }
            }
            ExprKind::Lambda(_) => self.not_in_a_plan(e.span),
            ExprKind::Num(_) | ExprKind::Str(_) | ExprKind::Bool(_) | ExprKind::Error => {}
        }
    }

    fn not_in_a_plan(&mut self, span: Span) {
        self.error(
            "this expression cannot be used in an inference block",
            span,
            "a function, or statements",
        )
        .hint_also("bind it in the model, let name = …;, and use the name here");
    }

    /// Lowers an expression of the model, recorded with every draw, to a slot of the top
    /// level.
    fn query(&mut self, e: &Expr) {
        if let ExprKind::Call { callee, args } = &e.kind
            && let ExprKind::Var(name) = &callee.kind
            && let Some(i) = self.code.builtins.find("", name)
            && matches!(self.code.builtins.get(i).kind, Kind::Inference)
        {
            let _ = args;
            self.error(
                format!("`{name}` is no quantity of the model"),
                e.span,
                "cannot be collected",
            )
            .hint_also("collect names of the model and expressions of them, log_joint() included");
            return;
        }
        let label: Arc<str> = Arc::from("query");
        let roots = self.roots.clone();
        let value = self.below(&label, |l| l.expr(e));
        self.roots = roots;
        self.code.queries.insert(e.span, value.at);
    }

    /// Checks `summary(@x)`, `best(view)`, or an expression of the model.
    fn reported(&mut self, e: &Expr) {
        if let ExprKind::Call { callee, args } = &e.kind
            && let ExprKind::Var(name) = &callee.kind
            && let Some(i) = self.code.builtins.find("", name)
        {
            let table = Arc::clone(&self.code.builtins);
            let b = table.get(i);
            if matches!(b.kind, Kind::Inference) {
                match b.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node))) {
                    Err(message) => {
                        self.mismatch(b, message, args, e.span);
                    }
                    Ok(order) => {
                        for (p, j) in order.iter().enumerate() {
                            let (Some(j), Some(arg)) = (j, b.args.get(p)) else { continue };
                            match arg.ty {
                                Type::Selection => self.selection(&args[*j].value, &[]),
                                _ => self.query(&args[*j].value),
                            }
                        }
                    }
                }
                return;
            }
        }
        self.query(e);
    }
}
