//! Lowering from syntax trees to [`Code`], with all names, arguments, tags and addresses
//! checked.
//!
//! Blocks nest as in the text; a name becomes a slot of its block. The top level comes
//! first, then the bodies of named functions, which see every top-level name, then the
//! inference blocks, which see everything before them. Nothing is evaluated here except
//! the defaults of `param` and `data` given by the host.
//!
//! There is one file per concern: `scope` names and sites, `items` the top level, `stmt`
//! statements, `draw` random choices and containers, `expr` expressions, `call` calls,
//! `plan` inference blocks, `formula` their expressions, `select` selections, `types` static types, `hints`
//! suggestions for unknown names, `interface` parameters and data.

mod call;
mod draw;
mod expr;
mod formula;
mod hints;
mod interface;
mod items;
mod plan;
mod scope;
mod select;
mod stmt;
mod types;

pub use interface::{DataItem, Interface, ParamItem, inspect};

use super::builtins::Table;
use super::builtins::data::Options;
use super::code::{Block, BlockId, BlockKind, Code, Eager, Op, Operand, Slot};
use super::error::Fault;
use super::load::Loaded;
use super::plan::{DeclaredKernel, Plan};
use super::value::Value;
use crate::diag::{Diagnostic, SourceMap};
use crate::syntax::ast::{Expr, FnDecl, KStmt, KernelDecl, Name};
use crate::syntax::span::{Span, Spanned};
use indexmap::{IndexMap, IndexSet};
use rustc_hash::FxHashMap;
use scope::{Body, Module, Scope};
use std::sync::Arc;

/// Reads a data file, given its kind (`image`, `csv`, …), its path as written, the folder
/// of the program, and the reading options.
pub type ReadData<'a> = &'a dyn Fn(&str, &str, &str, &Options) -> Result<Value, Fault>;

/// The external inputs of a program.
pub struct Inputs<'a> {
    /// The built-ins it sees.
    pub builtins: Arc<Table>,
    /// `--set name=value`, the value as text.
    pub sets: &'a [(String, String)],
    /// The `data` items that are given, by name.
    pub data: IndexMap<String, Value>,
    /// The reader for `data d = csv("file")`.
    pub read: ReadData<'a>,
    /// Whether a `data` item without a value is an error; false when a program is only
    /// checked.
    pub needs_data: bool,
    /// Default values for omitted arguments, by full name of the built-in and name of the
    /// argument.
    pub defaults: FxHashMap<(String, String), Value>,
    /// What runs even if nothing depends on it.
    pub eager: Eager,
}

/// `report e, … as "file";`
#[derive(Clone, Debug)]
pub struct Report {
    /// What to report.
    pub exprs: Vec<Expr>,
    /// The file, if named.
    pub file: Option<Arc<str>>,
}

/// `export e to "file";`
#[derive(Clone, Debug)]
pub struct Export {
    /// What to export.
    pub expr: Expr,
    /// The file.
    pub file: Arc<str>,
}

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
    if !l.errors.is_empty() {
        // Errors without a location are about the command line; they come first.
        l.errors.sort_by_key(|d| d.labels.first().map(|l| (l.span.file.0, l.span.start)));
        l.errors.dedup();
        return Err(l.errors);
    }
    l.code.finish();
    let (code, plans) = (Arc::new(l.code), l.plans);
    Ok(Compiled { code, plans, kernels, reports: l.reports, exports: l.exports })
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
    Plan { steps: l.plan_body(body, &mut plan::Around::default()), ..Plan::default() }
}

/// A named function whose body is lowered when all top-level names are known.
struct Pending {
    module: usize,
    block: BlockId,
    decl: FnDecl,
}

