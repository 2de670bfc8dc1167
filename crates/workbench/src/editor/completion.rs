//! Completion: the words that fit at a position in a program.

use super::Analysis;
use super::names::BindingKind;
use super::words::{self, KINDS};
use pcadlang_engine::lang::builtins::{Kind, Type};
use pcadlang_syntax::{Class, STATEMENTS, classes};
use std::path::Path;

/// A word that may be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The word.
    pub word: String,
    /// Its kind.
    pub kind: CandidateKind,
    /// One line about it.
    pub detail: String,
}

/// The kind of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CandidateKind {
    /// A name of the program.
    Bound(BindingKind),
    /// A built-in function or distribution.
    Function,
    /// A built-in kernel.
    Kernel,
    /// A constant of the language.
    Constant,
    /// An argument of the call around.
    Argument,
    /// A keyword.
    Keyword,
    /// A tag of choices.
    Tag,
    /// An address of a choice or observation.
    Address,
    /// A file or folder.
    File,
}

impl Analysis {
    /// Returns the words that may stand at a byte, and where the piece begins that they
    /// replace.
    pub fn complete(&self, byte: usize, folder: &Path) -> (usize, Vec<Candidate>) {
        let Some(before) = self.text().get(..byte) else { return (byte, Vec::new()) };
        let in_comment = |(r, c): &(std::ops::Range<usize>, Class)| {
            *c == Class::Comment && r.start < byte && byte <= r.end
        };
        if classes(self.text()).iter().any(in_comment) {
            return (byte, Vec::new());
        }
        let line = before.rfind('\n').map_or(0, |i| i + 1);
        if let Some(start) = words::open_string(&before[line..]).map(|at| line + at) {
            let endings = words::files_wanted(&before[line..start - 1]);
            let files = endings.map(|e| words::files(folder, &before[start..], e));
            let files = files.into_iter().flatten().map(|word| plain(word, CandidateKind::File));
            return chosen(start, before, files);
        }
        let start = words::start_of(before, |c| c.is_alphanumeric() || "_.$@/#".contains(c));
        let word = &before[start..];
        if let Some(at) = word.rfind('@') {
            return chosen(start + at, before, self.addresses());
        }
        if let Some(at) = word.rfind('$') {
            let tags = self.model.iter().flat_map(|m| &m.code().tags).map(|t| format!("${t}"));
            let all = tags.chain(KINDS.iter().map(|k| (*k).to_owned()));
            return chosen(start + at, before, all.map(|word| plain(word, CandidateKind::Tag)));
        }
        if word.starts_with(|c: char| c.is_ascii_digit()) {
            return (byte, Vec::new());
        }
        let start = words::start_of(before, |c| c.is_alphanumeric() || "_.".contains(c));
        let is_drawn = before[..start].trim_end().ends_with('~');
        let all = self.arguments(before, start).into_iter();
        let all = all.chain(self.bound(byte as u32)).chain(self.builtins(is_drawn));
        let (start, mut found) = chosen(start, before, all.chain(keywords()));
        if is_drawn {
            found.sort_by_key(|c| c.kind != CandidateKind::Function);
        }
        (start, found)
    }

    /// The names of the program that can be used here.
    fn bound(&self, byte: u32) -> Vec<Candidate> {
        let detail = |text: &str| text.lines().next().unwrap_or_default().to_owned();
        let mut all: Vec<Candidate> = self
            .names
            .visible(0, byte)
            .filter(|b| b.kind != BindingKind::Observation)
            .map(|b| Candidate {
                word: b.name.to_string(),
                kind: CandidateKind::Bound(b.kind),
                detail: detail(self.sources.slice(b.whole)),
            })
            .collect();
        // Names of included files, below their namespace or as they are.
        for global in self.model.iter().flat_map(|m| m.code().globals.keys()) {
            let word = global.replace('/', ".");
            if !all.iter().any(|c| c.word == word) {
                all.push(plain(word, CandidateKind::Bound(BindingKind::Value)));
            }
        }
        all
    }

    /// The built-in names: after `~` only those of distributions.
    fn builtins(&self, is_drawn: bool) -> impl Iterator<Item = Candidate> {
        let named = |name: &str| name.starts_with(|c: char| c.is_ascii_alphabetic());
        let fits = move |returns: &Type| !is_drawn || *returns == Type::Dist;
        let functions = self.builtins.iter().filter(move |b| named(&b.name) && fits(&b.returns));
        let functions = functions.map(|b| Candidate {
            word: b.full_name(),
            kind: match b.kind {
                Kind::Plan(_) => CandidateKind::Kernel,
                _ => CandidateKind::Function,
            },
            detail: b.doc.to_string(),
        });
        let constants = self.builtins.constants().iter().filter(move |_| !is_drawn);
        let constants = constants.map(|c| Candidate {
            word: c.name.to_string(),
            kind: CandidateKind::Constant,
            detail: c.doc.to_string(),
        });
        functions.chain(constants)
    }

    /// The arguments of the call around, as they are written.
    fn arguments(&self, before: &str, start: usize) -> Vec<Candidate> {
        let Some(name) = words::enclosing_call(&before[..start]) else { return Vec::new() };
        let own = self.names.bindings.iter().find(|b| *b.name == *name && !b.arguments.is_empty());
        let names: Vec<(String, String)> = match own {
            Some(b) => {
                let all = b.arguments.iter().filter_map(|id| self.names.bindings.get(*id));
                all.map(|b| (b.name.to_string(), String::new())).collect()
            }
            None => {
                let found = self.builtins.iter().find(|b| b.full_name() == name);
                let all = found.map_or(&[][..], |b| &b.args);
                all.iter().map(|a| (a.name.to_string(), a.doc.to_string())).collect()
            }
        };
        let written = |(name, detail)| Candidate {
            word: format!("{name} = "),
            kind: CandidateKind::Argument,
            detail,
        };
        names.into_iter().map(written).collect()
    }

    /// The addresses of choices as far as the text determines them.
    fn addresses(&self) -> impl Iterator<Item = Candidate> {
        let is_choice = |kind| matches!(kind, BindingKind::Choice | BindingKind::Observation);
        let top = self.outline().into_iter().filter(move |b| is_choice(b.kind));
        let top = top.map(|b| format!("@{}", b.name)).collect::<Vec<_>>();
        let inner = self.hints().into_iter().map(|h| h.address).filter(|a| !a.contains('…'));
        let all = top.into_iter().chain(inner);
        all.map(|word| plain(word, CandidateKind::Address))
    }
}

fn keywords() -> impl Iterator<Item = Candidate> {
    let statements = STATEMENTS.iter().map(|s| Candidate {
        word: s.name.to_owned(),
        kind: CandidateKind::Keyword,
        detail: s.doc.to_owned(),
    });
    let others = pcadlang_syntax::keywords().filter(|k| STATEMENTS.iter().all(|s| s.name != *k));
    statements.chain(others.map(|k| plain(k.to_owned(), CandidateKind::Keyword)))
}

fn plain(word: String, kind: CandidateKind) -> Candidate {
    Candidate { word, kind, detail: String::new() }
}

/// Returns the candidates that begin with the piece from `start` on, sorted, each once.
fn chosen(
    start: usize,
    before: &str,
    all: impl Iterator<Item = Candidate>,
) -> (usize, Vec<Candidate>) {
    let piece = &before[start..];
    let mut found: Vec<Candidate> = all.filter(|c| c.word.starts_with(piece)).collect();
    found.sort_by(|a, b| a.word.cmp(&b.word));
    found.dedup_by(|b, a| a.word == b.word);
    (start, found)
}
