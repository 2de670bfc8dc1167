//! Programs that would exceed the available memory, stack or time: an error with its
//! position and a remedy.

use pcadlang::{Model, Program, RunOptions};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Limits, Stop};
use pcadlang_inference::Progress;
use pcadlang_report::Memory;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Returns the error of simulating a program once.
fn error_within(text: &str, limits: Limits) -> String {
    let drawn = Program::parse(text)
        .and_then(|p| p.limits(limits).compile())
        .and_then(|m| m.simulate(1, 0));
    drawn.map(|_| ()).expect_err(text).to_string()
}

fn says(text: &str, part: &str) {
    let e = error_within(text, Limits::default());
    assert!(e.contains(part) && e.contains("<program>:1:"), "{text}\n{part:?} is not in\n{e}");
}

/// A program whose value is built in a number of steps, each from the previous one.
fn grown(step: &str, from: &str, times: &str) -> String {
    format!(
        "let v = fold(fn(a, i) {{ {step} }}, {from}, 0 .. {times}); observe normal(0, 1) = len(v);"
    )
}

#[test]
fn values_that_are_nested_too_deep() {
    for step in ["[a, \"x\"]", "{ a: a }", "[[a]]", "map(fn(i) { a }, [\"x\"])"] {
        says(&grown(step, "[\"x\"]", "100000"), "nested more than 200 deep");
    }
    let observed = |d: &str| format!("let d = {d}; observe d = 3;");
    says(
        &observed("fold(fn(d, i) { iid(d, 1) }, normal(0, 1), 0 .. 20000)"),
        "more than 200 nested distributions",
    );
    let mixture = "fold(fn(d, i) { mixture([1, 1], [d, normal(0, 1)]) }, normal(0, 1), 0 .. 20000)";
    says(&observed(mixture), "more than 200 nested distributions");
    let sum = "let c = fold(fn(c, i) { c + white(1) }, white(1), 0 .. 20000); observe gp(0, c, [0, 1]) = [1, 2];";
    says(sum, "more than 200 parameters");
    let product = "let c = fold(fn(c, i) { c * white(1) }, white(1), 0 .. 20000); observe gp(0, c, [0, 1]) = [1, 2];";
    says(product, "more than 200 parameters");
}

/// Short programs whose values would have more elements than a computer has bytes of
/// memory.
#[test]
fn values_that_are_too_large() {
    says(&grown("[a, a, \"x\"]", "[\"x\"]", "60"), "more than 10000000 elements");
    says(&grown("{ a: a, b: a }", "[\"x\"]", "60"), "more than 10000000 elements");
    says(&grown("concat(a, a)", "[1, 2]", "60"), "concat: an array of 16777216 elements");
    says(&grown("concat(a, a)", "\"ab\"", "60"), "concat: an array of 16777216 elements");
    says(&grown("a + a", "\"ab\"", "60"), "an array of 16777216 elements");
    says(
        "let v = fill(zeros(1e7), 1e7); observe normal(0, 1) = len(v);",
        "more than 10000000 elements",
    );
    says(
        "let v = diag(zeros(1e6)); observe normal(0, 1) = len(v);",
        "diag: an array of 1000000000000 elements",
    );
    says(
        "let v = outer(zeros(1e6), ones(1e6)); observe normal(0, 1) = len(v);",
        "outer: an array of",
    );
    let column = "map(fn(i) { [i] }, 0 .. 5000)";
    let product = format!(
        "let c = {column}; let v = matmul(c, [zeros(5000)]); observe normal(0, 1) = len(v);"
    );
    says(&product, "matmul: an array of 25000000 elements");
    says("let v = 0 .. 1e12; observe normal(0, 1) = len(v);", "an array of 1000000000000 elements");
    says(
        "v ~ iid(normal(0, 1), 1e9); observe normal(0, 1) = v[0];",
        "iid: an array of 1000000000 elements",
    );
    says("observe iid(iid(normal(0, 1), 1e5), 1e5) = 1;", "iid: more than 10000000 parts");
    let mixture = "fold(fn(d, i) { mixture([1, 1], [d, d]) }, normal(0, 1), 0 .. 60)";
    says(&format!("let d = {mixture}; observe d = 3;"), "mixture: more than 10000000 parts");
    says("let c = white(1); observe gp(0, c, 0 .. 100000) = 1;", "at most 4000 points");
}

