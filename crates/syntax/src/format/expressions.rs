//! Prints expressions: operators and their parentheses, calls, literals, addresses.

use super::printer::{Printer, Share};
use crate::ast::*;
use crate::string::{quote, record_key};
use crate::token::is_name;

/// How tightly an expression binds, as in the grammar. An operand that binds less tightly
/// than its position requires needs parentheses.
pub(super) type Binding = u8;
const WHOLE: Binding = 0;
const OR: Binding = 1;
const AND: Binding = 2;
const NOT: Binding = 3;
const COMPARISON: Binding = 4;
const RANGE: Binding = 5;
const SUM: Binding = 6;
const PRODUCT: Binding = 7;
const NEGATION: Binding = 8;
const POWER: Binding = 9;
pub(super) const POSTFIX: Binding = 10;

/// Returns the text of an operator, its binding, and the least bindings of its operands.
fn operator(op: BinaryOp) -> (&'static str, Binding, Binding, Binding) {
    match op {
        BinaryOp::Or => ("or", OR, OR, AND),
        BinaryOp::And => ("and", AND, AND, NOT),
        BinaryOp::Eq => ("==", COMPARISON, RANGE, RANGE),
        BinaryOp::Ne => ("!=", COMPARISON, RANGE, RANGE),
        BinaryOp::Lt => ("<", COMPARISON, RANGE, RANGE),
        BinaryOp::Le => ("<=", COMPARISON, RANGE, RANGE),
        BinaryOp::Gt => (">", COMPARISON, RANGE, RANGE),
        BinaryOp::Ge => (">=", COMPARISON, RANGE, RANGE),
        BinaryOp::Range => ("..", RANGE, SUM, SUM),
        BinaryOp::Add => ("+", SUM, SUM, PRODUCT),
        BinaryOp::Sub => ("-", SUM, SUM, PRODUCT),
        BinaryOp::Mul => ("*", PRODUCT, PRODUCT, NEGATION),
        BinaryOp::Div => ("/", PRODUCT, PRODUCT, NEGATION),
        BinaryOp::Rem => ("%", PRODUCT, PRODUCT, NEGATION),
        BinaryOp::Intersect => ("&", PRODUCT, PRODUCT, NEGATION),
        BinaryOp::Pow => ("**", POWER, POSTFIX, NEGATION),
    }
}

fn binding(expr: &Expr) -> Binding {
    match &expr.kind {
        ExprKind::If { .. } | ExprKind::Lambda(_) => WHOLE,
        ExprKind::Binary { op, .. } => operator(*op).1,
        ExprKind::Unary { op: UnaryOp::Not, .. } => NOT,
        ExprKind::Unary { op: UnaryOp::Neg, .. } => NEGATION,
        ExprKind::Num(x) if x.is_sign_negative() => NEGATION,
        _ => POSTFIX,
    }
}

/// Returns whether an `if` must be, or may be, written without its last `else`: the
/// branches have no value, and the `else` would be empty.
pub(super) fn lacks_else(expr: &Expr) -> bool {
    match &expr.kind {
        ExprKind::If { then, otherwise, .. } if then.result.is_none() => match &otherwise.result {
            _ if !otherwise.stmts.is_empty() => false,
            None => true,
            Some(nested) => lacks_else(nested),
        },
        _ => false,
    }
}

/// Returns whether an expression ends with a bracket that it opens.
pub(super) fn in_brackets(expr: &Expr) -> bool {
    matches!(
        expr.kind,
        ExprKind::Array(_) | ExprKind::Record(_) | ExprKind::Lambda(_) | ExprKind::If { .. }
    )
}

/// Returns whether an expression is short: a literal or a name.
fn is_short(expr: &Expr) -> bool {
    match &expr.kind {
        ExprKind::Num(_) | ExprKind::Bool(_) | ExprKind::Var(_) | ExprKind::Str(_) => true,
        ExprKind::Unary { op: UnaryOp::Neg, expr } => is_short(expr),
        _ => false,
    }
}

