//! Depth maps (distance of the visible surface at every pixel), and the likelihood of an
//! observed map given a rendered one.
//!
//! A depth is a positive number in the scene's unit of length; `+inf` is background (no
//! surface) and NaN is missing (not measured). Missing pixels are ignored: whether a
//! pixel is missing is assumed to be independent of the scene.

mod tally;

pub use self::tally::DepthTally;

use super::error::VisionError;
use super::pictures::floats::{self, Numbers};
use super::pictures::npy::{self, NpyData};
use super::pictures::photo::{Limits, decode_dynamic};
use pcadlang_numerics::num::LN_SQRT_2PI;
use pcadlang_numerics::rng::Stream;

/// A depth map in row-major order. Every value is positive and finite, `+inf`
/// (background) or NaN (missing).
#[derive(Clone, Debug)]
pub struct DepthMap {
    width: u32,
    height: u32,
    data: Vec<f32>,
}

impl DepthMap {
    /// Builds a depth map; values of 0 and below become background.
    pub fn new(width: u32, height: u32, mut data: Vec<f32>) -> Result<Self, VisionError> {
        if data.len() as u64 != u64::from(width) * u64::from(height) || data.is_empty() {
            return Err(VisionError::size(width, height, format!("{} pixels", data.len())));
        }
        data.iter_mut().filter(|v| **v <= 0.0).for_each(|v| *v = f32::INFINITY);
        Ok(DepthMap { width, height, data })
    }

    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The depths, in row-major order.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// Returns the map at another size (at least 1 x 1). Every pixel takes the value of
    /// the pixel that contains its centre, because averages across an object's edge are
    /// not depths of any surface.
    pub fn resized(&self, width: u32, height: u32) -> DepthMap {
        let (width, height) = (width.max(1), height.max(1));
        let pick = |i: u32, from: u32, to: u32| {
            ((2 * u64::from(i) + 1) * u64::from(from) / (2 * u64::from(to))) as usize
        };
        let data = (0..height)
            .flat_map(|j| {
                let row = pick(j, self.height, height) * self.width as usize;
                (0..width).map(move |i| row + pick(i, self.width, width))
            })
            .map(|k| self.data.get(k).copied().unwrap_or(f32::NAN))
            .collect();
        DepthMap { width, height, data }
    }
}

/// Reads a depth map from bytes: a grey picture of 16 bits or more (PNG, TIFF, OpenEXR) or a
/// `.npy` array of two axes. A depth is a number over `scale`, by default 1000 for whole numbers
/// (millimetres) and 1 for others; `missing` and NaN are not measured, as sensors and data sets
/// have it; other values of 0 and below, and `inf`, are background.
///
/// # Errors
/// If the bytes cannot be read, or hold no depths; a scale that is not positive.
pub fn decode(
    bytes: &[u8],
    scale: Option<f64>,
    missing: f64,
    limits: &Limits,
) -> Result<DepthMap, VisionError> {
    if let Some(value) = scale.filter(|s| !(*s > 0.0 && s.is_finite())) {
        return Err(VisionError::Range { name: "scale", rule: "positive", value });
    }
    let Numbers { width, height, values, whole } = numbers(bytes, limits)?;
    let scale = scale.unwrap_or(if whole { 1000.0 } else { 1.0 });
    let depth = |v: f64| if v == missing { f32::NAN } else { (v / scale) as f32 };
    DepthMap::new(width, height, values.into_iter().map(depth).collect())
}

/// The numbers of a file, as they stand in it.
fn numbers(bytes: &[u8], limits: &Limits) -> Result<Numbers, VisionError> {
    if npy::is_npy(bytes) {
        let array = npy::parse(bytes)?;
        let (width, height) = array.picture_size()?;
        limits.check(width, height)?;
        let whole = !matches!(array.data, NpyData::F32(_) | NpyData::F64(_));
        let values = array.into_f64();
        return Ok(Numbers { width, height, values, whole });
    }
    if floats::is_tiff(bytes) {
        return floats::tiff(bytes, limits);
    }
    if floats::is_exr(bytes) {
        return floats::exr(bytes, limits);
    }
    let (picture, _) = decode_dynamic(bytes, limits)?;
    let (width, height) = (picture.width(), picture.height());
    let image::DynamicImage::ImageLuma16(picture) = picture else {
        return Err(VisionError::Damaged(
            "a depth map must be a grey picture of 16 bits or more (PNG, TIFF, OpenEXR), or a .npy \
             array; fewer bits, or colours, are a picture of depths, without their unit"
                .into(),
        ));
    };
    let values = picture.pixels().map(|p| f64::from(p.0[0])).collect();
    Ok(Numbers { width, height, values, whole: true })
}

