//! Exact joint draws of finite discrete choices given all others, by variable elimination
//! (Koller & Friedman 2009, chapter 9).

use super::row::{KernelRow, SEL};
use crate::kernel::{Kernel, Outcome, Pick, Registered, SiteSelection, StepContext};
use pcadlang_engine::lang::code::Observed;
use pcadlang_engine::lang::error::{FaultKind, RunError};
use pcadlang_engine::trace::{
    Constraint, Selection, Selector, Tabulated, Tabulation, Trace, TraceResult,
};
use pcadlang_numerics::elimination::{Elimination, TooLarge};
use rustc_hash::FxHashSet;
use std::sync::Arc;

pub(crate) const ROW: KernelRow = KernelRow::new(
    "exact",
    &[SEL],
    "Draws all selected finite discrete choices jointly from their exact distribution given \
     the rest. They are summed out one by one in the order of min-fill, so long chains, trees \
     and narrow grids are cheap; a table may have at most 2^20 entries. If there are no other \
     choices, the draws are independent and the report has the exact evidence.",
    "\
for i in 0 .. 4 {
  z[i] ~ flip(if i == 0 { 0.5 } else { if z[i - 1] { 0.9 } else { 0.1 } });
  observe normal(if z[i] { 1 } else { 0 }, 0.5) = 0.8 as y;
}
infer { repeat 100 { exact($finite); collect z[0], z[3]; } }",
    |call| {
        call.moving(|scope, call| match scope.pick {
            Pick::All => Ok(Exact::new(scope.selector)),
            _ => {
                let message = "`exact` draws all selected choices together".to_owned();
                let mut e = crate::calls::error::fail(call.span(), message);
                e.hint = Some("exact($finite), or gibbs(each($finite)) for one at a time".into());
                Err(e)
            }
        })
    },
);

/// The largest number of entries of a table.
const LARGEST: usize = 1 << 20;

/// `exact(sel)`: a joint draw of finite choices.
#[derive(Clone, Debug)]
pub struct Exact {
    scope: Registered,
    last: Option<Last>,
    log_evidence: Option<f64>,
}

/// The tables of the last step, and what they hold for.
#[derive(Clone, Debug)]
struct Last {
    trace: Arc<()>,
    observed: Arc<Observed>,
    power: f64,
    others: Vec<(u64, Constraint)>,
    tables: Tabulated,
    elimination: Elimination,
}

/// Why there are no tables.
pub(super) enum NoTables {
    /// The program fails at some values of the choices.
    Fails,
    /// They cannot be tabulated, or a table would be too large.
    Refused(Box<RunError>),
}

impl Exact {
    /// A kernel for these choices.
    pub fn new(choices: Selector) -> Self {
        let scope = SiteSelection { selector: choices, pick: Pick::All };
        Exact { scope: Registered::new(scope), last: None, log_evidence: None }
    }

    /// Makes the tables for the present state, unless those of the last step still hold.
    fn tabulate(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<Result<(), NoTables>> {
        let selection = self.scope.selection(trace);
        let others = others(trace, selection);
        let observed = trace.replacements();
        let holds = |l: &Last| {
            Arc::ptr_eq(&l.trace, trace.identity())
                && Arc::ptr_eq(&l.observed, observed)
                && l.power == at.power
                && l.others == others
        };
        if self.last.as_ref().is_some_and(holds) {
            return Ok(Ok(()));
        }
        self.last = None;
        let (identity, observed) = (Arc::clone(trace.identity()), Arc::clone(observed));
        let mut tables = match trace.tabulate(selection, at.power, at.draws(0))? {
            Tabulation::Tables(tables) => tables,
            Tabulation::Fails => return Ok(Err(NoTables::Fails)),
            Tabulation::Refused(e) => return Ok(Err(NoTables::Refused(e))),
        };
        let factors = std::mem::take(&mut tables.factors);
        let made = Elimination::new(&tables.counts(), factors, LARGEST);
        let elimination = match made {
            Ok(elimination) => elimination,
            Err(e) => return Ok(Err(NoTables::Refused(too_large(trace, selection, e)))),
        };
        self.last =
            Some(Last { trace: identity, observed, power: at.power, others, tables, elimination });
        Ok(Ok(()))
    }

    /// Draws the choices; or returns why they have no tables.
    ///
    /// # Errors
    /// If the program fails in a way that does not depend on their values.
    pub(super) fn draw(
        &mut self,
        trace: &mut Trace,
        at: &StepContext,
    ) -> TraceResult<Result<Outcome, NoTables>> {
        match self.tabulate(trace, at)? {
            Ok(()) => self.draw_from_tables(trace, at).map(Ok),
            Err(none) => Ok(Err(none)),
        }
    }

    fn draw_from_tables(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let selection = self.scope.selection(trace);
        let Some(Last { others, tables, elimination, .. }) = &self.last else {
            return Ok(Outcome::failed());
        };
        let total = tables.rest + elimination.log_sum();
        if total.is_nan() || total == f64::NEG_INFINITY {
            return Ok(Outcome::failed());
        }
        if others.is_empty() && at.power == 1.0 {
            self.log_evidence = Some(total);
        }
        let drawn = elimination.draw(&mut at.stream());
        let there = trace.assign(tables, &drawn, selection, at.draws(0))?;
        Ok(if there { Outcome::one(true) } else { Outcome::failed() })
    }
}

/// The choices that are not selected, with their values.
fn others(trace: &Trace, selection: Selection) -> Vec<(u64, Constraint)> {
    let selected = trace.targets(selection);
    if selected.len() == trace.choice_count() {
        return Vec::new();
    }
    let hashes: FxHashSet<u64> = selected.iter().map(|t| trace.address_hash(*t)).collect();
    trace.constraints().into_iter().filter(|(hash, _)| !hashes.contains(hash)).collect()
}

fn too_large(trace: &Trace, selection: Selection, e: TooLarge) -> Box<RunError> {
    let address = trace.targets(selection).first().map(|t| trace.address(*t)).unwrap_or_default();
    Box::new(RunError {
        kind: FaultKind::Type,
        message: format!(
            "exact: these choices depend on each other too much: a table would have {} entries, and at most {LARGEST} are possible",
            e.0
        ),
        span: Default::default(),
        address,
        calls: Vec::new(),
        hint: Some("gibbs(each($finite)) draws them one at a time".into()),
    })
}

impl Kernel for Exact {
    fn name(&self) -> String {
        "exact".into()
    }

    fn log_evidence(&self) -> Option<f64> {
        self.log_evidence
    }

    fn step(&mut self, trace: &mut Trace, at: &StepContext) -> TraceResult<Outcome> {
        let selection = self.scope.selection(trace);
        if trace.targets(selection).is_empty() {
            return Ok(Outcome::default());
        }
        match self.draw(trace, at)? {
            Ok(outcome) => Ok(outcome),
            Err(NoTables::Fails) => Ok(Outcome::failed()),
            Err(NoTables::Refused(e)) => Err(e),
        }
    }
}
