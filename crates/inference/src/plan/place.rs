//! The position of a chain in its plan, as nested statements: what a checkpoint needs to
//! resume there.

use super::super::kernel::Outcome;
use super::super::plain::Plain;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A statement of a body that is being run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanPosition {
    /// Its index in the body.
    pub statement: usize,
    /// The number of variables when it began.
    pub depth: usize,
    /// How far it has got.
    #[serde(rename = "doing")]
    pub point: ResumePoint,
}

impl PlanPosition {
    /// The largest of its counts.
    pub fn most(&self) -> u64 {
        match &self.point {
            ResumePoint::Loop { pass, of, first } => (*pass).max(*of).max(*first),
            ResumePoint::Kernel { steps, .. } => *steps as u64,
            _ => 0,
        }
    }
}

/// How far a statement has got.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) enum ResumePoint {
    /// It is at its beginning.
    #[default]
    Begins,
    /// A loop, in one of its passes.
    Loop {
        /// The pass, from 0.
        pass: u64,
        /// The number of passes.
        of: u64,
        /// The step of the chain at which the loop began.
        first: u64,
    },
    /// A loop over items, at one of them.
    Items {
        /// The item, from 0.
        item: usize,
        /// All items; `None` if they are not all plain data.
        all: Option<Arc<[Plain]>>,
    },
    /// A kernel, before, between or after its steps.
    Kernel {
        /// The index of its arm, if it is in a `mix`.
        arm: Option<usize>,
        /// The number of steps made.
        steps: usize,
        /// The address hash of the choice that its sweep has visited last.
        after: Option<u64>,
        /// The outcome of its steps.
        done: Outcome,
    },
}
