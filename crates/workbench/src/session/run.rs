//! Inference from the current state, in the foreground, or in the background on a clone
//! of the trace.
//!
//! Each run is a chain with its own number, so that no stream of random numbers is used
//! twice. The last state of a run becomes the session's state when a foreground run ends
//! or a background run is stopped; `:undo` goes back.

use super::background::{Background, Finished};
use super::draws::SampledDraws;
use super::reply::Reply;
use super::state::{INPUT, Session};
use crate::bank::BankFiles;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::trace::{Limits, Stop};
use pcadlang_inference::{Progress, RunOptions, run_from};
use pcadlang_library::model::{Model, Program};
use pcadlang_numerics::platform::clock::Instant;
use pcadlang_report::{ChainDraws, number, seconds, table};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// The polling interval while waiting for a run.
const PAUSE: Duration = Duration::from_millis(100);
/// How often a kernel is applied that is given without a plan or a number of steps.
const TIMES: u64 = 1000;

/// A run to start.
struct Job {
    what: String,
    model: Arc<Model>,
    plan: Arc<Plan>,
    steps: Option<u64>,
    /// A note to show first.
    note: String,
}

impl Session {
    /// `:infer [plan] [N] [&]`.
    pub(super) fn infer(&mut self, text: &str) -> Result<Reply, Failure> {
        let (text, in_background) = match text.strip_suffix('&') {
            Some(rest) => (rest.trim(), true),
            None => (text, false),
        };
        let (plan, steps) = match text.rsplit_once(char::is_whitespace).unwrap_or(("", text)) {
            (plan, count) if count.bytes().all(|b| b.is_ascii_digit()) && !count.is_empty() => {
                let n = count.parse().map_err(|_| plain(format!("{count} steps are too many")))?;
                (plan.trim(), Some(n))
            }
            _ => (text, None),
        };
        let job = self.job(plan, steps)?;
        self.launch(job, in_background)
    }

    /// Runs a typed inference block.
    pub(super) fn infer_block(&mut self, block: &str) -> Result<Reply, Failure> {
        let job = self.typed(block, "infer { … }".to_owned(), None)?;
        self.launch(job, false)
    }

    fn job(&self, plan: &str, steps: Option<u64>) -> Result<Job, Failure> {
        let model = Arc::clone(&self.model);
        if plan.is_empty() {
            let (plan, default) = model.plan()?;
            let note = default.map_or(String::new(), |text| format!("the default plan:\n{text}"));
            let what = if note.is_empty() { "the program's plan" } else { "the default plan" };
            return Ok(Job { what: what.to_owned(), model, plan, steps, note });
        }
        if let Some(body) = model.plan_named(plan) {
            return Ok(Job {
                what: plan.to_owned(),
                model,
                plan: body,
                steps,
                note: String::new(),
            });
        }
        if plan.starts_with('{') {
            return self.typed(&format!("infer {plan}"), "infer { … }".to_owned(), steps);
        }
        let block = format!("infer {{\n{plan};\n}}");
        let mut job = self.typed(&block, plan.to_owned(), None)?;
        let times = format!("infer {{ repeat {} {{\n{plan};\n}} }}", steps.unwrap_or(TIMES));
        (job.plan, job.model) = self.compiled(&times)?;
        Ok(job)
    }

    /// Prepares the run of a block that is not part of the program.
    fn typed(&self, block: &str, what: String, steps: Option<u64>) -> Result<Job, Failure> {
        let (plan, model) = self.compiled(block)?;
        Ok(Job { what, model, plan, steps, note: String::new() })
    }

    fn compiled(&self, block: &str) -> Result<(Arc<Plan>, Arc<Model>), Failure> {
        let program: Program = self.program.and(INPUT, block)?;
        let model = program.compile()?;
        let plan = model.last_plan().ok_or_else(|| plain("this is not an inference block"))?;
        Ok((plan, Arc::new(model)))
    }

