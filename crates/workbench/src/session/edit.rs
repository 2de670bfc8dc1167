//! Directives: they are added to the program, and the trace is rebuilt with the choices
//! that it had.

use super::choices::{short, whole};
use super::files::{exported, exported_operand};
use super::redefine::{
    Key, Space, forgotten, items, key, to_forget, users, with_item, without_item,
};
use super::reply::Reply;
use super::state::{INPUT, Session};
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::code::{BlockKind, Operand};
use pcadlang_engine::lang::load::reason;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Address, Trace};
use pcadlang_library::model::{Model, Program};
use pcadlang_report::write_file;
use pcadlang_syntax::ast::{ExprKind, Item, ItemKind, Stmt, StmtKind};
use pcadlang_syntax::diag::SourceMap;
use pcadlang_syntax::{parse, print_expr};
use std::path::Path;
use std::sync::Arc;

/// How many users of a replaced name are listed.
const MOST_USERS: usize = 8;

/// The parts of a typed text.
#[derive(Default)]
struct Entry {
    /// The part that is added to the program.
    kept: String,
    /// The same part, item by item, with the names that the items bind.
    items: Vec<(Option<Key>, String)>,
    /// Names whose values are shown afterwards.
    names: Vec<Arc<str>>,
    /// Expressions to evaluate: those of `sample` statements, and plain ones.
    samples: Vec<String>,
    /// Inference blocks to run, with their names.
    plans: Vec<(Option<Arc<str>>, String)>,
}

impl Session {
    /// Adds directives to the program, runs the inference blocks among them, and
    /// describes the results.
    pub(super) fn add(&mut self, text: &str) -> Result<Reply, Failure> {
        if let Some(name) = forgotten(text) {
            return self.forget(name);
        }
        let mut entry = read(text);
        let past = self.remember(&first_line(text));
        let before = self.trace.log_joint();
        let mut said = String::new();
        let known = (self.model.reports().len(), self.model.exports().len());
        let known_names = items(self.text());
        let is_known = |k: &Key| known_names.iter().any(|(n, _)| n.as_ref() == Some(k));
        let again: Vec<Key> =
            entry.items.iter().filter_map(|(k, _)| k.clone()).filter(|k| is_known(k)).collect();
        if !again.is_empty() {
            said += &self.redefine(&mut entry, &again)?;
            self.keep(past);
        } else if !entry.kept.is_empty() {
            let grown = grown(self.text(), &entry.kept);
            said += &self.rewrite(self.program.edited(&grown)?)?;
            self.keep(past);
        }
        if let Err(e) = self.follow(&entry, known, &mut said) {
            if !entry.kept.is_empty()
                && let Some(past) = self.past.pop_back()
            {
                self.go_back(&past)?;
            }
            return Err(e);
        }
        let after = self.trace.log_joint();
        if entry.plans.is_empty() && after.to_bits() != before.to_bits() {
            said += &self.summary();
        }
        Ok(Reply::text(said))
    }

