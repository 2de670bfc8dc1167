//! What speed costs in accuracy: settings to try, the runs of them, which are kept, the
//! front, and the presets chosen from it.
//!
//! Numbers and text only: the runs themselves, and the truth they are compared with, are
//! the command's business.

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
