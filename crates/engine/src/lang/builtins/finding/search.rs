//! Full-text search for built-ins.

use crate::lang::builtins::{Builtin, Table};
use pcadlang_syntax::diag::nearest;
use pcadlang_syntax::elsewhere::FOREIGN_NAMES;

/// The result of a search.
#[derive(Debug)]
pub struct Found<'t> {
    /// The matches, best first.
    pub entries: Vec<&'t Builtin>,
    /// Words without a match, each with the nearest known word, which was searched for
    /// instead.
    pub instead: Vec<(String, String)>,
    /// Words without a match or a near word; they are ignored.
    pub unknown: Vec<String>,
}

/// Returns the built-ins that match all words, ranked by where the words occur: in the
/// name, in a name from another system, in the section, the description or the arguments.
pub fn search<'t>(table: &'t Table, words: &str) -> Found<'t> {
    let texts: Vec<Text<'t>> = table.iter().map(Text::new).collect();
    let mut found = Found { entries: Vec::new(), instead: Vec::new(), unknown: Vec::new() };
    let mut wanted = Vec::new();
    for word in words_of(words) {
        if texts.iter().any(|text| text.worth(&word) > 0) {
            wanted.push(word);
            continue;
        }
        let known = texts.iter().flat_map(Text::words).filter(|known| known.len() > 2);
        match nearest(&word, known) {
            Some(near) => {
                wanted.push(near.to_owned());
                found.instead.push((word, near.to_owned()));
            }
            None => found.unknown.push(word),
        }
    }
    if wanted.is_empty() {
        return found;
    }
    let worth = |text: &Text<'t>| {
        let each: Vec<u32> = wanted.iter().map(|word| text.worth(word)).collect();
        each.iter().all(|worth| *worth > 0).then(|| each.iter().sum::<u32>())
    };
    let mut ranked: Vec<(u32, &'t Builtin)> =
        texts.iter().filter_map(|text| Some((worth(text)?, text.of))).collect();
    ranked.sort_by_key(|(worth, _)| std::cmp::Reverse(*worth));
    found.entries = ranked.into_iter().map(|(_, b)| b).collect();
    found
}

/// The searchable text of a built-in, as lower-case words.
struct Text<'t> {
    of: &'t Builtin,
    name: String,
    parts: Vec<String>,
    section: Vec<String>,
    doc: Vec<String>,
    args: Vec<String>,
    /// Its names in other systems.
    aliases: Vec<String>,
}

impl<'t> Text<'t> {
    fn new(of: &'t Builtin) -> Self {
        let args = of.args.iter().flat_map(|arg| words_of(&arg.name).chain(words_of(&arg.doc)));
        let known =
            FOREIGN_NAMES.iter().find(|(name, ..)| of.module.is_empty() && *name == of.name);
        let aliases = known
            .into_iter()
            .flat_map(|(_, names, words)| [names, words])
            .flat_map(|words| words_of(words).chain(words.split(' ').map(str::to_owned)));
        Text {
            of,
            name: of.name.to_lowercase(),
            parts: words_of(&of.name).chain(words_of(&of.module)).collect(),
            section: words_of(&of.section).collect(),
            doc: words_of(&of.doc).collect(),
            args: args.collect(),
            aliases: aliases.collect(),
        }
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        let all = [&self.parts, &self.section, &self.doc, &self.args, &self.aliases]
            .into_iter()
            .flatten();
        all.map(String::as_str).chain(std::iter::once(self.name.as_str()))
    }

    /// The score of a word: 0 if it does not occur.
    fn worth(&self, word: &str) -> u32 {
        let begins = |words: &[String]| words.iter().any(|known| known.starts_with(word));
        let is = |words: &[String]| words.iter().any(|known| known == word);
        match () {
            () if self.name == word || self.of.full_name().to_lowercase() == word => 64,
            () if is(&self.parts) => 32,
            () if begins(&self.parts) || self.name.starts_with(word) => 16,
            () if is(&self.aliases) => 12,
            () if begins(&self.section) => 8,
            () if is(&self.doc) => 6,
            () if begins(&self.doc) => 4,
            () if is(&self.args) => 3,
            () if word.len() > 2 && (begins(&self.args) || self.name.contains(word)) => 1,
            () => 0,
        }
    }
}

/// Splits a text into lower-case words at white space and punctuation. Texts of one or
/// two characters are kept whole, so that operators are words too.
fn words_of(text: &str) -> impl Iterator<Item = String> + '_ {
    text.split(|c: char| c.is_whitespace() || "_.,;:()[]{}`'\"/".contains(c) && text.len() > 2)
        .map(|word| word.trim_matches(|c: char| c == '?').to_lowercase())
        .filter(|word| !word.is_empty())
}