    /// Adds items, some of which rebind names of the program. These items replace the old
    /// ones, in the text and for everything that uses them. Returns a description of the
    /// users; their values are shown, too.
    fn redefine(&mut self, entry: &mut Entry, again: &[Key]) -> Result<String, Failure> {
        let text = |moved: bool| {
            entry.items.iter().fold(self.text().to_owned(), |text, (name, item)| {
                let Some(name) = name.as_ref().filter(|k| again.contains(k)) else {
                    return grown(&text, item);
                };
                match moved {
                    false => with_item(&text, name, item),
                    true => without_item(&text, name).map(|text| grown(&text, item)),
                }
                .unwrap_or_else(|| grown(&text, item))
            })
        };
        let (in_place, moved) = (text(false), text(true));
        let impossible = self.trace.log_joint() == f64::NEG_INFINITY;
        // A new item that needs names bound after the old one is moved behind them.
        let (mut said, new) = match self.rewrite(self.program.edited(&in_place)?) {
            Ok(said) => (said, in_place),
            Err(first) => match self
                .program
                .edited(&moved)
                .map_err(Failure::from)
                .and_then(|p| self.rewrite(p))
            {
                Ok(said) => (said, moved),
                Err(_) => return Err(first),
            },
        };
        // The old value may be impossible under the new definition.
        if self.trace.log_joint() == f64::NEG_INFINITY && !impossible && self.redraw(again)? {
            said.clear();
        }
        for (_, name) in again {
            let users = users(&new, name);
            let shown: Vec<String> =
                users.iter().take(MOST_USERS).map(|(_, n)| format!("`{n}`")).collect();
            let more = if users.len() > MOST_USERS { ", …" } else { "" };
            said += &match shown.is_empty() {
                true => format!("`{name}` is replaced\n"),
                false => format!("`{name}` is replaced; used by {}{more}\n", shown.join(", ")),
            };
            let values = users
                .iter()
                .filter(|(space, _)| *space == Space::Value)
                .map(|(_, n)| Arc::clone(n));
            for n in values.take(MOST_USERS) {
                if !entry.names.contains(&n) {
                    entry.names.push(n);
                }
            }
        }
        let code = Arc::clone(self.model.code());
        let is_fn = |n: &Arc<str>| {
            code.blocks
                .iter()
                .any(|b| matches!(&b.kind, BlockKind::Function { name, .. } if name == n))
        };
        entry.names.retain(|n| !is_fn(n));
        Ok(said)
    }

    /// Resamples the choices below some names, if that gives a state of positive
    /// probability. Returns whether it did.
    fn redraw(&mut self, names: &[Key]) -> Result<bool, Failure> {
        let below = |a: &Address| {
            names.iter().any(|(_, n)| a.segments.first().is_some_and(|s| s.name == *n))
        };
        let gone: Vec<u64> = self
            .trace
            .choices()
            .iter()
            .filter(|(a, ..)| below(a))
            .map(|(a, ..)| a.hash64())
            .collect();
        let kept: Vec<_> =
            self.trace.constraints().into_iter().filter(|(h, _)| !gone.contains(h)).collect();
        let (trace, _) = self.restart(&self.model, &kept, self.trace.replacements())?;
        let is_possible = trace.log_joint() > f64::NEG_INFINITY;
        if is_possible {
            self.trace = trace;
        }
        Ok(is_possible)
    }

    /// `forget name`: removes an item from the program.
    fn forget(&mut self, name: &str) -> Result<Reply, Failure> {
        let key = to_forget(self.text(), name)?;
        let Some(text) = without_item(self.text(), &key) else {
            return Err(plain("there is no such item"));
        };
        let past = self.remember(&format!("forget {name}"));
        let said =
            match self.program.edited(&text).map_err(Failure::from).and_then(|p| self.rewrite(p)) {
                Ok(said) => said,
                Err(e) => {
                    let users = users(self.text(), name);
                    let Some((_, first)) = users.first().filter(|_| key.0 != Space::Label) else {
                        return Err(e);
                    };
                    let hint =
                        format!("forget `{first}` first, or bind `{name}` again to replace it");
                    return Err(plain(format!("`{first}` uses `{name}`")).hint(hint));
                }
            };
        self.keep(past);
        Ok(Reply::text(format!("{said}{}", self.summary())))
    }

    /// Replaces the text of the whole program, after editing.
    ///
    /// # Errors
    /// If the new text has errors; nothing has changed then.
    pub fn replace(&mut self, text: &str) -> Result<Reply, Failure> {
        if text == self.text() {
            return Ok(Reply::text("the program is unchanged\n"));
        }
        self.clock += 1;
        self.dragged = None;
        let past = self.remember(":edit");
        let said = self.rewrite(self.program.edited(text)?)?;
        self.keep(past);
        Ok(Reply::text(said + &self.summary()))
    }

