//! Inference blocks, declared kernels, reports and exports: all checks, and their
//! compilation to [plans](crate::lang::plan).

use super::hints::former;
use super::lowerer::{Lowerer, PlanScope};
use super::types::shown;
use crate::lang::builtins::{self, Builtin, KernelTraits, Kind, PlanForm, Type};
use crate::lang::code::Operand;
use crate::lang::plan::{
    Argument, BestOf, Callee, Choices, DeclaredKernel, Formula, Init, KernelCall, Path,
    PathSegment, Pick, Plan, Selection, Step, StepKind,
};
use pcadlang_syntax::ast::{Arg, Expr, ExprKind, KStmt, KStmtKind, KernelDecl, Param};
use pcadlang_syntax::print_expr;
use pcadlang_syntax::span::{Span, Spanned};
use smallvec::SmallVec;
use std::sync::Arc;

impl Lowerer<'_> {
    /// Checks everything except the model, and compiles the plans and declared kernels.
    pub fn inference(&mut self) -> Arc<[DeclaredKernel]> {
        self.module = 0;
        let top = PlanScope::default();
        let freezes = std::mem::take(&mut self.freezes);
        let freezes = freezes.iter().map(|f| self.selection(f, &top)).collect::<Arc<[_]>>();
        for f in self.code.forces.clone() {
            self.address(&f.target, f.span);
            Path::read(&f.target, f.span, &mut |key| self.formula(key, &top));
        }
        let kernels = self.kernels.values().cloned().collect::<Vec<_>>();
        let kernels = kernels.iter().map(|k| self.declared_kernel(k)).collect::<Arc<[_]>>();
        for (name, body) in std::mem::take(&mut self.blocks) {
            let steps = self.plan_body(&body, &mut PlanScope::default());
            let (kernels, freezes) = (Arc::clone(&kernels), Arc::clone(&freezes));
            self.plans.push(Arc::new(Plan { name, steps, kernels, freezes }));
        }
        for r in self.reports.clone() {
            r.exprs.iter().for_each(|e| self.reported(e));
        }
        for x in self.exports.clone() {
            self.reported(&x.expr);
        }
        kernels
    }

    fn declared_kernel(&mut self, k: &KernelDecl) -> DeclaredKernel {
        let top = PlanScope::default();
        let param = |p: &Param| {
            let default = p.default.as_ref().map(|e| self.formula(e, &top));
            (Arc::clone(&p.name.node), default)
        };
        let params: Box<[_]> = k.params.iter().map(param).collect();
        let names = k.params.iter().map(|p| Arc::clone(&p.name.node)).collect();
        let mut around = PlanScope { names, in_kernel: true, ..PlanScope::default() };
        let steps = self.plan_body(&k.body, &mut around);
        let draws = |s: &StepKind| matches!(s, StepKind::Propose(..) | StepKind::Draw(..));
        let map = |s: &StepKind| matches!(s, StepKind::Map(..) | StepKind::MapDrawn(..));
        let maps = steps.iter().any(|s| s.any(&map));
        let proposes = maps || steps.iter().any(|s| s.any(&draws));
        DeclaredKernel { name: k.name.clone(), params, steps, proposes, maps }
    }

    pub(super) fn plan_body(&mut self, body: &[KStmt], around: &mut PlanScope) -> Box<[Step]> {
        let depth = around.names.len();
        let step = |s: &KStmt| Some(Step { kind: self.plan_stmt(s, around)?, span: s.span });
        let steps = body.iter().filter_map(step).collect();
        around.names.truncate(depth);
        steps
    }

    /// Compiles a statement; `None` if it is wrong.
    fn plan_stmt(&mut self, s: &KStmt, around: &mut PlanScope) -> Option<StepKind> {
        Some(match &s.kind {
            KStmtKind::Warmup { count, body } => {
                if around.in_loop || around.in_kernel {
                    self.error(
                        "`warmup` is allowed only at the top level of an inference block",
                        s.span,
                        "inside a loop or kernel",
                    )
                    .hint_also("infer { warmup 1000 { … } repeat 1000 { … collect x; } }");
                }
                let count = self.count(count, around);
                let mut inner = PlanScope { in_loop: true, in_warmup: true, ..around.clone() };
                StepKind::Warmup(count, self.plan_body(body, &mut inner))
            }
            KStmtKind::Repeat { count, body } => {
                let count = self.count(count, around);
                let mut inner = PlanScope { in_loop: true, ..around.clone() };
                StepKind::Repeat(count, self.plan_body(body, &mut inner))
            }
            KStmtKind::Every { count, body } => {
                if !around.in_loop {
                    self.error("`every` is allowed only in a loop", s.span, "not in a loop")
                        .hint_also("repeat 1000 { … every 10 { … } }");
                }
                let count = self.count(count, around);
                StepKind::Every(count, self.plan_body(body, around))
            }
            KStmtKind::Mix(arms) => {
                let mut compiled = Vec::with_capacity(arms.len());
                for a in arms {
                    let weight = self.count(&a.weight, around);
                    if let Some(kind) = self.kernel(&a.kernel, around) {
                        compiled.push((weight, Step { kind, span: a.kernel.span }));
                    }
                }
                StepKind::Mix(compiled.into())
            }
            KStmtKind::For { var, iter, body } => {
                let items = self.formula(iter, around);
                let mut inner = PlanScope { in_loop: true, ..around.clone() };
                let var = inner.bind(&var.node);
                StepKind::For(items, var, self.plan_body(body, &mut inner))
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
                StepKind::StopWhen(self.formula(e, around))
            }
            KStmtKind::Collect(exprs) => {
                if around.in_warmup {
                    self.error("draws in warm-up are discarded", s.span, "cannot collect here")
                        .hint_also("put `collect` into the `repeat` that follows");
                }
                StepKind::Collect(exprs.iter().filter_map(|e| self.column(e, around)).collect())
            }
            KStmtKind::Propose { target, dist } => {
                if !around.in_kernel {
                    self.error("`propose` is allowed only in a kernel", s.span, "outside a kernel")
                        .hint_also("kernel name(…) { … propose @x ~ d; … }");
                }
                let dist = self.formula(dist, around);
                match &target.kind {
                    // An auxiliary variable of a map.
                    ExprKind::Var(name) if around.in_kernel && !self.roots.contains(name) => {
                        let variable = around.bind(name);
                        let name = Spanned::new(name.clone(), target.span);
                        StepKind::Draw(name, variable, dist)
                    }
                    _ => StepKind::Propose(self.choice(target, around), dist),
                }
            }
            KStmtKind::Map { target, value } => {
                if !around.in_kernel {
                    self.error("`propose` is allowed only in a kernel", s.span, "outside a kernel")
                        .hint_also("kernel name(…) { … propose @x = e; … }");
                }
                match &target.kind {
                    ExprKind::Var(name) if around.names.contains(name) => {
                        let name = Spanned::new(name.clone(), target.span);
                        StepKind::MapDrawn(name, self.formula(value, around))
                    }
                    _ => {
                        let target = self.choice(target, around);
                        StepKind::Map(target, self.formula(value, around))
                    }
                }
            }
            KStmtKind::Let { name, expr } => {
                let value = self.formula(expr, around);
                StepKind::Let(around.bind(&name.node), value)
            }
            KStmtKind::Expr(e) => self.kernel(e, around)?,
        })
    }

    /// Compiles a number of repetitions, or a weight.
    fn count(&mut self, e: &Expr, around: &PlanScope) -> Formula {
        let got = match &e.kind {
            ExprKind::Str(_) => Type::Str,
            ExprKind::Bool(_) => Type::Bool,
            ExprKind::Array(_) => Type::Array,
            ExprKind::Record(_) => Type::Record,
            _ => return self.formula(e, around),
        };
        let label = format!("this is {}", shown(got));
        self.error(format!("expected a number, got {}", shown(got)), e.span, label);
        Formula::constant(Default::default(), e.span)
    }

    /// Compiles a kernel applied to a selection, or another statement that has the form
    /// of a call.
    fn kernel(&mut self, e: &Expr, around: &PlanScope) -> Option<StepKind> {
        let ExprKind::Call { callee, args } = &e.kind else {
            self.error("expected a kernel", e.span, "not a call of a kernel")
                .hint_also("for example mh(one(@**)); or drift($tag);");
            return None;
        };
        let ExprKind::Var(name) = &callee.kind else {
            self.error("expected a kernel", callee.span, "not the name of a kernel");
            return None;
        };
        let varying = self.varying;
        if let Some((i, _, k)) = self.kernels.get_full(name) {
            let k = k.clone();
            let args = self.declared_args(&k, args, e, around);
            return Some(StepKind::Apply(self.kernel_call(e, Callee::Declared(i), args, varying)));
        }
        let table = Arc::clone(&self.code.builtins);
        let Some((i, what)) = self.inference_name(name) else {
            self.no_kernel(name, callee.span);
            return None;
        };
        let b = table.get(i);
        if b.returns != Type::Kernel {
            self.error(
                format!("`{name}` is not a kernel"),
                callee.span,
                format!("it returns {}", shown(b.returns)),
            );
            return None;
        }
        if what == PlanForm::Init && around.in_loop {
            self.error(
                "`init` is allowed only at the top level of an inference block",
                e.span,
                "inside a loop",
            )
            .hint_also("infer { init(best_of(100)); repeat 1000 { … } }");
        }
        if what == PlanForm::Anneal && !around.in_warmup {
            self.error("`anneal` is allowed only in `warmup`", e.span, "draws are kept here")
                .hint_also("draws must be collected under the unmodified likelihood");
        }
        if what == PlanForm::Init {
            let start = self.matched(b, args, e.span)?.first().copied().flatten()?;
            return self.start(&args[start].value, around);
        }
        let args = self.inference_args(b, args, e.span, around)?;
        match (what, args) {
            (PlanForm::Anneal, args) => match args.into_iter().next()? {
                Argument::Value(from) => Some(StepKind::Anneal(from)),
                _ => None,
            },
            (_, args) => {
                Some(StepKind::Apply(self.kernel_call(e, Callee::Builtin(i), args, varying)))
            }
        }
    }

    /// A call of a kernel; `varying` expressions came before its arguments.
    fn kernel_call(
        &mut self,
        e: &Expr,
        kernel: Callee,
        args: Box<[Argument]>,
        varying: usize,
    ) -> KernelCall {
        self.calls += 1;
        let (index, text, span) = (self.calls - 1, print_expr(e).into(), e.span);
        KernelCall { index, text, span, kernel, args, is_constant: varying == self.varying }
    }

    /// Compiles the arguments of a kernel that the program declares.
    fn declared_args(
        &mut self,
        k: &KernelDecl,
        args: &[Arg],
        e: &Expr,
        around: &PlanScope,
    ) -> Box<[Argument]> {
        let required = k.params.iter().filter(|p| p.default.is_none()).count();
        if args.len() < required || args.len() > k.params.len() {
            let takes = match k.params.len() {
                0 => "no arguments".to_owned(),
                1 => "1 argument".to_owned(),
                n => format!("{n} arguments"),
            };
            let message = format!("the kernel `{}` takes {takes}, got {}", k.name.node, args.len());
            self.error(message, e.span, "in this call").point_at(k.name.span, "declared here");
        }
        let given = args.iter().map(|a| self.formula(&a.value, around)).collect::<Vec<_>>();
        let of = |(i, p): (usize, &Param)| {
            let named = |a: &Arg| a.name.as_ref().is_some_and(|n| n.node == p.name.node);
            let place = args.iter().position(named);
            let here = || args.get(i).is_some_and(|a| a.name.is_none()).then_some(i);
            let place = place.or_else(here);
            place.map_or(Argument::Omitted, |i| Argument::Value(given[i].clone()))
        };
        k.params.iter().enumerate().map(of).collect()
    }

    /// The built-in of inference blocks with this name, by its index in the table.
    fn inference_name(&self, name: &str) -> Option<(u32, PlanForm)> {
        let i = self.code.builtins.find("", name)?;
        match self.code.builtins.get(i).kind {
            Kind::Plan(what) => Some((i, what)),
            _ => None,
        }
    }

    /// Reports a call of something that is not a kernel.
    fn no_kernel(&mut self, name: &Arc<str>, span: Span) {
        let table = Arc::clone(&self.code.builtins);
        let other = match table.find("", name).map(|i| table.get(i).kind) {
            Some(Kind::Distribution(_)) => Some("a distribution"),
            Some(_) => Some("a function"),
            None => self.modules[0].names.contains_key(name).then_some("a name of the model"),
        };
        let is_kernel = |b: &&Builtin| {
            matches!(b.kind, Kind::Plan(what) if what != PlanForm::Prior)
                && b.returns == Type::Kernel
        };
        let known = table.iter().filter(is_kernel).map(|b| &*b.name);
        let some: Vec<&str> = table.iter().filter(is_kernel).map(|b| &*b.name).take(5).collect();
        let own: Vec<Arc<str>> = self.kernels.keys().cloned().collect();
        let near = pcadlang_syntax::diag::nearest(name, known.chain(own.iter().map(|n| &**n)));
        let message = match other {
            Some(what) => format!("expected a kernel, but `{name}` is {what}"),
            None => format!("unknown kernel `{name}`"),
        };
        let hint = match near {
            _ if former(name).is_some() => former(name).unwrap_or_default().to_owned(),
            Some(n) => format!("did you mean `{n}`?"),
            None => format!("kernels are {}; see `pcadlang doc`", some.join(", ")),
        };
        self.error(message, span, "not a kernel").hint_also(hint);
    }

    /// Matches arguments to the parameters of a built-in of inference blocks.
    fn matched(
        &mut self,
        b: &Builtin,
        args: &[Arg],
        span: Span,
    ) -> Option<SmallVec<[Option<usize>; 8]>> {
        match b.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node))) {
            Ok(order) => Some(order),
            Err(message) => {
                let e = self.mismatch(b, message, args, span);
                if args.is_empty() && b.args.first().is_some_and(|a| a.ty == Type::Selection) {
                    e.hints.clear();
                    e.hint_also(format!("the selection comes first: {}(@**)", b.name));
                }
                None
            }
        }
    }

    /// Compiles the arguments of a built-in of inference blocks, by their types.
    pub(super) fn inference_args(
        &mut self,
        b: &Builtin,
        args: &[Arg],
        span: Span,
        around: &PlanScope,
    ) -> Option<Box<[Argument]>> {
        let order = self.matched(b, args, span)?;
        let of = |(from, arg): (&Option<usize>, &builtins::Argument)| {
            let Some(value) = from.map(|j| &args[j].value) else { return Argument::Omitted };
            match arg.ty {
                Type::Selection => Argument::Choices(self.choices(value, around)),
                Type::Kernel => self.inner_kernel(b, value, around),
                Type::Num | Type::Int | Type::Nums
                    if matches!(
                        value.kind,
                        ExprKind::Address(_) | ExprKind::TagSel { .. } | ExprKind::Str(_)
                    ) =>
                {
                    let message = format!("{}: `{}` must be {}", b.name, arg.name, shown(arg.ty));
                    let is_text = matches!(value.kind, ExprKind::Str(_));
                    let label = if is_text { "this is a string" } else { "a selection" };
                    self.error(message, value.span, label).hint_also(b.signature());
                    Argument::Omitted
                }
                _ => Argument::Value(self.formula(value, around)),
            }
        };
        Some(order.iter().zip(b.args.iter()).map(of).collect())
    }

    /// Compiles the argument of a kernel that applies another one.
    fn inner_kernel(&mut self, outer: &Builtin, e: &Expr, around: &PlanScope) -> Argument {
        let traits = |what| match what {
            Kind::Plan(PlanForm::Kernel(traits)) => traits,
            _ => KernelTraits::default(),
        };
        if let Some(example) = traits(outer.kind).of_reversible
            && let Some((name, _)) = call(e).filter(|(name, _)| !self.kernels.contains_key(*name))
            && let Some((i, _)) = self.inference_name(name)
            && traits(self.code.builtins.get(i).kind).irreversible
        {
            self.error(
                format!("`{}` does not take `{name}`", outer.name),
                e.span,
                "not a reversible move of one state",
            )
            .hint_also(format!("for example {example}"));
        }
        match self.kernel(e, around) {
            Some(StepKind::Apply(call)) => Argument::Kernel(call),
            _ => Argument::Omitted,
        }
    }

    /// Compiles what `init` takes.
    fn start(&mut self, e: &Expr, around: &PlanScope) -> Option<StepKind> {
        let table = Arc::clone(&self.code.builtins);
        let found = call(e).and_then(|(name, args)| Some((self.inference_name(name)?, args)));
        match found {
            Some(((i, form), args))
                if matches!(form, PlanForm::Prior | PlanForm::Unconstrained | PlanForm::BestOf) =>
            {
                let args = self.inference_args(table.get(i), args, e.span, around)?;
                let mut args = args.into_iter();
                let mut value = || match args.next() {
                    Some(Argument::Value(f)) => Some(f),
                    _ => None,
                };
                match form {
                    PlanForm::Prior => return Some(StepKind::Init(Init::Prior(value()))),
                    PlanForm::Unconstrained => {
                        return Some(StepKind::Init(Init::Unconstrained(value())));
                    }
                    _ => {}
                }
                let (draws, keep) = (value()?, value());
                let from = match args.next() {
                    Some(Argument::Kernel(call)) => Some(call),
                    _ => None,
                };
                Some(StepKind::Init(Init::BestOf(BestOf { draws, keep, from })))
            }
            _ => {
                self.error(
                    "`init` takes prior(), best_of(n) or unconstrained()",
                    e.span,
                    "not a start",
                )
                .hint_also("init(best_of(100)); starts at the best of 100 draws from the prior");
                None
            }
        }
    }

    /// Compiles a selection, optionally inside of `one(…)` or `each(…)`.
    fn choices(&mut self, e: &Expr, around: &PlanScope) -> Choices {
        let (pick, inner) = match call(e) {
            Some(("one", [a])) => (Pick::One, &a.value),
            Some(("each", [a])) => (Pick::Each, &a.value),
            _ => (Pick::All, e),
        };
        Choices { pick, selection: self.selection(inner, around) }
    }

    /// Compiles the address of one choice.
    fn choice(&mut self, e: &Expr, around: &PlanScope) -> Path {
        match self.selection(e, around) {
            Selection::Path(path) => path,
            // Refused like any other address of several choices.
            _ => Path { segments: [PathSegment::Deep].into(), span: e.span },
        }
    }

    /// Compiles an expression that is recorded with every draw.
    fn column(&mut self, e: &Expr, around: &PlanScope) -> Option<(String, Operand)> {
        if let ExprKind::Var(v) = &e.kind
            && around.names.contains(v)
        {
            let message = format!("`{v}` is not a quantity of the model");
            self.error(message, e.span, "a variable of this block");
            return None;
        }
        // A call without arguments loses its parentheses: `log_joint()`.
        let mut named = e;
        while let ExprKind::Call { callee, args } = &named.kind
            && args.is_empty()
        {
            named = callee;
        }
        Some((print_expr(named).replace('.', "/"), self.query(e)?))
    }

    /// Lowers an expression of the model, recorded with every draw, to a slot of the top
    /// level.
    fn query(&mut self, e: &Expr) -> Option<Operand> {
        if let Some((name, _)) = call(e)
            && self.inference_name(name).is_some()
        {
            self.error(
                format!("`{name}` is no quantity of the model"),
                e.span,
                "cannot be collected",
            )
            .hint_also("collect names of the model and expressions of them, log_joint() included");
            return None;
        }
        let label: Arc<str> = Arc::from("query");
        let roots = self.roots.clone();
        let value = self.below(&label, |l| l.expr(e));
        self.roots = roots;
        Some(value.at)
    }

    /// Lowers an expression that a report or export shows.
    fn shown_query(&mut self, e: &Expr) {
        if let Some(operand) = self.query(e) {
            self.code.queries.insert(e.span, operand);
        }
    }

    /// Checks `summary(@x)`, `best(view)`, or an expression of the model.
    fn reported(&mut self, e: &Expr) {
        let Some((i, args)) =
            call(e).and_then(|(name, args)| Some((self.inference_name(name)?.0, args)))
        else {
            return self.shown_query(e);
        };
        let table = Arc::clone(&self.code.builtins);
        let b = table.get(i);
        let order = match b.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node))) {
            Ok(order) => order,
            Err(message) => {
                self.mismatch(b, message, args, e.span);
                return;
            }
        };
        for (from, arg) in order.iter().zip(b.args.iter()) {
            let Some(value) = from.map(|j| &args[j].value) else { continue };
            match arg.ty {
                Type::Selection => drop(self.choices(value, &PlanScope::default())),
                _ => self.shown_query(value),
            }
        }
    }
}

/// The name and arguments of a call of a named function.
fn call(e: &Expr) -> Option<(&str, &[Arg])> {
    match &e.kind {
        ExprKind::Call { callee, args } => match &callee.kind {
            ExprKind::Var(name) => Some((name, args)),
            _ => None,
        },
        _ => None,
    }
}