/// The likelihood of an observed depth map given a rendered one. Per observed pixel:
///
/// * rendered at depth z: `(1 - outlier) Normal(z, sd) + outlier Q`;
/// * rendered as background: `(1 - outlier) [background] + outlier Q`;
/// * Q: background with probability 1/2, else a depth uniform over `range`.
///
/// It is a density with respect to length plus a unit mass at "background"; it integrates
/// to 1 for every rendered map. Missing pixels contribute 0.
#[derive(Clone, Debug)]
pub struct DepthLikelihood {
    observed: DepthMap,
    sd: f64,
    outlier: f64,
    range: (f64, f64),
    logs: Logs,
}

/// Logarithms of the parameters.
#[derive(Clone, Copy, Debug)]
struct Logs {
    /// Of the standard deviation, and of the probability of an inlier.
    sd: f64,
    inlier: f64,
    /// Of the probability of an outlier that is background; of the density of any other.
    background: f64,
    outlier: f64,
    /// Of the probability of background where it is rendered.
    empty: f64,
}

impl DepthLikelihood {
    /// Builds the likelihood of `observed` at its own size: `sd` > 0 (unit of depth),
    /// `outlier` strictly between 0 and 1, and the `range` of an outlier's depth, which
    /// must contain all observed depths.
    pub fn new(
        observed: &DepthMap,
        sd: f64,
        outlier: f64,
        range: (f64, f64),
    ) -> Result<Self, VisionError> {
        let fail = |name, rule, value| Err(VisionError::Range { name, rule, value });
        if !(sd > 0.0 && sd.is_finite()) {
            return fail("sd", "positive", sd);
        }
        if !(outlier > 0.0 && outlier < 1.0) {
            return fail("outlier", "strictly between 0 and 1", outlier);
        }
        let (near, far) = range;
        if !(near < far && near.is_finite() && far.is_finite()) {
            return fail("range", "two depths, the nearer first", far - near);
        }
        let outside = |&&v: &&f32| v.is_finite() && !(near..=far).contains(&f64::from(v));
        if let Some(&v) = observed.data.iter().find(outside) {
            return fail("every observed depth", "within the range of depths", f64::from(v));
        }
        let background = libm::log(0.5 * outlier);
        let logs = Logs {
            sd: libm::log(sd),
            inlier: libm::log1p(-outlier),
            background,
            outlier: background - libm::log(far - near),
            empty: libm::log1p(-0.5 * outlier),
        };
        Ok(DepthLikelihood { observed: observed.clone(), sd, outlier, range, logs })
    }

    /// Returns the likelihood at the rendered size (nearest pixels).
    pub fn resized(&self, width: u32, height: u32) -> Self {
        DepthLikelihood { observed: self.observed.resized(width, height), ..*self }
    }

    /// The observed map at the size of comparison.
    pub fn observed(&self) -> &DepthMap {
        &self.observed
    }

    /// Returns the log density of the observed map given rendered depths of the same size
    /// (`+inf` for background; never NaN).
    pub fn log_likelihood(
        &self,
        rendered: &[f32],
        width: u32,
        height: u32,
    ) -> Result<f64, VisionError> {
        self.log_likelihood_after(rendered, width, height, &mut DepthTally::default())
    }

    /// [`DepthLikelihood::log_likelihood`], bit for bit, computed only at the pixels whose
    /// rendered depth differs from that in the picture before. A tally belongs to one
    /// likelihood.
    pub fn log_likelihood_after(
        &self,
        rendered: &[f32],
        width: u32,
        height: u32,
        tally: &mut DepthTally,
    ) -> Result<f64, VisionError> {
        self.check(rendered, width, height)?;
        Ok(tally.follow(self, rendered))
    }

