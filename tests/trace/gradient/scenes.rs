//! Bodies with detected joints, and the comparators of pictures.

use super::{compare, draws};
use crate::common::folder::Folder;
use pcadlang::Program;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Target, Trace};
use pcadlang_library::scene::{DepthValue, ImageValue, MaskValue, ViewValue};
use pcadlang_numerics::dist::Datum;
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::{ContourMap, DepthMap, Mask, Photo};

#[test]
fn bodies_with_detected_joints() {
    let keypoints = r#"{ "nose": [120, 40, 0.9], "l_shoulder": [150, 90, 1], "r_elbow": [80, 130, 0.7], "l_knee": [140, 190],
                        "r_ankle": [100, 240, 0.8], "l_wrist": [180, 120, 0.9] }"#;
    let folder = Folder::new("gradient");
    let file = folder.write("keypoints.json", keypoints).path().join("keypoints.json");
    let text = r#"
        include "std/scene.pcad" as scene;
        data body = armature("std/human/human.lod2.rig.json");
        data points = keypoints();
        assume pose ~ iid(normal(0, 0.3), 66);
        assume build ~ normal(0, 1);
        assume person = scene.shaped(body, { heavy: max(build, 0), thin: max(-build, 0) });
        assume x ~ normal(0, 0.5);
        assume s ~ lognormal(0.7, 0.2);
        assume turn ~ iid(normal(0, 0.4), 3);
        let place = scene.affine(translate = [x, 0.1, 0], rotate = turn, scale = s) * scene.affine(translate = [0, -0.9, 0]);
        let view = scene.render(place * scene.skin(person, pose));
        observe scene.keypoints(view, sd = 4, outlier = 0.1) = points as joints;
        observe scene.relative_depth(view, s, share = 0.7, sd = 0.2, outlier = 0.2)
          = { nose: [0, 0, -0.2], l_wrist: [0.1, 0.4, 0.3], l_knee: [0, 0, -0.3], r_hip: [0, 0, 0.1] } as depths;"#;
    let model = Program::parse(text)
        .unwrap()
        .observe_file("points", file.to_str().unwrap())
        .unwrap()
        .compile()
        .unwrap();
    for seed in 0..3 {
        let mut trace = model.simulate(seed, 0).unwrap();
        compare(&mut trace, "a body");
    }
}

fn find(trace: &Trace, name: &str) -> Option<Target> {
    trace
        .choices()
        .iter()
        .find(|c| c.0.to_string() == format!("@{name}"))
        .and_then(|c| trace.find(&c.0))
}

/// A contour map of a disc, 64 pixels wide.
fn disc() -> ImageValue {
    let mut map = ContourMap::new(64, 64);
    for i in 0..150 {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 150.0).sin_cos();
        map.x.push((34.0 + 15.0 * cos) as f32);
        map.y.push((30.0 + 15.0 * sin) as f32);
        map.tx.push(-sin as f32);
        map.ty.push(cos as f32);
        map.strength.push(1.0);
    }
    ImageValue::contours(map, None)
}

/// Whether a pixel of a picture 256 pixels wide is in the disc.
fn inside(i: u32) -> bool {
    let (x, y) = (f64::from(i % 256) + 0.5, f64::from(i / 256) + 0.5);
    (x / 4.0 - 34.0).hypot(y / 4.0 - 30.0) < 15.0
}

fn mask() -> Value {
    let mask = Mask::new(256, 256, (0..256 * 256).map(inside).collect()).unwrap();
    Value::object(MaskValue::new(mask))
}

fn depth() -> Value {
    let depth = (0..256 * 256)
        .map(|i| if inside(i) { 7.0 + i as f32 * 1e-5 } else { f32::INFINITY })
        .collect();
    Value::object(DepthValue::new(DepthMap::new(256, 256, depth).unwrap()))
}

fn photo() -> Value {
    let colour = |x: u32, y: u32| {
        let noise = (x * 7919 + y * 104_729 + x * y) % 97;
        let base = if inside(y * 256 + x) { [150, 60, 50] } else { [70, 110, 140] };
        image::Rgb(base.map(|b: u32| (b + noise) as u8))
    };
    Value::object(ImageValue::photo(
        Photo::from_rgb(image::RgbImage::from_fn(256, 256, colour)).unwrap(),
    ))
}

#[test]
fn pictures_pull_where_their_score_rises() {
    let group = "scene.group([scene.lathe(profile), scene.affine(translate = [0, 2 * r, 0]) * scene.sphere(0.2)])";
    pull(group, false);
    let named = "scene.group({ vase: scene.lathe(profile), ball: scene.affine(translate = [0, 2 * r, 0]) * scene.sphere(0.2) })";
    pull(named, false);
}

