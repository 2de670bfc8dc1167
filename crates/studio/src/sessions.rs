//! The open sessions: each has a thread of its own, on which everything that is asked of it
//! is done in turn.

use super::folder::is_picture;
use super::protocol::HintJson;
use super::results::finite;
use pcadlang_engine::lang::reach::path_within;
use pcadlang_engine::lang::value::Value as Image;
use pcadlang_engine::trace::Stop;
use pcadlang_library::Program;
use pcadlang_library::scene::ImageValue;
use pcadlang_runs::args::{Inputs, Job, Sampling};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::hint::HintArgs;
use pcadlang_runs::reopening::reopened::Reopened;
use pcadlang_runs::{inputs, quality};
use pcadlang_workbench::session::{Session, observed_image};
use pcadlang_workbench::tradeoff::Quality;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum open sessions.
const MOST: usize = 64;

/// Something to do with a session.
type Work = Box<dyn FnOnce(&mut OpenSession) + Send>;

/// The image that a session observes.
type Shown = Arc<Mutex<Option<Image>>>;

/// The open sessions.
#[derive(Default)]
pub struct Sessions {
    all: Mutex<BTreeMap<u64, Arc<Handle>>>,
    opened: AtomicU64,
}

/// A session, from outside its thread.
pub struct Handle {
    /// Its number.
    pub id: u64,
    /// Set to stop what it is doing.
    stop: Arc<AtomicBool>,
    work: Sender<Work>,
    /// Its photograph, to look at while it is busy.
    photo: Shown,
}

/// A session, on its thread.
pub struct OpenSession {
    /// The session.
    pub session: Session,
    /// The command line that gives its program and data.
    pub job: Job,
    /// The message at its opening.
    pub note: String,
    /// The revision at which its state was drawn from the prior; none at a state of a run.
    drawn: Option<u64>,
}

/// Makes the job of a program that observes some files.
pub fn job_of(program: &str, sets: &BTreeMap<String, String>, observe: &[String]) -> Job {
    let inputs = Inputs {
        program: program.to_owned(),
        sets: sets.iter().map(|(k, v)| (k.clone(), v.clone())).collect(),
        camera: None,
        edges: None,
        who: Default::default(),
        allowed: Default::default(),
        hint: Default::default(),
    };
    let sampling = Sampling { seed: 1, ..Sampling::default() };
    Job { observe: observe.to_vec(), ..Job::of(inputs, sampling) }
}

impl Sessions {
    /// Opens a session for a job, or with the best state of a run.
    pub fn open(&self, job: Job, run: Option<Reopened>) -> Result<Arc<Handle>, Failure> {
        if self.ids().len() >= MOST {
            let problem = plain(format!("{MOST} sessions are open"));
            return Err(problem.hint("close one of them first"));
        }
        let id = self.opened.fetch_add(1, Ordering::SeqCst) + 1;
        let stop = Arc::new(AtomicBool::new(false));
        let (work, todo) = channel::<Work>();
        let (told, opened) = channel();
        let asked = Arc::clone(&stop);
        let photo = Shown::default();
        let shown = Arc::clone(&photo);
        let thread = std::thread::Builder::new().name(format!("session {id}"));
        let begun = thread.spawn(move || {
            // A session is not sent between threads, so it is opened on its own.
            let open = catch_unwind(AssertUnwindSafe(|| OpenSession::open(job, run, asked)));
            let mut open = match open {
                Ok(Ok(open)) => open,
                Ok(Err(problem)) => return told.send(Err(problem)).unwrap_or_default(),
                Err(_) => return told.send(Err(internal())).unwrap_or_default(),
            };
            open.show(&shown);
            let _ = told.send(Ok(()));
            for work in todo {
                work(&mut open);
            }
        });
        begun.map_err(|e| plain(format!("no thread can be started: {e}")))?;
        opened.recv().unwrap_or_else(|_| Err(internal()))?;
        let handle = Arc::new(Handle { id, stop, work, photo });
        // Not locked while the program is compiled: the other sessions go on meanwhile.
        let mut all = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        all.insert(id, Arc::clone(&handle));
        Ok(handle)
    }

