//! Embedding: a program compiled with its data, run to a posterior, in a few calls.

mod edited;
mod program;
mod started;

pub use pcadlang_syntax::diag::Error;
pub use program::Program;
pub use started::Started;

use pcadlang_engine::lang::code::Code;
use pcadlang_engine::lang::error::FaultKind;
use pcadlang_engine::lang::lower::{Compiled, Export, Report, compile_plan};
use pcadlang_engine::lang::missing::Missing;
use pcadlang_engine::lang::plan::Plan;
use pcadlang_engine::lang::reach::Reach;
use pcadlang_engine::trace::{Draws, Limits, Trace};
use pcadlang_inference::draws::Sink;
use pcadlang_inference::{ChainError, ChainResult, Progress, RunOptions, default_plan, run_chains};
use pcadlang_numerics::platform::clock;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::{ChainDraws, Memory, Quantity, quantities};
use pcadlang_syntax::ast::ItemKind;
use pcadlang_syntax::diag::{Diagnostic, Severity, SourceMap};
use pcadlang_syntax::parse;
use std::sync::{Arc, OnceLock};

/// A compiled program with its data.
#[derive(Debug)]
pub struct Model {
    compiled: Compiled,
    sources: SourceMap,
    text: String,
    hash: String,
    source_hash: String,
    data_hash: String,
    reach: Reach,
    limits: Limits,
    /// The default plan and its text, once they have been made.
    default_plan: OnceLock<(Arc<Plan>, String)>,
}

impl Model {
    /// Compiles a program from its text, with default parameters and data.
    ///
    /// # Errors
    /// All errors in the program.
    pub fn from_text(text: &str) -> Result<Model, Error> {
        Program::parse(text)?.compile()
    }

    /// Returns the lowered program, for work on [traces](pcadlang_engine::trace).
    pub fn code(&self) -> &Arc<Code> {
        &self.compiled.code
    }

    /// Returns a hash of the program's text and settings.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// Returns a hash of the program's text and of the files that it includes.
    #[doc(hidden)]
    pub fn source_hash(&self) -> &str {
        &self.source_hash
    }

    /// Returns a hash of the files that the program itself reads: the defaults of its
    /// `data` items.
    pub fn data_hash(&self) -> &str {
        &self.data_hash
    }

    /// Returns what is suspicious in the program, and its sources.
    #[doc(hidden)]
    pub fn warnings(&self) -> (&SourceMap, &[Diagnostic]) {
        (&self.sources, &self.compiled.warnings)
    }

    /// Returns the text of the main file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the folders that the program may read while it runs.
    #[doc(hidden)]
    pub fn reach(&self) -> &Reach {
        &self.reach
    }

    /// Returns the limits for evaluations outside of runs.
    #[doc(hidden)]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Returns the source texts that errors refer to.
    pub fn sources(&self) -> &SourceMap {
        &self.sources
    }

    /// Returns the program's exports.
    #[doc(hidden)]
    pub fn exports(&self) -> &[Export] {
        &self.compiled.exports
    }

    /// Returns the program's reports.
    #[doc(hidden)]
    pub fn reports(&self) -> &[Report] {
        &self.compiled.reports
    }

    /// Draws once from the prior; observations are scored, but do not condition the draw.
    ///
    /// # Errors
    /// If the program fails.
    pub fn simulate(&self, seed: u64, index: u64) -> Result<Trace, Error> {
        let draws =
            Draws { key: StreamKey::new(seed, 0, Purpose::START), step: index, substream: 0 };
        Trace::simulate(Arc::clone(self.code()), draws, self.limits.clone())
            .map_err(|e| self.run_error(*e))
    }

    /// Checks by a draw that missing entries of data, if there are any, are not used as values.
    /// Types cannot tell: programs may ask which entries are missing.
    fn uses_no_missing_entry(&self) -> Result<(), Error> {
        if self.code().consts.iter().all(|v| Missing::first_in(v).is_none()) {
            return Ok(());
        }
        match Trace::simulate(Arc::clone(self.code()), Draws::default(), self.limits.clone()) {
            Err(e) if e.kind == FaultKind::Missing => Err(self.run_error(*e)),
            _ => Ok(()),
        }
    }

