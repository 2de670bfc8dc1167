//! Calls of built-ins, forms, named functions and function values, with their arguments
//! matched and checked.

use super::lowerer::{Lowerer, Typed};
use super::scope::Meaning;
use super::types::{accepts, shown};
use crate::lang::builtins::data::Literal;
use crate::lang::builtins::{Args, Builtin, Domain, Form, Kind, Type};
use crate::lang::code::{BlockId, BlockKind, Callee, Op, Operand, Probe};
use crate::lang::fault::Fault;
use crate::lang::value::Value;
use pcadlang_syntax::ast::{Arg, Expr, ExprKind};
use pcadlang_syntax::diag::{Diagnostic, Severity};
use pcadlang_syntax::span::Span;
use smallvec::SmallVec;
use std::sync::Arc;

/// The referent of a called expression.
enum Target {
    Builtin(u32),
    Function(BlockId),
    Value,
    Failed,
}

impl Lowerer<'_> {
    pub fn call(&mut self, e: &Expr, callee: &Expr, args: &[Arg]) -> Typed {
        match self.target(callee) {
            Target::Builtin(i) => {
                let table = Arc::clone(&self.code.builtins);
                let b = table.get(i);
                match b.kind {
                    Kind::Form(form) => self.form(form, i, args, e.span),
                    Kind::Function(_) | Kind::Distribution(_) => {
                        match self.builtin_args(i, args, e.span) {
                            Some((builtin, args)) => {
                                self.op(Op::Prim { builtin, args }, b.returns, e.span)
                            }
                            None => self.nothing(),
                        }
                    }
                    Kind::Plan(what) => self.given(what, b, args, e, callee.span),
                }
            }
            Target::Function(block) => {
                let args = self.written(args);
                self.check_arity(block, &args, e.span);
                let label = self.callee_name(callee);
                let site = self.site(&label, Vec::new(), 0);
                let ops = args.into_iter().map(|(k, v, _)| (k, v.at)).collect();
                self.op(
                    Op::Call { callee: Callee::Static(block), args: ops, site },
                    Type::Any,
                    e.span,
                )
            }
            Target::Value => {
                let f = self.expr(callee);
                if !matches!(f.ty, Type::Any | Type::Function) {
                    let message = format!("only functions can be called, not {}", shown(f.ty));
                    let e = self.error(message, callee.span, format!("this is {}", shown(f.ty)));
                    if matches!(f.ty, Type::Num | Type::Int | Type::Nums) {
                        e.hint_also("a product is written with `*`");
                    }
                    return self.nothing();
                }
                let label = self.callee_name(callee);
                let args = self.written(args).into_iter().map(|(k, v, _)| (k, v.at)).collect();
                let site = self.site(&label, Vec::new(), 0);
                self.op(Op::Call { callee: Callee::Value(f.at), args, site }, Type::Any, e.span)
            }
            Target::Failed => {
                self.written(args);
                self.nothing()
            }
        }
    }

    /// Lowers a call of a built-in family of distributions, for `x ~ family(…)` and
    /// `observe family(…) = v`.
    pub fn family_call(&mut self, e: &Expr) -> Option<(u32, Box<[Operand]>)> {
        let ExprKind::Call { callee, args } = &e.kind else { return None };
        let name_is_free = match &callee.kind {
            ExprKind::Var(n) => self.lookup(n).is_none(),
            ExprKind::Field { .. } => true,
            _ => false,
        };
        if !name_is_free {
            return None;
        }
        let i = match &callee.kind {
            ExprKind::Var(n) => self.find_builtin(n)?,
            _ => return None,
        };
        if !matches!(self.code.builtins.get(i).kind, Kind::Distribution(_)) {
            return None;
        }
        let nothing = self.nothing().at;
        Some(self.builtin_args(i, args, e.span).unwrap_or_else(|| (i, [nothing].into())))
    }

    fn target(&mut self, callee: &Expr) -> Target {
        match &callee.kind {
            ExprKind::Var(name) => {
                if let Some((b, _)) = self.lookup(name) {
                    return match b.meaning {
                        Meaning::Function(block) => Target::Function(block),
                        _ => Target::Value,
                    };
                }
                if let Some(i) = self.find_builtin(name) {
                    return Target::Builtin(i);
                }
                if self.kernels.contains_key(name) {
                    self.only_in_plans(name, callee.span);
                } else {
                    self.unbound(name, callee.span);
                }
                Target::Failed
            }
            ExprKind::Field { base, field } => {
                let ExprKind::Var(ns) = &base.kind else { return Target::Value };
                if self.lookup(ns).is_some() {
                    return Target::Value;
                }
                let Some(space) = self.modules[self.module].namespaces.get(ns).cloned() else {
                    return Target::Value;
                };
                if let Some(b) = self.modules[space.module].names.get(&field.node) {
                    return match b.meaning {
                        Meaning::Function(block) => Target::Function(block),
                        _ => Target::Value,
                    };
                }
                let native = self.modules[space.module].native.clone();
                if let Some(i) = native.and_then(|m| self.code.builtins.find(&m, &field.node)) {
                    return Target::Builtin(i);
                }
                self.no_member(ns, space.module, field);
                Target::Failed
            }
            _ => Target::Value,
        }
    }

    /// Returns the name of a called expression in addresses.
    fn callee_name(&self, callee: &Expr) -> Arc<str> {
        match &callee.kind {
            ExprKind::Var(n) => Arc::clone(n),
            ExprKind::Field { field, .. } => Arc::clone(&field.node),
            _ => Arc::from("fn"),
        }
    }

    fn written(&mut self, args: &[Arg]) -> Vec<(Option<Arc<str>>, Typed, Span)> {
        let one = |l: &mut Self, a: &Arg| {
            let at = a.name.as_ref().map_or(a.value.span, |n| n.span);
            (a.name.as_ref().map(|n| Arc::clone(&n.node)), l.expr(&a.value), at)
        };
        args.iter().map(|a| one(self, a)).collect()
    }

    /// Finds the form of a built-in that a call has: exactly one of the last two arguments
    /// is to be given. Keeps those of that form in the order.
    fn form_called(
        &mut self,
        i: u32,
        (args, span): (&[Arg], Span),
        order: &mut SmallVec<[Option<usize>; 8]>,
    ) -> Option<u32> {
        let table = Arc::clone(&self.code.builtins);
        let b = table.get(i);
        let [.., one, other] = &*b.args else { return Some(i) };
        let forms = table.form(b, &one.name).zip(table.form(b, &other.name));
        let Some((by_one, by_other)) = forms else { return Some(i) };
        let last = order.len() - 2;
        let (form, unused) = match (order[last], order[last + 1]) {
            (Some(_), None) => (by_one, last + 1),
            (None, Some(_)) => (by_other, last),
            (given, again) => {
                let (p, q) = (&one.name, &other.name);
                let both = given.max(again).and_then(|j| args.get(j));
                let e = match both {
                    Some(a) => {
                        let at = a.name.as_ref().map_or(a.value.span, |n| n.span);
                        let message = format!("`{}` takes `{p}` or `{q}`, not both", b.name);
                        self.error(message, at, "the other one is given too")
                    }
                    None => {
                        let message = format!("`{}` needs `{p}` or `{q}`", b.name);
                        self.error(message, span, "in this call")
                    }
                };
                e.hint_also(b.signature());
                self.written(args);
                return None;
            }
        };
        order.remove(unused);
        Some(form)
    }

    /// Lowers the arguments of a built-in, in the order of the form that is called.
    pub fn builtin_args(
        &mut self,
        i: u32,
        args: &[Arg],
        span: Span,
    ) -> Option<(u32, Box<[Operand]>)> {
        let table = Arc::clone(&self.code.builtins);
        let b = table.get(i);
        let names = args.iter().map(|a| a.name.as_ref().map(|n| &*n.node));
        let mut order = match b.match_names(names) {
            Ok(order) => order,
            Err(message) => {
                self.mismatch(b, message, args, span);
                self.written(args);
                return None;
            }
        };
        let i = self.form_called(i, (args, span), &mut order)?;
        let b = table.get(i);
        let values: Vec<Typed> = args.iter().map(|a| self.expr(&a.value)).collect();
        let mut operands = Vec::with_capacity(order.len());
        for (p, from) in order.iter().enumerate() {
            let arg = &b.args[p.min(b.args.len() - 1)];
            match from {
                Some(j) => {
                    let v = values[*j];
                    if !accepts(arg.ty, v.ty) {
                        let message = format!(
                            "{}: `{}` must be {}, got {}",
                            b.full_name(),
                            arg.name,
                            shown(arg.ty),
                            shown(v.ty)
                        );
                        let e = self.error(
                            message,
                            args[*j].value.span,
                            format!("this is {}", shown(v.ty)),
                        );
                        if v.ty == Type::Dist {
                            e.hint_also("draw a value first: x ~ …; then use x");
                        } else {
                            e.hint_also(b.signature());
                        }
                    } else if let Some(fault) = refused(b, p, &args[*j].value) {
                        let e = self.error(fault.message, args[*j].value.span, "not allowed here");
                        e.hint_also(fault.hint.unwrap_or_else(|| b.signature()));
                    } else if let Some(warning) = unlike_probabilities(b, p, &args[*j].value) {
                        self.errors.push(warning);
                    }
                    operands.push(v.at);
                }
                None => {
                    let full: &str = &b.full_name();
                    let given = self
                        .inputs
                        .defaults
                        .iter()
                        .find(|((f, a), _)| f == full && *a == *arg.name);
                    let value = given.map_or(Value::Unit, |(_, v)| v.clone());
                    operands.push(self.constant(value).at);
                }
            }
        }
        Some((i, operands.into()))
    }

    fn maybe(&mut self, e: Option<&Expr>) -> Typed {
        match e {
            Some(e) => self.expr(e),
            None => self.nothing(),
        }
    }

    fn form(&mut self, form: Form, i: u32, args: &[Arg], span: Span) -> Typed {
        let table = Arc::clone(&self.code.builtins);
        let b = table.get(i);
        let order = match b.match_names(args.iter().map(|a| a.name.as_ref().map(|n| &*n.node))) {
            Ok(order) => order,
            Err(message) => {
                self.mismatch(b, message, args, span);
                self.written(args);
                return self.nothing();
            }
        };
        let arg =
            |p: usize| order.get(p).copied().flatten().and_then(|j| args.get(j)).map(|a| &a.value);
        let function = |l: &mut Self, e: Option<&Expr>| -> (Typed, Arc<str>) {
            let Some(e) = e else { return (l.nothing(), Arc::from("fn")) };
            let label = match &e.kind {
                ExprKind::Lambda(_) => Arc::from("fn"),
                _ => l.callee_name(e),
            };
            let value = l.expr(e);
            if !accepts(Type::Function, value.ty) {
                let message = format!(
                    "the first argument of `{}` must be a function, got {}",
                    b.name,
                    shown(value.ty)
                );
                l.error(message, e.span, format!("this is {}", shown(value.ty)))
                    .hint_also(b.signature());
            }
            (value, label)
        };
        let probe = |p: Probe| Op::Probe(p);
        match form {
            Form::Map => {
                let (f, label) = function(self, arg(0));
                let over = self.maybe(arg(1));
                let site = self.site(&label, Vec::new(), 0);
                let container = self.op(Op::Map { f: f.at, over: over.at, site }, Type::Any, span);
                self.push(Op::Gather, span);
                container
            }
            Form::Fold => {
                let (f, label) = function(self, arg(0));
                let init = self.maybe(arg(1));
                let over = self.maybe(arg(2));
                let site = self.site(&label, Vec::new(), 0);
                self.op(Op::Fold { f: f.at, init: init.at, over: over.at, site }, Type::Any, span)
            }
            Form::Mem => {
                let (f, label) = function(self, arg(0));
                let site = self.site(&label, Vec::new(), 0);
                self.op(Op::Mem { f: f.at, site }, Type::Function, span)
            }
            Form::LogJoint => self.op(probe(Probe::LogJoint), Type::Num, span),
            Form::LogPrior => self.op(probe(Probe::LogPrior), Type::Num, span),
            Form::LogLikelihood => self.op(probe(Probe::LogLikelihood), Type::Num, span),
        }
    }

    /// Checks the number and keywords of a named function's arguments.
    fn check_arity(
        &mut self,
        block: BlockId,
        args: &[(Option<Arc<str>>, Typed, Span)],
        span: Span,
    ) {
        let BlockKind::Function { name, params, required } = &self.code.blocks[block].kind else {
            return;
        };
        let (name, params, required) = (Arc::clone(name), Arc::clone(params), *required);
        let signature = format!("{name}({})", params.join(", "));
        let mut given = vec![false; params.len()];
        for (i, (keyword, _, at)) in args.iter().enumerate() {
            let p = match keyword {
                Some(k) => params.iter().position(|p| p == k),
                None => Some(i).filter(|i| *i < params.len()),
            };
            match (p, keyword) {
                (Some(p), _) if !given[p] => given[p] = true,
                (Some(p), _) => {
                    self.error(
                        format!("`{name}` got its argument `{}` twice", params[p]),
                        *at,
                        "given again here",
                    );
                    return;
                }
                (None, Some(k)) => {
                    let near = pcadlang_syntax::diag::nearest(k, params.iter().map(|p| &**p))
                        .map(str::to_owned);
                    let e = self.error(
                        format!("`{name}` has no argument `{k}`"),
                        *at,
                        "unknown keyword",
                    );
                    e.hint_also(near.map_or(signature, |n| format!("did you mean `{n}`?")));
                    return;
                }
                (None, None) => {
                    let takes = match params.len() {
                        0 => "no arguments".to_owned(),
                        1 => "1 argument".to_owned(),
                        n => format!("{n} arguments"),
                    };
                    self.error(
                        format!("`{name}` takes {takes}, got {}", args.len()),
                        *at,
                        "one too many",
                    )
                    .hint_also(signature);
                    return;
                }
            }
        }
        if let Some(p) = (0..required).find(|p| !given[*p]) {
            self.error(
                format!("`{name}` needs its argument `{}`", params[p]),
                span,
                "in this call",
            )
            .hint_also(signature);
        }
    }
}

