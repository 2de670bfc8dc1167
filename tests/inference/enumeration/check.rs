//! Checks one plan on one program: each pass of the plan starts from an independent exact
//! draw from the posterior, so if the plan leaves the posterior invariant, it ends in an
//! exact draw as well. The draws are independent, so exact tests apply.

use super::plans::Plan;
use super::posterior::Posterior;
use super::records::Records;
use super::verdict::{Counts, Pooled};
use pcadlang::Program;
use pcadlang_engine::trace::{Draws, Limits, Trace};
use pcadlang_inference::{
    Callback, ChainError, Latent, Neighbours, Progress, RunOptions, run_from,
};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::Memory;
use std::sync::{Arc, Mutex};

/// The number of intervals in which positions of continuous choices are counted.
const BINS: usize = 8;

/// A program with its posterior, and the distribution of what it records if that is checked.
pub struct Case {
    pub text: String,
    pub posterior: Arc<Posterior>,
    pub records: Option<Records>,
    pub has_data: bool,
}

/// The outcome of a check.
pub enum Said {
    /// The counts of the draws, the same for pooling, those of records, and the fraction of passes
    /// that changed the state.
    Counted(Counts, Pooled, Pooled, f64),
    /// The plan is refused for this program.
    Refused(String),
    /// The plan failed, or reached a state outside of the posterior's support.
    Failed(String),
}

/// Resets the chain to an exact draw whenever it records one, after counting the state
/// that the pass from the previous draw ended in.
struct Restart {
    posterior: Arc<Posterior>,
    seed: u64,
    seen: Mutex<Seen>,
}

impl std::fmt::Debug for Restart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("restart")
    }
}

#[derive(Default)]
struct Seen {
    begun: u64,
    ended: Vec<(usize, Vec<f64>)>,
    moved: u64,
    /// The state in which the present pass began.
    from: Option<(usize, Vec<f64>)>,
    failed: Option<String>,
}

impl Callback for Restart {
    fn draw(&self, _chain: u32, trace: &mut Trace, draws: Draws) {
        let Ok(mut seen) = self.seen.lock() else { return };
        let place = |t: &Trace| self.posterior.place(t);
        if let Some(from) = seen.from.take() {
            match place(trace) {
                Some(to) => {
                    seen.moved += u64::from(to != from);
                    seen.ended.push(to);
                }
                None => {
                    seen.failed = Some(format!("a state that cannot be: {:?}", trace.choices()))
                }
            }
        }
        let mut rng = StreamKey::new(self.seed, 0, Purpose::TRUTH).stream(seen.begun, 0, 0);
        seen.begun += 1;
        let (state, log_joint) = self.posterior.draw(&mut rng);
        if let Err(e) = trace.restore(&state, draws) {
            seen.failed = Some(format!("restoring a state: {e}"));
            return;
        }
        let now = trace.log_joint();
        if let Some(expected) = log_joint
            && (now - expected).abs() > 1e-7 * (1.0 + expected.abs())
        {
            seen.failed = Some(format!("log joint {now}, expected {expected}"));
        }
        seen.from = place(trace);
        if seen.from.is_none() {
            seen.failed = Some(format!("a draw that is not as it was made: {:?}", trace.choices()));
        }
    }

    fn is_over(&self) -> bool {
        self.seen.lock().is_ok_and(|s| s.failed.is_some())
    }
}

/// Checks a plan on a program, over `passes` passes.
pub fn check(case: &Case, plan: &Plan, passes: u64, seed: u64) -> Said {
    let (Case { text, posterior, records, .. }, Plan { statements, kernels, .. }) = (case, plan);
    let collected = records.as_ref().map_or("1".to_owned(), Records::collected);
    let plan = format!(
        "{text}
{kernels}infer {{ warmup 20 {{ {statements} }} repeat {passes} {{ {statements} collect {collected}; }} }}\n"
    );
    let model = match Program::parse(&plan).and_then(Program::compile) {
        Ok(m) => m,
        Err(e) => return Said::Failed(format!("{e}")),
    };
    let (state, _) = posterior.draw(&mut StreamKey::new(seed, 1, Purpose::TRUTH).stream(0, 0, 0));
    let draws = Draws { key: StreamKey::new(seed, 2, Purpose::VALUES), step: 0, substream: 0 };
    let trace = match Trace::generate(model.code().clone(), state, draws, Limits::default()) {
        Ok((t, _)) => t,
        Err(e) => return Said::Failed(format!("{e}")),
    };
    let banks = statements.contains("knn").then(|| {
        // A few neighbours that are unrelated to the data.
        let all: Vec<_> =
            (0..12).filter_map(|i| model.simulate(9, i).ok()).map(|t| Latent::all(&t)).collect();
        Arc::new(Neighbours::new(all.iter().take(3).cloned().collect(), &all)) as _
    });
    let watch =
        Arc::new(Restart { posterior: Arc::clone(posterior), seed, seen: Mutex::default() });
    let watched: Arc<dyn Callback> = watch.clone();
    let options = RunOptions { seed, callback: Some(watched), banks, ..RunOptions::default() };
    let plan = match model.plan() {
        Ok((plan, _)) => plan,
        Err(e) => return Said::Failed(format!("{e}")),
    };
    let mut memory = Memory::default();
    let done = run_from(model.code(), &plan, &options, &Progress::default(), &mut memory, 0, trace);
    let Ok(seen) = watch.seen.lock() else { return Said::Failed("the watch failed".into()) };
    if let Some(e) = &seen.failed {
        return Said::Failed(e.clone());
    }
    match done {
        Ok(_) => {
            let (mut counts, pooled, moved) = count(posterior, &seen);
            // The first record is of a state that was not counted.
            let counted = records.as_ref().map(|r| r.count(&memory.draws(), 1)).transpose();
            let more = match counted {
                Ok(Some((more, pooled))) => {
                    counts.cells.extend(more.cells);
                    pooled
                }
                Ok(None) => Pooled::default(),
                Err(e) => return Said::Failed(e),
            };
            Said::Counted(counts, pooled, more, moved)
        }
        Err(ChainError::Run(e)) if e.message.contains("cannot be summed out") => {
            Said::Refused(e.message.clone())
        }
        Err(ChainError::Run(e)) if e.message.contains("only the surrogate depends") => {
            Said::Refused(e.message.clone())
        }
        Err(e) => Said::Failed(format!("{e:?}")),
    }
}

