//! Completion of the word at the cursor, depending on its context.

use super::command::COMMANDS;
use super::state::Session;
use crate::lang::builtins::{Kind, Type};
use crate::lang::code::BlockKind;
use crate::syntax::{Class, STATEMENTS, classes};
use std::path::Path;

/// The candidates for a piece of a line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Completion {
    /// Where the piece that is replaced begins, in bytes.
    pub start: usize,
    /// The candidates, in order.
    pub words: Vec<String>,
}

/// Keywords that do not begin a statement.
const KEYWORDS: &[&str] = &["else", "and", "or", "not", "true", "false"];
/// Tags that choices get from their distributions.
const KINDS: &[&str] = &["$continuous", "$discrete", "$finite", "$gaussian"];
/// Built-ins that read files.
const READERS: &[&str] = &[
    "image",
    "csv",
    "json",
    "mesh",
    "armature",
    "keypoints",
    "mask",
    "depth",
    "contours",
    "detector",
];

impl Session {
    /// Completes the word that ends at byte `at` of a line.
    pub fn complete(&self, line: &str, at: usize) -> Completion {
        let Some(before) = line.get(..at) else { return Completion::default() };
        if let Some(command) = before.strip_prefix(':') {
            return match command.split_once(char::is_whitespace) {
                None => found(0, before, COMMANDS.iter().map(|c| format!(":{}", c.name))),
                Some((name, _)) => self.complete_argument(name, before),
            };
        }
        self.complete_text(before)
    }

    /// Completes an argument of a command; only what the command accepts is offered.
    fn complete_argument(&self, command: &str, before: &str) -> Completion {
        let start = before.rfind(char::is_whitespace).map_or(0, |i| i + 1);
        let word = &before[start..];
        let globals = || self.model.code().globals.keys().map(|n| n.to_string());
        let params = || self.program.interface().params.into_iter().map(|p| p.name);
        let is_first = before[..start].split_whitespace().count() == 1;
        match command {
            "save" | "save!" | "load" => found(start, word, files(word, &[".pcad"])),
            "render" => found(start, word, globals().chain(files(word, &[".png"]))),
            "plot" => found(start, word, self.quantity_names().into_iter()),
            "doc" | "help" if is_first => found(start, word, self.topics()),
            "why" if is_first => self.complete_choice(before, std::iter::empty()),
            "set" if is_first => self.complete_choice(before, params()),
            "flip" | "trace" => self.complete_choice(before, self.selections()),
            "infer" if !before.contains(['(', '{']) => {
                let kernels = self
                    .model
                    .code()
                    .builtins
                    .iter()
                    .filter(|b| matches!(b.kind, Kind::Inference(_)));
                let own = self.model.kernels().iter().map(|k| k.name.node.to_string());
                let plans = self.model.plan_names().map(str::to_owned).collect::<Vec<_>>();
                found(start, word, kernels.map(|b| b.name.to_string()).chain(own).chain(plans))
            }
            "infer" | "set" => self.complete_text(before),
            _ => Completion::default(),
        }
    }

    /// Completes the address of a choice or, without the `@`, its name, and some other
    /// words.
    fn complete_choice(&self, before: &str, others: impl Iterator<Item = String>) -> Completion {
        // Keys of addresses may contain spaces.
        let start = before
            .rfind(" @")
            .map_or_else(|| before.rfind(char::is_whitespace), Some)
            .map_or(0, |i| i + 1);
        let word = &before[start..];
        let choices = self.trace.choices().into_iter().map(|(a, _, _)| a.to_string());
        let written = |a: String| {
            if word.starts_with('@') { a } else { a.trim_start_matches('@').to_owned() }
        };
        found(start, word, choices.map(written).chain(others))
    }

    /// Returns tags, and functions that return selections.
    fn selections(&self) -> impl Iterator<Item = String> {
        let tags = self.model.code().tags.iter().map(|t| format!("${t}"));
        let all = self.model.code().builtins.iter().filter(|b| b.returns == Type::Selection);
        tags.chain(KINDS.iter().map(|k| (*k).to_owned())).chain(all.map(|b| b.full_name()))
    }

    /// Returns the topics that `:doc` explains: statements, built-ins, commands.
    pub(super) fn topics(&self) -> impl Iterator<Item = String> {
        let commands = COMMANDS.iter().flat_map(|c| [c.name.to_owned(), format!(":{}", c.name)]);
        STATEMENTS.iter().map(|s| s.name.to_owned()).chain(self.builtins()).chain(commands)
    }

