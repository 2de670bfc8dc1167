//! `pcadlang repl`: a session at a prompt, or a piped script.

mod edit;
mod editor;
mod pictures;

use super::args::{Graphics, Inputs, Job, Repl, Sampling};
use editor::{Lines, Typed, is_whole};
use pcadlang_engine::trace::Stop;
use pcadlang_report::number;
use pcadlang_runs::failure::{Failure, STOPPED, plain};
use pcadlang_runs::inputs;
use pcadlang_runs::reopening::reopened::Reopened;
use pcadlang_runs::term;
use pcadlang_runs::term::has_colors;
use pcadlang_workbench::session::{Reply, Request, Session, Status};
use std::cell::{Cell, RefCell};
use std::io::{BufRead, IsTerminal, Write};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// The prompt.
const PROMPT: &str = "pcad> ";
/// The prompt of continuation lines in a transcript.
const CONTINUED: &str = "    > ";

/// Runs a session until its input ends.
pub fn repl(a: &Repl) -> Result<(), Failure> {
    let interrupts = Arc::new(Interrupts::default());
    let (session, said) = open(a, Stop::when(Arc::clone(&interrupts.asked)))?;
    let is_live =
        std::io::stdin().is_terminal() && std::io::stdout().is_terminal() && !a.transcript;
    // If no handler can be set, the system's default stays.
    let heard = Arc::clone(&interrupts);
    let _ = ctrlc::set_handler(move || {
        heard.asked.store(true, Ordering::SeqCst);
        // A single operation, such as making an array of a billion numbers, cannot be
        // interrupted, so the third Ctrl-C exits.
        if heard.pressed.fetch_add(1, Ordering::SeqCst) >= 2 {
            std::process::exit(130);
        }
    });
    let shown = Rc::new(Cell::new(false));
    let session = Rc::new(RefCell::new(session));
    let mut front =
        Front { session, seed: a.seed, graphics: graphics(a), draft: None, shown, interrupts };
    print(&said.text);
    if is_live { front.prompt() } else { front.script(a.transcript) }
}

fn open(a: &Repl, stop: Stop) -> Result<(Session, Reply), Failure> {
    let Some(path) = &a.program else {
        return Session::new(a.seed, stop).map(|s| (s, Reply::default()));
    };
    if Path::new(path).join("run.json").is_file() {
        return Reopened::open(Path::new(path))?.session(a.seed, stop);
    }
    let job = job(a, path);
    let (program, _) = inputs::observe(inputs::program_of(&job, false)?, &job)?;
    Session::open(program, a.seed, stop)
}

/// Returns the equivalent arguments of `run`.
fn job(a: &Repl, path: &str) -> Job {
    let sampling = Sampling { seed: a.seed, chains: Some(1), ..Sampling::default() };
    Job {
        inputs: Inputs {
            program: path.to_owned(),
            sets: a.sets.clone(),
            camera: a.camera.clone(),
            edges: None,
            who: Default::default(),
            allowed: a.allowed.clone(),
            hint: Default::default(),
        },
        full_size: false,
        coco: Default::default(),
        observe: a.observe.clone(),
        observe_contours: None,
        keypoints: a.keypoints.clone(),
        features_from: None,
        sampling,
    }
}

fn graphics(a: &Repl) -> Graphics {
    let variable = |name: &str| std::env::var(name).ok();
    a.graphics
        .unwrap_or_else(|| pictures::graphics_from_env(variable, std::io::stdout().is_terminal()))
}

/// A session and how it is displayed.
struct Front {
    session: Rc<RefCell<Session>>,
    seed: u64,
    graphics: Graphics,
    /// An edited program with errors, from which the next `:edit` starts.
    draft: Option<String>,
    /// True if a progress line is shown on the terminal.
    shown: Rc<Cell<bool>>,
    interrupts: Arc<Interrupts>,
}

/// Ctrl-C presses since the last entry.
#[derive(Default)]
struct Interrupts {
    asked: Arc<AtomicBool>,
    /// The number of presses.
    pressed: AtomicU32,
}

impl Front {
    /// Reads entries from the terminal.
    fn prompt(&mut self) -> Result<(), Failure> {
        let wrong =
            |e: rustyline::error::ReadlineError| plain(format!("the terminal cannot be used: {e}"));
        let mut lines = Lines::new(Rc::clone(&self.session), has_colors()).map_err(wrong)?;
        let shown = Rc::clone(&self.shown);
        self.session.borrow_mut().set_watch(move |s| {
            error_text!("\r\x1b[K{}", progress(s));
            shown.set(true);
        });
        print_line!(
            "pcadlang {}: :help lists the commands, Tab completes, Ctrl-D leaves",
            env!("CARGO_PKG_VERSION")
        );
        let (mut told, mut warned) = (None, None);
        loop {
            let background = self.session.borrow().background();
            if let Some((number, true)) = background
                && told != Some(number)
            {
                print_line!("run {number} has finished; `:stop` keeps its state");
                told = Some(number);
            }
            let leaves = match lines.next(PROMPT).map_err(wrong)? {
                Typed::Entry(text) => match self.answered(&text, &mut lines) {
                    Ok(leaves) => leaves,
                    Err(Failure::Interrupted) => {
                        error_line!("{STOPPED}");
                        false
                    }
                    Err(failure) => {
                        term::fail(failure);
                        false
                    }
                },
                Typed::Cleared => false,
                Typed::End => true,
            };
            let background = self.session.borrow().background().map(|(number, _)| number);
            match background.filter(|_| leaves && warned != background) {
                Some(number) => {
                    print_line!(
                        "run {number} would be lost: `:stop` keeps its state; press Ctrl-D again to quit"
                    );
                    warned = background;
                }
                None if leaves => return Ok(()),
                None => {}
            }
        }
    }