    fn launch(&mut self, job: Job, in_background: bool) -> Result<Reply, Failure> {
        if let Some(b) = &self.background {
            let failure = plain(format!("run {} is in the background", b.number));
            return Err(failure.hint("`:wait` for it, `:stop` it, or `:drop` it first"));
        }
        let note = job.note.clone();
        let run = self.begin(job)?;
        if in_background {
            let text = format!("{note}run {} in the background: {}\n", run.number, run.what);
            self.background = Some(run);
            return Ok(Reply::text(text));
        }
        let stop = self.limits.stop.clone();
        let stopped = !self.wait_for(&run, &stop, true)?;
        // The final state is adopted although a stop was requested: the request ended the
        // run, and must not end this.
        self.limits.stop = Stop::default();
        let adopted = self.adopt(run);
        self.limits.stop = stop;
        self.trace.set_limits(self.limits.clone());
        let ended =
            if stopped { "stopped early; its draws are kept, and `:undo` goes back\n" } else { "" };
        Ok(Reply::text(format!("{note}{}{ended}", adopted?)))
    }

    /// Starts a chain on a clone of the trace.
    fn begin(&mut self, job: Job) -> Result<Background, Failure> {
        let mut trace = match Arc::ptr_eq(&job.model, &self.model) {
            true => self.trace.clone(),
            false => self.moved_to(&job.model, &self.trace)?,
        };
        let limits = Limits { stop: Stop::default(), ..self.limits.clone() };
        trace.set_limits(limits.clone());
        self.chains += 1;
        let number = self.chains;
        let folder = Path::new(self.program.name()).parent().unwrap_or(Path::new("")).to_owned();
        let banks = BankFiles::new(&job.model, &folder, None);
        let options = RunOptions {
            seed: self.seed,
            steps: job.steps,
            banks: Some(Arc::new(banks)),
            sites: true,
            limits,
            ..RunOptions::default()
        };
        let (progress, kept) = (Arc::new(Progress::default()), SampledDraws::default());
        let (over, done) = channel();
        let is_done = Arc::new(AtomicBool::new(false));
        let thread = {
            let (code, plan) = (Arc::clone(job.model.code()), job.plan);
            let (progress, mut sink, ended) =
                (Arc::clone(&progress), kept.clone(), Arc::clone(&is_done));
            std::thread::Builder::new().name(format!("run {number}")).spawn(move || {
                let result = run_from(&code, &plan, &options, &progress, &mut sink, number, trace);
                ended.store(true, Ordering::SeqCst);
                // Nobody receives this if the run was dropped.
                let _ = over.send(());
                result
            })
        };
        let thread = thread.map_err(|e| plain(format!("no thread can be started: {e}")))?;
        let base = Arc::clone(&self.model);
        let (what, model, steps, began) = (job.what, job.model, job.steps, Instant::now());
        Ok(Background {
            what,
            number,
            base,
            model,
            progress,
            steps,
            kept,
            began,
            done,
            is_done,
            thread,
        })
    }

    /// Waits until a run is over. If `stop` is requested meanwhile, `ends` tells whether
    /// that ends the run (and the wait continues until it has) or the wait, with an
    /// error. Returns true if the run was not cancelled.
    fn wait_for(&mut self, run: &Background, stop: &Stop, ends: bool) -> Result<bool, Failure> {
        while run.done.recv_timeout(PAUSE) == Err(RecvTimeoutError::Timeout) {
            if stop.is_asked() {
                if !ends {
                    return Err(Failure::Interrupted);
                }
                run.progress.cancelled.store(true, Ordering::Relaxed);
            }
            if let Some(watch) = &mut self.watch {
                watch(&run.status());
            }
        }
        Ok(!run.progress.cancelled.load(Ordering::Relaxed))
    }

