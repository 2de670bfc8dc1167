//! The network with which this process detects objects: the one included in the program.

use super::ObjectFinder;
use std::sync::OnceLock;

static INCLUDED: OnceLock<Result<ObjectFinder, String>> = OnceLock::new();

/// Returns the network of this process, which is read once.
///
/// # Errors
/// If the included one cannot be read.
pub fn finder() -> Result<&'static ObjectFinder, &'static str> {
    let read = || {
        let (model, weights) = (pcadlang_nanodet::MODEL, pcadlang_nanodet::WEIGHTS);
        ObjectFinder::new(model, weights).map_err(|e| e.to_string())
    };
    INCLUDED.get_or_init(read).as_ref().map_err(String::as_str)
}
