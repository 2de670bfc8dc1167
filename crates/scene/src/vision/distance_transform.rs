//! The exact Euclidean distance transform: for every pixel the distance to the nearest
//! set pixel, and its index. Felzenszwalb & Huttenlocher 2012, "Distance transforms of
//! sampled functions", Theory of Computing 8, 415-428: lower envelopes of parabolas,
//! columns first and then rows, in linear time. Distances are between pixel centres, in
//! pixels, exact up to one rounding. Among equally near set pixels the leftmost counts,
//! and among those in one column the upper one.

use pcadlang_numerics::num::simd::vectorised;

/// Distances to the nearest set pixel of a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DistanceMap {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Distances, pixels, in row-major order. If no pixel is set, all are the map's
    /// diagonal.
    pub values: Vec<f32>,
    /// Index (row * width + column) of a nearest set pixel; `u32::MAX` everywhere if no
    /// pixel is set.
    pub nearest: Vec<u32>,
}

/// Signed number of rows to the set pixel of a column that has none: more than any row's.
const NOWHERE: i32 = i32::MAX / 2;

/// For every pixel the number of rows down to the nearest set pixel of its column; of two
/// equally near ones, to the upper one.
pub(super) struct Columns {
    width: usize,
    away: Vec<i32>,
}

/// Buffers for one row at a time: the parabolas `(x - q)^2 + f(q)` of its lower envelope,
/// from the left. Parabolas differ by the lines `h - 2 x q` with `h = q^2 + f(q)`.
#[derive(Default)]
pub(super) struct Envelope {
    q: Vec<f64>,
    h: Vec<f64>,
}

impl Columns {
    /// Scans the columns of a map of at least one pixel; pixels beyond the end of `set`
    /// are not set.
    pub fn of(width: usize, height: usize, set: &[bool]) -> Self {
        let mut away = vec![0i32; width * height];
        let (mut above, mut below) = (vec![-NOWHERE; width], vec![NOWHERE; width]);
        let none = vec![false; width];
        let row = |y: usize| set.get(y * width..(y + 1) * width);
        let last: Vec<bool> =
            set.iter().skip(set.len() / width * width).copied().chain(none).take(width).collect();
        let at = |y: usize| row(y).unwrap_or(if y == set.len() / width { &last } else { &[] });
        vectorised(
            #[inline(always)]
            || {
                for (y, out) in away.chunks_exact_mut(width).enumerate() {
                    above.iter_mut().for_each(|a| *a -= 1);
                    above.iter_mut().zip(at(y)).for_each(|(a, &s)| *a = if s { 0 } else { *a });
                    out.copy_from_slice(&above);
                }
                for (y, out) in away.chunks_exact_mut(width).enumerate().rev() {
                    below.iter_mut().for_each(|b| *b += 1);
                    below.iter_mut().zip(at(y)).for_each(|(b, &s)| *b = if s { 0 } else { *b });
                    out.iter_mut()
                        .zip(&below)
                        .for_each(|(o, &b)| *o = if b < -*o { b } else { *o });
                }
            },
        );
        Columns { width, away }
    }

    /// Calls `each` for every pixel of a row, from the left, with the nearest set pixel
    /// (column, rows down to it); of two equally near ones with the left one. It is not
    /// called if no pixel of the map is set.
    ///
    /// Parabolas on the lower envelope are corners of the lower convex hull of the points
    /// `(q, h)`, so intersections need not be computed: all comparisons are of integers,
    /// which are exact in f64 for sides up to 2^17.
    pub fn nearest(
        &self,
        y: usize,
        envelope: &mut Envelope,
        mut each: impl FnMut(Option<(usize, i32)>),
    ) {
        let Some(away) = self.away.get(y * self.width..(y + 1) * self.width) else { return };
        let Envelope { q, h } = envelope;
        // The last two points, kept in registers.
        let (mut before, mut last) = ((0.0, 0.0), (0.0, 0.0));
        q.clear();
        h.clear();
        for (column, &a) in away.iter().enumerate().filter(|(_, a)| a.abs() < NOWHERE) {
            let (x, f) = (column as f64, f64::from(a));
            let new = (x, x * x + f * f);
            while q.len() > 1
                && (last.1 - before.1) * (new.0 - last.0) >= (new.1 - last.1) * (last.0 - before.0)
            {
                q.pop();
                h.pop();
                last = before;
                if let ([.., q, _], [.., h, _]) = (&q[..], &h[..]) {
                    before = (*q, *h);
                }
            }
            q.push(new.0);
            h.push(new.1);
            (before, last) = (last, new);
        }
        let mut lowest = 0;
        for x in 0..self.width {
            let twice = 2.0 * x as f64;
            while let ([p, o, ..], [a, b, ..]) = (&q[lowest..], &h[lowest..])
                && b - a < twice * (o - p)
            {
                lowest += 1;
            }
            let Some(&column) = q.get(lowest) else { return };
            let column = column as u32 as usize;
            each(Some((column, away[column])));
        }
    }