    /// Returns an open session.
    pub fn get(&self, id: u64) -> Result<Arc<Handle>, Failure> {
        let all = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        all.get(&id).cloned().ok_or_else(|| plain(format!("session {id} is not open")))
    }

    /// Closes a session, which ends when it is done with what it is doing.
    pub fn close(&self, id: u64) -> Result<(), Failure> {
        let handle = self.get(id)?;
        handle.interrupt();
        self.all.lock().unwrap_or_else(PoisonError::into_inner).remove(&id);
        Ok(())
    }

    /// Returns the numbers of the open sessions.
    pub fn ids(&self) -> Vec<u64> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner).keys().copied().collect()
    }
}

/// The message for a defect of the studio itself.
fn internal() -> Failure {
    plain("an internal error; the other sessions and the runs go on")
}

impl Handle {
    /// Does something with the session, after what was asked before, and waits for it.
    pub fn ask<T: Send + 'static>(
        &self,
        f: impl FnOnce(&mut OpenSession) -> Result<T, Failure> + Send + 'static,
    ) -> Result<T, Failure> {
        let (told, done) = channel();
        let (stop, shown) = (Arc::clone(&self.stop), Arc::clone(&self.photo));
        let work: Work = Box::new(move |open| {
            stop.store(false, Ordering::SeqCst);
            let done =
                catch_unwind(AssertUnwindSafe(|| f(open))).unwrap_or_else(|_| Err(internal()));
            open.show(&shown);
            let _ = told.send(done);
        });
        self.work.send(work).map_err(|_| plain("the session was closed"))?;
        done.recv().unwrap_or_else(|_| Err(plain("the session was closed")))
    }

    /// Returns the image that it observes, without waiting for what it is doing.
    pub fn photo(&self) -> Option<Image> {
        self.photo.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Stops what the session is doing.
    pub fn interrupt(&self) {
        self.stop.store(true, Ordering::SeqCst);
    }
}

impl OpenSession {
    fn open(job: Job, run: Option<Reopened>, stop: Arc<AtomicBool>) -> Result<Self, Failure> {
        let stop = Stop::when(stop);
        match run {
            Some(run) => OpenSession::of_run(&run, job.sampling.seed, stop),
            None => OpenSession::of(inputs::program_of(&job, true)?, job, stop),
        }
    }

    /// A session with the best state of a run.
    fn of_run(run: &Reopened, seed: u64, stop: Stop) -> Result<Self, Failure> {
        let (mut session, said) = run.session(seed, stop)?;
        session.confine(Path::new("."));
        Ok(OpenSession { session, job: run.job.clone(), note: said.text, drawn: None })
    }

    fn of(program: Program, job: Job, stop: Stop) -> Result<Self, Failure> {
        let (program, _) = inputs::observe(program, &job)?;
        let (mut session, said) = Session::open(program, job.sampling.seed, stop)?;
        session.confine(Path::new("."));
        let drawn = Some(session.revision());
        Ok(OpenSession { session, job, note: said.text, drawn })
    }

    /// Shows the image that it observes.
    fn show(&self, to: &Shown) {
        let mut shown = to.lock().unwrap_or_else(PoisonError::into_inner);
        *shown = observed_image(self.session.model().code());
    }

    /// Gives the program other data, without a hint, which was about the old photograph.
    /// `:undo` goes back to the program with the old data.
    pub fn observe(&mut self, observe: Vec<String>, stop: Stop) -> Result<(), Failure> {
        let text = self.session.text().to_owned();
        self.renew(observe, &text, "other data", stop)
    }

