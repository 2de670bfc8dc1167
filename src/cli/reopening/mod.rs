//! Runs that have ended: shown, compared, reported.

pub(in crate::cli) mod compare;
pub(in crate::cli) mod date;
pub(in crate::cli) mod film;
pub(in crate::cli) mod page;
pub(in crate::cli) mod reopened;
pub(in crate::cli) mod report;
pub(in crate::cli) mod seen;
pub(in crate::cli) mod show;
