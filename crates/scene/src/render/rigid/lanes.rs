//! Eight numbers at a time, with AVX or without. Only bounds are computed this way, so
//! results do not depend on which is used.

use wide::f32x8;

/// Arithmetic on eight numbers.
pub(super) trait Lanes: Copy {
    type Row: Copy;

    fn load(self, row: &f32x8) -> Self::Row;

    fn all(self, value: f32) -> Self::Row;

    fn numbers(self, row: Self::Row) -> [f32; 8];

    fn add(self, a: Self::Row, b: Self::Row) -> Self::Row;

    fn sub(self, a: Self::Row, b: Self::Row) -> Self::Row;

    fn mul(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// The lesser; the second where one is not a number.
    fn min(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// The greater; the second where one is not a number.
    fn max(self, a: Self::Row, b: Self::Row) -> Self::Row;

    /// Where the first is at most the second, as bits; nowhere if one is not a number.
    fn at_most(self, a: Self::Row, b: Self::Row) -> u32;
}

/// Something to be done with eight numbers at a time.
pub(super) trait Work: Sized {
    type Out;

    fn run<L: Lanes>(self, lanes: L) -> Self::Out;
}

/// Does some work with the processor's widest instructions.
#[inline(always)]
pub(super) fn widest<W: Work>(work: W) -> W::Out {
    #[cfg(target_arch = "x86_64")]
    if let Some(v3) = pulp::x86::V3::try_new() {
        return v3.vectorize(
            #[inline(always)]
            || work.run(v3),
        );
    }
    work.run(Plain)
}

/// On any processor.
#[derive(Clone, Copy)]
pub(super) struct Plain;

impl Lanes for Plain {
    type Row = f32x8;

    #[inline(always)]
    fn load(self, row: &f32x8) -> f32x8 {
        *row
    }

    #[inline(always)]
    fn all(self, value: f32) -> f32x8 {
        f32x8::splat(value)
    }

    #[inline(always)]
    fn numbers(self, row: f32x8) -> [f32; 8] {
        row.to_array()
    }

    #[inline(always)]
    fn add(self, a: f32x8, b: f32x8) -> f32x8 {
        a + b
    }

    #[inline(always)]
    fn sub(self, a: f32x8, b: f32x8) -> f32x8 {
        a - b
    }

    #[inline(always)]
    fn mul(self, a: f32x8, b: f32x8) -> f32x8 {
        a * b
    }

    #[inline(always)]
    fn min(self, a: f32x8, b: f32x8) -> f32x8 {
        a.simd_lt(b).bitselect(a, b)
    }

    #[inline(always)]
    fn max(self, a: f32x8, b: f32x8) -> f32x8 {
        a.simd_gt(b).bitselect(a, b)
    }

    #[inline(always)]
    fn at_most(self, a: f32x8, b: f32x8) -> u32 {
        a.simd_le(b).to_bitmask()
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use super::Lanes;
    use pulp::bytemuck::cast;
    use pulp::x86::V3;
    use std::arch::x86_64::{__m256, _CMP_LE_OQ};
    use wide::f32x8;

    impl Lanes for V3 {
        type Row = __m256;

        #[inline(always)]
        fn load(self, row: &f32x8) -> __m256 {
            cast(*row)
        }

        #[inline(always)]
        fn all(self, value: f32) -> __m256 {
            self.avx._mm256_set1_ps(value)
        }

        #[inline(always)]
        fn numbers(self, row: __m256) -> [f32; 8] {
            cast(row)
        }

        #[inline(always)]
        fn add(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_add_ps(a, b)
        }

        #[inline(always)]
        fn sub(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_sub_ps(a, b)
        }

        #[inline(always)]
        fn mul(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_mul_ps(a, b)
        }

        #[inline(always)]
        fn min(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_min_ps(a, b)
        }

        #[inline(always)]
        fn max(self, a: __m256, b: __m256) -> __m256 {
            self.avx._mm256_max_ps(a, b)
        }

        #[inline(always)]
        fn at_most(self, a: __m256, b: __m256) -> u32 {
            let mask = self.avx._mm256_cmp_ps::<_CMP_LE_OQ>(a, b);
            self.avx._mm256_movemask_ps(mask) as u32
        }
    }
}
