//! Recovery of known poses: people are drawn from the prior of `human.pcad`, and their
//! own clean contours are observed. How far are the inferred joints from the ground
//! truth, and how often do 90 % intervals contain it?
//!
//! `cargo run --release -p pcadlang-benches --bin pose_recovery -- [CASES] [SECONDS] [PARAMETER=VALUE…]`

mod known_truth;

use known_truth::{SIZE, argument, compile, draw, global, quantile, score, sorted};
use pcadlang::{Model, RunOptions};
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_inference::Callback;
use pcadlang_library::scene::ViewValue;
use pcadlang_scene::vision::ContourMap;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const LIMBS: [&str; 6] = ["shoulder", "elbow", "wrist", "hip", "knee", "ankle"];

/// Joints by name: x and y in pixels, and z, towards the camera, in scene units.
type Joints = BTreeMap<Arc<str>, [f64; 3]>;

fn over(map: ContourMap) -> Result<Model, pcadlang::Error> {
    compile("human.pcad", &[("sigma", "0.1"), ("truncate", "20")], map)
}

fn joints(trace: &mut Trace) -> Joints {
    let value = global(trace, "view");
    let Some(view) = value.downcast::<ViewValue>() else { return Joints::new() };
    let depth = view.0.solid().landmarks().iter().map(|l| l.position.z);
    let all = view.landmarks(SIZE, SIZE).zip(depth);
    all.filter_map(|((name, at), z)| at.map(|[x, y]| (Arc::clone(name), [x, y, z]))).collect()
}

/// The joints of all draws.
#[derive(Debug, Default)]
struct Seen(Mutex<Vec<Joints>>);

impl Callback for Seen {
    fn draw(&self, _chain: u32, trace: &mut Trace, _draws: Draws) {
        let joints = joints(trace);
        if let Ok(mut all) = self.0.lock() {
            all.push(joints);
        }
    }
}

/// Exchanges left and right if that is closer to the ground truth: the contours of a body
/// from behind are nearly those from the front.
fn either_way(seen: &Joints, truth: &Joints) -> Joints {
    let exchanged: Joints = seen
        .iter()
        .map(|(name, at)| match (name.strip_prefix("l_"), name.strip_prefix("r_")) {
            (Some(rest), _) => (Arc::from(format!("r_{rest}")), *at),
            (_, Some(rest)) => (Arc::from(format!("l_{rest}")), *at),
            _ => (Arc::clone(name), *at),
        })
        .collect();
    let far = |j: &Joints| {
        let apart =
            |(name, at): (&Arc<str>, &[f64; 3])| truth.get(name).map_or(0.0, |t| apart(at, t));
        j.iter().map(apart).sum::<f64>()
    };
    if far(&exchanged) < far(seen) { exchanged } else { seen.clone() }
}

