//! Reproduces a figure of the paper (Kulkarni et al. 2014, section 4): the log joint
//! density over time of chains with and without discriminative proposals, on one
//! photograph.
//!
//!     cargo run --release -p pcadlang-benches --bin proposals -- human.pcad examples/images/skier.jpg proposals.svg [CHAINS] [SECONDS] [CAMERA.json]
//!     cargo run --release -p pcadlang-benches --bin proposals -- lathe.pcad examples/images/table_lamp.png proposals.svg
//!
//! Both variants use the same program with the same likelihood, one chain per thread.
//! People: with the jumps of `modes` (the time of its search counts) and without them,
//! both started from the prior. Objects: started from the best of 200 lathes that fill
//! regions of the picture (the time to find these counts), and from the best of 200 draws
//! from the prior, without annealing. Writes the figure, and medians and quantiles as CSV
//! beside it, and prints when the median with proposals exceeds the final median without
//! them.

use pcadlang::Program;
use pcadlang_inference::draws::{Column, DrawRow, Sink};
use pcadlang_inference::{Progress, RunOptions};
use pcadlang_library::shipped;
use pcadlang_report::svg::Svg;
use pcadlang_scene::vision::candidates::{CandidateOptions, candidates};
use pcadlang_scene::vision::{Limits, photo};
use std::fmt::Write;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The number of times at which chains are compared, evenly spaced in the logarithm, from
/// 10 ms.
const MOMENTS: usize = 40;
const QUANTILES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// The log joint density of a chain over its elapsed time.
#[derive(Default)]
struct Path {
    begun: Option<Instant>,
    points: Vec<(f64, f64)>,
}

struct Recorder(Arc<Mutex<Path>>);

impl Sink for Recorder {
    fn columns(&mut self, _: &[Column]) -> io::Result<()> {
        Ok(())
    }

    fn resume(&mut self) -> io::Result<Option<pcadlang_inference::Checkpoint>> {
        if let Ok(mut path) = self.0.lock() {
            path.begun = Some(Instant::now());
        }
        Ok(None)
    }

    fn draw(&mut self, row: &DrawRow) -> io::Result<()> {
        if let Ok(mut path) = self.0.lock() {
            let seconds = path.begun.map_or(0.0, |b| b.elapsed().as_secs_f64());
            path.points.push((seconds, row.log_joint));
        }
        Ok(())
    }

    fn chain_done(&mut self, _: u32, _: u64, _: u64, _: f64) -> io::Result<()> {
        Ok(())
    }
}

/// Returns the text of a shipped program with a plan that records every step, with or
/// without its proposals from the picture.
fn program(name: &str, with: bool) -> Result<String, String> {
    let text = shipped::file(name).ok_or_else(|| format!("{name} is not shipped"))?;
    let plan = text.rfind("infer {").ok_or_else(|| format!("{name} has no plan"))?;
    let steps = "repeat 1000000 { moves(); collect log_joint(); }";
    // For people, a short warm-up adapts the step sizes, and the search for modes moves
    // the chain to one of them.
    let begin = match (name, with) {
        ("human.pcad", _) => "warmup 40 { moves(); }".to_owned(),
        ("lathe.pcad", true) => {
            let from = text[plan..].split_once("from = ").and_then(|(_, t)| t.split_once("));"));
            let (from, _) = from.ok_or("lathe.pcad has no starts")?;
            format!("init(best_of(200, from = {from}));")
        }
        ("lathe.pcad", false) => "init(best_of(200));".to_owned(),
        _ => return Err("of human.pcad and lathe.pcad it is known what their proposals are".into()),
    };
    let text = format!("{}infer {{ {begin} {steps} }}\n", &text[..plan]);
    let jumps = "0.10 * (1 - blind) => modes(";
    if name == "human.pcad" && !text.contains(jumps) {
        return Err("human.pcad has no jumps".into());
    }
    Ok(if with { text } else { text.replace(jumps, "0 * (1 - blind) => modes(") })
}

