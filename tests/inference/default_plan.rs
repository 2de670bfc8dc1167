//! What runs without an `infer` block, or with a plan as everybody writes it: nothing
//! observed, choices that nothing reads, discrete choices that depend on each other, sweeps
//! whose members appear and vanish.

use crate::common::*;
use pcadlang::{Model, RunOptions};
use pcadlang_inference::stuck_together;

/// Asserts that nearly all draws of a continuous quantity differ from each other.
fn assert_fresh(what: &str, draws: &[f64]) {
    let mut all = draws.to_vec();
    all.sort_by(f64::total_cmp);
    all.dedup();
    assert!(all.len() + 1 >= draws.len(), "{what}: {} of {} draws differ", all.len(), draws.len());
}

#[test]
fn without_data_every_record_is_a_draw_from_the_prior() {
    let text = "assume mu ~ normal(0, 1); assume heads ~ flip(0.3); predict y ~ normal(mu, 1);";
    let plans = [
        "",
        "infer { repeat 1000 { collect mu, heads; } }",
        "infer { repeat 1000 { } }",
        "infer { repeat 1000 { mh(each(@**)); nuts($continuous); collect mu, heads; } }",
    ];
    for plan in plans {
        let d = run(&format!("{text} {plan}"), 1, 4);
        assert_eq!(d["mu"].len(), 4000, "{plan}");
        assert_fresh(plan, &d["mu"]);
        assert_fresh(plan, &d["y"]);
        assert_mean(plan, &d["mu"], 0.0, 0.1);
        assert_mean(plan, &d["heads"], 0.3, 0.04);
        let squares: Vec<f64> = d["y"].iter().map(|y| y * y).collect();
        assert_mean(plan, &squares, 2.0, 0.25);
        // The prediction is made from the mu of the same record.
        let product: Vec<f64> = d["mu"].iter().zip(&d["y"]).map(|(m, y)| m * y).collect();
        assert_mean(plan, &product, 1.0, 0.15);
    }
}

#[test]
fn predictions_are_new_in_records_between_moves() {
    let text = "assume m ~ normal(0, 1); observe normal(m, 1) = 1 as x; predict y ~ normal(m, 1);
         infer { repeat 2000 { every 10 { nuts(@m); } collect m; } }";
    let d = run(text, 2, 1);
    assert_eq!(d["y"].len(), 2000);
    assert_fresh("y", &d["y"]);
}

/// The choices that exist depend on a coin; the others are drawn from the prior.
#[test]
fn choices_that_some_states_do_not_read() {
    let text = "assume a ~ flip(0.5); assume y ~ normal(0, 1); assume z ~ normal(0, 2);
         observe normal(if a { y } else { z }, 0.5) = 1 as w;
         assume y2 ~ normal(y, 1); assume z2 ~ normal(z, 2);
         observe flip(if a { 0.2 } else { 0.9 }) = true as c;";
    let d = run(text, 1, 4);
    let (p, q) =
        (0.2 * normal_pdf(1.0, 0.0, 1.25f64.sqrt()), 0.9 * normal_pdf(1.0, 0.0, 4.25f64.sqrt()));
    let a = p / (p + q);
    assert_mean("a", &d["a"], a, 0.08);
    for (name, mean) in [("y", a * 0.8), ("y2", a * 0.8)] {
        assert_mean(name, &d[name], mean, 0.2);
    }
    for (name, mean) in [("z", (1.0 - a) * 4.0 / 4.25), ("z2", (1.0 - a) * 4.0 / 4.25)] {
        assert_mean(name, &d[name], mean, 0.3);
    }
}

/// The number of heads before the first tail, with rate 1 + g observed: its weights are
/// p^g (1 - p) times a Poisson probability.
#[test]
fn sweeps_follow_choices_that_appear_and_vanish() {
    let weight = |g: i32| {
        let rate = 1.0 + f64::from(g);
        0.6f64.powi(g) * rate.powi(3) * (-rate).exp()
    };
    let (total, sum) =
        (0..80).fold((0.0, 0.0), |(t, s), g| (t + weight(g), s + f64::from(g) * weight(g)));
    for kernel in [
        "mh(each(@**))",
        "gibbs(each($finite))",
        "gibbs(each(@**))",
        "drift(each(@**))",
        "mh(one(@**))",
        "block(each(@**))",
    ] {
        let text = format!(
            "fn geom(p) {{ s ~ flip(p); if s {{ 1 + geom(p) }} else {{ 0 }} }}
             assume g = geom(0.6);
             observe poisson(1 + g) = 3 as y;
             infer {{ repeat 20000 {{ {kernel}; collect g; }} }}"
        );
        assert_mean(kernel, &run(&text, 3, 2)["g"], sum / total, 0.12);
    }
}

