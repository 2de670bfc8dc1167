//! Work shared among threads. Invariant: what comes out does not depend on how many there are.

use rayon::prelude::*;

/// Does the same with each of some things, on so many threads (0: as many as there are cores), one at a time where no threads can
/// be had; results in order.
pub(crate) fn in_parallel<I: Send, T: Send>(
    threads: usize,
    items: Vec<I>,
    one: impl Fn(I) -> T + Sync + Send,
) -> Vec<T> {
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(|| items.into_par_iter().with_max_len(1).map(one).collect()),
        Err(_) => items.into_iter().map(one).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::in_parallel;

    #[test]
    fn results_are_in_order_on_any_number_of_threads() {
        let expected: Vec<u64> = (0..1000).map(|i| i * i).collect();
        for threads in [0, 1, 2, 7] {
            assert_eq!(in_parallel(threads, (0..1000u64).collect(), |i| i * i), expected);
        }
    }
}
