//! An exact, order-independent accumulator of log densities.
//!
//! A term is quantised once: to a multiple of 2^-64 if its magnitude is below 2^40, and
//! otherwise to a multiple of 2^(40 k - 64) in a coarser limb k. Everything after that is
//! integer addition, so additions and subtractions in any order give the same bits, and
//! an incrementally updated sum equals one computed from scratch. Infinities and NaN are
//! counted, not added.

use super::exp::ROUND;
use super::simd::vectorised_if_many;

/// 2^64, the inverse of the finest quantum.
const SCALE: f64 = 18_446_744_073_709_551_616.0;
/// Terms of this magnitude or above go to coarser limbs.
const LARGE: f64 = 1_099_511_627_776.0; // 2^40
/// The number of exponents per coarse limb.
const SPAN: i32 = 40;

/// An exact sum of doubles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExactSum {
    fine: i128,
    /// Limb `k` holds terms of magnitude 2^(40 k) to 2^(40 (k + 1)), in units of
    /// 2^(40 k - 64); `None` while all terms are small.
    coarse: Option<Box<[i128; LIMBS]>>,
    negative: i64,
    positive: i64,
    nan: i64,
}

/// The number of limbs, for exponents up to 1024.
const LIMBS: usize = 26;

/// Returns the nearest integer to a number below 2^51, as both types.
#[inline(always)]
fn nearest(x: f64) -> (f64, i64) {
    let shifted = x + ROUND;
    (shifted - ROUND, (shifted.to_bits() as i64).wrapping_sub(ROUND.to_bits() as i64))
}

/// Returns x 2^64 rounded towards zero, for |x| < 2^40: `(x * SCALE) as i128` in three
/// exact pieces, each a machine word, in units of 2^64, 2^32 and 1.
#[inline(always)]
fn pieces(x: f64) -> [i64; 3] {
    const HALF: f64 = 4_294_967_296.0; // 2^32
    let (near, whole) = nearest(x);
    let rest = (x - near) * HALF;
    let (near, upper) = nearest(rest);
    let rest = (rest - near) * HALF;
    let (near, lower) = nearest(rest);
    // What was rounded away from zero is taken back.
    let beyond = i64::from((x > 0.0) & (near > rest)) - i64::from((x < 0.0) & (near < rest));
    [whole, upper, lower - beyond]
}

/// Puts the pieces, or sums of them, together.
#[inline]
fn joined([whole, upper, lower]: [i64; 3]) -> i128 {
    (i128::from(whole) << 64) + (i128::from(upper) << 32) + i128::from(lower)
}

/// Returns x 2^64 if |x| is at least 2^-11, so that nothing is rounded, and below 2^40.
#[inline]
fn shifted(x: f64) -> Option<i128> {
    // x is significand * 2^(shift - 64).
    let magnitude = x.to_bits() & (u64::MAX >> 1);
    let shift = (magnitude >> 52).wrapping_sub(1023 - 12);
    if !(1..=51).contains(&shift) {
        return None;
    }
    let significand = magnitude & ((1 << 52) - 1) | 1 << 52;
    let whole = u128::from(significand >> (64 - shift)) << 64 | u128::from(significand << shift);
    let sign = i128::from((x.to_bits() as i64) >> 63);
    Some((whole as i128 ^ sign) - sign)
}

/// How many pieces a machine word can sum: they are below 2^40.
const MOST: u32 = 1 << 22;
/// How many terms are looked at together: fewer than that.
const PART: usize = 64;

impl ExactSum {
    /// Adds a term.
    #[inline]
    pub fn add(&mut self, x: f64) {
        match shifted(x) {
            Some(whole) => self.fine += whole,
            None => self.put(x, 1),
        }
    }

    /// Adds terms, with the same result as one by one.
    #[inline]
    pub fn add_each(&mut self, terms: impl Iterator<Item = f64>) {
        let (mut sums, mut count) = ([0i64; 3], 0);
        for x in terms {
            if x.abs() >= LARGE || x.is_nan() {
                self.put(x, 1);
                continue;
            }
            sums.iter_mut().zip(pieces(x)).for_each(|(s, p)| *s += p);
            count += 1;
            if count == MOST {
                self.fine += joined(std::mem::take(&mut sums));
                count = 0;
            }
        }
        self.fine += joined(sums);
    }

    /// Adds many terms, with the same result as one by one.
    pub fn add_all(&mut self, terms: &[f64]) {
        vectorised_if_many(
            terms.len(),
            #[inline(always)]
            || {
                for part in terms.chunks(PART) {
                    // NaN is not below either.
                    if part.iter().fold(true, |all, x| all & (x.abs() < LARGE)) {
                        let mut sums = [0i64; 3];
                        for x in part {
                            sums.iter_mut().zip(pieces(*x)).for_each(|(s, p)| *s += p);
                        }
                        self.fine += joined(sums);
                    } else {
                        part.iter().for_each(|x| self.add(*x));
                    }
                }
            },
        );
    }

