//! The top level of a file: includes, parameters, data, functions, statements.

use super::interface::inspect;
use super::lowerer::{Export, Lowerer, Pending, Report, Typed};
use super::scope::{Body, Meaning, Module, Namespace, Scope, ScopeKind};
use super::types::{accepts, declared, shown};
use crate::lang::builtins::Type;
use crate::lang::builtins::data::Options;
use crate::lang::code::{BlockId, BlockKind, Op};
use crate::lang::ids::FrameId;
use crate::lang::value::{Closure, Value};
use pcadlang_syntax::ast::{
    Declaration, Expr, ExprKind, FnDecl, Item, ItemKind, Lambda, Stmt, StmtKind,
};
use pcadlang_syntax::diag::{Diagnostic, IntoDiagnostic, Severity, nearest};
use pcadlang_syntax::parse_expr;
use pcadlang_syntax::span::{Span, Spanned};
use std::sync::Arc;

/// The possible types of a parameter.
const TYPES: [&str; 5] = ["number", "int", "bool", "string", "array"];

/// Returns the text of a spanned string.
fn text(s: &Spanned<Arc<str>>) -> Arc<str> {
    Arc::clone(&s.node)
}

/// Returns the name by which a later `forget` can remove an item.
fn forgettable(item: &Item) -> Option<&pcadlang_syntax::ast::Name> {
    let ItemKind::Stmt(s) = &item.kind else { return None };
    match &s.kind {
        StmtKind::Assume { name, .. } | StmtKind::Predict { name, .. } => Some(name),
        StmtKind::Observe { name, .. } | StmtKind::Factor { name, .. } => name.as_ref(),
        _ => None,
    }
}

