//! Groups of chains that agree with each other, if not all chains do.
//!
//! Two chains agree if the split R-hat of the pair is low for every quantity; groups are
//! the connected components of agreement. A group is a region where chains stay (a mode,
//! if they are long enough). Its size is not a probability: it depends on where the
//! chains started.

use super::r_hat;

/// Two chains with a split R-hat above this are in different modes: their means are more
/// than about one and a half standard deviations apart (or one is much wider), which slow
/// mixing within one mode seldom causes.
const APART: f64 = 1.3;

/// Groups of chains, by number: each in order, the largest group first, then by first
/// chain. `quantities[quantity][chain]` are draws; chains without any are left out. If all
/// chains agree there is one group; without chains there are no groups.
pub fn modes(quantities: &[&[Vec<f64>]]) -> Vec<Vec<usize>> {
    let chains = quantities.iter().map(|q| q.len()).max().unwrap_or(0);
    let mut group: Vec<usize> = (0..chains).collect();
    let drawn = |c: &usize| quantities.iter().any(|q| q.get(*c).is_some_and(|x| !x.is_empty()));
    for a in (0..chains).filter(drawn) {
        for b in (a + 1..chains).filter(drawn) {
            if group[a] != group[b] && quantities.iter().all(|q| agree(q.get(a), q.get(b))) {
                let (from, to) = (group[a].max(group[b]), group[a].min(group[b]));
                group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    let mut all: Vec<Vec<usize>> = Vec::new();
    for g in 0..chains {
        let members: Vec<usize> = (0..chains).filter(|c| group[*c] == g && drawn(c)).collect();
        if !members.is_empty() {
            all.push(members);
        }
    }
    all.sort_by_key(|m| std::cmp::Reverse(m.len()));
    all
}

fn agree(a: Option<&Vec<f64>>, b: Option<&Vec<f64>>) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return true };
    let r = r_hat(&[a, b]);
    if r.is_nan() {
        // Chains that are too short to be distinguished are taken to agree; constant
        // chains agree if their values are equal.
        return a.len() < 4
            || b.len() < 4
            || a.first().map(|x| x.to_bits()) == b.first().map(|x| x.to_bits());
    }
    r <= APART
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_numerics::rng::{Purpose, StreamKey};

    fn chain(seed: u64, centre: f64, n: usize) -> Vec<f64> {
        let mut rng = StreamKey::new(seed, 0, Purpose(99)).stream(0, 0, 0);
        let mut x = 0.0;
        // Autocorrelated: about 7 draws are worth one independent draw.
        (0..n)
            .map(|_| {
                x = 0.75 * x + (1.0f64 - 0.75 * 0.75).sqrt() * rng.standard_normal();
                centre + x
            })
            .collect()
    }

    #[test]
    fn chains_of_two_modes_are_told_apart() {
        let x: Vec<Vec<f64>> =
            [0.0, 5.0, 0.0, 0.0, 5.0].iter().zip(0..).map(|(c, s)| chain(s, *c, 300)).collect();
        let y: Vec<Vec<f64>> = (0..5).map(|s| chain(50 + s, 1.0, 300)).collect();
        assert_eq!(modes(&[&y, &x]), [vec![0, 2, 3], vec![1, 4]]);
        assert_eq!(modes(&[&y]), [vec![0, 1, 2, 3, 4]]);
        assert!(modes(&[]).is_empty());
    }

    #[test]
    fn stuck_chains_are_at_as_many_places_as_they_have_values() {
        let x = vec![vec![1.0; 60], vec![2.0; 60], vec![1.0; 60]];
        assert_eq!(modes(&[&x]), [vec![0, 2], vec![1]]);
        let short = vec![vec![1.0, 2.0], vec![9.0, 8.0]];
        assert_eq!(modes(&[&short]), [vec![0, 1]]);
        // A single short chain is enough for the comparison to be uninformative.
        let uneven = vec![vec![1.0, 2.0], vec![9.0; 60]];
        assert_eq!(modes(&[&uneven]), [vec![0, 1]]);
        // A chain that never started is ignored.
        let missing = vec![vec![1.0; 60], vec![], vec![2.0; 60], vec![1.0; 60]];
        assert_eq!(modes(&[&missing]), [vec![0, 3], vec![2]]);
    }
}
