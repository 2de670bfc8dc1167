//! Programs: checked, formatted, explained, documented.

pub(in crate::cli) mod calibrate;
pub(in crate::cli) mod check;
pub(in crate::cli) mod doc;
pub(in crate::cli) mod explain;
pub(in crate::cli) mod fmt;
pub(in crate::cli) mod predict;
pub(in crate::cli) mod watch;
