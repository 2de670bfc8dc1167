//! Shading: whether the brightness inside the silhouette follows the normals. A Bayesian
//! linear regression of log brightness on seven functions of the normal, with
//! coefficients and noise variance integrated out, is compared with a constant brightness
//! by a log ratio.
//!
//! This is not a reflectance model, and it has no shadows or light sources: the seven
//! functions span what distant light does to a matt surface (Ramamoorthi & Hanrahan 2001,
//! "An efficient representation for irradiance environment maps": harmonics of first and
//! second order), except for `3 z^2 - 1`, which is close to `z` on the visible half.
//! Invariant: the result is finite.

use crate::vision::pictures::photo::LinearImage;
use pcadlang_numerics::num::simd::vectorised;

/// Number of functions of the normal.
const TERMS: usize = 7;
/// Number of variables: constant, terms, brightness.
const ALL: usize = TERMS + 2;
/// Prior precision of a coefficient, relative to the inverse noise variance.
const RIDGE: f64 = 1.0;
/// The inverse-gamma prior of the noise variance: shape, and scale in squared log
/// brightness.
const SHAPE: f64 = 1.0;
const SCALE: f64 = 0.05;
/// Added to linear brightness (0 to 1) before the logarithm, so that black is finite.
const DARK: f32 = 1.0 / 128.0;

/// Returns the log brightness of every pixel (ITU-R BT.709 luminance, natural logarithm).
pub(super) fn log_brightness(picture: &LinearImage) -> Vec<f32> {
    let log =
        |[r, g, b]: &[f32; 3]| libm::logf((0.2126 * r + 0.7152 * g + 0.0722 * b).max(0.0) + DARK);
    picture.rgb.iter().map(log).collect()
}

/// Returns the log ratio of the marginal likelihoods of the brightness of the pixels
/// whose group is not 0: linear in functions of the normal versus constant. It is 0 with
/// fewer than two pixels. Pixels whose normal or brightness is not finite are ignored.
pub(super) fn log_ratio(groups: &[u8], normals: &[[f32; 3]], brightness: &[f32]) -> f64 {
    let mut sums = [[[0.0; LANES]; ALL]; ALL];
    vectorised(
        #[inline(always)]
        || {
            // The pixels that count, side by side.
            let (mut block, mut count) = ([[0.0; BLOCK]; 4], 0);
            let mut columns = [[[0.0; LANES]; ROWS]; ALL];
            let lists = groups.chunks(BLOCK).zip(normals.chunks(BLOCK));
            for ((groups, normals), brightness) in lists.zip(brightness.chunks(BLOCK)) {
                // Most of a picture is background.
                if groups.iter().fold(0, |any, g| any | g) == 0 {
                    continue;
                }
                for ((g, n), b) in groups.iter().zip(normals).zip(brightness) {
                    let place = count % BLOCK;
                    [block[0][place], block[1][place], block[2][place]] = *n;
                    block[3][place] = *b;
                    count += usize::from(*g > 0 && (n[0] + n[1] + n[2] + b).is_finite());
                    if count == BLOCK {
                        add(&mut sums, &mut columns, &block, BLOCK);
                        count = 0;
                    }
                }
            }
            block.iter_mut().for_each(|list| list[count..].fill(0.0));
            add(&mut sums, &mut columns, &block, count);
        },
    );
    from_products(&sums.map(|row| row.map(|lanes| lanes.iter().sum())))
}

/// Number of independent partial sums. It is fixed, so that the result does not depend on the
/// machine.
const LANES: usize = 8;
/// Number of pixels whose products are added at a time, in rows of [`LANES`].
const BLOCK: usize = ROWS * LANES;
const ROWS: usize = 4;

