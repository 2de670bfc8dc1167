//! The features that the trees of a structured forest use: colours, and gradients at two
//! scales, normalised by the gradients around them and split by direction. All are
//! smaller than the picture, and smoothed lightly or strongly.

use super::options::ForestOptions;
use pcadlang_scene::vision::gradient::mirrored;

/// A channel: width, height, and its values in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub data: Vec<f32>,
}

/// The features of a picture with a border around it; the channels of a pixel are
/// adjacent.
pub(super) struct Features {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    /// The features that trees use individually.
    pub plain: Vec<f32>,
    /// The same with more smoothing, for differences.
    pub similar: Vec<f32>,
}

impl Features {
    /// Computes the features of a picture in sRGB values from 0 to 1.
    pub fn of(rgb: &[[f32; 3]], width: usize, height: usize, o: &ForestOptions) -> Features {
        let luv = bordered(rgb, width, height, o);
        let mut all: Vec<Plane> = luv.iter().map(|p| averaged(p, o.shrink)).collect();
        for halving in [1, 2] {
            let scaled =
                luv.each_ref().map(|p| smoothed(&averaged(p, halving), o.gradient_smoothing));
            let (magnitude, bins) = gradient(&scaled, o);
            all.push(averaged(&magnitude, o.shrink / halving));
            for bin in 0..o.orientations {
                let data =
                    magnitude.data.iter().zip(&bins).map(|(m, b)| if *b == bin { *m } else { 0.0 });
                all.push(averaged(
                    &Plane { data: data.collect(), ..magnitude },
                    o.shrink / halving,
                ));
            }
        }
        let (width, height) = (all[0].width, all[0].height);
        let side_by_side = |radius: usize| {
            let mut out = vec![0.0; width * height * all.len()];
            for (c, plane) in all.iter().enumerate() {
                let values = smoothed(plane, rounded(radius, o.shrink)).data;
                out.iter_mut().skip(c).step_by(all.len()).zip(values).for_each(|(o, v)| *o = v);
            }
            out
        };
        let (plain, similar) = (side_by_side(o.smoothing), side_by_side(o.similarity_smoothing));
        Features { width, height, channels: all.len(), plain, similar }
    }
}

/// Returns `a / b` rounded to the nearest integer, halves to even.
pub(super) fn rounded(a: usize, b: usize) -> usize {
    (a as f64 / b as f64).round_ties_even() as usize
}

/// Returns the colours of a picture that is mirrored beyond its border, as far as patches
/// extend and so that its sides can be halved and shrunk.
fn bordered(rgb: &[[f32; 3]], width: usize, height: usize, o: &ForestOptions) -> [Plane; 3] {
    let border = (o.patch - o.inner) / 2;
    let side = |n: usize| (n + 2 * border).next_multiple_of(2 * o.shrink);
    let (w, h) = (side(width), side(height));
    let table = lightness();
    let colours: Vec<[f32; 3]> = rgb.iter().map(|p| luv(*p, &table)).collect();
    let place = |i: usize, n: usize| mirrored(i as i64 - border as i64, n as i64);
    let columns: Vec<usize> = (0..w).map(|i| place(i, width)).collect();
    let mut planes = [0; 3].map(|_| Plane { width: w, height: h, data: Vec::with_capacity(w * h) });
    for j in 0..h {
        let row = &colours[place(j, height) * width..][..width];
        for (c, plane) in planes.iter_mut().enumerate() {
            plane.data.extend(columns.iter().map(|i| row[*i][c]));
        }
    }
    planes
}

/// L*, u* and v* are given in 270ths, so that they lie between 0 and 1.
const UNIT: f32 = 1.0 / 270.0;
/// Number of steps of luminance in the lightness table.
const STEPS: usize = 1024;

/// Returns L* by luminance. The thresholds of forests were learnt with such a table.
fn lightness() -> Vec<f32> {
    let slope = 29.0f32 * 29.0 * 29.0 / 27.0;
    let of = |i: usize| {
        let y = i.min(STEPS - 1) as f32 / STEPS as f32;
        UNIT * if y > 8.0 / slope { 116.0 * libm::cbrtf(y) - 16.0 } else { slope * y }
    };
    (0..STEPS + 40).map(of).collect()
}

/// Returns L*, u* and v* of sRGB values, which are treated as linear light, because they
/// were in training too.
fn luv([r, g, b]: [f32; 3], table: &[f32]) -> [f32; 3] {
    let x = 0.430_574 * r + 0.341_550 * g + 0.178_325 * b;
    let y = 0.222_015 * r + 0.706_655 * g + 0.071_330 * b;
    let z = 0.020_183 * r + 0.129_553 * g + 0.939_180 * b;
    let l = table[((STEPS as f32 * y) as usize).min(table.len() - 1)];
    let n = 1.0 / (x + 15.0 * y + 3.0 * z + 1e-35);
    // The white point, and offsets that make the smallest u* and v* zero.
    let (white_u, white_v) = (0.197_833, 0.468_331);
    [
        l,
        l * 13.0 * (4.0 * x * n - white_u) + 88.0 * UNIT,
        l * 13.0 * (9.0 * y * n - white_v) + 134.0 * UNIT,
    ]
}

