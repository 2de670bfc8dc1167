//! The best outline that is symmetric about an axis, by dynamic programming over rows across
//! the axis: exact for what is on the strip.
//!
//! An outline has a half-width in each row from its first to its last. It gains what is
//! inside, the edges along both sides in the direction of their slope, and the edges along
//! its flat ends. It pays for changes of the slope, up to a bound: a price on the slope alone
//! makes teeth.

use pcadlang_numerics::num::simd::vectorised;

/// The steepest slope, cells of half-width per row, and the number of slopes.
pub const STEEPEST: usize = 6;
pub const SLOPES: usize = 2 * STEEPEST + 1;
/// The least half-width, cells.
pub const LEAST: usize = 2;
/// What is impossible gains this.
const NEVER: f32 = -1e9;

/// The prices of an outline's slopes, nats.
#[derive(Clone, Copy)]
pub struct Prices {
    /// Per unit of slope and row.
    pub slope: f32,
    /// Per unit of change of the slope, and the most for a change.
    pub change: f32,
    pub most: f32,
}

/// Evidence in cells of rows across an axis, row by row.
pub struct Strip {
    pub rows: usize,
    pub columns: usize,
    /// Sums of what the cells of a row before each column gain on a flat end: one entry more per
    /// row than there are columns.
    pub ends: Vec<f32>,
    /// What a side gains per row, by its slope to the right, row and column. That of a left side
    /// is the reverse of the outline's.
    pub sides: Vec<f32>,
}

/// An outline: half-widths from a first row on.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// What it gains, nats.
    pub score: f32,
    pub first: usize,
    pub widths: Vec<usize>,
}

/// Memory for the scores of outlines.
#[derive(Default)]
pub struct Table {
    /// The best score of outlines that reach a row with a slope and a half-width; the last of
    /// the slopes is for those that begin there.
    best: Vec<f32>,
    /// What the last row allows to go on with, by slope and half-width.
    before: Vec<f32>,
    /// What a row gains by half-width: as a flat end, inside, and as the end after it; and the
    /// best score in it.
    spans: [Vec<f32>; 4],
}

/// States per half-width: the slopes, and the beginning.
const STATES: usize = SLOPES + 1;

impl Strip {
    /// Returns the best outline about the axis in a column, with half-widths of at most
    /// `widest` cells; `None` if the strip has no room for any. `inside` is what cells gain inside
    /// it, in sums like those of ends.
    pub fn outline(
        &self,
        inside: &[f32],
        axis: usize,
        widest: usize,
        prices: &Prices,
        table: &mut Table,
    ) -> Option<Outline> {
        let room = axis.checked_sub(2)?.min(self.columns.checked_sub(axis + 3)?);
        let widest = widest.min(room);
        if widest < LEAST || self.rows < 3 {
            return None;
        }
        let stride = widest + 1;
        table.best.clear();
        table.best.resize(self.rows * STATES * stride, NEVER);
        table.before.clear();
        table.before.resize(SLOPES * stride, NEVER);
        table.spans.iter_mut().for_each(|s| s.resize(stride, NEVER));
        let (mut best, mut end) = (NEVER, (0, 0, 0));
        for t in 1..self.rows - 1 {
            let Table { best: scores, before, spans: [begin, within, after, most] } = &mut *table;
            let (done, rest) = scores.split_at_mut(t * STATES * stride);
            let row = &mut rest[..STATES * stride];
            vectorised(
                #[inline(always)]
                || {
                    if t > 1 {
                        ways_on(&done[(t - 1) * STATES * stride..], stride, prices, before);
                        self.continued(axis, t, stride, prices.slope, before, row);
                    }
                    self.spans(&self.ends, axis, t, begin);
                    self.spans(inside, axis, t, within);
                    self.spans(&self.ends, axis, t + 1, after);
                    row[SLOPES * stride..].copy_from_slice(begin);
                    most.fill(NEVER);
                    for scores in row.chunks_exact_mut(stride) {
                        let gained = scores.iter_mut().zip(&*within).zip(&mut *most);
                        for ((score, within), most) in gained {
                            *score += within;
                            *most = most.max(*score);
                        }
                    }
                    most.iter_mut().zip(&*after).for_each(|(most, after)| *most += after);
                },
            );
            let highest = most[LEAST..].iter().fold(NEVER, |a, b| a.max(*b));
            if highest > best {
                let is_highest = |i: &usize| row[*i] + after[i % stride] == highest;
                let found = (0..row.len()).filter(|i| i % stride >= LEAST).find(is_highest);
                (best, end) = (highest, found.map_or(end, |i| (t, i / stride, i % stride)));
            }
        }
        let (first, widths) = self.traced(end, stride, prices, &table.best);
        Some(Outline { score: best, first, widths })
    }

