//! The crates apart that features of this package add to every program.

use pcadlang_inference::host::Host;
use pcadlang_library::standard;
use pcadlang_syntax::diag::Error;

/// Registers them. Once more changes nothing.
pub fn register() -> Result<(), Error> {
    let guests: &[Host] = &[
        #[cfg(feature = "autorig")]
        pcadlang_autorig::host(),
        #[cfg(feature = "contour_detectors")]
        pcadlang_contour_detectors::host(),
    ];
    guests.iter().try_for_each(standard::register)
}
