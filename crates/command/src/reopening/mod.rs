//! Runs that have ended: shown, compared, reported.

pub(crate) mod compare;
pub(crate) mod date;
pub(crate) mod film;
pub(crate) mod page;
pub(crate) mod reopened;
pub(crate) mod report;
pub(crate) mod seen;
pub(crate) mod show;
