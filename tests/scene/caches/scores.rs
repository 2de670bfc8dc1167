//! Scores: comparators, their prepared data, and what they remember of the last contours.

use super::afresh;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Draws;
use pcadlang_library::scene::{DepthValue, ImageValue, MaskValue};
use pcadlang_scene::vision::{DepthMap, Mask, Photo};

fn inside(i: u32, width: u32) -> bool {
    let (x, y) = (f64::from(i % width) - 50.0, f64::from(i / width) - 30.0);
    x * x + y * y < 400.0
}

const SIZE: [u32; 2] = [96, 64];

/// Returns a new observed value, without prepared data.
fn observed(kind: &str) -> Value {
    let [w, h] = SIZE;
    match kind {
        "mask" => Value::object(MaskValue::new(
            Mask::new(w, h, (0..w * h).map(|i| inside(i, w)).collect()).unwrap(),
        )),
        "depth" => {
            let depth = (0..w * h)
                .map(|i| if inside(i, w) { 7.0 + i as f32 * 1e-4 } else { f32::INFINITY });
            Value::object(DepthValue::new(DepthMap::new(w, h, depth.collect()).unwrap()))
        }
        _ => {
            let colour = |x: u32, y: u32| {
                let noise = (x * 7919 + y * 104_729 + x * y) % 97;
                let base = if inside(y * w + x, w) { [150, 60, 50] } else { [70, 110, 140] };
                image::Rgb(base.map(|b: u32| (b + noise) as u8))
            };
            Value::object(ImageValue::photo(
                Photo::from_rgb(image::RgbImage::from_fn(w, h, colour)).unwrap(),
            ))
        }
    }
}

/// Replaces `<base,step>` by base, or base + step if p[i] is 1, and `<a|b>` by a or b
/// accordingly; also returns the number of replacements.
fn written(text: &str) -> (String, usize) {
    let (mut out, mut count, mut rest) = (String::new(), 0, text);
    while let Some((before, after)) = rest.split_once('<') {
        let (one, after) = after.split_once('>').unwrap();
        let (a, b) = one.split_once([',', '|']).unwrap();
        out.push_str(before);
        match one.contains('|') {
            true => out += &format!("(if p[{count}] > 0.5 {{ {b} }} else {{ {a} }})"),
            false => out += &format!("({a} + {b} * step(p[{count}] - 0.5))"),
        }
        (count, rest) = (count + 1, after);
    }
    (out + rest, count)
}

const SCENE: &str = "
    let eye = scene.camera(position = [<0,0.1>, <0,0.1>, <8,0.2>], look_at = [<0,0.1>, <0,0.1>, <0,0.3>],
        up = [<0,0.1>, 1, <0,0.1>], focal = <1.8,0.05>, width = <96,1>, height = <64,1>);
    let h = linspace(-1, 1, <8,1>);
    let vase = scene.lathe({ y: <1,0.1> * h, r: <0.6,0.1> + 0.25 * sin(2.5 * h) }, sides = <16,2>);
    let ball = scene.affine(translate = [<1,0.1>, <0.5,0.1>, <0.3,0.1>]) * scene.sphere(<0.4,0.1>, sides = <12,2>);
    let rest = scene.group([scene.box([1, 0.4, 0.3]), scene.affine(translate = [-1.2, 0.4, 0]) * scene.sphere(0.3)]);
    let placed = scene.affine(translate = [<0,0.1>, <0,0.1>, <0,0.1>], rotate = [<0.1,0.1>, <0.2,0.1>, <0.4,0.1>],
        scale = <1,0.05>) * scene.group([vase, ball, rest, scene.affine(translate = [0, -1, 0]) * scene.sphere(0.2)]);
    let view = scene.render(placed, camera = eye);";

/// A single round surface, drawn without a mesh.
const ROUND: &str = "
    let eye = scene.camera(position = [<0,0.1>, <0,0.1>, <8,0.2>], look_at = [<0,0.1>, <0,0.1>, <0,0.3>],
        up = [<0,0.1>, 1, <0,0.1>], focal = <1.8,0.05>, width = <96,1>, height = <64,1>);
    let h = linspace(-1, 1, <8,1>);
    let placed = scene.affine(translate = [<0,0.1>, <0,0.1>, <0,0.1>], rotate = [<0.5,0.1>, <0.2,0.1>, <0.4,0.1>],
        scale = <0.8,0.05>) * scene.centred(scene.lathe({ y: <1,0.1> * h, r: <0.6,0.1> + 0.25 * sin(2.5 * h) }, sides = 0,
        thickness = <0.1,0.02>, floor = <0.3,0.1>));
    let view = scene.render(placed, camera = eye);";

