//! Finds and evaluates the view of a program in a trace.

use pcadlang_engine::lang::code::Operand;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Constraint, Draws, SaveError, SavedTrace, Trace};
use pcadlang_library::Model;
use pcadlang_library::scene::ViewValue;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_syntax::diag::Error;
pub use pcadlang_workbench::session::view;
use std::sync::Arc;

/// Returns the random stream for values that no observation depends on.
pub fn predictive(seed: u64, step: u64) -> Draws {
    Draws { key: StreamKey::new(seed, u32::MAX, Purpose::PREDICT), step, substream: 0 }
}

/// Rebuilds the state with the given choices.
pub fn rebuilt(model: &Model, choices: &[(u64, Constraint)], draws: Draws) -> Result<Trace, Error> {
    let (code, limits) = (Arc::clone(model.code()), model.limits().clone());
    let built = Trace::generate(code, choices.iter().cloned(), draws, limits);
    built.map(|(trace, _)| trace).map_err(|e| model.run_error(*e))
}

/// Loads a saved state.
pub fn loaded(model: &Model, saved: &SavedTrace) -> Result<Trace, SaveError> {
    Trace::load(Arc::clone(model.code()), model.hash(), saved, model.limits().clone())
}

/// Returns the operand of the program's view: the last top-level name that is a view, of
/// those that the state has, or else of all.
pub fn view_operand(trace: &mut Trace, draws: Draws) -> Option<Operand> {
    let globals: Vec<Operand> = trace.code().globals.values().rev().copied().collect();
    let is_view = |value: &Value| value.downcast::<ViewValue>().is_some();
    let known = globals.iter().find(|o| trace.evaluated(**o).is_some_and(is_view)).copied();
    let is_one = |values: Vec<Value>| values.first().is_some_and(is_view);
    known.or_else(|| globals.into_iter().find(|o| trace.query(&[*o], draws).is_ok_and(is_one)))
}
