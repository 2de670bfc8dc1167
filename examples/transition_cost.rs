//! What one transition of a local choice costs as a program grows: outlier flags of a regression, hidden states of a chain.
//!
//!     cargo run --release --example transition_cost -- [MODEL] [N] [TRANSITIONS]
//!
//! Without arguments, a table over both models and several sizes. Times are processor time of the one thread; for counts of
//! instructions run it twice under `valgrind --tool=none`-like counters with different TRANSITIONS and take the difference.

use pcadlang::infer::{At, Gibbs, Kernel, Pick, Scope};
use pcadlang::lang::value::Value;
use pcadlang::rng::{Purpose, StreamKey};
use pcadlang::trace::{Selector, Trace};
use pcadlang::{Model, Program};

fn main() {
    let _ = (StreamKey::new(0, 0, Purpose::VALUES), Value::Unit);
    let args: Vec<String> = std::env::args().skip(1).collect();
    let n: usize = args.get(1).and_then(|a| a.parse().ok()).unwrap_or(1000);
    let count: usize = args.get(2).and_then(|a| a.parse().ok()).unwrap_or(100_000);
    let clock = cpu();
    let model = match args.first().map(String::as_str) {
        Some("hmm") => hmm(n),
        _ => linreg(n),
    };
    let loaded = cpu();
    let mut trace = model.simulate(1, 0).unwrap_or_else(|e| panic!("{e}"));
    let started = cpu();
    let sel = Selector::Tag {
        name: if args.first().map(String::as_str) == Some("hmm") { "state".into() } else { "flag".into() },
        value: None,
    };
    let mut kernel = Gibbs::new(Scope { selector: sel, pick: Pick::One });
    go(&mut kernel, &mut trace, 1000.min(count), 0);
    let warm = cpu();
    let accepted = go(&mut kernel, &mut trace, count, 1000);
    let done = cpu();
    println!(
        "n {n}: load {:.2} s, start {:.2} s, {:.3} us a transition, {accepted} moved, {} MiB",
        loaded - clock,
        started - loaded,
        (done - warm) / count as f64 * 1e6,
        rss()
    );
}

fn go(kernel: &mut dyn Kernel, trace: &mut Trace, count: usize, first: u64) -> u64 {
    let mut accepted = 0;
    for i in 0..count {
        let at = At::new(1, 0, first + i as u64);
        accepted += u64::from(kernel.step(trace, &at).unwrap_or_else(|e| panic!("{e}")).accepted);
    }
    accepted
}

fn array(n: usize, f: impl Fn(usize) -> f64) -> Value {
    Value::Array((0..n).map(f).collect())
}

fn linreg(n: usize) -> Model {
    let x = array(n, |i| -5.0 + 10.0 * ((i * 7919) % 1000) as f64 / 1000.0);
    let y = array(n, |i| {
        if i % 10 == 3 { ((i * 31) % 41) as f64 - 20.0 } else { 7.0 - 10.0 * ((i * 7919) % 1000) as f64 / 1000.0 }
    });
    compile(include_str!("../benches/peers/linreg.pcad"), vec![("x", x), ("y", y)])
}

fn hmm(n: usize) -> Model {
    let y = array(n, |i| ((i / 7) % 3) as f64 * 2.0 - 2.0 + 0.1 * ((i * 31) % 17) as f64 - 0.8);
    let row = |k: usize| array(3, move |i| if i == k { 0.8 } else { 0.1 });
    let trans = Value::List(vec![row(0), row(1), row(2)].into());
    compile(
        include_str!("../benches/peers/hmm.pcad"),
        vec![
            ("y", y),
            ("trans", trans),
            ("mu", array(3, |i| 2.0 * i as f64 - 2.0)),
            ("probe", Value::Num((n / 2) as f64)),
        ],
    )
}

fn compile(text: &str, data: Vec<(&str, Value)>) -> Model {
    let text = text.split("infer {").next().unwrap_or(text);
    let mut program = Program::parse(text).unwrap_or_else(|e| panic!("{e}"));
    for (name, value) in data {
        program = program.observe(name, value);
    }
    program.compile().unwrap_or_else(|e| panic!("{e}"))
}

/// Processor seconds of this thread.
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    s.split_whitespace().next().and_then(|x| x.parse::<f64>().ok()).unwrap_or(f64::NAN) / 1e9
}

fn rss() -> u64 {
    let s = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = s.lines().find(|l| l.starts_with("VmRSS")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|x| x.parse::<u64>().ok()).unwrap_or(0) / 1024
}