    /// Completes a word of an expression or directive.
    fn complete_text(&self, before: &str) -> Completion {
        if let Some(start) = open_string(before) {
            let is_program = before[..start - 1].trim_end().ends_with("include");
            let reads =
                |name: &&str| before[..start - 1].trim_end().trim_end_matches('(').ends_with(*name);
            return match is_program || READERS.iter().any(reads) {
                true => found(
                    start,
                    &before[start..],
                    files(&before[start..], if is_program { &[".pcad"] } else { &[] }),
                ),
                false => Completion::default(),
            };
        }
        let part_of_address = |c: char| c.is_alphanumeric() || "@_/[]#*\".-".contains(c);
        let start = before
            .rfind(|c: char| !part_of_address(c))
            .map_or(0, |i| i + before[i..].chars().next().map_or(1, char::len_utf8));
        if before[start..].contains('@') {
            let start = start + before[start..].rfind('@').unwrap_or(0);
            return found(start, &before[start..], self.addresses());
        }
        let part_of_name = |c: char| c.is_alphanumeric() || c == '_' || c == '.' || c == '$';
        let start = before
            .rfind(|c: char| !part_of_name(c))
            .map_or(0, |i| i + before[i..].chars().next().map_or(1, char::len_utf8));
        let word = &before[start..];
        if word.starts_with('$') {
            let tags = self.model.code().tags.iter().map(|t| format!("${t}"));
            return found(start, word, tags.chain(KINDS.iter().map(|k| (*k).to_owned())));
        }
        if word.starts_with(|c: char| c.is_ascii_digit()) {
            return Completion::default();
        }
        let arguments =
            enclosing_call(&before[..start]).map(|name| self.arguments(&name)).unwrap_or_default();
        let globals = self.model.code().globals.keys().map(|n| n.replace('/', "."));
        let keywords =
            STATEMENTS.iter().map(|s| s.name).chain(KEYWORDS.iter().copied()).map(str::to_owned);
        found(
            start,
            word,
            arguments.into_iter().chain(globals).chain(self.builtins()).chain(keywords),
        )
    }

    /// Returns the addresses of choices and observations.
    fn addresses(&self) -> impl Iterator<Item = String> {
        let choices = self.trace.choices().into_iter().map(|(a, _, _)| a.to_string());
        choices.chain(self.trace.observed().into_iter().map(|o| o.address.to_string()))
    }

    /// Returns the built-ins that are called by name.
    fn builtins(&self) -> impl Iterator<Item = String> {
        let all = self
            .model
            .code()
            .builtins
            .iter()
            .filter(|b| b.name.starts_with(|c: char| c.is_ascii_alphabetic()));
        all.map(|b| b.full_name())
    }

    /// Returns the arguments of a function, distribution or kernel, as written in a call.
    fn arguments(&self, name: &str) -> Vec<String> {
        let code = self.model.code();
        let written = |n: &str| format!("{n} = ");
        let functions = code.blocks.iter().find_map(|b| match &b.kind {
            BlockKind::Function { name: n, params, .. } if **n == *name => Some(params),
            _ => None,
        });
        if let Some(params) = functions {
            return params.iter().map(|p| written(p)).collect();
        }
        if let Some(k) = self.model.kernels().iter().find(|k| *k.name.node == *name) {
            return k.params.iter().map(|(p, _)| written(p)).collect();
        }
        let builtin = code.builtins.iter().find(|b| b.full_name() == name);
        builtin.map(|b| b.args.iter().map(|a| written(&a.name)).collect()).unwrap_or_default()
    }
}

/// Returns the words that begin with `word`, sorted and without duplicates.
fn found(start: usize, word: &str, all: impl Iterator<Item = String>) -> Completion {
    let mut words: Vec<String> = all.filter(|w| w.starts_with(word)).collect();
    words.sort();
    words.dedup();
    Completion { start, words }
}

/// Returns where the text of an unclosed string begins.
fn open_string(before: &str) -> Option<usize> {
    let mut open = None;
    let mut chars = before.char_indices();
    while let Some((i, c)) = chars.next() {
        match c {
            '\\' if open.is_some() => {
                chars.next();
            }
            '"' => open = if open.is_some() { None } else { Some(i + 1) },
            _ => {}
        }
    }
    open
}

/// Returns the name of the call whose arguments are open at the end of a text.
fn enclosing_call(before: &str) -> Option<String> {
    let hidden: Vec<_> = classes(before)
        .into_iter()
        .filter(|(_, c)| matches!(c, Class::String | Class::Comment | Class::Address))
        .collect();
    let mut depth = 0;
    for (i, c) in before.char_indices().rev() {
        if hidden.iter().any(|(r, _)| r.contains(&i)) {
            continue;
        }
        match c {
            ')' | ']' | '}' => depth += 1,
            '(' if depth == 0 => {
                let head = before[..i].trim_end();
                let start = head
                    .rfind(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.'))
                    .map_or(0, |j| j + head[j..].chars().next().map_or(1, char::len_utf8));
                return Some(head[start..].to_owned()).filter(|n| !n.is_empty());
            }
            '(' | '[' | '{' => depth -= 1,
            ';' if depth == 0 => return None,
            _ => {}
        }
        if depth < 0 {
            // Inside an array or record among the arguments.
            depth = 0;
        }
    }
    None
}

/// Lists the files and subfolders in the folder of a path; files only with one of the
/// endings, if any are given. Hidden names are left out.
fn files(word: &str, endings: &[&str]) -> impl Iterator<Item = String> + use<> {
    let folder = word.rfind('/').map_or("", |i| &word[..=i]).to_owned();
    let endings: Vec<String> = endings.iter().map(|e| (*e).to_owned()).collect();
    let listed =
        std::fs::read_dir(if folder.is_empty() { Path::new(".") } else { Path::new(&folder) });
    listed.into_iter().flatten().flatten().filter_map(move |e| {
        let name = e.file_name().into_string().ok().filter(|n| !n.starts_with('.'))?;
        let is_folder = e.path().is_dir();
        let fits =
            is_folder || endings.is_empty() || endings.iter().any(|x| name.ends_with(x.as_str()));
        fits.then(|| format!("{folder}{name}{}", if is_folder { "/" } else { "" }))
    })
}
