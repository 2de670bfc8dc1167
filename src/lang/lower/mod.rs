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
//! `expr` expressions, `call` calls, `plan` inference blocks, `select` selections, `types`
//! static types, `hints` suggestions for unknown names, `interface` parameters and data.

mod call;
mod draw;
mod expr;
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
pub use lowerer::{Export, Inputs, Plan, ReadData, Report};

use super::code::{Block, BlockKind, Code};
use super::load::Loaded;
use crate::diag::{Diagnostic, SourceMap};
use indexmap::{IndexMap, IndexSet};
use lowerer::{AddHint, Lowerer};
use scope::{Body, Module, Scope, ScopeKind};
use std::sync::Arc;

/// A program ready to run.
#[derive(Debug)]
pub struct Compiled {
    /// The model.
    pub code: Arc<Code>,
    /// Its inference blocks, in order.
    pub plans: Vec<Plan>,
    /// Its reports.
    pub reports: Vec<Report>,
    /// Its exports.
    pub exports: Vec<Export>,
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
    let mut l = Lowerer {
        code: Code {
            builtins: Arc::clone(&inputs.builtins),
            eager: inputs.eager,
            ..Code::default()
        },
        inputs,
        loaded,
        map,
        errors: Vec::new(),
        modules: vec![Module::default()],
        module: 0,
        scopes: Vec::new(),
        bodies: Vec::new(),
        pending: Vec::new(),
        plans: Vec::new(),
        kernels: IndexMap::new(),
        reports: Vec::new(),
        exports: Vec::new(),
        used_sets: Vec::new(),
        used_data: Vec::new(),
        roots: IndexSet::new(),
    };
    l.code.blocks.push(Block::new(BlockKind::Root, None));
    l.scopes.push(Scope::new(0, ScopeKind::Root));
    l.bodies.push(Body::default());
    l.unit(0);
    l.function_bodies();
    l.inference();
    l.unused_inputs();
    if !l.errors.is_empty() {
        // Errors without a location are about the command line; they come first.
        l.errors.sort_by_key(|d| d.labels.first().map(|l| (l.span.file.0, l.span.start)));
        l.errors.dedup();
        return Err(l.errors);
    }
    l.code.kernels = l.kernels.into_values().collect();
    l.code.finish();
    Ok(Compiled { code: Arc::new(l.code), plans: l.plans, reports: l.reports, exports: l.exports })
}