/// Adds the products of (1, terms, brightness) of the first `count` of some pixels, only those on
/// and above the diagonal. `block` has their normals and brightness, and zeros behind them;
/// `columns` is room for the terms.
#[inline(always)]
fn add(
    sums: &mut [[[f64; LANES]; ALL]; ALL],
    columns: &mut [[[f64; LANES]; ROWS]; ALL],
    block: &[[f32; BLOCK]; 4],
    count: usize,
) {
    for row in 0..ROWS {
        for l in 0..LANES {
            let i = row * LANES + l;
            let [x, y, z, brightness] = [0, 1, 2, 3].map(|k| f64::from(block[k][i]));
            let one = if i < count { 1.0 } else { 0.0 };
            let terms = [one, x, y, z, x * y, x * z, y * z, x * x - y * y, brightness];
            for (column, term) in columns.iter_mut().zip(terms) {
                column[row][l] = term;
            }
        }
    }
    for i in 0..ALL {
        for j in i..ALL {
            // A copy, which stays in registers.
            let mut lanes = sums[i][j];
            for (a, b) in columns[i].iter().zip(&columns[j]) {
                for l in 0..LANES {
                    lanes[l] += a[l] * b[l];
                }
            }
            sums[i][j] = lanes;
        }
    }
}

/// Computes the log ratio from sums of products of (1, terms, brightness), of which those
/// on and above the diagonal are used. The constant has a flat prior, so it takes one
/// degree of freedom.
fn from_products(products: &[[f64; ALL]; ALL]) -> f64 {
    let n = products[0][0];
    if n < 2.0 {
        return 0.0;
    }
    let centred =
        |i: usize, j: usize| products[i.min(j)][i.max(j)] - products[0][i] * products[0][j] / n;
    let total = centred(ALL - 1, ALL - 1).max(0.0);
    // Cholesky factor of X'X + ridge, and the forward solution of X'y, in one pass.
    let mut factor = [[0.0f64; TERMS]; TERMS];
    let mut solved = [0.0f64; TERMS];
    let (mut log_det, mut explained) = (0.0, 0.0);
    for i in 0..TERMS {
        for j in 0..=i {
            let mut sum = centred(i + 1, j + 1) + if i == j { RIDGE } else { 0.0 };
            for k in 0..j {
                sum -= factor[i][k] * factor[j][k];
            }
            // Pivots are at least the ridge, except for rounding.
            factor[i][j] = if i == j { sum.max(RIDGE).sqrt() } else { sum / factor[j][j] };
        }
        let done: f64 = (0..i).map(|k| factor[i][k] * solved[k]).sum();
        solved[i] = (centred(i + 1, ALL - 1) - done) / factor[i][i];
        explained += solved[i] * solved[i];
        log_det += 2.0 * libm::log(factor[i][i]) - libm::log(RIDGE);
    }
    let left = (total - explained).max(0.0);
    let gain = libm::log(SCALE + 0.5 * total) - libm::log(SCALE + 0.5 * left);
    (SHAPE + 0.5 * (n - 1.0)) * gain - 0.5 * log_det
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    /// Normals of a sphere's visible half on a grid of `side` pixels, in row-major order;
    /// the group is 1 on it.
    fn sphere(side: usize) -> (Vec<u8>, Vec<[f32; 3]>) {
        let at = |i: usize| (2.0 * i as f32 + 1.0) / side as f32 - 1.0;
        let pixels = (0..side * side).map(|i| (at(i % side), -at(i / side)));
        let normal = |(x, y): (f32, f32)| {
            let d = x * x + y * y;
            if d < 1.0 { (1, [x, y, (1.0 - d).sqrt()]) } else { (0, [0.0; 3]) }
        };
        pixels.map(normal).unzip()
    }

    fn lit(normals: &[[f32; 3]], light: [f32; 3], noise: f64, seed: u64) -> Vec<f32> {
        let mut rng = StreamKey::new(seed, 0, Purpose::PREDICT).stream(0, 0, 0);
        let dot = |n: &[f32; 3]| n[0] * light[0] + n[1] * light[1] + n[2] * light[2];
        normals
            .iter()
            .map(|n| (0.3 + dot(n).max(0.0)).ln() + (noise * rng.standard_normal()) as f32)
            .collect()
    }

    /// The log ratio from its definition: contrasts that do not depend on the constant,
    /// their covariance under either model, and the noise variance integrated out, which
    /// gives a multivariate t density each.
    fn reference(normals: &[[f32; 3]], brightness: &[f32]) -> f64 {
        let n = normals.len();
        // Helmert's contrasts.
        let contrast = |v: &[f64]| -> Vec<f64> {
            let of = |i: usize| {
                let i_ = i as f64;
                (v[..i].iter().sum::<f64>() - i_ * v[i]) / (i_ * (i_ + 1.0)).sqrt()
            };
            (1..n).map(of).collect()
        };
        let y = contrast(&brightness.iter().map(|b| f64::from(*b)).collect::<Vec<_>>());
        let terms = |[x, y, z]: [f64; 3]| [x, y, z, x * y, x * z, y * z, x * x - y * y];
        let rows: Vec<[f64; TERMS]> = normals.iter().map(|n| terms(n.map(f64::from))).collect();
        let x: Vec<Vec<f64>> =
            (0..TERMS).map(|t| contrast(&rows.iter().map(|r| r[t]).collect::<Vec<_>>())).collect();
        let density = |with: bool| {
            let m = n - 1;
            let mut c = vec![vec![0.0; m]; m];
            let (mut log_det, mut square, mut z) = (0.0, 0.0, vec![0.0; m]);
            for i in 0..m {
                for j in 0..=i {
                    let prior: f64 =
                        if with { x.iter().map(|x| x[i] * x[j] / RIDGE).sum() } else { 0.0 };
                    let mut s = prior + f64::from(u8::from(i == j));
                    s -= (0..j).map(|k| c[i][k] * c[j][k]).sum::<f64>();
                    c[i][j] = if i == j { s.sqrt() } else { s / c[j][j] };
                }
                z[i] = (y[i] - (0..i).map(|k| c[i][k] * z[k]).sum::<f64>()) / c[i][i];
                square += z[i] * z[i];
                log_det += 2.0 * c[i][i].ln();
            }
            -0.5 * log_det - (SHAPE + 0.5 * m as f64) * (SCALE + 0.5 * square).ln()
        };
        density(true) - density(false)
    }

    #[test]
    fn agrees_with_the_density_written_out() {
        let (groups, normals) = sphere(9);
        for (noise, seed) in [(0.02, 1), (0.3, 2), (2.0, 3)] {
            let brightness = lit(&normals, [0.5, 0.6, 0.4], noise, seed);
            let inside = |i: &usize| groups[*i] > 0;
            let n: Vec<_> = (0..81).filter(inside).map(|i| normals[i]).collect();
            let b: Vec<_> = (0..81).filter(inside).map(|i| brightness[i]).collect();
            let (got, expected) = (log_ratio(&groups, &normals, &brightness), reference(&n, &b));
            assert!((got - expected).abs() < 1e-8 * expected.abs().max(1.0), "{got} {expected}");
        }
    }

    #[test]
    fn true_normals_explain_shading_and_wrong_ones_do_not() {
        let (groups, normals) = sphere(40);
        let brightness = lit(&normals, [0.5, 0.6, 0.4], 0.1, 4);
        let right = log_ratio(&groups, &normals, &brightness);
        let turned: Vec<_> =
            normals.iter().map(|[x, y, z]| [0.6 * y + 0.8 * x * z, *x * *y, *z]).collect();
        let wrong = log_ratio(&groups, &turned, &brightness);
        assert!(right > 300.0 && right > wrong + 100.0, "{right} {wrong}");
        let noise = lit(&vec![[0.0; 3]; normals.len()], [0.0; 3], 0.3, 5);
        let none = log_ratio(&groups, &normals, &noise);
        assert!(none < 0.0 && none > -60.0, "{none}");
    }

    #[test]
    fn extremes_are_finite() {
        let (groups, mut normals) = sphere(12);
        assert_eq!(log_ratio(&[0; 144], &normals, &[0.0; 144]), 0.0);
        assert!(log_ratio(&groups, &normals, &[-3.0; 144]).is_finite());
        let flat = vec![[0.0, 0.0, 1.0]; 144];
        assert!(log_ratio(&groups, &flat, &lit(&normals, [0.0, 0.0, 1.0], 0.1, 6)).abs() < 1e-6);
        normals[70] = [f32::NAN; 3];
        assert!(log_ratio(&groups, &normals, &[-3.0; 144]).is_finite());
    }
}