    /// Replaces the text of its program: shared choices keep their values, unless the new
    /// text takes other data. It observes `photo` if it takes one. `:undo` goes back.
    pub fn replace(
        &mut self,
        text: &str,
        photo: Option<String>,
        stop: Stop,
    ) -> Result<(), Failure> {
        let (before, after) = (self.session.program(), self.session.program().edited(text)?);
        let observe = suited(&after, &self.job.observe, photo.as_deref());
        let needs = |p: &Program| p.missing_data().is_empty();
        match observe == self.job.observe && needs(before) == needs(&after) {
            true => self.session.replace(text).map(|_| ()),
            false => self.renew(observe, text, ":edit", stop),
        }
    }

    /// Opens it again with other data and a text.
    fn renew(
        &mut self,
        observe: Vec<String>,
        text: &str,
        what: &str,
        stop: Stop,
    ) -> Result<(), Failure> {
        let mut job = Job { observe, ..self.job.clone() };
        job.inputs.hint = HintArgs::default();
        let read = inputs::program_of(&job, true)?;
        let program = match read.text() == text {
            true => read,
            false => read.edited(text)?,
        };
        let opened = OpenSession::of(program.clone(), job.clone(), stop);
        let opened = opened.map_err(|failure| match needed(program, &job, &failure) {
            Some(_) => plain(format!("{} cannot do without its photograph", job.inputs.program))
                .hint("choose another photograph, or the example, at the top of the page"),
            None => failure,
        })?;
        self.take_over(opened, what);
        Ok(())
    }

    /// Checks that a run has what it needs.
    pub fn check_data(&self) -> Result<(), Failure> {
        match &self.session.program().missing_data()[..] {
            [] => Ok(()),
            names => {
                let (program, names) = (&self.job.inputs.program, names.join("`, `"));
                let problem = plain(format!("{program} has nothing to fit: `{names}` is missing"));
                Err(problem.hint("choose a photograph, or the example, at the top of the page"))
            }
        }
    }

    /// Says where the object is in the photograph, in which nothing is detected anew.
    /// `:undo` goes back.
    pub fn hint(&mut self, hint: HintArgs, stop: Stop) -> Result<(), Failure> {
        let program = self.session.program().clone();
        let hinted = program.hint(hint.read()?);
        let program = hinted.map_err(|f| Failure::Plain(f.message, f.hint))?;
        let (session, said) = Session::open(program, self.job.sampling.seed, stop)?;
        self.session.take_over(session, "another hint");
        self.job.inputs.hint = hint;
        self.note = said.text;
        self.drawn = Some(self.session.revision());
        Ok(())
    }

    /// Goes on with a run. `:undo` goes back.
    pub fn load(&mut self, run: &Reopened, stop: Stop) -> Result<(), Failure> {
        let other = OpenSession::of_run(run, self.job.sampling.seed, stop)?;
        self.take_over(other, &format!(":load {}", run.folder().display()));
        Ok(())
    }

    fn take_over(&mut self, other: OpenSession, what: &str) {
        self.session.take_over(other.session, what);
        let is_drawn = other.drawn.is_some();
        (self.job, self.note) = (other.job, other.note);
        self.drawn = is_drawn.then(|| self.session.revision());
    }

    /// Writes the program to its file if it was changed, so that a run can read it. An
    /// edited shipped program becomes a file of the folder.
    pub fn write_program(&self, folder: &Path) -> Result<(), Failure> {
        let (name, text) = (&self.job.inputs.program, self.session.text());
        let there = Program::open_allowing(name, &self.job.inputs.allowed.allow_read);
        if there.is_ok_and(|p| p.text() == text) {
            return Ok(());
        }
        let path = path_within(folder, name).map_err(plain)?;
        pcadlang_runs::files::write(&path, text.as_bytes())
    }