#[test]
fn solids_that_are_too_large() {
    let scene = "include \"std/scene.pcad\" as scene; ";
    let doubled = "fold(fn(s, i) { scene.group([s, s]) }, scene.sphere(1), 0 .. 60)";
    says(&format!("{scene}let s = {doubled}; observe normal(0, 1) = s.height;"), "at most 100000");
    let limits = Limits { elements: 10_000_000, ..Limits::default() };
    let spheres = "map(fn(i) { scene.sphere(1 + i, sides = 1024) }, 0 .. 100)";
    let e = error_within(
        &format!("{scene}let s = scene.group({spheres}); observe normal(0, 1) = s.height;"),
        limits,
    );
    assert!(e.contains("more than 10000000 elements") && e.contains("--limit elements=N"), "{e}");
    // A solid may be transformed any number of times.
    let moved = "fold(fn(s, i) { scene.affine(translate = [0.001, 0, 0]) * s }, scene.sphere(1), 0 .. 5000)";
    let text = format!(
        "{scene}let s = {moved}; assume x ~ normal(0, 1); observe normal(x, 1) = s.height;"
    );
    assert!(Model::from_text(&text).and_then(|m| m.simulate(1, 0)).is_ok());
}

#[test]
fn limits_can_be_set_and_say_how() {
    let nested = "fn f(n) { 1 + f(n + 1) } observe normal(f(0), 1) = 0;";
    let e = error_within(nested, Limits::default().with("depth", 50).unwrap());
    assert!(e.contains("nested more than 50 deep") && e.contains("--limit depth=N"), "{e}");
    let wide = "let v = map(fn(i) { i + 1 }, 0 .. 10000); observe normal(sum(v), 1) = 0;";
    let e = error_within(wide, Limits::default().with("nodes", 1000).unwrap());
    assert!(e.contains("beyond 1000 nodes") && e.contains("--limit nodes=N"), "{e}");
    let e = error_within(wide, Limits::default().with("operations", 5000).unwrap());
    assert!(e.contains("more than 5000 operations") && e.contains("--limit operations=N"), "{e}");
    let arrays =
        "let v = map(fn(i) { sum(zeros(1000) + i) }, 0 .. 1000); observe normal(sum(v), 1) = 0;";
    let e = error_within(arrays, Limits::default().with("elements", 100_000).unwrap());
    assert!(e.contains("more than 100000 elements") && e.contains("--limit elements=N"), "{e}");
    for text in [wide, arrays] {
        assert!(Model::from_text(text).and_then(|m| m.simulate(1, 0)).is_ok(), "{text}");
    }
    assert!(Limits::default().with("patience", 1).is_err());
    assert!(Limits::default().with("depth", u64::MAX).is_err());
}

/// An evaluation that would take far too long.
const LONG: &str =
    "fn f(a) { sum(map(fn(i) { sum(map(fn(j) { i * j + a }, 0 .. 1000)) }, 0 .. 1000000)) }
    assume x ~ normal(0, 1); observe normal(f(x), 1) = 0; infer { repeat 100 { mh(@x); } }";

#[test]
fn an_evaluation_ends_when_time_is_up() {
    let model = Model::from_text(LONG).unwrap();
    let begun = Instant::now();
    let options = RunOptions { time: Some(Duration::from_millis(200)), ..RunOptions::default() };
    let e = model.run(&options, 1, 1).expect_err("there is no time for it").to_string();
    assert!(e.contains("stopped in the middle of an evaluation"), "{e}");
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
}

#[test]
fn an_evaluation_ends_when_somebody_asks() {
    let model = Model::from_text(LONG).unwrap();
    let progress = Progress::default();
    let cancelled = progress.cancelled.clone();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        cancelled.store(true, Ordering::Relaxed);
    });
    let results = model
        .run_into(&RunOptions::default(), 1, &progress, vec![Box::new(Memory::default())])
        .unwrap();
    assert!(results.iter().all(Result::is_err), "it cannot have come to an end");
}

/// Draws recorded before a step that takes too long are kept.
#[test]
fn draws_from_before_are_kept() {
    let text = "fn f(n) { sum(map(fn(i) { sum(map(fn(j) { i * j }, 0 .. 1000)) }, 0 .. n)) }
        assume k ~ flip(1e-9); assume x ~ normal(0, 1);
        let s = if k { f(1000000) } else { 0 };
        observe normal(x + 0 * s, 1) = 0;
        infer { repeat 1000 { for i in 0 .. 20 { mh(@x); collect x; } gibbs(@k); } }";
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let options = RunOptions { time: Some(Duration::from_millis(300)), ..RunOptions::default() };
    let begun = Instant::now();
    let posterior = model.run(&options, 1, 1).unwrap_or_else(|e| panic!("{e}"));
    assert!(posterior.chains[0].draws >= 20 && posterior.chains[0].last.log_joint().is_finite());
    assert!(begun.elapsed() > Duration::from_secs(2), "nothing was given up");
}

