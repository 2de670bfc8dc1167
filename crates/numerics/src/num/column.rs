//! Views of numbers in a buffer that is held elsewhere.

/// A view of a buffer: consecutive numbers, or one number that is repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// The index of the first number.
    pub at: usize,
    /// The stride: 1, or 0 for a repeated number.
    pub step: usize,
    /// True if derivatives with respect to the numbers are needed.
    pub live: bool,
}

impl Column {
    /// Number `i`.
    #[inline]
    pub fn get(&self, buffer: &[f64], i: usize) -> f64 {
        buffer[self.at + i * self.step]
    }
}
