//! A wrapper that makes a host's distribution meet the engine's assumptions.

use pcadlang_numerics::dist::{Datum, Distribution, Gradient, Support};
use pcadlang_numerics::rng::Stream;

/// A distribution whose log density is never NaN: a NaN is replaced by -inf, so that the
/// value counts as impossible.
#[derive(Debug)]
pub(super) struct Checked<D>(pub D);

fn number(log_density: f64) -> f64 {
    if log_density.is_nan() { f64::NEG_INFINITY } else { log_density }
}

/// Methods that call the wrapped distribution unchanged.
macro_rules! forward {
    ($($name:ident($($arg:ident: $ty:ty),*) -> $out:ty;)*) => {
        $(fn $name(&self, $($arg: $ty),*) -> $out { self.0.$name($($arg),*) })*
    };
}

impl<D: Distribution> Distribution for Checked<D> {
    fn log_density(&self, x: &Datum) -> f64 {
        number(self.0.log_density(x))
    }

    fn log_density_stored(&self, s: &Datum) -> f64 {
        number(self.0.log_density_stored(s))
    }

    forward! {
        name() -> &str;
        support() -> Support;
        sample(rng: &mut Stream) -> Datum;
        gradient(x: &Datum) -> Option<Gradient>;
        is_gaussian() -> bool;
        whiten(x: &Datum) -> Option<Vec<f64>>;
        colour(z: &[f64]) -> Option<Datum>;
        has_moving_support() -> bool;
        is_scalar() -> bool;
        is_improper() -> bool;
        is_stored_whitened() -> bool;
        sample_stored(rng: &mut Stream) -> Datum;
        gradient_stored(s: &Datum) -> Option<Gradient>;
        from_noncentred(s: &Datum) -> Datum;
        to_noncentred(value: &Datum) -> Option<Datum>;
        stored_support() -> Support;
        mean() -> Option<f64>;
        sd() -> Option<f64>;
    }
}
