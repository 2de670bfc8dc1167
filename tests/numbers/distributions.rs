//! Distributions in programs: matrices, mixtures, sorted values, improper priors,
//! whitened vectors; and the errors that programs can cause.

use crate::common::*;
use pcadlang::Model;
use pcadlang_inference::RunOptions;

fn error(text: &str) -> String {
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    match model.run(&RunOptions::default(), 1, 1) {
        Ok(_) => panic!("{text} should have failed"),
        Err(e) => e.to_string(),
    }
}

/// Compares the mean of `x` under a kernel with quadrature of the posterior density.
fn check(
    name: &str,
    model: &str,
    kernel: &str,
    density: impl Fn(f64) -> f64,
    range: [f64; 2],
    tolerance: f64,
) {
    let kernel = if kernel.ends_with('}') { kernel.to_owned() } else { format!("{kernel};") };
    let text = format!(
        "{model} infer {{ warmup 3000 {{ {kernel} }} repeat 60000 {{ {kernel} collect x; }} }}"
    );
    let [a, b] = range;
    let z = integrate(&density, a, b, 20_000);
    let m = integrate(|x| x * density(x), a, b, 20_000) / z;
    assert_mean(name, &run(&text, 11, 2)["x"], m, tolerance);
}

#[test]
fn scalars_by_moves_in_unconstrained_space() {
    let normal = normal_pdf;
    let truncated = |x: f64| normal(x, 0.0, 1.0) * normal(3.0, x, 2.0);
    let model = "assume x ~ truncated_normal(0, 1, hi = 0.5); observe normal(x, 2) = 3;";
    check("below a bound", model, "drift(@x)", truncated, [-9.0, 0.5], 0.03);
    let model = "assume x ~ truncated_normal(0, 1, -1, 0.5); observe normal(x, 2) = 3;";
    check("between bounds", model, "drift(@x)", truncated, [-1.0, 0.5], 0.02);
    // There is a mode on either side of the cut at pi: a random walk on the circle moves
    // between them.
    let circle = |x: f64| (2.0 * (x - 3.0).cos()).exp() * normal(x.sin(), 0.0, 0.3);
    let model = "assume x ~ von_mises(3, 2); observe normal(sin(x), 0.3) = 0;";
    let pi = std::f64::consts::PI;
    check("an angle", model, "drift(@x)", circle, [-pi, pi], 0.15);
    // Under the improper prior, the posterior is the likelihood alone.
    let model = "assume x ~ flat(); observe normal(x, 0.5) = 20;";
    check("flat", model, "drift(@x)", |x| normal(x, 20.0, 0.5), [15.0, 25.0], 0.03);
    // A proposal from the prior is refused, and the rest of the plan is still right.
    check(
        "flat",
        model,
        "mix { 0.2 => mh(@x); 0.8 => drift(@x); }",
        |x| normal(x, 20.0, 0.5),
        [15.0, 25.0],
        0.03,
    );
    let mixture = |x: f64| (normal(x, -2.0, 0.5) + 3.0 * normal(x, 1.0, 1.0)) * normal(0.0, x, 2.0);
    let model =
        "assume x ~ mixture([1, 3], [normal(-2, 0.5), normal(1, 1)]); observe normal(x, 2) = 0;";
    check(
        "a mixture",
        model,
        "mix { 0.5 => mh(@x); 0.5 => drift(@x); }",
        mixture,
        [-9.0, 9.0],
        0.05,
    );
}

#[test]
fn correlations_are_learnt() {
    // Four observed pairs; the reference is quadrature over the correlation, which is
    // uniform under lkj(2, 1).
    let pairs = [(1.0, 0.8), (-1.2, -1.0), (0.3, 0.6), (0.9, 1.1)];
    let likelihood = |r: f64| {
        let v = 1.0 - r * r;
        pairs
            .iter()
            .map(|(a, b)| (-(a * a - 2.0 * r * a * b + b * b) / (2.0 * v)).exp() / v.sqrt())
            .product::<f64>()
    };
    let z = integrate(likelihood, -0.99999, 0.99999, 20_000);
    let m = integrate(|r| r * likelihood(r), -0.99999, 0.99999, 20_000) / z;
    let model = "assume l ~ lkj(2, 1);
        for i in 0 .. 4 { observe mv_normal([0, 0], chol = l) = [[1, 0.8], [-1.2, -1], [0.3, 0.6], [0.9, 1.1]][i]; }
        assume r = l[1][0];";
    for kernel in ["drift(@l)", "mh(@l)"] {
        let text = format!(
            "{model} infer {{ warmup 2000 {{ {kernel}; }} repeat 40000 {{ {kernel}; collect r; }} }}"
        );
        assert_mean(kernel, &run(&text, 21, 2)["r"], m, 0.03);
    }
}

