//! The commands, which begin with a colon.

use super::reply::{Reply, Request};
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::builtins::search::search;
use pcadlang_engine::lang::builtins::{Builtin, Table, doc};
use pcadlang_syntax::diag::nearest;

/// A command, as listed by `:help`.
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// The name, without the colon.
    pub name: &'static str,
    /// Its arguments; optional ones are in brackets.
    pub takes: &'static str,
    /// A one-line description.
    pub doc: &'static str,
}

const fn command(name: &'static str, takes: &'static str, doc: &'static str) -> Command {
    Command { name, takes, doc }
}

/// All commands, in the order of `:help`.
pub const COMMANDS: &[Command] = &[
    command("trace", "[SEL]", "List choices with values and log densities: all, or a selection"),
    command("why", "NAME", "Show what a choice depends on, and what depends on it"),
    command(
        "flip",
        "SEL",
        "Propose a new value from the prior; show what changes and whether it is accepted",
    ),
    command("set", "NAME VALUE", "Change the value of a param, choice or observation"),
    command("draw", "", "Draw a new state from the prior"),
    command("undo", "", "Undo the last change"),
    command("redo", "", "Redo what was undone last"),
    command(
        "infer",
        "[PLAN] [N] [&]",
        "Run inference: the program's plan, a named one, `{ … }` or a kernel; & runs it in the background",
    ),
    command("status", "", "Show the background run, or the last run"),
    command("wait", "", "Wait for the background run"),
    command("stop", "", "Stop the background run and keep its state"),
    command("drop", "", "Stop the background run and discard it"),
    command("plot", "NAME", "Histogram and trace plot of a quantity of the last run"),
    command("profile", "", "Time and acceptance rates of the last run, by kernel and choice"),
    command(
        "render",
        "[NAME] [FILE]",
        "Show a picture of the scene, a view or a solid, or write it to FILE",
    ),
    command("list", "", "Show the program"),
    command("edit", "", "Edit the program in your editor ($VISUAL or $EDITOR)"),
    command(
        "save",
        "NAME",
        "Write the program to NAME.pcad and the trace to NAME.trace.json; asks before it overwrites",
    ),
    command("save!", "NAME", "The same without asking"),
    command(
        "load",
        "NAME",
        "Load a program, and its trace if there is one, or the folder of a run",
    ),
    command("doc", "[NAME]", "Explain a statement, built-in, kernel or command"),
    command("clear", "", "Clear the screen"),
    command("help", "[NAME]", "This list (also ? or help); with a name the same as :doc"),
    command("quit", "", "Quit (also exit, Ctrl-D)"),
];

/// Returns the command that is meant by a word that people type without the colon.
pub(super) fn alias(word: &str) -> Option<&'static str> {
    match word {
        "help" | "?" => Some("help"),
        "exit" | "quit" | "q" => Some("quit"),
        "clear" => Some("clear"),
        _ => None,
    }
}

