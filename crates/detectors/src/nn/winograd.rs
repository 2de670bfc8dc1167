//! Convolutions by 3 x 3 windows that move pixel by pixel, with 36 products for 4 x 4 results in
//! place of 144 (Winograd 1980; Lavin and Gray 2016): of sums of a tile's 6 x 6 pixels with those
//! of the weights, which are added up over the channels, and then to results.
//!
//! Every sum is taken in a fixed order, so the bits do not depend on the processor. They differ
//! from those of the plain sum by rounding.

use super::convolution::{Convolution, ROWS, VALUES, WIDE, add_products};
use super::shape::{Clip, Size};
use pcadlang_numerics::num::simd::vectorised;

/// Pixels along a side of a tile, and results.
const SIDE: usize = 6;
const STEP: usize = 4;
/// The number of products of a tile: its pixels.
const PLACES: usize = SIDE * SIDE;
/// The least number of tiles for which weights are prepared.
const TILES: usize = 48;
const NONE: Lanes = [0.0; WIDE];

/// The most channels of an input: tiles of more would take too much memory.
const DEEPEST: usize = 512;

/// How an image is divided into tiles, and how far what belongs to one place of tiles is from the
/// next: no multiples of a power of two, which would share a few lines of the cache.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tiling {
    /// The number of tiles in a row, in all, and of those that are computed together.
    across: usize,
    all: usize,
    tiles: usize,
    /// In panels of weights.
    weights: usize,
    /// In numbers.
    seen: usize,
    /// In panels of sums.
    products: usize,
}

impl Tiling {
    /// The number of elements for weights as stored and prepared, for tiles, and for products.
    fn lens(&self) -> [usize; 3] {
        let products = PLACES * self.products * WIDE;
        [(9 + PLACES) * self.weights * WIDE, PLACES * self.seen, products]
    }

    pub fn size(&self) -> usize {
        self.lens().into_iter().sum()
    }
}

/// Some channels.
type Lanes = [f32; WIDE];

