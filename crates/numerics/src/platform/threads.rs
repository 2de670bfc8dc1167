//! Parallel maps, which run sequentially if there are no threads. Invariant: results do
//! not depend on the number of threads.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// The threads among which [`available`] divides work; 0: one per core.
static MOST: AtomicUsize = AtomicUsize::new(0);

/// Lets this process divide work among this many threads from now on (0: one per core). Each takes
/// memory of its own.
pub fn limit(threads: usize) {
    MOST.store(threads, Ordering::Relaxed);
}

/// The number of threads among which work is divided that does not say how many it wants.
pub fn available() -> usize {
    match MOST.load(Ordering::Relaxed) {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        most => most,
    }
}

/// A pool of threads. It has none on WebAssembly, or if they cannot be created.
pub struct Pool {
    #[cfg(not(target_family = "wasm"))]
    pool: Option<rayon::ThreadPool>,
}

impl Pool {
    /// Starts this many threads (0: one per core), which live until the pool is dropped.
    pub fn new(threads: usize) -> Pool {
        #[cfg(target_family = "wasm")]
        let _ = threads;
        Pool {
            #[cfg(not(target_family = "wasm"))]
            pool: rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok(),
        }
    }

    /// Applies `one` to each item; results are in order.
    pub fn map<I: Send, T: Send>(
        &self,
        items: Vec<I>,
        one: impl Fn(I) -> T + Sync + Send,
    ) -> Vec<T> {
        #[cfg(not(target_family = "wasm"))]
        if let Some(pool) = &self.pool {
            use rayon::prelude::*;
            return pool.install(|| items.into_par_iter().with_max_len(1).map(one).collect());
        }
        items.into_iter().map(one).collect()
    }
}

/// Applies `one` to each item on this many threads (0: one per core); results are in
/// order.
pub fn in_parallel<I: Send, T: Send>(
    threads: usize,
    items: Vec<I>,
    one: impl Fn(I) -> T + Sync + Send,
) -> Vec<T> {
    Pool::new(threads).map(items, one)
}

/// Runs `work` for every part, each on its own thread but the last, and waits for all. It does not use
/// a [`Pool`]: a pool's waiting thread takes up other tasks, which could need a lock that
/// the caller holds.
pub fn side_by_side<T: Send>(parts: impl IntoIterator<Item = T>, work: impl Fn(usize, T) + Sync) {
    #[cfg(not(target_family = "wasm"))]
    {
        let work = &work;
        std::thread::scope(|scope| {
            let mut parts = parts.into_iter().enumerate().peekable();
            while let Some((i, part)) = parts.next() {
                match parts.peek() {
                    Some(_) => drop(scope.spawn(move || work(i, part))),
                    None => work(i, part),
                }
            }
        });
    }
    #[cfg(target_family = "wasm")]
    parts.into_iter().enumerate().for_each(|(i, part)| work(i, part));
}

/// Applies `one` to each item on as many threads as are [`available`]; results are in order.
/// Like [`side_by_side`], it may be called by one who holds a lock.
pub fn map_side_by_side<I: Sync, T: Send>(items: &[I], one: impl Fn(&I) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(items.len()));
    side_by_side(0..available().min(items.len()), |_, _| {
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(i) else { break };
            let result = one(item);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((i, result));
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Does two things, the first on a thread of its own if two are [`available`].
pub fn both<A: Send, B>(one: impl FnOnce() -> A + Send, other: impl FnOnce() -> B) -> (A, B) {
    #[cfg(not(target_family = "wasm"))]
    if available() > 1 {
        return std::thread::scope(|scope| {
            let one = scope.spawn(one);
            let other = other();
            (one.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), other)
        });
    }
    (one(), other())
}

#[cfg(test)]
mod tests {
    use super::{both, in_parallel, map_side_by_side};

    #[test]
    fn results_are_in_order_on_any_number_of_threads() {
        let expected: Vec<u64> = (0..1000).map(|i| i * i).collect();
        for threads in [0, 1, 2, 7] {
            assert_eq!(in_parallel(threads, (0..1000u64).collect(), |i| i * i), expected);
        }
        let items: Vec<u64> = (0..1000).collect();
        assert_eq!(map_side_by_side(&items, |i| i * i), expected);
        assert!(map_side_by_side(&[], |i: &u64| i * i).is_empty());
        assert_eq!(both(|| 1, || "two"), (1, "two"));
    }
}
