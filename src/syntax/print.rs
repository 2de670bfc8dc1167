//! The tree back to text, in one canonical form: two spaces of indentation, a line for each statement, no more
//! parentheses than needed. Comments are not in the tree, so this is no formatter.
//!
//! Parsing what [`print`] gives yields the same tree up to spans, for every tree that the parser makes without errors.

use super::ast::*;
use super::string::quote;
use super::token::is_name;
use std::fmt::Display;

/// A program as text.
pub fn print(program: &Program) -> String {
    let mut p = Printer::default();
    for item in &program.items {
        p.item(item);
        p.out.push('\n');
    }
    p.out
}

/// An expression as text.
pub fn print_expr(expr: &Expr) -> String {
    let mut p = Printer::default();
    p.expr(expr);
    p.out
}

/// How tightly an expression binds, as in the grammar; an operand looser than its place needs parentheses.
type Binding = u8;
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
const POSTFIX: Binding = 10;

/// The text of an operator, its own binding, and those its operands need.
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

/// Whether an `if` must be, or may be, written without its last `else`: no branch has a value, and nothing is done
/// otherwise.
fn lacks_else(expr: &Expr) -> bool {
    match &expr.kind {
        ExprKind::If { then, otherwise, .. } if then.result.is_none() => match &otherwise.result {
            _ if !otherwise.stmts.is_empty() => false,
            None => true,
            Some(nested) => lacks_else(nested),
        },
        _ => false,
    }
}

