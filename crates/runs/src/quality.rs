//! `--quality` and `--time`: measured presets of speed and accuracy, which fill in
//! settings that the command line leaves open.
//!
//! Invariant: filled-in settings are equivalent to typed ones, and depend on the command
//! line and the presets only, not on the machine.

use crate::args::{Job, QualityArg, Sampling};
use crate::failure::{Failure, plain};
use pcadlang_library::shipped;
use pcadlang_workbench::tradeoff::{Choice, Presets, Quality};
use std::path::Path;
use std::time::Duration;

/// Reads the presets of a program: `NAME.quality.json` beside it or, for a shipped
/// program, the shipped file.
pub fn presets(program: &str) -> Result<Option<(String, Presets)>, Failure> {
    let path = Path::new(program).with_extension("quality.json");
    let name = path.display().to_string();
    let shipped =
        || shipped::file(&name).filter(|_| !Path::new(program).exists()).map(str::to_owned);
    let Some(text) = std::fs::read_to_string(&path).ok().or_else(shipped) else { return Ok(None) };
    let wrong = |e: &dyn std::fmt::Display| plain(format!("{name}: {e}"));
    let presets: Presets = serde_json::from_str(&text).map_err(|e| wrong(&e))?;
    presets.front.iter().try_for_each(|p| p.setting.check()).map_err(|e| wrong(&e))?;
    Ok(Some((name, presets)))
}

/// Fills in the settings that a run leaves open. Returns a note for the user if there are
/// presets. `keypoints`: whether the run, or its dataset, has keypoints.
pub fn apply(job: &mut Job, keypoints: bool) -> Result<Option<String>, Failure> {
    let program = &job.inputs.program;
    let wanted = match (job.sampling.quality, job.sampling.time) {
        (Some(QualityArg::Own), _) | (None, None) => return Ok(None),
        (Some(QualityArg::Known(quality)), _) => Some(quality),
        (None, Some(_)) => None,
    };
    let known = presets(program)?;
    let Some(quality) = wanted else {
        let Some((name, presets)) = known.filter(|(_, p)| fits(p, keypoints)) else {
            return Ok(None);
        };
        let seconds = job.sampling.time.map_or(0.0, |t| t.as_secs_f64());
        return Ok(presets.of_time(seconds).map(|choice| apply_preset(job, &choice, &name)));
    };
    let Some((name, presets)) = known.filter(|(_, p)| fits(p, keypoints)) else {
        return Ok(Some(apply_time(job, quality)));
    };
    match presets.of_quality(quality) {
        Some(choice) => Ok(Some(apply_preset(job, &choice, &name))),
        None => Err(plain(format!("{name} contains no presets"))),
    }
}

/// Returns whether a run has the data that the presets were measured with.
pub fn fits(presets: &Presets, keypoints: bool) -> bool {
    presets.needs.iter().all(|kind| kind == "keypoints" && keypoints)
}

/// The time of a run without measured presets.
fn usual_time(quality: Quality) -> Duration {
    Duration::from_secs(match quality {
        Quality::Fast => 10,
        Quality::Balanced => 30,
        Quality::Accurate => 120,
    })
}

/// Fills in the length of a run for which nothing was measured.
fn apply_time(job: &mut Job, quality: Quality) -> String {
    let s = &mut job.sampling;
    let is_open = s.time.is_none() && s.steps.is_none();
    s.time = if is_open { Some(usual_time(quality)) } else { s.time };
    let time = usual_time(quality).as_secs();
    let said = if is_open { format!("--time {time}s") } else { "no changes".to_owned() };
    format!(
        "--quality {}: {said}; nothing was measured for {} as it is run here (pcadlang tradeoff \
         --presets does)",
        quality.name(),
        job.inputs.program
    )
}

fn apply_preset(job: &mut Job, choice: &Choice, name: &str) -> String {
    let setting = &choice.preset.setting;
    let mut said = Vec::new();
    for (param, value) in &setting.set {
        if !job.inputs.sets.iter().any(|(p, _)| p == param) {
            job.inputs.sets.push((param.clone(), value.clone()));
            said.push(format!("--set {param}={value}"));
        }
    }
    let s = &mut job.sampling;
    if let (None, Some(chains)) = (s.chains, setting.chains) {
        s.chains = Some(chains);
        said.push(format!("--chains {chains}"));
    }
    // Time and steps both determine the length of a run: if one is given, neither is
    // filled in.
    if let (None, None) = (s.time, s.steps) {
        if let Some(time) = setting.time {
            s.time = Some(Duration::from_secs_f64(time));
            said.push(format!("--time {time}s"));
        }
        if let Some(steps) = setting.steps {
            s.steps = Some(steps);
            said.push(format!("--steps {steps}"));
        }
    }
    if let (None, Some(warmup)) = (s.warmup, setting.warmup) {
        s.warmup = Some(warmup);
        said.push(format!("--warmup {warmup}"));
    }
    s.search = choice.preset.search.unwrap_or_default();
    let [low, high] = choice.preset.interval;
    let (error, cases) = (choice.preset.error, choice.preset.cases);
    format!(
        "{}: {}, from {name} (error {error}, {low} to {high} over {cases} cases); --quality own \
         uses the program's own settings",
        choice.wanted,
        if said.is_empty() { "no changes".to_owned() } else { said.join(" ") },
    )
}

