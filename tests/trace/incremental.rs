//! Incremental updates and full re-execution give bit-identical chains, for every shipped
//! program and for random ones. Programs that compare a picture use few pixels and few
//! steps, since full re-execution renders everything again.

use crate::common::{programs, tape};
use pcadlang::Program;
use pcadlang_inference::RunOptions;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn chains(
    program: impl Fn() -> Program,
    incremental: bool,
    steps: u64,
    warmup: u64,
) -> Vec<(String, Vec<u64>)> {
    let model = program().compile().unwrap_or_else(|e| panic!("{e}"));
    let options = RunOptions {
        seed: 5,
        steps: Some(steps),
        warmup: Some(warmup),
        incremental,
        ..RunOptions::default()
    };
    let posterior = model.run(&options, 2, 2).unwrap_or_else(|e| panic!("{e}"));
    posterior
        .scalars()
        .into_iter()
        .map(|(n, xs)| (n, xs.into_iter().map(f64::to_bits).collect()))
        .collect()
}

fn same(what: &str, program: impl Fn() -> Program, steps: u64, warmup: u64) {
    let (some, all) =
        (chains(&program, true, steps, warmup), chains(&program, false, steps, warmup));
    assert!(!some.is_empty(), "{what}: nothing is recorded");
    assert!(some == all, "{what}: increments and full re-execution give different chains");
}

#[test]
fn shipped_programs() {
    for (name, steps, warmup) in [
        ("coin.pcad", 500, 200),
        ("linreg.pcad", 300, 200),
        ("mixture.pcad", 600, 300),
        ("crp.pcad", 400, 200),
        ("geometric.pcad", 500, 200),
    ] {
        same(name, || Program::open(name).unwrap_or_else(|e| panic!("{e}")), steps, warmup);
    }
}

/// Checks a shipped program that compares a picture, at `size` pixels if it has that
/// parameter, with the given data.
fn same_of_picture(name: &str, size: Option<u32>, given: &[(&str, &str)], steps: u64, warmup: u64) {
    let open = || {
        let program = Program::open(name).unwrap_or_else(|e| panic!("{e}"));
        let program = size.into_iter().fold(program, |p, s| p.set("size", &s.to_string()));
        given.iter().fold(program, |p, (data, file)| {
            let path = format!("{}/examples/images/{file}", env!("CARGO_MANIFEST_DIR"));
            p.observe_file(data, &path).unwrap_or_else(|e| panic!("{e}"))
        })
    };
    same(name, open, steps, warmup);
}

const CUP: (&str, &str) = ("photo", "coffee_cup.png");
const SKIER: (&str, &str) = ("photo", "skier.jpg");

#[test]
fn shipped_lathes() {
    same_of_picture("lathe.pcad", None, &[CUP], 12, 12);
    same_of_picture("lathe_paper.pcad", None, &[CUP], 12, 12);
}

#[test]
fn shipped_scene() {
    same_of_picture("scene.pcad", Some(48), &[CUP], 60, 60);
}

#[test]
fn shipped_lathe_parts() {
    same_of_picture("lathe_parts.pcad", Some(48), &[CUP], 60, 60);
}

#[test]
fn shipped_table() {
    same_of_picture("table.pcad", Some(48), &[CUP], 40, 40);
}

#[test]
fn shipped_human() {
    same_of_picture("human.pcad", Some(48), &[SKIER], 60, 60);
}

/// With keypoints: joints, and kernels that follow their gradients.
#[test]
fn shipped_human_with_keypoints() {
    same_of_picture("human.pcad", Some(48), &[SKIER, ("points", "skier.keypoints.json")], 60, 60);
}

#[test]
fn shipped_human_of_the_paper() {
    same_of_picture("human_paper.pcad", Some(48), &[SKIER], 40, 40);
}

#[test]
fn shipped_human_with_handles() {
    same_of_picture("human_kth.pcad", Some(48), &[SKIER], 60, 0);
}

#[test]
fn shipped_people() {
    same_of_picture("people.pcad", Some(48), &[SKIER], 40, 40);
}

/// A branch with its own choices, on which one computation stops depending when the
/// parameters of a choice start to depend on it.
#[test]
fn branches_that_change_hands() {
    for kernel in ["gibbs(one($finite))", "mh(one(@**))"] {
        let text = format!(
            "assume f ~ flip(0.4); let x = if f {{ a ~ normal(0.8, 1); a }} else {{ 0.8 }};
             assume h ~ flip(0.3); let y = if h {{ [x, x][1] }} else {{ 0.5 }};
             assume z ~ normal(if 1 > y {{ x }} else {{ 0 }}, 1); observe normal(y + z, 1) = 1;
             infer {{ repeat 2000 {{ {kernel}; collect f, x, h, z; }} }}"
        );
        same(kernel, || Program::parse(&text).unwrap_or_else(|e| panic!("{e}")), 2000, 20);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn random_programs(text in programs::program()) {
        let parse = || Program::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        same(&text, parse, 60, 20);
        let model = parse().compile().unwrap_or_else(|e| panic!("{e}\n{text}"));
        for seed in 0..3 {
            tape::compare_tape(&mut model.simulate(seed, 0).unwrap_or_else(|e| panic!("{e}\n{text}")), &text);
        }
    }
}

/// Transitions that end in place and by proposals, alone and in turn with other kernels
/// and under another power of the likelihood.
#[test]
fn trajectories_that_end_in_place() {
    let model = "let y = [28, 8, -3, 7]; let sigma = [15, 10, 16, 11];
         assume mu ~ normal(0, 5); assume tau ~ half_normal(5); assume e ~ iid(normal(0, 1), 4);
         assume w ~ uniform(0, 2); assume k ~ flip(0.5);
         for i in 0 .. 4 { let m = mu + tau * e[i]; observe normal(if k { m } else { 0.5 * m }, sigma[i] * w) = y[i]; }
         let fit = mu + tau * e; observe normal(fit, sigma) = y;
         observe gp(0, sq_exp(exp(w), tau + 0.1) + white(0.5), [0, 0.4, 1.1, 1.9]) = [0.1, 0.4, -0.2, 0.3];";
    for body in [
        "nuts($continuous);",
        "hmc($continuous, steps = 3);",
        "mala(@mu + @e); mala(@tau);",
        "nuts(@mu + @tau); nuts(@e); mh(@k); repeat 3 { nuts($continuous, max_depth = 3); }",
        "mix { 0.5 => nuts($continuous, max_depth = 4); 0.5 => drift(one($continuous)); }",
    ] {
        let text = format!(
            "{model} infer {{ warmup 60 {{ anneal(20); {body} }} repeat 200 {{ {body} collect mu, tau, e, fit, w; }} }}"
        );
        same(body, || Program::parse(&text).unwrap_or_else(|e| panic!("{e}")), 200, 60);
    }
}

/// A value read several times by the same reader, which stops and resumes depending on
/// it.
#[test]
fn values_read_more_than_once() {
    for kernel in ["gibbs(one($finite))", "mh(one(@**))"] {
        let text = format!(
            "assume x ~ categorical([1, 2, 2]); assume f ~ flip(0.3);
             for i in 0 .. 4 {{
               g[i] ~ flip(0.2); let u = [x, x, x][1]; observe normal(if g[i] {{ if f {{ x }} else {{ 1 }} }} else {{ u + i }}, 1) = 0.3 * i;
             }}
             infer {{ repeat 600 {{ {kernel}; collect g, x, f; }} }}"
        );
        same(kernel, || Program::parse(&text).unwrap_or_else(|e| panic!("{e}")), 600, 20);
    }
}
