//! Names in a program: where each is bound, and where it stands otherwise.

use pcadlang_syntax::span::Span;
use std::sync::Arc;

/// The index of a binding in [`Names::bindings`].
pub type BindingId = usize;

/// The kind of thing that a name is bound to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A `param`.
    Param,
    /// A `data` item.
    Data,
    /// A function.
    Function,
    /// A declared kernel.
    Kernel,
    /// An `infer` block.
    Plan,
    /// A random choice, or a container of choices.
    Choice,
    /// A value.
    Value,
    /// A parameter of a function or kernel.
    Argument,
    /// The variable of a loop.
    Loop,
    /// A prediction.
    Prediction,
    /// The name of an observation or factor, in addresses only.
    Observation,
    /// The namespace of an included file.
    Namespace,
}

impl BindingKind {
    /// Returns what users call it.
    pub fn name(self) -> &'static str {
        match self {
            BindingKind::Param => "param",
            BindingKind::Data => "data",
            BindingKind::Function => "function",
            BindingKind::Kernel => "kernel",
            BindingKind::Plan => "inference block",
            BindingKind::Choice => "choice",
            BindingKind::Value => "value",
            BindingKind::Argument => "parameter",
            BindingKind::Loop => "loop variable",
            BindingKind::Prediction => "prediction",
            BindingKind::Observation => "observation",
            BindingKind::Namespace => "namespace",
        }
    }
}

/// One binding of a name.
#[derive(Clone, Debug)]
pub struct Binding {
    /// The name.
    pub name: Arc<str>,
    /// Its kind.
    pub kind: BindingKind,
    /// The name where it is bound.
    pub span: Span,
    /// The item, statement or parameter that binds it.
    pub whole: Span,
    /// Where it can be used: everywhere in its file if at the top level.
    pub scope: Option<Span>,
    /// The parameters of a function or kernel.
    pub arguments: Vec<BindingId>,
}

/// A place where a name stands, its binding included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occurrence {
    /// The name there.
    pub span: Span,
    /// The binding that it refers to.
    pub binding: BindingId,
}

/// The names of a program and of the files it includes.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// All bindings.
    pub bindings: Vec<Binding>,
    /// All occurrences, in no particular order.
    pub occurrences: Vec<Occurrence>,
    /// The names that are not bound in the program, with their namespace if written:
    /// built-ins, if they exist.
    pub others: Vec<(Span, Arc<str>)>,
    /// The names of segments of addresses after the first one. They are not resolved.
    pub segments: Vec<Arc<str>>,
}

impl Names {
    /// Returns the binding of the name at a byte of a file; a cursor right after a name
    /// counts.
    pub fn at(&self, file: u32, byte: u32) -> Option<(Occurrence, &Binding)> {
        let found = self.occurrences.iter().find(|o| touches(o.span, file, byte))?;
        Some((*found, self.bindings.get(found.binding)?))
    }

    /// Returns the name at a byte of a file that is not bound in the program.
    pub fn other_at(&self, file: u32, byte: u32) -> Option<(Span, &str)> {
        let found = self.others.iter().find(|(span, _)| touches(*span, file, byte))?;
        Some((found.0, &found.1))
    }

    /// Returns all places of a binding, in the order of the text, each once.
    pub fn places(&self, binding: BindingId) -> Vec<Span> {
        let mine = self.occurrences.iter().filter(|o| o.binding == binding);
        let mut all: Vec<Span> = mine.map(|o| o.span).collect();
        all.sort_by_key(|s| (s.file.0, s.start));
        all.dedup();
        all
    }

    /// Returns the bindings that can be used at a byte of a file, inner ones last.
    pub fn visible(&self, file: u32, byte: u32) -> impl Iterator<Item = &Binding> {
        self.bindings.iter().filter(move |b| match b.scope {
            None => b.span.file.0 == file,
            Some(scope) => touches(scope, file, byte) && b.span.start <= byte,
        })
    }

    /// Returns whether a choice with this name may be part of an address that is not resolved.
    pub fn is_segment(&self, name: &str) -> bool {
        self.segments.iter().any(|s| &**s == name)
    }
}

fn touches(span: Span, file: u32, byte: u32) -> bool {
    span.file.0 == file && span.start <= byte && byte <= span.end
}
