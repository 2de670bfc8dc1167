//! Masks (which pixels show the object), and the likelihood of an observed mask given a
//! rendered one. There is no segmentation here: masks come from files or from elsewhere
//! in the program.

use super::error::VisionError;
use super::npy;
use super::pictures::palette::palette_entries;
use super::pictures::photo::resize_rows;
use super::pictures::photo::{Limits, decode_dynamic, is_png};
use image::DynamicImage;
use pcadlang_numerics::num::simd::vectorised;
use pcadlang_numerics::rng::Stream;

/// A mask, true on the object. `data` has `width * height` entries in row-major order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    width: u32,
    height: u32,
    data: Vec<bool>,
}

impl Mask {
    /// Builds a mask from `width * height` pixels in row-major order, true on the object.
    pub fn new(width: u32, height: u32, data: Vec<bool>) -> Result<Self, VisionError> {
        if data.len() as u64 != u64::from(width) * u64::from(height) || data.is_empty() {
            return Err(VisionError::size(width, height, format!("{} pixels", data.len())));
        }
        Ok(Mask { width, height, data })
    }

    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The pixels, in row-major order.
    pub fn data(&self) -> &[bool] {
        &self.data
    }

    /// True if a position is on the object: the fractions of the width and of the height at
    /// which it is, 0 to 1.
    pub fn at(&self, [x, y]: [f64; 2]) -> bool {
        let pixel = |x: f64, n: u32| ((x * f64::from(n)) as u32).min(n - 1) as usize;
        self.data[pixel(y, self.height) * self.width as usize + pixel(x, self.width)]
    }

    /// Returns left, top, right and bottom of the object, in its own pixels; `None` if it is
    /// empty.
    pub fn bounds(&self) -> Option<[f64; 4]> {
        let row = self.width as usize;
        let on = || (0..self.data.len()).filter(|i| self.data[*i]);
        let (left, right) = (on().map(|i| i % row).min()?, on().map(|i| i % row).max()?);
        let (top, bottom) = (on().next()? / row, on().next_back()? / row);
        Some([left, top, right + 1, bottom + 1].map(|n| n as f64))
    }

    /// Returns the intersection over union with another mask at this one's size; 0 if both
    /// are empty.
    pub fn overlap(&self, other: &Mask) -> f64 {
        let other = other.resized(self.width, self.height);
        let pairs = || self.data.iter().zip(&other.data);
        let both = pairs().filter(|(a, b)| **a && **b).count();
        both as f64 / pairs().filter(|(a, b)| **a || **b).count().max(1) as f64
    }

    /// Returns the mask at another size (at least 1 x 1): a pixel is on the object if at
    /// least half of its area is.
    pub fn resized(&self, width: u32, height: u32) -> Mask {
        let (width, height) = (width.max(1), height.max(1));
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        let w = self.width as usize;
        let area = resize_rows((self.width, self.height), (width, height), |j, row| {
            for (p, &m) in row.iter_mut().zip(self.data.iter().skip(j as usize * w)) {
                *p = [f32::from(u8::from(m))];
            }
        });
        // Slightly less than a half, because sums of areas are rounded.
        Mask { width, height, data: area.into_iter().map(|[a]| a >= 0.4999).collect() }
    }
}

