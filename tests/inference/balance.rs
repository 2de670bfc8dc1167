//! Every kernel is reversible: the joint counts of (state, next state) are symmetric, and
//! the marginal is the posterior.
//!
//! For a reversible chain in equilibrium the numbers of moves i to j and j to i have the
//! same expectation, also for states lumped together, and the variance of their
//! difference is at most that of independent moves. A mixture of reversible kernels is
//! reversible, so a kernel that does not reach every state by itself is mixed with one
//! that does.

use crate::common::*;
use pcadlang::Model;
use pcadlang_inference::{Banks, RunOptions};
use std::sync::Arc;

/// A model, the function that maps its states to cells, and the posterior mass of each
/// cell.
struct Case {
    name: &'static str,
    text: &'static str,
    collect: &'static str,
    cell: fn(&Draws, usize) -> usize,
    mass: fn() -> Vec<f64>,
}

fn normalised(mut w: Vec<f64>) -> Vec<f64> {
    let z: f64 = w.iter().sum();
    w.iter_mut().for_each(|x| *x /= z);
    w
}

/// Returns the index of the interval between edges that contains a number.
fn bin(x: f64, edges: &[f64]) -> usize {
    edges.iter().take_while(|e| x >= **e).count()
}

const DISCRETE: Case = Case {
    name: "discrete",
    text:
        "assume a ~ categorical([0.2, 0.5, 0.3]); assume b ~ flip(if a == 1 { 0.7 } else { 0.2 });
           observe normal(a + (if b { 1 } else { 0 }), 0.7) = 1.5;",
    collect: "a, b",
    cell: |d, i| d["a"][i] as usize * 2 + d["b"][i] as usize,
    mass: || {
        let p = |a: usize, b: usize| {
            let pb = if a == 1 { 0.7 } else { 0.2 };
            [0.2, 0.5, 0.3][a]
                * if b == 1 { pb } else { 1.0 - pb }
                * normal_pdf(1.5, (a + b) as f64, 0.7)
        };
        normalised((0..6).map(|i| p(i / 2, i % 2)).collect())
    },
};

/// One branch has a discrete choice, the other a positive one and a flip.
const STRUCTURE: Case = Case {
    name: "structure",
    text: "assume c ~ flip(0.4);
           assume x = if c { a ~ categorical([1, 2, 1]); a }
                      else { b ~ gamma(2, 1); d ~ flip(0.3); if d { b } else { b + 1 } };
           observe normal(x, 1) = 2;",
    collect: "c, x",
    cell: |d, i| {
        let x = d["x"][i];
        if d["c"][i] == 1.0 { x as usize } else { 3 + bin(x, &[1.0, 1.7, 2.5]) }
    },
    mass: || {
        let gamma = |b: f64| if b > 0.0 { b * (-b).exp() } else { 0.0 };
        let f = |x: f64| 0.6 * (0.3 * gamma(x) + 0.7 * gamma(x - 1.0)) * normal_pdf(2.0, x, 1.0);
        let mut w: Vec<f64> =
            (0..3).map(|a| 0.4 * [0.25, 0.5, 0.25][a] * normal_pdf(2.0, a as f64, 1.0)).collect();
        w.extend(
            [(0.0, 1.0), (1.0, 1.7), (1.7, 2.5), (2.5, 14.0)]
                .map(|(a, b)| integrate(f, a, b, 2000)),
        );
        normalised(w)
    },
};

/// The same with a surrogate that disagrees with the likelihood.
const SURROGATE: Case = Case {
    name: "surrogate",
    text: "assume c ~ flip(0.4);
           assume x = if c { a ~ categorical([1, 2, 1]); a }
                      else { b ~ gamma(2, 1); d ~ flip(0.3); if d { b } else { b + 1 } };
           observe normal(x, 1) = 2 with coarse = normal(x - 0.7, 1.5) as y;",
    ..STRUCTURE
};

/// The same in three parts, of which later stages compare two.
const WAITING: Case = Case {
    name: "waiting",
    text: "assume c ~ flip(0.4);
           assume x = if c { a ~ categorical([1, 2, 1]); a }
                      else { b ~ gamma(2, 1); d ~ flip(0.3); if d { b } else { b + 1 } };
           observe normal(x, sqrt(3)) = 2;
           observe normal(x, sqrt(3)) = 2 with coarse = flat() as y;
           observe normal(x, sqrt(3)) = 2 with coarse = flat() as z;",
    ..STRUCTURE
};