#[test]
fn pictures_of_round_surfaces_pull_where_their_score_rises() {
    pull("scene.lathe(profile, sides = 0)", true);
    pull("scene.lathe(profile, sides = 0, thickness = 0.2 * r)", true);
}

/// Compares the slopes of the scores of an object with differences.
fn pull(object: &str, round: bool) {
    // Differences over half a pixel, since sums over pieces and pixels change in small
    // steps.
    let half = 0.5 * 4.4 / 64.0;
    for (likelihood, seen) in [
        ("scene.chamfer(view, sigma = s, size = 64)", Value::object(disc())),
        (
            "scene.chamfer(view, sigma = s, size = 64, mode = \"sum\", symmetric = true)",
            Value::object(disc()),
        ),
        ("scene.contour(view, size = 64, sd = 2, truncate = 9)", Value::object(disc())),
        ("scene.mask(view, size = 256)", mask()),
        ("scene.depth(view, size = 256, sd = 0.5)", depth()),
        ("scene.region(view, size = 256)", photo()),
    ] {
        let kind = match likelihood {
            l if l.starts_with("scene.mask") => "mask",
            l if l.starts_with("scene.depth") => "depth",
            _ => "image",
        };
        let text = format!(
            "include \"std/scene.pcad\" as scene; data photo: {kind};
             assume x ~ uniform(-1, 1); assume y ~ uniform(-1, 1); assume t ~ uniform(-3, 3); assume r ~ uniform(0, 2);
             assume s ~ uniform(0, 20);
             let h = linspace(-1, 1, 12);
             let profile = {{ y: r * h, r: r * (0.6 + 0.25 * sin(2.5 * h)) }};
             let solid = scene.centred({object});
             let placed = scene.affine(translate = [x, y, 0], rotate = [t, 0.2, 0.4]) * solid;
             assume view = scene.render(placed, metre = 1 + r);
             observe {likelihood} = photo as picture;"
        );
        let program = Program::parse(&text).unwrap().observe("photo", seen);
        let model =
            program.camera(Camera::default_for(64, 64)).compile().unwrap_or_else(|e| panic!("{e}"));
        let mut trace = model.simulate(1, 0).unwrap();
        let at = |trace: &mut Trace, values: &[(&str, f64)]| {
            let set =
                |(name, v): &(&str, f64)| Some((find(trace, name)?, Change::Set(Datum::Num(*v))));
            let changes: Vec<(Target, Change)> = values.iter().filter_map(set).collect();
            trace.propose(&changes, draws()).unwrap();
            trace.commit();
            trace.log_likelihood()
        };
        let mut here = [("x", 0.2), ("y", -0.1), ("t", 0.5), ("r", 0.8), ("s", 4.0)];
        at(&mut trace, &here);
        let view = trace.global("view", draws()).unwrap().unwrap();
        let view = &view.downcast::<ViewValue>().unwrap().0;
        assert_eq!(view.solid().revolution().is_some(), round);
        // If no observation depends on it, s does not exist.
        let targets: Vec<Target> = here.iter().filter_map(|(name, _)| find(&trace, name)).collect();
        let (mut all, mut prior) = (Vec::new(), Vec::new());
        trace
            .gradient(&targets, 1.0, &mut all)
            .unwrap_or_else(|e| panic!("{likelihood}: {}", e.message));
        trace.gradient(&targets, 0.0, &mut prior).unwrap();
        let (mut dot, mut found, mut slopes) = (0.0, 0.0, 0.0);
        for k in 0..targets.len() {
            let mut score = |h: f64| {
                here[k].1 += h;
                let score = at(&mut trace, &here);
                here[k].1 -= h;
                score
            };
            let slope = score(half) - score(-half);
            at(&mut trace, &here);
            // Differentiates by the coordinate itself, not the unconstrained one: x = lo
            // + (hi - lo) expit(y).
            let (lo, hi) = match here[k].0 {
                "t" => (-3.0, 3.0),
                "r" => (0.0, 2.0),
                "s" => (0.0, 20.0),
                _ => (-1.0, 1.0),
            };
            let share = (here[k].1 - lo) / (hi - lo);
            let g = (all[k] - prior[k]) / ((hi - lo) * share * (1.0 - share)) * 2.0 * half;
            dot += g * slope;
            found += g * g;
            slopes += slope * slope;
        }
        let cosine = dot / (found * slopes).sqrt();
        let ratio = (found / slopes).sqrt();
        // Pixels are either inside or outside, so their sums change in steps.
        let least = if likelihood.contains("256") { 0.95 } else { 0.98 };
        assert!(
            cosine > least && (0.8..1.25).contains(&ratio),
            "{likelihood}: cosine {cosine}, length {ratio}"
        );
    }
}
