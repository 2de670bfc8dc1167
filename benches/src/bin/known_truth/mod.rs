//! Code shared by the recovery examples: a shipped program observes the clean contours of
//! one of its own draws.

use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_library::shipped;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::ContourMap;
use std::sync::Arc;

/// The longer side of the pictures, in pixels.
pub const SIZE: u32 = 256;

/// The random stream of values on which no observation depends.
pub const DRAWS: fn() -> Draws =
    || Draws { key: StreamKey::new(0, 0, Purpose::PREDICT), step: 0, substream: 0 };

/// Reads a number from the command line.
pub fn argument(i: usize, default: u64) -> u64 {
    std::env::args().nth(i).and_then(|a| a.parse().ok()).unwrap_or(default)
}

/// Compiles a program that observes a contour map, with the given settings and those on
/// the command line after the first two arguments.
pub fn compile(
    program: &str,
    settings: &[(&str, &str)],
    map: ContourMap,
) -> Result<Model, pcadlang::Error> {
    let image = Value::object(ImageValue::contours(map, None));
    let program = Program::parse(shipped::file(program).unwrap_or_default())?
        .observe("photo", image)
        .camera(Camera::default_for(SIZE, SIZE))
        .set("clean", "true");
    let given: Vec<String> = std::env::args().skip(3).collect();
    let given = given.iter().filter_map(|s| s.split_once('='));
    settings
        .iter()
        .copied()
        .chain(given)
        .fold(program, |p, (name, value)| p.set(name, value))
        .compile()
}

/// Samples a draw from the prior that lies within the picture. Returns its trace and
/// contours.
pub fn draw(blank: &Model, seed: u64) -> Result<(Trace, ContourMap), pcadlang::Error> {
    for attempt in 0.. {
        let mut trace = blank.simulate(seed, attempt)?;
        let view = global(&mut trace, "view");
        let Some(view) = view.downcast::<ViewValue>() else { continue };
        let c = view.0.contours(SIZE);
        let inside = |v: &[f32]| v.iter().all(|x| (4.0..SIZE as f32 - 4.0).contains(x));
        if c.length.iter().sum::<f32>() < 100.0 || !inside(&c.x) || !inside(&c.y) {
            continue;
        }
        let map = ContourMap::of(&c.slice());
        return Ok((trace, map));
    }
    unreachable!("attempts do not end")
}

/// Returns the value of a top-level name.
pub fn global(trace: &mut Trace, name: &str) -> Value {
    trace.global(name, DRAWS()).and_then(Result::ok).unwrap_or_default()
}

/// Returns the log joint density of a draw under another observation.
pub fn score(model: &Model, truth: &Trace) -> f64 {
    let rebuilt =
        Trace::generate(Arc::clone(model.code()), truth.constraints(), DRAWS(), Default::default());
    rebuilt.map_or(f64::NAN, |(t, _)| t.log_joint())
}

/// Sorts numbers in ascending order.
pub fn sorted(mut v: Vec<f64>) -> Vec<f64> {
    v.sort_by(f64::total_cmp);
    v
}

/// Returns a quantile of numbers in ascending order.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    sorted.get((q * sorted.len() as f64) as usize).copied().unwrap_or(f64::NAN)
}
