//! Systematic resampling (Kitagawa 1996): each member gets one of the two whole numbers
//! of offspring next to its expected number.

use pcadlang_numerics::rng::Stream;

/// The parent of each of `places` offspring, in order. Weights are nonnegative, and not
/// all of them are zero.
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
    // Rounding errors may leave the last place empty.
    chosen.resize(places, weights.len() - 1);
    chosen
}