impl Convolution<'_> {
    /// True if results are computed by tiles: of windows that it is about, if channels fill lanes.
    pub fn is_tiled(&self, from: Size) -> bool {
        let shape = (self.window.size, self.window.stride) == ([3, 3], [1, 1]);
        let fills = from.channels.is_multiple_of(WIDE) && from.channels <= DEEPEST;
        shape && fills && self.channels >= WIDE
    }

    /// Divides an image.
    pub fn tiling(&self, from: Size, to: Size) -> Tiling {
        let across = to.width.div_ceil(STEP);
        let all = to.height.div_ceil(STEP) * across;
        let most = (VALUES / (PLACES * from.channels)).max(TILES).next_multiple_of(ROWS[0]);
        let tiles = most.min(all.next_multiple_of(ROWS[0]));
        Tiling {
            across,
            all,
            tiles,
            weights: from.channels + 1,
            seen: tiles * from.channels + WIDE,
            products: tiles + 1,
        }
    }

    /// Fills `out`; `memory` is for a [`Tiling`].
    pub fn run_tiled(
        &self,
        input: &[f32],
        from: Size,
        to: Size,
        memory: &mut [f32],
        out: &mut [f32],
    ) {
        let before = self.window.before(from, to);
        let apart = self.tiling(from, to);
        let Tiling { across, all, tiles, .. } = apart;
        let [weights, seen, products] = apart.lens();
        let (weights, rest) = memory.split_at_mut(weights);
        let (seen, rest) = rest.split_at_mut(seen);
        let products = &mut rest[..products];
        for start in (0..all).step_by(tiles) {
            let count = tiles.min(all - start);
            let place = |tile: usize| [tile / across, tile % across].map(|i| STEP * i);
            for k in 0..count {
                let pixels = tile_pixels(input, from, before, place(start + k));
                vectorised(
                    #[inline(always)]
                    || {
                        let out = &mut seen[k * from.channels..];
                        transform(&pixels, from.channels, out, apart.seen);
                    },
                );
            }
            for first in (0..self.channels).step_by(WIDE) {
                self.products(from, first, weights, (seen, count), &apart, products);
                vectorised(
                    #[inline(always)]
                    || {
                        let at = |k: usize| place(start + k);
                        self.results(products, (apart.products, count), first, at, to, out);
                    },
                );
            }
        }
    }

    /// Fills the products of tiles with the weights of the channels from `first` on, added up.
    fn products(
        &self,
        from: Size,
        first: usize,
        weights: &mut [f32],
        (seen, count): (&[f32], usize),
        apart: &Tiling,
        products: &mut [f32],
    ) {
        let (stored, weights) = weights.split_at_mut(9 * apart.weights * WIDE);
        let stored = stored.as_chunks_mut::<WIDE>().0;
        let weights = weights.as_chunks_mut::<WIDE>().0;
        vectorised(
            #[inline(always)]
            || {
                let depth = 9 * from.channels;
                for (tap, stored) in stored.chunks_exact_mut(apart.weights).enumerate() {
                    let part = (tap * from.channels, depth);
                    let stored = &mut stored[..from.channels];
                    self.weights.panel(part, (first, self.channels), stored);
                }
                for c in 0..from.channels {
                    let of = |i: usize, j: usize| &stored[(3 * i + j) * apart.weights + c];
                    let column = |j: usize| of_weights([of(0, j), of(1, j), of(2, j)]);
                    let columns: [[Lanes; SIDE]; 3] = core::array::from_fn(column);
                    for i in 0..SIDE {
                        let row = of_weights([&columns[0][i], &columns[1][i], &columns[2][i]]);
                        for (j, values) in row.into_iter().enumerate() {
                            weights[(SIDE * i + j) * apart.weights + c] = values;
                        }
                    }
                }
                let tile = from.channels;
                for p in 0..PLACES {
                    let weights = &weights[p * apart.weights..][..from.channels];
                    let sums = &mut products[p * apart.products * WIDE..].as_chunks_mut::<WIDE>().0;
                    for k in (0..count).step_by(ROWS[0]) {
                        let row = |r: usize| &seen[p * apart.seen + (k + r) * tile..][..tile];
                        let rows: [&[f32]; ROWS[0]] = core::array::from_fn(row);
                        let added = add_products([NONE; ROWS[0]], weights, rows);
                        sums[k..k + ROWS[0]].copy_from_slice(&added);
                    }
                }
            },
        );
    }

    /// Writes the results of tiles, in the channels from `first` on, from their products.
    #[inline(always)]
    fn results(
        &self,
        products: &[f32],
        (tiles, count): (usize, usize),
        first: usize,
        place: impl Fn(usize) -> [usize; 2],
        to: Size,
        out: &mut [f32],
    ) {
        let width = WIDE.min(self.channels - first);
        let products = products.as_chunks::<WIDE>().0;
        let Some(biases) = self.biases[first..].first_chunk::<WIDE>() else { return };
        let Clip { lo, hi } = self.clip;
        for k in 0..count {
            let [row, column] = place(k);
            let of = |i: usize, j: usize| &products[(SIDE * i + j) * tiles + k];
            let along = |j: usize| of_products(core::array::from_fn(|i| of(i, j)));
            let columns: [[Lanes; STEP]; SIDE] = core::array::from_fn(along);
            for i in 0..STEP {
                let sums = of_products(core::array::from_fn(|j| &columns[j][i]));
                for (j, mut sums) in sums.into_iter().enumerate() {
                    if row + i >= to.height || column + j >= to.width {
                        continue;
                    }
                    for (s, b) in sums.iter_mut().zip(biases) {
                        let sum = *s + b;
                        *s = sum.max(self.slope * sum).max(lo).min(hi);
                    }
                    let at = ((row + i) * to.width + column + j) * to.channels + first;
                    out[at..at + width].copy_from_slice(&sums[..width]);
                }
            }
        }
    }
}

