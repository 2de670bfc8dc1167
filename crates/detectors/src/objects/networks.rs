//! The network with which this process detects objects: the one included in the program.

use super::ObjectFinder;
use crate::shared::Shared;
use std::sync::Arc;

static INCLUDED: Shared<ObjectFinder> = Shared::new();

/// Returns the network of this process, which is read if nobody has it.
///
/// # Errors
/// If the included one cannot be read.
pub fn finder() -> Result<Arc<ObjectFinder>, String> {
    INCLUDED.get(|| {
        let (model, weights) = (pcadlang_nanodet::MODEL, pcadlang_nanodet::WEIGHTS);
        ObjectFinder::new(model, weights).map_err(|e| e.to_string())
    })
}
