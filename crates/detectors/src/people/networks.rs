//! The networks with which this process detects people: those included in the program,
//! unless others were chosen.

use super::PeopleFinder;
use crate::shared::Shared;
use std::sync::{Arc, OnceLock};

/// `None` for the included ones.
static CHOSEN: OnceLock<Option<Arc<PeopleFinder>>> = OnceLock::new();
static INCLUDED: Shared<PeopleFinder> = Shared::new();

/// Chooses the networks of this process; returns false if they were already chosen or
/// used.
pub fn choose(finder: PeopleFinder) -> bool {
    CHOSEN.set(Some(Arc::new(finder))).is_ok()
}

/// Returns the networks of this process. The included ones are read if nobody has them.
///
/// # Errors
/// If the included ones cannot be read.
pub fn finder() -> Result<Arc<PeopleFinder>, String> {
    match CHOSEN.get_or_init(|| None) {
        Some(chosen) => Ok(Arc::clone(chosen)),
        None => INCLUDED.get(shipped),
    }
}

/// The files of the included detection and landmark networks.
pub fn files() -> (&'static [u8], &'static [u8]) {
    (crate::weights::DETECTION, crate::weights::LANDMARKS)
}

fn shipped() -> Result<PeopleFinder, String> {
    let (detection, landmarks) = files();
    PeopleFinder::new(detection, landmarks).map_err(|e| e.to_string())
}
