//! Resolving the names of a syntax tree, which may be that of a text with mistakes: what
//! cannot be resolved is left out. The scopes are those of
//! [`lang::lower`](pcadlang_engine::lang::lower).

use super::names::{Binding, BindingId, BindingKind, Names, Occurrence};
use pcadlang_engine::lang::load::Loaded;
use pcadlang_syntax::ast::*;
use pcadlang_syntax::span::Span;
use rustc_hash::FxHashMap;
use std::sync::Arc;

type Scope = FxHashMap<Arc<str>, BindingId>;

impl Names {
    /// Resolves the names of a program.
    pub fn of(loaded: &Loaded) -> Names {
        let mut r = Resolver {
            loaded,
            names: Names::default(),
            units: vec![Scope::default(); loaded.units.len()],
            namespaces: FxHashMap::default(),
            unit: 0,
            scopes: Vec::new(),
        };
        if !loaded.units.is_empty() {
            r.declare_unit(0);
        }
        for unit in 0..loaded.units.len() {
            r.unit = unit;
            for item in &loaded.units[unit].program.items {
                r.item(item);
            }
        }
        r.names
    }
}

/// A block inside a declaration.
struct Local {
    names: Scope,
    span: Span,
    /// True if choices with keys belong to a block further out.
    is_loop: bool,
}

struct Resolver<'a> {
    loaded: &'a Loaded,
    names: Names,
    /// The top-level names of each file.
    units: Vec<Scope>,
    /// The files behind namespaces.
    namespaces: FxHashMap<BindingId, usize>,
    unit: usize,
    scopes: Vec<Local>,
}

