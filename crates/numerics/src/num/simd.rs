//! Loops over many numbers, vectorised with the widest instructions of the processor.
//!
//! The same code is compiled for the baseline, for AVX2 and for AVX-512, and selected at run
//! time. Nothing is fused or reordered, so all give the same bits.

/// Runs `work`, compiled for instructions of the processor as wide as AVX2 where it is inlined:
/// with AVX-512, loops over pixels, which gather and scatter, take longer.
#[inline]
pub fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    if PORTABLE.get() {
        return work();
    }
    #[cfg(target_arch = "x86_64")]
    return match pulp::x86::V3::try_new() {
        Some(avx2) => pulp::Simd::vectorize(avx2, work),
        None => work(),
    };
    #[cfg(not(target_arch = "x86_64"))]
    pulp::Arch::new().dispatch(work)
}

/// Runs `work` on `n` numbers, compiled for the widest instructions where it is inlined, if they
/// are many: for few, choosing costs more than it saves.
#[inline(always)]
pub fn vectorised_if_many<R>(n: usize, work: impl FnOnce() -> R) -> R {
    if n < MANY { work() } else { widest(work) }
}

// Apart, so that the loop over few numbers is inlined as if there were no other.
#[inline(never)]
fn widest<R>(work: impl FnOnce() -> R) -> R {
    if PORTABLE.get() { work() } else { pulp::Arch::new().dispatch(work) }
}

const MANY: usize = 32;

/// Sums a function of the numbers at the same places of three lists, in one fixed order: in
/// interleaved sums, which are added at the end. Other than one running sum, that can be
/// vectorised.
#[inline(always)]
pub fn sum_of_triples(a: &[f64], b: &[f64], c: &[f64], f: impl Fn(f64, f64, f64) -> f64) -> f64 {
    let n = a.len().min(b.len()).min(c.len());
    let (a, b, c) = (&a[..n], &b[..n], &c[..n]);
    let mut lanes = [0.0; LANES];
    let parts = (a.chunks_exact(LANES), b.chunks_exact(LANES), c.chunks_exact(LANES));
    let rest = parts.0.remainder().iter().zip(parts.1.remainder()).zip(parts.2.remainder());
    let rest = rest.fold(0.0, |sum, ((a, b), c)| sum + f(*a, *b, *c));
    for ((a, b), c) in parts.0.zip(parts.1).zip(parts.2) {
        for (((lane, a), b), c) in lanes.iter_mut().zip(a).zip(b).zip(c) {
            *lane += f(*a, *b, *c);
        }
    }
    lanes.iter().fold(rest, |sum, lane| sum + lane)
}

const LANES: usize = 16;

thread_local! {
    static PORTABLE: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Runs `work` as on a processor without wide instructions, on this thread: for tests that both
/// give the same bits.
pub fn portable<R>(work: impl FnOnce() -> R) -> R {
    PORTABLE.set(true);
    let out = work();
    PORTABLE.set(false);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_triples_are_right_and_the_same_on_every_processor() {
        for n in [0, 1, 15, 16, 33, 1000] {
            let list = |k: usize| (0..n).map(|i| ((i * k) % 7) as f64 + 0.5).collect::<Vec<_>>();
            let (a, b, c) = (list(1), list(3), list(5));
            let sum = || vectorised_if_many(n, || sum_of_triples(&a, &b, &c, |a, b, c| a * b - c));
            // These numbers are added without rounding.
            let plain: f64 = (0..n).map(|i| a[i] * b[i] - c[i]).sum();
            assert_eq!(sum(), plain);
            assert_eq!(sum(), portable(sum));
        }
        // The shortest list counts.
        assert_eq!(sum_of_triples(&[1.0, 2.0], &[3.0], &[4.0; 40], |a, b, c| a + b + c), 8.0);
    }
}