impl Session {
    /// Runs a command, given without its colon.
    pub(super) fn command(&mut self, text: &str) -> Result<Reply, Failure> {
        let (name, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let rest = rest.trim();
        if let Some(c) = COMMANDS.iter().find(|c| c.name == name) {
            if c.takes.is_empty() && !rest.is_empty() {
                return Err(plain(format!("`:{name}` takes no arguments, got `{rest}`")));
            }
            if !c.takes.is_empty() && !c.takes.starts_with('[') && rest.is_empty() {
                return Err(plain(format!("`:{name}` needs {}", c.takes)).hint(c.doc));
            }
        }
        match name {
            "trace" => self.show_trace(rest),
            "why" => self.why(rest),
            "flip" => self.flip(rest),
            "set" => self.set(rest),
            "draw" => self.draw(),
            "undo" => self.undo(),
            "redo" => self.redo(),
            "infer" => self.infer(rest),
            "status" => Ok(self.status()),
            "wait" => self.wait(),
            "stop" => self.stop(),
            "drop" => self.drop_background(),
            "plot" => self.plot(rest),
            "profile" => self.profile(),
            "render" => self.render(rest),
            "list" => Ok(self.list()),
            "edit" => Ok(Reply::request(Request::Edit)),
            "save" => self.save(rest, false),
            "save!" => self.save(rest, true),
            "load" => self.load(rest),
            "doc" => self.doc(rest),
            "help" | "h" | "?" if rest.is_empty() => Ok(Reply::text(help())),
            "help" | "h" | "?" => self.doc(rest),
            "clear" => Ok(Reply { clears: true, ..Reply::default() }),
            "quit" | "q" | "exit" => Ok(Reply { ends: true, ..Reply::default() }),
            _ => {
                let near = nearest(name, COMMANDS.iter().map(|c| c.name));
                let hint = near.map_or("`:help` lists the commands".to_owned(), |n| {
                    format!("did you mean `:{n}`?")
                });
                Err(plain(format!("there is no command `:{name}`")).hint(hint))
            }
        }
    }

    /// Shows the program with the line numbers that messages use.
    fn list(&self) -> Reply {
        let lines: Vec<&str> = self.text().lines().collect();
        let width = lines.len().to_string().len();
        let numbered = lines.iter().enumerate().map(|(i, l)| format!("{:width$}  {l}\n", i + 1));
        Reply::text(numbered.collect::<String>())
    }

    fn doc(&self, name: &str) -> Result<Reply, Failure> {
        if name.is_empty() {
            return Ok(Reply::text(
                "`:doc NAME` explains `observe`, `normal` or `:flip`; Tab completes names\n",
            ));
        }
        let command = |c: &Command| format!(":{} {}\n\n{}.\n", c.name, c.takes, c.doc);
        let named = |n: &str| COMMANDS.iter().find(|c| c.name == n).map(command);
        if let Some(text) = name.strip_prefix(':').and_then(named) {
            return Ok(Reply::text(text));
        }
        let table = &self.model.code().builtins;
        let entries: Vec<String> = doc::doc(table, name).into_iter().chain(named(name)).collect();
        if !entries.is_empty() {
            return Ok(Reply::text(entries.join("\n")));
        }
        if let Some(text) = about(table, name) {
            return Ok(Reply::text(text));
        }
        let names: Vec<String> = self.topics().collect();
        let failure = plain(format!("there is no statement, built-in or command `{name}`"));
        Err(match nearest(name, names.iter().map(String::as_str)) {
            Some(n) => failure.hint(format!("did you mean `{n}`?")),
            None => failure.hint("`:help` lists the commands, `pcadlang doc` all built-ins"),
        })
    }
}

/// How many built-ins are listed for a subject.
const FOUND: usize = 8;

/// Lists the built-ins on a subject, such as `kernels` or `logistic`, if all words match.
fn about(table: &Table, words: &str) -> Option<String> {
    let found = search(table, words);
    if found.entries.is_empty() || !found.instead.is_empty() || !found.unknown.is_empty() {
        return None;
    }
    let line = |b: &&Builtin| format!("{}\n    {}\n", b.signature(), b.doc);
    let more = match found.entries.len() {
        n if n > FOUND => format!("… and {} more: pcadlang doc --search {words}\n", n - FOUND),
        _ => String::new(),
    };
    Some(found.entries.iter().take(FOUND).map(line).collect::<String>() + &more)
}

/// Formats the text of `:help`.
fn help() -> String {
    let head = |c: &Command| format!(":{} {}", c.name, c.takes).trim_end().to_owned();
    let width = COMMANDS.iter().map(|c| head(c).chars().count()).max().unwrap_or(0);
    let line = |c: &Command| format!("  {:width$}  {}\n", head(c), c.doc);
    let intro = "Statements are as in a file; an expression shows its value; @a or $tag shows choices.\n\
        A name that is bound again is replaced; `forget NAME` takes it out.\n";
    intro.to_owned() + &COMMANDS.iter().map(line).collect::<String>()
}