    /// Fills in for each half-width what a row gains, by its sums before each column.
    #[inline(always)]
    fn spans(&self, sums: &[f32], axis: usize, row: usize, out: &mut [f32]) {
        let sums = &sums[row * (self.columns + 1)..];
        let (left, right) = (&sums[axis + 1 - out.len()..][..out.len()], &sums[axis + 1..]);
        for ((out, left), right) in out.iter_mut().zip(left.iter().rev()).zip(right) {
            *out = right - left;
        }
    }

    /// Fills in the scores of outlines that go on in a row, without what is inside it.
    #[inline(always)]
    fn continued(
        &self,
        axis: usize,
        t: usize,
        stride: usize,
        price: f32,
        before: &[f32],
        row: &mut [f32],
    ) {
        for m in 0..SLOPES {
            let slope = m as isize - STEEPEST as isize;
            let price = price * slope.unsigned_abs() as f32;
            // The half-widths that both rows have, and the middle between them.
            let first = (LEAST as isize + slope.max(0)) as usize;
            let last = (stride as isize + slope.min(0)).max(first as isize) as usize;
            let from = (first as isize - slope) as usize;
            let middle = (2 * first as isize - slope).div_euclid(2) as usize;
            let count = last - first;
            let side = |m: usize| &self.sides[(m * self.rows + t) * self.columns..];
            let right = &side(m)[axis + middle..][..count];
            let left = &side(SLOPES - 1 - m)[axis + 1 - middle - count..][..count];
            let before = &before[m * stride + from..][..count];
            let scores = &mut row[m * stride + first..][..count];
            for i in 0..count {
                scores[i] = before[i] + right[i] + left[count - 1 - i] - price;
            }
        }
    }

    /// Follows the best outline back from its last row, by state and half-width there.
    fn traced(
        &self,
        (mut t, mut m, mut w): (usize, usize, usize),
        stride: usize,
        prices: &Prices,
        best: &[f32],
    ) -> (usize, Vec<usize>) {
        let mut widths = vec![w];
        while m < SLOPES {
            (t, w) = (t - 1, w + STEEPEST - m);
            widths.push(w);
            let score = |k: usize| best[(t * STATES + k) * stride + w] - prices.of(k, m);
            m = (0..STATES).fold(SLOPES, |b, k| if score(k) > score(b) { k } else { b });
        }
        widths.reverse();
        (t, widths)
    }
}

impl Prices {
    /// The price of going from one slope to another; free at the beginning.
    fn of(&self, from: usize, to: usize) -> f32 {
        if from == SLOPES { 0.0 } else { (self.change * from.abs_diff(to) as f32).min(self.most) }
    }
}

