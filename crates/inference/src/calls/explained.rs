//! Which kernels of a plan select which choices, without running it.

use crate::calls::formula::PlanEnv;
use crate::calls::selection::selector;
use pcadlang_engine::lang::plan::{Argument, Callee, KernelCall, Plan, Selection, Step, StepKind};
use pcadlang_engine::trace::{Draws, Selector, Trace};

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
pub fn selecting(plan: &Plan, trace: &mut Trace) -> Vec<Selecting> {
    let env = PlanEnv::before(trace, Draws::default());
    let mut reader = Reader { plan, env, found: Vec::new(), within: Vec::new() };
    reader.steps(&plan.steps);
    reader.found
}

struct Reader<'a, 'e> {
    plan: &'a Plan,
    env: PlanEnv<'e>,
    found: Vec<Selecting>,
    /// The declared kernels being read, as one may call itself.
    within: Vec<usize>,
}

impl<'a> Reader<'a, '_> {
    fn steps(&mut self, steps: &'a [Step]) {
        for step in steps {
            step.calls().for_each(|call| self.kernel(call));
            self.steps(step.body());
        }
    }

    fn kernel(&mut self, call: &'a KernelCall) {
        if let Callee::Declared(i) = call.kernel {
            if !self.within.contains(&i) {
                let steps = &self.plan.kernels[i].steps;
                self.within.push(i);
                self.moved(call, steps);
                self.steps(steps);
                self.within.pop();
            }
            return;
        }
        // A kernel without a selection moves everything. A kernel that applies another
        // one moves what that moves.
        let mut selects = false;
        for arg in &call.args {
            match arg {
                Argument::Kernel(inner) => self.kernel(inner),
                Argument::Choices(c) => self.selects(call, &c.selection),
                _ => continue,
            }
            selects = true;
        }
        if !selects {
            self.add(&call.text, Selector::All);
        }
    }

    /// Adds what a declared kernel proposes itself.
    fn moved(&mut self, call: &KernelCall, steps: &[Step]) {
        for step in steps {
            match &step.kind {
                StepKind::For(_, _, body) => self.moved(call, body),
                StepKind::Propose(path, _) | StepKind::Map(path, _) => {
                    self.selects(call, &Selection::Path(path.clone()));
                }
                _ => {}
            }
        }
    }

    fn selects(&mut self, call: &KernelCall, selection: &Selection) {
        let selector = selector(selection, &mut self.env).unwrap_or(Selector::All);
        self.add(&call.text, selector);
    }

    fn add(&mut self, kernel: &str, selector: Selector) {
        match self.found.iter_mut().find(|k| k.kernel == kernel) {
            Some(k) if k.selector == selector => {}
            Some(k) => {
                k.selector = Selector::Union(Box::new(k.selector.clone()), Box::new(selector))
            }
            None => self.found.push(Selecting { kernel: kernel.to_owned(), selector }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{compiled, trace};

    #[test]
    fn kernels_within_declared_ones_are_found() {
        let text = "assume x ~ normal(0, 1); assume y ~ normal(0, 1); observe normal(x + y, 1) = 1;
             kernel first(s) { drift(@x, s); }
             kernel both(s) { first(s); mh(@y); }
             infer { repeat 10 { both(0.5); block(@x); both(2); } }";
        let (mut trace, plan) = (trace(text, 1), &compiled(text).plans[0]);
        let found = selecting(plan, &mut trace);
        let names: Vec<&str> = found.iter().map(|k| &*k.kernel).collect();
        assert_eq!(names, ["drift(@x, s)", "mh(@y)", "block(@x)"]);
    }
}
