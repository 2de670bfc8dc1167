//! Runs a program into a folder, and observes and ends the run from the host program:
//! `cargo run --release --example embed_run_dir [-- FOLDER]`.

use pcadlang::infer::draws::Sink;
use pcadlang::infer::{Callbacks, Progress};
use pcadlang::report::csv::CsvSink;
use pcadlang::report::{Memory, RunDir, Tee, quantities};
use pcadlang::{Model, RunOptions};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Runs two chains into a folder until each has `most` draws. Returns the total number of
/// draws.
///
/// # Errors
/// Returns an error if the folder holds other files, or if the program fails.
pub fn run(folder: &Path, most: u64) -> Result<usize, Box<dyn Error>> {
    let model = Model::from_text(
        "assume x ~ normal(0, 1); observe normal(x, 0.5) = 2;
         infer { warmup 200 { drift(@x); } repeat 1000000 { drift(@x); } }",
    )?;
    let dir = RunDir::create(folder)?;
    // Callbacks run on the chains' threads. A break ends the run at the next step; so
    // does setting `progress.cancelled`, which another thread or a signal handler may do
    // at any time.
    let callbacks =
        Callbacks::new().on_step(move |_chain, steps, _trace| match steps < 200 + most {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        });
    let progress = Arc::new(Progress::default());
    let shown = Arc::clone(&progress);
    let options =
        RunOptions { seed: 1, callback: Some(Arc::new(callbacks)), ..RunOptions::default() };

    // Draws go to files as they are made, and to memory for the summary at the end.
    let memories = [Memory::default(), Memory::default()];
    let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
    for (i, memory) in memories.iter().enumerate() {
        let file = dir.file(&format!("chain-{}.csv", i + 1));
        let csv = CsvSink::create(&file, i as u32, &[("program", model.hash().to_owned())])?;
        sinks.push(Box::new(Tee(vec![Box::new(csv), Box::new(memory.clone())])));
    }
    for chain in model.run_into(&options, 2, &progress, sinks)? {
        chain.map_err(|e| model.chain_error(e))?;
    }
    let draws: Vec<_> = memories.iter().map(Memory::draws).collect();
    let summary: serde_json::Map<_, _> =
        quantities(&draws).into_iter().map(|q| (q.name, serde_json::json!(q.summary))).collect();
    dir.write("summary.json", serde_json::to_string_pretty(&summary)?.as_bytes())?;
    dir.write("run.json", br#"{ "status": "done" }"#)?;
    println!("{} steps, {}", shown.steps.load(Ordering::Relaxed), dir.path().display());
    Ok(draws.iter().map(|d| d.rows.len()).sum())
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "runs/embedded".into());
    println!("{} draws", run(Path::new(&folder), 2000)?);
    Ok(())
}
