//! The state of a session: program, model and trace, and the states for `:undo`.

use super::background::{Background, Finished, Status};
use super::limbs::Grab;
use super::reply::Reply;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::code::{Eager, Observed};
use pcadlang_engine::lang::reach::path_within;
use pcadlang_engine::trace::{Address, Constraint, Draws, Limits, Stop, Trace};
use pcadlang_library::model::{Model, Program};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The name of a typed text in messages.
pub(super) const INPUT: &str = "<input>";
/// The name of a program without a file in messages.
const NAME: &str = "<session>";
/// How often choices are drawn if the log density is undefined or the probability zero.
const ATTEMPTS: u64 = 20;
/// The limit on the trace's nodes, about a gigabyte, so that a slip of the pen does not
/// use up the machine's memory.
const NODES: u32 = 4_000_000;
/// The maximum number of choices remembered for `:undo`, over all steps.
const REMEMBERED: usize = 4_000_000;

/// A callback that is shown the progress of inference.
type Watcher = Box<dyn FnMut(&Status)>;

/// A session.
pub struct Session {
    pub(super) seed: u64,
    pub(super) limits: Limits,
    pub(super) program: Arc<Program>,
    pub(super) model: Arc<Model>,
    pub(super) trace: Trace,
    pub(super) past: VecDeque<UndoState>,
    /// States that `:redo` can restore, the most recently undone one at the end.
    pub(super) undone: Vec<UndoState>,
    /// Files that this session wrote or loaded, which it may overwrite without a
    /// question.
    pub(super) own_files: BTreeSet<String>,
    /// The number of entries so far, which keys the random streams.
    pub(super) clock: u64,
    /// The number of inference chains so far.
    pub(super) chains: u32,
    pub(super) background: Option<Background>,
    pub(super) last: Option<Finished>,
    pub(super) watch: Option<Watcher>,
    /// The address that [`Session::assign`] changed last, if the next change of it joins
    /// that one.
    pub(super) dragged: Option<Address>,
    /// The joint that [`Session::pull`] pulled last.
    pub(super) grab: Option<Grab>,
    /// The folder below which entries may use files, if not everywhere.
    confined: Option<PathBuf>,
}

/// A state for `:undo`. Its choices are enough to rebuild the trace, to the last bit.
pub(super) struct UndoState {
    program: Arc<Program>,
    model: Arc<Model>,
    choices: Vec<(u64, Constraint)>,
    observed: Arc<Observed>,
    /// The change that followed it.
    what: String,
}

impl Session {
    /// Opens a session with an empty program.
    ///
    /// # Errors
    /// None are known.
    pub fn new(seed: u64, stop: Stop) -> Result<Session, Failure> {
        Session::open(Program::named(NAME, "")?, seed, stop).map(|(s, _)| s)
    }

    /// Opens a session with a program and its data, and returns it with notes for the
    /// user. `stop` ends evaluations from outside; its owner must reset it before the
    /// next [`Session::enter`].
    ///
    /// # Errors
    /// If the program has errors. Missing data are not an error: the session is then one
    /// of the prior.
    pub fn open(program: Program, seed: u64, stop: Stop) -> Result<(Session, Reply), Failure> {
        let limits = Limits { nodes: NODES, stop: stop.after(Duration::ZERO), ..Limits::default() };
        let missing = program.missing_data();
        let (program, note) = match &missing[..] {
            [] => (program.eager(Eager::Names), None),
            names => {
                let names = names.join("`, `");
                let note = format!(
                    "note: `{names}` is not given, so nothing is observed: this is the prior\n"
                );
                (program.without_data().eager(Eager::NamesOnly), Some(note))
            }
        };
        let program = Arc::new(program);
        let model = Arc::new((*program).clone().compile()?);
        let trace = Trace::prior(Arc::clone(model.code()), limits.clone());
        let mut session = Session {
            seed,
            limits,
            program,
            model,
            trace,
            past: VecDeque::new(),
            undone: Vec::new(),
            own_files: BTreeSet::new(),
            clock: 0,
            chains: 0,
            background: None,
            last: None,
            watch: None,
            dragged: None,
            grab: None,
            confined: None,
        };
        let model = Arc::clone(&session.model);
        let (mut trace, said) = session.restart(&model, &[], &Arc::default())?;
        session.force(&model, &mut trace, 0)?;
        session.trace = trace;
        Ok((session, Reply::text(note.unwrap_or_default() + &said)))
    }

