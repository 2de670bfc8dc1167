//! A run reopened from its folder: the command that began it, with all settings, and its
//! states.

use crate::args::{Job, Run};
use crate::failure::{Failure, plain};
use crate::{inputs, scene};
use clap::Parser;
use humantime::format_rfc3339_seconds;
use pcadlang_engine::trace::{SavedTrace, Stop, Trace};
use pcadlang_inference::{KeptTrace, TrajectoryState};
use pcadlang_library::{Model, Program};
use pcadlang_workbench::session::{Reply, Session};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The program's text, as it was run.
pub const PROGRAM: &str = "program.pcad";
/// The file of the kept states: JSON, one per line.
pub const TRACES: &str = "traces.jsonl";
/// The file of the states on the way from the prior: JSON, one per line.
pub const TRAJECTORY: &str = "trajectory.jsonl";

/// The command of a run, as it was recorded.
#[derive(Parser)]
struct Recorded {
    #[command(flatten)]
    run: Run,
}

/// The folder of a run.
pub struct Reopened {
    folder: PathBuf,
    /// The job, including everything that `--time` or `--quality` filled in.
    pub job: Job,
    /// The arguments of `pcadlang run`.
    pub arguments: Vec<String>,
}

/// Returns the arguments of `pcadlang run` that repeat a job: everything that its draws
/// depend on.
pub fn arguments(job: &Job) -> Vec<String> {
    let (g, s) = (&job.inputs, &job.sampling);
    let mut all = vec![g.program.clone()];
    let mut add = |name: &str, value: String| all.extend([format!("--{name}"), value]);
    let path = |p: &PathBuf| p.display().to_string();
    g.sets.iter().for_each(|(k, v)| add("set", format!("{k}={v}")));
    g.camera.iter().for_each(|p| add("camera", path(p)));
    g.edges.iter().for_each(|e| add("edges", e.clone()));
    g.who.person.iter().for_each(|n| add("person", n.to_string()));
    g.who.models.iter().for_each(|p| add("models", path(p)));
    g.allowed.allow_read.iter().for_each(|p| add("allow-read", path(p)));
    g.allowed.limits.iter().for_each(|(k, n)| add("limit", format!("{k}={n}")));
    job.observe.iter().for_each(|o| add("observe", o.clone()));
    job.observe_contours.iter().for_each(|p| add("observe-contours", path(p)));
    job.keypoints.iter().for_each(|k| add("keypoints", k.clone()));
    job.features_from.iter().for_each(|c| add("features-from", c.clone()));
    add("seed", s.seed.to_string());
    add("chains", s.chains().to_string());
    s.steps.iter().for_each(|n| add("steps", n.to_string()));
    s.warmup.iter().for_each(|n| add("warmup", n.to_string()));
    s.time.iter().for_each(|t| add("time", format!("{}ms", t.as_millis())));
    add("quality", "own".into());
    all.extend(g.who.anyway.then(|| "--anyway".to_owned()));
    all.extend(job.full_size.then(|| "--full-size".to_owned()));
    all.extend(g.hint.arguments());
    all
}

/// Quotes arguments for a shell.
pub fn quoted(arguments: &[String]) -> String {
    let plain = |a: &String| {
        !a.is_empty() && a.chars().all(|c| c.is_ascii_alphanumeric() || "_-./=:,#+@".contains(c))
    };
    let one =
        |a: &String| if plain(a) { a.clone() } else { format!("'{}'", a.replace('\'', "'\\''")) };
    arguments.iter().map(one).collect::<Vec<_>>().join(" ")
}

impl Reopened {
    /// Opens the run in a folder. Relative paths in its command refer to the current
    /// directory.
    ///
    /// # Errors
    /// If the folder does not contain a run, or one of a version that did not record its
    /// command.
    pub fn open(folder: &Path) -> Result<Reopened, Failure> {
        let run = crate::resume::run(folder)?;
        let told = || {
            let hint = "run it again with this version; `evaluate` keeps the pictures of its cases";
            Failure::Plain(
                format!("{}: the folder does not record its command", folder.display()),
                Some(hint.into()),
            )
        };
        let kept = run["arguments"].as_array().ok_or_else(told)?;
        let arguments: Vec<String> =
            kept.iter().filter_map(|a| a.as_str().map(str::to_owned)).collect();
        let typed = std::iter::once("run".to_owned()).chain(arguments.iter().cloned());
        match Recorded::try_parse_from(typed) {
            Ok(Recorded { run }) => {
                Ok(Reopened { folder: folder.to_owned(), job: run.job, arguments })
            }
            _ => Err(plain(format!(
                "{}: this version does not have the command it was run with",
                folder.display()
            ))),
        }
    }