    /// Reads entries as a script. A transcript echoes them, and shows errors in its
    /// output instead of stopping.
    fn script(&mut self, transcript: bool) -> Result<(), Failure> {
        let mut lines = std::io::stdin().lock().lines();
        while let Some(entry) = next_entry(&mut lines, transcript)? {
            let done = self.enter(&entry).and_then(|done| match done {
                Done::Asks { question, then } => {
                    let what = question.split(';').next().unwrap_or_default().to_owned();
                    Err(Failure::Plain(what, Some(format!("`{then}` overwrites it"))))
                }
                done => Ok(done == Done::Leaves),
            });
            match done {
                Ok(true) => return Ok(()),
                Ok(false) => {}
                Err(failure @ Failure::Plain(..)) if transcript => {
                    print(&(failure.with_hint() + "\n"));
                }
                Err(Failure::Program(e)) if transcript => print(&e.to_string()),
                Err(failure) => return Err(failure),
            }
        }
        Ok(())
    }

    /// Runs an entry, after asking the user to confirm if necessary. Returns whether the
    /// session ends.
    fn answered(&mut self, text: &str, lines: &mut Lines) -> Result<bool, Failure> {
        match self.enter(text)? {
            Done::Asks { question, then } => match lines.is_agreed(&question) {
                true => self.enter(&then).map(|done| done == Done::Leaves),
                false => {
                    print_line!("nothing was done");
                    Ok(false)
                }
            },
            done => Ok(done == Done::Leaves),
        }
    }

    /// Runs an entry and shows its result.
    fn enter(&mut self, text: &str) -> Result<Done, Failure> {
        self.interrupts.asked.store(false, Ordering::SeqCst);
        self.interrupts.pressed.store(0, Ordering::SeqCst);
        let done = self.session.borrow_mut().enter(text);
        if self.shown.take() {
            error_text!("\r\x1b[K");
        }
        let mut reply = done?;
        match reply.request.take() {
            None => {}
            Some(Request::Confirm { question, then }) => return Ok(Done::Asks { question, then }),
            Some(Request::Edit) => reply = self.edit()?,
            Some(Request::Open(folder)) => {
                let seed = self.seed;
                let stop = Stop::when(Arc::clone(&self.interrupts.asked));
                let (other, _) = Reopened::open(&folder)?.session(seed, stop)?;
                reply = self
                    .session
                    .borrow_mut()
                    .take_over(other, &format!(":load {}", folder.display()));
            }
        }
        if reply.clears && std::io::stdout().is_terminal() {
            print("\x1b[2J\x1b[H");
        }
        print(&reply.text);
        if let Some(picture) = &reply.picture {
            print(&pictures::shown(picture, self.graphics)?);
        }
        Ok(if reply.ends { Done::Leaves } else { Done::Goes })
    }

    /// Lets the user edit the program; a text with errors is kept for the next `:edit`.
    fn edit(&mut self) -> Result<Reply, Failure> {
        let text = self.draft.clone().unwrap_or_else(|| self.session.borrow().text().to_owned());
        let edited = edit::edited(&text)?;
        let replaced = self.session.borrow_mut().replace(&edited);
        self.draft = replaced.is_err().then_some(edited);
        // Errors in the text have their own messages; any other error gets the hint.
        replaced.map_err(|t| t.hint("`:edit` goes on with the text as you left it"))
    }
}

/// The result of an entry.
#[derive(PartialEq, Eq)]
enum Done {
    Goes,
    Leaves,
    /// A question to the user, and the entry to run if the answer is yes.
    Asks {
        question: String,
        then: String,
    },
}

/// Reads the next entry of a script: a line and its continuation lines.
fn next_entry(
    lines: &mut impl Iterator<Item = std::io::Result<String>>,
    transcript: bool,
) -> Result<Option<String>, Failure> {
    let mut entry: Option<String> = None;
    for line in lines {
        let line = line.map_err(|e| plain(format!("the input cannot be read: {e}")))?;
        if transcript {
            let prompt = if entry.is_none() { PROMPT } else { CONTINUED };
            print_line!("{}", format!("{prompt}{line}").trim_end());
        }
        let text = entry.map_or_else(|| line.clone(), |e| format!("{e}\n{line}"));
        if is_whole(&text) {
            return Ok(Some(text));
        }
        entry = Some(text);
    }
    Ok(entry)
}

/// Prints a text and flushes the output.
fn print(text: &str) {
    print_text!("{text}");
    let _ = std::io::stdout().flush();
}

/// Formats the progress line.
fn progress(s: &Status) -> String {
    let best = s.best.map_or(String::new(), |b| format!(", best log joint {}", number(b)));
    format!("{}{best}, {} s; Ctrl-C ends it and keeps its draws", s.part(), s.elapsed.as_secs())
}
