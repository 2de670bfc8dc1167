//! The actions of the grammar: they build the tree, and make the checks that are easier
//! here than in productions.

use super::ast::*;
use super::deep::{Deep, MAX_DEPTH, all, opt};
use super::error::{SyntaxError, SyntaxErrorKind};
use super::span::{FileId, Span, Spanned};
use std::sync::Arc;

/// The state of the actions: the file of the spans, and the errors so far.
pub(crate) struct Builder {
    file: FileId,
    /// Errors found by the actions; the text itself parses.
    pub errors: Vec<SyntaxError>,
    too_deep: bool,
}

/// A statement of a body. `open_if` marks an `if … else …` without a semicolon; as the
/// last statement, it is the value of the body.
pub(crate) struct BodyStmt {
    stmt: Deep<Stmt>,
    open_if: bool,
}

impl Builder {
    pub fn new(file: FileId) -> Self {
        Builder { file, errors: Vec::new(), too_deep: false }
    }

    pub fn span(&self, start: usize, end: usize) -> Span {
        Span::new(self.file, start, end)
    }

    pub fn name(&self, start: usize, text: &str, end: usize) -> Name {
        Spanned::new(Arc::from(text), self.span(start, end))
    }

    pub fn string(&self, start: usize, text: Arc<str>, end: usize) -> Spanned<Arc<str>> {
        Spanned::new(text, self.span(start, end))
    }

    // Every node with children goes through `expr`, `block` or `body`, which enforce the
    // depth limit.

    /// Builds an expression from parts of the given depth.
    pub fn expr(&mut self, start: usize, parts: Deep<ExprKind>, end: usize) -> Deep<Expr> {
        let span = self.span(start, end);
        let Deep { node: kind, depth } = self.limit(span, parts, || ExprKind::Error);
        Deep { node: Expr { kind, span }, depth }
    }

    /// Builds an expression without parts.
    pub fn atom(&self, start: usize, kind: ExprKind, end: usize) -> Deep<Expr> {
        Deep::leaf(Expr { kind, span: self.span(start, end) })
    }

    /// Builds the statements in braces, which count as a level.
    pub fn block<T>(&mut self, start: usize, stmts: Vec<Deep<T>>, end: usize) -> Deep<Vec<T>> {
        let span = self.span(start, end);
        self.limit(span, all(stmts), Vec::new)
    }

    /// Adds a level to the parts; if that is too deep, reports it once and returns
    /// `cut()` instead.
    fn limit<T>(&mut self, span: Span, parts: Deep<T>, cut: impl FnOnce() -> T) -> Deep<T> {
        let depth = parts.depth + 1;
        if depth <= MAX_DEPTH {
            return Deep { node: parts.node, depth };
        }
        if !self.too_deep {
            self.too_deep = true;
            self.errors
                .push(SyntaxError::new(SyntaxErrorKind::TooDeep, Span { end: span.start, ..span }));
        }
        Deep::leaf(cut())
    }

    pub fn unary(&mut self, start: usize, op: UnaryOp, expr: Deep<Expr>, end: usize) -> Deep<Expr> {
        self.expr(start, expr.map(|expr| ExprKind::Unary { op, expr: Box::new(expr) }), end)
    }

    pub fn binary(
        &mut self,
        start: usize,
        l: Deep<Expr>,
        op: BinaryOp,
        r: Deep<Expr>,
        end: usize,
    ) -> Deep<Expr> {
        let both =
            l.and(r).map(|(l, r)| ExprKind::Binary { op, left: Box::new(l), right: Box::new(r) });
        self.expr(start, both, end)
    }

    pub fn call(
        &mut self,
        start: usize,
        callee: Deep<Expr>,
        args: Vec<Deep<Arg>>,
        end: usize,
    ) -> Deep<Expr> {
        let parts = callee.and(all(args));
        self.expr(
            start,
            parts.map(|(callee, args)| ExprKind::Call { callee: Box::new(callee), args }),
            end,
        )
    }

    pub fn index(
        &mut self,
        start: usize,
        base: Deep<Expr>,
        index: Deep<Expr>,
        end: usize,
    ) -> Deep<Expr> {
        let parts = base.and(index);
        let kind = parts
            .map(|(base, index)| ExprKind::Index { base: Box::new(base), index: Box::new(index) });
        self.expr(start, kind, end)
    }

