//! The outline of a program, the classes of its pieces, the description of the name under a
//! cursor, and hints beside random choices: their address, and where their values lie.

use super::Analysis;
use super::names::{Binding, BindingKind};
use super::words::start_of;
use pcadlang_engine::lang::address::AddressSegment;
use pcadlang_engine::lang::builtins::Kind;
use pcadlang_engine::lang::builtins::doc::doc;
use pcadlang_engine::lang::code::{Block, BlockKind, Code, DistSpec, Op, Operand, SiteId};
use pcadlang_numerics::dist::FAMILIES;
use pcadlang_syntax::span::{FileId, Span};
use pcadlang_syntax::{Class, classes};
use std::ops::Range;
use std::sync::Arc;

/// A piece of the text with its class.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its bytes.
    pub range: Range<usize>,
    /// Its class.
    pub kind: PieceKind,
}

/// The class of a piece of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PieceKind {
    /// A class that the text alone has.
    Text(Class),
    /// A name of the program.
    Bound(BindingKind),
    /// A built-in function or distribution.
    Function,
    /// A built-in kernel.
    Kernel,
}

impl Analysis {
    /// Returns the bindings at the top level, in the order of the text.
    pub fn outline(&self) -> Vec<&Binding> {
        let top = |b: &&Binding| b.span.file == FileId(0) && b.scope.is_none();
        let mut all: Vec<&Binding> = self.names.bindings.iter().filter(top).collect();
        all.sort_by_key(|b| b.span.start);
        all
    }

    /// Returns the pieces of the text that have a class, in order.
    pub fn pieces(&self) -> Vec<Piece> {
        classes(self.text())
            .into_iter()
            .map(|(range, class)| {
                let kind = match class {
                    Class::Name => self.name_kind(range.start as u32),
                    class => PieceKind::Text(class),
                };
                Piece { range, kind }
            })
            .collect()
    }

    fn name_kind(&self, byte: u32) -> PieceKind {
        if let Some((_, b)) = self.names.at(0, byte + 1) {
            return PieceKind::Bound(b.kind);
        }
        let other = self.names.other_at(0, byte + 1).map(|(_, name)| name);
        let found = other.and_then(|name| self.builtins.iter().find(|b| b.full_name() == name));
        match found.map(|b| b.kind) {
            Some(Kind::Plan(_)) => PieceKind::Kernel,
            Some(_) => PieceKind::Function,
            None => PieceKind::Text(Class::Name),
        }
    }
}

/// The maximum number of lines of a declaration that are shown.
const LINES: usize = 6;

impl Analysis {
    /// Returns what the name or keyword at a byte is, as Markdown, and where it stands.
    pub fn hover(&self, byte: u32) -> Option<(Span, String)> {
        if let Some((o, binding)) = self.names.at(0, byte) {
            return Some((o.span, self.binding_text(binding)));
        }
        let (span, name) = match self.names.other_at(0, byte) {
            Some((span, name)) => (span, name.to_owned()),
            None => self.word_at(byte as usize)?,
        };
        let text = doc(&self.builtins, &name)?;
        Some((span, format!("```\n{}\n```", text.trim_end())))
    }

    fn binding_text(&self, b: &Binding) -> String {
        let text = self.sources.slice(b.whole);
        let lines: Vec<&str> = text.lines().take(LINES).collect();
        let more = if text.lines().count() > LINES { "\n…" } else { "" };
        let file = match b.span.file {
            FileId(0) => String::new(),
            _ => format!(" in {}", self.sources.locate(b.span)),
        };
        format!("```pcad\n{}{more}\n```\n{} `{}`{file}", lines.join("\n"), b.kind.name(), b.name)
    }

    /// Returns the word around a byte.
    fn word_at(&self, byte: usize) -> Option<(Span, String)> {
        let text = self.text();
        let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let (before, after) = text.split_at_checked(byte)?;
        let start = start_of(before, part);
        let end = byte + after.find(|c| !part(c)).unwrap_or(after.len());
        let word = text.get(start..end).filter(|w| !w.is_empty())?;
        Some((Span::new(FileId(0), start, end), word.to_owned()))
    }
}

/// A hint at a place in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Hint {
    /// The byte after which it is shown.
    pub at: u32,
    /// The address of the choice, where it is known: `…` stands for the callers of its
    /// function, and for the keys of loops.
    pub address: String,
    /// The support, in words.
    pub support: String,
}

impl Analysis {
    /// Returns a hint for each random choice in the text; none while it has mistakes.
    pub fn hints(&self) -> Vec<Hint> {
        let Some(model) = &self.model else { return Vec::new() };
        let code = model.code();
        let mut all = Vec::new();
        for block in &code.blocks {
            for (slot, span) in block.slots().zip(&block.spans) {
                let op = &code.ops[block.first + slot];
                let Op::Draw { dist, site, .. } = op else { continue };
                if span.file != FileId(0) {
                    continue;
                }
                all.push(Hint {
                    at: span.end,
                    address: address(code, block, *site),
                    support: support(code, block, dist).unwrap_or_default(),
                });
            }
        }
        all.sort_by_key(|h| h.at);
        all
    }
}

fn address(code: &Code, block: &Block, site: SiteId) -> String {
    let (mut inside, mut looped, mut at) = (false, false, Some(block));
    while let Some(block) = at {
        match block.kind {
            BlockKind::Function { .. } => inside = true,
            BlockKind::Loop => looped |= !inside,
            _ => {}
        }
        at = block.parent.map(|p| &code.blocks[p]);
    }
    let segments: Vec<String> = code.sites[site]
        .segments
        .iter()
        .map(|s| AddressSegment {
            name: Arc::clone(&s.name),
            occurrence: s.occurrence,
            keys: Vec::new(),
        })
        .map(|s| s.to_string())
        .collect();
    let (before, keys) = (if inside { "…/" } else { "" }, if looped { "[…]" } else { "" });
    format!("@{before}{}{keys}", segments.join("/"))
}

fn support(code: &Code, block: &Block, dist: &DistSpec) -> Option<String> {
    let builtin = match dist {
        DistSpec::Family { builtin, .. } => *builtin,
        DistSpec::Value(Operand::Local(slot)) => match &code.ops[block.first + *slot] {
            Op::Prim { builtin, .. } => *builtin,
            _ => return None,
        },
        DistSpec::Value(_) => return None,
    };
    let family = code.builtins.get(builtin);
    let found = FAMILIES.iter().find(|f| family.host.is_none() && *f.name == *family.name)?;
    Some(found.support.to_owned())
}