/// How far the sum of weights may be from 1 by rounding, and how far if they are probabilities
/// of which one is wrong or missing; anything else are weights of any scale.
const NEAR_1: std::ops::Range<f64> = 0.011..0.25;

/// A warning about weights that are written like probabilities, but do not sum to 1.
fn unlike_probabilities(b: &Builtin, p: usize, written: &Expr) -> Option<Diagnostic> {
    let of_weights = [("categorical", 0), ("mixture", 0), ("multinomial", 1)];
    if !b.module.is_empty() || !of_weights.contains(&(&*b.name, p)) {
        return None;
    }
    let Literal::Nums(weights) = Literal::of(written) else { return None };
    let sum: f64 = weights.iter().sum();
    let alike = weights.iter().all(|w| (0.0..=1.0).contains(w));
    if !alike || !NEAR_1.contains(&(sum - 1.0).abs()) {
        return None;
    }
    let sum = (sum * 1e9).round() / 1e9;
    let message = format!("the weights of `{}` sum to {sum}, not to 1", b.name);
    let warning = Diagnostic::new(Severity::Warning, message);
    let hint = format!("if they are right, each is divided by {sum}; is one wrong or missing?");
    Some(warning.primary(written.span, "weights like probabilities").hint(hint))
}

/// The fault of a number or word that is written where its argument does not take it.
fn refused(b: &Builtin, p: usize, written: &Expr) -> Option<Fault> {
    let domain = b.args.get(p)?.domain;
    let value = match Literal::of(written) {
        Literal::Num(x) => Value::Num(x),
        Literal::Str(s) => Value::Str(s),
        _ => return None,
    };
    let values: Vec<&Value> = (0..=p).map(|i| if i == p { &value } else { &Value::Unit }).collect();
    let a = Args { builtin: b, values: &values };
    match domain {
        Domain::Any => None,
        Domain::Words(_) => a.word(p).err(),
        _ => a.num(p).err(),
    }
}