/// Every member of a sweep moves, with every kernel.
#[test]
fn sweeps_move_every_member() {
    for kernel in ["mh", "drift", "slice", "elliptical", "block", "hmc", "nuts", "mala"] {
        let text = format!(
            "assume a ~ normal(0, 1); assume b ~ normal(0, 1); assume c ~ normal(0, 1);
             observe normal(a + b + c, 1) = 2 as y;
             infer {{ warmup 500 {{ {kernel}(each(@**)); }} repeat 20000 {{ {kernel}(each(@**)); collect a, b, c; }} }}"
        );
        let d = run(&text, 4, 1);
        for name in ["a", "b", "c"] {
            assert_mean(&format!("{kernel}: {name}"), &d[name], 0.5, 0.15);
        }
    }
}

#[test]
fn three_coupled_coins() {
    let text = "assume a ~ flip(0.5);
         assume b ~ flip(if a { 0.999999 } else { 0.000001 });
         assume c ~ flip(if b { 0.999999 } else { 0.000001 });
         observe flip(if c { 0.6 } else { 0.4 }) = true as o;";
    for plan in [
        "",
        "infer { repeat 2000 { exact($finite); } }",
        "infer { repeat 2000 { exact(@a + @b + @c); } }",
        "infer { repeat 2000 { nuts($continuous, marginal = $finite); } }",
        "infer { repeat 2000 { hmc($continuous, marginal = $finite); } }",
    ] {
        let d = run(&format!("{text} {plan}"), 1, 2);
        for name in ["a", "b", "c"] {
            assert_mean(plan, &d[name], 0.6, 0.07);
        }
    }
}

/// A choice that only some values of another one need is drawn with it, from whichever state.
#[test]
fn exact_draws_of_choices_that_not_all_values_need() {
    let text = "assume a ~ flip(0.3); assume b ~ flip(0.6); assume c ~ flip(0.2);
         observe flip(if (if a { b } else { c }) { 0.9 } else { 0.2 }) = true as y;
         assume u = if a { if b { 3 } else { 2 } } else { if c { 1 } else { 0 } };";
    let like = |v: bool| if v { 0.9 } else { 0.2 };
    let weights = [
        0.7 * 0.8 * like(false),
        0.7 * 0.2 * like(true),
        0.3 * 0.4 * like(false),
        0.3 * 0.6 * like(true),
    ];
    let total: f64 = weights.iter().sum();
    let mean = weights.iter().enumerate().map(|(i, w)| i as f64 * w).sum::<f64>() / total;
    for kernel in ["exact($finite)", "gibbs(each($finite))"] {
        let text = format!("{text} infer {{ repeat 10000 {{ {kernel}; collect u; }} }}");
        assert_mean(kernel, &run(&text, 5, 2)["u"], mean, 0.06);
    }
}

/// A hidden chain of 1,000 states with 8 values: drawn exactly, with its exact evidence.
#[test]
fn a_long_hidden_chain_is_drawn_exactly() {
    let (n, k) = (1000, 8);
    let y: Vec<f64> =
        (0..n).map(|i| ((i / 9) % k) as f64 + 0.3 * ((i * 31) % 7) as f64 - 0.9).collect();
    let text = format!(
        "let y = {y:?};
         let T = map(fn(i) {{ map(fn(j) {{ if i == j {{ 0.86 }} else {{ 0.02 }} }}, 0 .. 8) }}, 0 .. 8);
         for t in 0 .. 1000 {{
           z[t] ~ categorical(if t == 0 {{ [1, 1, 1, 1, 1, 1, 1, 1] }} else {{ T[z[t - 1]] }});
           observe normal(z[t], 1) = y[t] as y;
         }}
         infer {{ repeat 400 {{ exact($finite); collect z[500]; }} }}"
    );
    let like = |t: usize, s: usize| normal_pdf(y[t], s as f64, 1.0);
    let follow = |a: usize, b: usize| if a == b { 0.86 } else { 0.02 };
    let pass = |from: &[f64], t: usize, forward: bool| -> Vec<f64> {
        let next = |b: usize| -> f64 {
            let sum: f64 = (0..k)
                .map(|a| from[a] * follow(a, b) * if forward { 1.0 } else { like(t, a) })
                .sum();
            sum * if forward { like(t, b) } else { 1.0 }
        };
        let all: Vec<f64> = (0..k).map(next).collect();
        let total: f64 = all.iter().sum();
        all.iter().map(|x| x / total).collect()
    };
    let first: Vec<f64> = (0..k).map(|s| like(0, s)).collect();
    let forward = (1..=500).fold(first, |f, t| pass(&f, t, true));
    let backward = (501..n).rev().fold(vec![1.0; k], |b, t| pass(&b, t, false));
    let both: Vec<f64> = forward.iter().zip(&backward).map(|(f, b)| f * b).collect();
    let total: f64 = both.iter().sum();
    let mean = both.iter().enumerate().map(|(s, w)| s as f64 * w).sum::<f64>() / total;
    let d = run(&text, 6, 1);
    let name = d.keys().find(|k| k.contains('z')).cloned().unwrap_or_default();
    assert_mean("z[500]", &d[&name], mean, 0.15);
}