    /// Sets a callback that is shown the progress of inference, several times a second,
    /// while the session waits for it.
    pub fn set_watch(&mut self, watch: impl FnMut(&Status) + 'static) {
        self.watch = Some(Box::new(watch));
    }

    /// From now on, entries read and write only files below a folder, to which their paths
    /// are relative.
    pub fn confine(&mut self, folder: &Path) {
        self.confined = Some(folder.to_owned());
    }

    /// Checks a file that an entry names.
    pub(super) fn permit(&self, path: &str) -> Result<(), Failure> {
        let Some(folder) = &self.confined else { return Ok(()) };
        path_within(folder, path).map(|_| ()).map_err(|_| {
            let failure = plain(format!("{path}: not a file of this folder"));
            failure.hint("only files below the current folder can be used here")
        })
    }

    /// Returns the text of the program.
    pub fn text(&self) -> &str {
        self.program.text()
    }

    /// Returns the trace.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Returns the program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Returns the compiled program.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Returns a number that grows with every entry and change.
    pub fn revision(&self) -> u64 {
        self.clock
    }

    /// Returns what `:undo` would undo, and what `:redo` would redo.
    pub fn history(&self) -> [Option<&str>; 2] {
        [self.past.back(), self.undone.last()].map(|s| s.map(|s| s.what.as_str()))
    }

    /// Returns the random stream for values that are only inspected.
    pub(super) fn looks(&self) -> Draws {
        Draws {
            key: StreamKey::new(self.seed, u32::MAX, Purpose::PREDICT),
            step: self.clock,
            substream: 0,
        }
    }

    /// Makes a trace of a model with choices and observed values taken over as far as the
    /// model has them, and returns it with notes for the user. Other choices are drawn,
    /// several times if the log density is undefined or the probability zero.
    pub(super) fn restart(
        &self,
        model: &Model,
        kept: &[(u64, Constraint)],
        observed: &Arc<Observed>,
    ) -> Result<(Trace, String), Failure> {
        let code = match observed.is_empty() {
            true => Arc::clone(model.code()),
            false => Arc::new(model.code().with_observed(Arc::clone(observed))),
        };
        let key = StreamKey::new(self.seed, 0, Purpose::START);
        let (mut impossible, mut failure) = (None, None);
        for (kept, note) in [
            (kept, ""),
            (
                &[][..],
                "note: the log density is undefined for the current choices, so all were redrawn from the prior\n",
            ),
        ] {
            for substream in 0..ATTEMPTS {
                let draws = Draws { key, step: self.clock, substream };
                match Trace::generate(
                    Arc::clone(&code),
                    kept.iter().cloned(),
                    draws,
                    self.limits.clone(),
                ) {
                    Ok((t, _)) if t.log_joint() > f64::NEG_INFINITY => {
                        return Ok((t, note.to_owned()));
                    }
                    Ok((t, _)) => {
                        let nothing_new = t.choice_count() <= kept.len();
                        impossible.get_or_insert(t);
                        if nothing_new {
                            break;
                        }
                    }
                    Err(e) if e.is_recoverable() => failure = Some(e),
                    Err(e) => return Err(Failure::run(model, *e)),
                }
            }
            if let Some(t) = impossible {
                let note = note.to_owned() + &zero_probability(&t);
                return Ok((t, note));
            }
            if kept.is_empty() {
                break;
            }
        }
        match failure {
            Some(e) => Err(Failure::run(model, *e)),
            None => Err(plain("the log density is undefined")),
        }
    }

