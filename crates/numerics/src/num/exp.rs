//! The exponential function of many numbers at once.
//!
//! The same arithmetic as that of `libm::exp` (FreeBSD's `e_exp.c`), with its branches as
//! selections, so that a loop over it is vectorised and the results are the same bits.

use super::simd::vectorised_if_many;

/// The leading bits of ln 2, so that products with small integers are exact, and the rest.
const LN2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
const LN2_LOW: f64 = 1.90821492927058770002e-10;
const INVERSE_LN2: f64 = core::f64::consts::LOG2_E;
const P1: f64 = 1.66666666666666019037e-01;
const P2: f64 = -2.77777777770155933842e-03;
const P3: f64 = 6.61375632143793436117e-05;
const P4: f64 = -1.65339022054652515390e-06;
const P5: f64 = 4.13813679705723846039e-08;

/// The magnitudes from which `libm::exp` takes its branches: they differ in the high words.
const TINY: f64 = f64::from_bits(0x3e30_0001_0000_0000);
const HALF_LN2: f64 = f64::from_bits(0x3fd6_2e43_0000_0000);
const THREE_HALVES_LN2: f64 = f64::from_bits(0x3ff0_a2b2_0000_0000);

/// The magnitude up to which results, and the powers of two that scale them, are normal.
const NORMAL: f64 = 708.0;

/// Adding 3/2 2^52 rounds to an integer, and leaves it in the low bits.
pub(super) const ROUND: f64 = 6_755_399_441_055_744.0;

/// Returns the exponential of a number of a magnitude up to [`NORMAL`].
#[inline(always)]
pub(super) fn normal(x: f64) -> f64 {
    let (size, sign) = (x.abs(), if x < 0.0 { -1.0 } else { 1.0 });
    let scaled = INVERSE_LN2 * x + 0.5 * sign;
    let near = scaled + ROUND - ROUND;
    let whole = if near.abs() > scaled.abs() { near - sign } else { near };
    let k = if size >= THREE_HALVES_LN2 { whole } else { sign };
    let k = if size >= HALF_LN2 { k } else { 0.0 };
    let (high, low) = (x - k * LN2_HIGH, k * LN2_LOW);
    let r = high - low;
    let rr = r * r;
    let c = r - rr * (P1 + rr * (P2 + rr * (P3 + rr * (P4 + rr * P5))));
    let y = 1.0 + (r * c / (2.0 - c) - low + high);
    // The sum has k + 1023 in its low bits.
    let power = f64::from_bits((k + (ROUND + 1023.0)).to_bits() << 52);
    if size >= TINY { y * power } else { 1.0 + x }
}

/// Replaces each number by its exponential, with the bits of `libm::exp`.
pub fn exp_each(xs: &mut [f64]) {
    vectorised_if_many(
        xs.len(),
        #[inline(always)]
        || {
            for part in xs.chunks_mut(64) {
                // NaN is not within the range either.
                if part.iter().fold(true, |all, x| all & (x.abs() <= NORMAL)) {
                    part.iter_mut().for_each(|x| *x = normal(*x));
                } else {
                    part.iter_mut().for_each(|x| *x = libm::exp(*x));
                }
            }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::simd::portable;

    #[test]
    fn each_has_the_bits_of_libm() {
        let mut xs = vec![0.0, -0.0, 1.0, -1.0, NORMAL, -NORMAL, f64::MIN_POSITIVE];
        for edge in [TINY, HALF_LN2, THREE_HALVES_LN2, core::f64::consts::LN_2, 0.5, 2f64.powi(-28)]
        {
            for x in [edge.next_down(), edge, edge.next_up()] {
                xs.extend([x, -x, 3.0 * x, -3.0 * x, 100.0 * x]);
            }
        }
        xs.extend((0..20_000).map(|i| (f64::from(i) - 10_000.0) * 0.070_8));
        xs.extend(
            (0..20_000).map(|i| libm::sin(f64::from(i)) * libm::exp2(f64::from(i % 40 - 35))),
        );
        for special in
            [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 709.5, 800.0, -708.5, -744.0, -800.0]
        {
            xs.extend([1.5, special, -0.25]);
        }
        let expected: Vec<u64> = xs.iter().map(|x| libm::exp(*x).to_bits()).collect();
        let bits = |mut xs: Vec<f64>| -> Vec<u64> {
            xs.chunks_mut(17).for_each(exp_each);
            exp_each(&mut []);
            xs.iter().map(|x| x.to_bits()).collect()
        };
        for found in [bits(xs.clone()), portable(|| bits(xs.clone()))] {
            for ((x, found), expected) in xs.iter().zip(found).zip(&expected) {
                assert_eq!(found, *expected, "exp({x:e})");
            }
        }
    }
}