/// Returns for each slope and half-width the best score of the last row, less the price of
/// the change to that slope. Prices grow in proportion to the change up to a bound, so two
/// passes over the slopes suffice (Felzenszwalb & Huttenlocher 2012, "Distance transforms of
/// sampled functions", Theory of Computing 8, 415-428).
#[inline(always)]
fn ways_on(last: &[f32], stride: usize, prices: &Prices, before: &mut [f32]) {
    let (slopes, begun) = last.split_at(SLOPES * stride);
    before.copy_from_slice(slopes);
    let change = prices.change;
    for m in 1..SLOPES {
        let (less, more) = before.split_at_mut(m * stride);
        let less = &less[(m - 1) * stride..];
        for (x, y) in more[..stride].iter_mut().zip(less) {
            *x = x.max(y - change);
        }
    }
    for m in (1..SLOPES).rev() {
        let (less, more) = before.split_at_mut(m * stride);
        let less = &mut less[(m - 1) * stride..];
        for (x, y) in less.iter_mut().zip(&more[..stride]) {
            *x = x.max(y - change);
        }
    }
    for start in (0..stride).step_by(16) {
        let end = (start + 16).min(stride);
        let mut most = [NEVER; 16];
        let most = &mut most[..end - start];
        for (x, b) in most.iter_mut().zip(&begun[start..end]) {
            *x = *b;
        }
        for m in 0..SLOPES {
            for (x, s) in most.iter_mut().zip(&slopes[m * stride + start..m * stride + end]) {
                *x = x.max(s - prices.most);
            }
        }
        for m in 0..SLOPES {
            for (x, s) in before[m * stride + start..m * stride + end].iter_mut().zip(&*most) {
                *x = x.max(*s);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::testing::numbers;

    const ROWS: usize = 6;
    const COLUMNS: usize = 27;
    const AXIS: usize = 13;
    const PRICES: Prices = Prices { slope: 0.1, change: 0.3, most: 1.5 };

    /// A strip of random gains and what is inside, as sums, and both by cell.
    fn strip(seed: u64) -> (Strip, Vec<f32>, [Vec<f32>; 2]) {
        let mut next = numbers(seed);
        let mut list =
            |n: usize, scale: f32| -> Vec<f32> { (0..n).map(|_| scale * (next() - 0.5)).collect() };
        let (inside, ends) = (list(ROWS * COLUMNS, 0.5), list(ROWS * COLUMNS, 1.0));
        let sides = list(SLOPES * ROWS * COLUMNS, 6.0);
        let sums = |cells: &[f32]| -> Vec<f32> {
            let row = |row: &[f32]| -> Vec<f32> {
                (0..=COLUMNS).map(|n| row[..n].iter().sum()).collect()
            };
            cells.chunks(COLUMNS).flat_map(row).collect()
        };
        let strip = Strip { rows: ROWS, columns: COLUMNS, ends: sums(&ends), sides };
        (strip, sums(&inside), [inside, ends])
    }

    /// What an outline gains, cell by cell.
    fn gain(strip: &Strip, inside: &[f32], ends: &[f32], first: usize, widths: &[usize]) -> f32 {
        let row = |cells: &[f32], t: usize, w: usize| -> f32 {
            cells[t * COLUMNS + AXIS - w..=t * COLUMNS + AXIS + w].iter().sum()
        };
        let last = first + widths.len() - 1;
        let mut sum = row(ends, first, widths[0]) + row(ends, last + 1, widths[widths.len() - 1]);
        let mut before: Option<isize> = None;
        for (i, w) in widths.iter().enumerate() {
            sum += row(inside, first + i, *w);
            if i == 0 {
                continue;
            }
            let slope = *w as isize - widths[i - 1] as isize;
            if slope.unsigned_abs() > STEEPEST {
                return f32::NEG_INFINITY;
            }
            let middle = (w + widths[i - 1]) / 2;
            let side = |slope: isize, column: usize| {
                let m = (slope + STEEPEST as isize) as usize;
                strip.sides[(m * ROWS + first + i) * COLUMNS + column]
            };
            sum += side(slope, AXIS + middle) + side(-slope, AXIS - middle);
            sum -= PRICES.slope * slope.unsigned_abs() as f32;
            if let Some(before) = before {
                sum -= (PRICES.change * slope.abs_diff(before) as f32).min(PRICES.most);
            }
            before = Some(slope);
        }
        sum
    }

    #[test]
    fn no_outline_gains_more() {
        const WIDEST: usize = 10;
        let mut table = Table::default();
        for seed in 0..30 {
            let (strip, sums, [inside, ends]) = strip(seed);
            let found = strip.outline(&sums, AXIS, WIDEST, &PRICES, &mut table).unwrap();
            let own = gain(&strip, &inside, &ends, found.first, &found.widths);
            assert!((found.score - own).abs() < 1e-3, "{} is {own}", found.score);
            let mut best = f32::NEG_INFINITY;
            for first in 1..ROWS - 1 {
                for rows in 1..ROWS - first {
                    let mut widths = vec![LEAST; rows];
                    loop {
                        best = best.max(gain(&strip, &inside, &ends, first, &widths));
                        let Some(i) = widths.iter().position(|w| *w < WIDEST) else { break };
                        widths[i] += 1;
                        widths[..i].fill(LEAST);
                    }
                }
            }
            assert!((found.score - best).abs() < 1e-3, "{} instead of {best}", found.score);
        }
    }

    #[test]
    fn without_room_there_is_no_outline() {
        let (strip, sums, _) = strip(1);
        let mut table = Table::default();
        for (axis, widest) in [(0, 10), (3, 10), (COLUMNS - 4, 10), (COLUMNS, 10), (AXIS, 1)] {
            let found = strip.outline(&sums, axis, widest, &PRICES, &mut table);
            assert_eq!(found, None, "{axis} {widest}");
        }
    }
}