/// The masses of a model in which x is beta or gamma depending on c: by c, and by the
/// interval of x.
const BETA_OR_GAMMA: fn() -> Vec<f64> = || {
    let beta = |x: f64| if x > 0.0 && x < 1.0 { 12.0 * x * (1.0 - x) * (1.0 - x) } else { 0.0 };
    let gamma = |x: f64| x * (-x).exp();
    let cell = |lo: f64, hi: f64, c: bool| {
        let f = |x: f64| if c { 0.4 * beta(x) } else { 0.6 * gamma(x) } * normal_pdf(0.8, x, 0.5);
        integrate(f, lo, hi, 2000)
    };
    let parts = |c: bool| {
        [(0.0, 0.4), (0.4, 0.8), (0.8, if c { 1.0 } else { 9.0 })].map(|(a, b)| cell(a, b, c))
    };
    normalised([parts(false), parts(true)].concat())
};

fn beta_or_gamma(d: &Draws, i: usize) -> usize {
    d["c"][i] as usize * 3 + bin(d["x"][i], &[0.4, 0.8])
}

/// The same name in both branches: two addresses, `@x/a` and `@x/a#2`, of which exactly
/// one exists at any time.
const SAME_NAME: Case = Case {
    name: "same name",
    text: "assume c ~ flip(0.4);
           assume x = if c { a ~ beta(2, 3); a } else { a ~ gamma(2, 1); a };
           observe normal(x, 0.5) = 0.8;",
    collect: "c, x",
    cell: beta_or_gamma,
    mass: BETA_OR_GAMMA,
};

/// The same address in both states of c, since two functions are called at the same
/// place: one choice vanishes and another with a different support appears, both at
/// `@x/f/a`.
const SHARED: Case = Case {
    name: "shared address",
    text: "assume c ~ flip(0.4);
           let f = if c { fn() { a ~ beta(2, 3); a } } else { fn() { a ~ gamma(2, 1); a } };
           assume x = f();
           observe normal(x, 0.5) = 0.8;",
    collect: "c, x",
    cell: beta_or_gamma,
    mass: BETA_OR_GAMMA,
};

/// One choice whose support depends on another; outside of it the density is zero.
const MOVING: Case = Case {
    name: "moving support",
    text: "assume c ~ flip(0.4); let d = if c { beta(2, 3) } else { gamma(2, 1) };
           assume x ~ d;
           observe normal(x, 0.5) = 0.8;",
    collect: "c, x",
    cell: beta_or_gamma,
    mass: BETA_OR_GAMMA,
};

/// The support of k depends on n; with n = 0 it is a single value.
const FINITE_SUPPORT: Case = Case {
    name: "finite support",
    text: "assume n ~ categorical([0.3, 0.3, 0.4]); assume k ~ uniform_discrete(0, n);
           observe normal(k - 0.5 * n, 1) = 0.4;",
    collect: "n, k",
    cell: |d, i| [0, 1, 3][d["n"][i] as usize] + d["k"][i] as usize,
    mass: || {
        let p = |n: usize, k: usize| {
            [0.3, 0.3, 0.4][n] / (n + 1) as f64 * normal_pdf(0.4, k as f64 - 0.5 * n as f64, 1.0)
        };
        normalised(vec![p(0, 0), p(1, 0), p(1, 1), p(2, 0), p(2, 1), p(2, 2)])
    },
};

const SUPPORT: Case = Case {
    name: "support",
    text: "assume p1 ~ uniform(0.5, 1); assume p2 ~ uniform(0, p1); observe binomial(4, p2) = 1;",
    collect: "p1, p2",
    cell: |d, i| bin(d["p1"][i], &[0.75]) * 4 + bin(d["p2"][i], &[0.15, 0.3, 0.5]),
    mass: || {
        let like = |p: f64| p * (1.0 - p).powi(3);
        let cell = |lo: f64, hi: f64, a: f64, b: f64| {
            integrate(|p1| integrate(like, a, b.min(p1).max(a), 200) / p1, lo, hi, 200)
        };
        let row = |lo, hi| {
            [(0.0, 0.15), (0.15, 0.3), (0.3, 0.5), (0.5, 1.0)].map(|(a, b)| cell(lo, hi, a, b))
        };
        normalised([row(0.5, 0.75), row(0.75, 1.0)].concat())
    },
};