/// Averages squares of `by` pixels a side; sides are multiples of it.
fn averaged(plane: &Plane, by: usize) -> Plane {
    if by == 1 {
        return plane.clone();
    }
    let (width, height) = (plane.width / by, plane.height / by);
    let mut data = vec![0.0; width * height];
    for (j, row) in plane.data.chunks_exact(plane.width).enumerate().take(height * by) {
        let out = &mut data[j / by * width..][..width];
        out.iter_mut().zip(row.chunks_exact(by)).for_each(|(o, c)| *o += c.iter().sum::<f32>());
    }
    let part = 1.0 / (by * by) as f32;
    data.iter_mut().for_each(|v| *v *= part);
    Plane { width, height, data }
}

/// Smooths by a triangle filter along rows and columns; mirrored at the border, whose
/// pixels count once.
pub(super) fn smoothed(plane: &Plane, radius: usize) -> Plane {
    if radius == 0 {
        return plane.clone();
    }
    let r = radius as i64;
    let weight = |k: i64| (r + 1 - k.abs()) as f32 / ((r + 1) * (r + 1)) as f32;
    let kernel: Vec<f32> = (-r..=r).map(weight).collect();
    let (w, h) = (plane.width, plane.height);
    let mut across = Vec::with_capacity(plane.data.len());
    let places: Vec<usize> = (-r..w as i64 + r).map(|i| once(i, w as i64)).collect();
    let mut line = vec![0.0; places.len()];
    for row in plane.data.chunks_exact(w) {
        line.iter_mut().zip(&places).for_each(|(l, i)| *l = row[*i]);
        across.extend(
            line.windows(kernel.len())
                .map(|l| l.iter().zip(&kernel).map(|(v, k)| v * k).sum::<f32>()),
        );
    }
    let mut data = vec![0.0; across.len()];
    for (j, out) in data.chunks_exact_mut(w).enumerate() {
        for (k, weight) in (-r..=r).zip(&kernel) {
            let row = &across[once(j as i64 + k, h as i64) * w..][..w];
            out.iter_mut().zip(row).for_each(|(o, v)| *o += weight * v);
        }
    }
    Plane { width: w, height: h, data }
}

/// Returns position `i` of a line of `n`, mirrored at its ends; the end pixels count
/// once.
fn once(i: i64, n: i64) -> usize {
    let m = i.rem_euclid((2 * n - 2).max(1));
    (if m < n { m } else { 2 * n - 2 - m }) as usize
}

/// Smaller changes have no direction.
const FLAT: f32 = 1e-5;

/// Returns the gradient of the channel that changes most, relative to the gradients
/// around it, and the index of its direction.
fn gradient(planes: &[Plane; 3], o: &ForestOptions) -> (Plane, Vec<usize>) {
    let (w, h) = (planes[0].width, planes[0].height);
    let directions: Vec<[f32; 2]> = (0..o.orientations)
        .map(|k| std::f32::consts::PI * k as f32 / o.orientations as f32)
        .map(|a| [libm::cosf(a), libm::sinf(a)])
        .collect();
    let undirected = rounded(o.orientations, 2) % o.orientations;
    let mut plane = Plane { width: w, height: h, data: Vec::with_capacity(w * h) };
    let mut bins = Vec::with_capacity(w * h);
    for j in 0..h {
        let (up, down) = (j.saturating_sub(1) * w, (j + 1).min(h - 1) * w);
        for i in 0..w {
            let (left, right) = (i.saturating_sub(1), (i + 1).min(w - 1));
            let (mut most, mut change) = (-1.0, [0.0f32; 2]);
            for p in planes.iter().map(|p| &p.data) {
                let d = [p[j * w + right] - p[j * w + left], p[down + i] - p[up + i]];
                let square = d[0] * d[0] + d[1] * d[1];
                if square > most {
                    (most, change) = (square, d);
                }
            }
            plane.data.push(most.sqrt());
            bins.push(match change[0].abs() + change[1].abs() < FLAT {
                true => undirected,
                false => nearest(change, &directions),
            });
        }
    }
    let around = smoothed(&plane, o.normalization);
    plane.data.iter_mut().zip(around.data).for_each(|(m, a)| *m /= a + 0.01);
    (plane, bins)
}

/// Returns the direction nearest to that of a change, regardless of sign.
fn nearest([x, y]: [f32; 2], directions: &[[f32; 2]]) -> usize {
    let mut best = (0, -1.0);
    for (k, [c, s]) in directions.iter().enumerate() {
        let along = (x * c + y * s).abs();
        if along > best.1 {
            best = (k, along);
        }
    }
    best.0
}