/// When time is up, a search ends with the modes found so far, so that there is time to
/// sample.
#[test]
fn a_search_for_modes_ends_when_time_is_up() {
    let text = "assume x ~ normal(0, 1); let s = sum(map(fn(i) { i * x }, 0 .. 1000));
        observe normal(x + 0 * s, 0.1) = 2;
        infer { warmup 1 { modes(@x, tries = 1000000, keep = 8, steps = 40); } repeat 1 { mh(@x); collect x; } }";
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let options = RunOptions { time: Some(Duration::from_millis(400)), ..RunOptions::default() };
    let posterior = model.run(&options, 1, 1).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        posterior.chains[0].warmup == 1 && posterior.chains[0].seconds < 10.0,
        "the search took all time"
    );
    // It found at least the most probable of the draws that there was time for.
    let Value::Num(x) = posterior.chains[0].last.get("@x").unwrap() else { panic!("not a number") };
    assert!((x - 200.0 / 101.0).abs() < 1.0, "{x}");
}

/// An unlimited duration, as libraries express it, does not overflow.
#[test]
fn a_run_may_have_all_the_time_there_is() {
    let text = "assume x ~ normal(0, 1); observe normal(x, 1) = 0;
        infer { warmup 1 { modes(@x, tries = 8); } repeat 5000 { mh(@x); collect x; } }";
    let model = Model::from_text(text).unwrap_or_else(|e| panic!("{e}"));
    let options =
        RunOptions { time: Some(Duration::MAX), steps: Some(5000), ..RunOptions::default() };
    assert_eq!(model.run(&options, 1, 1).unwrap_or_else(|e| panic!("{e}")).chains[0].steps, 5000);
}

/// An observation that may render a picture counts as many operations, so it is stopped
/// sooner.
#[test]
fn observations_that_may_be_slow_are_stopped_sooner() {
    let stop = Stop::when(Arc::new(AtomicBool::new(true))).after(Duration::ZERO);
    let limits = Limits { stop, ..Limits::default() };
    let text = |d: &str| {
        format!(
            "assume x ~ normal(0, 1); let d = normal(x, 1); for i in 0 .. 40 {{ observe {d} = i; }}"
        )
    };
    let plain =
        Program::parse(&text("normal(x, 1)")).and_then(|p| p.limits(limits.clone()).compile());
    plain.and_then(|m| m.simulate(1, 0)).map(drop).unwrap_or_else(|e| panic!("{e}"));
    let e = error_within(&text("d"), limits);
    assert!(e.contains("stopped in the middle of an evaluation"), "{e}");
}

/// A host's own flag also ends a run; the result can be inspected although the flag is
/// still set.
#[test]
fn a_host_may_stop_evaluations_by_a_flag_of_its_own() {
    let text = "fn f(n) { sum(map(fn(i) { sum(map(fn(j) { i * j }, 0 .. 1000)) }, 0 .. n)) }
        assume x ~ normal(0, 1); observe normal(x, 1) = 0; let large = f(20);
        infer { repeat 1000000000 { mh(@x); collect x; } }";
    let flag = Arc::new(AtomicBool::new(false));
    let stop = Stop::when(Arc::clone(&flag)).after(Duration::ZERO);
    let options =
        RunOptions { limits: Limits { stop, ..Limits::default() }, ..RunOptions::default() };
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(200));
        flag.store(true, Ordering::Relaxed);
    });
    let posterior = Model::from_text(text)
        .and_then(|m| m.run(&options, 1, 1))
        .unwrap_or_else(|e| panic!("{e}"));
    assert!(posterior.chains[0].draws > 0);
    let large = posterior.chains[0].last.clone().global("large", Draws::default());
    assert!(matches!(large, Some(Ok(Value::Num(x))) if x > 0.0), "{large:?}");
}

#[test]
fn kernels_that_call_themselves() {
    let text = "kernel k(n) { k(n); } assume x ~ normal(0, 1); observe normal(x, 1) = 0; infer { repeat 10 { k(1); } }";
    let e = Model::from_text(text)
        .and_then(|m| m.run(&RunOptions::default(), 1, 1))
        .unwrap_err()
        .to_string();
    assert!(e.contains("more than 200 deep") && e.contains("<program>:1:"), "{e}");
}

#[test]
fn starts_that_would_never_be_done() {
    let text = |n: &str| {
        format!(
            "assume x ~ normal(0, 1); observe normal(x, 1) = 0; infer {{ init(best_of({n})); repeat 10 {{ mh(@x); }} }}"
        )
    };
    let options = RunOptions { time: Some(Duration::from_millis(300)), ..RunOptions::default() };
    for n in ["1e12", "1e300"] {
        let posterior = Model::from_text(&text(n))
            .and_then(|m| m.run(&options, 1, 1))
            .unwrap_or_else(|e| panic!("{e}"));
        assert!(posterior.chains[0].draws > 0);
    }
}
