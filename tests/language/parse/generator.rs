//! Random well-formed programs: every tree that the parser can produce, from a string of
//! bytes that determines each choice.
//!
//! When the bytes run out, every choice is the simplest one, so trees are finite, and
//! shrinking the bytes shrinks the program.

use pcadlang_syntax::ast::*;
use pcadlang_syntax::span::{Span, Spanned};
use std::sync::Arc;

const NAMES: [&str; 10] =
    ["a", "x1", "_", "S_L", "to", "when", "coarse", "upperarm_l", "dataset", "e1"];
const WORDS: [&str; 6] = ["b", "data", "if", "true", "fn", "with"];
const TEXTS: [&str; 8] =
    ["", "a b", "\"", "\\", "} // ;]", "é\n\t\u{1f600}", "\u{0}\u{9b}\u{2028}", "/*"];
const NUMBERS: [f64; 9] = [0.0, 1.0, 0.1, 12.5, 1e300, 5e-324, 1e16, 123456789.125, f64::MAX];
const BINARY: [BinaryOp; 16] = [
    BinaryOp::Add,
    BinaryOp::Sub,
    BinaryOp::Mul,
    BinaryOp::Div,
    BinaryOp::Rem,
    BinaryOp::Pow,
    BinaryOp::Intersect,
    BinaryOp::Eq,
    BinaryOp::Ne,
    BinaryOp::Lt,
    BinaryOp::Le,
    BinaryOp::Gt,
    BinaryOp::Ge,
    BinaryOp::And,
    BinaryOp::Or,
    BinaryOp::Range,
];

fn spanned<T>(node: T) -> Spanned<T> {
    Spanned::new(node, Span::default())
}

fn hole(kind: ExprKind) -> Expr {
    Expr { kind, span: Span::default() }
}

pub struct Generator<'a> {
    bytes: std::slice::Iter<'a, u8>,
    /// Whether the generator is in a computed key, which cannot contain statements.
    in_key: bool,
}

