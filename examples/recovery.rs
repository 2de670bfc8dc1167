//! Known truth: scenes drawn from the prior of `lathe.pcad`, their own clean contours as the observation. How well are pose and
//! profile recovered, and how often do 90 % intervals hold the truth?
//!
//! `cargo run --release --example recovery -- [CASES] [SECONDS] [PARAMETER=VALUE…]`

use pcadlang::lang::builtins::scene::{ImageValue, ViewValue};
use pcadlang::lang::load::embedded;
use pcadlang::lang::value::Value;
use pcadlang::render::Camera;
use pcadlang::report::Quantity;
use pcadlang::rng::{Purpose, StreamKey};
use pcadlang::trace::{Draws, Trace};
use pcadlang::vision::ContourMap;
use pcadlang::{Model, Program, RunOptions};
use std::sync::Arc;
use std::time::Duration;

const SIZE: u32 = 256;

fn compile(map: ContourMap) -> Result<Model, pcadlang::Error> {
    let image = Value::object(ImageValue::contours(map, None));
    let program = Program::parse(embedded("lathe.pcad").unwrap_or_default())?
        .observe("photo", image)
        .camera(Camera::default_for(SIZE, SIZE))
        .set("clean", "true");
    let settings: Vec<String> = std::env::args().skip(3).collect();
    let set = |p: Program, s: &String| match s.split_once('=') {
        Some((name, value)) => p.set(name, value),
        None => p,
    };
    settings.iter().fold(program, set).compile()
}

/// A scene from the prior that lies within the picture: its trace and contours.
fn scene(seed: u64) -> Result<(Trace, ContourMap), pcadlang::Error> {
    let blank = compile(ContourMap::new(SIZE, SIZE))?;
    for attempt in 0.. {
        let mut trace = blank.simulate(seed, attempt)?;
        let view = global(&mut trace, "view");
        let Some(view) = view.downcast::<ViewValue>() else { continue };
        let c = view.0.contours(SIZE);
        let inside = |v: &[f32]| v.iter().all(|x| (4.0..SIZE as f32 - 4.0).contains(x));
        if c.length.iter().sum::<f32>() < 100.0 || !inside(&c.x) || !inside(&c.y) {
            continue;
        }
        let strength = vec![1.0; c.x.len()];
        let map = ContourMap {
            x: c.x.clone(),
            y: c.y.clone(),
            tx: c.tx.clone(),
            ty: c.ty.clone(),
            strength,
            ..ContourMap::new(SIZE, SIZE)
        };
        return Ok((trace, map));
    }
    unreachable!("attempts do not end")
}

fn global(trace: &mut Trace, name: &str) -> Value {
    let draws = Draws { key: StreamKey::new(0, 0, Purpose::PREDICT), step: 0, lane: 0 };
    trace.global(name, draws).and_then(Result::ok).unwrap_or_default()
}

/// A number of the truth by the name of its column.
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

fn main() -> Result<(), pcadlang::Error> {
    let argument = |i: usize, default: u64| std::env::args().nth(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (cases, seconds) = (argument(1, 20), argument(2, 20));
    println!("case  |dH|/H  |dx|,|dy|  |dz|   tilt   profile  within 90 %  R-hat  log joint (truth)");
    let (mut held, mut asked) = (0, 0);
    let mut errors: Vec<[f64; 5]> = Vec::new();
    for case in 0..cases {
        let (mut t, map) = scene(case)?;
        let model = compile(map)?;
        // The score of the truth under the same observation.
        let constraints = t.constraints();
        let draws = Draws { key: StreamKey::new(0, 0, Purpose::PREDICT), step: 0, lane: 0 };
        let rebuilt = Trace::generate(Arc::clone(model.code()), constraints, draws, Default::default());
        let best = rebuilt.map_or(f64::NAN, |(t, _)| t.log_joint());
        let options = RunOptions { seed: case + 1, time: Some(Duration::from_secs(seconds)), ..RunOptions::default() };
        let posterior = model.run(&options, 2, 2)?;
        let quantities = posterior.quantities();
        let h = truth(&mut t, "H").unwrap_or(f64::NAN);
        let mut error = |names: &[&str]| -> f64 {
            let mut of = |n: &&str| {
                let q: Option<&Quantity> = quantities.iter().find(|q| q.name == **n);
                q.and_then(|q| truth(&mut t, n).map(|x| (q.summary.q50 - x).powi(2))).unwrap_or(f64::NAN)
            };
            names.iter().map(&mut of).sum::<f64>().sqrt()
        };
        let profile: Vec<String> = (0..10).flat_map(|i| [format!("lower/r[{i}]"), format!("upper/r[{i}]")]).collect();
        let profile: Vec<&str> = profile.iter().map(String::as_str).collect();
        let e = [
            error(&["H"]) / h,
            error(&["S_L/translate/x", "S_L/translate/y"]),
            error(&["S_L/translate/z"]),
            error(&["S_L/axis/x", "S_L/axis/y", "S_L/axis/z"]).to_degrees(),
            error(&profile) / 20f64.sqrt() / h,
        ];
        let (mut inside, mut all) = (0, 0);
        for q in &quantities {
            if let Some(x) = truth(&mut t, &q.name) {
                all += 1;
                inside += usize::from((q.summary.q05..=q.summary.q95).contains(&x));
            }
        }
        (held, asked) = (held + inside, asked + all);
        let log = &quantities[0].summary;
        println!(
            "{case:4}  {:6.3}  {:9.3}  {:5.3}  {:4.1}°  {:7.4}  {inside:3} of {all:2}    {:5.2}  {:8.1} ({best:.1})",
            e[0], e[1], e[2], e[3], e[4], log.r_hat, log.q50
        );
        errors.push(e);
    }
    let median = |i: usize| {
        let mut v: Vec<f64> = errors.iter().map(|e| e[i]).collect();
        v.sort_by(f64::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
    };
    println!("median {:6.3} {:9.3}  {:5.3}  {:4.1}°  {:7.4}", median(0), median(1), median(2), median(3), median(4));
    println!(
        "90 % intervals hold {held} of {asked} values ({:.0} %)",
        100.0 * f64::from(held as u32) / f64::from(asked as u32)
    );
    Ok(())
}
