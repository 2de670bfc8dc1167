//! Which kernels of a plan select which choices, without running it.

use crate::infer::calls::expr::PlanEnv;
use crate::infer::calls::selection::{selector, target};
use crate::infer::plan::call;
use crate::lang::code::Code;
use crate::platform::clock::Instant;
use crate::syntax::ast::{Expr, ExprKind, KStmt, KStmtKind};
use crate::syntax::print_expr;
use crate::trace::{Draws, Selector, Trace};
use std::sync::Arc;

/// A kernel of a plan, and the choices it selects.
#[derive(Clone, Debug)]
pub struct Selecting {
    /// The call as written.
    pub kernel: String,
    /// The choices it may move; all of them if the selection depends on variables of the
    /// plan.
    pub selector: Selector,
}

/// The kernels of a plan, including those of warm-up, each once, in the order of the
/// plan.
pub fn selecting(code: &Arc<Code>, plan: &[KStmt], trace: &mut Trace) -> Vec<Selecting> {
    let mut found = Vec::new();
    let env = PlanEnv {
        code,
        trace,
        variables: &[],
        draws: Draws::default(),
        started: Instant::now(),
        steps: 0,
        moved: None,
    };
    Reader { code, env, found: &mut found, within: Vec::new() }.statements(plan);
    found
}

struct Reader<'a, 'e> {
    code: &'a Code,
    env: PlanEnv<'e>,
    found: &'a mut Vec<Selecting>,
    /// The declared kernels being read, as one may call itself.
    within: Vec<Arc<str>>,
}

impl Reader<'_, '_> {
    fn statements(&mut self, all: &[KStmt]) {
        for statement in all {
            match &statement.kind {
                KStmtKind::Warmup { body, .. }
                | KStmtKind::Repeat { body, .. }
                | KStmtKind::Every { body, .. }
                | KStmtKind::For { body, .. } => self.statements(body),
                KStmtKind::Mix(arms) => arms.iter().for_each(|arm| self.kernel(&arm.kernel)),
                KStmtKind::Expr(e) => self.kernel(e),
                _ => {}
            }
        }
    }

    fn kernel(&mut self, e: &Expr) {
        let Some((name, args)) = call(e) else { return };
        if matches!(name, "init" | "anneal") {
            return;
        }
        if let Some(declared) = self.code.kernels.iter().find(|k| *k.name.node == *name) {
            if self.within.contains(&declared.name.node) {
                return;
            }
            self.within.push(declared.name.node.clone());
            self.moved(e, &declared.body);
            self.statements(&declared.body);
            self.within.pop();
            return;
        }
        // A kernel without a selection moves everything. A kernel that wraps others moves
        // what they move.
        let mut selected = false;
        for arg in args {
            let inside = call(&arg.value).is_some_and(|(inner, args)| {
                !matches!(inner, "one" | "each") && args.iter().any(|a| target(&a.value))
            });
            if inside {
                selected = true;
                self.kernel(&arg.value);
            } else if target(&arg.value) {
                selected = true;
                let all = call(&arg.value)
                    .and_then(|(_, args)| args.first())
                    .map_or(&arg.value, |a| &a.value);
                let selector = selector(all, &mut self.env).unwrap_or(Selector::All);
                self.add(print_expr(e), selector);
            }
        }
        if !selected {
            self.add(print_expr(e), Selector::All);
        }
    }

    /// Adds what a declared kernel, called by `e`, proposes itself.
    fn moved(&mut self, e: &Expr, body: &[KStmt]) {
        for statement in body {
            match &statement.kind {
                KStmtKind::For { body, .. } => self.moved(e, body),
                KStmtKind::Propose { target, .. } | KStmtKind::Map { target, .. }
                    if matches!(target.kind, ExprKind::Address(_)) =>
                {
                    let selector = selector(target, &mut self.env).unwrap_or(Selector::All);
                    self.add(print_expr(e), selector);
                }
                _ => {}
            }
        }
    }

    fn add(&mut self, kernel: String, selector: Selector) {
        match self.found.iter_mut().find(|k| k.kernel == kernel) {
            Some(k) if k.selector == selector => {}
            Some(k) => {
                k.selector = Selector::Union(Box::new(k.selector.clone()), Box::new(selector))
            }
            None => self.found.push(Selecting { kernel, selector }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;

    #[test]
    fn kernels_within_declared_ones_are_found() {
        let text = "assume x ~ normal(0, 1); assume y ~ normal(0, 1); observe normal(x + y, 1) = 1;
             kernel first(s) { drift(@x, s); }
             kernel both(s) { first(s); mh(@y); }
             infer { repeat 10 { both(0.5); block(@x); both(2); } }";
        let model = Model::from_text(text).unwrap();
        let (mut trace, plan) = (model.simulate(1, 0).unwrap(), model.plan().unwrap().0);
        let found = selecting(model.code(), &plan, &mut trace);
        let names: Vec<&str> = found.iter().map(|k| &*k.kernel).collect();
        assert_eq!(names, ["drift(@x, s)", "mh(@y)", "block(@x)"]);
    }
}
