//! A primitive of the host program with incremental state and a gradient, used by `hmc`:
//! `cargo run --release --example embed_function`.
//!
//! One watt flows through a rod of many cells; a program infers the conductivities of the
//! cells from temperatures. When some cells change, the sweep along the rod resumes at
//! the first of them, from the state kept by the previous evaluation. That is always the
//! state of the current trace, also after a rejected proposal.
//! `tests/library/embedding.rs` checks that incremental and full evaluation are equal,
//! bit for bit.

use pcadlang::host::{Adjoint, Args, Entry, Fault, Host, Previous, Type};
use pcadlang::{Error, Model, Program, RunOptions, Value};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Returns the temperature at the far end, and the state to keep: the temperatures after
/// each cell.
fn rod(
    a: &Args,
    previous: Option<Previous<'_, Vec<f64>>>,
    cells: &AtomicUsize,
) -> Result<(Value, Vec<f64>), Fault> {
    let (conductivity, start) = (a.array(0)?, a.num(1)?);
    if conductivity.iter().any(|k| k.is_nan() || *k <= 0.0) {
        return Err(a.outside(0, "positive"));
    }
    // Cells before the first change keep their temperatures, unless the start temperature
    // has changed too.
    let known = previous.filter(|p| !p.changed(a, 1)).and_then(|p| {
        let changed = p.changed_elements(a, 0)?;
        Some(&p.state()[..changed.first().copied().unwrap_or(conductivity.len())])
    });
    let mut temperatures = known.unwrap_or_default().to_vec();
    let swept = &conductivity[temperatures.len()..];
    cells.fetch_add(swept.len(), Ordering::Relaxed);
    for k in swept {
        let before = temperatures.last().copied().unwrap_or(start);
        temperatures.push(before - 1.0 / k);
    }
    Ok((Value::Num(temperatures.last().copied().unwrap_or(start)), temperatures))
}

/// Returns the adjoints of the arguments: the derivative of the end temperature is 1 with
/// respect to the start, and 1 / k^2 with respect to a conductivity.
fn vjp(a: &Args, _end: &Value, by: &Adjoint) -> Option<Vec<Adjoint>> {
    let conductivity = a.array(0).ok()?;
    let each = conductivity.iter().map(|k| by.number() / (k * k)).collect();
    Some(vec![Adjoint::Array(each), by.clone()])
}

/// Returns the host, and a counter of the cells that its sweeps have visited.
pub fn host() -> (Host, Arc<AtomicUsize>) {
    let cells = Arc::new(AtomicUsize::new(0));
    let counted = Arc::clone(&cells);
    let rod = Entry::incremental("rod", move |a, previous| rod(a, previous, &counted))
        .argument("conductivity", Type::Array, "That of each cell, positive.")
        .unit("W/K")
        .optional("start", Type::Num, 100.0, "The temperature at the near end.")
        .unit("degrees")
        .returns(Type::Num)
        .about("The temperature at the far end of a rod through which a watt flows.")
        .gradient(vjp);
    (Host::new().with(rod), cells)
}

/// Most moves change the few cells at the far end.
pub const PROGRAM: &str = "
    assume near ~ iid(lognormal(0, 0.3), 40);
    assume far ~ iid(lognormal(0, 0.3), 4);
    let end = rod(concat(near, far));
    observe normal(rod(near), 1) = 58 as middle;
    observe normal(end, 0.2) = 53 as measured;
    infer {
        warmup 300 { hmc(@far, steps = 4); drift(one(@far)); every 20 { drift(one(@near)); } }
        repeat 600 { hmc(@far, steps = 4); drift(one(@far)); every 20 { drift(one(@near)); } collect end, near, far; }
    }";

/// Compiles the model.
///
/// # Errors
/// Returns the errors of the program.
pub fn model(host: &Host) -> Result<Model, Error> {
    Program::parse(PROGRAM)?.host(host)?.compile()
}

fn main() -> Result<(), Error> {
    let (host, cells) = host();
    println!("{}", host.doc("rod").unwrap_or_default());
    let model = model(&host)?;
    for incremental in [false, true] {
        cells.store(0, Ordering::Relaxed);
        let options = RunOptions { seed: 1, incremental, ..RunOptions::default() };
        let end = model.run(&options, 1, 1)?.quantity("end").map_or(f64::NAN, |q| q.summary.mean);
        let how = if incremental { "going on" } else { "from scratch" };
        println!(
            "{how}: the far end has {end:.2} degrees; {} cells were gone through",
            cells.load(Ordering::Relaxed)
        );
    }
    Ok(())
}