struct Lowerer<'a> {
    code: Code,
    inputs: Inputs<'a>,
    loaded: &'a Loaded,
    map: &'a mut SourceMap,
    errors: Vec<Diagnostic>,
    modules: Vec<Module>,
    module: usize,
    /// The enclosing lexical blocks; the first is the top level.
    scopes: Vec<Scope>,
    /// The enclosing function bodies; the first is the top level.
    bodies: Vec<Body>,
    pending: Vec<Pending>,
    /// The inference blocks as written, by name, and compiled.
    blocks: Vec<(Option<Arc<str>>, Vec<KStmt>)>,
    plans: Vec<Arc<Plan>>,
    kernels: IndexMap<Arc<str>, KernelDecl>,
    freezes: Vec<Expr>,
    /// The number of calls of kernels so far.
    calls: usize,
    /// The number of expressions of plans so far whose values vary.
    varying: usize,
    /// The expression of a plan that is being lowered, if any.
    lowering: Option<formula::Lowering>,
    reports: Vec<Report>,
    exports: Vec<Export>,
    used_sets: Vec<String>,
    used_data: Vec<String>,
    /// First segments of addresses, with which a selection may begin.
    roots: IndexSet<Arc<str>>,
}

/// An operand and its static type.
#[derive(Clone, Copy, Debug)]
struct Typed {
    at: Operand,
    ty: super::builtins::Type,
}

impl<'a> Lowerer<'a> {
    fn new(loaded: &'a Loaded, inputs: Inputs<'a>, map: &'a mut SourceMap) -> Self {
        let (builtins, eager) = (Arc::clone(&inputs.builtins), inputs.eager);
        let blocks = vec![Block::new(BlockKind::Root, None)];
        Lowerer {
            code: Code { builtins, eager, blocks, ..Code::default() },
            inputs,
            loaded,
            map,
            errors: Vec::new(),
            modules: vec![Module::default()],
            module: 0,
            scopes: vec![Scope::new(0, scope::ScopeKind::Root)],
            bodies: vec![Body::default()],
            pending: Vec::new(),
            blocks: Vec::new(),
            plans: Vec::new(),
            kernels: IndexMap::new(),
            freezes: Vec::new(),
            calls: 0,
            varying: 0,
            lowering: None,
            reports: Vec::new(),
            exports: Vec::new(),
            used_sets: Vec::new(),
            used_data: Vec::new(),
            roots: IndexSet::new(),
        }
    }

    fn error(
        &mut self,
        message: impl Into<String>,
        span: Span,
        label: impl Into<String>,
    ) -> &mut Diagnostic {
        self.errors.push(Diagnostic::error(message, span, label));
        let last = self.errors.len() - 1;
        &mut self.errors[last]
    }

    /// Returns the block being built.
    fn block(&self) -> BlockId {
        self.scopes.last().map_or(0, |s| s.block)
    }

    /// Appends an operation to the block being built.
    fn push(&mut self, op: Op, span: Span) -> Slot {
        let block = self.block();
        self.code.blocks[block as usize].push(op, span)
    }

    fn new_block(&mut self, kind: BlockKind) -> BlockId {
        let parent = Some(self.block());
        self.code.blocks.push(Block::new(kind, parent));
        self.code.blocks.len() as BlockId - 1
    }

    fn constant(&mut self, v: Value) -> Typed {
        let ty = types::of_value(&v);
        Typed { at: self.code.constant(v), ty }
    }

    /// Returns a placeholder for something that could not be lowered and whose error was
    /// reported.
    fn nothing(&mut self) -> Typed {
        Typed { at: self.code.constant(Value::Unit), ty: super::builtins::Type::Any }
    }

    /// Returns the name under which a name of the current module appears in reports.
    fn global_name(&self, name: &Name) -> Arc<str> {
        match &self.modules[self.module].prefix {
            Some(p) => Arc::from(format!("{p}/{}", name.node)),
            None => Arc::clone(&name.node),
        }
    }
}

/// Adds hints and labels to a diagnostic in place.
trait AddHint {
    fn hint_also(&mut self, hint: impl Into<String>);
    fn point_at(&mut self, span: Span, text: &str);
}

impl AddHint for Diagnostic {
    fn hint_also(&mut self, hint: impl Into<String>) {
        self.hints.push(hint.into());
    }

    fn point_at(&mut self, span: Span, text: &str) {
        self.labels.push(crate::diag::Label { span, text: text.into(), primary: false });
    }
}

/// Returns the text of a spanned string.
fn text(s: &Spanned<Arc<str>>) -> Arc<str> {
    Arc::clone(&s.node)
}
