//! `pcadlang predict`: replicated data, drawn from the prior or the posterior, compared
//! with the observed data. The library draws them ([`pcadlang_inference::predictive`]); this
//! module makes a table and a file.

use crate::args::{Job, Predict};
use pcadlang_inference::draws::{Discard, Sink};
use pcadlang_inference::predictive::{
    Predictive, Replication, STATISTICS, observed, prior, statistics, tail,
};
use pcadlang_inference::{Progress, diagnostics};
use pcadlang_library::Model;
use pcadlang_report::{RunDir, number, seconds, table};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files::write_in;
use pcadlang_runs::inputs::{self, Ready};
use pcadlang_runs::job::{self, Interrupt};
use pcadlang_runs::progress::{self, Ending};
use pcadlang_runs::quality;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// If the observations have more numbers than this in total, only statistics are written.
const ELEMENTS: usize = 200;
/// A tail probability below this, or above one minus this, is marked.
const EXTREME: f64 = 0.01;

/// Draws, writes `predictive.csv`, and prints the table.
pub fn predict(a: &Predict) -> Result<(), Failure> {
    let begun = Instant::now();
    let job = &quality::filled(&a.job, a.prior)?;
    let ready = inputs::prepare(job, false)?;
    let model = &ready.model;
    let (what, draws) = match a.prior {
        true => ("prior", vec![from_prior(a, model)?]),
        false => ("posterior", from_posterior(job, &ready)?),
    };
    let now = observed(&model.simulate(a.job.sampling.seed, 0)?);
    let silent: Vec<&(String, String)> =
        draws.iter().flatten().next().map_or(Vec::new(), |r| r.silent.iter().collect());
    if draws.iter().flatten().all(|r| r.groups.is_empty()) {
        let named: Vec<String> =
            silent.iter().map(|(name, what)| format!("{name} is {what}")).collect();
        let hint = (!named.is_empty()).then(|| named.join("; "));
        return Err(Failure::Plain(
            "none of the program's observations has a sampler".into(),
            hint,
        ));
    }
    let stem = job::stem(&a.job.inputs.program);
    let dir = match &a.out {
        Some(path) => RunDir::create(path),
        None => RunDir::fresh(Path::new("runs"), &format!("{stem}-predictive")),
    };
    let dir = dir.map_err(|e| plain(e.to_string()))?;
    write_in(&dir, "predictive.csv", csv(&now, &draws).as_bytes())?;
    print_text!("{}", compared(what, &now, &draws));
    for (name, what) in silent {
        print_line!("note: {name} is {what}, so it is left out");
    }
    let count: usize = draws.iter().map(Vec::len).sum();
    let took = seconds(begun.elapsed().as_secs_f64());
    print_line!(
        "seed {}, {count} draws from the {what} in {took}\n{}",
        a.job.sampling.seed,
        dir.path().display()
    );
    Ok(())
}

fn from_prior(a: &Predict, model: &Model) -> Result<Vec<Replication>, Failure> {
    let drawn =
        prior(model.code(), a.job.sampling.seed, a.n, job::threads(&a.job), model.limits().clone());
    drawn.map_err(|e| model.chain_error(e).into())
}

fn from_posterior(job: &Job, ready: &Ready) -> Result<Vec<Vec<Replication>>, Failure> {
    let (s, model) = (&job.sampling, &ready.model);
    let watch = Predictive::new(s.chains(), s.seed);
    let options = job::options(job, ready, Some(Arc::new(watch.clone())));
    let sinks = (0..s.chains()).map(|_| Box::new(Discard) as Box<dyn Sink>).collect();
    let (progress, ending) = (Arc::new(Progress::default()), Ending::default());
    let interrupt = Interrupt::listen();
    interrupt.ends(&progress);
    let results = std::thread::scope(|scope| {
        scope.spawn(|| progress::watch(&progress, (s.chains(), "chains"), &ending, s.time, false));
        ending.of(|| model.run_into(&options, job::threads(job), &progress, sinks))
    })?;
    for warning in model.started(results)?.warnings {
        error_line!("warning: {warning}");
    }
    if progress.cancelled.load(Ordering::Relaxed) {
        return Err(Failure::Interrupted);
    }
    watch.draws().map_err(|e| model.run_error(*e).into())
}

/// Formats a table with one row per test statistic of each observation.
fn compared(what: &str, now: &Replication, draws: &[Vec<Replication>]) -> String {
    let head = ["observation", "statistic", "observed", "5%", "50%", "95%", "tail"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let mut marked = false;
    for group in &now.groups {
        let all: Vec<[f64; 4]> = draws
            .iter()
            .flatten()
            .filter_map(|r| r.get(&group.name))
            .map(|g| statistics(&g.numbers))
            .collect();
        if all.is_empty() {
            continue;
        }
        let here = statistics(&group.numbers);
        for (k, name) in STATISTICS.iter().enumerate() {
            let mut replicated: Vec<f64> =
                all.iter().map(|s| s[k]).filter(|x| !x.is_nan()).collect();
            replicated.sort_by(f64::total_cmp);
            // A single number is its own mean, minimum and maximum, and has no standard
            // deviation.
            if replicated.is_empty() || group.numbers.len() == 1 && k > 0 {
                continue;
            }
            let p = tail(here[k], &replicated);
            let extreme = !(EXTREME..=1.0 - EXTREME).contains(&p);
            marked |= extreme;
            let q = |p: f64| number(diagnostics::quantile_sorted(&replicated, p));
            let tail = format!("{p:.3}{}", if extreme { " *" } else { "" });
            let label = if group.numbers.len() == 1 { "value" } else { name };
            rows.push(vec![
                group.name.clone(),
                label.into(),
                number(here[k]),
                q(0.05),
                q(0.5),
                q(0.95),
                tail,
            ]);
        }
    }
    let mut s = table::aligned(&rows);
    let _ = writeln!(
        s,
        "tail: the fraction of {what} replications beyond the observed value (a \
                         predictive p-value); 0.5 is the centre"
    );
    if marked {
        let _ = writeln!(
            s,
            "*: tail probability below {EXTREME} on one side: the program rarely produces such data"
        );
    }
    s
}

/// Writes statistics of every draw, and the numbers themselves if they are few. Missing
/// values are empty.
fn csv(now: &Replication, draws: &[Vec<Replication>]) -> String {
    let total: usize = now.groups.iter().map(|g| g.numbers.len()).sum();
    let whole = total <= ELEMENTS;
    let mut s = "chain,draw".to_owned();
    for g in &now.groups {
        STATISTICS
            .iter()
            .for_each(|k| s.push_str(&format!(",{}", quoted(&format!("{}.{k}", g.name)))));
        if whole {
            (0..g.numbers.len())
                .for_each(|i| s.push_str(&format!(",{}", quoted(&format!("{}[{i}]", g.name)))));
        }
    }
    s.push('\n');
    for (chain, all) in draws.iter().enumerate() {
        for (draw, r) in all.iter().enumerate() {
            let _ = write!(s, "{},{draw}", chain + 1);
            for g in &now.groups {
                let numbers = r.get(&g.name).map_or(&[][..], |g| &g.numbers);
                let own = if whole { g.numbers.len() } else { 0 };
                let elements = (0..own).map(|i| numbers.get(i).copied().unwrap_or(f64::NAN));
                for x in statistics(numbers).into_iter().chain(elements) {
                    let _ = if x.is_nan() { write!(s, ",") } else { write!(s, ",{x}") };
                }
            }
            s.push('\n');
        }
    }
    s
}

/// Quotes a field according to RFC 4180.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}
