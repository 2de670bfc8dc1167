//! The parts that differ between platforms and builds: the clock and threads.

pub mod clock;
pub mod threads;