const GAUSSIAN: Case = Case {
    name: "gaussian",
    text: "assume a ~ normal(0.5, 1); assume b ~ normal(a, 1); observe normal(a * b, 0.8) = 1;",
    collect: "a, b",
    cell: |d, i| bin(d["a"][i], &[-0.5, 0.5, 1.2]) * 3 + bin(d["b"][i], &[0.0, 1.0]),
    mass: || {
        let cell = |a0: f64, a1: f64, b0: f64, b1: f64| {
            let inner = |a: f64| {
                integrate(|b| normal_pdf(b, a, 1.0) * normal_pdf(1.0, a * b, 0.8), b0, b1, 600)
                    * normal_pdf(a, 0.5, 1.0)
            };
            integrate(inner, a0, a1, 600)
        };
        let row =
            |a0, a1| [(-8.0, 0.0), (0.0, 1.0), (1.0, 9.0)].map(|(b0, b1)| cell(a0, a1, b0, b1));
        normalised([row(-5.0, -0.5), row(-0.5, 0.5), row(0.5, 1.2), row(1.2, 6.0)].concat())
    },
};

/// Two positive numbers, moved by deterministic maps: swapped, one of them scaled, or
/// their sum split in another proportion.
const MAPS: Case = Case {
    name: "maps",
    text: "assume x ~ gamma(2, 1); assume y ~ gamma(3, 1); observe normal(x - 2 * y, 1) = -1;
           kernel swap() { propose @x = value(@y); propose @y = value(@x); }
           kernel scaled() { propose u ~ lognormal(0, 0.7); propose @x = value(@x) * u; propose u = 1 / u; }
           kernel split() {
             propose u ~ beta(2, 3);
             let all = value(@x) + value(@y);
             propose @x = all * u; propose @y = all * (1 - u); propose u = value(@x) / all;
           }",
    collect: "x, y",
    cell: |d, i| bin(d["x"][i], &[1.0, 2.0]) * 3 + bin(d["y"][i], &[1.0, 1.8]),
    mass: || {
        let cell = |x0: f64, x1: f64, y0: f64, y1: f64| {
            let inner = |x: f64| {
                integrate(|y| y * y * (-y).exp() * normal_pdf(-1.0, x - 2.0 * y, 1.0), y0, y1, 400) * x * (-x).exp()
            };
            integrate(inner, x0, x1, 400)
        };
        let row = |x0, x1| [(0.0, 1.0), (1.0, 1.8), (1.8, 16.0)].map(|(y0, y1)| cell(x0, x1, y0, y1));
        normalised([row(0.0, 1.0), row(1.0, 2.0), row(2.0, 20.0)].concat())
    },
};

/// Two labels that share an observation, one with a prior that depends on a number, and a
/// number whose prior depends on a label.
const MIXTURE: Case = Case {
    name: "mixture",
    text: "assume s ~ gamma(2, 1); assume a ~ flip(0.3); assume b ~ categorical([0.2, 0.5, 0.3]);
           assume m ~ normal(if a { 1 } else { -1 }, s);
           observe normal(m + b, 0.7) = 1.5; observe flip(s / (s + 1)) = true;",
    collect: "s, a, b, m",
    cell: |d, i| {
        (bin(d["s"][i], &[1.5]) * 2 + d["a"][i] as usize) * 6
            + d["b"][i] as usize * 2
            + bin(d["m"][i], &[0.5])
    },
    mass: || {
        let cell = |s0: f64, s1: f64, a: usize, b: usize, m0: f64, m1: f64| {
            let centre = if a == 1 { 1.0 } else { -1.0 };
            let inner = |s: f64| {
                let s = s.max(1e-9);
                let m = |m: f64| normal_pdf(m, centre, s) * normal_pdf(1.5, m + b as f64, 0.7);
                // The integrand is negligible six standard deviations from the observed
                // value.
                let (near, far) = (m0.max(1.5 - b as f64 - 4.2), m1.min(1.5 - b as f64 + 4.2));
                let narrow = (near.max(centre - 8.0 * s), far.min(centre + 8.0 * s));
                let (low, high) = (narrow.0, narrow.1.max(narrow.0));
                s * (-s).exp() * s / (s + 1.0) * integrate(m, low, high, 200)
            };
            [0.7, 0.3][a] * [0.2, 0.5, 0.3][b] * integrate(inner, s0, s1, 600)
        };
        let mut w = Vec::new();
        for (s0, s1) in [(0.0, 1.5), (1.5, 16.0)] {
            for (a, b) in [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)] {
                w.push(cell(s0, s1, a, b, -40.0, 0.5));
                w.push(cell(s0, s1, a, b, 0.5, 40.0));
            }
        }
        normalised(w)
    },
};

