//! Signature help: the arguments of the call around the cursor.

use super::Analysis;
use super::words;

/// A call that is being written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signature {
    /// The signature, as in the reference.
    pub label: String,
    /// What it is; empty for functions of the program.
    pub doc: String,
    /// Where each argument is in the label, in UTF-16 units, and what it is.
    pub arguments: Vec<([u32; 2], String)>,
    /// The argument at the cursor; `None` if there are more than it takes.
    pub active: Option<usize>,
}

impl Analysis {
    /// Returns the signature of the call around a byte.
    pub fn signature(&self, byte: usize) -> Option<Signature> {
        let before = self.text().get(..byte)?;
        let (name, start) = words::open_call(before)?;
        let own = self.names.bindings.iter().find(|b| *b.name == *name && !b.arguments.is_empty());
        // The name, the default and the description of each argument.
        let mut all: Vec<(&str, Option<&str>, &str)> = Vec::new();
        let (mut doc, mut variadic) = ("", false);
        if let Some(binding) = own {
            let ids = binding.arguments.iter();
            let found = ids.filter_map(|id| self.names.bindings.get(*id));
            all.extend(found.map(|b| (&*b.name, None, "")));
        } else {
            let b = self.builtins.iter().find(|b| b.full_name() == name)?;
            (doc, variadic) = (&b.doc, b.variadic);
            all.extend(b.args.iter().map(|a| (&*a.name, a.default.as_deref(), &*a.doc)));
        }
        let mut label = format!("{name}(");
        let mut arguments = Vec::new();
        for (i, (name, default, doc)) in all.iter().enumerate() {
            label.push_str(if i > 0 { ", " } else { "" });
            let begin = utf16(&label);
            label.push_str(name);
            default.iter().for_each(|d| label.extend([" = ", *d]));
            arguments.push(([begin, utf16(&label)], (*doc).to_owned()));
        }
        label.push_str(if variadic { ", …)" } else { ")" });
        let written = &before[start..];
        let begins = words::arguments(written);
        let last = begins.last().map_or("", |at| &written[*at..]);
        let keyword = last.split_once('=').filter(|(_, rest)| !rest.starts_with('='));
        let keyword =
            keyword.and_then(|(k, _)| all.iter().position(|(name, ..)| *name == k.trim()));
        let place = keyword.unwrap_or(begins.len() - 1);
        let place = if variadic { place.min(all.len().saturating_sub(1)) } else { place };
        let active = Some(place).filter(|place| *place < all.len());
        Some(Signature { label, doc: doc.to_owned(), arguments, active })
    }
}

/// The length of a text in UTF-16 units, as the protocol counts.
fn utf16(text: &str) -> u32 {
    text.encode_utf16().count() as u32
}
