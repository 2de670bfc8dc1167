//! The syntax tree of a `.pcad` file, as written: names are not resolved and nothing is
//! checked.
//!
//! Every node carries its [`Span`]. Equality compares spans too; use
//! [`print`](super::print) to compare meaning.

use super::span::{Span, Spanned};
use std::sync::Arc;

/// A name in source text.
pub type Name = Spanned<Arc<str>>;

/// A whole file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// Its items, in order.
    pub items: Vec<Item>,
}

/// A top-level item.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// The kind of item.
    pub kind: ItemKind,
    /// The whole item, with its semicolon.
    pub span: Span,
}

/// The kinds of top-level items.
#[derive(Clone, Debug, PartialEq)]
pub enum ItemKind {
    /// `include "file" as ns;`
    Include {
        /// The path, relative to the including file, or `std/…`.
        path: Spanned<Arc<str>>,
        /// The namespace of the included names; without one, they are added to this
        /// file's.
        alias: Option<Name>,
    },
    /// `param name: type = default "help";`, set by `--set name=value`.
    Param(Declaration),
    /// `data name: type;` or `data name = expr;`, bound by `--observe name=FILE`.
    Data(Declaration),
    /// `fn name(params) { … }`
    Fn(FnDecl),
    /// `kernel name(params) { … }`
    Kernel(KernelDecl),
    /// `infer name { … }`
    Infer {
        /// An optional name.
        name: Option<Name>,
        /// The plan.
        body: Vec<KStmt>,
    },
    /// `report e, … as "file";`
    Report {
        /// The reported expressions.
        exprs: Vec<Expr>,
        /// The file in the run directory, if named.
        file: Option<Spanned<Arc<str>>>,
    },
    /// `export e to "file";`
    Export {
        /// The exported expression.
        expr: Expr,
        /// The file in the run directory.
        file: Spanned<Arc<str>>,
    },
    /// A model statement.
    Stmt(Stmt),
}

/// The common form of `param` and `data`.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// Its name.
    pub name: Name,
    /// The declared type, e.g. `int` or `image`.
    pub ty: Option<Name>,
    /// The default value.
    pub default: Option<Expr>,
    /// The help text.
    pub help: Option<Spanned<Arc<str>>>,
}

/// A function declaration.
#[derive(Clone, Debug, PartialEq)]
pub struct FnDecl {
    /// Its name.
    pub name: Name,
    /// Parameters and body.
    pub lambda: Lambda,
}

/// A kernel declaration.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelDecl {
    /// Its name.
    pub name: Name,
    /// The parameters.
    pub params: Vec<Param>,
    /// The body.
    pub body: Vec<KStmt>,
}

/// Parameters and body, of a named function or of `fn(x) { … }`.
#[derive(Clone, Debug, PartialEq)]
pub struct Lambda {
    /// The parameters.
    pub params: Vec<Param>,
    /// The body.
    pub body: Body,
}

/// One parameter: `name: type = default`.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Its name.
    pub name: Name,
    /// The declared type.
    pub ty: Option<Name>,
    /// The default value, evaluated in the scope of the declaration.
    pub default: Option<Expr>,
}

/// `{ stmt* expr }`: statements, then the expression whose value is that of the body.
/// Without one, the value is missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The statements.
    pub stmts: Vec<Stmt>,
    /// The final expression, if any.
    pub result: Option<Box<Expr>>,
    /// The span from the opening to the closing brace.
    pub span: Span,
}

impl Body {
    /// Returns whether it is an expression alone.
    pub fn is_expression(&self) -> bool {
        self.stmts.is_empty() && self.result.is_some()
    }
}

/// A model statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Stmt {
    /// The kind of statement.
    pub kind: StmtKind,
    /// The whole statement, with its semicolon.
    pub span: Span,
}

/// How a name is bound: `~ d` makes a random choice, `= e` gives a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bind {
    /// `~`
    Random,
    /// `=`
    Value,
}

