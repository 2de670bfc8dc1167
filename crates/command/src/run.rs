//! `pcadlang run`: one run, its folder, and the summary printed at the end.

use crate::args::{Job, Live, Run};
use crate::programs::explain::{Explanation, explain};
use pcadlang_engine::lang::plan::{Plan, StepKind};
use pcadlang_inference::ChainResult;
use pcadlang_numerics::platform::threads;
use pcadlang_report::{RunDir, modes_table, seconds, table};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files::write_in;
use pcadlang_runs::job::{self, Interrupt, Outcome, RunMode};
use pcadlang_runs::print::paragraph;
use pcadlang_runs::verdict::Judgement;
use pcadlang_runs::{inputs, quality, record, resume, term};
use pcadlang_syntax::diag::render;
use serde_json::json;
use std::io::IsTerminal;
use std::path::Path;

/// Runs a program and writes its folder.
pub fn run(a: &Run) -> Result<(), Failure> {
    let job = &quality::filled(&a.job, a.quiet)?;
    threads::limit(job.sampling.threads.unwrap_or(0) as usize);
    let ready = inputs::prepare(job, a.quiet)?;
    let (sources, warnings) = ready.model.warnings();
    if !warnings.is_empty() && !a.quiet {
        error_text!("{}", render(sources, warnings, term::has_colors()));
    }
    let (_, default_plan) = ready.model.plan()?;
    if let (Some(text), false) = (&default_plan, a.quiet) {
        error_line!(
            "note: the program has no `infer` block; using this default plan, which you can copy and edit:\n{text}"
        );
    }
    a.live.iter().try_for_each(Live::check)?;
    let interrupt = Interrupt::listen();
    let record = record::of(job, ready.model.hash(), &record::inputs_hash(job, &ready.model)?);
    let (runs, name) = (Path::new("runs"), job::stem(&job.inputs.program));
    if let Some(path) = a.out.as_ref().filter(|_| !a.resume) {
        let asks = !(a.quiet || a.json || a.stream);
        replaces(path, &job.inputs.program, a.overwrite, asks)?;
        if !a.quiet && resume::left(path).is_some() {
            error_line!("note: replacing the earlier run in {}", path.display());
        }
    }
    let dir = match &a.out {
        Some(path) if a.resume => resume::resumed(path, &record)?,
        None if a.resume => resume::resumed(&RunDir::latest(runs, name), &record)?,
        Some(path) => RunDir::create(path).map_err(|e| plain(e.to_string()))?,
        None => RunDir::fresh(runs, name).map_err(|e| plain(e.to_string()))?,
    };
    let mode = RunMode {
        live: !(a.quiet || a.json || a.stream),
        checkpoint: a.checkpoint,
        resume: a.resume,
        keep: a.keep,
        follow: a.live.clone(),
        stream: a.stream,
    };
    let outcome = job::perform(job, &ready, &dir, &record, &interrupt, mode)?;
    let explained = a.explain.then(|| explain(&ready.model, &outcome, job.sampling.seed));
    if let Some(explained) = &explained {
        let text = serde_json::to_vec_pretty(&explained.json()).unwrap_or_default();
        write_in(&dir, "explained.json", &text)?;
    }
    show(a, job, &dir, &outcome, explained.as_ref());
    if outcome.interrupted {
        return Err(Failure::Interrupted);
    }
    match job.sampling.time.filter(|_| job.sampling.steps != Some(0)) {
        Some(_) if made_no_step(&outcome, &ready.model.plan()?.0) => Err(unmoved()),
        _ => Ok(()),
    }
}

/// Makes sure that the run of another program in a folder is not lost: in a terminal the user says
/// whether it may be replaced, elsewhere it gets a folder of its own.
fn replaces(path: &Path, program: &str, overwrite: bool, asks: bool) -> Result<(), Failure> {
    let Some(other) = resume::other_program(path, program).filter(|_| !overwrite) else {
        return Ok(());
    };
    let said = format!("{} holds a run of {other}", path.display());
    let hint = "choose another folder with --out, or replace it with --overwrite";
    if asks && std::io::stdin().is_terminal() && term::is_live() {
        error_text!("{said}: replace it? [y/N] ");
        let mut answer = String::new();
        let _ = std::io::stdin().read_line(&mut answer);
        return match answer.trim() {
            "y" | "Y" | "yes" => Ok(()),
            _ => Err(plain(said).hint(hint)),
        };
    }
    let name = format!("{}.{}", path.display(), job::stem(&other));
    let numbered = (2..).map(|n| format!("{name}-{n}"));
    let free = std::iter::once(name.clone()).chain(numbered).find(|n| !Path::new(n).exists());
    let aside = free.unwrap_or(name);
    std::fs::rename(path, &aside).map_err(|e| plain(format!("{said}: {e}")).hint(hint))?;
    error_line!("note: {said}, which is now in {aside}");
    Ok(())
}