/// The number of elements of an array depends on a choice: when it changes, all elements
/// are drawn from the prior.
const ELEMENTS: Case = Case {
    name: "elements",
    text: "assume n ~ categorical([0.5, 0.3, 0.2]); assume z ~ iid(gamma(1, 1), n + 1);
           observe normal(sum(z), 0.8) = 1.5;",
    collect: "n, sum(z)",
    cell: |d, i| d["n"][i] as usize * 2 + bin(d["sum(z)"][i], &[1.4]),
    mass: || {
        // A sum of n + 1 exponentials is gamma(n + 1, 1).
        let f = |n: usize, x: f64| {
            [0.5, 0.3, 0.2][n] * [1.0, x, x * x / 2.0][n] * (-x).exp() * normal_pdf(1.5, x, 0.8)
        };
        let row = |n| [(0.0, 1.4), (1.4, 10.0)].map(|(a, b)| integrate(|x| f(n, x), a, b, 2000));
        normalised([row(0), row(1), row(2)].concat())
    },
};

/// Choices that appear when one of two observations first depends on them, and may be
/// shared.
const SHARED_GROUPS: Case = Case {
    name: "mem",
    text: "assume centre = mem(fn(k) { m ~ gamma(2, 1); m });
           assume a ~ flip(0.5); assume b ~ flip(0.3);
           observe normal(centre(a), 0.7) = 1; observe normal(centre(b), 0.7) = 2.2;",
    collect: "a, b, centre(a)",
    cell: |d, i| (d["a"][i] as usize * 2 + d["b"][i] as usize) * 2 + bin(d["centre(a)"][i], &[1.3]),
    mass: || {
        let prior = |m: f64| m * (-m).exp();
        let near = |m: f64, y: f64| normal_pdf(y, m, 0.7);
        let other = integrate(|m| prior(m) * near(m, 2.2), 0.0, 10.0, 2000);
        let mut w = Vec::new();
        for (a, b) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let p = 0.5 * if b == 1 { 0.3 } else { 0.7 };
            for (lo, hi) in [(0.0, 1.3), (1.3, 10.0)] {
                let f =
                    |m: f64| prior(m) * near(m, 1.0) * if a == b { near(m, 2.2) } else { other };
                w.push(p * integrate(f, lo, hi, 2000));
            }
        }
        normalised(w)
    },
};

/// An unbounded whole number, which is the upper bound of a finite one.
const COUNTS: Case = Case {
    name: "counts",
    text: "assume n ~ poisson(2); assume k ~ binomial(n, 0.6); observe normal(k, 1) = 1.5;",
    collect: "n, k",
    cell: |d, i| (d["n"][i] as usize).min(4) * 3 + (d["k"][i] as usize).min(2),
    mass: || {
        let mut w = vec![0.0; 15];
        let choose =
            |n: u32, k: u32| (0..k).map(|i| f64::from(n - i) / f64::from(i + 1)).product::<f64>();
        let mut poisson = (-2.0f64).exp();
        for n in 0..30u32 {
            for k in 0..=n {
                let p = choose(n, k) * 0.6f64.powi(k as i32) * 0.4f64.powi((n - k) as i32);
                w[(n.min(4) * 3 + k.min(2)) as usize] +=
                    poisson * p * normal_pdf(1.5, f64::from(k), 1.0);
            }
            poisson *= 2.0 / f64::from(n + 1);
        }
        normalised(w)
    },
};

