//! Loops over many numbers, vectorised with the widest instructions of the processor.
//!
//! The same code is compiled twice, for the baseline and for AVX2, and selected at run
//! time. Nothing is fused or reordered, so both give the same bits.

/// Runs `work`, compiled for the processor's widest instructions where it is inlined.
#[inline]
pub fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(any(test, feature = "portable"))]
    if PORTABLE.get() {
        return work();
    }
    pulp::Arch::new().dispatch(work)
}

#[cfg(any(test, feature = "portable"))]
thread_local! {
    static PORTABLE: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Runs `work` as on a processor without wide instructions.
#[cfg(any(test, feature = "portable"))]
pub fn portable<R>(work: impl FnOnce() -> R) -> R {
    PORTABLE.set(true);
    let out = work();
    PORTABLE.set(false);
    out
}
