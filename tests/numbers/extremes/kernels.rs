//! Every kernel on posteriors of scales 1e-150 to 1e150, far from the data, at the ends
//! of supports, and with log weights of 1e300: the state stays finite and in its support,
//! and the running score equals that of a fresh run bit for bit.

use super::points::Points;
use crate::common::{assert_mean, integrate, normal_pdf, run};
use pcadlang::Model;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_inference::draws::Discard;
use pcadlang_inference::{Callback, ChainResult, Progress, RunOptions};
use std::sync::{Arc, Mutex};

const SCALES: [&str; 5] = ["1e-150", "1e-8", "1", "1e8", "1e150"];

/// Models in which the choice is `x` and `S` is the scale.
const POSTERIORS: &[(&str, &str)] = &[
    ("normal", "assume x ~ normal(0, S); observe normal(x, S) = S;"),
    ("40 sd away", "assume x ~ normal(0, S); observe normal(x, S) = 40 * S;"),
    (
        "log weights of 1e300",
        "assume x ~ normal(0, S); factor(-1e300 * (x / S) * (x / S)); observe normal(x, S) = S;",
    ),
    ("truncated", "assume x ~ truncated_normal(0, S, 0, 3 * S); observe normal(x, S) = S;"),
    ("truncated far out", "assume x ~ truncated_normal(0, S, 38 * S); observe normal(x, S) = S;"),
    ("bounded", "assume x ~ uniform(0, S); observe normal(x, S) = S;"),
    ("positive", "assume x ~ lognormal(log(S), 1); observe normal(x, S) = S;"),
    ("heavy tails", "assume x ~ cauchy(0, S); observe cauchy(x, S) = S;"),
    ("bound by the data", "assume x ~ uniform(0, S); observe uniform(0, x) = S / 4;"),
];

/// Kernels that apply to all of them.
const KERNELS: &[&str] = &[
    "mh(@x)",
    "block(@x)",
    "drift(@x)",
    "hmc(@x, steps = 4)",
    "mala(@x)",
    "nuts(@x)",
    "slice(@x)",
    "slice(@x, doubling = true)",
    "temper(drift(@x), levels = 3)",
    "smc(drift(@x, scale = 1), particles = 8)",
    "delayed(drift(@x), @y)",
    "wide()",
    "scaled()",
];

/// Kernels that need a normal prior.
const GAUSSIAN: &[&str] = &["elliptical(@x)"];

fn program(posterior: &str, kernel: &str, scale: &str, counts: [u32; 2]) -> String {
    let [warmup, repeat] = counts;
    format!(
        "{posterior}
         data zero = 0; data rough = 0; observe normal(x / S, 1000) = zero with coarse = normal(x / S, 900) as y;
         kernel wide() {{ propose @x ~ normal(0, S); }}
         kernel scaled() {{ propose u ~ lognormal(0, 0.5); propose @x = value(@x) * u; propose u = 1 / u; }}
         infer {{ warmup {warmup} {{ {kernel}; }} repeat {repeat} {{ {kernel}; collect x; }} }}"
    )
    .replace(" data rough = 0;", "")
    .replace('S', scale)
}

/// The faults of a chain's states.
#[derive(Debug, Default)]
struct Faults(Mutex<Vec<String>>);

impl Callback for Faults {
    fn draw(&self, _: u32, trace: &mut Trace, _: Draws) {
        let mut faults = self.0.lock().unwrap();
        if !trace.log_joint().is_finite() {
            faults.push(format!("a score of {}", trace.log_joint()));
        }
        for t in trace.all_targets() {
            let (x, d) = (trace.stored(*t).unwrap(), trace.dist(*t).unwrap());
            if !d.stored_support().contains(&x) {
                faults.push(format!("{x:?} of {d:?}"));
            }
        }
    }
}