    /// Applies the `force` statements of a model after the first `known`.
    pub(super) fn force(
        &self,
        model: &Model,
        trace: &mut Trace,
        known: usize,
    ) -> Result<(), Failure> {
        let draws = Draws {
            key: StreamKey::new(self.seed, 0, Purpose::START),
            step: self.clock,
            substream: ATTEMPTS,
        };
        pcadlang_inference::force(model.code(), known, trace, draws)
            .map_err(|e| Failure::run(model, *e))
    }

    /// Records the present state for `:undo`; `what` describes the change that follows.
    pub(super) fn remember(&self, what: &str) -> UndoState {
        UndoState {
            program: Arc::clone(&self.program),
            model: Arc::clone(&self.model),
            choices: self.trace.constraints(),
            observed: Arc::clone(self.trace.replacements()),
            what: what.to_owned(),
        }
    }

    /// Adds a state for `:undo`; undone changes can no longer be redone.
    pub(super) fn keep(&mut self, past: UndoState) {
        self.undone.clear();
        self.push(past);
    }

    /// Adds a state for `:undo`, and drops the oldest ones beyond the limit.
    fn push(&mut self, past: UndoState) {
        self.past.push_back(past);
        let size = |p: &UndoState| p.choices.len() + 100;
        let mut all: usize = self.past.iter().map(size).sum();
        while all > REMEMBERED && self.past.len() > 1 {
            all -= self.past.pop_front().as_ref().map_or(0, size);
        }
    }

    /// Restores a recorded state.
    pub(super) fn go_back(&mut self, past: &UndoState) -> Result<(), Failure> {
        let (trace, _) = self.restart(&past.model, &past.choices, &past.observed)?;
        (self.program, self.model) = (Arc::clone(&past.program), Arc::clone(&past.model));
        self.trace = trace;
        Ok(())
    }

    /// `:undo`.
    pub(super) fn undo(&mut self) -> Result<Reply, Failure> {
        let Some(past) = self.past.pop_back() else {
            return Err(plain("there is nothing to undo"));
        };
        match self.exchange(&past) {
            Ok(now) => self.undone.push(now),
            Err(e) => {
                self.past.push_back(past);
                return Err(e);
            }
        }
        Ok(Reply::text(format!("undone: {}\n{}", past.what, self.summary())))
    }

    /// `:redo`.
    pub(super) fn redo(&mut self) -> Result<Reply, Failure> {
        let Some(next) = self.undone.pop() else {
            return Err(plain("there is nothing to redo"));
        };
        match self.exchange(&next) {
            Ok(now) => self.push(now),
            Err(e) => {
                self.undone.push(next);
                return Err(e);
            }
        }
        Ok(Reply::text(format!("redone: {}\n{}", next.what, self.summary())))
    }

    /// Switches to a recorded state, and returns the present one for the opposite step.
    fn exchange(&mut self, other: &UndoState) -> Result<UndoState, Failure> {
        let now = self.remember(&other.what);
        self.go_back(other)?;
        Ok(now)
    }

    /// Continues with the program and state of another session; `:undo` goes back.
    pub fn take_over(&mut self, other: Session, what: &str) -> Reply {
        let past = self.remember(what);
        (self.program, self.model, self.trace) = (other.program, other.model, other.trace);
        self.trace.set_limits(self.limits.clone());
        self.grab = None;
        self.keep(past);
        Reply::text(self.summary())
    }

    /// Formats the log joint density in one line.
    pub(super) fn summary(&self) -> String {
        format!("log joint {}\n", pcadlang_report::number(self.trace.log_joint()))
    }
}

/// Describes a state of probability zero.
fn zero_probability(t: &Trace) -> String {
    let found = t.impossible();
    let names: Vec<String> = found.iter().take(5).map(|(a, _)| a.to_string()).collect();
    let more =
        if found.len() > 5 { format!(" and {} more", found.len() - 5) } else { String::new() };
    format!(
        "note: this state has probability zero, by {}{more}; `:draw` draws another one\n",
        names.join(", ")
    )
}
