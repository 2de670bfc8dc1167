//! The networks that this process finds people with: those that come with the program,
//! unless others were chosen.

use super::PeopleFinder;
use std::sync::OnceLock;

static CHOSEN: OnceLock<Result<PeopleFinder, String>> = OnceLock::new();

/// Chooses the networks of this process; false if they were chosen, or used, before.
pub fn choose(finder: PeopleFinder) -> bool {
    CHOSEN.set(Ok(finder)).is_ok()
}

/// The networks of this process.
///
/// # Errors
/// If none were chosen, and none come with the program (feature `models`).
pub fn finder() -> Result<&'static PeopleFinder, &'static str> {
    CHOSEN.get_or_init(shipped).as_ref().map_err(String::as_str)
}

/// The files of a detection and of a landmark network that come with the program.
#[cfg(feature = "models")]
pub fn files() -> Result<(&'static [u8], &'static [u8]), String> {
    Ok((pcadlang_models::DETECTION, pcadlang_models::LANDMARKS))
}

/// Why there are none.
#[cfg(not(feature = "models"))]
pub fn files() -> Result<(&'static [u8], &'static [u8]), String> {
    Err("this build does not include the networks that detect people (feature `models`): give a \
         folder with them, --models DIR"
        .into())
}

fn shipped() -> Result<PeopleFinder, String> {
    let (detection, landmarks) = files()?;
    PeopleFinder::new(detection, landmarks).map_err(|e| e.to_string())
}
