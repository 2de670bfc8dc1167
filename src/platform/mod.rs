//! The parts that differ between platforms and builds: the clock and threads.

pub(crate) mod clock;
pub(crate) mod threads;
