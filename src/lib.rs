//! `pcadlang`: a probabilistic CAD language. A program draws a scene from a prior; the
//! engine samples the scenes that explain a photograph.
//!
//! [`Program`] and [`Model`] are the entry points; [`trace::Trace`] is the engine's
//! central data structure; [`host`] lets a program that embeds the language register its
//! own functions, distributions, likelihoods and kernels. What `docs/reference/api.md`
//! lists follows semantic versioning and is exercised by the doc-tests; the rest is public
//! for tests and tools, and may change at any time.
//!
//! This crate holds no code: each floor below it is a crate in `crates`, and what they
//! promise is named here. The engine ([`lang`], [`trace`], [`infer`]) knows nothing of
//! pictures. The scene is its guest: [`scene`] registers the crates `pcadlang-scene` and
//! `pcadlang-detectors` through [`host`], as any embedding program would.
#![doc = include_str!("guides/program.md")]
#![doc = include_str!("guides/pictures.md")]
#![warn(missing_docs)]
#![forbid(unsafe_code)]

#[cfg(feature = "command")]
pub use pcadlang_command::command;
pub use pcadlang_detectors::{nn, people};
pub use pcadlang_engine::lang;
pub use pcadlang_library::{scene, shipped, standard};
pub use pcadlang_numerics::{dist, num, rng};
pub use pcadlang_scene::{geom, render, vision};
pub use pcadlang_syntax as syntax;
pub use pcadlang_workbench::{bank, editor, score, session, tradeoff};

pub use pcadlang_engine::lang::value::Value;
pub use pcadlang_inference::RunOptions;
pub use pcadlang_library::{Model, Posterior, Program};
pub use pcadlang_scene::render::Camera;
pub use pcadlang_syntax::diag::Error;

/// Error messages with the place of the mistake.
#[doc = include_str!("guides/diag.md")]
pub mod diag {
    pub use pcadlang_syntax::diag::*;
}

/// How a program that embeds the language registers what it brings.
#[doc = include_str!("guides/host.md")]
pub mod host {
    pub use pcadlang_inference::host::*;
}

/// Kernels, plans, chains and diagnostics.
#[doc = include_str!("guides/infer.md")]
pub mod infer {
    pub use pcadlang_inference::*;
}

/// What a run leaves: draws, tables, files, pictures, pages.
#[doc = include_str!("guides/report.md")]
pub mod report {
    pub use pcadlang_report::*;
}

/// Executions of a program: choices by address, scores, updates, gradients.
#[doc = include_str!("guides/trace.md")]
pub mod trace {
    pub use pcadlang_engine::trace::*;
}