/// Returns the distance of two joints in the picture.
fn apart(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn mean(v: &[f64]) -> f64 {
    v.iter().sum::<f64>() / v.len() as f64
}

fn main() -> Result<(), pcadlang::Error> {
    let (cases, seconds) = (argument(1, 20), argument(2, 30));
    let blank = over(ContourMap::new(SIZE, SIZE))?;
    println!(
        "Errors of medians in the picture, in percent of the torso; with left and right as they fit better; and of depth"
    );
    println!("behind the pelvis.");
    println!(
        "case  {}    all  exchanged  depth  within 20 %  held by 90 %  R-hat  log joint, best (truth)",
        LIMBS.map(|l| format!("{l:>8}")).concat()
    );
    let mut all_errors: Vec<Vec<f64>> = vec![Vec::new(); LIMBS.len()];
    let (mut held, mut asked, mut depths, mut all_exchanged) = (0, 0, Vec::new(), Vec::new());
    for case in 0..cases {
        let (mut t, map) = draw(&blank, case)?;
        let truth = joints(&mut t);
        let model = over(map)?;
        let score = score(&model, &t);
        let seen = Arc::new(Seen::default());
        let options = RunOptions {
            seed: case + 1,
            time: Some(Duration::from_secs(seconds)),
            callback: Some(Arc::clone(&seen) as Arc<dyn Callback>),
            ..RunOptions::default()
        };
        let posterior = model.run(&options, 4, 2)?;
        let drawn = seen.0.lock().map(|mut all| std::mem::take(&mut *all)).unwrap_or_default();
        let at = |name: &str| truth.get(name).copied().unwrap_or([f64::NAN; 3]);
        let torso =
            0.5 * (apart(&at("l_shoulder"), &at("r_hip")) + apart(&at("r_shoulder"), &at("l_hip")));
        let nearer: Vec<Joints> = drawn.iter().map(|j| either_way(j, &truth)).collect();
        let mut exchanged = Vec::new();
        // Scene units per pixel in the plane z = 0, which is accurate enough for results
        // in percent.
        let unit = 4.4 / f64::from(SIZE);
        let mut by_limb = Vec::new();
        let (mut case_held, mut case_asked) = (0, 0);
        let mut case_depths = Vec::new();
        for (limb, errors) in LIMBS.iter().zip(&mut all_errors) {
            let mut both = Vec::new();
            for side in ["l_", "r_"] {
                let name = format!("{side}{limb}");
                let of = |f: &dyn Fn(&Joints) -> Option<f64>| {
                    sorted(drawn.iter().filter_map(f).collect())
                };
                let pixels = [0, 1].map(|i| of(&|j: &Joints| j.get(name.as_str()).map(|p| p[i])));
                let behind = |j: &Joints| Some(j.get(name.as_str())?[2] - j.get("pelvis")?[2]);
                let depth = of(&behind);
                let (true_at, true_depth) = (at(&name), behind(&truth).unwrap_or(f64::NAN));
                let error = [0, 1].map(|i| quantile(&pixels[i], 0.5) - true_at[i]);
                both.push(error[0].hypot(error[1]) / torso);
                let near = |i: usize| {
                    let all = nearer.iter().filter_map(|j| j.get(name.as_str()).map(|p| p[i]));
                    quantile(&sorted(all.collect()), 0.5)
                };
                exchanged.push(apart(&[near(0), near(1), 0.0], &true_at) / torso);
                case_depths.push((quantile(&depth, 0.5) - true_depth).abs() / unit / torso);
                for (v, x) in
                    [(&pixels[0], true_at[0]), (&pixels[1], true_at[1]), (&depth, true_depth)]
                {
                    case_asked += 1;
                    case_held += usize::from((quantile(v, 0.05)..=quantile(v, 0.95)).contains(&x));
                }
            }
            by_limb.push(mean(&both));
            errors.extend(both);
        }
        (held, asked) = (held + case_held, asked + case_asked);
        let own: Vec<f64> =
            all_errors.iter().flat_map(|e| e[e.len() - 2..].iter().copied()).collect();
        let within = own.iter().filter(|e| **e <= 0.2).count();
        let worst = posterior.quantities().iter().map(|q| q.summary.r_hat).fold(0.0, f64::max);
        let best = posterior
            .chains
            .iter()
            .filter_map(|c| c.best.as_ref().map(|b| b.0))
            .fold(f64::NEG_INFINITY, f64::max);
        println!(
            "{case:4}  {}  {:5.1}  {:9.1}  {:5.1}     {within:2} of {:2}      {case_held:2} of {case_asked:2}  {worst:5.2}  {best:8.1} ({score:.1})",
            by_limb.iter().map(|e| format!("{:8.1}", 100.0 * e)).collect::<String>(),
            100.0 * mean(&own),
            100.0 * mean(&exchanged),
            100.0 * mean(&case_depths),
            own.len(),
        );
        depths.extend(case_depths);
        all_exchanged.extend(exchanged);
    }
    for (name, q) in [("half", 0.5), ("3/4 ", 0.75)] {
        let by_limb =
            all_errors.iter().map(|e| format!("{:8.1}", 100.0 * quantile(&sorted(e.clone()), q)));
        let all = sorted(all_errors.concat());
        println!(
            "{name}  {}  {:5.1}  {:9.1}  {:5.1}",
            by_limb.collect::<String>(),
            100.0 * quantile(&all, q),
            100.0 * quantile(&sorted(all_exchanged.clone()), q),
            100.0 * quantile(&sorted(depths.clone()), q)
        );
    }
    let all = all_errors.concat();
    let within = all.iter().filter(|e| **e <= 0.2).count();
    let near = all_exchanged.iter().filter(|e| **e <= 0.2).count();
    println!(
        "{within} of {} joints within 20 % of the torso, {near} with left and right as they fit better; 90 % intervals hold {held} of {asked} values",
        all.len()
    );
    Ok(())
}