impl Lowerer<'_> {
    /// Lowers a file into the current module.
    pub fn unit(&mut self, index: usize) {
        let loaded = self.loaded;
        let unit = &loaded.units[index];
        // Named functions come first, since they may be called before they are written.
        for item in &unit.program.items {
            if let ItemKind::Fn(f) = &item.kind {
                self.declare(f);
            }
        }
        let forgotten = self.forgotten(&unit.program.items);
        for (i, item) in unit.program.items.iter().enumerate() {
            if forgotten.contains(&i) {
                continue;
            }
            match &item.kind {
                ItemKind::Include { alias, path } => {
                    let Some(included) = unit.includes.get(i).copied().flatten() else { continue };
                    let native = path
                        .node
                        .strip_prefix("std/")
                        .and_then(|p| p.strip_suffix(".pcad"))
                        .map(Arc::from);
                    match alias {
                        Some(alias) => {
                            let prefix = Some(Arc::clone(&alias.node));
                            self.modules.push(Module { prefix, native, ..Module::default() });
                            let module = self.modules.len() - 1;
                            let space = Namespace { module, span: alias.span };
                            let old = self.modules[self.module]
                                .namespaces
                                .insert(Arc::clone(&alias.node), space);
                            if let Some(old) = old {
                                let message =
                                    format!("the namespace `{}` is declared twice", alias.node);
                                let e = self.error(message, alias.span, "declared again here");
                                e.point_at(old.span, "first declared here");
                                e.hint_also(
                                    "rename one of them after `as`, or include the file once",
                                );
                            }
                            let outer = std::mem::replace(&mut self.module, module);
                            self.unit(included);
                            self.module = outer;
                        }
                        None => {
                            if native.is_some() && self.modules[self.module].native.is_none() {
                                self.modules[self.module].native = native;
                            }
                            self.unit(included);
                        }
                    }
                }
                ItemKind::Param(d) => self.param(d),
                ItemKind::Data(d) => self.data(d, &unit.folder),
                ItemKind::Fn(_) => {}
                ItemKind::Kernel(k) => {
                    if let Some(old) = self.kernels.insert(Arc::clone(&k.name.node), k.clone()) {
                        let message = format!("the kernel `{}` is declared twice", k.name.node);
                        let e = self.error(message, k.name.span, "declared again here");
                        e.point_at(old.name.span, "first declared here");
                        e.hint_also("rename one of them");
                    }
                }
                // A plan of an included file belongs to that file, and is ignored here.
                ItemKind::Infer { name, body } if index == 0 => {
                    let name = name.as_ref().map(|n| Arc::clone(&n.node));
                    self.blocks.push((name, body.clone()));
                }
                ItemKind::Report { exprs, file } if index == 0 => {
                    self.reports
                        .push(Report { exprs: exprs.clone(), file: file.as_ref().map(text) });
                }
                ItemKind::Export { expr, file } if index == 0 => {
                    self.exports.push(Export { expr: expr.clone(), file: text(file) });
                }
                ItemKind::Infer { .. } | ItemKind::Report { .. } | ItemKind::Export { .. } => {}
                ItemKind::Stmt(s) => self.stmt(s),
            }
        }
    }

    /// Returns the items that a later `forget` removes, and the `forget` statements
    /// themselves.
    fn forgotten(&mut self, items: &[Item]) -> Vec<usize> {
        let mut gone = Vec::new();
        for (i, item) in items.iter().enumerate() {
            let ItemKind::Stmt(Stmt { kind: StmtKind::Forget(e), .. }) = &item.kind else {
                continue;
            };
            gone.push(i);
            let name = match &e.kind {
                ExprKind::Var(name) => Some(Arc::clone(name)),
                _ => None,
            };
            let Some(name) = name else {
                self.error(
                    "`forget` takes the name of an observation or assume",
                    e.span,
                    "not a name",
                );
                continue;
            };
            let is_it = |item: &Item| forgettable(item).is_some_and(|n| n.node == name);
            match (0..i).rev().find(|j| !gone.contains(j) && is_it(&items[*j])) {
                Some(j) => gone.push(j),
                None => {
                    let message = format!("no earlier observation or assume is named `{name}`");
                    let names = items[..i].iter().filter_map(forgettable).collect::<Vec<_>>();
                    let near = nearest(&name, names.iter().map(|n| &*n.node)).map(str::to_owned);
                    let e = self.error(message, e.span, "nothing to forget");
                    match near {
                        Some(n) => e.hint_also(format!("did you mean `{n}`?")),
                        None => {
                            e.hint_also("name an observation with `as` to be able to forget it")
                        }
                    }
                }
            }
        }
        gone
    }

    /// Creates the block of a named function, so that it can be called.
    fn declare(&mut self, f: &FnDecl) {
        let block = self.function_block(Arc::clone(&f.name.node), &f.lambda);
        self.bind(&f.name, Meaning::Function(block), Type::Function);
        self.pending.push(Pending { module: self.module, block, decl: f.clone() });
        if self.modules[self.module].prefix.is_none() {
            let closure =
                self.code.constant(Value::Closure(Closure { block, frame: FrameId::ROOT }));
            self.code.globals.insert(Arc::clone(&f.name.node), closure);
        }
    }

    /// Creates an empty function block.
    pub fn function_block(&mut self, name: Arc<str>, lambda: &Lambda) -> BlockId {
        let params: Arc<[Arc<str>]> =
            lambda.params.iter().map(|p| Arc::clone(&p.name.node)).collect();
        let required =
            lambda.params.iter().position(|p| p.default.is_some()).unwrap_or(lambda.params.len());
        if let Some(p) = lambda.params[required..].iter().find(|p| p.default.is_none()) {
            let message = format!("the parameter `{}` needs a default", p.name.node);
            self.error(message, p.name.span, "comes after one that has a default")
                .hint_also("put parameters without a default first");
        }
        self.new_block(BlockKind::Function { name, params, required })
    }

    /// Lowers a function's body into its block.
    pub fn function_body(&mut self, block: BlockId, lambda: &Lambda) {
        self.scopes.push(Scope::new(block, ScopeKind::Function));
        self.bodies.push(Body::default());
        for (i, p) in lambda.params.iter().enumerate() {
            let slot = self.push(Op::Param { index: i as u16, default: None }, p.name.span);
            let ty = match &p.ty {
                Some(t) => declared(&t.node).unwrap_or(Type::Any),
                None => Type::Any,
            };
            let here = crate::lang::code::Operand::Local(slot);
            self.bind(&p.name, Meaning::Value(here), ty);
        }
        for (i, p) in lambda.params.iter().enumerate() {
            if let Some(e) = &p.default {
                let value = self.expr(e).at;
                self.code.blocks[block].ops[i] =
                    Op::Param { index: i as u16, default: Some(value) };
            }
        }
        let result = self.body_of(&lambda.body);
        self.code.blocks[block].result = result.map(|t| t.at);
        self.bodies.pop();
        self.scopes.pop();
    }

    /// Lowers the bodies of all named functions.
    pub fn function_bodies(&mut self) {
        for p in std::mem::take(&mut self.pending) {
            let outer = std::mem::replace(&mut self.module, p.module);
            self.function_body(p.block, &p.decl.lambda);
            self.module = outer;
        }
    }

    fn param(&mut self, d: &Declaration) {
        let name = self.global_name(&d.name);
        let ty = match &d.ty {
            Some(t) => declared(&t.node).unwrap_or_else(|| {
                let near = nearest(&t.node, TYPES).map(str::to_owned);
                let e = self.error(
                    format!("there is no parameter type `{}`", t.node),
                    t.span,
                    "unknown type",
                );
                match near {
                    Some(n) => e.hint_also(format!("did you mean `{n}`?")),
                    None => e.hint_also(format!("types are {}", TYPES.join(", "))),
                }
                Type::Any
            }),
            None => d.default.as_ref().map_or(Type::Any, literal_type),
        };
        let set = self.inputs.sets.iter().rev().find(|(n, _)| **n == *name).map(|(_, v)| v.clone());
        let value = match (set, &d.default) {
            (Some(text), _) => {
                self.used_sets.push(name.to_string());
                self.set_value(&name, &text, ty)
            }
            (None, Some(e)) => {
                let value = self.expr(e);
                let what = format!("the default of `{}`", d.name.node);
                self.check_type(value, ty, e.span, &what);
                self.check_whole(value, ty, e.span, &what);
                value
            }
            (None, None) => {
                if self.inputs.needs_data {
                    let e = self.error(
                        format!("the parameter `{name}` has no value"),
                        d.name.span,
                        "no default",
                    );
                    e.hint_also(format!("set it on the command line: --set {name}=…"));
                }
                self.nothing()
            }
        };
        self.bind_value(
            &d.name,
            Typed { at: value.at, ty: if ty == Type::Any { value.ty } else { ty } },
        );
    }

    /// Lowers the value of `--set name=text`.
    fn set_value(&mut self, name: &str, text: &str, ty: Type) -> Typed {
        let file = self.map.add(&format!("--set {name}"), text);
        if ty == Type::Str && !text.starts_with('"') {
            return self.constant(Value::str(text));
        }
        match parse_expr(text, file) {
            Ok(e) => {
                let value = self.expr(&e);
                self.check_type(value, ty, e.span, &format!("`{name}`"));
                self.check_whole(value, ty, e.span, &format!("`{name}`"));
                value
            }
            Err(errors) => {
                self.errors.extend(errors.into_iter().map(IntoDiagnostic::into_diagnostic));
                self.nothing()
            }
        }
    }

    /// Reports a constant that is not a whole number, if the type requires one.
    fn check_whole(
        &mut self,
        value: Typed,
        wanted: Type,
        span: pcadlang_syntax::span::Span,
        what: &str,
    ) {
        if wanted == Type::Int
            && let crate::lang::code::Operand::Const(i) = value.at
            && let Value::Num(x) = self.code.const_value(i)
            && *x != libm::trunc(*x)
        {
            self.error(format!("{what} must be a whole number, got {x}"), span, "not whole");
        }
    }

    pub fn check_type(
        &mut self,
        value: Typed,
        wanted: Type,
        span: pcadlang_syntax::span::Span,
        what: &str,
    ) {
        if !accepts(wanted, value.ty) {
            let message = format!("{what} must be {}, got {}", shown(wanted), shown(value.ty));
            self.error(message, span, format!("this is {}", shown(value.ty)));
        }
    }

    fn data(&mut self, d: &Declaration, folder: &str) {
        let name = self.global_name(&d.name);
        if let Some(t) = &d.ty
            && self.code.builtins.kind(&t.node).is_none()
        {
            let builtins = Arc::clone(&self.code.builtins);
            let near = nearest(&t.node, builtins.kinds()).map(str::to_owned);
            let e = self.error(
                format!("there is no data of type `{}`", t.node),
                t.span,
                "unknown type",
            );
            match near {
                Some(n) => e.hint_also(format!("did you mean `{n}`?")),
                None => e.hint_also(format!(
                    "types are {}",
                    builtins.kinds().collect::<Vec<_>>().join(", ")
                )),
            }
        }
        let value = match (self.inputs.data.get(&*name).cloned(), &d.default) {
            (Some(v), default) => {
                // The file was read with the options of the default.
                if let Some(ExprKind::Call { callee, args }) = default.as_ref().map(|e| &e.kind)
                    && let ExprKind::Var(kind) = &callee.kind
                    && self.code.builtins.kind(kind).is_some()
                {
                    self.options(kind, args.get(1..).unwrap_or_default());
                }
                self.used_data.push(name.to_string());
                self.remark(&v, d.name.span);
                self.constant(v)
            }
            (None, Some(e)) => self.data_default(e, folder),
            (None, None) => {
                if self.inputs.needs_data {
                    let e =
                        self.error(format!("`{name}` is not given"), d.name.span, "needs a file");
                    e.hint_also(format!("set it on the command line: --observe {name}=FILE"));
                }
                self.nothing()
            }
        };
        self.bind_value(&d.name, value);
    }

    /// Lowers `csv("file")` and the like, or any expression.
    fn data_default(&mut self, e: &Expr, folder: &str) -> Typed {
        if let ExprKind::Call { callee, args } = &e.kind
            && let ExprKind::Var(kind) = &callee.kind
            && self.code.builtins.kind(kind).is_some()
        {
            if let (true, Some(v)) = (args.is_empty(), self.without_file(kind)) {
                return self.constant(v);
            }
            let Some((arg, rest)) = args.split_first() else {
                self.error(format!("{kind} takes one path"), e.span, "expected one string");
                return self.nothing();
            };
            let ExprKind::Str(path) = &arg.value.kind else {
                self.error(
                    format!("{kind} takes a path, a string in quotes"),
                    arg.value.span,
                    "not a string",
                )
                .hint_also("the files of a run must be known before it starts");
                return self.nothing();
            };
            let Some(options) = self.options(kind, rest) else { return self.nothing() };
            return match (self.inputs.read)(kind, path, folder, &options) {
                Ok(v) => {
                    self.remark(&v, arg.value.span);
                    self.constant(v)
                }
                Err(f) => {
                    let d = self.error(f.message, arg.value.span, "cannot be read");
                    d.hints.extend(f.hint);
                    self.nothing()
                }
            };
        }
        self.expr(e)
    }

    /// Warns of what users should know of data.
    fn remark(&mut self, value: &Value, span: Span) {
        if let Value::Object(object) = value
            && let Some(message) = object.remark()
        {
            let warning = Diagnostic::new(Severity::Warning, message);
            self.errors.push(warning.primary(span, "read from here"));
        }
    }

    /// The value of a data item of a kind that is given no file.
    fn without_file(&self, kind: &str) -> Option<Value> {
        self.code.builtins.kind(kind)?.format.as_ref()?.without_file()
    }

    /// How a data item's file is to be read, from the arguments after its path.
    fn options(&mut self, kind: &str, args: &[pcadlang_syntax::ast::Arg]) -> Option<Options> {
        let (i, fault) = match self.code.builtins.options(kind, args) {
            Ok(options) => return Some(options),
            Err(e) => e,
        };
        let span = args.get(i)?.value.span;
        let builtins = Arc::clone(&self.code.builtins);
        self.error(
            fault.message,
            span,
            if builtins.has_options(kind) { "not an option" } else { "not expected" },
        )
        .hints
        .extend(fault.hint);
        None
    }

    /// Reports `--set` and `--observe` names that no file declares.
    pub fn unused_inputs(&mut self) {
        let interface = inspect(self.loaded, &self.code.builtins);
        let params: Vec<&str> = interface.params.iter().map(|p| p.name.as_str()).collect();
        let items: Vec<&str> = interface.data.iter().map(|d| d.name.as_str()).collect();
        let mut unknown = Vec::new();
        for (name, _) in self.inputs.sets {
            if !self.used_sets.contains(name) {
                unknown.push(("--set", "parameter", name.clone(), params.clone()));
            }
        }
        for name in self.inputs.data.keys() {
            if !self.used_data.contains(name) {
                unknown.push(("--observe", "data item", name.clone(), items.clone()));
            }
        }
        for (option, what, name, known) in unknown {
            let d = Diagnostic::new(
                Severity::Error,
                format!("{option} {name}: the program has no {what} of this name"),
            );
            self.errors.push(match (nearest(&name, known.iter().copied()), known.is_empty()) {
                (Some(n), _) => d.hint(format!("did you mean `{n}`?")),
                (None, true) => d.hint(format!("it has no {what}s")),
                (None, false) => d.hint(format!("it has {}", known.join(", "))),
            });
        }
    }
}

/// Returns the type of a literal; `Any` if it is not one.
fn literal_type(e: &Expr) -> Type {
    match &e.kind {
        ExprKind::Num(_) => Type::Num,
        ExprKind::Unary { expr, .. } => literal_type(expr),
        ExprKind::Bool(_) => Type::Bool,
        ExprKind::Str(_) => Type::Str,
        ExprKind::Array(_) => Type::Array,
        _ => Type::Any,
    }
}
