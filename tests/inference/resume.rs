//! Chains that are interrupted and resumed from a checkpoint are bit-identical to
//! uninterrupted ones: for every kernel and statement, every shipped program, random
//! programs.

use crate::common::{breaks, programs};
use breaks::same_after_breaks;
use pcadlang::{Model, Program};
use pcadlang_inference::RunOptions;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn options(steps: u64, warmup: u64) -> RunOptions {
    RunOptions {
        seed: 3,
        steps: Some(steps),
        warmup: Some(warmup),
        sites: true,
        ..RunOptions::default()
    }
}

fn of_text(text: &str) -> Model {
    Model::from_text(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Numbers, Booleans and a branch with its own choice; some observations have surrogates.
const MODEL: &str = "
    assume a ~ normal(0, 1); assume b ~ beta(2, 3); assume c ~ flip(0.4); assume k ~ categorical([1, 2, 3]);
    assume x = if c { inner ~ normal(1, 1); inner + a } else { a * 2 };
    assume z ~ iid(normal(0, 1), 3);
    fn label(i) { l ~ flip(b); l }
    let labels = mem(label);
    observe normal(x + k + z[0] * z[1], 0.7) = 1.2 with coarse = normal(x + k, 1) as y;
    for i in 0 .. 3 { observe normal(if labels(i) { z[i] } else { 0.3 }, 1) = 0.4 * i as w; }
    kernel shift(s) { propose @a ~ normal(a, s); }
    kernel both(n) { drift(@a, 0.3); mh(one(@**)); slice(@b); }
";

#[test]
fn every_kernel() {
    for kernel in [
        "mh(one(@**));",
        "mh(each(@**));",
        "block(@**);",
        "gibbs(each($finite)); drift(each($continuous));",
        "drift($continuous); drift(one(@**));",
        "drift(@a + @b + @z); gibbs(one($finite));",
        "slice(one($continuous)); mh(one(@**));",
        "elliptical($gaussian); gibbs(one($finite));",
        "hmc($continuous, steps = 4); mh(one(@**));",
        "hmc(@a + @b + @z, steps = 3);",
        "mala(@a + @z); nuts(@a + @z); gibbs(one($finite));",
        "nuts($continuous, max_depth = 4); gibbs(each($finite));",
        "nuts(@a, marginal = @k); mh(one(@**));",
        "temper(drift(one(@**)), levels = 3);",
        "temper(nuts(@a + @b + @z, max_depth = 3), levels = 3); mh(one(@**));",
        "smc(drift(one(@**)), particles = 5);",
        "delayed(drift(@a), @y); mh(one(@**));",
        "delayed(nuts(@a + @b), @y); gibbs(one($finite));",
        "shift(0.5); mh(one(@**));",
    ] {
        let text = format!("{MODEL} infer {{ warmup 30 {{ {kernel} }} repeat 30 {{ {kernel} }} }}");
        same_after_breaks(kernel, &of_text(&text), &options(40, 40), 16);
    }
}

#[test]
fn without_likelihoods() {
    let text = |kernel: &str| {
        format!(
            "assume p ~ beta(2, 2); observe iid(flip(p), 6) = [true, true, false, true, true, true] as y;
             infer {{ repeat 30 {{ {kernel} }} }}"
        )
    };
    let kernel = "abc(mh(@p), eps = 0.5);";
    same_after_breaks(kernel, &of_text(&text(kernel)), &options(30, 0), 30);
}

#[test]
fn every_statement() {
    let plans = [
        "warmup 10 { mix { 1 => mh(each(@**)); 2 => drift(each($continuous)); } } repeat 20 { mh(one(@**)); collect a, x; }",
        "repeat 12 { let s = 0.1 + abs(a); drift(@a, s); mh(one(@**)); every 3 { both(2); } collect a, b; }",
        "for s in [0.1, 1] { repeat 5 { drift(@a, s); mh(one(@**)); collect a; } }",
        "for s in [0.1, 1] { for t in [\"u\", \"v\"] { drift(@a, s); mh(each(@**)); collect a; } }",
        "repeat 30 { repeat 3 { mix { 0.5 => both(1); 0.5 => gibbs(each($finite)); } stop when a > 0.5; } collect a, x; }",
        "init(best_of(12, keep = 6)); warmup 200 { anneal(50); mh(one(@**)); } repeat 10 { mh(one(@**)); }",
        // Only a warm-up: it ends with the chain.
        "warmup 10 { mh(one(@**)); }",
    ];
    for plan in plans {
        let model = of_text(&format!("{MODEL} infer {{ {plan} }}"));
        // With the program's own number of steps, and with a given one.
        let free = RunOptions { seed: 4, sites: true, ..RunOptions::default() };
        same_after_breaks(plan, &model, &free, 25);
        same_after_breaks(plan, &model, &options(37, 23), 25);
    }
}

/// A loop whose argument changes has a separate kernel for each value.
#[test]
fn kernels_are_told_apart_by_their_arguments() {
    let model = of_text(
        "assume x ~ normal(0, 1); observe normal(x, 1) = 1; infer { for s in [0.001, 10] { repeat 50 { drift(@x, s); collect x; } } }",
    );
    let done = model.run(&RunOptions::default(), 1, 1).unwrap_or_else(|e| panic!("{e}"));
    let rates: Vec<f64> = done.chains[0].kernels.iter().filter_map(|k| k.acceptance()).collect();
    assert!(matches!(rates[..], [small, large] if small > 0.9 && large < 0.5), "{rates:?}");
}

#[test]
fn shipped_programs() {
    for name in ["coin.pcad", "linreg.pcad", "mixture.pcad", "crp.pcad", "geometric.pcad"] {
        let model =
            Program::open(name).and_then(Program::compile).unwrap_or_else(|e| panic!("{e}"));
        same_after_breaks(name, &model, &options(200, 150), 20);
    }
}

#[test]
fn shipped_programs_of_pictures() {
    for (name, data, file) in [
        ("lathe.pcad", "photo", "coffee_cup.png"),
        ("table.pcad", "photo", "coffee_cup.png"),
        ("human.pcad", "photo", "skier.jpg"),
        ("people.pcad", "photo", "skier.jpg"),
    ] {
        let path = format!("{}/examples/images/{file}", env!("CARGO_MANIFEST_DIR"));
        let program =
            Program::open(name).and_then(|p| p.set("size", "48").observe_file(data, &path));
        let model = program.and_then(Program::compile).unwrap_or_else(|e| panic!("{e}"));
        same_after_breaks(name, &model, &options(60, 60), 8);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, rng_seed: RngSeed::Fixed(2), ..ProptestConfig::default() })]
    #[test]
    fn random_programs(text in programs::program()) {
        same_after_breaks(&text, &of_text(&text), &options(60, 20), 6);
    }
}
