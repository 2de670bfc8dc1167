//! Counter-based random streams: Philox4x64-10 (Salmon, Moraes, Dror & Shaw 2011,
//! "Parallel random numbers: as easy as 1, 2, 3").
//!
//! A stream is a function of a key (seed, chain, purpose) and a position (step, site,
//! lane). There is no other state, so results do not depend on the order of requests or
//! on the number of threads.

use rand::TryRng;
use std::convert::Infallible;

/// The purpose of a stream's numbers; streams of different purposes are independent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Purpose(pub u32);

impl Purpose {
    /// Values of choices inside a trace.
    pub const VALUES: Purpose = Purpose(1);
    /// Decisions of kernels.
    pub const KERNEL: Purpose = Purpose(2);
    /// Starts of chains.
    pub const START: Purpose = Purpose(3);
    /// Predictions, and other draws that do not affect a chain.
    pub const PREDICT: Purpose = Purpose(4);
    /// The selection of kernels in a mixture.
    pub const MIX: Purpose = Purpose(5);
    /// Resampling of a population.
    pub const POPULATION: Purpose = Purpose(6);
    /// Draws from the prior as ground truth for simulated data.
    pub const TRUTH: Purpose = Purpose(7);
    /// Replicated observations.
    pub const REPLICATE: Purpose = Purpose(8);
}

/// The part of a stream's identity that is constant during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct StreamKey {
    seed: u64,
    chain_and_purpose: u64,
}

impl StreamKey {
    /// Makes the key of a chain's streams for a purpose.
    pub fn new(seed: u64, chain: u32, purpose: Purpose) -> Self {
        StreamKey { seed, chain_and_purpose: u64::from(chain) << 32 | u64::from(purpose.0) }
    }

    /// Returns the stream of a step, a site (the hash of an address), and a lane that
    /// distinguishes alternatives. No numbers are generated until the first request.
    pub fn stream(&self, step: u64, site: u64, substream: u64) -> Stream {
        Stream {
            key: [self.seed, self.chain_and_purpose],
            counter: [0, step, site, substream],
            block: [0; 4],
            used: 4,
        }
    }
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u64; 2],
    counter: [u64; 4],
    block: [u64; 4],
    used: u8,
}

/// Ten rounds of Philox4x64.
fn philox(mut counter: [u64; 4], mut key: [u64; 2]) -> [u64; 4] {
    for round in 0..10 {
        if round > 0 {
            key = [
                key[0].wrapping_add(0x9E37_79B9_7F4A_7C15),
                key[1].wrapping_add(0xBB67_AE85_84CA_A73B),
            ];
        }
        let a = u128::from(counter[0]) * 0xD2E7_470E_E14C_6C93;
        let b = u128::from(counter[2]) * 0xCA5A_8263_9512_1157;
        counter = [
            (b >> 64) as u64 ^ counter[1] ^ key[0],
            b as u64,
            (a >> 64) as u64 ^ counter[3] ^ key[1],
            a as u64,
        ];
    }
    counter
}

impl Stream {
    /// Returns the next 64 bits.
    #[inline]
    pub fn next_u64(&mut self) -> u64 {
        if self.used == 4 {
            self.block = philox(self.counter, self.key);
            self.counter[0] += 1;
            self.used = 0;
        }
        let x = self.block[self.used as usize];
        self.used += 1;
        x
    }

    /// Samples a number in [0, 1), a multiple of 2^-53.
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Samples a number in (0, 1).
    #[inline]
    pub fn open_uniform(&mut self) -> f64 {
        ((self.next_u64() >> 12) as f64 + 0.5) * (1.0 / (1u64 << 52) as f64)
    }

    /// Samples a standard normal number.
    #[inline]
    pub fn standard_normal(&mut self) -> f64 {
        self.sample(rand_distr::StandardNormal)
    }

    /// Samples an index below `n` without bias (Lemire 2019); 0 for n = 0.
    #[inline]
    pub fn index(&mut self, n: usize) -> usize {
        let n = n as u64;
        let mut product = u128::from(self.next_u64()) * u128::from(n);
        if (product as u64) < n {
            let threshold = n.wrapping_neg() % n.max(1);
            while (product as u64) < threshold {
                product = u128::from(self.next_u64()) * u128::from(n);
            }
        }
        (product >> 64) as usize
    }

    /// Samples an index with probability proportional to its weight; `total` is the sum
    /// of the weights. An index of weight 0 is never chosen, except the last one if all
    /// weights are 0.
    #[inline]
    pub fn weighted(&mut self, weights: &[f64], total: f64) -> usize {
        self.weighted_by(weights.iter().copied(), total)
    }

    /// [`Stream::weighted`] with weights that are in no slice.
    #[inline]
    pub fn weighted_by(&mut self, weights: impl Iterator<Item = f64>, total: f64) -> usize {
        // Without a positive weight it is the last one.
        let (mut u, mut last, mut n, mut any) = (self.uniform() * total, 0, 0, false);
        for (i, w) in weights.enumerate() {
            n = i;
            if w > 0.0 {
                (last, any) = (i, true);
                if u < w {
                    break;
                }
                u -= w;
            }
        }
        if any { last } else { n }
    }

    /// Samples from one of `rand_distr`'s distributions.
    pub fn sample<T>(&mut self, d: impl rand_distr::Distribution<T>) -> T {
        d.sample(self)
    }
}