    /// Like [`Columns::nearest`], with `None` for pixels without a set pixel within
    /// `reach`, at most [`FARTHEST`]. This is much faster if set pixels are dense or
    /// `reach` is small: columns are visited from near to far, for many pixels at a time.
    pub fn within(
        &self,
        y: usize,
        reach: usize,
        row: &mut Vec<i32>,
        mut each: impl FnMut(Option<(usize, i32)>),
    ) {
        let Some(away) = self.away.get(y * self.width..(y + 1) * self.width) else { return };
        // The high bits hold the squared distance and the low bits the column, so that
        // the minimum is the nearest set pixel, and the leftmost of equally near ones.
        let most = reach as i32;
        let bits = (2 * most + 1).ilog2() + 1;
        row.clear();
        row.resize(reach, NOWHERE);
        row.extend(away.iter().map(|&a| if a.abs() <= most { (a * a) << bits } else { NOWHERE }));
        row.resize(self.width.next_multiple_of(SPAN) + 2 * reach, NOWHERE);
        for start in (0..self.width).step_by(SPAN) {
            let mut least = [NOWHERE; SPAN];
            vectorised(
                #[inline(always)]
                || {
                    for dx in 0..=most {
                        for place in [most - dx, most + dx] {
                            let more = ((dx * dx) << bits) + place;
                            let there = &row[start + place as usize..][..SPAN];
                            for (l, t) in least.iter_mut().zip(there) {
                                let d = t + more;
                                *l = if d < *l { d } else { *l };
                            }
                        }
                        let worst = least.iter().fold(0, |a, &b| if b > a { b } else { a });
                        if (dx + 1) * (dx + 1) > worst >> bits {
                            break;
                        }
                    }
                },
            );
            for (x, l) in (start..self.width).zip(least) {
                let column = x + (l & ((1 << bits) - 1)) as usize;
                let found = l >> bits <= most * most;
                each(found.then(|| (column - reach, away[column - reach])));
            }
        }
    }
}

/// The maximum reach of [`Columns::within`], pixels: twice its square, shifted left by
/// the bits of its double, fits into an `i32`.
pub(super) const FARTHEST: usize = 500;

/// Number of pixels that are processed at a time.
const SPAN: usize = 64;

/// Computes the distance transform of a map of `width` x `height` pixels; pixels beyond
/// the end of `set` are not set. If no pixel is set, all distances are the diagonal and
/// all `nearest` are `u32::MAX`.
pub fn distance_transform(width: u32, height: u32, set: &[bool]) -> DistanceMap {
    let (w, h) = (width as usize, height as usize);
    if w * h == 0 || !set.iter().take(w * h).any(|&s| s) {
        let diagonal = libm::hypot(f64::from(width), f64::from(height)) as f32;
        return DistanceMap {
            width,
            height,
            values: vec![diagonal; w * h],
            nearest: vec![u32::MAX; w * h],
        };
    }
    let (mut values, mut nearest) = (Vec::with_capacity(w * h), Vec::with_capacity(w * h));
    let (columns, mut envelope) = (Columns::of(w, h, set), Envelope::default());
    for y in 0..h {
        columns.nearest(y, &mut envelope, |found| {
            let Some((column, down)) = found else { return };
            let (dx, dy) = (column as f64 - (nearest.len() - y * w) as f64, f64::from(down));
            values.push((dx * dx + dy * dy).sqrt() as f32);
            nearest.push(((y as i64 + i64::from(down)) as usize * w + column) as u32);
        });
    }
    DistanceMap { width, height, values, nearest }
}

