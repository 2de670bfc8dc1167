//! A disc of unknown position and size, observed as contours: MCMC compared with
//! integration of the same likelihood over a grid.
//!
//! The camera is so far away that a sphere is nearly a disc. The likelihood at every grid
//! point comes from the trace itself, so the test is of the chain: kernels, increments
//! and their weights, with a renderer inside.

use crate::common::*;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Draws as Streams, Target};
use pcadlang_inference::RunOptions;
use pcadlang_library::scene::ImageValue;
use pcadlang_numerics::dist::Datum;
use pcadlang_scene::vision::ContourMap;

/// The prior box of x, y and r, in scene units; a pixel is 4.4 / 48 = 0.092 units.
const BOX: [(f64, f64); 3] = [(-0.1, 0.5), (-0.5, 0.1), (0.6, 1.2)];
const SIDE: u32 = 48;

/// The contour of a disc with centre (0.2, -0.2) and radius 0.9, in pixels; y points down
/// in a picture.
fn observed() -> ImageValue {
    let unit = f64::from(SIDE) / 4.4;
    let (cx, cy, r) = (24.0 + 0.2 * unit, 24.0 + 0.2 * unit, 0.9 * unit);
    let mut map = ContourMap { width: SIDE, height: SIDE, ..ContourMap::default() };
    for i in 0..120 {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 120.0).sin_cos();
        map.x.push((cx + r * cos) as f32);
        map.y.push((cy + r * sin) as f32);
        map.tx.push(-sin as f32);
        map.ty.push(cos as f32);
        map.strength.push(1.0);
    }
    ImageValue::contours(map, None)
}

/// Random-walk plans: the warm-up, and each step after it.
const WALKS: [&str; 2] = ["1500 { WALK }", "repeat 3 { WALK }"];
const WALK: &str = "mix { 0.5 => drift(one(@**)); 0.4 => drift(@**); 0.1 => mh(one(@**)); }";

/// The same walks, with delayed acceptance by a coarse picture.
const DELAYED: [&str; 2] = ["1500 { WALK }", "repeat 3 { DELAYED }"];
const DELAYED_WALK: &str =
    "mix { 0.5 => delayed(drift(one(@**)), @picture); 0.4 => delayed(drift(@**), @picture);
    0.1 => delayed(mh(one(@**)), @picture); }";

/// HMC alone, by the gradient of the picture's score, so that no other kernel can mask
/// its errors.
const SLOPES: [&str; 2] = ["300 { hmc($continuous, steps = 4); }", "hmc($continuous, steps = 4);"];

/// The surrogate for delayed acceptance: a third of the pixels, another scale.
const COARSE: &str = "scene.chamfer(view, sigma = 1.5, size = 16)";

fn model(likelihood: &str, [warmup, step]: [&str; 2], steps: usize) -> Model {
    let kernels = |s: &str| s.replace("DELAYED", DELAYED_WALK).replace("WALK", WALK);
    let (warmup, step) = (kernels(warmup), kernels(step));
    let priors: String = ["x", "y", "r"]
        .iter()
        .zip(BOX)
        .map(|(name, (a, b))| format!("assume {name} ~ uniform({a}, {b});\n"))
        .collect();
    let text = format!(
        "include \"std/scene.pcad\" as scene;
         data photo: image;
         {priors}
         let far = scene.camera(position = [0, 0, 80], focal = {}, width = {SIDE}, height = {SIDE});
         assume view = scene.render(scene.affine(translate = [x, y, 0]) * scene.sphere(r), camera = far);
         observe {likelihood} = photo with coarse = {COARSE} as picture;
         infer {{
           warmup {warmup}
           repeat {steps} {{
             {step}
             collect x, y, r;
           }}
         }}",
        80.0 / 4.4
    );
    let program = Program::parse(&text).unwrap_or_else(|e| panic!("{e}"));
    program.observe("photo", Value::object(observed())).compile().unwrap_or_else(|e| panic!("{e}"))
}

/// Returns means and variances of x, y and r by the midpoint rule with n points per axis.
fn by_grid(model: &Model, n: usize) -> [(f64, f64); 3] {
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    let targets: Vec<Target> =
        ["@x", "@y", "@r"].map(|name| find(&trace, name)).into_iter().collect();
    let at = |d: usize, i: usize| BOX[d].0 + (BOX[d].1 - BOX[d].0) * (i as f64 + 0.5) / n as f64;
    let mut points = Vec::with_capacity(n * n * n);
    for i in 0..n * n * n {
        let p = [at(0, i / (n * n)), at(1, i / n % n), at(2, i % n)];
        let changes: Vec<_> =
            targets.iter().zip(p).map(|(t, x)| (*t, Change::Set(Datum::Num(x)))).collect();
        trace.propose(&changes, Streams::default()).unwrap();
        trace.commit();
        points.push((p, trace.log_likelihood()));
    }
    let top = points.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p.1));
    let weights: Vec<f64> = points.iter().map(|p| (p.1 - top).exp()).collect();
    let z: f64 = weights.iter().sum();
    std::array::from_fn(|d| {
        let m = points.iter().zip(&weights).map(|((p, _), w)| p[d] * w).sum::<f64>() / z;
        let v =
            points.iter().zip(&weights).map(|((p, _), w)| (p[d] - m) * (p[d] - m) * w).sum::<f64>()
                / z;
        (m, v)
    })
}