    /// Returns for each pixel the derivative of the log density with respect to its
    /// rendered depth; 0 if either is background.
    pub fn slopes(&self, rendered: &[f32]) -> Vec<f64> {
        let slope = |(o, r): (&f32, &f32)| {
            let (o, r) = (f64::from(*o), f64::from(*r));
            if !(o.is_finite() && r.is_finite()) {
                return 0.0;
            }
            let z = (o - r) / self.sd;
            let good = self.logs.inlier - 0.5 * z * z - self.logs.sd - LN_SQRT_2PI;
            let share = libm::exp(good - self.log_density(o, r));
            // Where the responsibility of the normal part is 0, z may be infinite.
            if share > 0.0 { share * z / self.sd } else { 0.0 }
        };
        self.observed.data.iter().zip(rendered).map(slope).collect()
    }

    /// Returns for each pixel the increase of the log density if the object covers it. A
    /// pixel beside the object takes the depth of an adjacent covered pixel; pixels
    /// farther away have gain 0.
    pub fn gains(&self, rendered: &[f32]) -> Vec<f64> {
        let width = self.observed.width as usize;
        let depth = |i: usize| rendered.get(i).copied().filter(|r| r.is_finite());
        let gain = |(i, o): (usize, &f32)| {
            let beside = [i.checked_sub(1), Some(i + 1), i.checked_sub(width), Some(i + width)];
            let r = depth(i).or_else(|| beside.into_iter().flatten().find_map(depth));
            r.map_or(0.0, |r| {
                self.log_density(f64::from(*o), f64::from(r))
                    - self.log_density(f64::from(*o), f64::INFINITY)
            })
        };
        self.observed.data.iter().enumerate().map(gain).collect()
    }

    /// Returns the log density of an observed depth given a rendered one.
    fn log_density(&self, observed: f64, rendered: f64) -> f64 {
        if observed.is_nan() {
            return 0.0;
        }
        match (observed.is_finite(), rendered.is_finite()) {
            (false, false) => self.logs.empty,
            (false, true) => self.logs.background,
            (true, false) => self.logs.outlier,
            (true, true) => {
                let z = (observed - rendered) / self.sd;
                let good = self.logs.inlier - 0.5 * z * z - self.logs.sd - LN_SQRT_2PI;
                let odd = self.logs.outlier;
                let (most, least) = if good > odd { (good, odd) } else { (odd, good) };
                most + libm::log1p(libm::exp(least - most))
            }
        }
    }

    fn check(&self, rendered: &[f32], width: u32, height: u32) -> Result<(), VisionError> {
        let own = &self.observed;
        if (own.width, own.height) != (width, height) || rendered.len() != own.data.len() {
            return Err(VisionError::size(
                own.width,
                own.height,
                format!("{width} x {height} ({} pixels)", rendered.len()),
            ));
        }
        // Without an early end, so that it vectorises.
        match rendered.iter().fold(false, |any, v| any | v.is_nan()) {
            true => Err(VisionError::Range {
                name: "rendered depth",
                rule: "a number",
                value: f64::NAN,
            }),
            false => Ok(()),
        }
    }