/// Reads a mask from the bytes of a picture or of a `.npy` array of two axes. On the object are
/// pixels equal to `label`, a grey value, an entry of the palette or a number; without one:
///
/// * opaque pixels, if any pixels are transparent;
/// * bright pixels, of at least half of the type's range (above 0.5 for floats); if a PNG or an array
///   of whole numbers has none, it holds labels, and those that are not 0;
/// * in a PNG with a palette the entries that are not 0, nor 255 ("void" in PASCAL VOC) if there
///   are others.
///
/// # Errors
/// If the bytes cannot be read, or a label is asked of colours.
pub fn decode(bytes: &[u8], label: Option<u32>, limits: &Limits) -> Result<Mask, VisionError> {
    if npy::is_npy(bytes) {
        let array = npy::parse(bytes)?;
        let (width, height) = array.picture_size()?;
        limits.check(width, height)?;
        let numbers = |v: Vec<f64>| match label {
            Some(n) => v.into_iter().map(|x| x == f64::from(n)).collect(),
            None => v.into_iter().map(|x| x > 0.5).collect(),
        };
        let data = match array.data {
            npy::NpyData::Bool(v) => on(v.into_iter().map(u32::from), label, 1),
            npy::NpyData::U8(v) => on(v.into_iter().map(u32::from), label, 128),
            npy::NpyData::F32(v) => numbers(v.into_iter().map(f64::from).collect()),
            npy::NpyData::F64(v) | npy::NpyData::Whole(v) => numbers(v),
        };
        return Mask::new(width, height, data);
    }
    if let Some((width, height, entries)) = palette_entries(bytes, limits)? {
        let others = entries.iter().any(|e| !matches!(e, 0 | 255));
        let entry = |e: u8| if label.is_none() && others && e == 255 { 0 } else { u32::from(e) };
        return Mask::new(width, height, on(entries.into_iter().map(entry), label, 1));
    }
    let (picture, _) = decode_dynamic(bytes, limits)?;
    let (width, height) = (picture.width(), picture.height());
    let data = match picture {
        DynamicImage::ImageLuma8(p) if is_png(bytes) => {
            on(p.into_raw().into_iter().map(u32::from), label, 0x80)
        }
        DynamicImage::ImageLuma16(p) => on(p.into_raw().into_iter().map(u32::from), label, 0x8000),
        _ if label.is_some() => {
            return Err(VisionError::Damaged(
                "labels are read from a PNG that is grey or has a palette, or from a .npy array; \
                 this picture has colours"
                    .into(),
            ));
        }
        picture => {
            let rgba = picture.color().has_alpha().then(|| picture.to_rgba8());
            match rgba.filter(|p| p.pixels().any(|p| p.0[3] < 255)) {
                Some(rgba) => rgba.pixels().map(|p| p.0[3] >= 128).collect(),
                None => picture.into_luma8().pixels().map(|p| p.0[0] >= 128).collect(),
            }
        }
    };
    Mask::new(width, height, data)
}

/// Returns which values are a label, or without one on the object: those of at least `half`, or
/// if there are none those that are not 0.
fn on(values: impl Iterator<Item = u32> + Clone, label: Option<u32>, half: u32) -> Vec<bool> {
    let least = if values.clone().any(|v| v >= half) { half } else { 1 };
    values.map(|v| label.map_or(v >= least, |n| v == n)).collect()
}

/// The likelihood of an observed mask given a rendered one: every pixel is observed
/// wrongly and independently, with one probability on the rendered object and another
/// outside it. It is normalised over all masks of one size.
#[derive(Clone, Debug)]
pub struct MaskLikelihood {
    observed: Mask,
    eps_in: f64,
    eps_out: f64,
    /// The log probabilities of a pixel that is not observed on the object, and of one that is,
    /// by the covered parts of [`PARTS`]: drawn fractions are whole numbers of them.
    logs: Vec<[f64; 2]>,
    /// Their derivatives with respect to the fraction.
    slopes: Vec<[f64; 2]>,
}

/// The samples of a pixel from which fractions are drawn.
const PARTS: usize = 256;

impl MaskLikelihood {
    /// Builds the likelihood of `observed` at its own size. `eps_in` is the probability
    /// that a pixel of the rendered object is observed as background; `eps_out` that a
    /// pixel outside it is observed as object. Both must be strictly between 0 and 1.
    pub fn new(observed: &Mask, eps_in: f64, eps_out: f64) -> Result<Self, VisionError> {
        for (name, value) in [("eps_in", eps_in), ("eps_out", eps_out)] {
            if !(value > 0.0 && value < 1.0) {
                return Err(VisionError::Range { name, rule: "strictly between 0 and 1", value });
            }
        }
        let (logs, slopes, observed) = (Vec::new(), Vec::new(), observed.clone());
        let mut all = MaskLikelihood { observed, eps_in, eps_out, logs, slopes };
        for k in 0..=PARTS {
            let fraction = k as f64 / PARTS as f64;
            all.logs.push([false, true].map(|o| libm::log(all.probability(fraction, o))));
            all.slopes.push([false, true].map(|o| all.slope(fraction, o)));
        }
        Ok(all)
    }

