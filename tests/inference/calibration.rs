//! Kernels and shipped programs draw from the posterior of data simulated from the model:
//! simulation-based calibration (Talts et al. 2018) and Geweke's joint distribution test
//! (2004). `tests/inference/planted_errors.rs` shows that the checks detect planted
//! errors.
//!
//! The checks fail a correct sampler once in a thousand; seeds are fixed. To run the slow
//! ones: `cargo test --release -- --ignored`.

use crate::common::folder::Folder;
use crate::common::kernels::{CALIBRATED, RANKED, RANKED_ON_COUNTS};
use crate::common::wrong_neighbours;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_inference::calibration::{PlanSampler, Settings, geweke, sbc};
use pcadlang_inference::{Progress, RunOptions};
use pcadlang_library::scene::{DepthValue, ImageValue, KeypointsValue, MaskValue};
use pcadlang_scene::vision::keypoints::Keypoint;
use pcadlang_scene::vision::{DepthMap, Keypoints, Mask, Photo};
use std::sync::Arc;

/// Which of the two checks, with the number of data sets or chains, and the steps of each
/// chain.
#[derive(Clone, Copy)]
enum Check {
    Ranks(usize, Option<u64>),
    Turns(usize, Option<u64>),
}

fn passes(name: &str, model: &Model, check: Check) {
    let (plan, _) = model.plan().unwrap_or_else(|e| panic!("{e}"));
    let progress = Progress::default();
    let options = RunOptions {
        seed: 1,
        banks: Some(Arc::new(wrong_neighbours(model))),
        ..RunOptions::default()
    };
    let sampler = PlanSampler { plan: &plan, options, progress: &progress };
    let (Check::Ranks(replicates, steps) | Check::Turns(replicates, steps)) = check;
    let settings = Settings { replicates, steps, seed: 1, threads: 2, ..Settings::default() };
    match check {
        Check::Ranks(..) => {
            let said =
                sbc(model.code(), &sampler, &settings).unwrap_or_else(|e| panic!("{name}: {e:?}"));
            assert!(said.passes(), "{name}: {said:#?}");
        }
        Check::Turns(..) => {
            let said = geweke(model.code(), &sampler, &settings)
                .unwrap_or_else(|e| panic!("{name}: {e:?}"));
            assert!(said.passes(), "{name}: {said:#?}");
        }
    }
}

/// A choice of each kind: Boolean, Gaussian, positive.
fn small(kernel: &str) -> Model {
    let k = if kernel.ends_with([';', '}']) { kernel.to_owned() } else { format!("{kernel};") };
    Model::from_text(&format!(
        "assume c ~ flip(0.4); assume m ~ normal(if c {{ 1 }} else {{ -1 }}, 1); assume s ~ gamma(3, 3);
         observe normal(m, s) = [0, 1, 2] as y;
         infer {{ warmup 200 {{ {k} }} repeat 60 {{ repeat 4 {{ {k} }} collect c, m, s; }} }}"
    ))
    .unwrap_or_else(|e| panic!("{kernel}: {e}"))
}

/// Counts, which simulated data can equal exactly.
fn counts(kernel: &str) -> Model {
    Model::from_text(&format!(
        "assume c ~ flip(0.4); assume p ~ beta(2, 3);
         observe binomial(3, if c {{ p }} else {{ 1 - p }}) = 1 as a; observe flip(p) = true as b;
         infer {{ warmup 300 {{ {kernel}; }} repeat 60 {{ repeat 40 {{ {kernel}; }} collect c, p; }} }}"
    ))
    .unwrap_or_else(|e| panic!("{kernel}: {e}"))
}

#[test]
#[ignore = "minutes"]
fn ranks_under_every_kernel() {
    for kernel in CALIBRATED.iter().chain(RANKED) {
        passes(kernel, &small(kernel), Check::Ranks(60, None));
    }
    for kernel in RANKED_ON_COUNTS {
        passes(kernel, &counts(kernel), Check::Ranks(60, None));
    }
}

#[test]
fn turns_under_every_kernel() {
    for kernel in CALIBRATED {
        passes(kernel, &small(kernel), Check::Turns(40, None));
    }
}

