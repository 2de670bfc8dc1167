//! `pcadlang`: a probabilistic CAD language. A program draws a scene from a prior; the
//! engine samples the scenes that explain a photograph.
//!
//! [`Program`] and [`Model`] are the entry points; [`trace::Trace`] is the engine's
//! central data structure; [`host`] lets a program that embeds the language register its
//! own functions, distributions, likelihoods and kernels. The documented interface
//! follows semantic versioning, is exercised by the doc-tests, and is listed in
//! `docs/reference/api.md`; modules that are public only for tests and tools are hidden.
//!
//! Dependencies between modules are one-way: `syntax`, `dist`, `geom`, `render` and
//! `vision` do not depend on traces, and `infer` does not depend on pictures.
#![doc = include_str!("guide.md")]
#![warn(missing_docs)]
#![forbid(unsafe_code)]

#[cfg(feature = "scene")]
#[doc(hidden)]
pub mod bank;
pub mod diag;
pub mod host;
pub mod infer;
#[doc(hidden)]
pub mod lang;
mod model;
pub mod report;
#[cfg(feature = "scene")]
#[doc(hidden)]
pub mod scene;
#[doc(hidden)]
pub mod score;
#[cfg(feature = "scene")]
#[doc(hidden)]
pub mod session;
#[doc(hidden)]
pub mod standard;
#[doc(hidden)]
pub mod syntax;
pub mod trace;
#[doc(hidden)]
pub mod tradeoff;

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
