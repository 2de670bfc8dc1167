//! Processor time, for examples that measure it.

/// Returns the processor time of this thread in seconds; NaN if the system does not
/// report it.
#[allow(dead_code)]
pub fn processor_seconds() -> f64 {
    let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    s.split_whitespace().next().and_then(|x| x.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1e9
}

/// Returns the processor time of all threads in seconds, including those that have ended,
/// with a resolution of 0.01; NaN if the system does not report it.
#[allow(dead_code)]
pub fn process_seconds() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // After the name of the program, which may contain any character: user and system
    // time in hundredths of a second.
    let after = s.rsplit(')').next().unwrap_or_default().split_whitespace().skip(11);
    let ticks: Vec<f64> = after.take(2).filter_map(|x| x.parse().ok()).collect();
    if ticks.len() == 2 { (ticks[0] + ticks[1]) / 100.0 } else { f64::NAN }
}