#[test]
fn whole_matrices_are_observed_and_forced() {
    let log = |text: &str| {
        let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
        model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}")).log_joint()
    };
    let one = "[[1, 0], [0.6, 0.8]]";
    assert!((log(&format!("observe lkj(2, 1) = {one};")) - 0.5f64.ln()).abs() < 1e-12);
    assert!((log(&format!("observe lkj(2, 1) = [{one}, {one}];")) - 0.25f64.ln()).abs() < 1e-12);
    assert_eq!(log("observe lkj(2, 1) = [[1, 0], [0.6, 0.9]];"), f64::NEG_INFINITY);
    assert!((log("observe multinomial(3, [1, 1]) = [1, 2];") - 0.375f64.ln()).abs() < 1e-12);
    // The standard Wishart density with two degrees of freedom at the unit matrix, times
    // 2^2 for the factor.
    let expected = -1.0 - (4.0 * std::f64::consts::PI).ln() + 4f64.ln();
    let got = log("observe wishart(2, [[1, 0], [0, 1]]) = [[1, 0], [0, 1]];");
    assert!((got - expected).abs() < 1e-12, "{got} against {expected}");
    let forced = format!(
        "assume l ~ lkj(2, 1); observe mv_normal([0, 0], chol = l) = [1, 1]; assume r = l[1][0]; force @l = {one};
         infer {{ repeat 1 {{ collect r; }} }}"
    );
    assert_eq!(run(&forced, 1, 1)["r"], vec![0.6]);
}

#[test]
fn white_noise_behind_vectors_moves_with_its_scale() {
    // s ~ exponential(1), v = s z: with z integrated out, y = v + noise has variance s^2
    // + 0.25 in each of two components.
    let likelihood = |s: f64| {
        let sd = (s * s + 0.25).sqrt();
        (-s).exp() * normal_pdf(1.0, 0.0, sd) * normal_pdf(-2.0, 0.0, sd)
    };
    let z = integrate(likelihood, 0.0, 30.0, 20_000);
    let m = integrate(|s| s * likelihood(s), 0.0, 30.0, 20_000) / z;
    let text = "assume s ~ exponential(1);
        assume v ~ mv_normal([0, 0], chol = [[s, 0], [0, s]], whitened = true);
        for i in 0 .. 2 { observe normal(v[i], 0.5) = [1, -2][i]; }
        infer { warmup 3000 { drift(@s); elliptical(@v); } repeat 40000 { drift(@s); elliptical(@v); collect s; } }";
    assert_mean("the scale", &run(text, 31, 2)["s"], m, 0.08);
}

#[test]
fn sorted_values_stay_sorted() {
    // Two sorted normal means, each observed once: by symmetry, the mean is that of the
    // greater of two independent posteriors.
    let text = "assume m ~ ordered(normal(0, 1), 2); assume low = m[0]; assume high = m[1];
        observe normal(low, 1) = 0; observe normal(high, 1) = 0;
        infer { warmup 2000 { drift(@m); } repeat 40000 { drift(@m); collect low, high; } }";
    let d = run(text, 41, 2);
    assert!(d["low"].iter().zip(&d["high"]).all(|(a, b)| a <= b));
    // Each posterior has sd 1 / sqrt(2); the greater of two has mean sd / sqrt(pi).
    assert_mean("high", &d["high"], (0.5 / std::f64::consts::PI).sqrt(), 0.05);
}

#[test]
fn errors_say_what_was_expected() {
    let e = error(
        "assume x ~ flat(); assume y ~ normal(0, 1); observe normal(y, 1) = 0; infer { repeat 1 { collect x; } }",
    );
    assert!(e.contains("`flat` is improper, so it cannot be sampled"), "{e}");
    let e = error("observe mixture([1, 1], [normal(0, 1), 3]) = 0;");
    assert!(e.contains("mixture: `components` must be an array of distributions"), "{e}");
    let e = error("observe ordered(poisson(1), 2) = [0, 1];");
    assert!(
        e.contains("ordered: d must be a distribution of continuous numbers, got poisson"),
        "{e}"
    );
    let e = error("observe truncated_normal(0, 1, [2, 3], 2.5) = [2.2, 3];");
    assert!(e.contains("must be below hi, got 3 and 2.5 (element 1)"), "{e}");
}

/// A flat choice in a branch can neither appear nor vanish in a proposal: the chain stays
/// in its initial branch.
#[test]
fn improper_choices_neither_come_nor_go() {
    let text = "assume b ~ flip(0.5); assume x = if b { f ~ flat(); f } else { 0 }; observe normal(x, 1) = 0;
        infer { repeat 2000 { mh(@b); drift(@**); collect b; } }";
    for seed in 1..5 {
        let d = run(text, seed, 1);
        assert!(d["b"].iter().all(|b| *b == d["b"][0]), "seed {seed}");
    }
}
