//! Trace operations by hand, in a custom Metropolis-Hastings loop:
//! `cargo run --release --example embed_trace`.

use pcadlang::Model;
use pcadlang::rng::{Purpose, StreamKey};
use pcadlang::trace::{Change, Draws};
use std::error::Error;

/// Samples a coin's bias after 14 heads in 20 throws, by a random walk in unconstrained
/// space.
pub fn chain(steps: u64) -> Result<Vec<f64>, Box<dyn Error>> {
    let model = Model::from_text("assume p ~ beta(2, 2); observe binomial(20, p) = 14 as heads;")?;
    let mut trace = model.simulate(1, 0)?;
    let p = trace.find(&"@p".parse()?).ok_or("no choice `p`")?;
    let (key, values) =
        (StreamKey::new(1, 0, Purpose::KERNEL), StreamKey::new(1, 0, Purpose::VALUES));
    let mut draws = Vec::new();
    for step in 0..steps {
        let mut rng = key.stream(step, 0, 0);
        // The coordinate of the choice in unconstrained space and the log Jacobian there,
        // which is part of the log density over that space.
        let (y, jacobian) = trace.free(p).ok_or("`p` has no coordinate")?;
        let moved = vec![y[0] + 0.8 * rng.standard_normal()];
        let weight = trace
            .propose(&[(p, Change::Free(moved))], Draws { key: values, step, substream: 0 })?;
        let ratio = weight.log_weight + weight.log_jacobian - jacobian;
        if rng.open_uniform().ln() < ratio {
            trace.commit()
        } else {
            trace.rollback()
        }
        draws.extend(trace.value(p).numbers());
    }
    Ok(draws)
}

fn main() -> Result<(), Box<dyn Error>> {
    let draws = chain(20_000)?;
    let mean = draws.iter().sum::<f64>() / draws.len() as f64;
    println!("p: mean {mean:.3}; (2 + 14) / (4 + 20) = 0.667");
    Ok(())
}
