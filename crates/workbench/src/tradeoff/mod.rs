//! The trade-off between speed and accuracy: settings to try, their runs, selection by
//! successive halving, the front, and the presets chosen from it.
//!
//! This module works on numbers and text only: the command performs the runs and compares
//! them with the ground truth.

mod halving;
mod interval;
mod plot;
mod presets;
mod rows;
mod runs;
mod setting;

pub use halving::{Round, rounds, survivors};
pub use interval::{Interval, mean_interval};
pub use plot::plot;
pub use presets::{Choice, Preset, Presets, Quality};
pub use rows::{Row, front, rows, to_csv};
pub use runs::{Mark, RunRecord, marks};
pub use setting::{Plan, PlanError, Setting};
