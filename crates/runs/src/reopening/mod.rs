//! Runs that have ended: shown, compared, reported.

pub mod compare;
pub mod film;
pub mod page;
pub mod reopened;
pub mod seen;
pub mod show;