    /// Removes a term: the exact inverse of [`ExactSum::add`].
    #[inline]
    pub fn sub(&mut self, x: f64) {
        match shifted(x) {
            Some(whole) => self.fine -= whole,
            None => self.put(x, -1),
        }
    }

    /// Returns whether all terms were finite and small.
    #[inline]
    pub fn is_fine(&self) -> bool {
        self.coarse.is_none() && (self.negative | self.positive | self.nan) == 0
    }

    /// Returns the [`ExactSum::difference`] of `new[0] + new[1] - new[2]` and
    /// `old[0] + old[1] - old[2]`.
    pub fn difference_of_sums(new: [&ExactSum; 3], old: [&ExactSum; 3]) -> f64 {
        if new.iter().chain(&old).all(|s| s.is_fine()) {
            let fine = (new[0].fine + new[1].fine - new[2].fine)
                - (old[0].fine + old[1].fine - old[2].fine);
            return fine as f64 / SCALE;
        }
        let total = |[a, b, without]: [&ExactSum; 3]| {
            let mut sum = a.clone();
            sum.merge(b);
            sum.unmerge(without);
            sum
        };
        ExactSum::difference(&total(new), &total(old))
    }

    /// Returns the [`ExactSum::difference`] to an empty sum.
    pub fn difference_from_zero(&self) -> f64 {
        if self.is_fine() {
            self.fine as f64 / SCALE
        } else {
            ExactSum::difference(self, &ExactSum::default())
        }
    }

    /// Returns [`ExactSum::difference_from_zero`] of the sum of two sums.
    pub fn of_both(a: &ExactSum, b: &ExactSum) -> f64 {
        if a.is_fine() && b.is_fine() {
            return (a.fine + b.fine) as f64 / SCALE;
        }
        let mut sum = a.clone();
        sum.merge(b);
        sum.difference_from_zero()
    }

    fn put(&mut self, x: f64, sign: i64) {
        if x.abs() < LARGE {
            self.fine += i128::from(sign) * joined(pieces(x));
        } else if x.is_nan() {
            self.nan += sign;
        } else if x == f64::INFINITY {
            self.positive += sign;
        } else if x == f64::NEG_INFINITY {
            self.negative += sign;
        } else {
            let exponent = ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023;
            let limb = (exponent / SPAN).clamp(1, LIMBS as i32 - 1);
            // Scaling by a power of two is exact; the result has at most 53 significant
            // bits above the unit.
            let scaled = libm::ldexp(x, 64 - SPAN * limb) as i128;
            let limbs = self.coarse.get_or_insert_with(|| Box::new([0; LIMBS]));
            limbs[limb as usize] += i128::from(sign) * scaled;
            if limbs.iter().all(|l| *l == 0) {
                self.coarse = None;
            }
        }
    }

    /// Adds all terms of another sum.
    pub fn merge(&mut self, other: &ExactSum) {
        self.combine(other, 1);
    }

    /// Removes all terms of another sum.
    pub fn unmerge(&mut self, other: &ExactSum) {
        self.combine(other, -1);
    }

    fn combine(&mut self, other: &ExactSum, sign: i64) {
        self.fine += i128::from(sign) * other.fine;
        self.negative += sign * other.negative;
        self.positive += sign * other.positive;
        self.nan += sign * other.nan;
        if let Some(theirs) = &other.coarse {
            let limbs = self.coarse.get_or_insert_with(|| Box::new([0; LIMBS]));
            limbs.iter_mut().zip(theirs.iter()).for_each(|(a, b)| *a += i128::from(sign) * b);
            if limbs.iter().all(|l| *l == 0) {
                self.coarse = None;
            }
        }
    }

    /// Returns the rounded sum. It is -inf if a term is, and NaN if a term is, or if the
    /// terms include both infinities.
    pub fn value(&self) -> f64 {
        if self.nan != 0 || (self.negative != 0 && self.positive != 0) {
            f64::NAN
        } else if self.negative != 0 {
            f64::NEG_INFINITY
        } else if self.positive != 0 {
            f64::INFINITY
        } else {
            self.finite()
        }
    }

    /// Returns the sum of the finite terms.
    fn finite(&self) -> f64 {
        let mut sum = 0.0;
        if let Some(limbs) = &self.coarse {
            for (k, limb) in limbs.iter().enumerate().rev() {
                sum += libm::ldexp(*limb as f64, SPAN * k as i32 - 64);
            }
        }
        sum + self.fine as f64 / SCALE
    }

