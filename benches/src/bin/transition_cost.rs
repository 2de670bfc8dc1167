//! Measures one transition of a local choice as a program grows: the outlier flags of a
//! regression, or the hidden states of a Markov chain.
//!
//!     cargo run --release -p pcadlang-benches --bin transition_cost -- MODEL N TRANSITIONS [sweep]
//!
//! MODEL is `linreg` or `hmm` (programs of `benches/peers`, without their plans). Choices
//! are updated in random order or, with `sweep`, one after the other. Prints processor
//! times of the single thread, and memory. To count instructions, run it twice under
//! callgrind with different TRANSITIONS and take the difference.

mod clock;

use clock::processor_seconds;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Selector, Trace};
use pcadlang_inference::{Gibbs, Kernel, Pick, SiteSelection, StepContext};
use std::error::Error;

/// The number of transitions before timing starts.
const WARM: u64 = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [model, n, count, order @ ..] = &args[..] else {
        return Err("usage: transition_cost linreg|hmm N TRANSITIONS [sweep]".into());
    };
    let pick = if order.first().is_some_and(|o| o == "sweep") { Pick::Each } else { Pick::One };
    let (n, count): (usize, u64) = (n.parse()?, count.parse()?);
    let begun = processor_seconds();
    let (model, tag) = match model.as_str() {
        "linreg" => (linreg(n)?, "flag"),
        "hmm" => (hmm(n)?, "state"),
        other => return Err(format!("no model `{other}`").into()),
    };
    let loaded = processor_seconds();
    let mut trace = model.simulate(1, 0)?;
    let started = processor_seconds();
    let selector = Selector::Tag { name: tag.into(), value: None };
    let mut kernel = Gibbs::new(SiteSelection { selector, pick });
    let warm = WARM.min(count);
    run(&mut kernel, &mut trace, 0..warm)?;
    let ready = processor_seconds();
    let moved = run(&mut kernel, &mut trace, warm..warm + count)?;
    let each = (processor_seconds() - ready) / count as f64 * 1e6;
    println!(
        "n {n}: load {:.2} s, start {:.2} s, {each:.3} us a transition, {moved} moved, {} MiB",
        loaded - begun,
        started - loaded,
        resident_mib()
    );
    Ok(())
}

/// Runs steps of a kernel. Returns how many of them moved the choice.
fn run(
    kernel: &mut dyn Kernel,
    trace: &mut Trace,
    steps: std::ops::Range<u64>,
) -> Result<u64, Box<dyn Error>> {
    let (mut moved, mut left) = (0, 0);
    for step in steps {
        if left == 0 {
            kernel.sweep(trace, None);
        }
        let at = StepContext::new(1, 0, step);
        let outcome = kernel.step(trace, &at).map_err(|e| e.to_string())?;
        moved += u64::from(outcome.accepted);
        left = kernel.remaining(trace);
    }
    Ok(moved)
}

fn array(n: usize, f: impl Fn(usize) -> f64) -> Value {
    Value::Array((0..n).map(f).collect())
}

fn linreg(n: usize) -> Result<Model, Box<dyn Error>> {
    let at = |i: usize| ((i * 7919) % 1000) as f64 / 1000.0;
    let x = array(n, |i| -5.0 + 10.0 * at(i));
    let y =
        array(n, |i| if i % 10 == 3 { ((i * 31) % 41) as f64 - 20.0 } else { 7.0 - 10.0 * at(i) });
    compile(include_str!("../../peers/linreg.pcad"), vec![("x", x), ("y", y)])
}

fn hmm(n: usize) -> Result<Model, Box<dyn Error>> {
    let y = array(n, |i| ((i / 7) % 3) as f64 * 2.0 - 2.0 + 0.1 * ((i * 31) % 17) as f64 - 0.8);
    let row = |k: usize| array(3, move |i| if i == k { 0.8 } else { 0.1 });
    let trans = Value::List(vec![row(0), row(1), row(2)].into());
    let (mu, probe) = (array(3, |i| 2.0 * i as f64 - 2.0), Value::Num((n / 2) as f64));
    compile(
        include_str!("../../peers/hmm.pcad"),
        vec![("y", y), ("trans", trans), ("mu", mu), ("probe", probe)],
    )
}

/// Compiles the model of a program without its plan.
fn compile(text: &str, data: Vec<(&str, Value)>) -> Result<Model, Box<dyn Error>> {
    let model = text.split("infer {").next().unwrap_or(text);
    let program = data
        .into_iter()
        .fold(Program::parse(model)?, |program, (name, value)| program.observe(name, value));
    Ok(program.compile()?)
}

/// Returns the resident memory in MiB.
fn resident_mib() -> u64 {
    let s = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = s.lines().find(|l| l.starts_with("VmRSS")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|x| x.parse::<u64>().ok()).unwrap_or(0) / 1024
}