/// No draw from the prior satisfies all conditions: the start is drawn given them.
#[test]
fn a_start_that_no_draw_from_the_prior_hits() {
    let text = "for i in 0 .. 60 { z[i] ~ flip(0.5); }
         for i in 0 .. 59 { observe flip(if z[i] == z[i + 1] { 1 } else { 0 }) = true as y; }
         assume first = z[0]; assume last = z[59];";
    let d = run(text, 7, 2);
    assert_mean("first", &d["first"], 0.5, 0.06);
    assert_eq!(d["first"], d["last"]);
}

/// Priors as vague as those of BUGS: draws from them overflow or lie far from the data.
#[test]
fn vague_priors_start_and_agree_with_quadrature() {
    let text = "let y = [4.1, 5.3, 4.8, 5.9, 5.1, 4.4, 5.6, 5.0, 4.7, 5.2];
         assume mu ~ normal(0, 1000);
         assume tau ~ gamma(0.001, 0.001);
         observe normal(mu, 1 / sqrt(tau)) = y as y;";
    let y = [4.1, 5.3, 4.8, 5.9, 5.1, 4.4, 5.6, 5.0, 4.7, 5.2];
    let squares: f64 = y.iter().map(|y| (y - 5.01f64).powi(2)).sum();
    let d = run(text, 1, 4);
    assert_mean("mu", &d["mu"], 5.01, 0.05);
    // With mu integrated out, tau ~ gamma(0.001 + 9/2, 0.001 + squares/2).
    assert_mean("tau", &d["tau"], 4.501 / (0.001 + squares / 2.0), 0.4);
}

/// The data say what a step function of a choice is, and its derivative is uninformative.
#[test]
fn choices_without_a_derivative_are_moved_by_slice() {
    let text = "assume x ~ normal(0, 2); assume m ~ normal(0, 1);
         observe normal(floor(x), 0.3) = 1 as y; observe normal(m, 1) = 1 as z;";
    let model = Model::from_text(text).unwrap();
    let plan = model.plan().unwrap().1.unwrap();
    assert!(plan.contains("nuts($continuous - @x); slice(each(@x));"), "{plan}");
    let weight = |x: f64| normal_pdf(x, 0.0, 2.0) * normal_pdf(x.floor(), 1.0, 0.3);
    // The step function has its steps at the ends of intervals.
    let sum = |f: &dyn Fn(f64) -> f64| -> f64 {
        (-8..8).map(|i| integrate(f, f64::from(i), f64::from(i + 1) - 1e-12, 200)).sum()
    };
    let mean = sum(&|x| x * weight(x)) / sum(&weight);
    let d = run(text, 2, 4);
    assert_mean("x", &d["x"], mean, 0.1);
    assert_mean("m", &d["m"], 0.5, 0.1);
}

/// Single-site moves cannot leave a mode of choices that depend on each other, and are said to
/// be stuck. One by itself that hardly ever moves is not, nor one that has no other value.
#[test]
fn choices_that_never_move_although_they_could() {
    let text = "assume a ~ flip(0.5); assume b ~ flip(if a { 0.9999999 } else { 0.0000001 });
         assume c ~ flip(if b { 0.9999999 } else { 0.0000001 });
         observe flip(if c { 0.6 } else { 0.4 }) = true as o;
         assume alone ~ flip(0.9999999); observe flip(if alone { 0.6 } else { 0.4 }) = true as p;
         assume sure ~ flip(1); observe flip(if sure and a { 0.5 } else { 0.5 }) = true as q;
         infer { repeat 300 { gibbs(each($finite)); } }";
    let options = RunOptions { seed: 1, sites: true, ..RunOptions::default() };
    let posterior = Model::from_text(text).unwrap().run(&options, 1, 1).unwrap();
    let chain = &posterior.chains[0];
    assert_eq!(stuck_together(&chain.last, &chain.sites), ["@a", "@b", "@c"]);
}
