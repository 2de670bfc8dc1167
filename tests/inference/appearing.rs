//! Choices that appear, vanish, or are needed in some states only. A wrong idea of what
//! depends on what then gives a wrong posterior without any visible sign. Each case was
//! once wrong.

use crate::common::*;
use pcadlang_inference::RunOptions;

/// An outer condition decides whether the inner one is evaluated, and both change with
/// `x`. The data are uninformative about `x`, so its posterior is its prior. Kernels that
/// stay within the present structure once took moving up past 0.25 for a change of
/// structure, but not moving down.
#[test]
fn conditions_that_turn_together_are_no_change_of_structure() {
    for kernel in
        ["slice(@x)", "slice(@x, doubling = true)", "nuts(@x)", "mala(@x)", "elliptical(@x)"]
    {
        let text = format!(
            "assume d ~ categorical([1, 1, 1]);
             assume x ~ normal(0, 1);
             let high = not (x < 0.25);
             observe normal(if (not high) and (high and d == 0) {{ x }} else {{ 1.9 }}, 1.1) = -1.3 as y;
             infer {{ warmup 100 {{ {kernel}; }} repeat 4000 {{ {kernel}; collect x; }} }}"
        );
        let draws = run(&text, 3, 2);
        assert_mean(kernel, &draws["x"], 0.0, 0.3);
        let above: Vec<f64> = draws["x"].iter().map(|x| f64::from(u8::from(*x >= 0.25))).collect();
        assert_mean(&format!("{kernel}: above"), &above, 0.401_294, 0.2);
    }
}

/// A value that only the iterations of a loop read, under a condition; where the
/// condition is false, the value is undefined.
#[test]
fn what_no_pass_asks_for_is_not_run() {
    let text = "assume k ~ categorical([1, 2, 3, 4]);
         let m = [0.5, 1, 1.5][k];
         for i in 0 .. 2 { if k < 3 { observe normal(m, 1) = 1.2 as y; } else { factor(-1); } }
         infer { repeat 6000 { mh(@k); collect k; } }";
    let draws = run(text, 4, 2);
    let weight = |k: usize| match k {
        3 => 4.0 * (-2.0f64).exp(),
        _ => (k + 1) as f64 * normal_pdf(1.2, [0.5, 1.0, 1.5][k], 1.0).powi(2),
    };
    let total: f64 = (0..4).map(weight).sum();
    for k in 0..4 {
        let share: Vec<f64> =
            draws["k"].iter().map(|x| f64::from(u8::from(*x == k as f64))).collect();
        assert_mean(&format!("{k}"), &share, weight(k) / total, 0.1);
    }
}

/// As many choices appear as vanish, but they are different ones: the first stage of
/// delayed acceptance has to account for both.
#[test]
fn delayed_acceptance_sees_which_choices_appear() {
    let text = "assume c ~ flip(0.5);
         assume a ~ normal(2, 1);
         assume b ~ normal(2, 0.7);
         observe normal(if c { a } else { b }, 0.5) = 2 with coarse = normal(if c { 1 } else { 2 }, 2) as y;
         infer { repeat 20000 { mix { 0.5 => delayed(mh(@c), @y); 0.5 => block(@**); } collect c; } }";
    let draws = run(text, 5, 2);
    let (a, b) = (1.25f64.sqrt().recip(), 0.74f64.sqrt().recip());
    assert_mean("c", &draws["c"], a / (a + b), 0.05);
}

/// A choice that only the observation depends on appears, and nothing vanishes: the first
/// stage cannot account for its density, so no such move may be accepted.
#[test]
fn delayed_acceptance_leaves_what_only_the_observation_asks_for() {
    let text = "assume c ~ flip(0.5);
         assume a ~ normal(2, 0.2);
         observe normal(if c { a } else { 1.5 }, 0.5) = 2 with coarse = normal(if c { 1 } else { 2 }, 2) as y;
         infer { repeat 20000 { mix { 0.5 => delayed(mh(@c), @y); 0.5 => block(@**); } collect c; } }";
    let draws = run(text, 5, 2);
    let (with, without) = (normal_pdf(2.0, 2.0, 0.29f64.sqrt()), normal_pdf(2.0, 1.5, 0.5));
    assert_mean("c", &draws["c"], with / (with + without), 0.05);
}

/// The default plan includes moves between structures, whatever the structure of the draw
/// from which the plan was made.
#[test]
fn the_default_plan_goes_where_other_choices_are() {
    let text = "assume x ~ normal(0, 1);
         let m = if x > 0 { z ~ flip(0.5); if z { 2 } else { 0 } } else { -1 };
         observe normal(m, 1) = 0.5 as y;";
    let options = RunOptions { seed: 6, steps: Some(8000), ..RunOptions::default() };
    let draws = run_with(text, &options, 2, 2);
    let (up, down) =
        (0.5 * (normal_pdf(0.5, 2.0, 1.0) + normal_pdf(0.5, 0.0, 1.0)), normal_pdf(0.5, -1.0, 1.0));
    let mean = (2.0 / std::f64::consts::PI).sqrt() * (up - down) / (up + down);
    assert_mean("x", &draws["x"], mean, 0.2);
}