/// The kinds of model statements.
#[derive(Clone, Debug, PartialEq)]
pub enum StmtKind {
    /// `assume x ~ d #tag;` or `assume x = e #tag;`
    Assume {
        /// The name bound.
        name: Name,
        /// `~` or `=`.
        bind: Bind,
        /// The distribution or value.
        expr: Expr,
        /// The tags of every choice at or below the name.
        tags: Vec<Tag>,
    },
    /// `x ~ d #tag;` or `t[k] ~ d #tag;`
    Draw {
        /// A name, or a name indexed once or more.
        target: Expr,
        /// The distribution.
        dist: Expr,
        /// The choice's tags.
        tags: Vec<Tag>,
    },
    /// `let x = e;`
    Let {
        /// The name bound.
        name: Name,
        /// The value.
        expr: Expr,
    },
    /// `observe d = v with coarse = L as name;`
    Observe {
        /// The distribution or likelihood.
        dist: Expr,
        /// The observed value.
        value: Expr,
        /// The surrogate of delayed acceptance.
        coarse: Option<Expr>,
        /// The address of the observation.
        name: Option<Name>,
    },
    /// `predict x ~ d;` or `predict x = e;`
    Predict {
        /// The name recorded.
        name: Name,
        /// `~` or `=`.
        bind: Bind,
        /// The distribution or value.
        expr: Expr,
    },
    /// `factor(logw) as name;`
    Factor {
        /// The log weight.
        expr: Expr,
        /// The address of the factor.
        name: Option<Name>,
    },
    /// `force @a = v;`
    Force {
        /// The address of one choice.
        target: Expr,
        /// Its value.
        value: Expr,
    },
    /// `freeze sel;`
    Freeze(Expr),
    /// `forget name;`
    Forget(Expr),
    /// `sample e;`
    Sample(Expr),
    /// `for i in e { … }`
    For {
        /// The loop variable.
        var: Name,
        /// The iterated expression: a range, an array, or a record's keys.
        iter: Expr,
        /// The body.
        body: Vec<Stmt>,
    },
    /// `e;`, evaluated for the choices and observations made in it.
    Expr(Expr),
}

/// `#name` or `#name:value`.
#[derive(Clone, Debug, PartialEq)]
pub struct Tag {
    /// The tag's name.
    pub name: Name,
    /// The tag's value: a literal, or a variable in scope.
    pub value: Option<Expr>,
    /// The whole tag.
    pub span: Span,
}

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// The kind of expression.
    pub kind: ExprKind,
    /// Its place in the source.
    pub span: Span,
}

/// The kinds of expressions.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// A number.
    Num(f64),
    /// A string.
    Str(Arc<str>),
    /// `true` or `false`.
    Bool(bool),
    /// A name.
    Var(Arc<str>),
    /// `@a/b[k]`
    Address(Address),
    /// `$tag` or `$tag:value`
    TagSel {
        /// The tag's name.
        name: Arc<str>,
        /// The value that the tag must have, if given.
        value: Option<Arc<str>>,
    },
    /// `[a, b]`
    Array(Vec<Expr>),
    /// `{ a: x, b: y }`
    Record(Vec<(Name, Expr)>),
    /// `f(a, k = b)`
    Call {
        /// The function.
        callee: Box<Expr>,
        /// The arguments.
        args: Vec<Arg>,
    },
    /// `a[i]`
    Index {
        /// The array, record, or container.
        base: Box<Expr>,
        /// The index or key.
        index: Box<Expr>,
    },
    /// `a.b`
    Field {
        /// The record or namespace.
        base: Box<Expr>,
        /// The field.
        field: Name,
    },
    /// `-a`, `not a`
    Unary {
        /// The operator.
        op: UnaryOp,
        /// The operand.
        expr: Box<Expr>,
    },
    /// `a + b`, `a and b`, `a .. b`, …
    Binary {
        /// The operator.
        op: BinaryOp,
        /// The left operand.
        left: Box<Expr>,
        /// The right operand.
        right: Box<Expr>,
    },
    /// `if c { … } else { … }`
    If {
        /// The condition.
        cond: Box<Expr>,
        /// The branch taken if the condition is true.
        then: Box<Body>,
        /// The branch taken if it is false; `else if` is a body that holds a single `if`.
        otherwise: Box<Body>,
    },
    /// `fn(x) { … }`
    Lambda(Arc<Lambda>),
    /// Text that did not parse; an error was reported.
    Error,
}

