//! Measures a log density with its gradient, the main cost of a leapfrog step: by a
//! proposal and a reverse pass through the trace, and by a tape.
//!
//!     cargo run --release -p pcadlang-benches --bin leapfrog_cost [-- PART_OF_A_NAME]
//!
//! Prints processor microseconds for each.

mod clock;

use clock::processor_seconds;
use pcadlang::{Model, Program};
use pcadlang_engine::trace::{Change, Draws, Target, Trace};
use std::error::Error;

/// Programs that include their data.
const PROGRAMS: &[(&str, &str)] = &[
    (
        "schools",
        "let y = [28, 8, -3, 7, -1, 1, 18, 12]; let sigma = [15, 10, 16, 11, 9, 11, 10, 18];
         assume mu ~ normal(0, 5); assume tau ~ half_normal(5); assume e ~ iid(normal(0, 1), 8);
         observe normal(mu + tau * e, sigma) = y;",
    ),
    (
        "regression on 400 points",
        "let x = linspace(80, 120, 400); let y = 20 + 0.6 * x + 15 * sin(7 * x);
         assume a ~ flat(); assume b ~ flat(); assume s ~ half_cauchy(0, 2.5);
         observe normal(a + b * x, s) = y;",
    ),
    (
        "two groups, 400 points",
        "let y = 2 * sin(linspace(0, 300, 400));
         assume mu ~ ordered(normal(0, 2), 2); assume s ~ iid(half_normal(2), 2); assume t ~ beta(5, 5);
         observe mixture([t, 1 - t], [normal(mu[0], s[0]), normal(mu[1], s[1])]) = y;",
    ),
    (
        "a loop over 100 points",
        "assume a ~ normal(0, 2); assume b ~ normal(0, 2); assume s ~ lognormal(0, 1);
         for i in 0 .. 100 { observe normal(a + b * i / 100, s) = sin(i); }",
    ),
];

/// Returns the smallest mean time of a call over a few rounds, in microseconds.
fn cost(mut call: impl FnMut(usize) -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        let (begun, mut calls) = (processor_seconds(), 0);
        while processor_seconds() - begun < 0.05 {
            for _ in 0..20 {
                call(calls)?;
                calls += 1;
            }
        }
        least = least.min((processor_seconds() - begun) * 1e6 / calls as f64);
    }
    Ok(least)
}

/// `human.pcad` with the joints of the skier, and with a mask of them by the detector.
fn body(joints: bool) -> Result<Model, Box<dyn Error>> {
    let image = |name: &str| format!("{}/../examples/images/{name}", env!("CARGO_MANIFEST_DIR"));
    let program = Program::open("human.pcad")?.observe_file("photo", &image("skier.jpg"))?;
    Ok(match joints {
        true => program.observe_file("points", &image("skier.keypoints.json"))?.compile()?,
        false => program.compile()?,
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let plain = PROGRAMS.iter().map(|(name, text)| Ok((*name, Model::from_text(text)?)));
    let mut models = plain.collect::<Result<Vec<_>, Box<dyn Error>>>()?;
    models.push(("a body with joints", body(true)?));
    models.push(("… with depths and a mask", body(false)?));
    println!("{:<28} {:>12} {:>12} {:>8}", "", "by trace, us", "by tape, us", "ratio");
    let only = std::env::args().nth(1);
    for (name, model) in models {
        if only.as_ref().is_some_and(|only| !name.contains(only.as_str())) {
            continue;
        }
        let mut trace: Trace = model.simulate(1, 0)?;
        let continuous = |t: &Target| trace.free(*t).is_some_and(|(y, _)| !y.is_empty());
        let targets: Vec<Target> = trace.all_targets().iter().copied().filter(continuous).collect();
        let mut tape = trace.record(&targets).ok_or("no tape")?;
        let mut here = Vec::new();
        if !tape.begin(&trace, &mut here) {
            return Err("the tape does not hold".into());
        }
        let widths: Vec<usize> =
            targets.iter().map(|t| trace.free(*t).map_or(0, |(y, _)| y.len())).collect();
        let near = |i: usize| here.iter().map(move |y| y + 1e-3 * (i % 7) as f64);
        let mut gradient = Vec::new();
        let by_trace = cost(|i| {
            let mut y = near(i);
            let own = |(t, n): (&Target, &usize)| (*t, Change::Free(y.by_ref().take(*n).collect()));
            let changes: Vec<_> = targets.iter().zip(&widths).map(own).collect();
            trace.propose(&changes, Draws::default())?;
            gradient.clear();
            Ok(trace.gradient(&targets, 1.0, &mut gradient)?)
        })?;
        trace.rollback();
        let mut y = Vec::new();
        let by_tape = cost(|i| {
            y.clear();
            y.extend(near(i));
            let there = tape.weigh(&y).is_some() && tape.gradient(&y, 1.0, &mut gradient);
            if there { Ok(()) } else { Err("the tape does not hold".into()) }
        })?;
        println!("{name:<28} {by_trace:>12.2} {by_tape:>12.2} {:>8.1}", by_trace / by_tape);
    }
    Ok(())
}