    /// Switches to another version of the program, and keeps the choices that both share.
    /// Returns notes for the user.
    pub(super) fn rewrite(&mut self, program: Program) -> Result<String, Failure> {
        let model = program.clone().compile()?;
        let choices = self.trace.constraints();
        let (mut trace, said) = self.restart(&model, &choices, self.trace.replacements())?;
        let known = self.model.code().forces.len();
        self.force(&model, &mut trace, known)?;
        (self.program, self.model, self.trace) = (Arc::new(program), Arc::new(model), trace);
        Ok(said)
    }

    /// Shows the values, samples, reports and exports of an entry, and runs its plans,
    /// once the program has grown.
    fn follow(
        &mut self,
        entry: &Entry,
        known: (usize, usize),
        said: &mut String,
    ) -> Result<(), Failure> {
        for name in &entry.names {
            let draws = self.looks();
            if let Some(value) = self.trace.global(name, draws) {
                let value = value.map_err(|e| Failure::run(&self.model, *e))?;
                *said += &format!("{name} = {}\n", short(&value));
            }
        }
        for text in &entry.samples {
            *said += &format!("{}\n", whole(&self.value_of(text)?));
        }
        self.report(known.0, said)?;
        self.export(known.1, said)?;
        for (name, block) in &entry.plans {
            *said += &match name {
                Some(name) => self.infer(name)?.text,
                None => self.infer_block(block)?.text,
            };
        }
        Ok(())
    }

    /// Returns the value of an expression in the current state.
    pub(super) fn value_of(&mut self, text: &str) -> Result<Value, Failure> {
        let model = self.program.with_query(INPUT, text)?.compile()?;
        let mut trace = self.moved_to(&model, &self.trace)?;
        let Some(operand) = model.code().samples.last().copied() else {
            return Err(plain("this is not an expression"));
        };
        let values = trace.query(&[operand], self.looks()).map_err(|e| Failure::run(&model, *e))?;
        Ok(values.into_iter().next().unwrap_or_default())
    }

    /// Returns a trace of another model with the same choices and observed values.
    pub(super) fn moved_to(&self, model: &Model, from: &Trace) -> Result<Trace, Failure> {
        self.restart(model, &from.constraints(), from.replacements()).map(|(t, _)| t)
    }

    /// Sets a param. The default of a param in the main file is changed in the text.
    pub(super) fn set_param(&mut self, name: &str, value: &str) -> Result<Reply, Failure> {
        let (program, _) = parse(self.text(), SourceMap::new().add("", self.text()));
        let declared = program.items.iter().find_map(|i| match &i.kind {
            ItemKind::Param(d) if *d.name.node == *name => Some(d),
            _ => None,
        });
        // A value from the command line takes precedence over the default.
        let program = match declared.and_then(|d| d.default.as_ref()) {
            Some(e) if !self.program.is_set(name) => {
                let (before, after) = (
                    self.text().get(..e.span.start as usize),
                    self.text().get(e.span.end as usize..),
                );
                let text =
                    format!("{}{value}{}", before.unwrap_or_default(), after.unwrap_or_default());
                self.program.edited(&text)?
            }
            _ => (*self.program).clone().set(name, value),
        };
        let past = self.remember(&format!(":set {name} {value}"));
        let said = self.rewrite(program)?;
        self.keep(past);
        Ok(Reply::text(said + &self.summary()))
    }

    /// Returns whether a name is a param of the program.
    pub(super) fn is_param(&self, name: &str) -> bool {
        self.program.interface().params.iter().any(|p| p.name == name)
    }

    /// Shows the values of the reports after the first `known`.
    fn report(&mut self, known: usize, said: &mut String) -> Result<(), Failure> {
        let model = Arc::clone(&self.model);
        for e in model.reports().iter().skip(known).flat_map(|r| &r.exprs) {
            if let Some(operand) = model.code().queries.get(&e.span) {
                *said += &format!("{} = {}\n", print_expr(e), whole(&self.asked(*operand)?));
            }
        }
        Ok(())
    }