fn shipped(name: &str) -> Model {
    Program::open(name).and_then(Program::compile).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn small_shipped_programs() {
    for name in ["coin.pcad", "geometric.pcad"] {
        passes(name, &shipped(name), Check::Ranks(60, Some(1500)));
        passes(name, &shipped(name), Check::Turns(40, Some(500)));
    }
}

/// A shipped program with `rows` rows of data.
fn shipped_with(name: &str, rows: usize) -> Model {
    let text: String = (0..rows).map(|i| format!("{i},{i}\n")).collect();
    let folder = Folder::new("calibration");
    let path = folder.write("d.csv", format!("x,y\n{text}")).path().join("d.csv");
    let program = Program::open(name)
        .and_then(|p| p.observe_file("d", path.to_str().unwrap()))
        .and_then(Program::compile);
    program.unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Runs both checks of a program for many steps, with little data: a plan that is long
/// enough for the program's own data may be too short for that many rows drawn from its
/// prior. Takes minutes each: `LONG=1 cargo test --release --test inference calibration::
/// -- --ignored`.
fn at_length(name: &str, model: &Model, steps: Option<u64>, turns: Option<u64>) {
    if std::env::var_os("LONG").is_some() {
        passes(name, model, Check::Ranks(200, steps));
        passes(name, model, Check::Turns(100, turns));
    }
}

#[test]
#[ignore = "minutes, and only with LONG=1"]
fn small_shipped_programs_at_length() {
    at_length("coin.pcad", &shipped("coin.pcad"), None, None);
    at_length("geometric.pcad", &shipped("geometric.pcad"), None, None);
}

#[test]
#[ignore = "minutes, and only with LONG=1"]
fn linreg_at_length() {
    at_length("linreg.pcad", &shipped_with("linreg.pcad", 8), Some(18_000), Some(9_000));
}

#[test]
#[ignore = "minutes, and only with LONG=1"]
fn mixture_at_length() {
    at_length("mixture.pcad", &shipped_with("mixture.pcad", 8), Some(120_000), Some(30_000));
}

#[test]
#[ignore = "minutes, and only with LONG=1"]
fn crp_at_length() {
    at_length("crp.pcad", &shipped_with("crp.pcad", 6), Some(100_000), Some(30_000));
}

/// A sphere in front of the camera, with a given observation.
fn scene(data: &str, observe: &str, given: Value) -> Model {
    let text = format!(
        "include \"std/scene.pcad\" as scene; {data};
         fn ball(r) {{ scene.landmarks(scene.sphere(r, sides = 8), {{ nose: [0, r, 0], l_ankle: [0, -r, 0], l_hip: [0, 0, -r], r_hip: [0, 0, 0] }}) }}
         assume x ~ normal(0, 0.4); assume y ~ normal(0, 0.4); assume r ~ uniform(0.4, 0.9);
         let view = scene.render(scene.affine(translate = [x, y, 0]) * ball(r));
         observe {observe};
         infer {{ warmup 300 {{ drift(one(@**)); drift(@**); }} repeat 60 {{ repeat 5 {{ drift(one(@**)); drift(@**); }} collect x, y, r; }} }}"
    );
    let program = Program::parse(&text).unwrap_or_else(|e| panic!("{e}"));
    program.observe("seen", given).compile().unwrap_or_else(|e| panic!("{e}"))
}

fn scenes() -> Vec<(&'static str, Model)> {
    let mask = Value::object(MaskValue::new(Mask::new(16, 16, vec![false; 256]).unwrap()));
    let mut depths = vec![f32::INFINITY; 256];
    depths[7] = f32::NAN;
    let depth = Value::object(DepthValue::new(DepthMap::new(16, 16, depths).unwrap()));
    let point = |name: &str| Keypoint::new(name, [8.0, 8.0], 0.6);
    let points = Keypoints::new(["nose", "l_ankle"].map(point).to_vec()).unwrap().in_image(16, 16);
    let points = Value::object(KeypointsValue(points));
    let grey = |x: u32, y: u32| image::Rgb([((x * 7 + y * 11) % 4 * 60) as u8; 3]);
    let photo = Photo::from_rgb(image::RgbImage::from_fn(16, 16, grey)).unwrap();
    let photo = Value::object(ImageValue::photo(photo));
    let region = "scene.region(view, power = 1, tile_power = 0, colours = 4, size = 16) = seen";
    let away = |z: f64| Value::array(vec![0.0, 0.0, z]);
    let metres = Value::record([("nose", away(0.1)), ("l_hip", away(0.4)), ("knee", away(0.0))]);
    let depths = "scene.relative_depth(view, 1.5, share = 0.8, sd = 0.3, outlier = 0.3) = seen";
    vec![
        ("relative depth", scene("data seen = json()", depths, metres)),
        (
            "keypoints",
            scene(
                "data seen = keypoints()",
                "scene.keypoints(view, sd = 10, outlier = 0.3) = seen",
                points,
            ),
        ),
        ("region", scene("data seen: image", region, photo)),
        (
            "mask",
            scene(
                "data seen = mask()",
                "scene.mask(view, eps_in = 0.3, eps_out = 0.3, size = 16) = seen",
                mask,
            ),
        ),
        (
            "depth",
            scene(
                "data seen = depth()",
                "scene.depth(view, sd = 0.5, outlier = 0.4, size = 16) = seen",
                depth,
            ),
        ),
    ]
}

#[test]
fn scenes_with_samplers() {
    for (name, model) in scenes() {
        passes(name, &model, Check::Turns(30, Some(200)));
    }
}

#[test]
#[ignore = "minutes"]
fn scenes_with_samplers_at_length() {
    for (name, model) in scenes() {
        passes(name, &model, Check::Ranks(200, None));
        passes(name, &model, Check::Turns(100, None));
    }
}