/// An argument of a call: `e` or `name = e`.
#[derive(Clone, Debug, PartialEq)]
pub struct Arg {
    /// The keyword, if given.
    pub name: Option<Name>,
    /// The value.
    pub value: Expr,
}

/// Prefix operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UnaryOp {
    /// `-`
    Neg,
    /// `not`
    Not,
}

/// Infix operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum BinaryOp {
    Add,
    Sub,
    Mul,
    Div,
    Rem,
    Pow,
    /// `a & b`: the choices in both selections.
    Intersect,
    Eq,
    Ne,
    Lt,
    Le,
    Gt,
    Ge,
    And,
    Or,
    Range,
}

/// An address pattern: `@pose[upperarm_l]/bone/rot[z]`. Without wildcards or computed
/// keys it names one choice and everything below it.
#[derive(Clone, Debug, PartialEq)]
pub struct Address {
    /// The segments between slashes.
    pub segments: Vec<Segment>,
}

/// One segment of an address: a name, its occurrence, its keys.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The name.
    pub name: SegmentName,
    /// `#n`: the number of the textual call site or unnamed observation; 1 if not
    /// written.
    pub occurrence: u32,
    /// `[key]`, any number of them.
    pub keys: Vec<Key>,
}

/// The name of a segment.
#[derive(Clone, Debug, PartialEq)]
pub enum SegmentName {
    /// A name.
    Name(Arc<str>),
    /// `*`: any one segment.
    Any,
    /// `**`: any number of segments.
    Deep,
}

/// A key in an address.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// A bare word or a quoted string.
    Str(Arc<str>),
    /// A number.
    Num(f64),
    /// `[*]`
    Any,
    /// `[{expr}]`
    Expr(Box<Expr>),
}

/// A statement of an inference block or kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct KStmt {
    /// The kind of statement.
    pub kind: KStmtKind,
    /// The whole statement.
    pub span: Span,
}

/// The kinds of inference statements.
#[derive(Clone, Debug, PartialEq)]
pub enum KStmtKind {
    /// `warmup n { … }`
    Warmup {
        /// The number of passes.
        count: Expr,
        /// The body.
        body: Vec<KStmt>,
    },
    /// `repeat n { … }`
    Repeat {
        /// The number of passes.
        count: Expr,
        /// The body.
        body: Vec<KStmt>,
    },
    /// `every n { … }`
    Every {
        /// The period, in passes of the enclosing loop.
        count: Expr,
        /// The body.
        body: Vec<KStmt>,
    },
    /// `mix { w => kernel; … }`
    Mix(Vec<MixArm>),
    /// `for x in e { … }`
    For {
        /// The loop variable.
        var: Name,
        /// The iterated expression.
        iter: Expr,
        /// The body.
        body: Vec<KStmt>,
    },
    /// `stop when e;`
    StopWhen(Expr),
    /// `collect e, …;`
    Collect(Vec<Expr>),
    /// `propose @x ~ d;`, in kernels only; `propose u ~ d;` draws an auxiliary variable.
    Propose {
        /// The address of one choice, or a new name.
        target: Expr,
        /// The proposal distribution.
        dist: Expr,
    },
    /// `propose @x = e;`, in kernels only: the new value of a choice or auxiliary
    /// variable.
    Map {
        /// The address of one choice, or the name of an auxiliary variable.
        target: Expr,
        /// The new value.
        value: Expr,
    },
    /// `let x = e;`
    Let {
        /// The name bound.
        name: Name,
        /// The value.
        expr: Expr,
    },
    /// `kernel(sel);`
    Expr(Expr),
}

/// One arm of a `mix`.
#[derive(Clone, Debug, PartialEq)]
pub struct MixArm {
    /// The weight.
    pub weight: Expr,
    /// The kernel.
    pub kernel: Expr,
    /// The whole arm.
    pub span: Span,
}
