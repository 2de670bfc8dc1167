//! The state that other threads may read while the chains of a run are under way.

use crate::args::Job;
use pcadlang_inference::{BestSoFar, KeptTraces, Progress, Trajectory};
use pcadlang_library::Model;
use pcadlang_report::Memory;
use std::sync::Arc;

/// How many numbers are kept in memory for the summary, over all chains: 32 MiB.
pub const ROOM: usize = 4 << 20;

/// Shared with the chains of one run.
pub struct Watched {
    /// Steps and phase, and the means to pause or end the run.
    pub progress: Arc<Progress>,
    /// The best state so far.
    pub best: Arc<BestSoFar>,
    /// Complete states at some draws.
    pub kept: Arc<KeptTraces>,
    /// States on the way from the prior.
    pub trajectory: Arc<Trajectory>,
    /// The draws of each chain.
    pub memories: Vec<Memory>,
}

impl Watched {
    /// For a job whose run keeps `keep` complete states.
    pub fn new(job: &Job, model: &Model, keep: u32) -> Watched {
        let chains = job.sampling.chains();
        let progress = Arc::new(Progress::default());
        let room = ROOM / chains as usize;
        Watched {
            best: Arc::new(BestSoFar::new(chains, &progress)),
            kept: Arc::new(KeptTraces::new(chains, keep as usize, model.hash())),
            trajectory: Arc::new(Trajectory::new(chains, model.hash())),
            memories: (0..chains).map(|_| Memory::bounded(room)).collect(),
            progress,
        }
    }
}