/// Returns the pixels of an input of which the results from `(row, column)` on are sums; empty
/// ones outside the image.
fn tile_pixels(
    input: &[f32],
    from: Size,
    before: [usize; 2],
    [row, column]: [usize; 2],
) -> [&[f32]; PLACES] {
    core::array::from_fn(|i| {
        let at = |start: usize, by: usize, before: usize, n: usize| {
            (start + by).checked_sub(before).filter(|x| *x < n)
        };
        let y = at(row, i / SIDE, before[0], from.height);
        let x = at(column, i % SIDE, before[1], from.width);
        y.zip(x).map_or(&[][..], |(y, x)| from.pixel(input, y, x))
    })
}

/// Writes the sums of a tile's pixels at intervals of `step`, channel by channel: along its
/// columns, then along its rows.
#[inline(always)]
fn transform(pixels: &[&[f32]; PLACES], channels: usize, out: &mut [f32], step: usize) {
    for c in (0..channels).step_by(WIDE) {
        let of = |i: usize, j: usize| {
            pixels[SIDE * i + j].get(c..).and_then(|p| p.first_chunk()).unwrap_or(&NONE)
        };
        let column = |j: usize| of_pixels(core::array::from_fn(|i| of(i, j)));
        let columns: [[Lanes; SIDE]; SIDE] = core::array::from_fn(column);
        for i in 0..SIDE {
            let row = of_pixels(core::array::from_fn(|j| &columns[j][i]));
            for (j, values) in row.iter().enumerate() {
                out[(SIDE * i + j) * step + c..][..WIDE].copy_from_slice(values);
            }
        }
    }
}

/// The sums of a line of pixels.
#[inline(always)]
fn of_pixels([a, b, c, d, e, f]: [&Lanes; SIDE]) -> [Lanes; SIDE] {
    let mut out = [NONE; SIDE];
    for j in 0..WIDE {
        let (near, far) = (d[j] - b[j], e[j] - c[j]);
        out[0][j] = 4.0 * a[j] - 5.0 * c[j] + e[j];
        out[1][j] = (d[j] + e[j]) - 4.0 * (b[j] + c[j]);
        out[2][j] = (e[j] - d[j]) + 4.0 * (b[j] - c[j]);
        out[3][j] = far + 2.0 * near;
        out[4][j] = far - 2.0 * near;
        out[5][j] = 4.0 * b[j] - 5.0 * d[j] + f[j];
    }
    out
}

/// The sums of a line of weights.
#[inline(always)]
fn of_weights([a, b, c]: [&Lanes; 3]) -> [Lanes; SIDE] {
    let mut out = [*a, NONE, NONE, NONE, NONE, *c];
    for j in 0..WIDE {
        let (outer, weighted) = (a[j] + c[j], a[j] + 4.0 * c[j]);
        out[0][j] = a[j] * (1.0 / 4.0);
        out[1][j] = (outer + b[j]) * (-1.0 / 6.0);
        out[2][j] = (outer - b[j]) * (-1.0 / 6.0);
        out[3][j] = (weighted + 2.0 * b[j]) * (1.0 / 24.0);
        out[4][j] = (weighted - 2.0 * b[j]) * (1.0 / 24.0);
    }
    out
}

/// The results of a line of products.
#[inline(always)]
fn of_products([a, b, c, d, e, f]: [&Lanes; SIDE]) -> [Lanes; STEP] {
    let mut out = [NONE; STEP];
    for j in 0..WIDE {
        let (p, q, r, s) = (b[j] + c[j], b[j] - c[j], d[j] + e[j], d[j] - e[j]);
        out[0][j] = a[j] + p + r;
        out[1][j] = q + 2.0 * s;
        out[2][j] = p + 4.0 * r;
        out[3][j] = q + 8.0 * s + f[j];
    }
    out
}
