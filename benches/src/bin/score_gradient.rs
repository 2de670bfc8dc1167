//! Does the gradient of a picture's score point where the score rises? For random poses
//! of a lathe and of a body, scored against the contours of another pose: the cosine
//! between the gradient and central differences of half a pixel each way, and the cost of
//! a gradient.
//!
//! `cargo run --release -p pcadlang-benches --bin score_gradient -- [POSES] [LIKELIHOOD]`, such as
//! `200 "scene.contour(view)"`
//!
//! Each coordinate is scaled so that it moves its part of the surface by half a pixel in
//! the picture.

use pcadlang::{Model, Program};
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::{Change, Draws, Selector, Target, Trace};
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_scene::render::Camera;
use pcadlang_scene::vision::ContourMap;
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

const SIZE: u32 = 128;

const LATHE: &str = "
    assume turn ~ iid(normal(0, 0.5), 3);
    assume at ~ iid(normal(0, 0.3), 3);
    assume size ~ lognormal(0, 0.15);
    assume profile ~ gp(mean = 0, cov = sq_exp(0.6, 0.3), at = linspace(-1, 1, 9));
    let vase = scene.lathe({ y: linspace(-1, 1, 9), r: 0.5 * exp(profile) });
    let solid = scene.affine(translate = at, rotate = turn, scale = size) * vase;";

const BODY: &str = "
    data body = armature(\"std/human/human.lod2.rig.json\");
    assume pose ~ iid(normal(0, 0.3), 66);
    assume at ~ iid(normal(0, 0.2), 3);
    assume turn ~ iid(normal(0, 0.4), 3);
    assume size ~ lognormal(0.6, 0.1);
    let solid = scene.affine(translate = at, rotate = turn, scale = size)
        * scene.affine(translate = [0, -0.9, 0]) * scene.skin(body, pose);";

fn draws() -> Draws {
    Draws { key: StreamKey::new(0, 0, Purpose::VALUES), step: 0, substream: 0 }
}

fn compile(scene: &str, likelihood: &str, map: ContourMap) -> Result<Model> {
    let text = format!(
        "include \"std/scene.pcad\" as scene; data photo: image; {scene} let view = scene.render(solid);
         observe {likelihood} = photo as picture;"
    );
    let image = Value::object(ImageValue::contours(map, None));
    Ok(Program::parse(&text)?
        .observe("photo", image)
        .camera(Camera::default_for(SIZE, SIZE))
        .compile()?)
}

fn view(trace: &mut Trace) -> Option<ViewValue> {
    trace.global("view", draws())?.ok()?.downcast::<ViewValue>().cloned()
}

/// Samples a draw from the prior that lies within the picture. Returns it with its
/// contours.
fn draw(model: &Model, seed: u64) -> Result<Option<(Trace, ContourMap)>> {
    for attempt in 0..200 {
        let mut trace = model.simulate(seed, attempt)?;
        let Some(view) = view(&mut trace) else { return Ok(None) };
        let c = view.0.contours(SIZE);
        let inside = |v: &[f32]| v.iter().all(|x| (2.0..SIZE as f32 - 2.0).contains(x));
        if c.total_length() > 60.0 && inside(&c.x) && inside(&c.y) {
            let map = ContourMap::of(&c.slice());
            return Ok(Some((trace, map)));
        }
    }
    Ok(None)
}

/// A trace and its unconstrained coordinates.
struct System {
    trace: Trace,
    targets: Vec<Target>,
    sizes: Vec<usize>,
    at: Vec<f64>,
}

impl System {
    fn new(mut trace: Trace) -> System {
        let selection = trace.select(&Selector::All);
        let targets = trace.targets(selection).to_vec();
        let own: Vec<Vec<f64>> =
            targets.iter().map(|t| trace.free(*t).map_or(Vec::new(), |f| f.0)).collect();
        System { trace, targets, sizes: own.iter().map(Vec::len).collect(), at: own.concat() }
    }

    fn go(&mut self, y: &[f64]) -> f64 {
        let mut from = 0;
        let part = |(t, n): (&Target, &usize)| {
            from += n;
            (*t, Change::Free(y[from - n..from].to_vec()))
        };
        let changes: Vec<(Target, Change)> =
            self.targets.iter().zip(&self.sizes).map(part).collect();
        if self.trace.propose(&changes, draws()).is_err() {
            return f64::NAN;
        }
        self.trace.commit();
        self.trace.log_likelihood()
    }

    fn moved(&mut self, i: usize, by: f64) -> f64 {
        let mut y = self.at.clone();
        y[i] += by;
        self.go(&y)
    }

    /// Returns the gradient of the log likelihood.
    fn gradient(&self) -> Result<Vec<f64>> {
        let (mut all, mut prior) = (Vec::new(), Vec::new());
        for (power, out) in [(1.0, &mut all), (0.0, &mut prior)] {
            self.trace.gradient(&self.targets, power, out).map_err(|e| e.message.clone())?;
        }
        Ok(all.iter().zip(&prior).map(|(a, b)| a - b).collect())
    }

    /// Returns the positions of the surface's vertices in the picture.
    fn seen(&mut self) -> Vec<[f64; 2]> {
        let Some(view) = view(&mut self.trace) else { return Vec::new() };
        let camera = view.0.camera().scaled_to(SIZE);
        let at = |p| {
            let (x, y, _) = camera.project(p);
            [x, y]
        };
        view.0.solid().vertices().map(at).collect()
    }

    /// Returns the step of each coordinate that moves the surface by half a pixel.
    fn halves(&mut self) -> Vec<f64> {
        let (here, small, count) = (self.seen(), 1e-3, self.at.len());
        let half = |i: usize| {
            self.moved(i, small);
            let there = self.seen();
            // The mean over the vertices, weighted by their movement: one hand counts as
            // much as the whole body.
            let squares =
                here.iter().zip(&there).map(|(a, b)| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2));
            let (fourth, square) = squares.fold((0.0, 0.0), |(f, s), d| (f + d * d, s + d));
            0.5 * small / (fourth / square).sqrt()
        };
        (0..count).map(half).collect()
    }
}

