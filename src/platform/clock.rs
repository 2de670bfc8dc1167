//! The clock. Bare WebAssembly has none: time is constant there, and runs are bounded by
//! steps.

#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
mod running {
    pub(crate) use std::time::Instant;

    /// Whether time passes.
    pub(crate) const RUNS: bool = true;
}

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
mod running {
    use std::time::Duration;

    /// The only instant.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Instant;

    impl Instant {
        pub(crate) fn now() -> Instant {
            Instant
        }

        pub(crate) fn checked_sub(&self, _past: Duration) -> Option<Instant> {
            Some(Instant)
        }

        pub(crate) fn elapsed(&self) -> Duration {
            Duration::ZERO
        }
    }

    /// Whether time passes.
    pub(crate) const RUNS: bool = false;
}

pub(crate) use running::{Instant, RUNS};
