//! Single transitions from exact draws: the end has the same distribution as the start,
//! and pairs (start, end) are as frequent as (end, start). These are exact tests, with
//! fixed seeds, of errors that would otherwise show in long chains only: in the
//! acceptance of doubling in `slice`, in the selection of a point of the trajectory in
//! `nuts`, in the metric of Hamiltonian kernels. A correct kernel fails a test with
//! probability 1e-6.

use ciborium::Value as Cbor;
use pcadlang::Model;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Selector, Trace};
use pcadlang_inference::{Hmc, Kernel, Nuts, Pick, SiteSelection, Slice, StepContext};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// The probability that a correct kernel fails a test.
const ALPHA: f64 = 1e-6;

/// Uniform numbers in 0..1, reproducible in every run.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let mut x = self.0;
        x = (x ^ (x >> 33)).wrapping_mul(0xff51afd7ed558ccd);
        ((x ^ (x >> 33)) >> 11) as f64 / (1u64 << 53) as f64 + 1e-17
    }

    fn normal(&mut self) -> f64 {
        standard().inverse_cdf(self.next().clamp(1e-16, 1.0 - 1e-16))
    }
}

fn standard() -> Normal {
    Normal::new(0.0, 1.0).unwrap()
}

fn all() -> SiteSelection {
    SiteSelection { selector: Selector::All, pick: Pick::All }
}

fn trace(text: &str) -> Trace {
    Model::from_text(text).and_then(|m| m.simulate(1, 0)).unwrap_or_else(|e| panic!("{e}"))
}

