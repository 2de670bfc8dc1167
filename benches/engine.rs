//! What a step costs: one transition of a regression with 10 and with 10,000 points, and one evaluation of the contour
//! likelihood of `lathe.pcad` at 128 pixels.

use criterion::{Criterion, criterion_group, criterion_main};
use pcadlang::dist::Datum;
use pcadlang::infer::{At, Drift, Kernel, Mh, Pick, Scope};
use pcadlang::rng::{Purpose, StreamKey};
use pcadlang::trace::{Address, AddressSegment, Change, Draws, Selector, Trace};
use pcadlang::{Model, Program};
use std::hint::black_box;

/// A line through `n` points, observed as one array or one by one.
fn line(n: usize, one_by_one: bool) -> Model {
    let y: Vec<String> =
        (0..n).map(|i| format!("{:.3}", 1.5 * i as f64 / n as f64 - 0.5 + 0.1 * ((i * 7 % 11) as f64))).collect();
    let observe = match one_by_one {
        true => format!("for i in 0 .. {n} {{ observe normal(slope * x[i] + intercept, noise) = y[i] as y; }}"),
        false => "observe normal(slope * x + intercept, noise) = y as y;".to_owned(),
    };
    let text = format!(
        "let x = (0 .. {n}) / {n}; let y = [{}];
         assume slope ~ normal(0, 2); assume intercept ~ normal(0, 2); assume noise ~ half_cauchy(0, 1); {observe}",
        y.join(", ")
    );
    Model::from_text(&text).unwrap_or_else(|e| panic!("{e}"))
}

fn draws(step: u64) -> Draws {
    Draws { key: StreamKey::new(1, 0, Purpose::VALUES), step, lane: 0 }
}

fn target(name: &str) -> Address {
    Address { segments: vec![AddressSegment { name: name.into(), occurrence: 1, keys: Vec::new() }] }
}

fn transitions(c: &mut Criterion) {
    for n in [10, 10_000] {
        for (how, one_by_one) in [("array", false), ("loop", true)] {
            let model = line(n, one_by_one);
            let scope = || Scope { selector: Selector::All, pick: Pick::One };
            let kernels: [(&str, Box<dyn Kernel>); 2] =
                [("mh", Box::new(Mh::new(scope()))), ("drift", Box::new(Drift::new(scope(), Some(0.1))))];
            for (name, mut kernel) in kernels {
                let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
                let mut step = 0;
                c.bench_function(&format!("linreg n={n} {how}: one {name} transition"), |b| {
                    b.iter(|| {
                        step += 1;
                        let at = At::new(1, 0, step);
                        kernel.step(&mut trace, &at).map(|o| o.accepted).unwrap_or_default()
                    });
                });
            }
        }
    }
}

/// Proposes values that wander a little, so that everything that depends on the choice runs again.
fn wander(c: &mut Criterion, what: &str, trace: &mut Trace, name: &str, around: f64) {
    let Some(target) = trace.find(&target(name)) else { panic!("no choice {name}") };
    let mut step = 0u64;
    c.bench_function(what, |b| {
        b.iter(|| {
            step += 1;
            let x = around + 1e-3 * (step % 97) as f64;
            let weight = trace.propose(&[(target, Change::Set(Datum::Num(x)))], draws(step));
            let weight = black_box(weight.map(|w| w.log_weight));
            trace.rollback();
            weight.is_ok()
        });
    });
}

fn likelihood(c: &mut Criterion) {
    let photograph = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/images/coffee_cup.png");
    // A pose that can be set by itself, and a size, which makes a new profile.
    let text = include_str!("../programs/lathe.pcad");
    let model = Program::parse(text)
        .and_then(|p| p.observe_file("photo", photograph))
        .and_then(Program::compile)
        .unwrap_or_else(|e| panic!("{e}"));
    let mut trace = model.simulate(3, 0).unwrap_or_else(|e| panic!("{e}"));
    wander(c, "lathe at 128: new profile, contours, likelihood", &mut trace, "H", 1.8);
    let shift = trace.choices().into_iter().find(|(a, ..)| a.to_string() == "@S_L/place/t[x]").map(|(a, ..)| a);
    let Some(shift) = shift.and_then(|a| trace.find(&a)) else { panic!("no shift") };
    let mut step = 0u64;
    c.bench_function("lathe at 128: new pose, contours, likelihood", |b| {
        b.iter(|| {
            step += 1;
            let x = 1e-3 * (step % 97) as f64;
            let weight = trace.propose(&[(shift, Change::Set(Datum::Num(x)))], draws(step));
            let weight = black_box(weight.map(|w| w.log_weight));
            trace.rollback();
            weight.is_ok()
        });
    });
}

criterion_group!(benches, transitions, likelihood);
criterion_main!(benches);
