//! Six posteriors of posteriordb with the default plan: means and mean squares compared
//! with the reference, |z| < 4 at more than 400 effective draws of each parameter.
//! `cargo test --release --test inference posteriordb:: -- --include-ignored --nocapture`
//! prints times.

use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_inference::RunOptions;
use pcadlang_inference::diagnostics::{ess_bulk, ess_mean, mcse_mean, r_hat};
use serde_json::Value as Json;
use std::path::Path;

fn value(j: &Json) -> Value {
    match j {
        Json::Number(x) => Value::Num(x.as_f64().unwrap()),
        Json::Array(xs) => Value::from_elements(xs.iter().map(value).collect()),
        other => panic!("{other}"),
    }
}

fn read(name: &str) -> (Model, Json) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/posteriordb");
    let json = std::fs::read_to_string(folder.join(format!("{name}.json"))).unwrap();
    let json: Json = serde_json::from_str(&json).unwrap();
    let text = std::fs::read_to_string(folder.join(format!("{name}.pcad"))).unwrap();
    let mut program = Program::parse(&text).unwrap_or_else(|e| panic!("{e}"));
    for item in program.interface().data {
        program = program.observe(&item.name, value(&json["data"][&item.name]));
    }
    (program.compile().unwrap_or_else(|e| panic!("{e}")), json)
}

/// Runs the default plan and checks the z-scores of means and mean squares.
fn passes(name: &str) {
    let (model, json) = read(name);
    let (_, plan) = model.plan().unwrap_or_else(|e| panic!("{e}"));
    assert!(
        plan.is_some_and(|p| p.contains("nuts")),
        "{name}: the default plan should follow the gradient"
    );
    let begun = std::time::Instant::now();
    let options = RunOptions { seed: 1, ..RunOptions::default() };
    let posterior = model.run(&options, 4, 2).unwrap_or_else(|e| panic!("{name}: {e}"));
    let quantities = posterior.quantities();
    let (mut worst, mut least) = (0.0f64, f64::INFINITY);
    for (parameter, reference) in json["reference"].as_object().unwrap() {
        // The reference's indices start at 1.
        let ours = match parameter.split_once('[') {
            Some((base, index)) => {
                format!("{base}[{}]", index.trim_end_matches(']').parse::<usize>().unwrap() - 1)
            }
            None => parameter.clone(),
        };
        let q = quantities
            .iter()
            .find(|q| q.name == ours)
            .unwrap_or_else(|| panic!("{name}: no {ours}"));
        let (mean, sd) = (reference["mean"].as_f64().unwrap(), reference["sd"].as_f64().unwrap());
        let noise = reference["mcse_mean"].as_f64().unwrap_or(0.0);
        let squares: Vec<Vec<f64>> =
            q.chains.iter().map(|c| c.iter().map(|x| x * x).collect()).collect();
        // The standard error of the reference's mean square, as if its draws were normal.
        let noise_square = noise * (4.0 * mean * mean + 2.0 * sd * sd).sqrt() / sd;
        for (chains, expected, noise, what) in [
            (&q.chains, mean, noise, "mean"),
            (&squares, mean * mean + sd * sd, noise_square, "mean square"),
        ] {
            let all: Vec<f64> = chains.concat();
            let m = all.iter().sum::<f64>() / all.len() as f64;
            let z = (m - expected) / mcse_mean(chains).hypot(noise);
            assert!(
                z.abs() < 4.0,
                "{name}: the {what} of {parameter} is {m}, expected {expected} (z = {z:.2})"
            );
            assert!(
                ess_mean(chains) > 400.0,
                "{name}: {what} of {parameter}: ess {}",
                ess_mean(chains)
            );
            worst = worst.max(z.abs());
        }
        least = least.min(ess_bulk(&q.chains));
        assert!(r_hat(&q.chains) < 1.01, "{name}: R-hat of {parameter} is {}", r_hat(&q.chains));
    }
    let seconds = begun.elapsed().as_secs_f64();
    println!(
        "{name}: largest |z| {worst:.2}, least bulk ess {least:.0}, {seconds:.1} s, {:.0} ess/s",
        least / seconds
    );
}

#[test]
fn eight_schools() {
    passes("eight_schools");
}

#[test]
#[ignore = "a minute"]
fn regression_with_flat_priors() {
    passes("kidscore_momiq");
}

#[test]
fn gaussian_process() {
    passes("gp_regr");
}

#[test]
#[ignore = "a minute"]
fn mixture() {
    passes("gauss_mix");
}

#[test]
#[ignore = "a minute"]
fn autoregression() {
    passes("arK");
}

#[test]
fn narrow_regression() {
    passes("blr");
}