/// Adds a table of disjoint cells, each with its name, probability and count. Rare cells are merged
/// into one.
pub fn tabulate(
    cells: impl Iterator<Item = ((String, f64), u64)>,
    counts: &mut Counts,
    pooled: &mut Pooled,
) {
    let draws = counts.draws;
    let (mut table, mut rest) = (Vec::new(), (0.0, 0));
    for ((name, p), c) in cells {
        if p * draws as f64 >= 5.0 {
            counts.cells.push((name, p, c));
            table.push((p, c));
        } else {
            rest = (rest.0 + p, rest.1 + c);
        }
    }
    counts.cells.push(("other kinds".into(), rest.0, rest.1));
    match table.last_mut() {
        Some(last) if rest.0 * (draws as f64) < 3.0 => *last = (last.0 + rest.0, last.1 + rest.1),
        _ => table.push(rest),
    }
    pooled.add(draws, &table);
}

fn count(posterior: &Posterior, seen: &Seen) -> (Counts, Pooled, f64) {
    let probabilities = posterior.probabilities();
    let draws = seen.ended.len() as u64;
    let mut counts = Counts { draws, cells: Vec::new() };
    let mut pooled = Pooled::default();
    let mut by_kind = vec![0; probabilities.len()];
    seen.ended.iter().for_each(|(k, _)| by_kind[*k] += 1);
    let named = probabilities.iter().enumerate().map(|(i, p)| (format!("kind {i}"), *p));
    tabulate(named.zip(by_kind), &mut counts, &mut pooled);
    // The positions of continuous choices are uniform, whatever the kind of state.
    let uniform = 1.0 / BINS as f64;
    let dims = seen.ended.iter().map(|(_, u)| u.len()).max().unwrap_or(0);
    for d in 0..dims {
        let mut bins = [0u64; BINS];
        let with = seen.ended.iter().filter_map(|(_, u)| u.get(d));
        with.for_each(|u| bins[((u * BINS as f64) as usize).min(BINS - 1)] += 1);
        let n: u64 = bins.iter().sum();
        // How many states have this choice depends on their kinds; given that it exists,
        // its position is uniform.
        if n == draws {
            counts.cells.extend(
                bins.iter()
                    .enumerate()
                    .map(|(b, c)| (format!("continuous {d}, bin {b}"), uniform, *c)),
            );
        } else {
            let share: f64 = seen_share(posterior, d);
            let cells = bins.iter().enumerate();
            counts.cells.extend(
                cells.map(|(b, c)| (format!("continuous {d}, bin {b}"), uniform * share, *c)),
            );
        }
        pooled.add(n, &bins.map(|c| (uniform, c)));
    }
    (counts, pooled, seen.moved as f64 / draws.max(1) as f64)
}

/// Returns the probability that a state has more than `d` continuous choices.
fn seen_share(posterior: &Posterior, d: usize) -> f64 {
    posterior.kinds().filter(|(_, n)| *n > d).map(|(p, _)| p).sum()
}

/// Counts the states of a chain by kind.
struct Visits {
    posterior: Arc<Posterior>,
    counts: Mutex<Vec<f64>>,
}

impl std::fmt::Debug for Visits {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("visits")
    }
}

impl Callback for Visits {
    fn draw(&self, _chain: u32, trace: &mut Trace, _draws: Draws) {
        if let (Ok(mut counts), Some((kind, _))) = (self.counts.lock(), self.posterior.place(trace))
        {
            counts[kind] += 1.0;
        }
    }
}

/// Returns the total variation distance between the posterior and the states of four
/// chains of a plan, by kind, or between the records' distribution and their records if that is
/// larger.
pub fn distance(case: &Case, plan: &str, seed: u64) -> f64 {
    let Case { text, posterior, records, .. } = case;
    let longer = plan.replace("repeat 1000 {", "repeat 3000 {");
    let model = Program::parse(&format!("{text}\n{longer}")).and_then(Program::compile);
    let model = model.unwrap_or_else(|e| panic!("{e}"));
    let probabilities = posterior.probabilities();
    let counts = Mutex::new(vec![0.0; probabilities.len()]);
    let visits = Arc::new(Visits { posterior: Arc::clone(posterior), counts });
    let watched: Arc<dyn Callback> = visits.clone();
    let options = RunOptions { seed, callback: Some(watched), ..RunOptions::default() };
    let run = model.run(&options, 4, 2).unwrap_or_else(|e| panic!("{e}"));
    let recorded = records.as_ref().map_or(Ok(0.0), |r| r.distance(&run.draws));
    let counts = visits.counts.lock().map(|c| c.clone()).unwrap_or_default();
    let total: f64 = counts.iter().sum();
    let of_states =
        0.5 * counts.iter().zip(&probabilities).map(|(c, p)| (c / total - p).abs()).sum::<f64>();
    of_states.max(recorded.unwrap_or_else(|e| panic!("{e}\n{text}")))
}