    /// Writes the files of the exports after the first `known`.
    fn export(&mut self, known: usize, said: &mut String) -> Result<(), Failure> {
        let model = Arc::clone(&self.model);
        for x in model.exports().iter().skip(known) {
            let Some(operand) = exported_operand(model.code(), x) else { continue };
            self.permit(&x.file)?;
            let bytes = exported(&self.asked(operand)?, &x.file).map_err(plain)?;
            write_file(Path::new(&*x.file), &bytes)
                .map_err(|e| plain(format!("cannot write {}: {}", x.file, reason(&e))))?;
            *said += &format!("{}\n", x.file);
        }
        Ok(())
    }

    /// Returns the value of a top-level operand.
    fn asked(&mut self, operand: Operand) -> Result<Value, Failure> {
        let draws = self.looks();
        let values =
            self.trace.query(&[operand], draws).map_err(|e| Failure::run(&self.model, *e))?;
        Ok(values.into_iter().next().unwrap_or_default())
    }
}

/// Sorts the items of a typed text. A text that does not parse is kept whole, so that the
/// compiler reports its errors.
fn read(text: &str) -> Entry {
    let text = closed(text);
    let (program, errors) = parse(&text, SourceMap::new().add(INPUT, &text));
    if !errors.is_empty() {
        return Entry { kept: text, ..Entry::default() };
    }
    let mut entry = Entry::default();
    for item in &program.items {
        let slice = text.get(item.span.start as usize..item.span.end as usize).unwrap_or_default();
        match &item.kind {
            ItemKind::Infer { name: None, .. } => entry.plans.push((None, slice.to_owned())),
            ItemKind::Stmt(s) if matches!(s.kind, StmtKind::Sample(_)) => {
                let e = slice.trim_start_matches("sample").trim_end_matches(';');
                entry.samples.push(e.trim().to_owned());
            }
            // A plain expression is evaluated, not added to the program.
            ItemKind::Stmt(Stmt { kind: StmtKind::Expr(e), .. })
                if !matches!(e.kind, ExprKind::Call { .. }) =>
            {
                entry.samples.push(slice.trim_end_matches(';').trim().to_owned());
            }
            kind => {
                if let ItemKind::Infer { name: Some(name), .. } = kind {
                    entry.plans.push((Some(Arc::clone(&name.node)), slice.to_owned()));
                }
                entry.names.extend(bound(item));
                entry.items.push((key(item), slice.to_owned()));
                entry.kept += slice;
                entry.kept += "\n";
            }
        }
    }
    // Comments and layout are kept if no item is taken out.
    if entry.samples.is_empty()
        && !entry.plans.iter().any(|(name, _)| name.is_none())
        && !entry.kept.is_empty()
    {
        entry.kept = text;
    }
    entry
}

/// Adds the semicolon that is often omitted at a prompt; on its own line if a comment
/// ends the text.
fn closed(text: &str) -> String {
    let parses = |text: &str| parse(text, SourceMap::new().add(INPUT, "")).1.is_empty();
    let ways = [text.to_owned(), format!("{text};"), format!("{text}\n;")];
    ways.into_iter().find(|t| parses(t)).unwrap_or_else(|| text.to_owned())
}

/// Returns the name that an item binds to a value worth showing: neither a function nor a
/// single element of a container.
fn bound(item: &Item) -> Option<Arc<str>> {
    let (space, name) = key(item).filter(|_| !matches!(item.kind, ItemKind::Fn(_)))?;
    (space == Space::Value && !name.contains('[')).then_some(name)
}

/// Appends to the text of a program.
fn grown(text: &str, more: &str) -> String {
    let gap = if text.is_empty() || text.ends_with('\n') { "" } else { "\n" };
    format!("{text}{gap}{}\n", more.trim_end())
}

/// Returns the first line of a typed text, shortened, for messages.
fn first_line(text: &str) -> String {
    let line = text.lines().next().unwrap_or("");
    if line.chars().count() > 60 || text.lines().nth(1).is_some() {
        line.chars().take(59).chain(['…']).collect()
    } else {
        line.to_owned()
    }
}
