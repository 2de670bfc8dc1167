//! The state of lowering: what it is given, and what has been lowered so far.

use super::scope::{Body, Module, Scope, ScopeKind};
use super::types::of_value;
use crate::lang::builtins::data::Options;
use crate::lang::builtins::{Table, Type};
use crate::lang::code::{Block, BlockId, BlockKind, Code, Eager, Op, Operand, Slot};
use crate::lang::error::Fault;
use crate::lang::load::Loaded;
use crate::lang::plan::{Given, Plan};
use crate::lang::value::Value;
use indexmap::{IndexMap, IndexSet};
use pcadlang_syntax::ast::{Expr, FnDecl, KStmt, KernelDecl, Name};
use pcadlang_syntax::diag::{Diagnostic, SourceMap};
use pcadlang_syntax::span::Span;
use rustc_hash::FxHashMap;
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
    /// True if a `data` item without a value is an error; false when a program is only
    /// checked.
    pub needs_data: bool,
    /// Default values for omitted arguments, by full name of the built-in and name of the
    /// argument.
    pub defaults: FxHashMap<(String, String), Value>,
    /// The slots that run even if nothing depends on them.
    pub eager: Eager,
}

/// `report e, … as "file";`
#[derive(Clone, Debug)]
pub struct Report {
    /// The reported expression.
    pub exprs: Vec<Expr>,
    /// The file, if named.
    pub file: Option<Arc<str>>,
}

/// `export e to "file";`
#[derive(Clone, Debug)]
pub struct Export {
    /// The exported expression.
    pub expr: Expr,
    /// The file.
    pub file: Arc<str>,
}

/// A named function whose body is lowered when all top-level names are known.
pub(super) struct Pending {
    pub module: usize,
    pub block: BlockId,
    pub decl: FnDecl,
}

/// The context of a statement of an inference block.
#[derive(Clone, Default)]
pub(super) struct PlanScope {
    /// Variables of the block.
    pub names: Vec<Arc<str>>,
    pub in_loop: bool,
    pub in_warmup: bool,
    pub in_kernel: bool,
}

impl PlanScope {
    /// Binds a variable.
    pub fn bind(&mut self, name: &Arc<str>) -> usize {
        self.names.push(Arc::clone(name));
        self.names.len() - 1
    }
}

/// The expression of a plan that is being lowered.
pub(super) struct Lowering {
    pub block: BlockId,
    pub given: Vec<Given>,
    pub around: PlanScope,
}

pub(super) struct Lowerer<'a> {
    pub code: Code,
    pub inputs: Inputs<'a>,
    pub loaded: &'a Loaded,
    pub map: &'a mut SourceMap,
    /// Errors and warnings.
    pub errors: Vec<Diagnostic>,
    pub modules: Vec<Module>,
    pub module: usize,
    /// The enclosing lexical blocks; the first is the top level.
    pub scopes: Vec<Scope>,
    /// The enclosing function bodies; the first is the top level.
    pub bodies: Vec<Body>,
    pub pending: Vec<Pending>,
    /// The inference blocks as written, by name, and compiled.
    pub blocks: Vec<(Option<Arc<str>>, Vec<KStmt>)>,
    pub plans: Vec<Arc<Plan>>,
    pub kernels: IndexMap<Arc<str>, KernelDecl>,
    pub freezes: Vec<Expr>,
    /// The number of calls of kernels so far.
    pub calls: usize,
    /// The number of expressions of plans so far whose values vary.
    pub varying: usize,
    /// The expression of a plan that is being lowered, if any.
    pub lowering: Option<Lowering>,
    pub reports: Vec<Report>,
    pub exports: Vec<Export>,
    pub used_sets: Vec<String>,
    pub used_data: Vec<String>,
    /// First segments of addresses, with which a selection may begin.
    pub roots: IndexSet<Arc<str>>,
}

/// An operand and its static type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Typed {
    pub at: Operand,
    pub ty: Type,
}

impl<'a> Lowerer<'a> {
    pub fn new(loaded: &'a Loaded, inputs: Inputs<'a>, map: &'a mut SourceMap) -> Self {
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
            scopes: vec![Scope::new(BlockId::ROOT, ScopeKind::Root)],
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

    pub fn error(
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
    pub fn block(&self) -> BlockId {
        self.scopes.last().map_or(BlockId::ROOT, |s| s.block)
    }

    /// Appends an operation to the block being built.
    pub fn push(&mut self, op: Op, span: Span) -> Slot {
        let block = self.block();
        self.code.blocks[block].push(op, span)
    }

    pub fn new_block(&mut self, kind: BlockKind) -> BlockId {
        let parent = Some(self.block());
        self.code.blocks.push(Block::new(kind, parent));
        BlockId::new(self.code.blocks.len() - 1)
    }

    pub fn constant(&mut self, v: Value) -> Typed {
        let ty = of_value(&v);
        Typed { at: self.code.constant(v), ty }
    }

    /// Returns a placeholder for something that could not be lowered and whose error was
    /// reported.
    pub fn nothing(&mut self) -> Typed {
        Typed { at: self.code.constant(Value::Unit), ty: Type::Any }
    }

    /// Returns the name under which a name of the current module appears in reports.
    pub fn global_name(&self, name: &Name) -> Arc<str> {
        match &self.modules[self.module].prefix {
            Some(p) => Arc::from(format!("{p}/{}", name.node)),
            None => Arc::clone(&name.node),
        }
    }
}
