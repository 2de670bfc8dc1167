//! A part of a row of the picture: its lines of sight, and what they meet first.

use super::cover::Patch;
use super::lanes::{LANES, Row, mask};
use super::rays::{FirstHits, Shape};
use super::sight::{Lines, Rays, Sight};

/// The number of pixels of a part; a power of 2. It is fixed, so that indices are known to
/// be inside.
pub(super) const MOST: usize = 128;

/// Numbers for each pixel of a part.
type Part<T> = [T; MOST + LANES];

/// The lines of sight of a part of a row of pixels, and what they meet first.
#[derive(Debug)]
pub(super) struct Scan {
    /// As in [`Rays`]. The first of each is the same for all pixels if a pinhole sees them,
    /// and given only once.
    square: [Part<f64>; 3],
    height: [Part<f64>; 2],
    /// The ways of [`Lines`] from a pinhole, or else their origins.
    lines: [Part<f64>; 3],
    depth: Part<f64>,
    span: Part<u64>,
    /// The columns.
    window: [usize; 2],
}

impl Default for Scan {
    fn default() -> Scan {
        let none = [0.0; MOST + LANES];
        let span = [0; MOST + LANES];
        Scan {
            square: [none; 3],
            height: [none; 2],
            lines: [none; 3],
            depth: none,
            span,
            window: [0; 2],
        }
    }
}

impl Scan {
    /// Begins a part of a row: at most [`MOST`] columns, of which nothing is met yet.
    #[inline(always)]
    pub fn begin<const PINHOLE: bool>(
        &mut self,
        sight: &Sight,
        row: usize,
        [from, past]: [usize; 2],
    ) {
        self.window = [from, past.min(from + MOST)];
        let mut at = 0;
        while from + at < self.window[1] {
            let lines = sight.lines::<PINHOLE>(centres(from + at, row).each_ref());
            let rays = Rays::of(&lines);
            let vary = if PINHOLE { &lines.way } else { &lines.origin };
            put(&mut self.lines[0], at, &vary[0]);
            put(&mut self.lines[1], at, &vary[1]);
            put(&mut self.lines[2], at, &vary[2]);
            if PINHOLE {
                (self.square[0][0], self.height[0][0]) = (rays.square[0][0], rays.height[0][0]);
            } else {
                put(&mut self.square[0], at, &rays.square[0]);
                put(&mut self.height[0], at, &rays.height[0]);
            }
            put(&mut self.square[1], at, &rays.square[1]);
            put(&mut self.square[2], at, &rays.square[2]);
            put(&mut self.height[1], at, &rays.height[1]);
            self.note(at, &FirstHits::NOTHING);
            at += LANES;
        }
    }

    /// The columns, from the first to one past the last.
    #[inline(always)]
    pub fn window(&self) -> [usize; 2] {
        self.window
    }

    /// Tests the columns of two intervals, from the first to one past the last, against a
    /// patch.
    #[inline(always)]
    pub fn test<const PINHOLE: bool>(&mut self, patch: &Patch, columns: [[usize; 2]; 2]) {
        let beyond = patch.beyond;
        match patch.shape {
            Shape::Cone(cone) => self.each::<PINHOLE>(
                beyond,
                columns,
                #[inline(always)]
                |rays, seen| cone.first(rays, seen),
            ),
            Shape::Level(level) => self.each::<PINHOLE>(
                beyond,
                columns,
                #[inline(always)]
                |rays, seen| level.first(rays, seen),
            ),
        }
    }

    #[inline(always)]
    fn each<const PINHOLE: bool>(
        &mut self,
        beyond: f64,
        columns: [[usize; 2]; 2],
        first: impl Fn(&Rays, &mut FirstHits),
    ) {
        let [begin, end] = self.window;
        for [from, past] in columns {
            let (mut at, past) = (from.max(begin) - begin, past.min(end).saturating_sub(begin));
            while at < past {
                let mut seen = self.seen(at);
                if beyond <= 0.0 || any_beyond(&seen.depth, beyond) {
                    first(&self.rays::<PINHOLE>(at), &mut seen);
                    self.note(at, &seen);
                }
                at += LANES;
            }
        }
    }

    /// The lines of sight of pixels from one on, counted from the first.
    #[inline(always)]
    pub fn lines<const PINHOLE: bool>(&self, sight: &Sight, at: usize) -> Lines {
        let [x, y, z] = &self.lines;
        let vary = [get(x, at), get(y, at), get(z, at)];
        let same = sight.shared::<PINHOLE>();
        match PINHOLE {
            true => Lines { origin: same, way: vary },
            false => Lines { origin: vary, way: same },
        }
    }

    #[inline(always)]
    fn rays<const PINHOLE: bool>(&self, at: usize) -> Rays {
        let [c, b, a] = &self.square;
        let [height, climb] = &self.height;
        let (c, height) = match PINHOLE {
            true => ([c[0]; LANES], [height[0]; LANES]),
            false => (get(c, at), get(height, at)),
        };
        Rays { square: [c, get(b, at), get(a, at)], height: [height, get(climb, at)] }
    }

    /// The first hits at pixels from one on, counted from the first.
    #[inline(always)]
    pub fn seen(&self, at: usize) -> FirstHits {
        FirstHits { depth: get(&self.depth, at), span: get(&self.span, at) }
    }

    /// Replaces what is met first at pixels from one on, counted from the first.
    #[inline(always)]
    pub fn note(&mut self, at: usize, seen: &FirstHits) {
        put(&mut self.depth, at, &seen.depth);
        put(&mut self.span, at, &seen.span);
    }
}

/// The centres of pixels of a row, from a column on.
#[inline(always)]
pub(super) fn centres(column: usize, row: usize) -> [Row; 2] {
    let (first, mut x) = (column as f64, [0.0; LANES]);
    for (i, x) in x.iter_mut().enumerate() {
        *x = first + (i as f64 + 0.5);
    }
    [x, [row as f64 + 0.5; LANES]]
}

/// True if any of some depths is greater than another.
#[inline(always)]
fn any_beyond(depth: &Row, beyond: f64) -> bool {
    let mut open = 0;
    for depth in depth {
        open |= mask(*depth > beyond);
    }
    open != 0
}

#[inline(always)]
fn get<T: Copy + Default>(part: &Part<T>, at: usize) -> [T; LANES] {
    part[at % MOST..].first_chunk().copied().unwrap_or_default()
}

#[inline(always)]
fn put<T: Copy>(part: &mut Part<T>, at: usize, row: &[T; LANES]) {
    if let Some(place) = part[at % MOST..].first_chunk_mut() {
        *place = *row;
    }
}
