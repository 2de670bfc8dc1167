//! The choices that a tape sums out: which sums belong to each, and how they are drawn.

use super::op::Op;
use pcadlang_numerics::rng::Stream;
use smallvec::SmallVec;

/// A choice that is summed out.
#[derive(Clone, Debug)]
pub(super) struct Summed {
    pub choice: usize,
    /// The choices on which its conditional depends, with their numbers of values.
    pub given: Vec<(usize, usize)>,
    /// By joint value of those, the result of the sum; after the tape is complete, the
    /// operation and the place in it.
    pub sums: SmallVec<[(usize, usize); 1]>,
}

/// Resolves the results of sums to the operations that compute them.
pub(super) fn find_sums(summed: &mut [Summed], ops: &[Op]) {
    let mut found = rustc_hash::FxHashMap::default();
    for (k, op) in ops.iter().enumerate() {
        if let Op::LogSumExp(l) = op {
            found.extend((0..l.n).map(|i| (l.out + i, (k, i))));
        }
    }
    let sums = summed.iter_mut().flat_map(|s| &mut s.sums);
    sums.for_each(|s| *s = found.get(&s.0).copied().unwrap_or(*s));
}

/// Moves the results of sums.
pub(super) fn move_sums(summed: &mut [Summed], to: impl Fn(usize) -> usize) {
    summed.iter_mut().flat_map(|s| &mut s.sums).for_each(|s| s.0 = to(s.0));
}

/// Draws the choices from their conditional at the point of the last run. Returns the index
/// of each one's value.
pub(super) fn draw(summed: &[Summed], ops: &[Op], rng: &mut Stream) -> Vec<usize> {
    let mut values = vec![0; summed.len()];
    for s in summed.iter().rev() {
        let joint = s.given.iter().rev().fold(0, |p, (y, n)| p * n + values[*y]);
        let Some((op, i)) = s.sums.get(joint).copied() else { continue };
        let Some(Op::LogSumExp(l)) = ops.get(op) else { continue };
        values[s.choice] = rng.weighted_by(l.conditional(i), 1.0);
    }
    values
}
