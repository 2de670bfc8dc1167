//! Systematic resampling (Kitagawa 1996): each member gets the whole number of offspring
//! next to its share.

use crate::rng::Stream;

/// Which member each of `places` offspring comes from, in order. Weights are at least 0
/// and not all 0.
pub(crate) fn systematic(weights: &[f64], places: usize, rng: &mut Stream) -> Vec<usize> {
    let spacing = weights.iter().sum::<f64>() / places as f64;
    let (mut at, mut reached) = (rng.uniform() * spacing, 0.0);
    let mut chosen = Vec::with_capacity(places);
    for (i, w) in weights.iter().enumerate() {
        reached += w;
        while at < reached && chosen.len() < places {
            chosen.push(i);
            at += spacing;
        }
    }
    // Rounding may leave the last place empty.
    chosen.resize(places, weights.len() - 1);
    chosen
}
