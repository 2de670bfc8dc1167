//! The clock. Bare WebAssembly has none: time is constant there, and runs are bounded by
//! steps.

#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
mod running {
    pub use std::time::Instant;

    /// True if the clock runs.
    pub const RUNS: bool = true;
}

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
mod running {
    use std::time::Duration;

    /// The only instant.
    #[derive(Clone, Copy, Debug)]
    pub struct Instant;

    impl Instant {
        pub fn now() -> Instant {
            Instant
        }

        pub fn checked_add(&self, _time: Duration) -> Option<Instant> {
            Some(Instant)
        }

        pub fn checked_sub(&self, _past: Duration) -> Option<Instant> {
            Some(Instant)
        }

        pub fn elapsed(&self) -> Duration {
            Duration::ZERO
        }
    }

    /// True if the clock runs.
    pub const RUNS: bool = false;
}

pub use running::{Instant, RUNS};