/// Returns the result of a chain, or the first fault of any of its states.
fn watched(text: &str, seed: u64) -> Result<ChainResult, String> {
    let model = Model::from_text(text).map_err(|e| e.to_string())?;
    let faults = Arc::new(Faults::default());
    let options = RunOptions { seed, callback: Some(faults.clone()), ..RunOptions::default() };
    let chains = model.run_into(&options, 1, &Progress::default(), vec![Box::new(Discard)]);
    let chain = chains
        .map_err(|e| e.to_string())?
        .remove(0)
        .map_err(|e| model.chain_error(e).to_string())?;
    match faults.0.lock().unwrap().first() {
        Some(fault) => Err(fault.clone()),
        None => Ok(chain),
    }
}

/// Compares the scores of a state with those of a fresh run with its choices.
fn rescored(trace: &Trace) -> Result<(), String> {
    let fresh = trace.rerun().map_err(|e| e.to_string())?;
    let scores = |t: &Trace| [t.log_joint(), t.log_prior(), t.log_likelihood()].map(f64::to_bits);
    if scores(trace) == scores(&fresh) {
        return Ok(());
    }
    Err(format!("scored {:e}, anew {:e}", trace.log_joint(), fresh.log_joint()))
}

#[test]
fn states_stay_valid_at_every_scale() {
    let mut points = Points::of("kernels");
    for (name, posterior) in POSTERIORS {
        let gaussian = if posterior.contains("x ~ normal") { GAUSSIAN } else { &[] };
        for kernel in KERNELS.iter().chain(gaussian) {
            for (seed, scale) in SCALES.iter().enumerate() {
                // Particles run through a whole ladder at each step, so there are fewer
                // steps.
                let counts = if kernel.starts_with("smc") { [3, 6] } else { [100, 200] };
                let text = program(posterior, kernel, scale, counts);
                let end = watched(&text, seed as u64).and_then(|chain| rescored(&chain.last));
                points.check(end.is_ok(), || {
                    format!("{name}, {kernel}, {scale}: {}", end.unwrap_err())
                });
            }
        }
    }
    points.finish();
}

#[test]
fn means_are_right_at_every_scale() {
    let mut points = Points::of("posterior means");
    // In units of the scale: z ~ normal(0, 1) or lognormal(0, 1), observed as 1.
    let seen = |z: f64| normal_pdf(1.0, z, 1.0) * normal_pdf(z, 0.0, 1000.0);
    let normal = |z: f64| seen(z) * normal_pdf(z, 0.0, 1.0);
    let positive = |z: f64| seen(z) * normal_pdf(z.ln(), 0.0, 1.0) / z;
    let mean = |f: &dyn Fn(f64) -> f64, from| {
        integrate(|z| z * f(z), from, 20.0, 40_000) / integrate(f, from, 20.0, 40_000)
    };
    let cases: [(usize, f64, &[&str]); 2] = [
        (0, mean(&normal, -20.0), &["mh(@x)", "block(@x)", "elliptical(@x)", "wide()"]),
        (
            6,
            mean(&positive, 1e-9),
            &[
                "mh(@x)",
                "drift(@x)",
                "hmc(@x, steps = 4)",
                "mala(@x)",
                "nuts(@x)",
                "slice(@x)",
                "scaled()",
            ],
        ),
    ];
    for (posterior, expected, kernels) in cases {
        for kernel in kernels {
            for scale in SCALES {
                let text = program(POSTERIORS[posterior].1, kernel, scale, [500, 12_000]);
                let draws = run(&text, 5, 1);
                let unit: f64 = scale.parse().unwrap();
                let zs: Vec<f64> = draws["x"].iter().map(|x| x / unit).collect();
                assert_mean(&format!("{kernel} at {scale}"), &zs, expected, 0.5);
                points.check(true, String::new);
            }
        }
    }
    points.finish();
}