/// Returns the shortest text that is read as the same number.
fn number(x: f64) -> String {
    let text = format!("{x:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

impl Printer<'_> {
    /// Prints an expression in a position that requires the binding `least`. If there is
    /// a source, the parentheses come from it.
    pub fn operand(&mut self, expr: &Expr, least: Binding) {
        if self.source.is_none() && binding(expr) < least {
            self.text("(");
            self.expr(expr);
            self.text(")");
        } else {
            self.expr(expr);
        }
    }

    /// Prints an expression, in the parentheses that it has in the source.
    pub fn expr(&mut self, expr: &Expr) {
        let parentheses =
            self.source.as_ref().map_or(0, |source| source.parentheses(expr.span.start));
        (0..parentheses).for_each(|_| self.text("("));
        self.bare(expr);
        (0..parentheses).for_each(|_| self.text(")"));
    }

    fn bare(&mut self, expr: &Expr) {
        match &expr.kind {
            ExprKind::Num(x) => self.token(&number(*x)),
            ExprKind::Str(text) => self.token(&quote(text)),
            ExprKind::Bool(value) => self.text(value),
            ExprKind::Var(name) => self.token(name),
            ExprKind::Address(address) => self.address(address),
            ExprKind::TagSel { name, value } => {
                let bare = |v: &str| {
                    !v.is_empty() && v.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_')
                };
                let value = value
                    .as_ref()
                    .map(|v| if bare(v) { format!(":{v}") } else { format!(":{}", quote(v)) });
                self.token(&format!("${name}{}", value.unwrap_or_default()));
            }
            ExprKind::Array(items) => {
                let share = if items.iter().all(is_short) { Share::Lines } else { Share::Nothing };
                self.brackets(("[", "", "]"), items, share, Self::expr);
            }
            ExprKind::Record(fields) => {
                self.brackets(("{", " ", "}"), fields, Share::Nothing, |p, (name, value)| {
                    p.token(&record_key(&name.node));
                    p.text(": ");
                    p.expr(value);
                })
            }
            ExprKind::Call { callee, args } => {
                self.operand(callee, POSTFIX);
                self.args(args);
            }
            ExprKind::Index { base, index } => {
                self.base(base);
                self.text("[");
                self.expr(index);
                self.text("]");
            }
            ExprKind::Field { base, field } => {
                self.base(base);
                self.text(".");
                self.token(&field.node);
            }
            ExprKind::Unary { op: UnaryOp::Neg, expr } => {
                self.text("-");
                self.operand(expr, NEGATION);
            }
            ExprKind::Unary { op: UnaryOp::Not, expr } => {
                self.text("not ");
                self.operand(expr, NOT);
            }
            ExprKind::Binary { op, .. } if matches!(operator(*op).1, RANGE | POWER) => {
                self.chain(expr)
            }
            ExprKind::Binary { .. } => self.group(|p| p.chain(expr)),
            ExprKind::If { .. } => self.if_else(expr, false),
            ExprKind::Lambda(lambda) => {
                self.text("fn");
                self.lambda(lambda);
            }
            ExprKind::Error => self.text("<error>"),
        }
    }

    fn args(&mut self, args: &[Arg]) {
        let alone = matches!(args, [Arg { name: None, value }] if in_brackets(value));
        let share = if alone { Share::Brackets } else { Share::Nothing };
        self.brackets(("(", "", ")"), args, share, |p, arg| {
            if let Some(name) = &arg.name {
                p.token(&name.node);
                p.text(" = ");
            }
            p.expr(&arg.value);
        });
    }

    /// Prints operators of equal binding and their operands; except at `..` and `**`, a
    /// line may be broken before each operator.
    fn chain(&mut self, expr: &Expr) {
        let ExprKind::Binary { op, left, right } = &expr.kind else { return self.bare(expr) };
        let (text, own, left_least, right_least) = operator(*op);
        let same = matches!(left.kind, ExprKind::Binary { .. })
            && binding(left) == own
            && left_least == own;
        let bare =
            self.source.as_ref().is_none_or(|source| source.parentheses(left.span.start) == 0);
        if same && bare {
            self.chain(left);
        } else {
            self.operand(left, left_least);
        }
        if matches!(own, RANGE | POWER) {
            self.text(format_args!(" {text} "));
            self.operand(right, right_least);
        } else {
            self.continued(|p| {
                p.text(format_args!("{text} "));
                p.operand(right, right_least);
            });
        }
    }

    /// Prints what is indexed. An address needs parentheses, because `[` and `.` right
    /// after it would be part of it.
    fn base(&mut self, base: &Expr) {
        let address = matches!(base.kind, ExprKind::Address(_));
        self.operand(base, if address { POSTFIX + 1 } else { POSTFIX });
    }

    /// Prints an `if`, without its last `else` if `open`. Its blocks are broken together.
    pub fn if_else(&mut self, expr: &Expr, open: bool) {
        let broken = self.breaks(expr);
        self.blocks(broken, |p| p.if_chain(expr, open));
    }

    /// Returns whether a block of an `if` is on several lines in the source.
    fn breaks(&self, expr: &Expr) -> bool {
        let ExprKind::If { then, otherwise, .. } = &expr.kind else { return false };
        let broken = |body: &Body| {
            self.source.as_ref().is_some_and(|source| source.opened_at(body.span.start))
        };
        broken(then)
            || broken(otherwise)
            || otherwise.result.as_ref().is_some_and(|nested| self.breaks(nested))
    }

    fn if_chain(&mut self, expr: &Expr, open: bool) {
        let ExprKind::If { cond, then, otherwise } = &expr.kind else { return self.expr(expr) };
        self.text("if ");
        self.operand(cond, OR);
        self.text(" ");
        self.branch(then);
        let nested = otherwise.result.as_ref().filter(|nested| {
            otherwise.stmts.is_empty() && matches!(nested.kind, ExprKind::If { .. })
        });
        let has_else = self.next_is("else");
        if !has_else.unwrap_or_else(|| {
            !open || nested.is_some() || otherwise.result.is_some() || !otherwise.stmts.is_empty()
        }) {
            return;
        }
        self.text(" else ");
        match nested {
            Some(nested) if self.next_is("if").unwrap_or(true) => self.if_chain(nested, open),
            _ => self.branch(otherwise),
        }
    }

    /// Prints a block of an `if`; in the canonical form, each is broken or not by itself.
    fn branch(&mut self, body: &Body) {
        if self.source.is_some() { self.body_lines(body) } else { self.body(body) }
    }

    fn address(&mut self, address: &Address) {
        if self.source.is_some() {
            return self.token("");
        }
        self.text("@");
        for (i, segment) in address.segments.iter().enumerate() {
            if i > 0 {
                self.text("/");
            }
            match &segment.name {
                SegmentName::Name(name) => self.text(name),
                SegmentName::Any => self.text("*"),
                SegmentName::Deep => self.text("**"),
            }
            if segment.occurrence != 1 {
                self.text(format_args!("#{}", segment.occurrence));
            }
            for key in &segment.keys {
                self.key(key);
            }
        }
    }

    fn key(&mut self, key: &Key) {
        match key {
            Key::Str(word) if is_name(word) => self.text(format_args!("[{word}]")),
            Key::Str(text) => self.token(&format!("[{}]", quote(text))),
            Key::Num(x) => self.text(format_args!("[{}]", number(*x))),
            Key::Any => self.text("[*]"),
            Key::Expr(expr) => {
                let inline = std::mem::replace(&mut self.inline, true);
                self.text("[{");
                self.expr(expr);
                self.text("}]");
                self.inline = inline;
            }
        }
    }
}
