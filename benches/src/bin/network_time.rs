//! Measures one run of a network on one core: median, best and worst time of 21 runs on a
//! uniform grey picture.
//!
//!     cargo run --release -p pcadlang-benches --bin network_time -- models/*.tflite

use pcadlang_detectors::nn::Network;
use std::time::Instant;

/// The number of timed runs.
const RUNS: usize = 21;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        return Err("files of networks (.tflite) are wanted".into());
    }
    for file in &files {
        let network = Network::read(&std::fs::read(file)?)?;
        let input = vec![0.5; network.input_shape().iter().product()];
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let input = input.clone();
            let begun = Instant::now();
            network.run(input)?;
            times.push(begun.elapsed().as_secs_f64() * 1e3);
        }
        times.sort_by(f64::total_cmp);
        println!("{file}: {:.1} ms ({:.1} to {:.1})", times[RUNS / 2], times[0], times[RUNS - 1]);
    }
    Ok(())
}