fn find(trace: &pcadlang_engine::trace::Trace, name: &str) -> Target {
    let (address, ..) = trace.choices().into_iter().find(|c| c.0.to_string() == name).unwrap();
    trace.find(&address).unwrap()
}

fn agrees(likelihood: &str, plan: [&str; 2], n: usize, steps: usize) {
    let model = model(likelihood, plan, steps);
    // The error of the grid is about its difference from a grid with two thirds of the
    // points.
    let (grid, coarse) = (by_grid(&model, n), by_grid(&model, n * 2 / 3));
    let options = RunOptions { seed: 3, ..RunOptions::default() };
    let posterior = model.run(&options, 2, 2).unwrap_or_else(|e| panic!("{e}"));
    let draws: Draws = posterior.scalars().into_iter().collect();
    for (d, name) in ["x", "y", "r"].into_iter().enumerate() {
        let (m, v) = grid[d];
        let sd = v.sqrt();
        let width = BOX[d].1 - BOX[d].0;
        assert!(
            sd > 0.3 * width / n as f64,
            "{likelihood}: the grid is too coarse for {name}, sd {sd}"
        );
        assert!(sd < 0.27 * width, "{likelihood}: {name} is not informed, sd {sd}");
        let xs = &draws[name];
        let squares: Vec<f64> = xs.iter().map(|x| (x - m) * (x - m)).collect();
        for (what, xs, expected, coarse, scale) in
            [("mean", xs, m, coarse[d].0, sd), ("variance", &squares, v, coarse[d].1, v)]
        {
            let (got, se) = (mean(xs), standard_error(xs));
            let bound = 5.0 * se + 1.5 * (expected - coarse).abs();
            assert!(
                bound < 0.5 * scale,
                "{likelihood}: {what} of {name} is not sharp: {bound} for {scale}"
            );
            assert!(
                (got - expected).abs() < bound,
                "{likelihood}: {what} of {name} {got}, grid {expected}, bound {bound}"
            );
        }
    }
    // The ground truth lies within the posterior's mass.
    for (d, truth) in [0.2, -0.2, 0.9].into_iter().enumerate() {
        let (m, v) = grid[d];
        assert!((m - truth).abs() < 3.0 * v.sqrt() + 0.05, "{likelihood}: {m} for {truth}");
    }
}

#[test]
fn chamfer_agrees_with_a_grid() {
    agrees("scene.chamfer(view, sigma = 1, size = 48)", WALKS, 15, 4000);
}

#[test]
fn contour_ratio_agrees_with_a_grid() {
    agrees(
        "scene.contour(view, size = 48, sd = 1.5, truncate = 8, weight = 0.01)",
        WALKS,
        15,
        4000,
    );
}

#[test]
fn hamiltonian_steps_leave_the_posterior_as_it_is() {
    agrees("scene.chamfer(view, sigma = 1, size = 48)", SLOPES, 15, 4000);
}

#[test]
fn a_coarse_first_stage_leaves_the_posterior_as_it_is() {
    agrees("scene.chamfer(view, sigma = 1, size = 48)", DELAYED, 15, 4000);
    agrees(
        "scene.contour(view, size = 48, sd = 1.5, truncate = 8, weight = 0.01)",
        DELAYED,
        15,
        4000,
    );
}

#[test]
fn a_trace_says_what_is_approximate() {
    let model = model("scene.chamfer(view, sigma = 1, size = 48)", WALKS, 1);
    let trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        trace.approximations(),
        ["scene.chamfer: rendered at 48 pixels in single precision"]
    );
}

#[test]
#[ignore = "minutes"]
fn all_likelihoods_agree_with_a_fine_grid() {
    agrees("scene.chamfer(view, sigma = 0.7, size = 48)", WALKS, 36, 60_000);
    agrees("scene.chamfer(view, sigma = 0.7, symmetric = true, size = 48)", WALKS, 36, 60_000);
    agrees(
        "scene.contour(view, size = 48, sd = 1.5, truncate = 8, weight = 0.02)",
        WALKS,
        36,
        60_000,
    );
    agrees("scene.chamfer(view, sigma = 0.7, size = 48)", DELAYED, 36, 60_000);
}