    pub fn field(&mut self, start: usize, base: Deep<Expr>, field: Name, end: usize) -> Deep<Expr> {
        self.expr(start, base.map(|base| ExprKind::Field { base: Box::new(base), field }), end)
    }

    pub fn lambda(&mut self, params: Vec<Deep<Param>>, body: Deep<Body>) -> Deep<Lambda> {
        all(params).and(body).map(|(params, body)| Lambda { params, body })
    }

    /// Builds `if cond { … } else { … }`.
    pub fn if_else(
        &mut self,
        at: usize,
        cond: Deep<Expr>,
        then: Deep<Body>,
        other: Deep<Body>,
        end: usize,
    ) -> Deep<Expr> {
        let parts = cond.and(then).and(other).map(|((cond, then), otherwise)| ExprKind::If {
            cond: Box::new(cond),
            then: Box::new(then),
            otherwise: Box::new(otherwise),
        });
        self.expr(at, parts, end)
    }

    /// Builds the statement `if cond { … }`, which cannot have a value.
    pub fn if_only(
        &mut self,
        at: usize,
        cond: Deep<Expr>,
        then: Deep<Body>,
        end: usize,
    ) -> Deep<Expr> {
        self.no_value(&then.node);
        let empty = Deep::leaf(Body { stmts: Vec::new(), result: None, span: self.span(end, end) });
        self.if_else(at, cond, then, empty, end)
    }

    /// Reports the value of a branch, in an `if` without its last `else`.
    pub fn no_value(&mut self, body: &Body) {
        if let Some(result) = &body.result {
            self.errors.push(SyntaxError::new(SyntaxErrorKind::ValueWithoutElse, result.span));
        }
    }

    /// Builds the body that stands for `else if …`.
    pub fn else_if(&mut self, nested: Deep<Expr>) -> Deep<Body> {
        nested.map(|e| Body { stmts: Vec::new(), span: e.span, result: Some(Box::new(e)) })
    }

    /// Builds `target ~ dist`; the target must be a name, with or without keys.
    pub fn draw(
        &mut self,
        target: Deep<Expr>,
        dist: Deep<Expr>,
        tags: Vec<Deep<Tag>>,
    ) -> Deep<StmtKind> {
        let mut name = &target.node;
        while let ExprKind::Index { base, .. } = &name.kind {
            name = base;
        }
        if !matches!(name.kind, ExprKind::Var(_) | ExprKind::Error) {
            self.errors.push(SyntaxError::new(SyntaxErrorKind::DrawTarget, target.node.span));
        }
        target.and(dist).and(all(tags)).map(|((target, dist), tags)| StmtKind::Draw {
            target,
            dist,
            tags,
        })
    }

    pub fn stmt(&self, start: usize, kind: Deep<StmtKind>, end: usize) -> BodyStmt {
        let span = self.span(start, end);
        BodyStmt { stmt: kind.map(|kind| Stmt { kind, span }), open_if: false }
    }

    /// Builds an `if … else …` without a semicolon.
    pub fn open_if(&self, expr: Deep<Expr>) -> BodyStmt {
        let stmt = expr.map(|e| Stmt { span: e.span, kind: StmtKind::Expr(e) });
        BodyStmt { stmt, open_if: true }
    }

    /// Builds a body. Without a final expression, a last `if … else …` without a
    /// semicolon is its value.
    pub fn body(
        &mut self,
        start: usize,
        mut stmts: Vec<BodyStmt>,
        result: Option<Deep<Expr>>,
        end: usize,
    ) -> Deep<Body> {
        let mut result = opt(result);
        if result.node.is_none()
            && let Some(last) = stmts.pop_if(|last| last.open_if)
        {
            result = last.stmt.map(|stmt| match stmt.kind {
                StmtKind::Expr(expr) => Some(expr),
                _ => None,
            });
        }
        let span = self.span(start, end);
        let stmts = all(stmts.into_iter().map(|s| s.stmt).collect());
        let body = stmts.and(result).map(|(stmts, result)| Body {
            stmts,
            result: result.map(Box::new),
            span,
        });
        self.limit(span, body, || Body { stmts: Vec::new(), result: None, span })
    }
}

impl BodyStmt {
    pub fn stmt(self) -> Deep<Stmt> {
        self.stmt
    }
}
