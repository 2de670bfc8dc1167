//! Where the edges of a triangle cross rows of pixels, in integers and without a division
//! for each row.

use std::cmp::Ordering;

/// Integers of some width.
pub(in crate::render) trait Int:
    Copy
    + Ord
    + From<i32>
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
{
    /// The quotient by a positive number, rounded down, and the remainder.
    fn divided(self, by: Self) -> (Self, Self);

    /// Converts to an index; the number must be a valid one.
    fn index(self) -> usize;
}

macro_rules! int {
    ($($name:ty),*) => {$(
        impl Int for $name {
            fn divided(self, by: Self) -> (Self, Self) {
                (self.div_euclid(by), self.rem_euclid(by))
            }

            fn index(self) -> usize {
                self as usize
            }
        }
    )*};
}

int!(i32, i64, i128);

/// Where an edge crosses a row, kept as quotient and remainder so that rows need no
/// division.
pub(in crate::render) struct Crossing<N> {
    /// Which side is inside: the right (1), the left (-1), or the whole row or none of it
    /// (0).
    side: i32,
    /// The edge function where the row begins, divided by the magnitude of its change per
    /// column, which is `by`.
    at: (N, N),
    per_row: (N, N),
    by: N,
}

impl<N: Int> Crossing<N> {
    /// From an edge function: value where the first row begins, change per column, change
    /// per row.
    pub fn new([at, by_column, by_row]: [N; 3]) -> Crossing<N> {
        let zero = N::from(0);
        let (side, by) = match by_column.cmp(&zero) {
            Ordering::Greater => (1, by_column),
            Ordering::Less => (-1, zero - by_column),
            Ordering::Equal => (0, N::from(1)),
        };
        Crossing { side, at: at.divided(by), per_row: by_row.divided(by), by }
    }

    /// Narrows a row's columns to those inside, and advances to the next row.
    pub fn narrow(&mut self, from: &mut N, to: &mut N) {
        let (zero, one) = (N::from(0), N::from(1));
        match self.side {
            // Inside are columns c with at + c * by >= 0.
            1 => *from = (*from).max(zero - self.at.0),
            -1 => *to = (*to).min(self.at.0 + one),
            _ if self.at.0 < zero => *to = *from,
            _ => {}
        }
        self.at = (self.at.0 + self.per_row.0, self.at.1 + self.per_row.1);
        if self.at.1 >= self.by {
            self.at = (self.at.0 + one, self.at.1 - self.by);
        }
    }
}
