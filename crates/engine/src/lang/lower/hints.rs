//! Hints for unknown names: where a name is bound elsewhere, similar names, and its
//! equivalent in this language.
//!
//! Only messages are produced here; nothing in this file decides whether a program is
//! correct.

use super::lowerer::Lowerer;
use crate::lang::builtins::{Builtin, Kind, Type};
use pcadlang_syntax::ast::{Arg, ItemKind, Name, Stmt, StmtKind};
use pcadlang_syntax::diag::{Diagnostic, nearest};
use pcadlang_syntax::elsewhere::called_here;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// Diagnostics by which plans in other languages end, and what to do instead. A chain knows only
/// its own draws.
const OF_A_RUN: [&str; 6] = ["ess", "rhat", "r_hat", "acceptance", "snapshot", "converged"];
const INSTEAD: &str = "a chain does not see the others while it runs: end it by --time or --steps, or \
                       by elapsed() or steps(); the table at the end has ess and r_hat";

/// Where a name that is unknown at some place is bound.
enum Elsewhere {
    /// At the top level, further down.
    Later(Span),
    /// In the statement that uses it.
    Itself(Span),
    /// In a function or a loop.
    Inside(Span, &'static str),
}

impl Lowerer<'_> {
    /// Reports an unknown name.
    pub fn unbound(&mut self, name: &str, span: Span) {
        let visible = self.visible();
        let builtins = Arc::clone(&self.code.builtins);
        let known = builtins
            .iter()
            .filter(|b| b.module.is_empty() && b.name.starts_with(|c: char| c.is_alphabetic()))
            .filter(|b| !matches!(b.kind, Kind::Plan(_)))
            .map(|b| &*b.name);
        let dists = builtins.iter().filter(|b| b.module.is_empty() && b.returns == Type::Dist);
        let dists = dists.map(|b| &*b.name);
        let visible = || visible.iter().map(|n| &**n);
        let drawn = self.is_drawn(span).then(|| nearest(name, dists.chain(visible()))).flatten();
        let near = drawn.or_else(|| nearest(name, visible().chain(known))).map(str::to_owned);
        // A name of a namespace, written without the namespace.
        let inside = self.modules[self.module].namespaces.iter().find_map(|(ns, space)| {
            let module = &self.modules[space.module];
            let native = module.native.as_deref().is_some_and(|m| builtins.find(m, name).is_some());
            (native || module.names.contains_key(name)).then(|| format!("{ns}.{name}"))
        });
        let elsewhere = self.bound_elsewhere(name, span);
        let lives = builtins.iter().find(|b| b.name == name && !b.module.is_empty());
        let lives = lives
            .map(|b| format!("include \"std/{0}.pcad\" as {0}; then write {0}.{name}", b.module));
        let module = builtins.iter().find(|b| b.module == name);
        let module =
            module.map(|_| format!("add at the top: include \"std/{name}.pcad\" as {name};"));
        let called = called_here(name).map(|here| format!("write `{here}`"));
        let e = self.error(format!("unknown name `{name}`"), span, "not bound here");
        match elsewhere {
            Some(Elsewhere::Later(at)) => {
                e.point_at(at, "bound later");
                e.hint_also("statements run from top to bottom: bind a name before using it");
                return;
            }
            Some(Elsewhere::Itself(at)) => {
                e.point_at(at, "bound by this statement, after its value is computed");
                e.hint_also("for recursion, declare a function: fn f(k) { … f(k - 1) … }");
                return;
            }
            Some(Elsewhere::Inside(at, place)) => {
                e.point_at(at, &format!("bound inside a {place}, and visible only there"));
                return;
            }
            None => {}
        }
        let near = near.map(|n| format!("did you mean `{n}`?"));
        let of_a_run = OF_A_RUN.contains(&name).then(|| INSTEAD.to_owned());
        let inside = inside.map(|i| format!("did you mean `{i}`?"));
        if let Some(hint) = inside.or(module).or(called).or(of_a_run).or(near).or(lives) {
            e.hint_also(hint);
        }
    }

    /// True if a name is that of the distribution after `~` or `observe`.
    fn is_drawn(&self, name: Span) -> bool {
        let text = self.map.get(name.file).and_then(|f| f.text().get(..name.start as usize));
        let before = text.unwrap_or_default().trim_end();
        before.ends_with('~') || before.ends_with("observe")
    }