    /// Makes the last state of a finished run the state of the session.
    fn adopt(&mut self, run: Background) -> Result<String, Failure> {
        let joined = run.thread.join().map_err(|_| plain("the run ended unexpectedly"))?;
        let result = joined.map_err(|e| run.model.chain_error(e))?;
        let finished = Finished {
            what: run.what,
            steps: result.steps,
            warmup: result.warmup,
            counts: run.kept.counts(),
            kernels: result.kernels,
            sites: result.sites,
            seconds: result.seconds,
            draws: run.kept.draws(),
        };
        if !Arc::ptr_eq(&run.base, &self.model) {
            self.last = Some(finished);
            let failure =
                plain(format!("the program has changed since run {} started", run.number));
            return Err(
                failure.hint("its state cannot be used; `:plot` and `:profile` show what it did")
            );
        }
        let mut last = result.last;
        if !Arc::ptr_eq(&run.model, &self.model) {
            last = self.moved_to(&self.model, &last)?;
        }
        last.set_limits(self.limits.clone());
        let past = self.remember(&format!("inference by {}", finished.what));
        let before = std::mem::replace(&mut self.trace, last).log_joint();
        self.keep(past);
        let (line, means) = (finished.line(), finished.means());
        let said = format!(
            "{line}{means}log joint {} -> {}\n",
            number(before),
            number(self.trace.log_joint())
        );
        self.last = Some(finished);
        Ok(said)
    }

    /// `:status`.
    pub(super) fn status(&self) -> Reply {
        Reply::text(match (&self.background, &self.last) {
            (Some(run), _) => run.line(),
            (None, Some(last)) => {
                format!("nothing runs in the background; last was {}", last.line())
            }
            (None, None) => "nothing runs in the background, and nothing has run\n".to_owned(),
        })
    }

    /// `:wait`.
    pub(super) fn wait(&mut self) -> Result<Reply, Failure> {
        let run = self.taken()?;
        let waited = self.wait_for(&run, &self.limits.stop.clone(), false);
        let said = run.line();
        self.background = Some(run);
        waited.map(|_| Reply::text(said))
    }

    /// `:stop`.
    pub(super) fn stop(&mut self) -> Result<Reply, Failure> {
        let run = self.taken()?;
        run.progress.cancelled.store(true, Ordering::Relaxed);
        if let Err(e) = self.wait_for(&run, &self.limits.stop.clone(), false) {
            self.background = Some(run);
            return Err(e);
        }
        let number = run.number;
        self.adopt(run).map(|said| Reply::text(format!("run {number} is the state now\n{said}")))
    }

    /// `:drop`.
    pub(super) fn drop_background(&mut self) -> Result<Reply, Failure> {
        let run = self.taken()?;
        run.progress.cancelled.store(true, Ordering::Relaxed);
        Ok(Reply::text(format!("run {} was discarded\n", run.number)))
    }

    fn taken(&mut self) -> Result<Background, Failure> {
        self.background
            .take()
            .ok_or_else(|| plain("nothing runs in the background").hint(":infer &"))
    }

    /// Returns the number of the background run, and whether it is over, so that a front
    /// end can report it.
    pub fn background(&self) -> Option<(u32, bool)> {
        self.background.as_ref().map(|b| (b.number, b.status().is_done))
    }

    /// Returns the draws of the background run, or else of the last run, with a note on
    /// their origin.
    ///
    /// # Errors
    /// If there are no draws: nothing has run, or the run is still in warm-up.
    pub(super) fn latest_draws(&self) -> Result<(String, ChainDraws), Failure> {
        match (&self.background, &self.last) {
            (Some(run), _) => match run.kept.draws() {
                draws if draws.rows.is_empty() => Err(plain(run.no_draws().trim_end())),
                draws if run.status().is_done => Ok((String::new(), draws)),
                draws => Ok((format!("run {}: {}\n", run.number, run.status().part()), draws)),
            },
            (None, Some(last)) => Ok((String::new(), last.draws.clone())),
            (None, None) => Err(plain("nothing has run yet").hint(":infer")),
        }
    }

    /// `:profile`.
    pub(super) fn profile(&self) -> Result<Reply, Failure> {
        let Some(last) = &self.last else {
            return Err(plain("nothing has run yet").hint(":infer"));
        };
        let mut text = last.line();
        let rate = (last.steps + last.warmup) as f64 / last.seconds;
        text += &format!(
            "{}, {} steps per second\n\n{}",
            seconds(last.seconds),
            number(rate),
            table::kernels(&last.kernels)
        );
        let sites = table::sites(&last.sites);
        if !sites.is_empty() {
            text += &format!("\n{sites}");
        }
        Ok(Reply::text(text))
    }
}