    /// Returns the inference plan: the program's first `infer` block, or the default
    /// plan. The second part is the text of the default plan, if that is used.
    ///
    /// # Errors
    /// If no draw from the prior succeeds, so that the program's choices are unknown.
    #[doc(hidden)]
    pub fn plan(&self) -> Result<(Arc<Plan>, Option<String>), Error> {
        if let Some(p) = self.compiled.plans.first() {
            return Ok((Arc::clone(p), None));
        }
        let made = |(plan, text): &(Arc<Plan>, String)| (Arc::clone(plan), Some(text.clone()));
        if let Some(known) = self.default_plan.get() {
            return Ok(made(known));
        }
        let text = default_plan(self.code(), &self.limits).map_err(|e| self.run_error(*e))?;
        let mut sources = self.sources.clone();
        let file = sources.add("<default plan>", &text);
        let (program, _) = parse(&text, file);
        let body = program.items.into_iter().find_map(|i| match i.kind {
            ItemKind::Infer { body, .. } => Some(body),
            _ => None,
        });
        let plan = compile_plan(Arc::clone(&self.code().builtins), &body.unwrap_or_default());
        Ok(made(self.default_plan.get_or_init(|| (Arc::new(plan), text))))
    }

    /// Runs chains and keeps their draws in memory. The draws depend on the seed, but not
    /// on the number of threads.
    ///
    /// # Errors
    /// If no chain can start or the program fails. Chains that cannot start while others do are
    /// named in [`Posterior::warnings`].
    pub fn run(
        &self,
        options: &RunOptions,
        chains: usize,
        threads: usize,
    ) -> Result<Posterior, Error> {
        let memories: Vec<Memory> = (0..chains.max(1)).map(|_| Memory::default()).collect();
        let sinks = memories.iter().map(|m| Box::new(m.clone()) as Box<dyn Sink>).collect();
        let results = self.run_into(options, threads, &Progress::default(), sinks)?;
        let Started { chains, places, warnings } = self.started(results)?;
        Ok(Posterior {
            draws: places.iter().map(|i| memories[*i].draws()).collect(),
            chains,
            warnings,
        })
    }

    /// Runs one chain per sink. A chain that fails does not stop the others.
    ///
    /// # Errors
    /// As [`Model::plan`], and if there is a time limit but the platform has no clock.
    pub fn run_into(
        &self,
        options: &RunOptions,
        threads: usize,
        progress: &Progress,
        sinks: Vec<Box<dyn Sink>>,
    ) -> Result<Vec<Result<ChainResult, ChainError>>, Error> {
        if options.time.is_some() && !clock::RUNS {
            let d = Diagnostic::new(
                Severity::Error,
                "this platform has no clock, so a run cannot have a time limit",
            );
            return Err(Error {
                diagnostics: vec![d.hint("limit it by `steps`")],
                sources: self.sources.clone(),
            });
        }
        let (plan, _) = self.plan()?;
        Ok(run_chains(self.code(), &plan, options, threads, progress, sinks))
    }
}

/// Draws from a posterior, and the chains that made them.
#[derive(Debug)]
pub struct Posterior {
    /// The draws of each chain.
    pub draws: Vec<ChainDraws>,
    /// The last state of each chain, its kernels and its statistics.
    pub chains: Vec<ChainResult>,
    /// Sentences on chains that found no state to start from and are left out, and on those that
    /// started without what `force` sets.
    pub warnings: Vec<String>,
}

impl Posterior {
    /// Returns every scalar quantity with its summary; elements of vectors are named
    /// `name[i]`.
    pub fn quantities(&self) -> Vec<Quantity> {
        quantities(&self.draws)
    }

    /// Returns the quantity with this name.
    pub fn quantity(&self, name: &str) -> Option<Quantity> {
        self.quantities().into_iter().find(|q| q.name == name)
    }

    /// Returns the draws of every scalar quantity, with those of all chains concatenated.
    pub fn scalars(&self) -> Vec<(String, Vec<f64>)> {
        self.quantities().into_iter().map(|q| (q.name, q.chains.concat())).collect()
    }
}