fn put(trace: &mut Trace, values: &[(&str, Value)]) {
    for (address, v) in values {
        trace.set(address, v.clone(), Draws::default()).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// Returns the p-value of counts in equally probable cells.
fn even(counts: &[u64]) -> f64 {
    let expected = counts.iter().sum::<u64>() as f64 / counts.len() as f64;
    let chi2: f64 = counts.iter().map(|c| (*c as f64 - expected).powi(2) / expected).sum();
    1.0 - ChiSquared::new(counts.len() as f64 - 1.0).unwrap().cdf(chi2)
}

/// Returns the p-value of the numbers of moves in two directions that are equally
/// probable.
fn balanced(there: u64, back: u64) -> f64 {
    let z = (there as f64 - back as f64) / ((there + back) as f64).sqrt();
    2.0 * standard().cdf(-z.abs())
}

/// Prints a p-value, and fails if it is too small for a correct kernel.
fn holds(what: &str, p: f64) {
    println!("{what}: p = {p:.2e}");
    assert!(p >= ALPHA, "{what}: p = {p:.2e}");
}

/// A density of one number: exact draws, and its distribution function.
struct Density<'a> {
    text: &'a str,
    draw: fn(&mut Uniform) -> f64,
    cdf: fn(f64) -> f64,
    /// A point between the modes.
    middle: f64,
}

/// The distribution function of a narrow mode, and a wide one with more mass.
fn modes_cdf(x: f64) -> f64 {
    0.3 * standard().cdf((x + 3.0) / 0.1) + 0.7 * standard().cdf(x - 1.5)
}

/// By segment: its end, and the factor by which the density of normal(0, 2) is
/// multiplied.
const STEPS: [(f64, f64); 3] = [(-1.0, 8.0), (1.0, 0.02), (f64::INFINITY, 1.0)];

/// Returns the mass of the segments up to x, without normalisation.
fn steps_mass(x: f64) -> f64 {
    let normal = |x: f64| standard().cdf(x / 2.0);
    let mut from = f64::NEG_INFINITY;
    STEPS
        .map(|(to, weight)| {
            weight * (normal(x.min(to)) - normal(x.min(std::mem::replace(&mut from, to))))
        })
        .iter()
        .sum()
}

const DENSITIES: [Density; 2] = [
    Density {
        text: "assume x ~ mixture([0.3, 0.7], [normal(-3, 0.1), normal(1.5, 1)]); observe normal(0 * x, 1) = 0;",
        draw: |u| if u.next() < 0.3 { 0.1 * u.normal() - 3.0 } else { u.normal() + 1.5 },
        cdf: modes_cdf,
        middle: -2.0,
    },
    Density {
        text: "assume x ~ normal(0, 2); factor(log(if x < -1 { 8 } else { if x < 1 { 0.02 } else { 1 } }));",
        draw: |u| loop {
            let x = 2.0 * u.normal();
            let weight = STEPS.iter().find(|(to, _)| x < *to).map_or(0.0, |s| s.1);
            if 8.0 * u.next() < weight {
                return x;
            }
        },
        cdf: |x| steps_mass(x) / steps_mass(f64::INFINITY),
        middle: 0.0,
    },
];

/// Slice sampling, by doubling or stepping out, of two modes of different widths and of a
/// step function.
#[test]
fn slices_of_two_modes() {
    for (d, doubling, width) in
        [(0, true, 0.3), (0, true, 3.0), (0, false, 1.5), (1, true, 0.3), (1, false, 0.5)]
    {
        let d = &DENSITIES[d];
        let (mut trace, mut rng) = (trace(d.text), Uniform(7));
        let mut kernel = Slice::new(all(), Some(width), doubling);
        let (mut bins, mut there, mut back) = ([0; 12], 0, 0);
        for i in 0..12_000 {
            let from = (d.draw)(&mut rng);
            put(&mut trace, &[("@x", from.into())]);
            kernel.step(&mut trace, &StepContext::new(3, 0, i)).unwrap();
            let Ok(Value::Num(to)) = trace.get("@x") else { panic!("no number") };
            there += u64::from(from < d.middle && to > d.middle);
            back += u64::from(from > d.middle && to < d.middle);
            bins[(((d.cdf)(to) * 12.0) as usize).min(11)] += 1;
        }
        let what = format!("slice(width = {width}, doubling = {doubling}) on {}", d.text);
        assert!(there + back > 100 || !doubling, "{what}: {there} moves between the modes");
        if doubling {
            holds(&format!("{what}: there and back"), balanced(there, back));
        }
        holds(&format!("{what}: ends"), even(&bins));
    }
}

/// Numbers of two scales, so that trajectories are long and their energy oscillates.
const GAUSSIAN: &str = "assume a ~ iid(normal(0, 1), 5); assume b ~ normal(0, 8); observe normal(0 * (sum(a) + b), 1) = 0;";

/// Returns a kernel whose adapted step size and inverse masses are replaced by these:
/// those of `a`, and that of `b`; if `mixed`, after a map of all coordinates.
fn set<K: Kernel>(
    mut kernel: K,
    trace: &mut Trace,
    step: f64,
    masses: ([f64; 5], f64),
    mixed: bool,
) -> K {
    put(trace, &[("@a", Value::array(vec![0.1; 5])), ("@b", 0.2.into())]);
    kernel.step(trace, &StepContext::new(1, 0, 0)).unwrap();
    let mut state: Cbor = ciborium::from_reader(&kernel.save(trace)[..]).unwrap();
    let adaptation = state.as_array_mut().unwrap()[0].as_map_mut().unwrap();
    let sizes = adaptation
        .iter()
        .find(|(k, _)| k.as_text() == Some("signature"))
        .unwrap()
        .1
        .as_array()
        .unwrap()
        .clone();
    // By address: one entry is `b`, the others are the elements of `a`, in order.
    let b = trace.address_hash(trace.find(&"@b".parse().unwrap()).unwrap());
    let (mut rest, is_b) =
        (masses.0.into_iter(), |s: &Cbor| s.as_array().unwrap()[0] == Cbor::from(b));
    let masses: Vec<Cbor> = sizes
        .iter()
        .flat_map(|s| {
            if is_b(s) {
                vec![masses.1]
            } else {
                rest.by_ref().take(if sizes.len() == 2 { 5 } else { 1 }).collect()
            }
        })
        .map(|m: f64| Cbor::Float(m.sqrt()))
        .collect();
    assert!(masses.len() == 6);
    let entry = |i: usize, j: usize| f64::from(u8::from(i == j)) + 0.3 * ((i + 2 * j) as f64).sin();
    let map = |entry: &dyn Fn(usize, usize) -> f64| {
        let all = (0..36).map(|k| Cbor::Float(entry(k / 6, k % 6)));
        Cbor::Array(if mixed { all.collect() } else { Vec::new() })
    };
    let mut found = 0;
    for (name, value) in adaptation {
        match name.as_text() {
            Some("metric") => {
                for (name, value) in value.as_map_mut().unwrap() {
                    match name.as_text().unwrap() {
                        "scales" => *value = Cbor::Array(masses.clone()),
                        "columns" => *value = map(&|j, i| entry(i, j)),
                        "rows" => *value = map(&entry),
                        _ => continue,
                    }
                    found += 1;
                }
            }
            Some("step" | "averaged") => *value = Cbor::Float(step),
            _ => {}
        }
    }
    assert_eq!(found, 3);
    let mut bytes = Vec::new();
    ciborium::into_writer(&state, &mut bytes).unwrap();
    kernel.load(&bytes).unwrap();
    kernel
}

/// Makes `count` transitions, each from a draw of the Gaussian, and tests the
/// distributions of the elements of `a`, of `b`, and of the squared length of `a`.
fn gaussian_stays(what: &str, mut kernel: impl Kernel, trace: &mut Trace, count: u64) {
    let mut rng = Uniform(11);
    let (mut bins, mut accepted) = ([[0; 16]; 3], 0);
    let length = ChiSquared::new(5.0).unwrap();
    for i in 0..count {
        let a: Vec<f64> = (0..5).map(|_| rng.normal()).collect();
        put(trace, &[("@a", Value::array(a)), ("@b", (8.0 * rng.normal()).into())]);
        accepted += kernel.step(trace, &StepContext::new(5, 0, i)).unwrap().accepted;
        let (Ok(Value::Array(a)), Ok(Value::Num(b))) = (trace.get("@a"), trace.get("@b")) else {
            panic!("no numbers")
        };
        let mut count =
            |list: usize, place: f64| bins[list][((place * 16.0) as usize).min(15)] += 1;
        a.iter().for_each(|z| count(0, standard().cdf(*z)));
        count(1, standard().cdf(b / 8.0));
        count(2, length.cdf(a.iter().map(|z| z * z).sum()));
    }
    let share = f64::from(accepted) / count as f64;
    assert!((0.2..1.0 + 1e-9).contains(&share), "{what}: {share} accepted");
    for (bins, of) in bins.iter().zip(["a", "b", "the length of a"]) {
        holds(&format!("{what}, {of}"), even(bins));
    }
}

/// The step is so long that the weights of points along a trajectory differ much, so that
/// errors in the selection among them show.
#[test]
fn places_of_a_trajectory_are_chosen_by_their_weights() {
    let mut t = trace(GAUSSIAN);
    for step in [1.6, 1.8] {
        let kernel = set(Nuts::new(all(), 8), &mut t, step, ([1.0; 5], 1.0), false);
        gaussian_stays(&format!("nuts, step {step}"), kernel, &mut t, 8000);
    }
}

/// Inverse masses far from 1 and from each other, and a map that mixes coordinates: any
/// metric leaves the density invariant.
#[test]
fn metrics_leave_the_density_as_it_is() {
    let mut t = trace(GAUSSIAN);
    let masses = ([6.0, 0.2, 1.0, 3.0, 0.5], 40.0);
    for mixed in [false, true] {
        let kernel = set(Hmc::new(all(), 3, None), &mut t, 0.5, masses, mixed);
        gaussian_stays(&format!("hmc, uneven metric, {mixed}"), kernel, &mut t, 4000);
        let kernel = set(Hmc::new(all(), 1, None), &mut t, 0.5, masses, mixed);
        gaussian_stays(&format!("mala, uneven metric, {mixed}"), kernel, &mut t, 4000);
        let kernel = set(Nuts::new(all(), 6), &mut t, 0.5, masses, mixed);
        gaussian_stays(&format!("nuts, uneven metric, {mixed}"), kernel, &mut t, 2000);
    }
}

/// Warm-up learns the variance of each number, not its inverse or its root.
#[test]
fn metrics_learn_variances() {
    let text = "assume x ~ normal(0, 0.05); assume y ~ normal(0, 0.3); assume z ~ normal(0, 1.5);
                observe normal(0 * (x + y + z), 1) = 0;";
    for mut kernel in
        [Box::new(Nuts::new(all(), 8)) as Box<dyn Kernel>, Box::new(Hmc::new(all(), 10, None))]
    {
        let mut t = trace(text);
        for i in 0..1000 {
            kernel
                .step(&mut t, &StepContext { adapting: true, ..StepContext::new(2, 0, i) })
                .unwrap();
        }
        let state: Cbor = ciborium::from_reader(&kernel.save(&t)[..]).unwrap();
        let adaptation = state.as_array().unwrap()[0].as_map().unwrap().clone();
        let field = |map: &[(Cbor, Cbor)], name: &str| {
            map.iter().find(|(k, _)| k.as_text() == Some(name)).unwrap().1.clone()
        };
        let metric = field(&adaptation, "metric").as_map().unwrap().clone();
        let scales = field(&metric, "scales").as_array().unwrap().clone();
        let mut learnt: Vec<f64> = scales.iter().map(|x| x.as_float().unwrap().powi(2)).collect();
        // In any order of the choices.
        learnt.sort_by(f64::total_cmp);
        for (found, variance) in learnt.iter().zip([0.0025, 0.09, 2.25]) {
            assert!((0.3..3.0).contains(&(found / variance)), "{}: {learnt:?}", kernel.name());
        }
    }
}