fn cosine(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

fn quartiles(mut all: Vec<f64>) -> [f64; 3] {
    all.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|q| all.get((q * all.len() as f64) as usize).copied().unwrap_or(f64::NAN))
}

fn main() -> Result<()> {
    let poses: u64 = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(200);
    let likelihood =
        std::env::args().nth(2).unwrap_or(format!("scene.chamfer(view, sigma = 1, size = {SIZE})"));
    println!(
        "{likelihood}: cosine with differences of half a pixel (quartiles), cost of a gradient in evaluations of the score"
    );
    for (name, scene) in [("lathe", LATHE), ("body", BODY)] {
        let blank = compile(scene, &likelihood, ContourMap::new(SIZE, SIZE))?;
        let (mut cosines, mut scores, mut gradients, mut coordinates) =
            (Vec::new(), Vec::new(), Vec::new(), 0);
        for case in 0..poses {
            let Some((_, map)) = draw(&blank, case)? else { continue };
            let Some((pose, _)) = draw(&blank, case + 100_000)? else { continue };
            let model = compile(scene, &likelihood, map)?;
            let rebuilt = Trace::generate(
                std::sync::Arc::clone(model.code()),
                pose.constraints(),
                draws(),
                Default::default(),
            );
            let Ok((trace, _)) = rebuilt else { continue };
            let mut s = System::new(trace);
            coordinates = s.at.len();
            let halves = s.halves();
            let (up, down): (Vec<f64>, Vec<f64>) =
                (0..coordinates).map(|i| (s.moved(i, halves[i]), s.moved(i, -halves[i]))).unzip();
            let differences: Vec<f64> = up.iter().zip(&down).map(|(a, b)| a - b).collect();
            let away: Vec<f64> = s.at.iter().zip(&halves).map(|(y, h)| y + h).collect();
            let here = s.at.clone();
            // All coordinates change, so everything is rendered.
            let start = Instant::now();
            s.go(&away);
            s.go(&here);
            scores.push(start.elapsed().as_secs_f64() / 2.0);
            let mut found = Vec::new();
            let start = Instant::now();
            s.trace.gradient(&s.targets, 1.0, &mut found).map_err(|e| e.message.clone())?;
            gradients.push(start.elapsed().as_secs_f64());
            let slopes: Vec<f64> =
                s.gradient()?.iter().zip(&halves).map(|(g, h)| g * 2.0 * h).collect();
            cosines.push(cosine(&slopes, &differences));
        }
        let (n, [low, mid, high]) = (cosines.len(), quartiles(cosines));
        let [_, score, _] = quartiles(scores);
        let [_, gradient, _] = quartiles(gradients);
        println!(
            "{name:5}  {n} poses, {coordinates} coordinates  {low:.3} {mid:.3} {high:.3}  {:.2} ms / {:.2} ms = {:.2}",
            1e3 * gradient,
            1e3 * score,
            gradient / score
        );
    }
    Ok(())
}
