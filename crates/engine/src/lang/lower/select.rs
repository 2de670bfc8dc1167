//! Selections of choices; the addresses and tags in them must occur in the program.

use super::lowerer::{Lowerer, PlanScope};
use crate::lang::plan::Selection;
use pcadlang_syntax::ast::{Address, BinaryOp, Expr, ExprKind, SegmentName};
use pcadlang_syntax::diag::nearest;
use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// Tags that every choice has by its kind.
const BUILT_IN: [&str; 4] = ["continuous", "discrete", "gaussian", "finite"];

impl Lowerer<'_> {
    /// Compiles a selection.
    pub fn selection(&mut self, e: &Expr, around: &PlanScope) -> Selection {
        self.check_selection(e);
        let read = Selection::read(e, &mut |key| self.formula(key, around));
        // The mistake was reported.
        read.unwrap_or_else(|_| Selection::Tag("".into(), None))
    }

    fn check_selection(&mut self, e: &Expr) {
        match &e.kind {
            ExprKind::Address(a) => self.address(a, e.span),
            ExprKind::TagSel { name, .. } => {
                let known = BUILT_IN.contains(&&**name) || self.code.tags.contains(name);
                if !known {
                    let near = nearest(name, self.code.tags.iter().map(|t| &**t).chain(BUILT_IN))
                        .map(str::to_owned);
                    let tags = self
                        .code
                        .tags
                        .iter()
                        .map(|t| format!("${t}"))
                        .collect::<Vec<_>>()
                        .join(", ");
                    let e = self.error(
                        format!("no choice has the tag `${name}`"),
                        e.span,
                        "unknown tag",
                    );
                    match near {
                        Some(n) => e.hint_also(format!("did you mean `${n}`?")),
                        None if tags.is_empty() => {
                            e.hint_also("a tag is put on a choice: x ~ normal(0, 1) #name;")
                        }
                        None => e.hint_also(format!("tags of this program are {tags}")),
                    }
                }
            }
            ExprKind::Binary {
                op: BinaryOp::Add | BinaryOp::Sub | BinaryOp::Intersect,
                left,
                right,
            } => {
                self.check_selection(left);
                self.check_selection(right);
            }
            ExprKind::Call { .. } => {
                self.error("expected a selection of choices", e.span, "not a selection").hint_also(
                    "an address such as @**, a tag such as $affine, or one(…) or each(…) of either",
                );
            }
            ExprKind::Var(v) => {
                let bound = self.roots.contains(v);
                let e = self.error("expected a selection of choices", e.span, "not a selection");
                e.hint_also(if bound {
                    format!("write @{v}")
                } else {
                    "addresses begin with @, tags with $".into()
                });
            }
            ExprKind::Error => {}
            _ => {
                self.error("expected a selection of choices", e.span, "not a selection").hint_also(
                    "an address such as @**, a tag such as $affine, or both joined by +, - or &",
                );
            }
        }
    }

    /// Checks that an address begins with a name under which there are choices.
    pub fn address(&mut self, a: &Address, span: Span) {
        let Some(first) = a.segments.first() else { return };
        let SegmentName::Name(name) = &first.name else { return };
        if self.roots.contains(name) {
            // The other segments must occur somewhere in the program.
            for s in &a.segments[1..] {
                if let SegmentName::Name(n) = &s.name
                    && !self
                        .code
                        .sites
                        .iter()
                        .any(|site| site.segments.iter().any(|x| x.name == *n))
                {
                    let known: Vec<Arc<str>> = self
                        .code
                        .sites
                        .iter()
                        .flat_map(|s| s.segments.iter().map(|x| Arc::clone(&x.name)))
                        .collect();
                    let near = nearest(n, known.iter().map(|n| &**n)).map(str::to_owned);
                    let e = self.error(
                        format!("no address has a segment `{n}`"),
                        span,
                        "nothing is there",
                    );
                    if let Some(n) = near {
                        e.hint_also(format!("did you mean `{n}`?"));
                    }
                    return;
                }
            }
            return;
        }
        let near = nearest(name, self.roots.iter().map(|n| &**n)).map(str::to_owned);
        let all = self.roots.iter().map(|n| format!("@{n}")).collect::<Vec<_>>().join(", ");
        let e = self.error(
            format!("no choice has an address that begins with @{name}"),
            span,
            "nothing is there",
        );
        match near {
            Some(n) => e.hint_also(format!("did you mean @{n}?")),
            None if all.is_empty() => e.hint_also("this program makes no choices"),
            None => e.hint_also(format!("addresses begin with {all}")),
        }
    }
}
