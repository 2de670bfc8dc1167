//! The line editor: colours, completion, continuation lines, history.

use pcadlang_syntax::{Class, classes, is_incomplete};
use pcadlang_workbench::session::Session;
use rustyline::completion::{Completer, Pair};
use rustyline::config::{BellStyle, CompletionType, Config};
use rustyline::error::ReadlineError;
use rustyline::highlight::{CmdKind, Highlighter};
use rustyline::hint::Hinter;
use rustyline::history::FileHistory;
use rustyline::validate::{ValidationContext, ValidationResult, Validator};
use rustyline::{ColorMode, Context, Editor, Helper};
use std::borrow::Cow;
use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

/// The number of entries kept in the history.
const HISTORY: usize = 10_000;

/// A line editor for a session.
pub struct Lines {
    editor: Editor<Help, FileHistory>,
    history: Option<PathBuf>,
}

/// An entry of the user.
pub enum Typed {
    /// A complete entry, of one or more lines.
    Entry(String),
    /// Ctrl-C: the line is cleared.
    Cleared,
    /// Ctrl-D.
    End,
}

impl Lines {
    /// Makes an editor for a session.
    pub fn new(session: Rc<RefCell<Session>>, colors: bool) -> Result<Lines, ReadlineError> {
        let config = Config::builder()
            .max_history_size(HISTORY)?
            .history_ignore_dups(true)?
            .history_ignore_space(true)
            .auto_add_history(false)
            .completion_type(CompletionType::List)
            .bell_style(BellStyle::None)
            .color_mode(if colors { ColorMode::Enabled } else { ColorMode::Disabled })
            .build();
        let mut editor = Editor::with_config(config)?;
        editor.set_helper(Some(Help { session, colors }));
        let history = history_file();
        if let Some(path) = &history {
            // The file does not exist on first use.
            let _ = editor.load_history(path);
        }
        Ok(Lines { editor, history })
    }

    /// Asks a question, and returns whether the answer is yes.
    pub fn is_agreed(&mut self, question: &str) -> bool {
        let answer = self.editor.readline(&format!("{question} [y/N] "));
        answer.is_ok_and(|a| matches!(a.trim().to_lowercase().as_str(), "y" | "yes"))
    }

    /// Reads the next entry.
    pub fn next(&mut self, prompt: &str) -> Result<Typed, ReadlineError> {
        match self.editor.readline(prompt) {
            Ok(text) => {
                let _ = self.editor.add_history_entry(text.as_str());
                if let Some(path) = &self.history {
                    // A history that cannot be written is not an error.
                    let _ = path.parent().map(std::fs::create_dir_all);
                    let _ = self.editor.append_history(path);
                }
                Ok(Typed::Entry(text))
            }
            Err(ReadlineError::Interrupted) => Ok(Typed::Cleared),
            Err(ReadlineError::Eof) => Ok(Typed::End),
            Err(e) => Err(e),
        }
    }
}

/// Returns the history file, in the user's folder for the state of programs.
fn history_file() -> Option<PathBuf> {
    let set = |name| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let state = set("XDG_STATE_HOME").or_else(|| set("HOME").map(|h| h.join(".local/state")))?;
    Some(state.join("pcadlang/history"))
}

/// Completion, validation and colours while a line is typed.
struct Help {
    session: Rc<RefCell<Session>>,
    colors: bool,
}

impl Helper for Help {}

impl Hinter for Help {
    type Hint = String;
}

impl Completer for Help {
    type Candidate = Pair;

    fn complete(
        &self,
        line: &str,
        at: usize,
        _: &Context<'_>,
    ) -> Result<(usize, Vec<Pair>), ReadlineError> {
        let found = self.session.borrow().complete(line, at);
        let pair = |w: String| Pair { display: w.clone(), replacement: w };
        Ok((found.start, found.words.into_iter().map(pair).collect()))
    }
}

impl Validator for Help {
    fn validate(&self, context: &mut ValidationContext) -> Result<ValidationResult, ReadlineError> {
        Ok(match is_whole(context.input()) {
            true => ValidationResult::Valid(None),
            false => ValidationResult::Incomplete,
        })
    }
}

impl Highlighter for Help {
    fn highlight<'l>(&self, line: &'l str, _: usize) -> Cow<'l, str> {
        if self.colors { Cow::Owned(colored(line)) } else { Cow::Borrowed(line) }
    }

    fn highlight_prompt<'b, 's: 'b, 'p: 'b>(&'s self, prompt: &'p str, _: bool) -> Cow<'b, str> {
        if self.colors {
            Cow::Owned(format!("\x1b[1;34m{prompt}\x1b[0m"))
        } else {
            Cow::Borrowed(prompt)
        }
    }

    fn highlight_char(&self, _: &str, _: usize, _: CmdKind) -> bool {
        self.colors
    }
}

/// Colours a line.
fn colored(line: &str) -> String {
    let command = if line.starts_with(':') {
        line.find(char::is_whitespace).unwrap_or(line.len())
    } else {
        0
    };
    let (head, rest) = line.split_at(command);
    let mut out = if head.is_empty() { String::new() } else { format!("\x1b[1;35m{head}\x1b[0m") };
    let mut at = 0;
    for (range, class) in classes(rest) {
        let code = match class {
            Class::Keyword => "1;35",
            Class::Number => "36",
            Class::String => "32",
            Class::Address => "33",
            Class::Comment => "90",
            Class::Name => continue,
        };
        out += &format!("{}\x1b[{code}m{}\x1b[0m", &rest[at..range.start], &rest[range.clone()]);
        at = range.end;
    }
    out + &rest[at..]
}

/// Returns whether an entry is complete; a `:` command always is.
pub fn is_whole(text: &str) -> bool {
    text.trim_start().starts_with(':') || !is_incomplete(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_change_no_letter() {
        for line in
            [":flip @x[1] // é", "assume x ~ normal(0, 1) #tag;", "\"open", ":", "", "let é = /* c"]
        {
            let mut plain = String::new();
            for (i, part) in colored(line).split("\x1b[").enumerate() {
                plain += if i == 0 { part } else { part.split_once('m').unwrap().1 };
            }
            assert_eq!(plain, line);
        }
        assert!(
            colored("let x = 1").contains("\x1b[1;35mlet\x1b[0m")
                && colored(":flip @x").contains("\x1b[33m@x\x1b[0m")
        );
    }
}