    /// Returns new - old, as compared by an accept test.
    ///
    /// It is -inf if `new` is impossible (-inf or NaN), even if `old` is too, so that a
    /// chain does not wander among impossible states. It is +inf if only `old` is
    /// impossible.
    pub fn difference(new: &ExactSum, old: &ExactSum) -> f64 {
        if new.is_fine() && old.is_fine() {
            return (new.fine - old.fine) as f64 / SCALE;
        }
        if new.nan > 0 || new.negative > 0 {
            return f64::NEG_INFINITY;
        }
        if old.nan > 0 || old.negative > 0 {
            return f64::INFINITY;
        }
        match new.positive.cmp(&old.positive) {
            std::cmp::Ordering::Greater => f64::INFINITY,
            std::cmp::Ordering::Less => f64::NEG_INFINITY,
            std::cmp::Ordering::Equal => {
                let mut d = new.clone();
                d.combine(old, -1);
                d.finite()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sum(xs: &[f64]) -> ExactSum {
        let mut s = ExactSum::default();
        xs.iter().for_each(|x| s.add(*x));
        s
    }

    fn term() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => -1e3..1e3f64,
            2 => -1e14..1e14f64,
            1 => any::<f64>(),
            1 => Just(-1e300),
            1 => Just(f64::NEG_INFINITY),
        ]
    }

    proptest! {
        #[test]
        fn any_order_and_any_history_give_the_same_bits(xs in prop::collection::vec(term(), 0..90), extra in prop::collection::vec(term(), 0..10), rotate in 0usize..40) {
            let plain = sum(&xs);
            let mut shuffled = xs.clone();
            if !shuffled.is_empty() {
                let by = rotate % shuffled.len();
                shuffled.rotate_left(by);
            }
            let mut s = ExactSum::default();
            extra.iter().for_each(|x| s.add(*x));
            shuffled.iter().for_each(|x| s.add(*x));
            extra.iter().rev().for_each(|x| s.sub(*x));
            prop_assert_eq!(&s, &plain);
            let mut together = ExactSum::default();
            together.add_each(shuffled.iter().copied());
            prop_assert_eq!(&together, &plain);
            let mut all = ExactSum::default();
            all.add_all(&shuffled);
            prop_assert_eq!(&all, &plain);
            prop_assert_eq!(s.value().to_bits(), plain.value().to_bits());
        }

        #[test]
        fn sums_are_right(xs in prop::collection::vec(-1e6..1e6f64, 0..100)) {
            let naive: f64 = xs.iter().sum();
            prop_assert!((sum(&xs).value() - naive).abs() <= 1e-9 * (1.0 + xs.iter().map(|x| x.abs()).sum::<f64>()));
        }
    }

    #[test]
    fn terms_are_quantised_towards_zero() {
        let mut xs = vec![
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.5,
            1e-300,
            -1e-19,
            6e-20,
            LARGE.next_down(),
            -LARGE.next_down(),
        ];
        xs.extend([2.5, -2.5, -1e-300, 5.4e-20, -5.4e-20, 0.1, -0.1, f64::from_bits(1)]);
        let edge = libm::exp2(-11.0);
        xs.extend([edge, -edge, edge.next_down(), -edge.next_down(), edge.next_up()]);
        xs.extend((0..2000).map(|i| libm::sin(f64::from(i)) * libm::exp2(f64::from(i % 120 - 80))));
        for x in xs {
            assert_eq!(joined(pieces(x)), (x * SCALE) as i128, "{x}");
            assert_eq!(sum(&[x]).fine, (x * SCALE) as i128, "{x}");
        }
    }

    #[test]
    fn large_terms_do_not_drown_small_ones() {
        let mut s = sum(&[-1e300, 1.5, 1e15, 0.25]);
        assert_eq!(s.value(), -1e300);
        s.sub(-1e300);
        s.sub(1e15);
        assert_eq!(s.value(), 1.75);
        assert_eq!(s, sum(&[1.75]));
    }

    #[test]
    fn infinities_cancel_by_count() {
        let mut s = sum(&[f64::NEG_INFINITY, 2.0, f64::NEG_INFINITY]);
        assert_eq!(s.value(), f64::NEG_INFINITY);
        s.sub(f64::NEG_INFINITY);
        assert_eq!(s.value(), f64::NEG_INFINITY);
        s.sub(f64::NEG_INFINITY);
        assert_eq!(s.value(), 2.0);
    }

    #[test]
    fn differences_decide_accept_tests() {
        let (one, two) = (sum(&[1.0]), sum(&[2.5]));
        let zero = sum(&[3.0, f64::NEG_INFINITY]);
        assert_eq!(ExactSum::difference(&two, &one), 1.5);
        assert_eq!(ExactSum::difference(&zero, &one), f64::NEG_INFINITY);
        assert_eq!(ExactSum::difference(&one, &zero), f64::INFINITY);
        assert_eq!(ExactSum::difference(&zero, &zero), f64::NEG_INFINITY);
        assert_eq!(ExactSum::difference(&sum(&[f64::NAN]), &one), f64::NEG_INFINITY);
    }
}