/// Runs a kernel for many steps and checks its balance and its marginal.
fn balanced(case: &Case, kernel: &str, steps: usize) {
    let what = format!("{}, {kernel}", case.name);
    let stmt = if kernel.ends_with('}') { kernel.to_owned() } else { format!("{kernel};") };
    let text = format!(
        "{} infer {{ repeat 300 {{ {stmt} }} repeat {steps} {{ {stmt} collect {}; }} }}",
        case.text, case.collect
    );
    let banks: Arc<dyn Banks> = Arc::new(wrong_neighbours(&Model::from_text(case.text).unwrap()));
    let options = RunOptions { seed: 101, banks: Some(banks), ..RunOptions::default() };
    let d = run_with(&text, &options, 1, 1);
    let states: Vec<usize> = (0..steps).map(|i| (case.cell)(&d, i)).collect();
    let mass = (case.mass)();
    let n = mass.len();
    let mut counts = vec![vec![0.0f64; n]; n];
    states.windows(2).for_each(|w| counts[w[0]][w[1]] += 1.0);
    let mut moves = 0.0;
    for i in 0..n {
        for j in i + 1..n {
            let (there, back) = (counts[i][j], counts[j][i]);
            moves += there + back;
            let bound = 5.0 * (there + back).sqrt() + 5.0;
            assert!(
                (there - back).abs() < bound,
                "{what}: {i} to {j} {there} times, back {back} times"
            );
        }
    }
    assert!(moves > 0.01 * steps as f64, "{what}: the chain hardly moves");
    for (i, expected) in mass.iter().enumerate() {
        let here: Vec<f64> = states.iter().map(|s| f64::from(u8::from(*s == i))).collect();
        let (m, se) = (mean(&here), standard_error(&here));
        assert!(se < 0.03, "{what}: run longer, se {se}");
        // The standard error of a cell that is hardly ever visited is unreliable, so an
        // error of a thousandth is allowed.
        assert!(
            (m - expected).abs() < 5.0 * se + 1e-3,
            "{what}: cell {i} has {m} (se {se}), expected {expected}"
        );
    }
}

fn all_balanced(case: &Case, steps: usize, kernels: &[&str]) {
    kernels.iter().for_each(|k| balanced(case, k, steps));
}

#[test]
fn discrete_choices() {
    all_balanced(&DISCRETE, 20_000, kernels::balance::DISCRETE);
}

#[test]
fn choices_that_appear_and_vanish() {
    all_balanced(&STRUCTURE, 20_000, kernels::balance::STRUCTURE);
}

#[test]
fn surrogates_that_decide_first() {
    all_balanced(&SURROGATE, 20_000, kernels::balance::SURROGATE);
    all_balanced(&WAITING, 20_000, kernels::balance::WAITING);
}

#[test]
fn one_name_in_two_branches() {
    all_balanced(&SAME_NAME, 20_000, kernels::balance::SAME_NAME);
}

#[test]
fn one_address_in_two_branches() {
    let model = Model::from_text(SHARED.text).unwrap();
    for c in [true, false] {
        let mut trace = model.simulate(1, 0).unwrap();
        trace.set("@c", c, Default::default()).unwrap();
        let names: Vec<String> =
            trace.choices().into_iter().map(|(a, _, _)| a.to_string()).collect();
        assert_eq!(names, ["@c", "@x/f/a"]);
    }
    all_balanced(&SHARED, 20_000, kernels::balance::SHARED);
}

#[test]
fn a_support_that_moves_with_a_branch() {
    all_balanced(&MOVING, 20_000, kernels::balance::MOVING);
}

#[test]
fn values_that_depend_on_another_choice() {
    all_balanced(&FINITE_SUPPORT, 20_000, kernels::balance::FINITE_SUPPORT);
}

#[test]
fn maps_that_are_their_own_inverse() {
    all_balanced(&MAPS, 20_000, kernels::balance::MAPS);
}

#[test]
fn labels_that_are_summed_out() {
    all_balanced(&MIXTURE, 20_000, kernels::balance::MIXTURE);
}

#[test]
fn arrays_that_change_length() {
    all_balanced(&ELEMENTS, 20_000, kernels::balance::ELEMENTS);
}

#[test]
fn shared_choices_that_appear_and_vanish() {
    all_balanced(&SHARED_GROUPS, 20_000, kernels::balance::SHARED_GROUPS);
}

#[test]
fn unbounded_whole_numbers() {
    all_balanced(&COUNTS, 20_000, kernels::balance::COUNTS);
}

#[test]
fn bounds_that_depend_on_another_choice() {
    all_balanced(&SUPPORT, 20_000, kernels::balance::SUPPORT);
}

#[test]
fn gaussian_choices() {
    all_balanced(&GAUSSIAN, 20_000, kernels::balance::GAUSSIAN);
}

