//! Measures one transition as a scene grows in which only one object is uncertain: the
//! pose of a vase drifts among fixed boxes, spheres and lathes.
//!
//!     cargo run --release -p pcadlang-benches --bin scene_cost -- [N…] [nested|flat] [front|hidden] [COMPARATOR…] [count=TRANSITIONS] [warm=TRANSITIONS] [scale=S]
//!
//! COMPARATOR is `contour` (the default), `chamfer`, `symmetric` (chamfer distance), `mask`,
//! `depth`, `region`, `parts` (`scene.region` by parts) or `shading` (`scene.region` with
//! shading); with several, all are observed.
//! The observed picture is rendered from the program at the truth; N includes the vase.
//! `nested`: the fixed objects form a separate group; `flat`: all objects are members of
//! one group. `front`: the vase is in front of the others; `hidden`: it is among them, so
//! that half of them may be in front of it. Without a scale, the kernel learns it during
//! a warm-up. Prints processor times of the single thread. To count instructions, run it
//! twice under callgrind with different `count` and take the difference.

mod clock;

use clock::processor_seconds;
use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Draws, Selector, Trace};
use pcadlang_inference::{Drift, Kernel, Pick, SiteSelection, StepContext};
use pcadlang_library::scene::{DepthValue, ImageValue, MaskValue, ViewValue};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_report::pictures::shaded;
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::{ContourMap, DepthMap, Mask, Photo};
use std::error::Error;
use std::fmt::Write;

/// The longer side of the picture, in pixels.
const SIZE: u32 = 128;

/// The number of transitions of the warm-up, in which the kernel learns its scale, if none is given.
const WARM: u64 = 3000;

/// The comparators by name: the call, and the observed picture.
const COMPARATORS: [(&str, &str, &str); 8] = [
    ("contour", "scene.contour(view", "photo"),
    ("chamfer", "scene.chamfer(view", "photo"),
    ("symmetric", "scene.chamfer(view, symmetric = true", "photo"),
    ("mask", "scene.mask(view", "covered"),
    ("depth", "scene.depth(view", "range"),
    ("region", "scene.region(view", "photo"),
    ("parts", "scene.region(view, groups = \"parts\"", "photo"),
    ("shading", "scene.region(view, shading = 0.05", "photo"),
];

/// The options.
struct Wanted {
    flat: bool,
    front: bool,
    /// Which of [`COMPARATORS`] are observed.
    observe: Vec<usize>,
    count: u64,
    warm: u64,
    scale: Option<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut sizes: Vec<usize> = Vec::new();
    let mut wanted = Wanted {
        flat: false,
        front: true,
        observe: Vec::new(),
        count: 3000,
        warm: WARM,
        scale: None,
    };
    for a in std::env::args().skip(1) {
        match a.as_str() {
            "nested" | "flat" => wanted.flat = a == "flat",
            "front" | "hidden" => wanted.front = a == "front",
            _ => match (a.split_once('='), COMPARATORS.iter().position(|c| c.0 == a)) {
                (_, Some(comparator)) => wanted.observe.push(comparator),
                (Some(("count", count)), _) => wanted.count = count.parse()?,
                (Some(("warm", warm)), _) => wanted.warm = warm.parse()?,
                (Some(("scale", scale)), _) => wanted.scale = Some(scale.parse()?),
                _ => sizes.push(a.parse()?),
            },
        }
    }
    if wanted.observe.is_empty() {
        wanted.observe.push(0);
    }
    if sizes.is_empty() {
        sizes = vec![1, 10, 100, 1000];
    }
    let mut alone = None;
    for n in sizes {
        let (model, mut trace) = scene(n, &wanted)?;
        let pieces = view(&mut trace)?.0.contours(SIZE).len();
        let scope = SiteSelection {
            selector: Selector::Tag { name: "pose".into(), value: None },
            pick: Pick::All,
        };
        let mut kernel = Drift::new(scope, wanted.scale);
        let warm = wanted.warm;
        run(&mut kernel, &mut trace, 0..warm, true)?;
        let begun = processor_seconds();
        let moved = run(&mut kernel, &mut trace, warm..warm + wanted.count, false)?;
        let each = (processor_seconds() - begun) / wanted.count as f64 * 1e6;
        let times = each / *alone.get_or_insert(each);
        println!(
            "{n:>5} objects, {pieces:>5} pieces: {each:>8.1} us a transition, {times:>6.2} times, {moved} moved"
        );
        drop(model);
    }
    Ok(())
}

/// Runs steps of a kernel. Returns how many of them were accepted.
fn run(
    kernel: &mut dyn Kernel,
    trace: &mut Trace,
    steps: std::ops::Range<u64>,
    adapting: bool,
) -> Result<u64, Box<dyn Error>> {
    let mut moved = 0;
    for step in steps {
        let outcome = kernel
            .step(trace, &StepContext { adapting, ..StepContext::new(1, 0, step) })
            .map_err(|e| e.to_string())?;
        moved += u64::from(outcome.accepted);
    }
    Ok(moved)
}

