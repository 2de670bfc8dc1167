//! Where numbers are in a buffer. It does not hold them.

/// Numbers of a buffer: one after the other, or one that stands for each of any number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// The place of the first.
    pub at: usize,
    /// 1, or 0 for one that stands for all.
    pub step: usize,
    /// Whether derivatives by them are wanted.
    pub live: bool,
}

impl Column {
    /// Number `i`.
    #[inline]
    pub fn get(&self, buffer: &[f64], i: usize) -> f64 {
        buffer[self.at + i * self.step]
    }
}