/// A few neighbours that are unrelated to the data: the proposal's density is in the
/// acceptance ratio.
#[test]
fn proposals_from_wrong_neighbours() {
    for case in [
        &DISCRETE,
        &STRUCTURE,
        &SAME_NAME,
        &SHARED,
        &MOVING,
        &FINITE_SUPPORT,
        &SUPPORT,
        &GAUSSIAN,
        &ELEMENTS,
        &SHARED_GROUPS,
        &COUNTS,
    ] {
        all_balanced(case, 20_000, kernels::balance::NEIGHBOURS);
    }
    all_balanced(&STRUCTURE, 20_000, kernels::balance::NEIGHBOURS_OF_SOME);
}

/// Geweke's test ("Getting it right", 2004): alternately draws data given the parameters
/// and moves the parameters given the data. Parameters and data then follow the joint
/// prior, whose moments are known. The data are choices that `block` draws from their
/// prior given the rest.
#[test]
fn parameters_and_data_by_turns() {
    for kernel in kernels::BY_TURNS {
        let k = kernel.replace('%', "(@s + @m + @w)");
        let text = format!(
            "assume s ~ gamma(3, 3); assume m ~ normal(0, 1); assume w ~ beta(2, 2);
             for i in 0 .. 3 {{ y[i] ~ normal(m + w, s); }}
             observe normal(0 * sum(map(fn(i) {{ y[i] }}, 0 .. 3)), 1) = 0;
             infer {{ repeat 30000 {{ {k}; block(@y); collect s, m, w, y[0] * y[1], m * m, s * s; }} }}"
        );
        let d = run(&text, 7, 2);
        // gamma(3, rate 3): mean 1, mean square 4/3; beta(2, 2): mean 1/2, mean square
        // 3/10.
        assert_mean(&format!("{kernel} s"), &d["s"], 1.0, 0.15);
        assert_mean(&format!("{kernel} s^2"), &d["s * s"], 4.0 / 3.0, 0.4);
        assert_mean(&format!("{kernel} m"), &d["m"], 0.0, 0.25);
        assert_mean(&format!("{kernel} m^2"), &d["m * m"], 1.0, 0.4);
        assert_mean(&format!("{kernel} w"), &d["w"], 0.5, 0.05);
        assert_mean(&format!("{kernel} y0 y1"), &d["y[0] * y[1]"], 1.3, 0.5);
    }
}

/// Simulation-based calibration (Talts et al. 2018): for parameters drawn from the prior
/// and data drawn given them, the rank of a parameter among posterior draws is uniform.
fn calibrated(runs: usize) {
    use pcadlang_numerics::rng::{Purpose, StreamKey};
    let (bins, thinned) = (8usize, 63usize);
    let mut counts = [vec![0.0; bins], vec![0.0; bins]];
    for r in 0..runs as u64 {
        let mut rng = StreamKey::new(5, 0, Purpose(77)).stream(r, 0, 0);
        let m = 1.0 + 2.0 * rng.standard_normal();
        let p = rng.uniform();
        let y: Vec<f64> = (0..3)
            .map(|_| {
                let far = rng.uniform() < p;
                m + if far { 2.0 } else { 0.0 } + 0.8 * rng.standard_normal()
            })
            .collect();
        let text = format!(
            "assume m ~ normal(1, 2); assume p ~ uniform(0, 1);
             let y = {y:?};
             for i in 0 .. 3 {{ z[i] ~ flip(p); observe normal(if z[i] {{ m + 2 }} else {{ m }}, 0.8) = y[i]; }}
             infer {{ warmup 300 {{ drift(@m); drift(@p); gibbs(one(@z)); }}
               repeat {thinned} {{ repeat 30 {{ drift(@m); drift(@p); gibbs(one(@z)); elliptical(@m); mh(@p); }} collect m, p; }} }}"
        );
        let d = run(&text, r, 1);
        for (count, (name, truth)) in counts.iter_mut().zip([("m", m), ("p", p)]) {
            let rank = d[name].iter().filter(|x| **x < truth).count();
            count[rank * bins / (thinned + 1)] += 1.0;
        }
    }
    for (count, name) in counts.iter().zip(["m", "p"]) {
        let expected = runs as f64 / bins as f64;
        let chi: f64 = count.iter().map(|c| (c - expected) * (c - expected) / expected).sum();
        // 7 degrees of freedom: the statistic is above 35 with probability 1e-5.
        assert!(chi < 35.0, "{name}: ranks {count:?}, chi-square {chi}");
    }
}

#[test]
fn ranks_of_the_truth_are_uniform() {
    calibrated(100);
}

#[test]
#[ignore = "a minute"]
fn ranks_of_the_truth_are_uniform_in_many_runs() {
    calibrated(2000);
}