impl TryRng for Stream {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok((self.next_u64() >> 32) as u32)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(self.next_u64())
    }

    fn try_fill_bytes(&mut self, dst: &mut [u8]) -> Result<(), Infallible> {
        for chunk in dst.chunks_mut(8) {
            let word = self.next_u64().to_le_bytes();
            chunk.copy_from_slice(&word[..chunk.len()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers_of_random123() {
        assert_eq!(
            philox([0; 4], [0; 2]),
            [0x16554d9eca36314c, 0xdb20fe9d672d0fdc, 0xd7e772cee186176b, 0x7e68b68aec7ba23b]
        );
        assert_eq!(
            philox([u64::MAX; 4], [u64::MAX; 2]),
            [0x87b092c3013fe90b, 0x438c3c67be8d0224, 0x9cc7d7c69cd777b6, 0xa09caebf594f0ba0]
        );
        assert_eq!(
            philox(
                [0x243f6a8885a308d3, 0x13198a2e03707344, 0xa4093822299f31d0, 0x082efa98ec4e6c89],
                [0x452821e638d01377, 0xbe5466cf34e90c6c]
            ),
            [0xa528f45403e61d95, 0x38c72dbd566e9788, 0xa5a1610e72fd18b5, 0x57bd43b5e52b7fe6]
        );
    }

    #[test]
    fn places_have_streams_of_their_own() {
        let key = StreamKey::new(1, 0, Purpose::VALUES);
        let first = |mut s: Stream| (0..6).map(|_| s.next_u64()).collect::<Vec<_>>();
        let base = first(key.stream(5, 9, 0));
        assert_eq!(base, first(key.stream(5, 9, 0)), "the same place gives the same numbers");
        for other in [
            key.stream(6, 9, 0),
            key.stream(5, 10, 0),
            key.stream(5, 9, 1),
            StreamKey::new(2, 0, Purpose::VALUES).stream(5, 9, 0),
            StreamKey::new(1, 1, Purpose::VALUES).stream(5, 9, 0),
            StreamKey::new(1, 1 << 31, Purpose::VALUES).stream(5, 9, 0),
            StreamKey::new(1, 0, Purpose::KERNEL).stream(5, 9, 0),
        ] {
            assert!(first(other).iter().all(|x| !base.contains(x)));
        }
    }

    #[test]
    fn neighbouring_streams_are_uniform_and_uncorrelated() {
        let key = StreamKey::new(7, 3, Purpose::VALUES);
        let n = 40_000;
        let xs: Vec<f64> = (0..n).map(|i| key.stream(i, 1, 0).uniform()).collect();
        let mut bins = [0u32; 20];
        xs.iter().for_each(|x| bins[(x * 20.0) as usize] += 1);
        let expected = n as f64 / 20.0;
        let chi2: f64 = bins.iter().map(|b| (f64::from(*b) - expected).powi(2) / expected).sum();
        assert!(chi2 < 75.0, "chi-square with 19 degrees of freedom: {chi2}");
        let lag: f64 =
            xs.windows(2).map(|w| (w[0] - 0.5) * (w[1] - 0.5)).sum::<f64>() * 12.0 / n as f64;
        assert!(lag.abs() < 5.0 / (n as f64).sqrt(), "lag-1 correlation {lag}");
    }

    #[test]
    fn indices_are_in_range_and_even() {
        let mut s = StreamKey::new(0, 0, Purpose::KERNEL).stream(0, 0, 0);
        let mut counts = [0u32; 7];
        (0..70_000).for_each(|_| counts[s.index(7)] += 1);
        assert!(counts.iter().all(|c| (f64::from(*c) - 10_000.0).abs() < 600.0), "{counts:?}");
        assert_eq!(s.index(1), 0);
    }

    #[test]
    fn indices_below_large_numbers_are_even() {
        // n is 3/8 of the range, so wrongly kept or rejected draws are common enough to
        // show.
        let n = 3usize << (usize::BITS - 3);
        let mut s = StreamKey::new(0, 0, Purpose::KERNEL).stream(2, 0, 0);
        let mut counts = [0u32; 3];
        (0..30_000).for_each(|_| counts[s.index(n) % 3] += 1);
        assert!(counts.iter().all(|c| (f64::from(*c) - 10_000.0).abs() < 500.0), "{counts:?}");
    }

    #[test]
    fn weights_of_zero_are_never_chosen() {
        // Half of the products with the smallest positive double round up to it, beyond
        // every weight.
        let (tiny, mut s) =
            (f64::from_bits(1), StreamKey::new(0, 0, Purpose::KERNEL).stream(1, 0, 0));
        assert!((0..100).all(|_| s.weighted(&[0.0, tiny, 0.0], tiny) == 1));
        assert_eq!(s.weighted(&[0.0, 0.0], 0.0), 1, "there is nothing else");
    }

    #[test]
    fn bytes_are_those_of_the_numbers() {
        let key = StreamKey::new(3, 0, Purpose::VALUES);
        let (mut a, mut b) = (key.stream(0, 0, 0), key.stream(0, 0, 0));
        let mut bytes = [0u8; 20];
        a.try_fill_bytes(&mut bytes).unwrap();
        let expected: Vec<u8> = (0..3).flat_map(|_| b.next_u64().to_le_bytes()).collect();
        assert_eq!(bytes[..], expected[..20]);
        assert_eq!(a.next_u64(), b.next_u64(), "the rest of the last number is not used");
    }

    #[test]
    fn normal_draws_are_golden() {
        // Detects changes of `rand_distr` that change draws.
        let mut s = StreamKey::new(42, 0, Purpose::VALUES).stream(0, 0, 0);
        let bits: Vec<u64> = (0..4).map(|_| s.standard_normal().to_bits()).collect();
        assert_eq!(bits, GOLDEN, "{bits:#x?}");
    }

    const GOLDEN: [u64; 4] =
        [0xbfd9147c3b1dce9e, 0xbffc04dbb2256d9a, 0x3fda26ea9e14562a, 0xbfd200e34a500ee6];
}