/// Builds a scene of `n` objects that observes its own picture at the truth, and a trace
/// at the truth.
fn scene(n: usize, wanted: &Wanted) -> Result<(Model, Trace), Box<dyn Error>> {
    let text = program(n, wanted);
    let over = |image: ImageValue, depth: Vec<f32>| {
        let mask = Mask::new(SIZE, SIZE, depth.iter().map(|d| d.is_finite()).collect())?;
        Ok::<_, Box<dyn Error>>(
            Program::parse(&text)?
                .observe("photo", Value::object(image))
                .observe("covered", Value::object(MaskValue::new(mask)))
                .observe("range", Value::object(DepthValue::new(DepthMap::new(SIZE, SIZE, depth)?)))
                .camera(Camera::default_for(SIZE, SIZE))
                .compile()?,
        )
    };
    let grey = Photo::from_rgb(image::RgbImage::new(SIZE, SIZE))?;
    let nothing = ImageValue::contours(ContourMap::new(SIZE, SIZE), Some(grey));
    let mut trace = over(nothing, vec![f32::INFINITY; (SIZE * SIZE) as usize])?.simulate(1, 0)?;
    let truth = trace.constraints();
    let seen = view(&mut trace)?.0;
    let (c, frame) = (seen.contours(SIZE), seen.frame(SIZE));
    let [x, y, tx, ty] = [&c.x, &c.y, &c.tx, &c.ty].map(Clone::clone);
    let strength = vec![1.0; c.len()];
    let map = ContourMap { x, y, tx, ty, strength, ..ContourMap::new(SIZE, SIZE) };
    let photo = Photo::from_rgb(shaded(&frame))?;
    let model = over(ImageValue::contours(map, Some(photo)), frame.depth.clone())?;
    let (trace, _) = Trace::generate(model.code().clone(), truth, draws(), Default::default())?;
    Ok((model, trace))
}

fn draws() -> Draws {
    Draws { key: StreamKey::new(0, 0, Purpose::PREDICT), step: 0, substream: 0 }
}

fn view(trace: &mut Trace) -> Result<ViewValue, Box<dyn Error>> {
    let value = trace.global("view", draws()).ok_or("no view")??;
    value.downcast::<ViewValue>().cloned().ok_or_else(|| "no view".into())
}

/// Returns the program's text. The fixed objects are at random positions in view, and
/// smaller if there are more of them.
fn program(n: usize, wanted: &Wanted) -> String {
    let mut text = String::from(
        "include \"std/scene.pcad\" as scene;\ndata photo: image \"the picture\";\ndata covered = mask();\ndata range = depth();\n",
    );
    let mut random = StreamKey::new(7, 0, Purpose::PREDICT).stream(0, 0, 0);
    let mut things = String::new();
    for i in 1..n {
        let mut between = |low: f64, high: f64| low + (high - low) * random.uniform();
        let size = 0.9 / (n as f64).cbrt();
        let (x, y, z) = (
            between(-1.9, 1.9),
            between(-1.9, 1.9),
            between(-2.0, if wanted.front { -0.5 } else { 1.0 }),
        );
        let turn = [between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)];
        let _ = writeln!(
            things,
            "  {{ kind: {}, at: [{x}, {y}, {z}], turn: {turn:?}, size: {size} }},",
            i % 3
        );
    }
    let members = if wanted.flat {
        "append(map(thing, things), vase)"
    } else {
        "[scene.group(map(thing, things)), vase]"
    };
    let group = if n == 1 { "[vase]" } else { members };
    let _ = writeln!(
        text,
        "let things = [\n{things}];
fn thing(o) {{
  let shape = if o.kind == 0 {{ scene.box(o.size * [1, 1.4, 1]) }} else {{
    if o.kind == 1 {{ scene.sphere(0.7 * o.size, sides = 16) }} else {{
      scene.lathe([{{ y: o.size * [0, 0.5, 1, 1.5], r: o.size * [0.4, 0.6, 0.3, 0.5] }}], sides = 16)
    }}
  }};
  scene.affine(translate = o.at, rotate = o.turn) * shape
}}
for k in [\"x\", \"y\", \"z\"] {{ t[k] ~ normal(0, 0.1) #pose; r[k] ~ normal(0, 0.1) #pose; }}
let ys = linspace(0, 1.2, 20);
let body = scene.lathe([{{ y: ys, r: 0.3 + 0.1 * sin(5 * ys) }}], sides = 48);
let vase = scene.affine(translate = [t.x, t.y - 0.6, t.z], rotate = [r.x, r.y, r.z]) * body;
let view = scene.render(scene.group({group}));"
    );
    for (name, call, seen) in wanted.observe.iter().filter_map(|i| COMPARATORS.get(*i)) {
        let _ = writeln!(text, "observe {call}, size = {SIZE}) = {seen} as {name};");
    }
    text
}
