//! Diagnostics of draws of any scale, of constants, infinities and NaN: equal to those of
//! draws of scale 1, or the documented result.

use super::points::Points;
use super::table::agree;
use pcadlang_inference::diagnostics::{
    Summary, ess_bulk, ess_mean, ess_quantile, ess_tail, mcse_mean, mcse_sd, modes, quantile,
    r_hat, summary,
};
use pcadlang_numerics::rng::{Purpose, StreamKey};

/// Returns autocorrelated chains of approximately standard normal draws.
fn chains() -> Vec<Vec<f64>> {
    let chain = |c: u32| {
        let mut rng = StreamKey::new(3, c, Purpose::VALUES).stream(0, 0, 0);
        let mut x = 0.0;
        let mut next = || {
            x = 0.6 * x + 0.8 * rng.standard_normal();
            x
        };
        (0..200).map(|_| next()).collect()
    };
    (0..4).map(chain).collect()
}

fn scaled(chains: &[Vec<f64>], by: f64) -> Vec<Vec<f64>> {
    chains.iter().map(|c| c.iter().map(|x| x * by).collect()).collect()
}

/// Splits a summary into numbers with the unit of the draws, and dimensionless ones.
fn numbers(s: &Summary) -> ([f64; 7], [f64; 3]) {
    ([s.mean, s.sd, s.q05, s.q50, s.q95, s.mcse_mean, s.mcse_sd], [s.ess_bulk, s.ess_tail, s.r_hat])
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

#[test]
fn the_unit_of_draws_does_not_matter() {
    let mut points = Points::of("diagnostics of any scale");
    let draws = chains();
    let (lengths, plain) = numbers(&summary(&draws));
    for power in (-1000..=1020).step_by(20) {
        // Powers of 2, so that only the exponents of the draws change.
        let unit = libm_ldexp(power);
        let x = scaled(&draws, unit);
        let (got, bare) = numbers(&summary(&x));
        let right = got.iter().zip(lengths).all(|(g, l)| agree(*g, l * unit, 1e-12, 0.0));
        points.check(right, || format!("2^{power}: {got:?}, expected {lengths:?} times {unit:e}"));
        points.check(bare == plain, || format!("2^{power}: {bare:?}, expected {plain:?}"));
        let others = |x: &[Vec<f64>]| {
            [ess_mean(x), ess_quantile(x, 0.25), ess_bulk(x), ess_tail(x), r_hat(x)]
        };
        points.check(others(&x) == others(&draws), || format!("2^{power}: {:?}", others(&x)));
        let errors = [mcse_mean(&x), mcse_sd(&x)];
        let right = agree(errors[0], lengths[5] * unit, 1e-12, 0.0)
            && agree(errors[1], lengths[6] * unit, 1e-12, 0.0);
        points.check(right, || format!("2^{power}: {errors:?}"));
    }
    points.finish();
}

fn libm_ldexp(power: i32) -> f64 {
    // In two steps, so that products such as 2^-1000 times 2^-20 are exact.
    2f64.powi(power / 2) * 2f64.powi(power - power / 2)
}

#[test]
fn outcomes_are_stated() {
    let mut points = Points::of("diagnostics of odd draws");
    let (inf, nan) = (f64::INFINITY, f64::NAN);
    for c in [0.0, -0.0, 5e-324, 1e-300, 1.0, -1e150, 1e300, f64::MAX] {
        for count in [1, 4] {
            let s = summary(&vec![vec![c; 50]; count]);
            // The mean is rounded, and so is everything that depends on it.
            let little = 4e-15 * c.abs();
            let right = agree(s.mean, c, 4e-15, 0.0)
                && s.sd <= little
                && [s.q05, s.q50, s.q95].iter().all(|q| *q == c);
            points.check(right, || format!("{count} constant chains of {c:e}: {s:?}"));
            points.check(s.ess_bulk == 50.0 * count as f64 && s.r_hat.is_nan(), || {
                format!("{c:e}: {s:?}")
            });
            let unsure = s.mcse_sd > little || s.mcse_mean > little;
            points.check(!unsure && !s.mcse_mean.is_nan(), || format!("{c:e}: {s:?}"));
        }
    }
    for odd in [inf, -inf, nan] {
        for at in [0, 50, 199] {
            let mut x = chains();
            x[1][at] = odd;
            let s = summary(&x);
            let unknown = [s.ess_bulk, s.ess_tail, s.r_hat, s.mcse_mean, s.mcse_sd, s.sd];
            points.check(unknown.iter().all(|v| v.is_nan()), || format!("{odd} at {at}: {s:?}"));
            let quantiles = [s.q05, s.q50, s.q95];
            let right =
                quantiles.iter().all(|q| if odd.is_nan() { q.is_nan() } else { q.is_finite() });
            points.check(right && same(s.mean, odd), || format!("{odd} at {at}: {s:?}"));
        }
    }
    let x = [vec![inf; 20], vec![-inf; 20]];
    let s = summary(&x);
    points.check(s.mean.is_nan() && s.q05 == -inf && s.q95 == inf, || format!("{s:?}"));
    // Interpolation between two order statistics of any size; between infinities of
    // opposite sign it is undefined.
    let cases: [(&[f64], f64, f64); 12] = [
        (&[-f64::MAX, f64::MAX], 0.5, 0.0),
        (&[-f64::MAX, f64::MAX], 0.75, 0.75 * f64::MAX - 0.25 * f64::MAX),
        (&[0.0, inf], 0.0, 0.0),
        (&[0.0, inf], 0.5, inf),
        (&[-inf, 0.0], 1.0, 0.0),
        (&[-inf, 0.0], 0.0, -inf),
        (&[-inf, 0.0], 0.5, -inf),
        (&[-inf, inf], 0.5, nan),
        (&[-inf, 1.0, inf], 0.5, 1.0),
        (&[5e-324, 1e-323], 0.0, 5e-324),
        (&[1e-300, 1e300], 0.0, 1e-300),
        (&[1e300, 1e-300, 3e300], 0.75, 2e300),
    ];
    for (x, p, expected) in cases {
        let got = quantile(x, p);
        points.check(same(got, expected), || format!("quantile {p} of {x:?}: {got:e}"));
    }
    // Two modes that chains do not leave, at any distance.
    for (here, there) in [(1e-300, 2e-300), (-1e300, 1e300), (0.0, 1.0), (-f64::MAX, f64::MAX)] {
        let at = |c: f64| {
            chains()
                .iter()
                .map(|x| {
                    x.iter()
                        .map(|x| c + 1e-3 * c.abs() * x)
                        .map(|x| x.clamp(f64::MIN, f64::MAX))
                        .collect()
                })
                .take(2)
                .collect::<Vec<Vec<f64>>>()
        };
        let x = [at(here), at(there)].concat();
        let r = r_hat(&x);
        points.check(r > 1.5, || format!("R-hat of {here:e} and {there:e}: {r}"));
        let groups = modes(&[&x]);
        points.check(groups.len() == 2, || format!("modes of {here:e} and {there:e}: {groups:?}"));
    }
    points.finish();
}