    /// Describes the session, for the page.
    pub fn described(&mut self, id: u64) -> Value {
        let view = self.session.view();
        let s = &self.session;
        let interface = s.program().interface();
        let image = observed_image(s.model().code());
        let photo = image
            .as_ref()
            .and_then(|i| i.downcast::<ImageValue>()?.as_photo().map(|p| (p.width(), p.height())));
        let name = self.job.observe.iter().map(|o| inputs::file_of(o)).find(|f| is_picture(f));
        let data = data_of(s.program());
        let set = |name: &str| self.job.inputs.sets.iter().find(|(n, _)| n == name).map(|(_, v)| v);
        let params: Vec<Value> = interface
            .params
            .iter()
            .map(|p| json!({ "name": p.name, "value": set(&p.name).or(p.default.as_ref()), "about": p.help }))
            .collect();
        let [undo, redo] = s.history();
        json!({
            "session": id,
            "program": self.job.inputs.program,
            "text": s.text(),
            "note": self.note,
            "observe": self.job.observe,
            "hint": HintJson::of(&self.job.inputs.hint).ok(),
            "photo": photo.map(|(w, h)| json!({ "name": name, "width": w, "height": h })),
            "data": data,
            "params": params,
            "revision": s.revision(),
            "log_joint": finite(s.trace().log_joint()),
            "is_prior": self.drawn == Some(s.revision()),
            "undo": undo,
            "redo": redo,
            "has_view": view.is_some(),
            "plans": s.model().plan_names().collect::<Vec<_>>(),
            "presets": presets(&self.job),
            "background": s.background().map(|(number, done)| json!({ "number": number, "done": done })),
        })
    }
}

/// Describes the data of a program: which of them are given.
fn data_of(program: &Program) -> Vec<Value> {
    let missing = program.missing_data();
    let data = program.interface().data;
    data.iter()
        .map(|d| json!({ "name": d.name, "kind": d.ty, "given": !missing.contains(&d.name) }))
        .collect()
}

/// Returns the observations of which a program has the items, with a photograph for its
/// first image if that has none or another one.
pub fn suited(program: &Program, observe: &[String], photo: Option<&str>) -> Vec<String> {
    let data = program.interface().data;
    let image = data.iter().find(|d| d.ty.as_deref() == Some("image"));
    let image = image.zip(photo).map(|(d, photo)| (d.name.as_str(), photo));
    let of = |spec: &String| inputs::named(program, spec).ok();
    let is_kept = |spec: &&String| {
        of(spec).is_some_and(|(name, _)| {
            data.iter().any(|d| d.name == name) && image.is_none_or(|(i, _)| i != name)
        })
    };
    let kept = observe.iter().filter(is_kept).cloned();
    match image {
        // The same observation may have been written without a name.
        Some((name, photo)) => {
            let old =
                observe.iter().find(|s| of(s).is_some_and(|o| o == (name.into(), photo.into())));
            let photo = old.cloned().unwrap_or_else(|| format!("{name}={photo}"));
            std::iter::once(photo).chain(kept).collect()
        }
        None => kept.collect(),
    }
}

/// Returns a program with its data, if some are missing and that is why it failed.
fn needed(program: Program, job: &Job, failure: &Failure) -> Option<Program> {
    let (program, _) = inputs::observe(program, job).ok()?;
    // A program that is evaluated without its data finds `nothing` in their place.
    let is_why = !program.missing_data().is_empty() && failure.to_string().contains("nothing");
    is_why.then_some(program)
}

/// Describes a program that has failed to open: as one that needs data if that is why.
pub fn without_data(program: Program, job: &Job, failure: Failure) -> Result<Value, Failure> {
    let Some(program) = needed(program, job, &failure) else { return Err(failure) };
    let (name, text) = (&job.inputs.program, program.text());
    Ok(json!({ "session": null, "program": name, "text": text, "data": data_of(&program) }))
}

/// Lists the presets that a run of a job can use.
fn presets(job: &Job) -> Vec<Value> {
    let Ok(Some((_, presets))) = quality::presets(&job.inputs.program) else { return Vec::new() };
    if !quality::fits(&presets, job.keypoints.is_some()) {
        return Vec::new();
    }
    let of = |q: Quality| {
        let preset = presets.of_quality(q)?.preset;
        let about = format!("{} s, error {} ({})", preset.seconds, preset.error, presets.error);
        Some(json!({ "name": q.name(), "about": about }))
    };
    Quality::ALL.into_iter().filter_map(of).collect()
}