#[test]
fn scales_are_learnt_from_far_away() {
    let mut points = Points::of("learnt scales");
    // Chains start within 2 of 0 with steps of about 1; the posterior is normal(1, 1) in
    // units of the scale.
    for kernel in ["drift(@x)", "slice(@x)", "nuts(@x)", "hmc(@x, steps = 4)", "mala(@x)"] {
        for scale in ["1e-30", "1e-12", "1", "1e6"] {
            let text = format!(
                "assume x ~ flat(); observe normal(x, {scale}) = {scale};
                 infer {{ warmup 6000 {{ {kernel}; }} repeat 12000 {{ {kernel}; collect x; }} }}"
            );
            let draws = run(&text, 7, 1);
            let unit: f64 = scale.parse().unwrap();
            let zs: Vec<f64> = draws["x"].iter().map(|x| x / unit).collect();
            assert_mean(&format!("{kernel} at {scale}"), &zs, 1.0, 0.6);
            points.check(true, String::new);
        }
    }
    points.finish();
}

#[test]
fn finite_choices_weigh_1e300() {
    let mut points = Points::of("finite choices");
    // Log weights, and the values that remain possible, with equal probabilities.
    let cases: [(&str, &[f64]); 5] = [
        ("[-1e300, 0, -1e300]", &[1.0]),
        ("[1e300, 1e300, -1e300]", &[0.0, 1.0]),
        ("[-1e300, -1e300, -1e300]", &[0.0, 1.0, 2.0]),
        ("[-1e300, -1e308, -1e308]", &[0.0]),
        ("[1e-300, 0, -1e300]", &[0.0, 1.0]),
    ];
    for (weights, possible) in cases {
        for kernel in
            ["gibbs(@k)", "mh(@k)", "drift(@k)", "block(@k)", "smc(mh(@k), particles = 8)"]
        {
            let text = format!(
                "assume k ~ categorical([1e300, 1e300, 1e300]); factor({weights}[k]);
                 infer {{ warmup 50 {{ {kernel}; }} repeat 4000 {{ {kernel}; collect k; }} }}"
            );
            let draws = &run(&text, 9, 1)["k"];
            let share =
                |k: f64| draws.iter().filter(|d| **d == k).count() as f64 / draws.len() as f64;
            let right = (0..3).map(f64::from).all(|k| {
                let expected =
                    if possible.contains(&k) { 1.0 / possible.len() as f64 } else { 0.0 };
                (share(k) - expected).abs() < 0.06 && (expected > 0.0 || share(k) == 0.0)
            });
            points.check(right, || {
                format!("{kernel} under {weights}: {:?}", [share(0.0), share(1.0), share(2.0)])
            });
        }
    }
    points.finish();
}

/// Choices that appear and vanish, and terms of many sizes.
const LONG: &str = "assume n ~ poisson(2);
    assume a ~ normal(0, 1e3);
    assume b = if n > 1 { c ~ normal(a, 1e-3); d ~ cauchy(c, 10); c + d } else { e ~ gamma(0.1, 1e-3); e };
    assume far ~ cauchy(0, 1e100);
    factor(-1e-12 * a); factor(-1e-110 * far); factor(1e15 + n); factor(-1e300); factor(1e300);
    observe normal(a + b, 10) = 3; observe cauchy(far, 1e-3) = 1e90;
    infer { repeat COUNT { mix { 0.5 => drift(one($continuous)); 0.5 => mh(one(@**)); } } }";

fn score_is_kept(points: &mut Points, steps: u64, seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let end = watched(&LONG.replace("COUNT", &steps.to_string()), seed).and_then(|chain| {
            let accepted: u64 = chain.kernels.iter().map(|k| k.accepted).sum();
            assert!(
                chain.steps == steps && accepted > steps / 50,
                "{} steps, {accepted} accepted",
                chain.steps
            );
            rescored(&chain.last)
        });
        points.check(end.is_ok(), || format!("seed {seed}, {steps} steps: {}", end.unwrap_err()));
    }
}

#[test]
fn the_running_score_is_that_of_a_fresh_run() {
    let mut points = Points::of("running scores");
    for steps in [1, 100, 10_000, 100_000] {
        score_is_kept(&mut points, steps, 0..5);
    }
    points.finish();
}

#[test]
#[ignore = "a minute"]
fn the_running_score_is_that_of_a_fresh_run_after_ten_million_steps() {
    let mut points = Points::of("running scores after 1e7 steps");
    score_is_kept(&mut points, 10_000_000, 0..1);
    points.finish();
}
