//! A primitive of the host with incremental state and gradient, used by `hmc`:
//! `cargo run --release --example embed_function`.
//!
//! A watt flows through a rod of many cells; a program infers their conductivities from
//! temperatures. When some cells change, the sweep along the rod goes on from the first
//! of them, from what was kept of the state before: that of the state it is in, also
//! after a rejected proposal. `tests/embedding.rs` checks that incremental equals full,
//! bit for bit.

use pcadlang::host::{Adjoint, Args, Entry, Fault, Host, Previous, Type};
use pcadlang::{Error, Model, Program, RunOptions, Value};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The temperature at the far end, and what is kept: that after each cell.
fn rod(
    a: &Args,
    previous: Option<Previous<'_, Vec<f64>>>,
    cells: &AtomicUsize,
) -> Result<(Value, Vec<f64>), Fault> {
    let (conductivity, start) = (a.array(0)?, a.num(1)?);
    if conductivity.iter().any(|k| k.is_nan() || *k <= 0.0) {
        return Err(a.outside(0, "positive"));
    }
    // The cells before the first that changed are as they were, unless what they start
    // from changed too.
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

/// The adjoints of the arguments: the end moves with the start, and by 1 / k^2 with a
/// conductivity.
fn vjp(a: &Args, _end: &Value, by: &Adjoint) -> Option<Vec<Adjoint>> {
    let conductivity = a.array(0).ok()?;
    let each = conductivity.iter().map(|k| by.number() / (k * k)).collect();
    Some(vec![Adjoint::Array(each), by.clone()])
}

/// The host, and how many cells its sweeps have gone through.
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

/// Most moves are of the few cells at the far end.
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

/// The model.
///
/// # Errors
/// What is wrong with it.
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