/// The kind of observed data, and the observation with its comparator.
const COMPARED: [(&str, &str); 6] = [
    (
        "image",
        "scene.contour(view, size = <64,8>, foreground = <0.75,-0.1>, sd = <0.4,0.1>, truncate = <3.3,1>, credit = <2,1>, \
         weight = <0.5,0.1>) = seen",
    ),
    (
        "image",
        "scene.chamfer(view, sigma = <3,1>, mode = <\"mean\"|\"sum\">, symmetric = <false|true>, truncate = <20,-15>, \
         oriented = <1,1>, size = <64,8>) = seen",
    ),
    (
        "image",
        "scene.chamfer(view, sigma = 3) = scene.edges(seen, size = <256,-64>, smooth = <1.6,1>, strength = <0.4,0.3>)",
    ),
    ("mask", "scene.mask(view, eps_in = <0.05,0.05>, eps_out = <0.05,0.05>, size = <64,8>) = seen"),
    (
        "depth",
        "scene.depth(view, sd = <0.2,0.1>, outlier = <0.05,0.05>, near = <0,1>, far = <100,10>, size = <64,8>) = seen",
    ),
    (
        "image",
        "scene.region(view, power = <0.05,0.05>, tiles = <8,-3>, tile_power = <0.1,0.1>, colours = <32,-16>, \
         groups = <\"silhouette\"|\"parts\">, shading = <0,0.1>, size = <64,8>) = seen",
    ),
];

fn program(scene: &str, kind: &str, compared: &str) -> (Model, usize) {
    let (text, count) = written(&format!("{scene} observe {compared};"));
    let data =
        if kind == "image" { "data seen: image;".into() } else { format!("data seen = {kind}();") };
    let text = format!(
        "include \"std/scene.pcad\" as scene; {data} assume p ~ iid(normal(0, 1), {count}); {text}"
    );
    let model =
        Program::parse(&text).map(|p| p.observe("seen", observed(kind))).and_then(Program::compile);
    (model.unwrap_or_else(|e| panic!("{e}\n{text}")), count)
}

fn put(t: &mut pcadlang_engine::trace::Trace, address: &str, v: Value) {
    t.set(address, v, Draws::default()).unwrap_or_else(|e| panic!("{address}: {e}"));
}

/// Changes each argument of cameras, shapes, placements, views and comparators alone.
#[test]
fn scores_of_other_arguments() {
    for (scene, (kind, compared)) in
        [SCENE, ROUND].into_iter().flat_map(|scene| COMPARED.map(|compared| (scene, compared)))
    {
        let (model, count) = program(scene, kind, compared);
        let mut here = model.simulate(1, 0).unwrap_or_else(|e| panic!("{compared}: {e}"));
        let from_scratch = |p: Vec<f64>| {
            afresh(|| {
                let mut there = program(scene, kind, compared).0.simulate(1, 0).unwrap();
                put(&mut there, "@p", Value::array(p));
                there.log_likelihood()
            })
        };
        put(&mut here, "@p", Value::array(vec![0.0; count]));
        let base = here.log_likelihood();
        assert_eq!(base.to_bits(), from_scratch(vec![0.0; count]).to_bits(), "{compared}");
        let mut shows = 0;
        for k in 0..count {
            let address = format!("@p[{k}]");
            put(&mut here, &address, 1.0.into());
            let mut p = vec![0.0; count];
            p[k] = 1.0;
            let (found, expected) = (here.log_likelihood(), from_scratch(p));
            assert_eq!(
                found.to_bits(),
                expected.to_bits(),
                "{compared}: argument {k}: {found}, from scratch {expected}"
            );
            shows += usize::from(found.to_bits() != base.to_bits());
            put(&mut here, &address, 0.0.into());
            assert_eq!(
                here.log_likelihood().to_bits(),
                base.to_bits(),
                "{compared}: argument {k} and back"
            );
        }
        // A few arguments do not change this picture's score: the depth of the look-at
        // point, a translation along the line of sight; the wall of a vessel
        // does not change its mask.
        println!("{shows} of {count} show: {compared}");
        let few = if scene == ROUND { 7 } else { 4 };
        assert!(shows + few >= count, "{compared}: {shows} of {count} arguments change the score");
    }
}
