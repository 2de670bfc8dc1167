//! Programs: checked, formatted, explained, documented.

pub(crate) mod calibrate;
pub(crate) mod check;
pub(crate) mod doc;
pub(crate) mod explain;
pub(crate) mod fmt;
pub(crate) mod predict;
pub(crate) mod watch;
