//! Expressions.

use super::lowerer::{Lowerer, Typed};
use super::scope::{Meaning, Scope, ScopeKind};
use super::types::shown;
use crate::lang::builtins::{Kind, Type};
use crate::lang::code::{BlockId, BlockKind, Op, Operand};
use crate::lang::ids::FrameId;
use crate::lang::index::index_value;
use crate::lang::value::{Closure, Value};
use pcadlang_syntax::ast::{BinaryOp, Body, Expr, ExprKind, Lambda, Name, UnaryOp};
use pcadlang_syntax::print_expr;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

impl Lowerer<'_> {
    /// Lowers an expression into the current block.
    pub fn expr(&mut self, e: &Expr) -> Typed {
        match &e.kind {
            ExprKind::Num(x) => self.constant(Value::Num(*x)),
            ExprKind::Str(s) => self.constant(Value::Str(Arc::clone(s))),
            ExprKind::Bool(b) => self.constant(Value::Bool(*b)),
            ExprKind::Var(name) => self.variable(name, e.span),
            ExprKind::Address(_) | ExprKind::TagSel { .. } => {
                if self.refused_in_plans(e.span) {
                    return self.nothing();
                }
                self.error(
                    "a selection of choices is not a value of the model",
                    e.span,
                    "a selection",
                )
                .hint_also("selections belong in inference blocks, `freeze` and `force`");
                self.nothing()
            }
            ExprKind::Array(xs) => {
                let items: Box<[Operand]> = xs.iter().map(|x| self.expr(x).at).collect();
                if let Some(v) = self.constant_items(&items) {
                    return self.constant(v);
                }
                self.op(Op::Array(items), Type::Array, e.span)
            }
            ExprKind::Record(fields) => self.record(fields, e.span),
            ExprKind::Call { callee, args } => self.call(e, callee, args),
            ExprKind::Index { .. } => self.index(e),
            ExprKind::Field { base, field } => self.field(e, base, field),
            ExprKind::Unary { op, expr } => {
                let v = self.expr(expr);
                let name = match op {
                    UnaryOp::Neg => "neg",
                    UnaryOp::Not => "not",
                };
                if let (UnaryOp::Neg, Operand::Const(i)) = (op, v.at)
                    && let Value::Num(x) = self.code.const_value(i)
                {
                    let x = -*x;
                    return self.constant(Value::Num(x));
                }
                self.operator(name, &[(v, expr.span)], e.span)
            }
            ExprKind::Binary { op, left, right } => self.binary(*op, left, right, e.span),
            ExprKind::If { then, otherwise, .. }
                if [then, otherwise].iter().any(|b| !b.is_expression())
                    && self.refused_in_plans(e.span) =>
            {
                self.nothing()
            }
            ExprKind::If { cond, then, otherwise } => self.if_else(cond, then, otherwise),
            ExprKind::Lambda(_) if self.refused_in_plans(e.span) => self.nothing(),
            ExprKind::Lambda(l) => self.lambda(l, &Arc::from("fn"), e.span),
            ExprKind::Error => self.nothing(),
        }
    }

    /// Lowers an expression that is bound to a name, which is a function's name in
    /// addresses.
    pub fn expr_named(&mut self, e: &Expr, name: &Arc<str>) -> Typed {
        match &e.kind {
            ExprKind::Lambda(l) => self.lambda(l, name, e.span),
            ExprKind::Call { callee, args } => self.call(e, callee, args),
            _ => self.expr(e),
        }
    }

    pub fn op(&mut self, op: Op, ty: Type, span: Span) -> Typed {
        let slot = self.push(op, span);
        Typed { at: Operand::Local(slot), ty }
    }

    /// Returns an array of the items, if all are constants.
    fn constant_items(&self, items: &[Operand]) -> Option<Value> {
        let values: Option<Vec<Value>> = items
            .iter()
            .map(|o| match o {
                Operand::Const(i) => Some(self.code.const_value(*i).clone()),
                _ => None,
            })
            .collect();
        values.map(Value::from_elements)
    }

    pub fn variable(&mut self, name: &Arc<str>, span: Span) -> Typed {
        if let Some((b, up)) = self.lookup(name) {
            return match b.meaning {
                Meaning::Value(o) => Typed { at: Self::reach(o, up), ty: b.ty },
                Meaning::Container(slot) => {
                    Typed { at: Self::reach(Operand::Local(slot), up), ty: Type::Any }
                }
                Meaning::Function(block) => {
                    self.constant(Value::Closure(Closure { block, frame: FrameId::ROOT }))
                }
            };
        }
        if let Some(x) = self.code.builtins.constant(name) {
            return self.constant(Value::Num(x));
        }
        if let Some(i) = self.find_builtin(name) {
            match self.code.builtins.get(i).kind {
                Kind::Function(_) | Kind::Distribution(_) => {
                    return self.constant(Value::Builtin(i));
                }
                Kind::Form(_) => {
                    self.error(format!("`{name}` can only be called"), span, "not a value")
                        .hint_also(format!("wrap it in a function: fn(x) {{ {name}(…) }}"));
                }
                Kind::Plan(_) => self.only_in_plans(name, span),
            }
            return self.nothing();
        }
        if self.modules[self.module].namespaces.contains_key(name) {
            self.error(format!("`{name}` is a namespace, not a value"), span, "a namespace")
                .hint_also(format!("write {name}.NAME"));
            return self.nothing();
        }
        self.unbound(name, span);
        self.nothing()
    }

    pub fn only_in_plans(&mut self, name: &str, span: Span) {
        let message = format!("`{name}` belongs in an inference block");
        self.error(message, span, "not a function of the model")
            .hint_also(format!("infer {{ repeat 1000 {{ {name}(…); }} }}"));
    }

    fn record(&mut self, fields: &[(Name, Expr)], span: Span) -> Typed {
        let mut names: Vec<Arc<str>> = Vec::with_capacity(fields.len());
        let mut values = Vec::with_capacity(fields.len());
        for (name, e) in fields {
            if names.contains(&name.node) {
                self.error(
                    format!("the field `{}` occurs twice", name.node),
                    name.span,
                    "again here",
                );
            }
            names.push(Arc::clone(&name.node));
            values.push(self.expr(e).at);
        }
        self.op(Op::Record { names: names.into(), values: values.into() }, Type::Record, span)
    }

    /// Lowers `a[i]`; all keys of a container are one operation.
    fn index(&mut self, e: &Expr) -> Typed {
        let mut keys = Vec::new();
        let mut base = e;
        while let ExprKind::Index { base: b, index } = &base.kind {
            keys.push(&**index);
            base = b;
        }
        keys.reverse();
        if let ExprKind::Var(name) = &base.kind
            && let Some((binding, up)) = self.lookup(name)
            && let Meaning::Container(slot) = binding.meaning
        {
            let written = keys.iter().map(|k| format!("[{}]", print_expr(k))).collect::<String>();
            if let Some(o) = self.drawn_here(name, &written) {
                return Typed { at: o, ty: Type::Any };
            }
            let keys = keys.iter().map(|k| self.expr(k).at).collect();
            let base = Self::reach(Operand::Local(slot), up);
            return self.op(Op::Index { base, keys }, Type::Any, e.span);
        }
        let mut value = self.expr(base);
        for k in keys {
            let key = self.expr(k);
            if matches!(
                value.ty,
                Type::Num
                    | Type::Int
                    | Type::Bool
                    | Type::Str
                    | Type::Dist
                    | Type::Function
                    | Type::Likelihood
            ) {
                let message = format!("{} has no elements", shown(value.ty));
                self.error(message, base.span, format!("this is {}", shown(value.ty)));
                return self.nothing();
            }
            if matches!(value.ty, Type::Array | Type::Nums)
                && matches!(
                    key.ty,
                    Type::Bool | Type::Str | Type::Record | Type::Dist | Type::Function
                )
            {
                let message =
                    format!("an array index must be a whole number, got {}", shown(key.ty));
                self.error(message, k.span, format!("this is {}", shown(key.ty)));
                return self.nothing();
            }
            value = self.op(Op::Index { base: value.at, keys: [key.at].into() }, Type::Any, e.span);
        }
        value
    }

    /// Checks a field of a value that is known before a run, such as a column of a file:
    /// it must exist, unless it may never be read.
    fn check_field(&mut self, base: Operand, field: &Name) {
        let always = |s: &Scope| matches!(s.kind, ScopeKind::Root | ScopeKind::Loop { .. });
        let Operand::Const(i) = base else { return };
        if !self.scopes.iter().all(always) {
            return;
        }
        let value = self.code.const_value(i);
        if !matches!(value, Value::Record(_)) {
            return;
        }
        let key = Value::Str(Arc::clone(&field.node));
        if let Err(fault) = index_value(value, &key) {
            let e = self.error(fault.message, field.span, "not a field of it");
            if let Some(hint) = fault.hint {
                e.hint_also(hint);
            }
        }
    }

    fn field(&mut self, e: &Expr, base: &Expr, field: &Name) -> Typed {
        if let ExprKind::Var(ns) = &base.kind
            && self.lookup(ns).is_none()
            && let Some(space) = self.modules[self.module].namespaces.get(ns).cloned()
        {
            return self.member(ns, space.module, field, e.span);
        }
        let value = self.expr(base);
        if matches!(
            value.ty,
            Type::Num
                | Type::Int
                | Type::Bool
                | Type::Str
                | Type::Array
                | Type::Nums
                | Type::Dist
                | Type::Function
        ) {
            let message = format!("{} has no field `{}`", shown(value.ty), field.node);
            let e = self.error(message, base.span, format!("this is {}", shown(value.ty)));
            match value.ty {
                Type::Array => {
                    e.hint_also("elements of an array are indexed by number: a[0], a[1], …")
                }
                Type::Function => e.hint_also(format!("call it first: f(…).{}", field.node)),
                _ => {}
            }
            return self.nothing();
        }
        self.check_field(value.at, field);
        let key = self.constant(Value::Str(Arc::clone(&field.node)));
        self.op(Op::Index { base: value.at, keys: [key.at].into() }, Type::Any, e.span)
    }

    /// Lowers `ns.name` as a value.
    fn member(&mut self, ns: &str, module: usize, field: &Name, span: Span) -> Typed {
        if let Some(b) = self.modules[module].names.get(&field.node).copied() {
            let up = (self.scopes.len() - 1) as u16;
            return match b.meaning {
                Meaning::Value(o) => Typed { at: Self::reach(o, up), ty: b.ty },
                Meaning::Container(slot) => {
                    Typed { at: Self::reach(Operand::Local(slot), up), ty: Type::Any }
                }
                Meaning::Function(block) => {
                    self.constant(Value::Closure(Closure { block, frame: FrameId::ROOT }))
                }
            };
        }
        if let Some(native) = &self.modules[module].native
            && let Some(i) = self.code.builtins.find(native, &field.node)
        {
            return self.constant(Value::Builtin(i));
        }
        self.no_member(ns, module, field);
        let _ = span;
        self.nothing()
    }

    /// Returns the index of a built-in of the language, or of the native module to which
    /// this file belongs.
    pub fn find_builtin(&self, name: &str) -> Option<u32> {
        let native = self.modules[self.module].native.as_deref();
        native
            .and_then(|m| self.code.builtins.find(m, name))
            .or_else(|| self.code.builtins.find("", name))
    }

    fn binary(&mut self, op: BinaryOp, left: &Expr, right: &Expr, span: Span) -> Typed {
        match op {
            BinaryOp::And | BinaryOp::Or => {
                let cond = self.expr(left);
                self.check_bool(cond, left.span, "the operands of `and` and `or` must be bools");
                let settled = self.constant(Value::Bool(op == BinaryOp::Or)).at;
                let other = self.branch(|l| {
                    let v = l.expr(right);
                    l.check_bool(v, right.span, "the operands of `and` and `or` must be bools");
                    Some(v)
                });
                let fixed = self.branch(|_| Some(Typed { at: settled, ty: Type::Bool }));
                let (then, otherwise) =
                    if op == BinaryOp::And { (other.0, fixed.0) } else { (fixed.0, other.0) };
                self.op(Op::If { cond: cond.at, then, otherwise }, Type::Bool, left.span)
            }
            BinaryOp::Intersect => {
                self.error("`&` joins selections of choices", span, "not in the model")
                    .hint_also("the logical connective is `and`");
                self.nothing()
            }
            _ => {
                let (a, b) = (self.expr(left), self.expr(right));
                self.operator(operator_name(op), &[(a, left.span), (b, right.span)], span)
            }
        }
    }

    /// Lowers an operator of the table.
    fn operator(&mut self, name: &str, args: &[(Typed, Span)], span: Span) -> Typed {
        let Some(builtin) = self.code.builtins.find("", name) else { return self.nothing() };
        // One message per operator.
        if let Some((v, at)) = args.iter().find(|(v, _)| !operand_fits(name, v.ty)) {
            let shown_op = if name == "neg" { "-" } else { name };
            let wanted = match name {
                "not" => "a bool",
                "+" | "<" | "<=" | ">" | ">=" => "numbers, arrays of them, or strings",
                "*" => "numbers, arrays of them, or a placement and a solid",
                ".." => "whole numbers",
                _ => "numbers or arrays of them",
            };
            let message = format!("`{shown_op}` needs {wanted}, got {}", shown(v.ty));
            let e = self.error(message, *at, format!("this is {}", shown(v.ty)));
            match v.ty {
                Type::Dist => e.hint_also("draw a value first: x ~ …; then use x"),
                Type::Function => e.hint_also("call it: f(…)"),
                Type::Num | Type::Int if name == "not" => e.hint_also("compare it, e.g. x == 0"),
                _ => {}
            }
            return self.nothing();
        }
        let comparison = matches!(name, "==" | "!=" | "<" | "<=" | ">" | ">=" | "not");
        let all_numbers = args.iter().all(|(v, _)| matches!(v.ty, Type::Num | Type::Int));
        let ty = match name {
            "==" | "!=" => Type::Bool,
            ".." => Type::Array,
            _ if comparison && all_numbers => Type::Bool,
            _ if all_numbers => Type::Num,
            _ => Type::Any,
        };
        let args = args.iter().map(|(v, _)| v.at).collect();
        self.op(Op::Prim { builtin, args }, ty, span)
    }

    pub fn check_bool(&mut self, v: Typed, span: Span, what: &str) {
        if !matches!(v.ty, Type::Any | Type::Bool) {
            let e = self.error(
                format!("{what}, got {}", shown(v.ty)),
                span,
                format!("this is {}", shown(v.ty)),
            );
            if matches!(v.ty, Type::Num | Type::Int | Type::Nums) {
                e.hint_also("compare it, e.g. x != 0");
            }
        }
    }

    fn if_else(&mut self, cond: &Expr, then: &Body, otherwise: &Body) -> Typed {
        let c = self.expr(cond);
        self.check_bool(c, cond.span, "the condition of `if` must be a bool");
        let a = self.branch(|l| l.body_of(then));
        let b = self.branch(|l| l.body_of(otherwise));
        let ty = if a.1 == b.1 { a.1 } else { Type::Any };
        self.op(Op::If { cond: c.at, then: a.0, otherwise: b.0 }, ty, cond.span)
    }

    /// Lowers a branch into a separate block.
    fn branch(&mut self, f: impl FnOnce(&mut Self) -> Option<Typed>) -> (BlockId, Type) {
        let block = self.new_block(BlockKind::Branch);
        self.scopes.push(Scope::new(block, ScopeKind::Branch));
        let result = f(self);
        self.scopes.pop();
        // The result is an operand as seen from inside the branch, from where outer slots
        // are one level further out.
        self.code.blocks[block].result = result.map(|t| t.at);
        (block, result.map_or(Type::Any, |t| t.ty))
    }

    pub fn lambda(&mut self, l: &Lambda, name: &Arc<str>, span: Span) -> Typed {
        let block = self.function_block(Arc::clone(name), l);
        self.function_body(block, l);
        self.op(Op::Closure(block), Type::Function, span)
    }
}

