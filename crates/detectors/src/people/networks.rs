//! The networks with which this process detects people: those included in the program,
//! unless others were chosen.

use super::PeopleFinder;
use std::sync::OnceLock;

static CHOSEN: OnceLock<Result<PeopleFinder, String>> = OnceLock::new();

/// Chooses the networks of this process; returns false if they were already chosen or
/// used.
pub fn choose(finder: PeopleFinder) -> bool {
    CHOSEN.set(Ok(finder)).is_ok()
}

/// Returns the networks of this process.
///
/// # Errors
/// If the included ones cannot be read.
pub fn finder() -> Result<&'static PeopleFinder, &'static str> {
    CHOSEN.get_or_init(shipped).as_ref().map_err(String::as_str)
}

/// The files of the included detection and landmark networks.
pub fn files() -> (&'static [u8], &'static [u8]) {
    (crate::weights::DETECTION, crate::weights::LANDMARKS)
}

fn shipped() -> Result<PeopleFinder, String> {
    let (detection, landmarks) = files();
    PeopleFinder::new(detection, landmarks).map_err(|e| e.to_string())
}
