//! Names, lexical blocks and bodies: what a name refers to, and what a place in the text
//! adds to addresses.

use crate::lang::builtins::Type;
use crate::lang::code::{BlockId, Operand, SiteTag, Slot};
use indexmap::IndexMap;
use pcadlang_syntax::span::Span;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// The referent of a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    /// A constant, or a slot of the block in which the name is bound.
    Value(Operand),
    /// A named function.
    Function(BlockId),
    /// A keyed container: its slot.
    Container(Slot),
}

/// A bound name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Binding {
    pub meaning: Meaning,
    pub ty: Type,
    pub span: Span,
}

/// The kinds of lexical blocks.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ScopeKind {
    Root,
    Function,
    Branch,
    /// A pass of the `for` in a slot of the enclosing block.
    Loop {
        var: Arc<str>,
        at: Slot,
    },
}

/// A lexical block.
#[derive(Debug)]
pub(super) struct Scope {
    pub block: BlockId,
    pub kind: ScopeKind,
    pub names: IndexMap<Arc<str>, Binding>,
    /// Elements of containers that are drawn here: container, keys as written, slot.
    pub drawn: Vec<(Arc<str>, String, Slot)>,
}

impl Scope {
    pub fn new(block: BlockId, kind: ScopeKind) -> Self {
        Scope { block, kind, names: IndexMap::new(), drawn: Vec::new() }
    }
}

/// The counters and tags of one function body; addresses are relative to it.
#[derive(Debug, Default)]
pub(super) struct Body {
    /// The bindings around the current expression, outermost first.
    pub prefix: Vec<Arc<str>>,
    /// The number of occurrences of a name under a prefix.
    pub counts: FxHashMap<(Vec<Arc<str>>, Arc<str>), u32>,
    /// Tags of the enclosing `assume`, by index of their name.
    pub tags: Vec<SiteTag>,
    /// The occurrence of a container's name, by block and slot: its elements share it,
    /// wherever they are drawn.
    pub containers: FxHashMap<(BlockId, Slot), u32>,
}

/// The top-level names of a file, or of files that share a namespace.
#[derive(Debug, Default)]
pub(super) struct Module {
    pub names: IndexMap<Arc<str>, Binding>,
    pub namespaces: FxHashMap<Arc<str>, Namespace>,
    /// The namespace under which its names are visible from outside.
    pub prefix: Option<Arc<str>>,
    /// The module of the table of built-ins whose names are visible in it.
    pub native: Option<Arc<str>>,
}

/// The referent of `ns` in `ns.name`.
#[derive(Clone, Debug)]
pub(super) struct Namespace {
    pub module: usize,
    pub span: Span,
}