    /// Returns where the current file binds the name.
    fn bound_elsewhere(&self, name: &str, span: Span) -> Option<Elsewhere> {
        let items = &self.loaded.units.iter().find(|u| u.file == span.file)?.program.items;
        let mut inner = None;
        for item in items {
            let within = item.span.start <= span.start && span.end <= item.span.end;
            match &item.kind {
                ItemKind::Param(d) | ItemKind::Data(d) if &*d.name.node == name => {
                    return Some(Elsewhere::Later(d.name.span));
                }
                ItemKind::Fn(f) => {
                    let parameter =
                        f.lambda.params.iter().map(|p| &p.name).find(|n| &*n.node == name);
                    let found =
                        parameter.map(|n| n.span).or_else(|| bound_in(&f.lambda.body.stmts, name));
                    inner = inner.or(found.map(|at| Elsewhere::Inside(at, "function")));
                }
                ItemKind::Stmt(s) => {
                    if let Some(n) = binds(s, name) {
                        return Some(if within {
                            Elsewhere::Itself(n)
                        } else {
                            Elsewhere::Later(n)
                        });
                    }
                    if let StmtKind::For { var, body, .. } = &s.kind {
                        let found = Some(var.span)
                            .filter(|_| &*var.node == name)
                            .or_else(|| bound_in(body, name));
                        inner = inner.or(found.map(|at| Elsewhere::Inside(at, "loop")));
                    }
                }
                _ => {}
            }
        }
        inner
    }

    /// Reports a name that is not in a namespace.
    pub fn no_member(&mut self, ns: &str, module: usize, field: &Name) {
        let table = Arc::clone(&self.code.builtins);
        let m = &self.modules[module];
        let native = m.native.clone();
        let own = m.names.keys().cloned().collect::<Vec<_>>();
        let natives =
            table.iter().filter(|b| native.as_deref() == Some(&*b.module)).map(|b| &*b.name);
        let known: Vec<&str> = own.iter().map(|n| &**n).chain(natives).collect();
        let hint = match nearest(&field.node, known.iter().copied()) {
            Some(n) => format!("did you mean `{ns}.{n}`?"),
            None if known.is_empty() => "it has no names".into(),
            None => format!("it has {}", known.join(", ")),
        };
        self.error(format!("`{ns}` has no `{}`", field.node), field.span, "unknown name")
            .hint_also(hint);
    }

    /// Reports arguments that do not match those of a built-in; `message` is the reason.
    pub fn mismatch(
        &mut self,
        b: &Builtin,
        message: String,
        args: &[Arg],
        span: Span,
    ) -> &mut Diagnostic {
        // The messages of the table end with the signature or with a suggestion.
        let cut = [": ", "; "].iter().filter_map(|s| message.find(s)).min();
        let (message, rest) = match cut {
            Some(i) => (message[..i].to_owned(), message[i + 2..].to_owned()),
            None => (message, b.signature()),
        };
        let unknown = args
            .iter()
            .filter_map(|a| a.name.as_ref())
            .find(|n| !b.args.iter().any(|p| p.name == *n.node));
        let again = args.iter().enumerate().find_map(|(i, a)| {
            let n = a.name.as_ref()?;
            let place = b.args.iter().position(|p| p.name == *n.node)?;
            let earlier =
                args[..i].iter().any(|o| o.name.as_ref().is_some_and(|o| o.node == n.node));
            let positional = args[..i].get(place).is_some_and(|o| o.name.is_none());
            (earlier || positional).then_some(n.span)
        });
        let (at, label) = match (unknown, again) {
            (Some(n), _) => (n.span, "unknown keyword"),
            (None, Some(at)) => (at, "given again here"),
            _ if args.len() > b.args.len() => (args[b.args.len()].value.span, "one too many"),
            _ => (span, "in this call"),
        };
        let former = unknown.and_then(|n| former(&format!("{} {}", b.name, n.node)));
        let e = self.error(message, at, label);
        e.hint_also(former.map_or(rest, str::to_owned));
        e
    }
}

/// The successors of kernels and of their arguments that no longer exist.
pub(super) fn former(name: &str) -> Option<&'static str> {
    match name {
        "optimize" => Some(
            "`init(unconstrained())` begins with a climb, `modes(@x)` climbs to modes in warm-up",
        ),
        "abc particles" | "abc moves" => Some(
            "`abc(move, eps)` moves one state towards `eps` from any distance; `smc` draws complete states",
        ),
        _ => None,
    }
}

/// Returns where a statement itself binds a name.
fn binds(s: &Stmt, name: &str) -> Option<Span> {
    let bound = match &s.kind {
        StmtKind::Assume { name, .. }
        | StmtKind::Predict { name, .. }
        | StmtKind::Let { name, .. } => name,
        _ => return None,
    };
    (&*bound.node == name).then_some(bound.span)
}

/// Returns where one of several statements binds a name, loops included.
fn bound_in(stmts: &[Stmt], name: &str) -> Option<Span> {
    use pcadlang_syntax::ast::ExprKind;
    stmts.iter().find_map(|s| match &s.kind {
        StmtKind::Draw { target, .. } if matches!(&target.kind, ExprKind::Var(n) if &**n == name) => Some(target.span),
        StmtKind::For { body, .. } => bound_in(body, name),
        _ => binds(s, name),
    })
}
