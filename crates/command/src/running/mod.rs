//! Runs: their inputs, chains, progress and results.

pub(crate) mod best;
pub(crate) mod embedded;
pub(crate) mod files;
pub(crate) mod inputs;
pub(crate) mod job;
pub(crate) mod keypoints;
pub(crate) mod live;
pub(crate) mod places;
pub(crate) mod progress;
pub(crate) mod quality;
pub(crate) mod ration;
pub(crate) mod ready;
pub(crate) mod resume;
pub(crate) mod run;
pub(crate) mod stream;
pub(crate) mod watched;