    /// Returns the likelihood at the rendered size: a pixel is observed on the object if
    /// at least half of its area is.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        MaskLikelihood { observed: self.observed.resized(width, height), ..self.clone() }
    }

    /// The observed mask at the size of comparison.
    pub fn observed(&self) -> &Mask {
        &self.observed
    }

    fn check(&self, pixels: usize, width: u32, height: u32) -> Result<(), VisionError> {
        let own = &self.observed;
        if (own.width, own.height) != (width, height) || pixels != own.data.len() {
            return Err(VisionError::size(
                own.width,
                own.height,
                format!("{width} x {height} ({pixels} pixels)"),
            ));
        }
        Ok(())
    }

    /// Returns the log probability of the observed mask given a rendered one of the same
    /// size.
    pub fn log_likelihood(
        &self,
        rendered: &[bool],
        width: u32,
        height: u32,
    ) -> Result<f64, VisionError> {
        self.check(rendered.len(), width, height)?;
        // In pieces whose counts fit into bytes, so that it vectorises.
        let count = |of: fn(bool, bool) -> bool| -> usize {
            let one = |(r, o): (&[bool], &[bool])| {
                let count = |n: u8, (r, o): (&bool, &bool)| n + u8::from(of(*r, *o));
                usize::from(r.iter().zip(o).fold(0, count))
            };
            rendered.chunks(255).zip(self.observed.data.chunks(255)).map(one).sum()
        };
        let (drawn, seen, both) = vectorised(
            #[inline(always)]
            || (count(|r, _| r), count(|_, o| o), count(|r, o| r & o)),
        );
        let counts = [[rendered.len() + both - drawn - seen, seen - both], [drawn - both, both]];
        Ok(counts[1][1] as f64 * libm::log1p(-self.eps_in)
            + counts[1][0] as f64 * libm::log(self.eps_in)
            + counts[0][1] as f64 * libm::log(self.eps_out)
            + counts[0][0] as f64 * libm::log1p(-self.eps_out))
    }

    /// Returns for each pixel the increase of the log probability if the object covers
    /// it.
    pub fn gains(&self) -> Vec<f64> {
        let (seen, unseen) = (
            libm::log1p(-self.eps_in) - libm::log(self.eps_out),
            libm::log(self.eps_in) - libm::log1p(-self.eps_out),
        );
        self.observed.data.iter().map(|o| if *o { seen } else { unseen }).collect()
    }

    /// Returns the log probability of the observed mask given the fraction of every pixel
    /// that the rendered object covers (0..=1); a partly covered pixel mixes the two
    /// cases. Values of 0 and 1 give [`MaskLikelihood::log_likelihood`].
    pub fn log_likelihood_coverage(
        &self,
        coverage: &[f32],
        width: u32,
        height: u32,
    ) -> Result<f64, VisionError> {
        self.check(coverage.len(), width, height)?;
        if let Some(sum) = self.log_likelihood_parts(coverage) {
            return Ok(sum);
        }
        let mut sum = 0.0;
        for (&c, &o) in coverage.iter().zip(&self.observed.data) {
            let c = f64::from(c);
            if !(0.0..=1.0).contains(&c) {
                return Err(VisionError::Range {
                    name: "coverage",
                    rule: "between 0 and 1",
                    value: c,
                });
            }
            sum += libm::log(self.probability(c, o));
        }
        Ok(sum)
    }

    /// The same where all fractions are whole numbers of [`PARTS`]; `None` if they are not.
    fn log_likelihood_parts(&self, coverage: &[f32]) -> Option<f64> {
        let mut places = vec![0u16; coverage.len()];
        let all_whole = vectorised(
            #[inline(always)]
            || {
                let mut all_whole = true;
                let pixels = coverage.iter().zip(&self.observed.data);
                for (place, (c, o)) in places.iter_mut().zip(pixels) {
                    let parts = c * PARTS as f32;
                    let whole = parts as i32;
                    all_whole &= (whole as f32 == parts) & (whole >= 0) & (whole <= PARTS as i32);
                    *place = (2 * whole) as u16 + u16::from(*o);
                }
                all_whole
            },
        );
        let logs = self.logs.as_flattened();
        let of = |place: &u16| logs.get(usize::from(*place)).copied().unwrap_or_default();
        // Four sums, none of which waits for another.
        let (fours, rest) = places.as_chunks::<4>();
        let mut sums = [0.0; 4];
        for four in fours {
            sums.iter_mut().zip(four).for_each(|(sum, place)| *sum += of(place));
        }
        let sum = sums.iter().sum::<f64>() + rest.iter().map(of).sum::<f64>();
        all_whole.then_some(sum)
    }

    /// The probability of what is observed at a pixel of which this fraction is covered.
    fn probability(&self, fraction: f64, observed: bool) -> f64 {
        let [miss, hit] = self.ends(observed);
        fraction * hit + (1.0 - fraction) * miss
    }

    /// The same without and with the object there.
    fn ends(&self, observed: bool) -> [f64; 2] {
        match observed {
            true => [self.eps_out, 1.0 - self.eps_in],
            false => [1.0 - self.eps_out, self.eps_in],
        }
    }

    /// Returns the derivative of [`MaskLikelihood::log_likelihood_coverage`] with respect to
    /// the fraction of a pixel that is covered, at a fraction; 0 if there is no such pixel.
    pub fn gain_coverage(&self, pixel: usize, fraction: f32) -> f64 {
        let Some(observed) = self.observed.data.get(pixel) else { return 0.0 };
        let parts = fraction * PARTS as f32;
        let whole = parts as usize;
        match self.slopes.get(whole).filter(|_| whole as f32 == parts) {
            Some(slopes) => slopes[usize::from(*observed)],
            None => self.slope(f64::from(fraction), *observed),
        }
    }

    fn slope(&self, fraction: f64, observed: bool) -> f64 {
        let [miss, hit] = self.ends(observed);
        (hit - miss) / self.probability(fraction, observed)
    }

    /// Samples a mask given the fraction of every pixel that the rendered object covers.
    pub fn simulate_coverage(
        &self,
        coverage: &[f32],
        rng: &mut Stream,
    ) -> Result<Mask, VisionError> {
        self.check(coverage.len(), self.observed.width, self.observed.height)?;
        let draw = |c: &f32| rng.uniform() < self.probability(f64::from(*c), true);
        let data = coverage.iter().map(draw).collect();
        Ok(Mask { data, ..self.observed })
    }

    /// Samples a mask given a rendered one of the same size.
    pub fn simulate(&self, rendered: &[bool], rng: &mut Stream) -> Result<Mask, VisionError> {
        self.check(rendered.len(), self.observed.width, self.observed.height)?;
        let data = rendered
            .iter()
            .map(|&r| (rng.uniform() < if r { self.eps_in } else { self.eps_out }) != r)
            .collect();
        Ok(Mask { data, ..self.observed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    #[test]
    fn positions_and_overlaps_are_those_of_the_pixels() {
        let left = Mask::new(4, 1, vec![true, true, false, false]).unwrap();
        let wide = Mask::new(2, 1, vec![true, true]).unwrap();
        assert_eq!((left.overlap(&left), left.overlap(&wide)), (1.0, 0.5));
        assert_eq!([0.0, 0.49, 0.5, 1.0].map(|x| left.at([x, 1.0])), [true, true, false, false]);
        let empty = Mask::new(4, 1, vec![false; 4]).unwrap();
        assert_eq!((left.overlap(&empty), empty.overlap(&empty)), (0.0, 0.0));
    }

    #[test]
    fn probabilities_of_all_masks_sum_to_one() {
        let soft = [0.0, 1.0, 0.3, 0.5, 0.9, 1.0];
        let hard = [false, true, true, false, true, false];
        let (mut a, mut b) = (0.0, 0.0);
        for bits in 0..64u32 {
            let mask = Mask::new(3, 2, (0..6).map(|i| bits >> i & 1 == 1).collect()).unwrap();
            let l = MaskLikelihood::new(&mask, 0.07, 0.2).unwrap();
            a += libm::exp(l.log_likelihood(&hard, 3, 2).unwrap());
            b += libm::exp(l.log_likelihood_coverage(&soft, 3, 2).unwrap());
            let sum = |soft: &[f32]| l.log_likelihood_coverage(soft, 3, 2).unwrap();
            let mut moved = soft;
            moved[3] += 0.001;
            let slope = (sum(&moved) - sum(&soft)) / f64::from(moved[3] - soft[3]);
            assert!((slope - l.gain_coverage(3, 0.5005)).abs() < 1e-4);
            let same =
                l.log_likelihood_coverage(&hard.map(|h| f32::from(u8::from(h))), 3, 2).unwrap();
            assert!((same - l.log_likelihood(&hard, 3, 2).unwrap()).abs() < 1e-12);
        }
        assert!((a - 1.0).abs() < 1e-12 && (b - 1.0).abs() < 1e-12);
    }

    #[test]
    fn draws_have_the_stated_rates() {
        let rendered: Vec<bool> = (0..200 * 200).map(|i| i % 200 < 100).collect();
        let l = MaskLikelihood::new(&Mask::new(200, 200, rendered.clone()).unwrap(), 0.1, 0.03)
            .unwrap();
        let mut rng = StreamKey::new(1, 0, Purpose::PREDICT).stream(0, 0, 0);
        let drawn = l.simulate(&rendered, &mut rng).unwrap();
        let wrong = |on: bool| {
            (0..40000).filter(|&i| rendered[i] == on && drawn.data[i] != on).count() as f64
                / 20000.0
        };
        // Standard errors are 0.0021 and 0.0012.
        assert!((wrong(true) - 0.1).abs() < 0.01 && (wrong(false) - 0.03).abs() < 0.006);
    }

    #[test]
    fn sizes_and_parameters_are_checked() {
        let mask = Mask::new(2, 1, vec![true, false]).unwrap();
        assert!(Mask::new(2, 2, vec![true]).is_err() && Mask::new(0, 0, vec![]).is_err());
        for eps in [0.0, 1.0, -0.1, f64::NAN] {
            assert!(MaskLikelihood::new(&mask, eps, 0.1).is_err());
            assert!(MaskLikelihood::new(&mask, 0.1, eps).is_err());
        }
        let l = MaskLikelihood::new(&mask, 0.1, 0.1).unwrap();
        assert!(l.log_likelihood(&[true, false], 1, 2).is_err());
        assert!(l.log_likelihood(&[true], 2, 1).is_err());
        assert!(l.log_likelihood_coverage(&[f32::NAN, 0.0], 2, 1).is_err());
        assert!(l.resized(1, 1).observed().data()[0]);
        assert!(
            l.resized(4, 2)
                .log_likelihood(&[true, true, false, false, true, true, false, false], 4, 2)
                .is_ok()
        );
    }

    #[test]
    fn masks_from_arrays_and_pictures() {
        let u8s = npy::bytes_of(1, "|u1", "False", "(1, 2)", &[0, 1]);
        assert_eq!(decode(&u8s, None, &Limits::default()).unwrap().data(), [false, true]);
        let u8s = npy::bytes_of(1, "|u1", "False", "(2, 1)", &[200, 1]);
        assert_eq!(decode(&u8s, None, &Limits::default()).unwrap().data(), [true, false]);
        let f32s: Vec<u8> = [0.0f32, 0.5, 0.51, 1.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let f32s = npy::bytes_of(1, "<f4", "False", "(1, 4)", &f32s);
        assert_eq!(
            decode(&f32s, None, &Limits::default()).unwrap().data(),
            [false, false, true, true]
        );
        let f64s: Vec<u8> = [0.5f64, 0.75].iter().flat_map(|x| x.to_le_bytes()).collect();
        let f64s = npy::bytes_of(1, "<f8", "False", "(1, 2)", &f64s);
        assert_eq!(decode(&f64s, None, &Limits::default()).unwrap().data(), [false, true]);
        let png = |picture: image::DynamicImage| {
            let mut out = std::io::Cursor::new(Vec::new());
            picture.write_to(&mut out, image::ImageFormat::Png).unwrap();
            out.into_inner()
        };
        let grey = image::GrayImage::from_raw(3, 1, vec![0, 255, 100]).unwrap();
        assert_eq!(
            decode(&png(grey.into()), None, &Limits::default()).unwrap().data(),
            [false, true, false]
        );
        // Labels: of 0 and 1, of 16 bits, and those above half as the bright ones.
        let limits = Limits::default();
        let read = |bytes: &[u8], label| decode(bytes, label, &limits).unwrap().data().to_vec();
        let small = image::GrayImage::from_raw(4, 1, vec![0, 1, 2, 100]).unwrap();
        let small = png(small.into());
        assert_eq!(read(&small, None), [false, true, true, true]);
        assert_eq!(read(&small, Some(2)), [false, false, true, false]);
        let wide = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(3, 1, vec![0, 1, 300]);
        let wide = png(wide.unwrap().into());
        assert_eq!(read(&wide, None), [false, true, true]);
        assert_eq!(read(&wide, Some(300)), [false, false, true]);
        let cut = image::RgbaImage::from_raw(2, 1, vec![255, 255, 255, 0, 0, 0, 0, 255]).unwrap();
        assert_eq!(
            decode(&png(cut.into()), None, &Limits::default()).unwrap().data(),
            [false, true]
        );
    }
}
