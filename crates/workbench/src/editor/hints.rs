//! Hints beside random choices: their address, and where their values lie.

use super::Analysis;
use pcadlang_engine::lang::address::AddressSegment;
use pcadlang_engine::lang::code::{Block, BlockKind, Code, DistSpec, Op, Operand, SiteId};
use pcadlang_numerics::dist::FAMILIES;
use pcadlang_syntax::span::FileId;
use std::sync::Arc;

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
