//! `pcadlang check --sbc` and `--geweke`: tests whether a program's plan samples from its
//! posterior. The statistics are in the library ([`pcadlang_inference::calibration`]); this
//! module runs them and prints the results.

use crate::args::{Check, Inputs, Job, Sampling};
use pcadlang_inference as infer;
use pcadlang_inference::calibration::{
    CalibrationError, FALSE_ALARMS, Geweke, PlanSampler, RANKS, Sampler, Sbc, Settings, geweke, sbc,
};
use pcadlang_inference::{Progress, RunOptions};
use pcadlang_library::Model;
use pcadlang_report::{number, seconds, table};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::inputs;
use pcadlang_runs::job::{Interrupt, machine_threads};
use pcadlang_runs::people::PersonArgs;
use pcadlang_runs::progress::{self, Ending};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// The default numbers of data sets for `--sbc` and of chains for `--geweke`.
const REPLICATES: (u32, u32) = (200, 100);

/// Simulates from each program and reports whether its plan passes.
pub fn calibrate(a: &Check) -> Result<(), Failure> {
    let interrupt = Interrupt::listen();
    let mut failed = Vec::new();
    for path in &a.programs {
        let job = job(a, path);
        let (program, _) = inputs::observe(inputs::program_of(&job, false)?, &job)?;
        let model = program.compile()?;
        let mut passes = true;
        if a.sbc {
            let (said, took) = run(a, &model, &interrupt, REPLICATES.0, sbc)?;
            print_text!("{}", ranks(path, &said, a.seed, took));
            passes &= said.passes();
        }
        if a.geweke {
            let (said, took) = run(a, &model, &interrupt, REPLICATES.1, geweke)?;
            print_text!("{}", turns(path, &said, a.seed, took));
            passes &= said.passes();
        }
        if !passes {
            failed.push(path.as_str());
        }
    }
    if failed.is_empty() {
        Ok(())
    } else {
        let (n, of) = (failed.len(), a.programs.len());
        Err(plain(format!("{n} of {of} programs fail: {}", failed.join(", "))))
    }
}

/// Returns the equivalent arguments of `run`.
fn job(a: &Check, path: &str) -> Job {
    Job {
        features_from: None,
        full_size: false,
        coco: Default::default(),
        inputs: Inputs {
            program: path.to_owned(),
            sets: a.sets.clone(),
            camera: None,
            edges: None,
            who: PersonArgs::default(),
            allowed: a.allowed.clone(),
            hint: Default::default(),
        },
        observe: a.observe.clone(),
        observe_contours: None,
        keypoints: None,
        sampling: Sampling {
            seed: a.seed,
            chains: Some(1),
            threads: a.threads,
            steps: a.steps,
            ..Sampling::default()
        },
    }
}

/// One of the two checks.
type Method<T> = fn(
    &Arc<pcadlang_engine::lang::code::Code>,
    &dyn Sampler,
    &Settings,
) -> Result<T, CalibrationError>;

fn run<T>(
    a: &Check,
    model: &Model,
    interrupt: &Interrupt,
    replicates: u32,
    method: Method<T>,
) -> Result<(T, f64), Failure> {
    let begun = Instant::now();
    let (plan, _) = model.plan()?;
    let settings = Settings {
        replicates: a.replicates.unwrap_or(replicates) as usize,
        seed: a.seed,
        threads: a.threads.map_or_else(machine_threads, |n| n as usize),
        steps: a.steps,
        limits: model.limits().clone(),
        estimated: Some(|time| error_line!("this takes about {}", seconds(time.as_secs_f64()))),
    };
    let (progress, ending) = (Arc::new(Progress::default()), Ending::default());
    interrupt.ends(&progress);
    let options = RunOptions { seed: a.seed, ..RunOptions::default() };
    let sampler = PlanSampler { plan: &plan, options, progress: &progress };
    let said = std::thread::scope(|scope| {
        scope.spawn(|| {
            progress::watch(
                &progress,
                (settings.replicates as u32, "replicates"),
                &ending,
                None,
                false,
            )
        });
        ending.of(|| method(model.code(), &sampler, &settings))
    });
    if progress.cancelled.load(Ordering::Relaxed) {
        return Err(Failure::Interrupted);
    }
    said.map(|said| (said, begun.elapsed().as_secs_f64())).map_err(|e| failure(e, model))
}

