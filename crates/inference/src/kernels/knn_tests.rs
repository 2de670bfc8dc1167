//! Compares the proposal with slow references: its density integrates to 1, and is the
//! density of its draws.

use super::*;
use crate::Pick;
use crate::neighbours::Latents;
use pcadlang_engine::trace::Constraint;
use pcadlang_engine::trace::{Draws, Selector, Trace};
use pcadlang_numerics::rng::{Purpose, StreamKey};

fn trace(text: &str) -> Trace {
    crate::testing::trace(text, 3)
}

fn kernel(entries: Vec<Latents>, among: &[Latents]) -> Knn {
    let scope = SiteSelection { selector: Selector::All, pick: Pick::All };
    Knn::new(scope, Arc::new(Neighbours::new(entries, among)))
}

fn places(t: &Trace) -> Vec<Place> {
    t.all_targets().iter().map(|c| Place::of(t, *c).unwrap()).collect()
}

/// The trace with another value of its only choice.
fn at(t: &Trace, x: Datum) -> Trace {
    let hash = t.address_hash(t.all_targets()[0]);
    let values = [(hash, Constraint::Stored(x))];
    Trace::generate(Arc::clone(t.code()), values, Draws::default(), Default::default()).unwrap().0
}

/// The density of the proposal at a value.
fn density(k: &Knn, t: &Trace, x: Datum) -> f64 {
    let p = places(&at(t, x));
    libm::exp(k.log_density(&p) + p[0].score)
}

/// Entries with one continuous choice at these coordinates.
fn free(t: &Trace, ys: &[f64]) -> Vec<Latents> {
    let hash = t.address_hash(t.all_targets()[0]);
    ys.iter().map(|y| [(hash, Latent::Free(vec![*y]))].into_iter().collect()).collect()
}

#[test]
fn densities_of_numbers_integrate_to_one() {
    let models = [
        ("assume x ~ normal(1, 2); observe normal(x, 1) = 0;", -25.0, 25.0),
        ("assume x ~ uniform(2, 5); observe normal(x, 1) = 0;", 2.0, 5.0),
        ("assume x ~ gamma(2, 1); observe normal(x, 1) = 0;", 0.0, 400.0),
        ("assume x ~ von_mises(0.5, 2); observe normal(x, 1) = 0;", -PI, PI),
    ];
    for (text, lo, hi) in models {
        let t = trace(text);
        let k = kernel(free(&t, &[-0.3, 0.4, 1.9]), &[]);
        let n = 20_000;
        let h = (hi - lo) / f64::from(n);
        let total: f64 =
            (0..n).map(|i| density(&k, &t, Datum::Num(lo + (f64::from(i) + 0.5) * h)) * h).sum();
        assert!((total - 1.0).abs() < 2e-3, "{text}: {total}");
    }
}

#[test]
fn masses_of_discrete_choices_sum_to_one() {
    let t = trace("assume x ~ categorical([0.5, 0.3, 0.2]); observe normal(x, 1) = 0;");
    let hash = t.address_hash(t.all_targets()[0]);
    let scene =
        |x: f64| -> Latents { [(hash, Latent::Discrete(Datum::Num(x)))].into_iter().collect() };
    let k = kernel(vec![scene(2.0), scene(2.0), scene(0.0)], &[]);
    let q: Vec<f64> = (0..3).map(|x| density(&k, &t, Datum::Num(f64::from(x)))).collect();
    let by_hand = |x: usize, copies: f64| {
        let prior = [0.5, 0.3, 0.2][x];
        PRIOR * prior + (1.0 - PRIOR) * (REDRAWN * prior + (1.0 - REDRAWN) * copies / 3.0)
    };
    for (x, copies) in [(0, 1.0), (1, 0.0), (2, 2.0)] {
        assert!((q[x] - by_hand(x, copies)).abs() < 1e-14);
    }
    assert!((q.iter().sum::<f64>() - 1.0).abs() < 1e-14);
}

