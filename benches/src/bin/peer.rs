//! Runs one model of a benchmark that compares probabilistic languages, and writes the
//! time that it took.
//!
//!     cargo run --release -p pcadlang-benches --bin peer -- DATA.json OUT.json MODEL N BUDGET_S SEED
//!
//! The models are the programs in `benches/peers`; DATA holds the data sets by model (and
//! by size, if there are several). A path that ends in `.pcad` is a model, too: its data are
//! all of DATA, and OUT gets all that it collects, by the default plan if it has none. BUDGET_S is a time in seconds, or a number of steps
//! after warm-up, as in `20000steps`, to count instructions by the difference of two. OUT
//! gets the time at which sampling could start, the number of transitions after warm-up,
//! their processor time on one thread, and the draws.

mod clock;

use clock::processor_seconds;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_inference::{Callback, RunOptions};
use serde_json::{Value as Json, json};
use std::error::Error;
use std::sync::Arc;
use std::sync::Mutex;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// The models: name, program, and the names of the collected quantities.
const MODELS: &[(&str, &str, &[&str])] = &[
    ("coin", include_str!("../../peers/coin.pcad"), &["p"]),
    ("linreg", include_str!("../../peers/linreg.pcad"), &["slope", "intercept", "log_noise"]),
    (
        "linreg_summed",
        include_str!("../../peers/linreg_summed.pcad"),
        &["slope", "intercept", "log_noise"],
    ),
    ("hmm", include_str!("../../peers/hmm.pcad"), &["z"]),
    ("gmm", include_str!("../../peers/gmm.pcad"), &["mu0", "mu1", "mu2"]),
    ("schools", include_str!("../../peers/schools.pcad"), &["mu", "tau"]),
    ("gp", include_str!("../../peers/gp.pcad"), &["log_ls", "log_amp", "log_noise"]),
    ("tree", include_str!("../../peers/tree.pcad"), &["leaves"]),
];

/// The draws so far: processor time (NaN if it was not read) and number of steps.
#[derive(Debug, Default)]
struct Clock(Mutex<Vec<(f64, u64)>>);

impl Callback for Clock {
    fn draw(&self, _chain: u32, _trace: &mut Trace, draws: Draws) {
        let Ok(mut seen) = self.0.lock() else { return };
        // Reading the clock takes longer than a small step, so it is not read at every
        // draw.
        seen.push((f64::NAN, draws.step));
        let n = seen.len();
        if n == 1 || n.is_multiple_of(64) {
            seen[n - 1].0 = processor_seconds();
        }
    }
}

fn value(j: &Json) -> Value {
    match j {
        Json::Number(x) => Value::Num(x.as_f64().unwrap_or(f64::NAN)),
        Json::Array(xs) => Value::from_elements(xs.iter().map(value).collect()),
        _ => Value::Unit,
    }
}

fn compile(text: &str, data: &Json) -> Result<Model, Box<dyn Error>> {
    let mut program = Program::parse(text)?;
    for item in program.interface().data {
        let given =
            data.get(&item.name).ok_or_else(|| format!("the data have no `{}`", item.name))?;
        program = program.observe(&item.name, value(given));
    }
    Ok(program.compile()?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [data, out, name, n, budget, seed] = &args[..] else {
        return Err("usage: peer DATA.json OUT.json MODEL N BUDGET_S SEED".into());
    };
    let data: Json = serde_json::from_str(&std::fs::read_to_string(data)?)?;
    let own = name.ends_with(".pcad").then(|| std::fs::read_to_string(name)).transpose()?;
    let (text, names) = match (&own, MODELS.iter().find(|(m, ..)| m == name)) {
        (Some(text), _) => (&text[..], None),
        (None, Some((_, text, names))) => (*text, Some(*names)),
        (None, None) => return Err(format!("no model `{name}`").into()),
    };
    // Both programs of a model have the same data.
    let given = if own.is_some() { &data } else { &data[name.trim_end_matches("_summed")] };
    let model = compile(text, given.get(n).unwrap_or(given))?;
    let (time, steps) = match budget.strip_suffix("steps") {
        Some(steps) => (None, Some(steps.parse()?)),
        None => (Some(Duration::from_secs_f64(budget.parse()?)), None),
    };
    let clock = Arc::new(Clock::default());
    let t_ready = SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs_f64();
    let options = RunOptions {
        seed: seed.parse()?,
        time,
        steps,
        callback: Some(Arc::clone(&clock) as Arc<dyn Callback>),
        ..RunOptions::default()
    };
    let posterior = model.run(&options, 1, 1)?;
    let seen = clock.0.lock().map_err(|_| "the clock was lost")?;
    let timed: Vec<usize> = (0..seen.len()).filter(|i| !seen[*i].0.is_nan()).collect();
    let (Some(first), Some(last)) = (timed.first(), timed.last()) else {
        return Err("no draws".into());
    };
    let mut draws = serde_json::Map::new();
    let collected =
        posterior.scalars().into_iter().filter(|(name, _)| !name.starts_with("log_joint"));
    for (i, (collected, values)) in collected.enumerate() {
        let name = match names {
            Some(names) => names.get(i).map(|name| (*name).to_owned()),
            None => Some(collected),
        };
        if let Some(name) = name {
            draws.insert(name, json!([values[first + 1..=*last]]));
        }
    }
    let result = json!({
        "t_ready": t_ready,
        "transitions": seen[*last].1 - seen[*first].1,
        "sampling_cpu_s": seen[*last].0 - seen[*first].0,
        "unit": "one step of a kernel: one choice updated, or the selected ones together",
        "draws": draws,
    });
    std::fs::write(out, result.to_string())?;
    Ok(())
}
