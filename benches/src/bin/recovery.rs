//! Recovery of known scenes: scenes are drawn from the prior of `lathe.pcad`, and their
//! own clean contours are observed. How well are pose and profile recovered, and how
//! often do 90 % intervals contain the ground truth?
//!
//! `cargo run --release -p pcadlang-benches --bin recovery -- [CASES] [SECONDS] [PARAMETER=VALUE…]`

mod known_truth;

use known_truth::{argument, compile, draw, global, quantile, score, sorted};
use pcadlang::{Model, RunOptions};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Trace;
use pcadlang_report::Quantity;
use pcadlang_scene::vision::ContourMap;
use std::time::Duration;

/// The position of the default camera on the z axis.
const EYE: f64 = 8.0;

fn over(map: ContourMap) -> Result<Model, pcadlang::Error> {
    compile("lathe.pcad", &[("sigma", "0.1")], map)
}

/// Returns a number of the ground truth by the name of its column.
fn truth(trace: &mut Trace, column: &str) -> Option<f64> {
    let (path, index) = match column.split_once('[') {
        Some((path, rest)) => (path, rest.trim_end_matches(']').parse().ok()),
        None => (column, None),
    };
    let mut parts = path.split('/');
    let mut value = global(trace, parts.next()?);
    for field in parts {
        value = match &value {
            Value::Record(r) => r.get(field).cloned()?,
            Value::Object(o) => o.field(field)?,
            _ => return None,
        };
    }
    match (value, index) {
        (Value::Num(x), None) => Some(x),
        (Value::Array(xs), Some(i)) => xs.get::<usize>(i).copied(),
        _ => None,
    }
}

/// The number of knots of the profile.
const KNOTS: usize = 24;

/// Returns the radius at 51 heights from the bottom to the top, as a fraction of the
/// total height; `get` reads a column.
fn shape(get: &mut dyn FnMut(&str) -> f64) -> Vec<f64> {
    let h = get("H");
    let radii: Vec<f64> = (0..KNOTS).map(|i| get(&format!("r[{i}]")) / h).collect();
    let at = |y: f64| {
        let place = (y * KNOTS as f64 - 0.5).clamp(0.0, (KNOTS - 1) as f64);
        let i = (place as usize).min(KNOTS - 2);
        radii[i] + (place - i as f64) * (radii[i + 1] - radii[i])
    };
    (0..=50).map(|i| at(f64::from(i) / 50.0)).collect()
}

/// Returns the root mean square of the differences.
fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

fn main() -> Result<(), pcadlang::Error> {
    let (cases, seconds) = (argument(1, 20), argument(2, 20));
    println!(
        "case    size       H  x and y       z   tilt    shape  held by 90 %  R-hat  log joint, best (truth)"
    );
    let blank = over(ContourMap::new(known_truth::SIZE, known_truth::SIZE))?;
    let (mut held, mut asked) = (0, 0);
    let mut errors: Vec<[f64; 6]> = Vec::new();
    for case in 0..cases {
        let (mut t, map) = draw(&blank, case)?;
        let model = over(map)?;
        let score = score(&model, &t);
        let options = RunOptions {
            seed: case + 1,
            time: Some(Duration::from_secs(seconds)),
            ..RunOptions::default()
        };
        let posterior = model.run(&options, 4, 2)?;
        let quantities = posterior.quantities();
        let mut found = |name: &str| -> f64 {
            let q: Option<&Quantity> = quantities.iter().find(|q| q.name == name);
            q.map_or(f64::NAN, |q| q.summary.q50)
        };
        let mut known = |name: &str| truth(&mut t, name).unwrap_or(f64::NAN);
        let distance = |names: &[&str],
                        known: &mut dyn FnMut(&str) -> f64,
                        found: &mut dyn FnMut(&str) -> f64| {
            names.iter().map(|n| (known(n) - found(n)).powi(2)).sum::<f64>().sqrt()
        };
        let z = "S_L/translate/z";
        // The apparent size: one picture determines it, but not height and distance
        // separately.
        let size = |get: &mut dyn FnMut(&str) -> f64| get("H") / (EYE - get(z));
        let e = [
            (size(&mut found) / size(&mut known) - 1.0).abs(),
            (found("H") / known("H") - 1.0).abs(),
            distance(&["S_L/translate/x", "S_L/translate/y"], &mut known, &mut found),
            distance(&[z], &mut known, &mut found),
            distance(&["S_L/axis/x", "S_L/axis/y", "S_L/axis/z"], &mut known, &mut found)
                .to_degrees(),
            rms(&shape(&mut found), &shape(&mut known)),
        ];
        let (mut inside, mut all) = (0, 0);
        for q in quantities.iter().filter(|q| q.name != "log_joint") {
            if let Some(x) = truth(&mut t, &q.name) {
                all += 1;
                inside += usize::from((q.summary.q05..=q.summary.q95).contains(&x));
            }
        }
        (held, asked) = (held + inside, asked + all);
        let worst = quantities.iter().map(|q| q.summary.r_hat).fold(0.0, f64::max);
        let best = posterior
            .chains
            .iter()
            .filter_map(|c| c.best.as_ref().map(|b| b.0))
            .fold(f64::NEG_INFINITY, f64::max);
        println!(
            "{case:4}  {:5.1} %  {:4.1} %    {:5.3}   {:5.3}  {:4.1}°  {:6.4}      {inside:2} of {all:2}  {worst:5.2}  {best:8.1} ({score:.1})",
            100.0 * e[0],
            100.0 * e[1],
            e[2],
            e[3],
            e[4],
            e[5]
        );
        errors.push(e);
    }
    let at = |i: usize, q: f64| quantile(&sorted(errors.iter().map(|e| e[i]).collect()), q);
    for (name, q) in [("half", 0.5), ("3/4 ", 0.75)] {
        let e: Vec<f64> = (0..6).map(|i| at(i, q)).collect();
        println!(
            "{name}  {:5.1} %  {:4.1} %    {:5.3}   {:5.3}  {:4.1}°  {:6.4}",
            100.0 * e[0],
            100.0 * e[1],
            e[2],
            e[3],
            e[4],
            e[5]
        );
    }
    println!(
        "90 % intervals hold {held} of {asked} values ({:.0} %)",
        100.0 * held as f64 / asked as f64
    );
    Ok(())
}
