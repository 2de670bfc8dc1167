//! Runs: their inputs, chains, progress and results.

pub(in crate::cli) mod best;
pub(in crate::cli) mod embedded;
pub(in crate::cli) mod files;
pub(in crate::cli) mod inputs;
pub(in crate::cli) mod job;
pub(in crate::cli) mod keypoints;
pub(in crate::cli) mod live;
pub(in crate::cli) mod places;
pub(in crate::cli) mod progress;
pub(in crate::cli) mod quality;
pub(in crate::cli) mod ration;
pub(in crate::cli) mod ready;
pub(in crate::cli) mod resume;
pub(in crate::cli) mod run;
pub(in crate::cli) mod stream;
pub(in crate::cli) mod watched;