/// A program and its inputs.
struct Job<'a> {
    name: &'a str,
    image: &'a str,
    camera: Option<&'a str>,
    chains: usize,
    seconds: f64,
}

/// Runs all chains and returns their paths. Times include the search for regions.
fn paths(job: &Job, with: bool) -> Result<Vec<Vec<(f64, f64)>>, String> {
    let said = |e: pcadlang::Error| e.to_string();
    let program =
        Program::parse(&program(job.name, with)?).and_then(|p| p.observe_file("photo", job.image));
    let program = program.map_err(said)?;
    let program = match job.camera {
        Some(path) => {
            let text = std::fs::read_to_string(path).map_err(|e| format!("{path}: {e}"))?;
            program.camera(
                pcadlang_scene::render::Camera::from_json(&text).map_err(|e| e.to_string())?,
            )
        }
        None => program,
    };
    let model = program.compile().map_err(said)?;
    // Regions are found once for all chains, but the cost counts for each chain.
    let cost = if with && job.name == "lathe.pcad" { regions(job.image)? } else { 0.0 };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut all = Vec::new();
    // Runs as many chains at once as there are cores, so that each has its own core and
    // all have the same time.
    for first in (0..job.chains).step_by(threads) {
        let shared: Vec<Arc<Mutex<Path>>> =
            (first..job.chains.min(first + threads)).map(|_| Arc::default()).collect();
        let sinks =
            shared.iter().map(|p| Box::new(Recorder(Arc::clone(p))) as Box<dyn Sink>).collect();
        let time = Some(Duration::from_secs_f64(job.seconds));
        let options = RunOptions { seed: first as u64 + 1, time, ..RunOptions::default() };
        for chain in model.run_into(&options, threads, &Progress::default(), sinks).map_err(said)? {
            chain.map_err(|e| format!("{e:?}"))?;
        }
        all.extend(shared.iter().filter_map(|p| Some(std::mem::take(&mut p.lock().ok()?.points))));
    }
    all.iter_mut().flatten().for_each(|(t, _)| *t += cost);
    Ok(all)
}

/// Returns the time to find regions in a picture, in seconds.
fn regions(image: &str) -> Result<f64, String> {
    let bytes = std::fs::read(image).map_err(|e| e.to_string())?;
    let photo = photo::decode(&bytes, &Limits::default()).map_err(|e| e.to_string())?;
    let begun = Instant::now();
    candidates(&photo, &CandidateOptions::default());
    Ok(begun.elapsed().as_secs_f64())
}

/// Returns quantiles over chains at each time; before its first draw, a chain counts as
/// minus infinity.
fn quantiles(paths: &[Vec<(f64, f64)>], moments: &[f64]) -> Vec<[f64; 5]> {
    let at = |t: &f64| {
        let value = |p: &Vec<(f64, f64)>| {
            p[..p.partition_point(|(s, _)| s <= t)].last().map_or(f64::NEG_INFINITY, |x| x.1)
        };
        let mut here: Vec<f64> = paths.iter().map(value).collect();
        here.sort_by(f64::total_cmp);
        QUANTILES.map(|q| here[((here.len() - 1) as f64 * q).round() as usize])
    };
    moments.iter().map(at).collect()
}