/// Returns a job with its open settings filled in, and prints a note unless `quiet` is
/// true.
pub fn filled(job: &Job, quiet: bool) -> Result<Job, Failure> {
    let mut job = job.clone();
    let keypoints = job.keypoints.is_some();
    if let (Some(said), false) = (apply(&mut job, keypoints)?, quiet) {
        error_line!("note: {said}");
    }
    Ok(job)
}

/// Formats the options for repeating a run that differ from the defaults, except its
/// length.
pub fn again(job: &Job) -> String {
    let sets = job.inputs.sets.iter().map(|(k, v)| format!(" --set {k}={v}"));
    let chains =
        job.sampling.chains.filter(|n| *n != Sampling::CHAINS).map(|n| format!(" --chains {n}"));
    sets.chain(chains).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Inputs;

    fn job(quality: Option<QualityArg>, time: Option<f64>) -> Job {
        let inputs = Inputs {
            program: "x.pcad".into(),
            sets: vec![("size".into(), "64".into())],
            camera: None,
            edges: None,
            who: Default::default(),
            allowed: Default::default(),
            hint: Default::default(),
        };
        Job::of(
            inputs,
            Sampling { quality, time: time.map(Duration::from_secs_f64), ..Sampling::default() },
        )
    }

    #[test]
    fn what_was_typed_stays() {
        let text = r#"{"about": "", "error": "", "front": [
            {"chains": 2, "time": 1, "set": {"size": "96", "keep": "4"}, "seconds": 1.1, "error": 0.3, "interval": [0.2, 0.4], "cases": 3}]}"#;
        let presets: Presets = serde_json::from_str(text).unwrap();
        let mut open = job(None, None);
        let said =
            apply_preset(&mut open, &presets.of_quality(Quality::Fast).unwrap(), "x.quality.json");
        assert_eq!(open.inputs.sets, [("size".into(), "64".into()), ("keep".into(), "4".into())]);
        assert_eq!((open.sampling.chains(), open.sampling.time), (2, Some(Duration::from_secs(1))));
        assert!(said.starts_with(
            "--quality fast: --set keep=4 --chains 2 --time 1s, from x.quality.json (error 0.3, 0.2 to 0.4"
        ));
        let mut told = job(None, Some(5.0));
        told.sampling.chains = Some(3);
        apply_preset(&mut told, &presets.of_time(5.0).unwrap(), "x.quality.json");
        assert_eq!((told.sampling.chains(), told.sampling.time), (3, Some(Duration::from_secs(5))));
    }

    #[test]
    fn all_that_was_measured_is_filled_in() {
        let text = r#"{"about": "", "error": "", "front": [
            {"steps": 200, "warmup": 50, "seconds": 1.1, "error": 0.3, "interval": [0.2, 0.4], "cases": 3}]}"#;
        let presets: Presets = serde_json::from_str(text).unwrap();
        let mut open = job(None, None);
        apply_preset(&mut open, &presets.of_quality(Quality::Fast).unwrap(), "x.quality.json");
        assert_eq!(
            (open.sampling.steps, open.sampling.warmup, open.sampling.time),
            (Some(200), Some(50), None)
        );
        let mut told = job(None, Some(2.0));
        told.sampling.warmup = Some(7);
        apply_preset(&mut told, &presets.of_time(2.0).unwrap(), "x.quality.json");
        assert_eq!((told.sampling.steps, told.sampling.warmup), (None, Some(7)));
    }

    /// Programs without measured presets have a time for each quality.
    #[test]
    fn what_is_not_measured_has_a_usual_time() {
        let of = |quality| {
            let mut open = job(Some(QualityArg::Known(quality)), None);
            let said = apply(&mut open, false).unwrap().unwrap();
            assert!(said.contains("nothing was measured"), "{said}");
            open.sampling.time.unwrap()
        };
        let [fast, balanced, accurate] = Quality::ALL.map(of);
        assert!(fast < balanced && balanced < accurate);
        let mut told = job(Some(QualityArg::Known(Quality::Fast)), None);
        told.sampling.steps = Some(7);
        apply(&mut told, false).unwrap();
        assert_eq!((told.sampling.steps, told.sampling.time), (Some(7), None));
        assert!(apply(&mut job(None, Some(1.0)), false).unwrap_or_default().is_none());
        assert!(apply(&mut job(Some(QualityArg::Own), None), false).unwrap_or_default().is_none());
    }
}