/// The mixture is over all choices jointly and not one by one: two scenes and two
/// numbers, compared with the sum written out.
#[test]
fn the_mixture_is_joint() {
    let t =
        trace("assume x ~ normal(0, 1); assume y ~ normal(0, 3); observe normal(x + y, 1) = 0;");
    let hash: Vec<u64> = t.all_targets().iter().map(|c| t.address_hash(*c)).collect();
    let scene = |a: f64, b: f64| -> Latents {
        [(hash[0], Latent::Free(vec![a])), (hash[1], Latent::Free(vec![b]))].into_iter().collect()
    };
    let entries = vec![scene(-1.0, 2.0), scene(0.5, -4.0)];
    let among: Vec<Latents> = (0..5).map(|i| scene(f64::from(i), 10.0 * f64::from(i))).collect();
    let k = kernel(entries.clone(), &among);
    let p = places(&t);
    let at = |i: usize| match &p[i].form {
        Form::Free { y, .. } => y[0],
        _ => f64::NAN,
    };
    let sd = |i: usize| {
        let (a, b): (f64, f64) = ([-1.0, 2.0][i], [0.5, -4.0][i]);
        let local = (a - b).abs() / 2f64.sqrt();
        let wide = [1.0, 10.0][i] * 2.5f64.sqrt();
        (1.06 * 2f64.powf(-0.2) * local).max(FLOOR * wide)
    };
    let normal = |x: f64, m: f64, s: f64| (-0.5 * ((x - m) / s).powi(2)).exp() / (s * TAU.sqrt());
    let mut mixture = PRIOR * (p[0].score + p[1].score).exp();
    for (a, b) in [(-1.0, 2.0), (0.5, -4.0)] {
        for w in WIDTHS {
            mixture +=
                (1.0 - PRIOR) / 4.0 * normal(at(0), a, sd(0) * w) * normal(at(1), b, sd(1) * w);
        }
    }
    let q = k.log_density(&p) + p[0].score + p[1].score;
    assert!((q - mixture.ln()).abs() < 1e-12, "{q}, {}", mixture.ln());
}

/// Draws follow the claimed density: fractions of draws in bins against the integral over
/// each bin.
#[test]
fn draws_follow_the_density() {
    let text = "assume x ~ uniform(0, 1); observe normal(x, 1) = 0;";
    let t = trace(text);
    let k = kernel(free(&t, &[-2.0, 1.0, 1.5]), &[]);
    let bins = 20;
    let (mut counts, n) = (vec![0.0; bins], 40_000);
    let p = places(&t);
    let mut rng = StreamKey::new(1, 0, Purpose::KERNEL).stream(0, 0, 0);
    for _ in 0..n {
        let x = match &k.draw(&p, &mut rng)[0] {
            Change::Free(y) => Support::Interval { lo: 0.0, hi: 1.0 }.from_free_scalar(y[0]).0,
            _ => rng.uniform(),
        };
        counts[((x * bins as f64) as usize).min(bins - 1)] += 1.0;
    }
    let fine = 200;
    for (b, count) in counts.iter().enumerate() {
        let middle = |i: usize| (b as f64 + (i as f64 + 0.5) / fine as f64) / bins as f64;
        let mass: f64 = (0..fine).map(|i| density(&k, &t, Datum::Num(middle(i)))).sum::<f64>()
            / (fine * bins) as f64;
        let expected = mass * f64::from(n);
        assert!(
            (count - expected).abs() < 5.0 * expected.sqrt() + 5.0,
            "bin {b}: {count}, expected {expected}"
        );
    }
}

#[test]
fn without_neighbours_or_with_none_that_fit_it_is_the_prior() {
    let t = trace("assume x ~ normal(0, 1); observe normal(x, 1) = 0;");
    assert_eq!(kernel(Vec::new(), &[]).log_density(&places(&t)), 0.0);
    let other: Latents = [(7, Latent::Free(vec![0.0]))].into_iter().collect();
    let hash = t.address_hash(t.all_targets()[0]);
    let form: Latents = [(hash, Latent::Discrete(Datum::Bool(true)))].into_iter().collect();
    assert!(kernel(vec![other, form], &[]).log_density(&places(&t)).abs() < 1e-15);
}

#[test]
fn wide_normals_round_the_circle_are_uniform() {
    for (x, sd, expected) in [
        (0.4, 20.0, -TAU.ln()),
        (-3.0, 1e6, -TAU.ln()),
        (TAU + 0.01, 0.01, -0.5 - 0.01f64.ln() - 0.5 * TAU.ln()),
    ] {
        let got = log_wrapped(x, sd);
        assert!((got - expected).abs() < 1e-3, "{x} {sd}: {got}, {expected}");
    }
    // The density on the circle integrates to one for any standard deviation.
    for sd in [0.3, 1.0, 2.0, 5.0] {
        let n = 2000;
        let total: f64 =
            (0..n).map(|i| log_wrapped(TAU * f64::from(i) / f64::from(n), sd).exp()).sum();
        assert!((total * TAU / f64::from(n) - 1.0).abs() < 1e-9, "{sd}: {total}");
    }
}

#[test]
fn a_scene_whose_choice_has_other_coordinates_is_the_prior() {
    let t = trace("assume x ~ normal(0, 1); observe normal(x, 1) = 0;");
    let hash = t.address_hash(t.all_targets()[0]);
    let with = |last: Latents| {
        let mut entries = free(&t, &[-1.0, 1.5]);
        entries.push(last);
        density(&kernel(entries, &[]), &t, Datum::Num(0.3))
    };
    let longer = with([(hash, Latent::Free(vec![0.3, 0.0]))].into_iter().collect());
    let absent = with([(7, Latent::Free(vec![0.3]))].into_iter().collect());
    assert_eq!(longer, absent);
}