/// True if an operator may take an operand of this static type.
fn operand_fits(name: &str, ty: Type) -> bool {
    match (name, ty) {
        ("==" | "!=", _) | (_, Type::Any | Type::Array) => true,
        ("not", ty) => ty == Type::Bool,
        (_, Type::Num | Type::Int | Type::Nums) => true,
        ("+" | "<" | "<=" | ">" | ">=", Type::Str) => true,
        ("+", Type::Covariance) => true,
        ("*", Type::Covariance | Type::Object(_)) => true,
        _ => false,
    }
}

/// Returns the name of an operator in the table of built-ins.
fn operator_name(op: BinaryOp) -> &'static str {
    match op {
        BinaryOp::Add => "+",
        BinaryOp::Sub => "-",
        BinaryOp::Mul => "*",
        BinaryOp::Div => "/",
        BinaryOp::Rem => "%",
        BinaryOp::Pow => "**",
        BinaryOp::Eq => "==",
        BinaryOp::Ne => "!=",
        BinaryOp::Lt => "<",
        BinaryOp::Le => "<=",
        BinaryOp::Gt => ">",
        BinaryOp::Ge => ">=",
        BinaryOp::Range => "..",
        BinaryOp::Intersect | BinaryOp::And | BinaryOp::Or => "",
    }
}