/// Returns whether some chain made no step, although the plan has kernels and there are choices
/// to move.
fn made_no_step(o: &Outcome, plan: &Plan) -> bool {
    let applies = |kind: &StepKind| matches!(kind, StepKind::Apply(_) | StepKind::Mix(_));
    let still = |c: &ChainResult| c.steps + c.warmup == 0 && c.last.choice_count() > 0;
    plan.steps.iter().any(|s| s.any(&applies)) && o.chains.iter().any(still)
}

/// Says that the draws of a run with a time limit are not of the posterior.
fn unmoved() -> Failure {
    plain("no kernel made a step, so the draws are those that the chains started from, not of the posterior")
        .hint("raise --time, or see whether the plan ends before its kernels")
}

/// Prints the results at the end of a run.
fn show(a: &Run, job: &Job, dir: &RunDir, o: &Outcome, explained: Option<&Explanation>) {
    let seed = job.sampling.seed;
    if a.json {
        let all = job::summaries(&o.quantities, o.kernel_seconds());
        let mut said = json!({
            "out": dir.path(), "seed": seed, "quantities": all, "kernels": o.kernels, "choices": o.sites,
            "modes": o.modes,
            "warnings": o.warnings,
            "found": o.judged.as_ref().map(Judgement::json),
            "approximate": o.approximate,
        });
        if let Some(explained) = explained {
            said["explained"] = explained.json();
        }
        print_line!("{said}");
        return;
    }
    if a.quiet || a.stream {
        return;
    }
    if let Some(judged) = &o.judged {
        paragraph(&format!("{judged}\n"));
    }
    let modes = modes_table(&o.modes, &o.quantities);
    let gap = if modes.is_empty() { "" } else { "\n" };
    let quantities = table::quantities(&o.quantities, o.kernel_seconds());
    print_text!("{quantities}{gap}{modes}\n{}", table::kernels(&o.kernels));
    let sites = table::sites(&o.sites);
    if !sites.is_empty() {
        print_text!("\n{sites}");
    }
    if let Some(explained) = explained {
        print_text!("\n{}\n", explained.text());
    }
    for w in &o.warnings {
        paragraph(&format!("warning: {w}"));
    }
    match &o.approximate[..] {
        [] => {}
        all if a.verbose => all.iter().for_each(|a| paragraph(&format!("approximate: {a}"))),
        [one] => paragraph(&format!("approximate: {one}")),
        all => print_line!(
            "approximate: {} approximations, listed in the report and with --verbose",
            all.len()
        ),
    }
    if o.chains.first().is_some_and(|c| c.last.is_pseudo()) {
        paragraph(
            "note: the image score is not a normalised likelihood: the widths of intervals depend on \
             its scale (a pseudo-posterior)",
        );
    }
    if o.chains.iter().all(|c| !c.last.is_conditioned()) {
        paragraph("note: nothing is observed, so these are draws from the prior");
    }
    if o.every > 1 {
        print_line!(
            "note: the summary is thinned to one draw in {}; the chain files have all draws",
            o.every
        );
    }
    let steps: u64 = o.chains.iter().map(|c| c.steps + c.warmup).sum();
    let most = o.chains.iter().map(|c| (c.steps, c.warmup)).max().unwrap_or_default();
    print_line!("seed {seed}, {} chains, {steps} steps in {}", o.chains.len(), seconds(o.seconds));
    if job.sampling.time.is_some() {
        print_line!(
            "to repeat the longest chain: --steps {} --warmup {}{}",
            most.0,
            most.1,
            quality::again(job)
        );
    }
    if o.interrupted {
        print_line!(
            "interrupted: all draws so far are kept; to resume, repeat the command with --resume --out {}",
            shown(dir)
        );
    }
    print_line!("{}", dir.path().display());
}

/// Quotes a folder for the command line if necessary.
fn shown(dir: &RunDir) -> String {
    let path = dir.path().display().to_string();
    if path.contains(char::is_whitespace) { format!("'{path}'") } else { path }
}
