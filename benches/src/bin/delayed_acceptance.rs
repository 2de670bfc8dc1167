//! Measures the gain of delayed acceptance: effective draws per second with and without a
//! coarse first stage, for the same posterior.
//!
//!     cargo run --release -p pcadlang-benches --bin delayed_acceptance [-- DRAWS]
//!
//! The pose of a known object of revolution is inferred from its own clean contours,
//! observed by the symmetric chamfer distance at 256 and 512 pixels; the first stage
//! compares at 64 pixels. The mesh is either light (2,000 triangles) or full (100,000).
//! Two chains start from the truth. Random walks move all pose variables at once, with
//! increasing step sizes and therefore decreasing acceptance rates. Prints, for each: the
//! acceptance rate, milliseconds of processor time per step, the effective sample size
//! per second (the geometric mean over the five pose variables), the ratio of the latter,
//! and the ratio of accepted steps per second, which is less noisy. DRAWS is the number
//! of steps of a chain (20,000).

mod clock;

use clock::process_seconds;
use pcadlang::{Model, Program, RunOptions};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Draws;
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_scene::vision::ContourMap;
use std::error::Error;

const PROGRAM: &str = r#"
include "std/scene.pcad" as scene;
data photo: image;
param fine: int = 256;
param sides: int = 32;
param rings: int = 32;
param step = 0.1;
param draws: int = 1000;
assume x ~ normal(0, 1) #pose;
assume y ~ normal(0, 1) #pose;
assume z ~ normal(0, 1) #pose;
assume rx ~ normal(0, 0.4) #pose;
assume rz ~ normal(0, 0.4) #pose;
let ys = linspace(0, 2, rings);
let object = scene.centred(scene.lathe([{ y: ys, r: 0.5 + 0.2 * sin(3 * ys) }], sides = sides));
let placed = scene.affine(translate = [x, y, z], rotate = [rx, 0, rz]) * object;
assume view = scene.render(placed);
observe scene.chamfer(view, sigma = 0.1, symmetric = true, truncate = 20, size = fine) = photo
  with coarse = scene.chamfer(view, sigma = 0.1, symmetric = true, truncate = 20, size = 64) as picture;
force @x = 0.3; force @y = -0.2; force @z = 0.4; force @rx = 0.3; force @rz = -0.2;
infer {
  repeat draws { STEP; collect x, y, z, rx, rz; }
}
"#;

/// The number of chains, each on its own thread.
const CHAINS: usize = 2;

/// The longer side of the observed picture, in pixels.
const SEEN: u32 = 512;

fn program(step: &str, set: &[(&str, String)], map: ContourMap) -> Result<Model, pcadlang::Error> {
    let program = Program::parse(&PROGRAM.replace("STEP", step))?;
    let program = program.observe("photo", Value::object(ImageValue::contours(map, None)));
    set.iter().fold(program, |p, (name, value)| p.set(name, value)).compile()
}

/// Returns the contours of the forced state.
fn contours(set: &[(&str, String)]) -> Result<ContourMap, Box<dyn Error>> {
    let model = program("mh(one(@**))", set, ContourMap::new(SEEN, SEEN))?;
    let mut trace = model
        .run(&RunOptions { steps: Some(0), ..RunOptions::default() }, 1, 1)?
        .chains
        .remove(0)
        .last;
    let draws = Draws { key: StreamKey::new(0, 0, Purpose::PREDICT), step: 0, substream: 0 };
    let view = trace.global("view", draws).ok_or("no view")?.map_err(|e| model.run_error(*e))?;
    let c = view.downcast::<ViewValue>().ok_or("no view")?.0.contours(SEEN);
    Ok(ContourMap::of(&c.slice()))
}

/// Runs the chains. Returns the acceptance rate, seconds per step, and effective draws
/// per second (the geometric mean over the pose variables).
fn measure(
    step: &str,
    set: &[(&str, String)],
    map: &ContourMap,
    draws: u64,
) -> Result<[f64; 3], Box<dyn Error>> {
    let set: Vec<_> = set.iter().cloned().chain([("draws", draws.to_string())]).collect();
    let model = program(step, &set, map.clone())?;
    let begun = process_seconds();
    let posterior = model.run(&RunOptions { seed: 1, ..RunOptions::default() }, CHAINS, CHAINS)?;
    let seconds = process_seconds() - begun;
    let kernels = || posterior.chains.iter().flat_map(|c| c.kernels.first());
    let [accepted, proposals] =
        [kernels().map(|k| k.accepted).sum::<u64>(), kernels().map(|k| k.proposals).sum()];
    let quantities = posterior.quantities();
    let pose: Vec<f64> =
        quantities.iter().filter(|q| q.column.is_some()).map(|q| q.summary.ess_bulk.ln()).collect();
    let effective = (pose.iter().sum::<f64>() / pose.len() as f64).exp();
    Ok([
        accepted as f64 / proposals as f64,
        seconds / (draws as f64 * CHAINS as f64),
        effective / seconds,
    ])
}

fn main() -> Result<(), Box<dyn Error>> {
    let draws: u64 = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(20_000);
    println!(
        "| mesh | coarse / fine | step | accepted, plain | delayed | ms a step, plain | delayed | ESS/s, plain | delayed | ratio | moves/s, ratio |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for (mesh, sides, rings) in [("2,000 triangles", 32, 32), ("100,000", 224, 224)] {
        for fine in [256, 512] {
            let mut set = vec![
                ("sides", format!("{sides}")),
                ("rings", format!("{rings}")),
                ("fine", format!("{fine}")),
            ];
            let map = contours(&set)?;
            for step in [0.015, 0.03, 0.045] {
                set.retain(|s| s.0 != "step");
                set.push(("step", format!("{step}")));
                let plain = measure("drift($pose, step)", &set, &map, draws)?;
                let delayed = measure("delayed(drift($pose, step), @picture)", &set, &map, draws)?;
                println!(
                    "| {mesh} | 64 / {fine} | {step} | {:.1} % | {:.1} % | {:.3} | {:.3} | {:.1} | {:.1} | {:.2} | {:.2} |",
                    100.0 * plain[0],
                    100.0 * delayed[0],
                    1e3 * plain[1],
                    1e3 * delayed[1],
                    plain[2],
                    delayed[2],
                    delayed[2] / plain[2],
                    (delayed[0] / delayed[1]) / (plain[0] / plain[1]),
                );
            }
        }
    }
    Ok(())
}
