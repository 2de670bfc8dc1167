//! Loops over many numbers, vectorised with the widest instructions of the processor.
//!
//! The same code is compiled twice, for the baseline and for AVX2, and selected at run
//! time. Nothing is fused or reordered, so both give the same bits.

/// Runs `work`, compiled for the processor's widest instructions where it is inlined.
#[inline]
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(test)]
    if PORTABLE.get() {
        return work();
    }
    pulp::Arch::new().dispatch(work)
}

#[cfg(test)]
thread_local! {
    static PORTABLE: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Runs `work` as on a processor without wide instructions.
#[cfg(test)]
pub(crate) fn portable<R>(work: impl FnOnce() -> R) -> R {
    PORTABLE.set(true);
    let out = work();
    PORTABLE.set(false);
    out
}