/// The shortest text that is read as the same number.
fn number(x: f64) -> String {
    let text = format!("{x:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

#[derive(Default)]
struct Printer {
    out: String,
    indent: usize,
    /// In a computed key, which must stay on its line.
    inline: bool,
}

impl Printer {
    fn text(&mut self, text: impl Display) {
        self.out.push_str(&text.to_string());
    }

    /// `prefix` and what `print` prints, if there is a value.
    fn maybe<T>(&mut self, prefix: &str, value: Option<&T>, print: impl FnOnce(&mut Self, &T)) {
        if let Some(value) = value {
            self.text(prefix);
            print(self, value);
        }
    }

    fn list<T>(&mut self, items: &[T], mut print: impl FnMut(&mut Self, &T)) {
        for (i, item) in items.iter().enumerate() {
            if i > 0 {
                self.text(", ");
            }
            print(self, item);
        }
    }

    fn name(&mut self, name: &Name) {
        self.text(&name.node);
    }

    /// The lines of a block, in braces.
    fn block(&mut self, lines: usize, mut print: impl FnMut(&mut Self, usize)) {
        if lines == 0 {
            return self.text("{}");
        }
        self.text("{");
        self.indent += 1;
        for i in 0..lines {
            self.line();
            print(self, i);
        }
        self.indent -= 1;
        self.line();
        self.text("}");
    }

    fn line(&mut self) {
        if self.inline {
            self.out.push(' ');
        } else {
            self.out.push('\n');
            self.out.extend(std::iter::repeat_n("  ", self.indent));
        }
    }

    fn item(&mut self, item: &Item) {
        match &item.kind {
            ItemKind::Include { path, alias } => {
                self.text(format_args!("include {}", quote(&path.node)));
                self.maybe(" as ", alias.as_ref(), Self::name);
                self.text(";");
            }
            ItemKind::Param(declaration) => self.declaration("param ", declaration),
            ItemKind::Data(declaration) => self.declaration("data ", declaration),
            ItemKind::Fn(FnDecl { name, lambda }) => {
                self.text("fn ");
                self.name(name);
                self.lambda(lambda);
            }
            ItemKind::Kernel(KernelDecl { name, params, body }) => {
                self.text("kernel ");
                self.name(name);
                self.params(params);
                self.text(" ");
                self.plan(body);
            }
            ItemKind::Infer { name, body } => {
                self.text("infer ");
                self.maybe("", name.as_ref(), |p, name| p.text(format_args!("{} ", name.node)));
                self.plan(body);
            }
            ItemKind::Report { exprs, file } => {
                self.text("report ");
                self.list(exprs, Self::expr);
                self.maybe(" as ", file.as_ref(), |p, file| p.text(quote(&file.node)));
                self.text(";");
            }
            ItemKind::Export { expr, file } => {
                self.text("export ");
                self.expr(expr);
                self.text(format_args!(" to {};", quote(&file.node)));
            }
            ItemKind::Stmt(stmt) => self.stmt(stmt, false),
        }
    }

    fn declaration(&mut self, keyword: &str, declaration: &Declaration) {
        self.text(keyword);
        self.name(&declaration.name);
        self.maybe(": ", declaration.ty.as_ref(), Self::name);
        self.maybe(" = ", declaration.default.as_ref(), Self::expr);
        self.maybe(" ", declaration.help.as_ref(), |p, help| p.text(quote(&help.node)));
        self.text(";");
    }

    fn params(&mut self, params: &[Param]) {
        self.text("(");
        self.list(params, |p, param| {
            p.name(&param.name);
            p.maybe(": ", param.ty.as_ref(), Self::name);
            p.maybe(" = ", param.default.as_ref(), Self::expr);
        });
        self.text(")");
    }

    fn lambda(&mut self, lambda: &Lambda) {
        self.params(&lambda.params);
        self.text(" ");
        self.body(&lambda.body);
    }

    fn body(&mut self, body: &Body) {
        let Body { stmts, result, .. } = body;
        match result {
            Some(result) if stmts.is_empty() => {
                self.text("{ ");
                self.expr(result);
                self.text(" }");
            }
            result => self.block(stmts.len() + usize::from(result.is_some()), |p, i| match (stmts.get(i), result) {
                (Some(stmt), _) => p.stmt(stmt, result.is_none() && i + 1 == stmts.len()),
                (None, Some(result)) => p.expr(result),
                (None, None) => {}
            }),
        }
    }

    /// A statement; `last` if it ends a body without a value, so that a last `if` must not become the value.
    fn stmt(&mut self, stmt: &Stmt, last: bool) {
        match &stmt.kind {
            StmtKind::Assume { name, bind, expr, tags } => {
                self.text("assume ");
                self.binding(name, *bind, expr);
                self.tags(tags);
            }
            StmtKind::Draw { target, dist, tags } => {
                self.operand(target, POSTFIX);
                self.text(" ~ ");
                self.expr(dist);
                self.tags(tags);
            }
            StmtKind::Let { name, expr } => {
                self.text("let ");
                self.binding(name, Bind::Value, expr);
            }
            StmtKind::Observe { dist, value, coarse, name } => {
                self.pair("observe ", dist, " = ", value);
                self.maybe(" with coarse = ", coarse.as_ref(), Self::expr);
                self.maybe(" as ", name.as_ref(), Self::name);
            }
            StmtKind::Predict { name, bind, expr } => {
                self.text("predict ");
                self.binding(name, *bind, expr);
            }
            StmtKind::Factor { expr, name } => {
                self.text("factor(");
                self.expr(expr);
                self.text(")");
                self.maybe(" as ", name.as_ref(), Self::name);
            }
            StmtKind::Force { target, value } => self.pair("force ", target, " = ", value),
            StmtKind::Freeze(expr) => self.verb("freeze ", expr),
            StmtKind::Forget(expr) => self.verb("forget ", expr),
            StmtKind::Sample(expr) => self.verb("sample ", expr),
            StmtKind::For { var, iter, body } => {
                self.text(format_args!("for {} in ", var.node));
                self.expr(iter);
                self.text(" ");
                return self.block(body.len(), |p, i| body.get(i).map_or((), |stmt| p.stmt(stmt, false)));
            }
            StmtKind::Expr(expr) => return self.expr_stmt(expr, last),
        }
        self.text(";");
    }

    fn expr_stmt(&mut self, expr: &Expr, last: bool) {
        match &expr.kind {
            ExprKind::If { .. } if lacks_else(expr) => self.if_else(expr, true),
            ExprKind::If { .. } if !last => self.expr(expr),
            _ => {
                self.expr(expr);
                self.text(";");
            }
        }
    }

    fn binding(&mut self, name: &Name, bind: Bind, expr: &Expr) {
        self.name(name);
        self.text(if bind == Bind::Random { " ~ " } else { " = " });
        self.expr(expr);
    }

    fn pair(&mut self, verb: &str, left: &Expr, between: &str, right: &Expr) {
        self.verb(verb, left);
        self.verb(between, right);
    }

    fn verb(&mut self, verb: &str, expr: &Expr) {
        self.text(verb);
        self.expr(expr);
    }

    fn tags(&mut self, tags: &[Tag]) {
        for tag in tags {
            self.text(format_args!(" #{}", tag.name.node));
            self.maybe(":", tag.value.as_ref(), Self::expr);
        }
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
            KStmtKind::For { var, iter, body } => return counted(&format!("for {} in ", var.node), iter, body),
            KStmtKind::Mix(arms) => {
                self.text("mix ");
                return self.block(arms.len(), |p, i| {
                    if let Some(arm) = arms.get(i) {
                        p.pair("", &arm.weight, " => ", &arm.kernel);
                        p.text(";");
                    }
                });
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
                self.binding(name, Bind::Value, expr);
            }
        }
        self.text(";");
    }

    fn operand(&mut self, expr: &Expr, least: Binding) {
        if binding(expr) < least {
            self.text("(");
            self.expr(expr);
            self.text(")");
        } else {
            self.expr(expr);
        }
    }

    fn expr(&mut self, expr: &Expr) {
        match &expr.kind {
            ExprKind::Num(x) => self.text(number(*x)),
            ExprKind::Str(text) => self.text(quote(text)),
            ExprKind::Bool(value) => self.text(value),
            ExprKind::Var(name) => self.text(name),
            ExprKind::Address(address) => self.address(address),
            ExprKind::TagSel { name, value } => {
                self.text(format_args!("${name}"));
                let bare = |v: &str| !v.is_empty() && v.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
                self.maybe(":", value.as_ref(), |p, v| p.text(if bare(v) { v.to_string() } else { quote(v) }));
            }
            ExprKind::Array(items) => {
                self.text("[");
                self.list(items, Self::expr);
                self.text("]");
            }
            ExprKind::Record(fields) => {
                self.text("{ ");
                self.list(fields, |p, (name, value)| p.verb(&format!("{}: ", name.node), value));
                self.text(" }");
            }
            ExprKind::Call { callee, args } => {
                self.operand(callee, POSTFIX);
                self.text("(");
                self.list(args, |p, arg| {
                    p.maybe("", arg.name.as_ref(), |p, name| p.text(format_args!("{} = ", name.node)));
                    p.expr(&arg.value);
                });
                self.text(")");
            }
            ExprKind::Index { base, index } => {
                self.base(base);
                self.text("[");
                self.expr(index);
                self.text("]");
            }
            ExprKind::Field { base, field } => {
                self.base(base);
                self.text(format_args!(".{}", field.node));
            }
            ExprKind::Unary { op: UnaryOp::Neg, expr } => {
                self.text("-");
                self.operand(expr, NEGATION);
            }
            ExprKind::Unary { op: UnaryOp::Not, expr } => {
                self.text("not ");
                self.operand(expr, NOT);
            }
            ExprKind::Binary { op, left, right } => {
                let (text, _, left_least, right_least) = operator(*op);
                self.operand(left, left_least);
                self.text(format_args!(" {text} "));
                self.operand(right, right_least);
            }
            ExprKind::If { .. } => self.if_else(expr, false),
            ExprKind::Lambda(lambda) => {
                self.text("fn");
                self.lambda(lambda);
            }
            ExprKind::Error => self.text("<error>"),
        }
    }

    /// What is indexed: right after an address, `[` and `.` would belong to it.
    fn base(&mut self, base: &Expr) {
        let address = matches!(base.kind, ExprKind::Address(_));
        self.operand(base, if address { POSTFIX + 1 } else { POSTFIX });
    }

    /// An `if`, without its last `else` if `open`.
    fn if_else(&mut self, expr: &Expr, open: bool) {
        let ExprKind::If { cond, then, otherwise } = &expr.kind else { return self.expr(expr) };
        self.text("if ");
        self.operand(cond, OR);
        self.text(" ");
        self.body(then);
        match &otherwise.result {
            Some(nested) if otherwise.stmts.is_empty() && matches!(nested.kind, ExprKind::If { .. }) => {
                self.text(" else ");
                self.if_else(nested, open);
            }
            None if open && otherwise.stmts.is_empty() => {}
            _ => {
                self.text(" else ");
                self.body(otherwise);
            }
        }
    }

    fn address(&mut self, address: &Address) {
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
            Key::Str(text) => self.text(format_args!("[{}]", quote(text))),
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
