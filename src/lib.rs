//! `pcadlang`: a probabilistic CAD language. A program draws a scene from a prior; the
//! engine samples the scenes that explain a photograph.
//!
//! [`Program`] and [`Model`] are the entry points; [`trace::Trace`] is the engine's
//! central data structure; [`host`] lets a program that embeds the language register its
//! own functions, distributions, likelihoods and kernels. What `docs/reference/api.md`
//! lists follows semantic versioning and is exercised by the doc-tests.
//!
//! This crate holds no code: each floor below it is a crate in `crates`, and what they
//! promise to those who embed the language is named here.
#![doc = include_str!("guides/program.md")]
#![doc = include_str!("guides/pictures.md")]
#![warn(missing_docs)]
#![forbid(unsafe_code)]

#[cfg(feature = "command")]
pub use pcadlang_command::command;
pub use pcadlang_engine::lang::value::Value;
pub use pcadlang_inference::RunOptions;
pub use pcadlang_library::{Model, Posterior, Program};
pub use pcadlang_scene::render::Camera;
pub use pcadlang_syntax::diag::Error;

pub mod diag {
    //! Error messages with the place of the mistake.
    #![doc = include_str!("guides/diag.md")]

    pub use pcadlang_syntax::diag::{
        Diagnostic, IntoDiagnostic, Label, Severity, SourceFile, SourceMap, render,
    };
    pub use pcadlang_syntax::span::{FileId, Span};
}

pub mod host {
    //! How a program that embeds the language registers what it brings.
    #![doc = include_str!("guides/host.md")]

    pub use pcadlang_inference::host::*;
}

pub mod infer {
    //! Kernels, chains and what runs report while they go on.
    #![doc = include_str!("guides/infer.md")]

    pub use pcadlang_inference::{
        Block, Callback, Callbacks, ChainError, ChainResult, Checkpoint, Drift, Elliptical, Gibbs,
        Kernel, Mh, Outcome, Pick, Progress, SiteSelection, Slice, StateError, StepContext, decide,
        recoverable,
    };

    /// Where draws go, row by row.
    pub mod draws {
        pub use pcadlang_inference::draws::{Column, DrawRow, KernelStats, Sink};
    }
}

pub mod report {
    //! Results of a run: draws, quantities, folders.
    #![doc = include_str!("guides/report.md")]

    pub use pcadlang_report::{ChainDraws, Memory, Quantity, RunDir, RunDirError, Tee, quantities};

    /// Draws as CmdStan writes them.
    pub mod csv {
        pub use pcadlang_report::csv::CsvSink;
    }
}

/// Streams of random numbers, by seed, chain, purpose and place.
pub mod rng {
    pub use pcadlang_numerics::rng::{Purpose, Stream, StreamKey};
}

/// A host comparator's access to a rendered scene.
pub mod scene {
    pub use pcadlang_library::scene::SceneView;
}

pub mod trace {
    //! Executions of a program: choices by address, scores, updates, gradients.
    #![doc = include_str!("guides/trace.md")]

    pub use pcadlang_engine::trace::{
        Address, AddressSegment, Change, ChoiceKind, Constraint, Draws, Given, Limits, Observation,
        Pattern, PatternSegment, Replicate, RunError, SaveError, SavedTrace, Selection, Selector,
        Stop, Target, Trace, TraceResult, Update, Weight,
    };
}
