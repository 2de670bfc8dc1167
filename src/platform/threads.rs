//! Work shared among threads, or done in turn where there are none. Invariant: what comes
//! out does not depend on how many there are.

/// Threads that wait for work; none in a build without the feature `threads`, or where
/// none can be had.
pub(crate) struct Pool {
    #[cfg(feature = "threads")]
    pool: Option<rayon::ThreadPool>,
}

#[cfg(feature = "threads")]
impl Pool {
    /// So many threads (0: as many as there are cores), which stay until this is dropped.
    pub fn new(threads: usize) -> Pool {
        Pool { pool: rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok() }
    }

    /// Does the same with each of some things; results in order.
    pub fn map<I: Send, T: Send>(
        &self,
        items: Vec<I>,
        one: impl Fn(I) -> T + Sync + Send,
    ) -> Vec<T> {
        use rayon::prelude::*;
        match &self.pool {
            Some(pool) => pool.install(|| items.into_par_iter().with_max_len(1).map(one).collect()),
            None => items.into_iter().map(one).collect(),
        }
    }
}

#[cfg(not(feature = "threads"))]
impl Pool {
    /// No threads, whatever is asked for.
    pub fn new(_threads: usize) -> Pool {
        Pool {}
    }

    /// Does the same with each of some things, one after the other.
    pub fn map<I: Send, T: Send>(
        &self,
        items: Vec<I>,
        one: impl Fn(I) -> T + Sync + Send,
    ) -> Vec<T> {
        items.into_iter().map(one).collect()
    }
}

/// Does the same with each of some things, on so many threads (0: as many as there are
/// cores); results in order.
pub(crate) fn in_parallel<I: Send, T: Send>(
    threads: usize,
    items: Vec<I>,
    one: impl Fn(I) -> T + Sync + Send,
) -> Vec<T> {
    Pool::new(threads).map(items, one)
}

/// Does `work` for every part, each on a thread of its own, and waits for all. Not the
/// threads of a [`Pool`]: whoever waits here may hold a lock that a task of theirs, which
/// they would take up meanwhile, waits for.
pub(crate) fn side_by_side<T: Send>(
    parts: impl IntoIterator<Item = T>,
    work: impl Fn(usize, T) + Sync,
) {
    #[cfg(all(feature = "threads", not(target_family = "wasm")))]
    {
        let work = &work;
        std::thread::scope(|scope| {
            for (i, part) in parts.into_iter().enumerate() {
                scope.spawn(move || work(i, part));
            }
        });
    }
    #[cfg(not(all(feature = "threads", not(target_family = "wasm"))))]
    parts.into_iter().enumerate().for_each(|(i, part)| work(i, part));
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
