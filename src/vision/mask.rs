//! Masks, and how probable an observed one is given a rendered one.

use super::photo::decode;
use super::{Limits, VisionError};
use crate::rng::Stream;

/// Which pixels show the object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row.
    pub values: Vec<bool>,
}

impl Mask {
    /// Reads a picture: bright, or not transparent, is the object.
    ///
    /// # Errors
    /// As [`super::Photo::decode`].
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Mask, VisionError> {
        let image = decode(bytes, limits)?.to_luma_alpha8();
        let values = image.pixels().map(|p| p.0[0] >= 128 && p.0[1] >= 128).collect();
        Ok(Mask { width: image.width(), height: image.height(), values })
    }

    /// At another size: the value at each new pixel's centre.
    pub fn resized(&self, width: u32, height: u32) -> Mask {
        let values = resized(&self.values, (self.width, self.height), (width, height));
        Mask { width, height, values }
    }
}

/// Nearest-pixel resampling.
pub(super) fn resized<T: Copy>(values: &[T], old: (u32, u32), new: (u32, u32)) -> Vec<T> {
    let place = |i: u32, n: u32, o: u32| ((2 * u64::from(i) + 1) * u64::from(o) / (2 * u64::from(n.max(1)))) as usize;
    let mut out = Vec::with_capacity(new.0 as usize * new.1 as usize);
    for y in 0..new.1 {
        let row = place(y, new.1, old.1) * old.0 as usize;
        out.extend((0..new.0).filter_map(|x| values.get(row + place(x, new.0, old.0)).copied()));
    }
    out
}

/// The density of an observed mask: each pixel is the rendered one, flipped with a small probability.
#[derive(Clone, Debug)]
pub struct MaskLikelihood {
    observed: Mask,
    /// Log probabilities of an observed value, by rendered and observed.
    table: [[f64; 2]; 2],
    eps: [f64; 2],
}

impl MaskLikelihood {
    /// Prepares an observed mask for frames of a size. `eps_in` is the probability that a pixel of the object is observed
    /// as background, `eps_out` the other way round; both above 0 and below 1.
    ///
    /// # Errors
    /// If a probability is not.
    pub fn prepare(observed: &Mask, width: u32, height: u32, eps_in: f64, eps_out: f64) -> Result<Self, VisionError> {
        for (name, e) in [("eps_in", eps_in), ("eps_out", eps_out)] {
            if !(e > 0.0 && e < 1.0) {
                return Err(VisionError::Array(format!("`{name}` must be above 0 and below 1, got {e}")));
            }
        }
        let (ln, ln1p) = (libm::log, libm::log1p);
        let table = [[ln1p(-eps_out), ln(eps_out)], [ln(eps_in), ln1p(-eps_in)]];
        Ok(MaskLikelihood { observed: observed.resized(width, height), table, eps: [eps_in, eps_out] })
    }

    /// The log probability of the observed mask given the rendered one; pixels the rendered one lacks are background.
    pub fn log_likelihood(&self, rendered: impl Iterator<Item = bool>) -> f64 {
        let rendered = rendered.chain(std::iter::repeat(false));
        // Counted, so that the sum does not depend on the order.
        let mut counts = [[0u64; 2]; 2];
        for (o, r) in self.observed.values.iter().zip(rendered) {
            counts[usize::from(r)][usize::from(*o)] += 1;
        }
        (0..4).map(|k| counts[k / 2][k % 2] as f64 * self.table[k / 2][k % 2]).sum()
    }

    /// An observation of a rendered mask.
    pub fn simulate(&self, rendered: &[bool], rng: &mut Stream) -> Vec<bool> {
        rendered.iter().map(|r| r ^ (rng.uniform() < self.eps[usize::from(!r)])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, StreamKey};

    #[test]
    fn probabilities_of_all_masks_sum_to_one() {
        let rendered = [true, false, false, true];
        let total: f64 = (0..16u32)
            .map(|bits| {
                let values = (0..4).map(|i| bits >> i & 1 == 1).collect();
                let l = MaskLikelihood::prepare(&Mask { width: 2, height: 2, values }, 2, 2, 0.1, 0.02).unwrap();
                l.log_likelihood(rendered.into_iter()).exp()
            })
            .sum();
        assert!((total - 1.0).abs() < 1e-12);
    }

    #[test]
    fn simulation_flips_as_often_as_it_should() {
        let rendered: Vec<bool> = (0..20_000).map(|i| i % 2 == 0).collect();
        let observed = Mask { width: 200, height: 100, values: rendered.clone() };
        let l = MaskLikelihood::prepare(&observed, 200, 100, 0.1, 0.02).unwrap();
        let seen = l.simulate(&rendered, &mut StreamKey::new(1, 0, Purpose::PREDICT).stream(0, 0, 0));
        let lost = (0..20_000).filter(|i| rendered[*i] && !seen[*i]).count() as f64 / 10_000.0;
        let false_ones = (0..20_000).filter(|i| !rendered[*i] && seen[*i]).count() as f64 / 10_000.0;
        assert!((lost - 0.1).abs() < 0.02 && (false_ones - 0.02).abs() < 0.01, "{lost} {false_ones}");
        assert!(MaskLikelihood::prepare(&observed, 2, 2, 0.0, 0.1).is_err());
        assert!(MaskLikelihood::prepare(&observed, 2, 2, 0.1, f64::NAN).is_err());
    }

    #[test]
    fn resizing_keeps_the_shape() {
        let m = Mask { width: 4, height: 2, values: vec![true, true, false, false, true, true, false, false] };
        assert_eq!(m.resized(2, 1).values, [true, false]);
        assert_eq!(m.resized(8, 2).values.iter().filter(|v| **v).count(), 8);
    }
}
