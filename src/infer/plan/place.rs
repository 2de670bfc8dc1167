//! Where in a plan a chain is, statement within statement: what it takes to leave and to
//! come back.

use super::super::kernel::Outcome;
use super::super::plain::Plain;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A statement of a body that is being run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Place {
    /// Which one.
    pub statement: usize,
    /// How many variables there were when it began.
    pub depth: usize,
    /// How far it is.
    pub doing: Doing,
}

impl Place {
    /// The largest of its counts.
    pub fn most(&self) -> u64 {
        match &self.doing {
            Doing::Loop { pass, of, first } => (*pass).max(*of).max(*first),
            Doing::Kernel { steps, .. } => *steps as u64,
            _ => 0,
        }
    }
}

/// How far a statement is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) enum Doing {
    /// It begins.
    #[default]
    Begins,
    /// A loop is at a pass.
    Loop {
        /// The pass, from 0.
        pass: u64,
        /// Of so many.
        of: u64,
        /// The step of the chain at which the loop began.
        first: u64,
    },
    /// A loop over items is at one of them.
    Items {
        /// The item, from 0.
        item: usize,
        /// All of them; `None` if they are more than plain data.
        all: Option<Arc<[Plain]>>,
    },
    /// A kernel has made some of its steps.
    Kernel {
        /// The arm of a `mix` that it is.
        arm: Option<usize>,
        /// So many.
        steps: usize,
        /// What they did.
        done: Outcome,
    },
}
