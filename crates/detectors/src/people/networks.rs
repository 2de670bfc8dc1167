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
/// If none were chosen, and none are included in the program (feature `models`).
pub fn finder() -> Result<&'static PeopleFinder, &'static str> {
    CHOSEN.get_or_init(shipped).as_ref().map_err(String::as_str)
}

/// The files of the included detection and landmark networks.
#[cfg(feature = "weights")]
pub fn files() -> Result<(&'static [u8], &'static [u8]), String> {
    Ok((crate::weights::DETECTION, crate::weights::LANDMARKS))
}

/// Explains why no networks are included.
#[cfg(not(feature = "weights"))]
pub fn files() -> Result<(&'static [u8], &'static [u8]), String> {
    Err("this build does not include the networks that detect people (feature `models`): give a \
         folder with them, --models DIR"
        .into())
}

fn shipped() -> Result<PeopleFinder, String> {
    let (detection, landmarks) = files()?;
    PeopleFinder::new(detection, landmarks).map_err(|e| e.to_string())
}
