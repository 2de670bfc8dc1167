//! Chains that are interrupted and resumed from a checkpoint, compared with the same
//! chains without interruption.

use pcadlang::Model;
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use pcadlang_inference::{Checkpoint, Progress, RunOptions};
use std::io;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

/// Draws as bits: the step, the log joint density, the values.
pub type Rows = Vec<(u64, u64, Vec<u64>)>;

/// The draws and checkpoints of a chain.
#[derive(Default)]
struct Kept {
    rows: Rows,
    checkpoints: Vec<Vec<u8>>,
}

/// Keeps the draws, and a checkpoint at each step if `each` is set.
struct Keep {
    kept: Arc<Mutex<Kept>>,
    progress: Arc<Progress>,
    from: Option<Checkpoint>,
    each: bool,
}

impl Sink for Keep {
    fn columns(&mut self, _: &[Column]) -> io::Result<()> {
        Ok(())
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        let values = row.values.iter().map(|x| x.to_bits()).collect();
        self.kept.lock().unwrap().rows.push((row.step, row.log_joint.to_bits(), values));
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }

    fn resume(&mut self) -> io::Result<Option<Checkpoint>> {
        Ok(self.from.take())
    }

    fn takes_checkpoints(&self) -> bool {
        self.each
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        self.kept.lock().unwrap().checkpoints.push(checkpoint.to_bytes());
        self.progress.checkpoints.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

fn go(
    model: &Model,
    options: &RunOptions,
    from: Option<Checkpoint>,
    each: bool,
) -> (Rows, Vec<Vec<u8>>, String) {
    let (kept, progress) = (Arc::new(Mutex::new(Kept::default())), Arc::new(Progress::default()));
    progress.checkpoints.store(1, Ordering::Relaxed);
    let sink = Keep { kept: Arc::clone(&kept), progress: Arc::clone(&progress), from, each };
    let done = model
        .run_into(options, 1, &progress, vec![Box::new(sink)])
        .unwrap_or_else(|e| panic!("{e}"));
    let done =
        done.into_iter().next().unwrap().unwrap_or_else(|e| panic!("{}", model.chain_error(e)));
    let counts: Vec<_> =
        done.kernels.iter().map(|k| (&k.name, k.proposals, k.accepted, k.failed)).collect();
    let best = done.best.as_ref().map(|b| b.0.to_bits());
    let end = format!("{} {} {counts:?} {:?} {best:?}", done.steps, done.warmup, done.sites);
    let kept = std::mem::take(&mut *kept.lock().unwrap());
    (kept.rows, kept.checkpoints, end)
}

/// Interrupts a chain at about `breaks` of its steps, warm-up included, and asserts that
/// it resumes with the same draws as without interruption.
pub fn same_after_breaks(what: &str, model: &Model, options: &RunOptions, breaks: usize) {
    let (rows, _, end) = go(model, options, None, false);
    let (kept, checkpoints, _) = go(model, options, None, true);
    assert!(rows == kept, "{what}: keeping checkpoints changes the chain");
    assert!(checkpoints.len() > 1, "{what}: no checkpoints");
    let stride = checkpoints.len().div_ceil(breaks).max(1);
    for bytes in checkpoints.iter().step_by(stride).chain(checkpoints.last()) {
        let checkpoint = Checkpoint::from_bytes(bytes).unwrap_or_else(|e| panic!("{what}: {e}"));
        let (step, draws) = (checkpoint.steps(), checkpoint.draws() as usize);
        let (rest, _, other_end) = go(model, options, Some(checkpoint), false);
        assert_eq!(
            rows.len(),
            draws + rest.len(),
            "{what}: broken off at step {step}, the numbers of draws differ"
        );
        let differ = rows[draws..].iter().zip(&rest).position(|(a, b)| a != b);
        assert_eq!(
            differ, None,
            "{what}: broken off at step {step}, draw {draws}; the first that differs after it"
        );
        assert_eq!(end, other_end, "{what}: broken off at step {step}");
    }
}