    /// Returns its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Opens a session with the program, data, settings and best state of the run.
    ///
    /// # Errors
    /// If any of them cannot be read.
    pub fn session(&self, seed: u64, stop: Stop) -> Result<(Session, Reply), Failure> {
        let (program, _) = inputs::observe(self.program()?, &self.job)?;
        let (mut session, _) = Session::open(program, seed, stop)?;
        let said = session.take_up(&self.best()?)?;
        Ok((session, said))
    }

    /// Reads the program, as it was run: its file may have changed since.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn program(&self) -> Result<Program, Failure> {
        let now = inputs::program_of(&self.job, true)?;
        match std::fs::read_to_string(self.folder.join(PROGRAM)) {
            Ok(text) if text != now.text() => Ok(now.edited(&text)?),
            _ => Ok(now),
        }
    }

    /// Reads the kept states.
    ///
    /// # Errors
    /// If their file cannot be read.
    pub fn traces(&self) -> Result<Vec<KeptTrace>, Failure> {
        self.states(TRACES)
    }

    /// Reads the states on the way from the prior.
    ///
    /// # Errors
    /// If their file cannot be read.
    pub fn trajectory(&self) -> Result<Vec<TrajectoryState>, Failure> {
        self.states(TRAJECTORY)
    }

    fn states<S: DeserializeOwned>(&self, name: &str) -> Result<Vec<S>, Failure> {
        let path = self.folder.join(name);
        let text = std::fs::read_to_string(&path)
            .map_err(|e| plain(format!("cannot read {}: {e}", path.display())))?;
        let one = |(i, line): (usize, &str)| {
            serde_json::from_str(line)
                .map_err(|e| plain(format!("{}: line {}: {e}", path.display(), i + 1)))
        };
        text.lines().enumerate().map(one).collect()
    }

    /// Reads the best state.
    ///
    /// # Errors
    /// If the state was not written, or cannot be read.
    pub fn best(&self) -> Result<SavedTrace, Failure> {
        let path = self.folder.join("best.trace.json");
        let bytes = crate::files::read(&path)?;
        serde_json::from_slice(&bytes).map_err(|e| plain(format!("{}: {e}", path.display())))
    }

    /// Loads a state as a trace of the program.
    ///
    /// # Errors
    /// If the program, its data or its settings are no longer those of the run.
    pub fn trace(&self, model: &Model, saved: &SavedTrace) -> Result<Trace, Failure> {
        scene::loaded(model, saved)
            .map_err(|e| plain(format!("a state of {}: {e}", self.folder.display())))
    }
}

/// Returns the present time in UTC, to the second: `2014-06-24T09:30:00Z` (RFC 3339). A
/// clock before 1970 counts as 1970, one after 9999 as its end.
pub fn now() -> String {
    written(SystemTime::now())
}

/// Formats a time; `humantime` has no other years than those from 1970 to 9999.
fn written(time: SystemTime) -> String {
    let end = UNIX_EPOCH + Duration::from_secs(253_402_300_799);
    format_rfc3339_seconds(time.clamp(UNIX_EPOCH, end)).to_string()
}

/// Formats a date for people, without its seconds; a text of another form is unchanged.
pub fn readable(date: &str) -> String {
    match (date.split_once('T'), date.ends_with('Z')) {
        (Some((day, time)), true) if time.len() == 9 => format!("{day} {} UTC", &time[..5]),
        _ => date.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (951_868_800, "2000-03-01T00:00:00Z"),
            (1_403_602_200, "2014-06-24T09:30:00Z"),
            (1_735_689_599, "2024-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(written(UNIX_EPOCH + Duration::from_secs(seconds)), date);
        }
        let far = Duration::from_secs(300_000_000_000);
        assert_eq!(written(UNIX_EPOCH - far), "1970-01-01T00:00:00Z");
        assert_eq!(written(UNIX_EPOCH + far), "9999-12-31T23:59:59Z");
        assert!(*now() > *"2025-01-01T00:00:00Z" && now().len() == 20);
        assert_eq!(readable("2014-06-24T09:30:00Z"), "2014-06-24 09:30 UTC");
        assert_eq!((readable("yesterday"), readable("TéTZ")), ("yesterday".into(), "TéTZ".into()));
    }
}
