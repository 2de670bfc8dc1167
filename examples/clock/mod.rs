//! Processor time, for examples that measure.

/// Processor seconds of this thread so far; NaN where the system does not tell.
pub fn processor_seconds() -> f64 {
    let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    s.split_whitespace().next().and_then(|x| x.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1e9
}
