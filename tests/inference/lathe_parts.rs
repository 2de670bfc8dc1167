//! The number of parts of a lathe is drawn from its posterior, compared with
//! probabilities by quadrature over the same pictures.

use crate::common::{assert_mean, integrate};
use pcadlang::{Model, Program, RunOptions};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_library::shipped;
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::ContourMap;

const SIZE: u32 = 48;

/// One radius or two; the second exists only if there is a second part.
const MODEL: &str = "include \"std/scene.pcad\" as scene;
data photo: image \"the contours\";
assume two   ~ flip(0.3);
assume lower ~ uniform(0.3, 0.7);
assume upper = if two { r ~ uniform(0.3, 0.7); r } else { lower };
let parts = [{ y: [-1, 0], r: [lower, lower] }, { y: [0, 1], r: [upper, upper] }];
assume view = scene.render(scene.lathe(parts, sides = 24));
observe scene.chamfer(view, sigma = 1, symmetric = true, size = 48) = photo as distance;
";

fn model(text: &str, map: ContourMap) -> Model {
    let image = Value::object(ImageValue::contours(map, None));
    let program = Program::parse(text)
        .and_then(|p| p.observe("photo", image).camera(Camera::default_for(SIZE, SIZE)).compile());
    program.unwrap_or_else(|e| panic!("{e}"))
}

/// Returns the contours of a state.
fn shown(trace: &mut Trace) -> ContourMap {
    let view = trace.global("view", Draws::default()).unwrap().unwrap();
    let c = view.downcast::<ViewValue>().unwrap().0.contours(SIZE);
    ContourMap::of(&c.slice())
}

fn set(trace: &mut Trace, values: &[(&str, Value)]) {
    for (address, value) in values {
        trace
            .set(address, value.clone(), Draws::default())
            .unwrap_or_else(|e| panic!("{address}: {e:?}"));
    }
}

#[test]
fn the_second_part_comes_and_goes_as_its_posterior_says() {
    let mut truth = model(MODEL, ContourMap::new(SIZE, SIZE)).simulate(1, 0).unwrap();
    set(&mut truth, &[("@two", true.into()), ("@lower", 0.45.into()), ("@upper/r", 0.56.into())]);
    let map = shown(&mut truth);
    let start = model(MODEL, map.clone()).simulate(1, 0).unwrap();
    let density = |lower: f64, upper: Option<f64>| {
        let mut t = start.clone();
        set(&mut t, &[("@two", upper.is_some().into()), ("@lower", lower.into())]);
        set(&mut t, &upper.map(|r| ("@upper/r", r.into())).into_iter().collect::<Vec<_>>());
        t.log_likelihood().exp() / 0.4
    };
    let one = 0.7 * integrate(|r| density(r, None), 0.3, 0.7, 80);
    let two =
        0.3 * integrate(|r| integrate(|s| density(r, Some(s)), 0.3, 0.7, 40) / 0.4, 0.3, 0.7, 40);
    let expected = two / (one + two);
    assert!((0.1..0.9).contains(&expected), "{expected}: a test of nothing");
    for kernels in [
        "mh(@two); drift(one($continuous));",
        "gibbs(@two); drift(one($continuous));",
        "mh(one(@**));",
    ] {
        let plan = format!(
            "{MODEL}infer {{ warmup 500 {{ {kernels} }} repeat 12000 {{ {kernels} collect two; }} }}"
        );
        let posterior = model(&plan, map.clone()).run(&RunOptions::default(), 2, 2).unwrap();
        let draws: Vec<f64> = posterior
            .scalars()
            .into_iter()
            .filter(|(n, _)| n == "two")
            .flat_map(|(_, v)| v)
            .collect();
        assert_mean(kernels, &draws, expected, 0.12);
    }
}

/// The shipped program under its own prior: parts appear and vanish, and the scores equal
/// those of a run from scratch.
#[test]
fn the_shipped_program_makes_and_removes_a_part() {
    let text = shipped::file("lathe_parts.pcad").unwrap();
    let text = text.split("infer {").next().unwrap();
    let map = shown(&mut model(text, ContourMap::new(SIZE, SIZE)).simulate(5, 0).unwrap());
    let (mut trace, mut counts) = (model(text, map).simulate(3, 0).unwrap(), Vec::new());
    for two in [true, false, true, true, false] {
        set(&mut trace, &[("@two", two.into())]);
        counts.push(trace.choice_count());
        assert_eq!(trace.log_joint().to_bits(), trace.rerun().unwrap().log_joint().to_bits());
    }
    // The cut, the ratio of the widths, and the bandwidth and profile of a part.
    assert_eq!(counts[0], counts[1] + 4, "{counts:?}");
}