fn failure(e: infer::calibration::CalibrationError, model: &Model) -> Failure {
    match e {
        CalibrationError::NotSimulable(reason) => {
            let hint = "programs are checked on simulated data: they need proper priors, and observations that have samplers";
            Failure::Plain(reason, Some(hint.into()))
        }
        CalibrationError::TooFew(reason) => plain(reason),
        CalibrationError::Chain(e) => model.chain_error(e).into(),
    }
}

/// Formats the table of `--sbc`.
fn ranks(path: &str, said: &Sbc, seed: u64, took: f64) -> String {
    let mut rows =
        vec![["quantity", "ranks", "chi2", "p", "min ess", "verdict"].map(str::to_owned).to_vec()];
    for r in &said.rows {
        let verdict = match (r.passes, r.is_short) {
            (true, false) => "ok",
            (true, true) => "ok, few draws",
            (false, false) => "FAILS",
            (false, true) => "FAILS, few draws",
        };
        let ess = format!("{:.0}", r.least_ess);
        rows.push(vec![
            r.name.clone(),
            bars(&r.counts),
            number(r.chi_square),
            number(r.p),
            ess,
            verdict.into(),
        ]);
    }
    let mut s = format!("{path}: simulation-based calibration\n{}", table::aligned(&rows));
    s.push_str(&more(said.left_out));
    s.push_str(&format!(
        "{} data sets; ranks among {} draws in {} bins; fails below p = {} (false alarm rate \
         {FALSE_ALARMS} over {} quantities)\n",
        said.replicates,
        RANKS - 1,
        said.bins,
        number(said.threshold),
        said.rows.len(),
    ));
    if said.rows.iter().any(|r| r.is_short) {
        s.push_str(
            "few draws: some chains have a smaller effective sample size than the number \
                    of ranked draws; increase --steps\n",
        );
    }
    s.push_str(&format!("seed {seed}, {} steps per chain, {}\n", said.steps, seconds(took)));
    s
}

/// Formats the table of `--geweke`.
fn turns(path: &str, said: &Geweke, seed: u64, took: f64) -> String {
    let head = ["quantity", "median, prior", "median, chains", "z mean", "z square", "verdict"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for r in &said.rows {
        let z = |z: f64| format!("{z:.2}");
        let verdict = if r.passes { "ok" } else { "FAILS" };
        let (a, b) = (number(r.marginal), number(r.successive));
        rows.push(vec![r.name.clone(), a, b, z(r.z_mean), z(r.z_square), verdict.into()]);
    }
    let mut s = format!("{path}: Geweke's joint distribution test\n{}", table::aligned(&rows));
    s.push_str(&more(said.left_out));
    s.push_str(&format!(
        "{} chains of {} alternations against {} draws from the prior; fails beyond |z| = {:.2} \
         (false alarm rate {FALSE_ALARMS} over {} scores)\n",
        said.chains,
        said.turns,
        said.marginal,
        said.threshold,
        2 * said.rows.len(),
    ));
    s.push_str(&format!("seed {seed}, {}\n", seconds(took)));
    s
}

fn more(left_out: usize) -> String {
    if left_out == 0 {
        String::new()
    } else {
        format!("… and {left_out} more, present in fewer states\n")
    }
}

/// Draws counts as bars, relative to the largest.
fn bars(counts: &[u32]) -> String {
    const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    counts.iter().map(|c| BARS[(8 * c).div_ceil(most).min(8) as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_level_with_the_largest() {
        assert_eq!(bars(&[0, 1, 4, 8]), " ▁▄█");
        assert_eq!(bars(&[0, 0]), "  ");
    }
}
