//! Lowering from syntax trees to [`Code`], with all names, arguments, tags and addresses
//! checked.
//!
//! Blocks nest as in the text; a name becomes a slot of its block. The top level comes
//! first, then the bodies of named functions, which see every top-level name, then the
//! inference blocks, which see everything before them. Nothing is evaluated here except
//! the defaults of `param` and `data` given by the host.
//!
//! There is one file per concern: `lowerer` the state, `scope` and `names` names and
//! sites, `items` the top level, `stmt` statements, `draw` random choices and containers,
//! `expr` expressions, `call` calls, `plan` inference blocks, `formula` their expressions,
//! `select` selections, `types` static types, `hints` suggestions for unknown names, `interface` parameters and data.

mod call;
mod draw;
mod expr;
mod formula;
mod hints;
mod interface;
mod items;
mod lowerer;
mod names;
mod plan;
mod scope;
mod select;
mod stmt;
mod types;

pub use interface::{DataItem, Interface, ParamItem, inspect};
pub use lowerer::{Export, Inputs, ReadData, Report};

use super::builtins::Table;
use super::code::{Code, Eager};
use super::load::Loaded;
use super::plan::{DeclaredKernel, Plan};
use super::value::Value;
use indexmap::IndexMap;
use lowerer::{Lowerer, PlanScope};
use pcadlang_syntax::ast::KStmt;
use pcadlang_syntax::diag::{Diagnostic, Severity, SourceMap};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// A program ready to run.
#[derive(Debug)]
pub struct Compiled {
    /// The model.
    pub code: Arc<Code>,
    /// Its inference blocks, in order.
    pub plans: Vec<Arc<Plan>>,
    /// The kernels it declares.
    pub kernels: Arc<[DeclaredKernel]>,
    /// Its reports.
    pub reports: Vec<Report>,
    /// Its exports.
    pub exports: Vec<Export>,
    /// What is suspicious in it, in the order of the text.
    pub warnings: Vec<Diagnostic>,
}

/// Lowers a loaded program. The texts of `--set` values are added to `map`.
///
/// # Errors
/// All errors of the program, in the order of the text; those about settings come first.
pub fn compile(
    loaded: &Loaded,
    inputs: Inputs,
    map: &mut SourceMap,
) -> Result<Compiled, Vec<Diagnostic>> {
    let mut l = Lowerer::new(loaded, inputs, map);
    l.unit(0);
    l.function_bodies();
    let kernels = l.inference();
    l.unused_inputs();
    // Errors without a location are about the command line; they come first.
    l.errors.sort_by_key(|d| d.labels.first().map(|l| (l.span.file.0, l.span.start)));
    l.errors.dedup();
    let is_warning = |d: &Diagnostic| d.severity != Severity::Error;
    let (warnings, errors): (Vec<_>, Vec<_>) = l.errors.into_iter().partition(is_warning);
    if !errors.is_empty() {
        return Err(errors);
    }
    l.code.finish();
    let (code, plans) = (Arc::new(l.code), l.plans);
    Ok(Compiled { code, plans, kernels, reports: l.reports, exports: l.exports, warnings })
}

/// Compiles an inference block that reads nothing of a program, such as the default one.
pub fn compile_plan(builtins: Arc<Table>, body: &[KStmt]) -> Plan {
    let inputs = Inputs {
        builtins,
        sets: &[],
        data: IndexMap::new(),
        read: &|_, _, _, _| Ok(Value::Unit),
        needs_data: false,
        defaults: FxHashMap::default(),
        eager: Eager::default(),
    };
    let (loaded, mut map) = (Loaded::default(), SourceMap::new());
    let mut l = Lowerer::new(&loaded, inputs, &mut map);
    Plan { steps: l.plan_body(body, &mut PlanScope::default()), ..Plan::default() }
}