impl DistanceMap {
    /// Returns the distance at a position in pixel coordinates (pixel centres at +0.5)
    /// and its derivatives along x and y, by bilinear interpolation between pixel
    /// centres. Beyond the outermost centres it is the value at the nearest position
    /// between them plus the distance to that position, so it is continuous everywhere.
    /// At non-finite coordinates, and in a map without pixels, it is the map's diagonal
    /// with derivatives 0.
    pub fn sample(&self, x: f32, y: f32) -> (f32, f32, f32) {
        let (w, h) = (self.width as usize, self.height as usize);
        if w == 0 || h == 0 || !x.is_finite() || !y.is_finite() {
            return (libm::hypot(f64::from(self.width), f64::from(self.height)) as f32, 0.0, 0.0);
        }
        let (u, v) = (f64::from(x) - 0.5, f64::from(y) - 0.5);
        let (cu, cv) = (u.clamp(0.0, (w - 1) as f64), v.clamp(0.0, (h - 1) as f64));
        let (i, j) = (cu as usize, cv as usize);
        let (fx, fy) = (cu - i as f64, cv - j as f64);
        let at = |i: usize, j: usize| f64::from(self.values[j.min(h - 1) * w + i.min(w - 1)]);
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
        let top = a + fx * (b - a);
        let bottom = c + fx * (d - c);
        let mut value = top + fy * (bottom - top);
        let mut dx = if cu == u { (b - a) + fy * ((d - c) - (b - a)) } else { 0.0 };
        let mut dy = if cv == v { bottom - top } else { 0.0 };
        let (ox, oy) = (u - cu, v - cv);
        let out = (ox * ox + oy * oy).sqrt();
        if out > 0.0 {
            value += out;
            dx += ox / out;
            dy += oy / out;
        }
        (value as f32, dx as f32, dy as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    fn brute(w: usize, h: usize, set: &[bool]) -> Vec<f32> {
        let on: Vec<(i64, i64)> =
            (0..w * h).filter(|&i| set[i]).map(|i| ((i % w) as i64, (i / w) as i64)).collect();
        (0..w * h)
            .map(|i| {
                let (x, y) = ((i % w) as i64, (i / w) as i64);
                let d = on.iter().map(|(a, b)| (a - x).pow(2) + (b - y).pow(2)).min().unwrap();
                (d as f64).sqrt() as f32
            })
            .collect()
    }

    fn random(w: usize, h: usize, density: f64, seed: u64) -> Vec<bool> {
        let mut s = StreamKey::new(seed, 0, Purpose::VALUES).stream(0, 0, 0);
        (0..w * h).map(|_| s.uniform() < density).collect()
    }

    #[test]
    fn equal_to_brute_force() {
        let mut seed = 0;
        for (w, h) in [(1, 1), (1, 17), (23, 1), (2, 2), (16, 9), (31, 40)] {
            for density in [0.01, 0.1, 0.5, 1.0] {
                seed += 1;
                let mut set = random(w, h, density, seed);
                set[(seed as usize * 7) % (w * h)] = true;
                let map = distance_transform(w as u32, h as u32, &set);
                assert_eq!(map.values, brute(w, h, &set), "{w} x {h} {density}");
                for (i, &n) in map.nearest.iter().enumerate() {
                    let n = n as usize;
                    assert!(set[n]);
                    let d2 = (n % w).abs_diff(i % w).pow(2) + (n / w).abs_diff(i / w).pow(2);
                    assert_eq!((d2 as f64).sqrt() as f32, map.values[i]);
                }
            }
        }
    }

    #[test]
    fn near_pixels_are_found_within_reach() {
        for (seed, (w, h)) in (0..).zip([(1, 1), (1, 17), (70, 3), (64, 20), (150, 33)]) {
            for (density, reach) in [(0.002, 0), (0.01, 5), (0.2, 3), (0.01, 40), (0.5, FARTHEST)] {
                let set = random(w, h, density, seed);
                let (columns, mut envelope, mut line) =
                    (Columns::of(w, h, &set), Envelope::default(), Vec::new());
                for y in 0..h {
                    let (mut all, mut near) = (Vec::new(), Vec::new());
                    columns.nearest(y, &mut envelope, |found| all.push(found));
                    columns.within(y, reach, &mut line, |found| near.push(found));
                    all.resize(w, None);
                    let square = |x: usize, (column, down): (usize, i32)| {
                        column.abs_diff(x).pow(2) as i32 + down * down
                    };
                    for (x, found) in all.iter_mut().enumerate() {
                        *found = found.filter(|f| square(x, *f) <= (reach * reach) as i32);
                    }
                    assert_eq!(all, near, "{w} x {h}, {density}, within {reach}, row {y}");
                }
            }
        }
    }

    #[test]
    fn of_pixels_as_near_the_leftmost_and_uppermost_counts() {
        let set: Vec<bool> = (0..25).map(|i| [2, 10, 14, 22].contains(&i)).collect();
        let map = distance_transform(5, 5, &set);
        assert_eq!((map.nearest[12], map.nearest[7], map.nearest[13]), (10, 2, 14));
        assert_eq!(distance_transform(1, 3, &[true, false, true]).nearest, [0, 0, 2]);
    }

    #[test]
    fn empty_and_odd_maps() {
        let map = distance_transform(3, 4, &[false; 12]);
        assert!(map.values.iter().all(|&v| v == 5.0));
        assert!(map.nearest.iter().all(|&n| n == u32::MAX));
        assert_eq!(distance_transform(0, 5, &[]).values.len(), 0);
        assert_eq!(distance_transform(0, 5, &[]).sample(1.0, 1.0), (5.0, 0.0, 0.0));
        // Missing pixels are not set.
        assert_eq!(distance_transform(3, 1, &[true]).values, [0.0, 1.0, 2.0]);
    }

    #[test]
    fn samples_meet_pixels_and_derivatives() {
        let set = random(12, 9, 0.05, 5);
        let map = distance_transform(12, 9, &set);
        for j in 0..9 {
            for i in 0..12 {
                assert_eq!(map.sample(i as f32 + 0.5, j as f32 + 0.5).0, map.values[j * 12 + i]);
            }
        }
        let mut s = StreamKey::new(9, 0, Purpose::VALUES).stream(0, 0, 0);
        let mut checked = 0;
        for _ in 0..2000 {
            let (x, y) = (s.uniform() as f32 * 24.0 - 6.0, s.uniform() as f32 * 21.0 - 6.0);
            let e = 1.0 / 256.0;
            // The derivative jumps at a cell border between the two samples.
            let crosses = |v: f32| ((v - 0.5 - e).floor() - (v - 0.5 + e).floor()) != 0.0;
            if crosses(x) || crosses(y) {
                continue;
            }
            let (_, dx, dy) = map.sample(x, y);
            let nx = (map.sample(x + e, y).0 - map.sample(x - e, y).0) / (2.0 * e);
            let ny = (map.sample(x, y + e).0 - map.sample(x, y - e).0) / (2.0 * e);
            assert!(
                (dx - nx).abs() < 2e-3 && (dy - ny).abs() < 2e-3,
                "({x}, {y}): {dx} {nx} {dy} {ny}"
            );
            checked += 1;
        }
        assert!(checked > 1500);
    }

    #[test]
    fn outside_is_continuous_and_grows() {
        let map = distance_transform(8, 8, &random(8, 8, 0.1, 2));
        for k in 0..80 {
            let y = k as f32 * 0.1;
            for edge in [0.5f32, 7.5] {
                let (a, b) = (map.sample(edge - 1e-4, y).0, map.sample(edge + 1e-4, y).0);
                assert!((a - b).abs() < 1e-3);
            }
        }
        assert_eq!(map.sample(-9.5, 0.5).0, map.values[0] + 10.0);
        assert_eq!(map.sample(f32::NAN, 0.5).1, 0.0);
        assert!(
            map.sample(f32::MAX, f32::MAX).0.is_finite()
                || map.sample(f32::MAX, f32::MAX).0 == f32::INFINITY
        );
    }
}