impl Resolver<'_> {
    /// Binds the top-level names of a file and of those it includes.
    fn declare_unit(&mut self, unit: usize) {
        let loaded = self.loaded;
        let Some(u) = loaded.units.get(unit) else { return };
        for (i, item) in u.program.items.iter().enumerate() {
            self.unit = unit;
            match &item.kind {
                ItemKind::Include { alias, .. } => {
                    let Some(included) = u.includes.get(i).copied().flatten() else { continue };
                    self.declare_unit(included);
                    self.unit = unit;
                    match alias {
                        Some(name) => {
                            let id = self.bind(name, BindingKind::Namespace, item.span);
                            self.namespaces.insert(id, included);
                        }
                        None => {
                            let added = self.units[included].clone();
                            self.units[unit].extend(added);
                        }
                    }
                }
                ItemKind::Param(d) => {
                    self.bind(&d.name, BindingKind::Param, item.span);
                }
                ItemKind::Data(d) => {
                    self.bind(&d.name, BindingKind::Data, item.span);
                }
                ItemKind::Fn(f) => {
                    let id = self.bind(&f.name, BindingKind::Function, item.span);
                    self.arguments(id, &f.lambda.params, item.span);
                }
                ItemKind::Kernel(k) => {
                    let id = self.bind(&k.name, BindingKind::Kernel, item.span);
                    self.arguments(id, &k.params, item.span);
                }
                ItemKind::Infer { name: Some(name), .. } => {
                    self.bind(name, BindingKind::Plan, item.span);
                }
                ItemKind::Infer { .. } | ItemKind::Report { .. } | ItemKind::Export { .. } => {}
                ItemKind::Stmt(s) => self.declare(s),
            }
        }
    }

    /// Binds the parameters of a declaration, which is where they can be used.
    fn arguments(&mut self, of: BindingId, params: &[Param], scope: Span) {
        for p in params {
            let id = self.add(&p.name, BindingKind::Argument, param_span(p), Some(scope));
            self.names.bindings[of].arguments.push(id);
        }
    }

    /// Binds what a statement binds in its block.
    fn declare(&mut self, s: &Stmt) {
        let kind = |bind: Bind, value| match bind {
            Bind::Random => BindingKind::Choice,
            Bind::Value => value,
        };
        match &s.kind {
            StmtKind::Assume { name, bind, .. } => {
                self.bind(name, kind(*bind, BindingKind::Value), s.span);
            }
            StmtKind::Let { name, .. } => {
                self.bind(name, BindingKind::Value, s.span);
            }
            StmtKind::Predict { name, .. } => {
                self.bind(name, BindingKind::Prediction, s.span);
            }
            StmtKind::Observe { name: Some(name), .. }
            | StmtKind::Factor { name: Some(name), .. } => {
                self.add(name, BindingKind::Observation, s.span, None);
            }
            StmtKind::Draw { target, .. } => self.declare_target(target, s.span),
            StmtKind::For { body, .. } => body.iter().for_each(|s| self.declare_keyed(s)),
            _ => {}
        }
    }

    /// Binds the containers of choices that statements in a loop draw into.
    fn declare_keyed(&mut self, s: &Stmt) {
        match &s.kind {
            StmtKind::Draw { target, .. } if matches!(target.kind, ExprKind::Index { .. }) => {
                self.declare_target(target, s.span);
            }
            StmtKind::For { body, .. } => body.iter().for_each(|s| self.declare_keyed(s)),
            _ => {}
        }
    }

    /// Binds the name of a choice; a container is bound once.
    fn declare_target(&mut self, target: &Expr, whole: Span) {
        let Some((name, span, keyed)) = target_name(target) else { return };
        let known = match self.scopes.last() {
            None => self.units[self.unit].get(&name).copied(),
            Some(block) => block.names.get(&name).copied(),
        };
        match known {
            Some(_) if keyed => {}
            _ => {
                self.bind(&Name::new(name, span), BindingKind::Choice, whole);
            }
        }
    }

    /// Binds a name in the innermost block.
    fn bind(&mut self, name: &Name, kind: BindingKind, whole: Span) -> BindingId {
        let scope = self.scopes.last().map(|b| b.span);
        let id = self.add(name, kind, whole, scope);
        match self.scopes.last_mut() {
            Some(block) => block.names.insert(Arc::clone(&name.node), id),
            None => self.units[self.unit].insert(Arc::clone(&name.node), id),
        };
        id
    }

    fn add(
        &mut self,
        name: &Name,
        kind: BindingKind,
        whole: Span,
        scope: Option<Span>,
    ) -> BindingId {
        let binding = self.names.bindings.len();
        self.names.bindings.push(Binding {
            name: Arc::clone(&name.node),
            kind,
            span: name.span,
            whole,
            scope,
            arguments: Vec::new(),
        });
        self.names.occurrences.push(Occurrence { span: name.span, binding });
        binding
    }

    fn lookup(&self, name: &str) -> Option<BindingId> {
        let inner = self.scopes.iter().rev().find_map(|s| s.names.get(name));
        inner.or_else(|| self.units[self.unit].get(name)).copied()
    }

    fn meet(&mut self, span: Span, binding: BindingId) {
        self.names.occurrences.push(Occurrence { span, binding });
    }

    fn item(&mut self, item: &Item) {
        match &item.kind {
            ItemKind::Include { .. } => {}
            ItemKind::Param(d) | ItemKind::Data(d) => self.exprs(&d.default),
            ItemKind::Fn(f) => {
                let of = self.units[self.unit].get(&f.name.node).copied();
                self.lambda(&f.lambda, of);
            }
            ItemKind::Kernel(k) => {
                let of = self.units[self.unit].get(&k.name.node).copied();
                let names = self.argument_names(&k.params, of, item.span);
                self.block(item.span, names, false, |r| r.steps(&k.body));
            }
            ItemKind::Infer { body, .. } => {
                self.block(item.span, Scope::default(), false, |r| r.steps(body));
            }
            ItemKind::Report { exprs, .. } => exprs.iter().for_each(|e| self.expr(e)),
            ItemKind::Export { expr, .. } => self.expr(expr),
            ItemKind::Stmt(s) => self.stmt(s, true),
        }
    }

    fn block(&mut self, span: Span, names: Scope, is_loop: bool, work: impl FnOnce(&mut Self)) {
        self.scopes.push(Local { names, span, is_loop });
        work(self);
        self.scopes.pop();
    }

    /// Returns the scope of the parameters of a function; those of a declared one are
    /// bound already.
    fn argument_names(&mut self, params: &[Param], of: Option<BindingId>, whole: Span) -> Scope {
        let known = of.map_or(Vec::new(), |id| self.names.bindings[id].arguments.clone());
        let mut names = Scope::default();
        for p in params {
            self.exprs(&p.default);
            let bound = known.iter().find(|id| self.names.bindings[**id].span == p.name.span);
            let id = match bound {
                Some(id) => *id,
                None => self.add(&p.name, BindingKind::Argument, param_span(p), Some(whole)),
            };
            names.insert(Arc::clone(&p.name.node), id);
        }
        names
    }

    fn lambda(&mut self, l: &Lambda, of: Option<BindingId>) {
        let names = self.argument_names(&l.params, of, l.body.span);
        self.block(l.body.span, names, false, |r| r.body(&l.body));
    }

    /// Resolves a body in its own block.
    fn body(&mut self, body: &Body) {
        self.block(body.span, Scope::default(), false, |r| {
            r.stmts(&body.stmts);
            body.result.iter().for_each(|e| r.expr(e));
        });
    }

    fn stmts(&mut self, stmts: &[Stmt]) {
        // Containers can be read before the loop that draws into them.
        if !self.in_loop() {
            stmts.iter().for_each(|s| self.declare_keyed(s));
        }
        stmts.iter().for_each(|s| self.stmt(s, false));
    }

    /// Resolves a statement; those at the top level are declared.
    fn stmt(&mut self, s: &Stmt, declared: bool) {
        match &s.kind {
            StmtKind::Assume { expr, tags, .. } => {
                self.expr(expr);
                self.tags(tags);
            }
            StmtKind::Draw { target, dist, tags } => {
                self.expr(dist);
                self.tags(tags);
                if let ExprKind::Index { .. } = target.kind {
                    self.expr(target);
                }
            }
            StmtKind::Let { expr, .. } | StmtKind::Predict { expr, .. } => self.expr(expr),
            StmtKind::Observe { dist, value, coarse, .. } => {
                self.expr(dist);
                self.expr(value);
                self.exprs(coarse);
            }
            StmtKind::Factor { expr, .. } => self.expr(expr),
            StmtKind::Force { target, value } => {
                self.expr(target);
                self.expr(value);
            }
            StmtKind::Freeze(e) | StmtKind::Forget(e) | StmtKind::Sample(e) | StmtKind::Expr(e) => {
                self.expr(e);
            }
            StmtKind::For { var, iter, body } => {
                self.loop_over(var, iter, s.span, |r| r.stmts(body));
            }
        }
        let is_declared = declared
            || match &s.kind {
                // Its container belongs to a block further out.
                StmtKind::Draw { target, .. } => {
                    matches!(target.kind, ExprKind::Index { .. }) && self.in_loop()
                }
                StmtKind::For { .. } => true,
                _ => false,
            };
        if !is_declared {
            self.declare(s);
        }
    }

    /// Resolves a loop of the model or of a plan.
    fn loop_over(&mut self, var: &Name, iter: &Expr, span: Span, body: impl FnOnce(&mut Self)) {
        self.expr(iter);
        let id = self.add(var, BindingKind::Loop, var.span, Some(span));
        let names = Scope::from_iter([(Arc::clone(&var.node), id)]);
        self.block(span, names, true, body);
    }

    fn in_loop(&self) -> bool {
        self.scopes.last().is_some_and(|s| s.is_loop)
    }

    fn tags(&mut self, tags: &[Tag]) {
        for value in tags.iter().filter_map(|t| t.value.as_ref()) {
            match &value.kind {
                // Any word that is not a variable is a string.
                ExprKind::Var(name) => {
                    if let Some(id) = self.lookup(name) {
                        self.meet(value.span, id);
                    }
                }
                _ => self.expr(value),
            }
        }
    }

    fn steps(&mut self, steps: &[KStmt]) {
        for s in steps {
            match &s.kind {
                KStmtKind::Warmup { count, body }
                | KStmtKind::Repeat { count, body }
                | KStmtKind::Every { count, body } => {
                    self.expr(count);
                    self.block(s.span, Scope::default(), false, |r| r.steps(body));
                }
                KStmtKind::Mix(arms) => {
                    for arm in arms {
                        self.expr(&arm.weight);
                        self.expr(&arm.kernel);
                    }
                }
                KStmtKind::For { var, iter, body } => {
                    self.loop_over(var, iter, s.span, |r| r.steps(body));
                }
                KStmtKind::StopWhen(e) | KStmtKind::Expr(e) => self.expr(e),
                KStmtKind::Collect(all) => all.iter().for_each(|e| self.expr(e)),
                KStmtKind::Propose { target, dist } => {
                    self.expr(dist);
                    match &target.kind {
                        ExprKind::Var(name) => {
                            let name = Name::new(Arc::clone(name), target.span);
                            self.bind(&name, BindingKind::Choice, s.span);
                        }
                        _ => self.expr(target),
                    }
                }
                KStmtKind::Map { target, value } => {
                    self.expr(target);
                    self.expr(value);
                }
                KStmtKind::Let { name, expr } => {
                    self.expr(expr);
                    self.bind(name, BindingKind::Value, s.span);
                }
            }
        }
    }

    fn exprs<'e>(&mut self, all: impl IntoIterator<Item = &'e Expr>) {
        all.into_iter().for_each(|e| self.expr(e));
    }

    fn expr(&mut self, e: &Expr) {
        match &e.kind {
            ExprKind::Num(_)
            | ExprKind::Str(_)
            | ExprKind::Bool(_)
            | ExprKind::TagSel { .. }
            | ExprKind::Error => {}
            ExprKind::Var(name) => match self.lookup(name) {
                Some(id) => self.meet(e.span, id),
                None => self.names.others.push((e.span, Arc::clone(name))),
            },
            ExprKind::Address(a) => self.address(a, e.span),
            ExprKind::Array(all) => self.exprs(all),
            ExprKind::Record(fields) => fields.iter().for_each(|(_, e)| self.expr(e)),
            ExprKind::Call { callee, args } => {
                self.expr(callee);
                let called = self.names.occurrences.last().copied();
                let called = called.filter(|o| o.span.end == callee.span.end);
                for arg in args {
                    let named = called.zip(arg.name.as_ref()).and_then(|(of, name)| {
                        let all = &self.names.bindings[of.binding].arguments;
                        let id = all.iter().find(|id| self.names.bindings[**id].name == name.node);
                        Some((name.span, *id?))
                    });
                    if let Some((span, id)) = named {
                        self.meet(span, id);
                    }
                    self.expr(&arg.value);
                }
            }
            ExprKind::Index { base, index } => {
                self.expr(base);
                self.expr(index);
            }
            ExprKind::Field { base, field } => self.field(base, field),
            ExprKind::Unary { expr, .. } => self.expr(expr),
            ExprKind::Binary { left, right, .. } => {
                self.expr(left);
                self.expr(right);
            }
            ExprKind::If { cond, then, otherwise } => {
                self.expr(cond);
                self.body(then);
                self.body(otherwise);
            }
            ExprKind::Lambda(l) => self.lambda(l, None),
        }
    }

    /// A field of a record, a name of a namespace, or a built-in of a module.
    fn field(&mut self, base: &Expr, field: &Name) {
        let ExprKind::Var(name) = &base.kind else { return self.expr(base) };
        match self.lookup(name) {
            Some(id) => {
                self.meet(base.span, id);
                let unit = self.namespaces.get(&id);
                let inside = unit.and_then(|u| self.units[*u].get(&field.node).copied());
                match inside {
                    Some(inside) => self.meet(field.span, inside),
                    None if unit.is_some() => {
                        let whole = format!("{name}.{}", field.node).into();
                        self.names.others.push((field.span, whole));
                    }
                    None => {}
                }
            }
            None => {
                let whole = format!("{name}.{}", field.node).into();
                self.names.others.push((base.span.to(field.span), whole));
            }
        }
    }

    /// The first segment of an address is the name of a choice or observation.
    fn address(&mut self, a: &Address, span: Span) {
        for (i, s) in a.segments.iter().enumerate() {
            if let SegmentName::Name(name) = &s.name {
                let known = |kind| {
                    !matches!(kind, BindingKind::Argument | BindingKind::Loop | BindingKind::Plan)
                };
                let bound = self.names.bindings.iter().rposition(|b| {
                    b.name == *name
                        && b.scope.is_none()
                        && known(b.kind)
                        && b.span.file == span.file
                });
                match bound.filter(|_| i == 0) {
                    Some(id) => {
                        let start = span.start + 1;
                        let end = start + name.len() as u32;
                        self.meet(Span { start, end, ..span }, id);
                    }
                    None => self.names.segments.push(Arc::clone(name)),
                }
            }
            for key in &s.keys {
                if let Key::Expr(e) = key {
                    self.expr(e);
                }
            }
        }
    }
}

fn param_span(p: &Param) -> Span {
    p.default.as_ref().map_or(p.name.span, |d| p.name.span.to(d.span))
}

/// Returns the name that a choice is drawn into, and whether it has keys.
fn target_name(e: &Expr) -> Option<(Arc<str>, Span, bool)> {
    match &e.kind {
        ExprKind::Var(name) => Some((Arc::clone(name), e.span, false)),
        ExprKind::Index { base, .. } => {
            let (name, span, _) = target_name(base)?;
            Some((name, span, true))
        }
        _ => None,
    }
}
