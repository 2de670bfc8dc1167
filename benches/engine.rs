//! Benchmarks of inference steps: one transition of a regression with 10 and with 10,000
//! points, one update of a choice on which one point among 10 to 100,000 depends, one
//! sweep over such choices, one gradient, and one evaluation of the contour likelihood of
//! `lathe.pcad` at 128 pixels. `cargo bench -p pcadlang-benches --bench engine -- update` runs the benchmarks
//! with that name.

use criterion::{Criterion, criterion_group, criterion_main};
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, ChoiceKind, Draws, Selector, Trace};
use pcadlang_inference::{Drift, Gibbs, Kernel, Mh, Pick, SiteSelection, StepContext};
use pcadlang_numerics::dist::Datum;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use std::hint::black_box;

/// Compiles a line through `n` points, observed as one array or one by one.
fn line(n: usize, one_by_one: bool) -> Model {
    let y: Vec<String> = (0..n)
        .map(|i| format!("{:.3}", 1.5 * i as f64 / n as f64 - 0.5 + 0.1 * ((i * 7 % 11) as f64)))
        .collect();
    let observe = match one_by_one {
        true => format!(
            "for i in 0 .. {n} {{ observe normal(slope * x[i] + intercept, noise) = y[i] as y; }}"
        ),
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
    Draws { key: StreamKey::new(1, 0, Purpose::VALUES), step, substream: 0 }
}

/// Measures the steps of a kernel.
fn steps(c: &mut Criterion, what: &str, trace: &mut Trace, kernel: &mut dyn Kernel) {
    let mut step = 0;
    c.bench_function(what, |b| {
        b.iter(|| {
            step += 1;
            kernel
                .step(trace, &StepContext::new(1, 0, step))
                .map(|o| o.accepted)
                .unwrap_or_default()
        });
    });
}

fn transitions(c: &mut Criterion) {
    for n in [10, 10_000] {
        for (how, one_by_one) in [("array", false), ("loop", true)] {
            let model = line(n, one_by_one);
            let scope = || SiteSelection { selector: Selector::All, pick: Pick::One };
            let kernels: [(&str, Box<dyn Kernel>); 2] = [
                ("mh", Box::new(Mh::new(scope()))),
                ("drift", Box::new(Drift::new(scope(), Some(0.1)))),
            ];
            for (name, mut kernel) in kernels {
                let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
                steps(
                    c,
                    &format!("linreg n={n} {how}: one {name} transition"),
                    &mut trace,
                    &mut *kernel,
                );
            }
        }
    }
}

/// Simulates a model from the comparison with other languages, in which a flag for each
/// point says whether it is an outlier.
fn flags(n: usize) -> Trace {
    let text = include_str!("peers/linreg.pcad");
    let text = text.split("infer {").next().unwrap_or(text);
    let at = |i: usize| ((i * 7919) % 1000) as f64 / 1000.0;
    let array = |f: &dyn Fn(usize) -> f64| Value::Array((0..n).map(f).collect());
    let model = Program::parse(text)
        .map(|p| {
            p.observe("x", array(&|i| -5.0 + 10.0 * at(i)))
                .observe("y", array(&|i| 7.0 - 10.0 * at(i)))
        })
        .and_then(Program::compile)
        .unwrap_or_else(|e| panic!("{e}"));
    model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"))
}

/// Measures updates of a choice on which one of n points depends.
fn update(c: &mut Criterion) {
    let scope =
        || SiteSelection { selector: Selector::Kind(ChoiceKind::Discrete), pick: Pick::One };
    for n in [10, 1_000, 100_000] {
        let mut trace = flags(n);
        steps(c, &format!("update: mh of a flag, n={n}"), &mut trace, &mut Mh::new(scope()));
        steps(c, &format!("update: gibbs of a flag, n={n}"), &mut trace, &mut Gibbs::new(scope()));
    }
}

/// Measures sweeps over n such choices, one after the other.
fn sweep(c: &mut Criterion) {
    let scope = SiteSelection { selector: Selector::Kind(ChoiceKind::Discrete), pick: Pick::Each };
    for n in [10, 1_000] {
        let mut trace = flags(n);
        let mut kernel = Gibbs::new(scope.clone());
        let mut step = 0;
        c.bench_function(&format!("sweep: gibbs of each of {n} flags"), |b| {
            b.iter(|| {
                let mut left = kernel.sweep(&mut trace, None).unwrap_or(1);
                while left > 0 {
                    step += 1;
                    let moved = kernel.step(&mut trace, &StepContext::new(1, 0, step));
                    black_box(moved.map(|o| o.accepted).unwrap_or_default());
                    left = kernel.remaining(&mut trace);
                }
            });
        });
    }
}

/// Converts a number, or nested arrays of numbers.
fn value(j: &serde_json::Value) -> Value {
    match j.as_array() {
        Some(xs) => Value::from_elements(xs.iter().map(value).collect()),
        None => Value::Num(j.as_f64().unwrap_or_default()),
    }
}

/// Measures one gradient of the log joint density with respect to all continuous choices,
/// at a draw from the prior.
fn gradient(c: &mut Criterion) {
    for (name, what) in [
        ("eight_schools", "schools, 10 coordinates"),
        ("gp_regr", "a Gaussian process at 11 points"),
        ("kidscore_momiq", "a regression with 434 points"),
    ] {
        let file = |ending: &str| {
            format!("{}/../tests/posteriordb/{name}.{ending}", env!("CARGO_MANIFEST_DIR"))
        };
        let read = |ending: &str| {
            std::fs::read_to_string(file(ending)).unwrap_or_else(|e| panic!("{name}: {e}"))
        };
        let json: serde_json::Value =
            serde_json::from_str(&read("json")).unwrap_or_else(|e| panic!("{name}: {e}"));
        let program = Program::parse(&read("pcad")).unwrap_or_else(|e| panic!("{e}"));
        let items = program.interface().data;
        let program =
            items.iter().fold(program, |p, d| p.observe(&d.name, value(&json["data"][&*d.name])));
        let model = program.compile().unwrap_or_else(|e| panic!("{e}"));
        let trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
        let (targets, mut out) = (trace.all_targets().to_vec(), Vec::new());
        c.bench_function(&format!("gradient: {what}"), |b| {
            b.iter(|| {
                out.clear();
                let done = trace.gradient(&targets, 1.0, &mut out).is_ok();
                black_box((done, out.last().copied()))
            });
        });
    }
}

/// Measures proposals of slightly varying values, so that everything that depends on the
/// choice is recomputed.
fn wander(c: &mut Criterion, what: &str, trace: &mut Trace, name: &str, around: f64) {
    let Some(target) = name.parse().ok().and_then(|a| trace.find(&a)) else {
        panic!("no choice {name}")
    };
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
    let photograph = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/images/coffee_cup.png");
    // `@S_L/place/t[x]` changes the pose alone, and `@H` the profile as well.
    let text = include_str!("../programs/lathe.pcad");
    let model = Program::parse(text)
        .map(|p| p.set("size", "128"))
        .and_then(|p| p.observe_file("photo", photograph))
        .and_then(Program::compile)
        .unwrap_or_else(|e| panic!("{e}"));
    let mut trace = model.simulate(3, 0).unwrap_or_else(|e| panic!("{e}"));
    wander(c, "lathe at 128: new profile, contours, likelihood", &mut trace, "@H", 1.8);
    wander(c, "lathe at 128: new pose, contours, likelihood", &mut trace, "@S_L/place/t[x]", 0.0);
}

criterion_group!(benches, transitions, update, sweep, gradient, likelihood);
criterion_main!(benches);
