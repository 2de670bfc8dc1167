//! Measures one run of a network on one core: median, best and worst time of 21 runs on a
//! uniform grey picture.
//!
//!     cargo run --release -p pcadlang-benches --bin network_time -- models/*.tflite models/*.json
//!
//! The weights of a graph model (.json) are in a file of the same name that ends in .bin.

use pcadlang_detectors::nn::Network;
use std::time::Instant;

/// The number of timed runs.
const RUNS: usize = 21;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        return Err("files of networks (.tflite, or .json with .bin) are wanted".into());
    }
    for file in &files {
        let bytes = std::fs::read(file)?;
        let weights = match file.strip_suffix(".json") {
            Some(name) => Some(std::fs::read(format!("{name}.bin"))?),
            None => None,
        };
        let network = match &weights {
            Some(weights) => Network::read_graph_model(&bytes, weights, None)?,
            None => Network::read(&bytes)?,
        };
        let input = vec![0.5; network.input_shape().iter().product()];
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let input = input.clone();
            let begun = Instant::now();
            network.run(input)?;
            times.push(begun.elapsed().as_secs_f64() * 1e3);
        }
        times.sort_by(f64::total_cmp);
        let (middle, work) = (times[RUNS / 2], network.work() as f64 / 1e6);
        println!(
            "{file}: {middle:.1} ms ({:.1} to {:.1}), {work:.0} M products",
            times[0],
            times[RUNS - 1]
        );
    }
    Ok(())
}
