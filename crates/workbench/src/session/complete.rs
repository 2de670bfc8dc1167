//! Completion of the word at the cursor, depending on its context.

use super::command::COMMANDS;
use super::state::Session;
use crate::editor::words::{KINDS, enclosing_call, files, files_wanted, open_string, start_of};
use pcadlang_engine::lang::builtins::{Kind, Type};
use pcadlang_engine::lang::code::BlockKind;
use pcadlang_syntax::STATEMENTS;
use std::path::Path;

/// The candidates for a piece of a line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Completion {
    /// Where the piece that is replaced begins, in bytes.
    pub start: usize,
    /// The candidates, in order.
    pub words: Vec<String>,
}

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
            "save" | "save!" | "load" => found(start, word, files(Path::new(""), word, &[".pcad"])),
            "render" => found(start, word, globals().chain(files(Path::new(""), word, &[".png"]))),
            "plot" => found(start, word, self.quantity_names().into_iter()),
            "doc" | "help" if is_first => found(start, word, self.topics()),
            "why" if is_first => self.complete_choice(before, std::iter::empty()),
            "set" if is_first => self.complete_choice(before, params()),
            "flip" | "trace" => self.complete_choice(before, self.selections()),
            "infer" if !before.contains(['(', '{']) => {
                let kernels =
                    self.model.code().builtins.iter().filter(|b| matches!(b.kind, Kind::Plan(_)));
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
            return match files_wanted(&before[..start - 1]) {
                Some(endings) => {
                    let word = &before[start..];
                    found(start, word, files(Path::new(""), word, endings))
                }
                None => Completion::default(),
            };
        }
        let part_of_address = |c: char| c.is_alphanumeric() || "@_/[]#*\".-".contains(c);
        let start = start_of(before, part_of_address);
        if before[start..].contains('@') {
            let start = start + before[start..].rfind('@').unwrap_or(0);
            return found(start, &before[start..], self.addresses());
        }
        let part_of_name = |c: char| c.is_alphanumeric() || c == '_' || c == '.' || c == '$';
        let start = start_of(before, part_of_name);
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
        let keywords = pcadlang_syntax::keywords().map(str::to_owned);
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
