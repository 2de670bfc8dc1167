//! `pcadlang`: a probabilistic CAD language. A program draws a scene from a prior; the
//! engine samples the scenes that explain a photograph.
//!
//! [`Program`] and [`Model`] are the entry points; [`trace::Trace`] is the engine's
//! central data structure; [`host`] lets a program that embeds the language register its
//! own functions, distributions, likelihoods and kernels. What `docs/reference/api.md`
//! lists follows semantic versioning and is exercised by the doc-tests; the rest is public
//! for tests and tools, and may change at any time.
//!
//! The engine ([`lang`], [`trace`], [`infer`]) knows nothing of pictures. The scene is its
//! guest: [`scene`] registers the crates `pcadlang-scene` and `pcadlang-detectors` through
//! [`host`], as any embedding program would. Without the feature `scene` the engine is
//! built alone.
#![doc = include_str!("guide.md")]
#![doc = include_str!("pictures.md")]
#![warn(missing_docs)]
#![forbid(unsafe_code)]

#[cfg(feature = "scene")]
pub mod bank;
#[cfg(feature = "cli")]
mod cli;
pub mod diag;
pub mod editor;
pub mod host;
pub mod infer;
pub mod lang;
mod model;
pub mod report;
#[cfg(feature = "scene")]
pub mod scene;
pub mod score;
#[cfg(feature = "scene")]
pub mod session;
pub mod standard;
pub mod syntax;
pub mod trace;
pub mod tradeoff;

// The modules of the command are written as those of a program that uses this library.
#[cfg(feature = "cli")]
extern crate self as pcadlang;

#[doc(hidden)]
#[cfg(feature = "cli")]
pub use cli::command;
#[doc(no_inline)]
#[cfg(feature = "scene")]
pub use pcadlang_detectors::{nn, people};
use pcadlang_numerics::platform;
pub use pcadlang_numerics::{dist, num, rng};
#[doc(no_inline)]
#[cfg(feature = "scene")]
pub use pcadlang_scene::{geom, render, vision};

pub use infer::RunOptions;
#[doc(inline)]
pub use lang::value::Value;
pub use model::{Error, Model, Posterior, Program};
#[cfg(feature = "scene")]
#[doc(inline)]
pub use render::Camera;