impl<'a> Generator<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Generator { bytes: bytes.iter(), in_key: false }
    }

    pub fn program(&mut self) -> Program {
        let mut items = Vec::new();
        while self.bytes.len() > 0 {
            let kind = self.item();
            items.push(Item { kind, span: Span::default() });
        }
        Program { items }
    }

    /// Returns a number below `n`, or 0 when the bytes have run out.
    fn pick(&mut self, n: usize) -> usize {
        self.bytes.next().map_or(0, |b| usize::from(*b) % n)
    }

    fn coin(&mut self) -> bool {
        self.pick(2) == 1
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.pick(all.len())]
    }

    fn many<T>(&mut self, least: usize, mut one: impl FnMut(&mut Self) -> T) -> Vec<T> {
        let n = least + self.pick(3);
        (0..n).map(|_| one(self)).collect()
    }

    fn maybe<T>(&mut self, one: impl FnOnce(&mut Self) -> T) -> Option<T> {
        self.coin().then(|| one(self))
    }

    fn name(&mut self) -> Name {
        spanned(self.of(&NAMES).into())
    }

    /// Returns a name where keywords are allowed.
    fn word(&mut self) -> Name {
        if self.coin() { spanned(self.of(&WORDS).into()) } else { self.name() }
    }

    fn field_key(&mut self) -> Name {
        if self.coin() { self.word() } else { spanned(self.text()) }
    }

    fn text(&mut self) -> Arc<str> {
        self.of(&TEXTS).into()
    }

    fn file(&mut self) -> Spanned<Arc<str>> {
        spanned(self.text())
    }

    fn boxed(&mut self) -> Box<Expr> {
        Box::new(self.expr())
    }

    fn item(&mut self) -> ItemKind {
        match self.pick(10) {
            0 => ItemKind::Stmt(self.stmt()),
            1 => ItemKind::Include { path: self.file(), alias: self.maybe(Self::name) },
            2 => {
                let declaration = self.declaration();
                ItemKind::Param(Declaration { default: Some(self.expr()), ..declaration })
            }
            3 => ItemKind::Data(self.declaration()),
            4 => ItemKind::Fn(FnDecl { name: self.name(), lambda: self.lambda() }),
            5 => ItemKind::Kernel(KernelDecl {
                name: self.name(),
                params: self.many(0, Self::param),
                body: self.plan(),
            }),
            6 => ItemKind::Infer { name: self.maybe(Self::name), body: self.plan() },
            7 => ItemKind::Report { exprs: self.many(1, Self::expr), file: self.maybe(Self::file) },
            8 => ItemKind::Export { expr: self.expr(), file: self.file() },
            _ => ItemKind::Stmt(self.stmt()),
        }
    }

    fn declaration(&mut self) -> Declaration {
        Declaration {
            name: self.name(),
            ty: self.maybe(Self::name),
            default: self.maybe(Self::expr),
            help: self.maybe(Self::file),
        }
    }

    fn param(&mut self) -> Param {
        Param { name: self.name(), ty: self.maybe(Self::name), default: self.maybe(Self::expr) }
    }

    fn lambda(&mut self) -> Lambda {
        Lambda { params: self.many(0, Self::param), body: self.body() }
    }

    fn body(&mut self) -> Body {
        let stmts = if self.in_key { Vec::new() } else { self.many(0, Self::stmt) };
        Body { stmts, result: self.maybe(Self::boxed), span: Span::default() }
    }

    fn stmt(&mut self) -> Stmt {
        let kind = match self.pick(14) {
            0 => StmtKind::Expr(self.expr()),
            1 => StmtKind::Assume {
                name: self.name(),
                bind: self.bind(),
                expr: self.expr(),
                tags: self.many(0, Self::tag),
            },
            2 => StmtKind::Draw {
                target: self.target(),
                dist: self.expr(),
                tags: self.many(0, Self::tag),
            },
            3 => StmtKind::Let { name: self.name(), expr: self.expr() },
            4 => StmtKind::Observe {
                dist: self.expr(),
                value: self.expr(),
                coarse: self.maybe(Self::expr),
                name: self.maybe(Self::name),
            },
            5 => StmtKind::Predict { name: self.name(), bind: self.bind(), expr: self.expr() },
            6 => StmtKind::Factor { expr: self.expr(), name: self.maybe(Self::name) },
            7 => StmtKind::Force { target: self.expr(), value: self.expr() },
            8 => StmtKind::Freeze(self.expr()),
            9 => StmtKind::Forget(self.expr()),
            10 => StmtKind::Sample(self.expr()),
            11 => StmtKind::For {
                var: self.name(),
                iter: self.expr(),
                body: self.many(0, Self::stmt),
            },
            _ => StmtKind::Expr(self.conditional()),
        };
        Stmt { kind, span: Span::default() }
    }

    fn bind(&mut self) -> Bind {
        if self.coin() { Bind::Random } else { Bind::Value }
    }

    fn target(&mut self) -> Expr {
        let mut target = hole(ExprKind::Var(self.name().node));
        while self.pick(3) == 1 {
            target = hole(ExprKind::Index { base: Box::new(target), index: self.boxed() });
        }
        target
    }

    fn tag(&mut self) -> Tag {
        Tag { name: self.word(), value: self.maybe(Self::literal), span: Span::default() }
    }

    fn plan(&mut self) -> Vec<KStmt> {
        self.many(0, |g| {
            let kind = match g.pick(12) {
                0 => KStmtKind::Expr(g.expr()),
                1 => KStmtKind::Warmup { count: g.expr(), body: g.plan() },
                2 => KStmtKind::Repeat { count: g.expr(), body: g.plan() },
                3 => KStmtKind::Every { count: g.expr(), body: g.plan() },
                4 => KStmtKind::Mix(g.many(1, |g| MixArm {
                    weight: g.expr(),
                    kernel: g.expr(),
                    span: Span::default(),
                })),
                5 => KStmtKind::For { var: g.name(), iter: g.expr(), body: g.plan() },
                6 => KStmtKind::StopWhen(g.expr()),
                7 => KStmtKind::Collect(g.many(1, Self::expr)),
                8 => KStmtKind::Propose { target: g.expr(), dist: g.expr() },
                9 => KStmtKind::Map { target: g.expr(), value: g.expr() },
                10 => KStmtKind::Let { name: g.name(), expr: g.expr() },
                _ => KStmtKind::Expr(g.conditional()),
            };
            KStmt { kind, span: Span::default() }
        })
    }

    fn conditional(&mut self) -> Expr {
        let otherwise = match self.pick(3) {
            0 => Body { stmts: Vec::new(), result: None, span: Span::default() },
            1 => Body {
                stmts: Vec::new(),
                result: Some(Box::new(self.conditional())),
                span: Span::default(),
            },
            _ => self.body(),
        };
        let (cond, then) = (self.boxed(), Box::new(self.body()));
        hole(ExprKind::If { cond, then, otherwise: Box::new(otherwise) })
    }

    fn literal(&mut self) -> Expr {
        hole(match self.pick(4) {
            0 => ExprKind::Var(self.name().node),
            1 => ExprKind::Num(self.of(&NUMBERS)),
            2 => ExprKind::Str(self.text()),
            _ => ExprKind::Bool(self.coin()),
        })
    }

    fn expr(&mut self) -> Expr {
        let kind = match self.pick(16) {
            0..3 => return self.literal(),
            3 => ExprKind::Address(Address { segments: self.many(1, Self::segment) }),
            4 => ExprKind::TagSel { name: self.word().node, value: self.tag_value() },
            5 => ExprKind::Array(self.many(0, Self::expr)),
            6 => ExprKind::Record(self.many(0, |g| (g.field_key(), g.expr()))),
            7 => ExprKind::Call {
                callee: self.boxed(),
                args: self.many(0, |g| Arg { name: g.maybe(Self::name), value: g.expr() }),
            },
            8 => ExprKind::Index { base: self.boxed(), index: self.boxed() },
            9 => ExprKind::Field { base: self.boxed(), field: self.word() },
            10 => ExprKind::Unary { op: UnaryOp::Neg, expr: self.boxed() },
            11 => ExprKind::Unary { op: UnaryOp::Not, expr: self.boxed() },
            12 => ExprKind::Lambda(Arc::new(self.lambda())),
            13 => return self.conditional(),
            _ => ExprKind::Binary { op: self.of(&BINARY), left: self.boxed(), right: self.boxed() },
        };
        hole(kind)
    }

    fn tag_value(&mut self) -> Option<Arc<str>> {
        self.maybe(|g| if g.coin() { g.text() } else { g.word().node })
    }

    fn segment(&mut self) -> Segment {
        let name = match self.pick(4) {
            0 => SegmentName::Any,
            1 => SegmentName::Deep,
            _ => SegmentName::Name(self.word().node),
        };
        let occurrence = self.of(&[1, 1, 2, u32::MAX]);
        Segment { name, occurrence, keys: self.many(0, Self::key) }
    }

    fn key(&mut self) -> Key {
        match self.pick(5) {
            0 => Key::Any,
            1 => Key::Str(self.word().node),
            2 => Key::Str(self.text()),
            3 => Key::Num(if self.coin() { -self.of(&NUMBERS) } else { self.of(&NUMBERS) }),
            // Addresses in keys can be nested only eight deep, so there is no key in a
            // key.
            _ if self.in_key => Key::Any,
            _ => {
                self.in_key = true;
                let key = Key::Expr(self.boxed());
                self.in_key = false;
                key
            }
        }
    }
}
