//! A session at a prompt: a program that grows line by line, one trace of it to inspect
//! and change, and inference from that trace, in the background too.
//!
//! A session does not depend on a terminal and prints nothing: [`Session::enter`] takes a
//! typed text and returns a [`Reply`] for a front end to show; `complete` and
//! [`pcadlang_syntax::classes`] support line editing. Invariants: an error leaves program
//! and trace unchanged; the same lines with the same seed give the same replies, except
//! for times.

mod background;
mod choices;
mod command;
mod complete;
mod draws;
mod edit;
mod files;
mod limbs;
mod look;
mod picture;
mod plot;
mod redefine;
mod reply;
mod run;
mod state;

pub use crate::failure::Failure;
pub use background::Status;
pub use choices::{ChoiceRow, Marks, Scores, short, to_json};
pub use command::{COMMANDS, Command};
pub use complete::Completion;
pub use files::{exported, exported_operand};
pub use limbs::Joints;
pub use picture::{
    Layer, ViewPicture, as_view, detected, observed_image, over, picture_operand, reduced, view,
};
pub use reply::{Reply, Request};
pub use state::Session;

impl Session {
    /// Runs an entry: directives, an expression, or a command such as `:trace`.
    ///
    /// # Errors
    /// If the entry has errors or was stopped; nothing has changed then.
    pub fn enter(&mut self, text: &str) -> Result<Reply, Failure> {
        self.clock += 1;
        self.dragged = None;
        let text = text.trim();
        let done = match text.strip_prefix(':') {
            Some(command) => self.command(command),
            None if text.is_empty() => Ok(Reply::default()),
            None if text.starts_with(['@', '$']) => self.show_trace(text),
            None if pcadlang_syntax::is_directive(text) => self.add(text),
            None => match (self.value_of(text), command::alias(text)) {
                (Ok(v), _) => Ok(Reply::text(choices::whole(&v) + "\n")),
                // A name of the program takes precedence over a command.
                (Err(_), Some(command)) => self.command(command),
                (Err(e), None) => Err(e),
            },
        };
        match done {
            Err(_) if self.limits.stop.is_asked() => Err(Failure::Interrupted),
            done => done,
        }
    }
}