/// Draws bands of quantiles, and medians, as SVG.
fn figure(moments: &[f64], both: &[(&str, &str, Vec<[f64; 5]>)]) -> String {
    let (width, height, left, bottom) = (720.0, 420.0, 70.0, 40.0);
    let ends = (moments[0].ln(), moments[moments.len() - 1].ln());
    // The scale covers the later times only, because starts from the prior are far below.
    let late = moments.len() / 3;
    let shown = || {
        both.iter().flat_map(|b| b.2[late..].iter().flatten()).copied().filter(|x| x.is_finite())
    };
    let (low, high) =
        (shown().fold(f64::INFINITY, f64::min), shown().fold(f64::NEG_INFINITY, f64::max));
    let x = |t: f64| left + (t.ln() - ends.0) / (ends.1 - ends.0) * (width - left - 20.0);
    let y = |l: f64| {
        height - bottom - ((l - low) / (high - low)).clamp(0.0, 1.0) * (height - bottom - 20.0)
    };
    let mut s = Svg::file(width, height);
    for t in [0.01f64, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0].into_iter().filter(|t| t.ln() <= ends.1) {
        s.text((x(t), height - 20.0), "middle", "", &format!("{t} s"));
    }
    for i in 0..=4 {
        let l = low + (high - low) * f64::from(i) / 4.0;
        s.text((left - 6.0, y(l) + 4.0), "end", "", &format!("{l:.0}"));
    }
    for (i, (name, colour, q)) in both.iter().enumerate() {
        let there: Vec<usize> = (0..q.len()).filter(|j| q[*j][2].is_finite()).collect();
        let point = |j: usize, k: usize| (x(moments[j]), y(q[j][k]));
        for (lo, hi) in [(0, 4), (1, 3)] {
            let up = there.iter().map(|j| point(*j, lo));
            let down = there.iter().rev().map(|j| point(*j, hi));
            s.area(up.chain(down), &format!("fill=\"{colour}\" opacity=\"0.2\""));
        }
        let line = there.iter().map(|j| point(*j, 2));
        s.line(line, &format!("stroke=\"{colour}\" stroke-width=\"2\""), "");
        let label = format!("{name}: median, middle half, 90 %");
        let at = (left + 10.0, 30.0 + 18.0 * i as f64);
        s.text(at, "start", &format!("fill=\"{colour}\""), &label);
    }
    s.end()
}

fn main() -> Result<(), String> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [name, image, out, rest @ ..] = &args[..] else {
        return Err("usage: PROGRAM IMG OUT.svg [CHAINS] [SECONDS] [CAMERA.json]".into());
    };
    let number = |i: usize, other: f64| {
        rest.get(i).map_or(Ok(other), |x| x.parse::<f64>().map_err(|e| e.to_string()))
    };
    let (chains, seconds) = (number(0, 100.0)? as usize, number(1, 1.5)?);
    if chains == 0 || !(seconds > 0.01 && seconds < 1e6) {
        return Err("at least one chain and more than 0.01 seconds are needed".into());
    }
    let job = Job { name, image, camera: rest.get(2).map(String::as_str), chains, seconds };
    let moments: Vec<f64> = (0..MOMENTS)
        .map(|i| 0.01 * (seconds / 0.01).powf(i as f64 / (MOMENTS - 1) as f64))
        .collect();
    let with = quantiles(&paths(&job, true)?, &moments);
    let without = quantiles(&paths(&job, false)?, &moments);
    let mut csv = String::from(
        "seconds,with_q05,with_q25,with_q50,with_q75,with_q95,without_q05,without_q25,without_q50,without_q75,without_q95\n",
    );
    for (t, (a, b)) in moments.iter().zip(with.iter().zip(&without)) {
        let numbers: Vec<String> = a.iter().chain(b).map(|x| format!("{x:.2}")).collect();
        let _ = writeln!(csv, "{t:.4},{}", numbers.join(","));
    }
    let last = without.last().map_or(f64::NEG_INFINITY, |q| q[2]);
    let passes = moments.iter().zip(&with).find(|(_, q)| q[2] >= last);
    println!(
        "median log joint after {seconds} s: {:.1} with proposals from the picture, {last:.1} without",
        with.last().map_or(f64::NAN, |q| q[2])
    );
    match passes {
        Some((t, _)) => {
            println!(
                "with them the median chain is there after {t:.2} s: {:.0} times sooner",
                seconds / t
            )
        }
        None => println!("with them the median chain does not get there"),
    }
    let both =
        [("with proposals from the picture", "#1f77b4", with), ("without", "#d62728", without)];
    std::fs::write(out, figure(&moments, &both)).map_err(|e| format!("{out}: {e}"))?;
    std::fs::write(format!("{out}.csv"), csv).map_err(|e| format!("{out}.csv: {e}"))
}