    /// Samples a depth map given rendered depths of the same size, without missing
    /// pixels. Inliers are drawn from the untruncated normal distribution, so a depth may
    /// be negative if `sd` is as large as the depths.
    pub fn simulate(&self, rendered: &[f32], rng: &mut Stream) -> Result<Vec<f32>, VisionError> {
        self.check(rendered, self.observed.width, self.observed.height)?;
        let draw = |&r: &f32| {
            if rng.uniform() < self.outlier {
                let background = rng.uniform() < 0.5;
                let depth = self.range.0 + (self.range.1 - self.range.0) * rng.uniform();
                if background { f32::INFINITY } else { depth as f32 }
            } else if r.is_finite() {
                (f64::from(r) + self.sd * rng.standard_normal()) as f32
            } else {
                f32::INFINITY
            }
        };
        Ok(rendered.iter().map(draw).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    const INF: f32 = f32::INFINITY;

    fn likelihood(data: Vec<f32>) -> DepthLikelihood {
        let n = data.len() as u32;
        DepthLikelihood::new(&DepthMap::new(n, 1, data).unwrap(), 0.1, 0.2, (0.5, 4.5)).unwrap()
    }

    #[test]
    fn integrates_to_one() {
        let l = likelihood(vec![1.0]);
        for rendered in [2.0, f64::INFINITY] {
            // Integrates over the range of depths only: the uniform part is inside it,
            // and the normal part practically so.
            let background = libm::exp(l.log_density(f64::INFINITY, rendered));
            let step = 1e-4;
            let depths: f64 = (0..40000)
                .map(|i| {
                    step * libm::exp(l.log_density(0.5 + (f64::from(i) + 0.5) * step, rendered))
                })
                .sum();
            assert!(
                (background + depths - 1.0).abs() < 1e-6,
                "{rendered}: {background} + {depths}"
            );
        }
    }

    #[test]
    fn values_by_hand() {
        let uniform = 0.1 / 4.0;
        let normal =
            |z: f64| 0.8 * (-0.5 * z * z).exp() / (0.1 * (2.0 * std::f64::consts::PI).sqrt());
        let l = likelihood(vec![1.0, 1.0, INF, INF, f32::NAN, 4.0]);
        let got = l.log_likelihood(&[1.0, INF, 2.0, INF, 3.0, 1.0], 6, 1).unwrap();
        let want = (normal(0.0) + uniform).ln()
            + uniform.ln()
            + 0.1f64.ln()
            + 0.9f64.ln()
            + (uniform + normal(30.0)).ln();
        assert!((got - want).abs() < 1e-9, "{got} {want}");
        // Outliers cost a bounded amount, and the result stays finite.
        assert!(l.log_likelihood(&[1e30, -1e30, 0.0, 0.0, 0.0, 1e38], 6, 1).unwrap().is_finite());
        assert!(l.log_likelihood(&[f32::NAN; 6], 6, 1).is_err());
        assert!(l.log_likelihood(&[1.0; 6], 3, 2).is_err());
    }

    #[test]
    fn a_tally_follows_rendered_maps_bit_for_bit() {
        let mut rng = StreamKey::new(5, 0, Purpose::PREDICT).stream(0, 0, 0);
        let mut depth = |lost: bool| match rng.index(5) {
            0 => INF,
            1 if lost => f32::NAN,
            _ => 0.5 + 4.0 * rng.uniform() as f32,
        };
        let n = 1000;
        let l = likelihood((0..n).map(|_| depth(true)).collect());
        let (mut tally, mut rendered) = (DepthTally::default(), vec![INF; n]);
        for step in 0..40 {
            for i in 0..[0, 1, 30, 900][step % 4] {
                rendered[(37 * step + i) % n] = depth(false);
            }
            let got = l.log_likelihood_after(&rendered, n as u32, 1, &mut tally).unwrap();
            let plain = l.log_likelihood(&rendered, n as u32, 1).unwrap();
            assert_eq!(got.to_bits(), plain.to_bits());
            let mut odd = rendered.clone();
            odd[step] = f32::NAN;
            assert!(l.log_likelihood_after(&odd, n as u32, 1, &mut tally).is_err());
            let one_by_one: f64 = (l.observed.data.iter().zip(&rendered))
                .map(|(o, r)| l.log_density(f64::from(*o), f64::from(*r)))
                .sum();
            assert!((plain - one_by_one).abs() < 1e-9 * one_by_one.abs());
        }
    }

    #[test]
    fn draws_follow_the_density() {
        let n = 20000;
        let l = likelihood(vec![1.0; n]);
        let mut rng = StreamKey::new(3, 0, Purpose::PREDICT).stream(0, 0, 0);
        let drawn = l.simulate(&vec![2.0; n], &mut rng).unwrap();
        let share =
            |f: &dyn Fn(f32) -> bool| drawn.iter().filter(|&&v| f(v)).count() as f64 / n as f64;
        assert!((share(&|v| v == INF) - 0.1).abs() < 0.01);
        assert!(
            (share(&|v| v.is_finite() && (v - 2.0).abs() > 0.4) - 0.1 * 3.2 / 4.0).abs() < 0.01
        );
        assert!(
            (share(&|v| (v - 2.0).abs() < 0.1) - (0.8 * 0.6827 + 0.1 * 0.2 / 4.0)).abs() < 0.015
        );
    }

    #[test]
    fn parameters_are_checked() {
        let map = DepthMap::new(1, 1, vec![1.0]).unwrap();
        for (sd, outlier, range) in [
            (0.0, 0.1, (0.0, 2.0)),
            (f64::NAN, 0.1, (0.0, 2.0)),
            (0.1, 0.0, (0.0, 2.0)),
            (0.1, 1.0, (0.0, 2.0)),
            (0.1, 0.1, (2.0, 0.0)),
            (0.1, 0.1, (0.0, f64::INFINITY)),
            (0.1, 0.1, (2.0, 3.0)),
        ] {
            assert!(
                DepthLikelihood::new(&map, sd, outlier, range).is_err(),
                "{sd} {outlier} {range:?}"
            );
        }
        assert!(DepthMap::new(2, 2, vec![1.0]).is_err());
    }

    #[test]
    fn files_and_sizes() {
        let grey =
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0u16, 8192]).unwrap();
        let mut png = std::io::Cursor::new(Vec::new());
        image::DynamicImage::ImageLuma16(grey).write_to(&mut png, image::ImageFormat::Png).unwrap();
        let limits = Limits::default();
        let map = decode(png.get_ref(), Some(4096.0), 0.0, &limits).unwrap();
        assert!(map.data()[0].is_nan() && map.data()[1] == 2.0, "0 is not measured");
        let map = decode(png.get_ref(), Some(4096.0), f64::NAN, &limits).unwrap();
        assert_eq!(map.data(), [INF, 2.0], "unless nothing is missing");
        let map = decode(png.get_ref(), Some(4096.0), 8192.0, &limits).unwrap();
        assert!(map.data()[0] == INF && map.data()[1].is_nan());
        assert!(decode(png.get_ref(), Some(0.0), 0.0, &limits).is_err());
        let mut bits = std::io::Cursor::new(Vec::new());
        let grey = image::GrayImage::from_raw(2, 1, vec![0, 200]).unwrap();
        image::DynamicImage::from(grey).write_to(&mut bits, image::ImageFormat::Png).unwrap();
        assert!(
            decode(bits.get_ref(), Some(1000.0), 0.0, &limits).is_err(),
            "8 bits are no depths"
        );
        let body: Vec<u8> =
            [0.0f32, -1.0, 3.0, f32::NAN].iter().flat_map(|v| v.to_le_bytes()).collect();
        let map =
            decode(&npy::bytes_of(1, "<f4", "False", "(2, 2)", &body), Some(1.0), -1.0, &limits);
        let map = map.unwrap();
        assert!(map.data()[0] == INF && map.data()[1].is_nan() && map.data()[2] == 3.0);
        let wide: Vec<u8> = [0u16, 65_535].iter().flat_map(|v| v.to_le_bytes()).collect();
        let wide = npy::bytes_of(1, "<u2", "False", "(1, 2)", &wide);
        assert_eq!(decode(&wide, Some(65.535), 0.0, &limits).unwrap().data()[1], 1000.0);
        let body: Vec<u8> =
            [0.0f32, -1.0, 3.0, f32::NAN].iter().flat_map(|v| v.to_le_bytes()).collect();
        let map = decode(
            &npy::bytes_of(1, "<f4", "False", "(2, 2)", &body),
            Some(1.0),
            f64::NAN,
            &limits,
        );
        let map = map.unwrap();
        assert!(map.data()[..3] == [INF, INF, 3.0] && map.data()[3].is_nan());
        let big = map.resized(4, 4);
        assert_eq!(
            (big.data()[0], big.data()[5], big.data()[8], big.data()[13]),
            (INF, INF, 3.0, 3.0)
        );
        assert_eq!(big.resized(2, 2).data()[2], 3.0);
    }
}
