//! The effect of levels of detail on the score, for a lathe, the shipped body and a dense
//! mesh, over fixed poses.
//!
//! There are two bounds. For the contours themselves, the mean distance from those of the
//! full meshes is at most `detail`, in every pose. For rho, the mean distance from the
//! contours of another pose, the change is at most three times `detail` in 49 of 50
//! poses, where `detail` is at most half a pixel. Rho is a mean over the visible
//! contours, so a fold that appears or is hidden counts with its distance from the other
//! contours, not with the distance that anything moved.

use crate::subjects;
use pcadlang_scene::geom::Solid;
use pcadlang_scene::render::{Camera, Contours, View};
use pcadlang_scene::vision::ContourMap;
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions};
use std::sync::Arc;
use subjects::Subject;

const SIZE: u32 = 128;
const POSES: usize = 50;

fn contours(solid: &Solid, detail: f64) -> Arc<Contours> {
    View::with_detail(solid.clone(), Camera::default_for(SIZE, SIZE), detail).contours(SIZE)
}

/// Returns a function for the mean distance from these contours, in pixels.
fn to(c: &Contours) -> impl Fn(&Contours) -> f64 {
    let map = ContourMap::of(&c.slice());
    let chamfer = Chamfer::prepare(&map, SIZE, SIZE, &ChamferOptions::default()).unwrap();
    let pixels = f64::from(SIZE) * 2f64.sqrt() / 100.0;
    move |c| chamfer.distance(&c.slice()) * pixels
}

#[test]
fn the_score_is_off_by_no_more_than_the_detail_allows() {
    let mut report = String::new();
    for subject in Subject::all().unwrap() {
        let solids: Vec<Solid> = (0..POSES).map(|i| subject.at(i).unwrap()).collect();
        let exact: Vec<_> = solids.iter().map(|s| contours(s, 0.0)).collect();
        let distances: Vec<_> = exact.iter().map(|c| to(c)).collect();
        for detail in [0.1, 0.25, 0.5] {
            let (mut own, mut off) = (Vec::new(), Vec::new());
            for i in 0..POSES {
                let c = contours(&solids[i], detail);
                let other = &distances[(i + 1) % POSES];
                // The observed contours are kept as a grid of distances, so the distance
                // of a pose from itself is not exactly 0.
                own.push(distances[i](&c) - distances[i](&exact[i]));
                off.push((other(&c) - other(&exact[i])).abs());
            }
            [&mut own, &mut off].into_iter().for_each(|list| list.sort_by(f64::total_cmp));
            let (own, off) = (own[POSES - 1] / detail, off[POSES * 99 / 100 - 1] / detail);
            report +=
                &format!("{} {detail}: contours {own:.3}, rho {off:.3} of it\n", subject.name);
            assert!(own <= 1.0 && off <= 3.0, "{report}");
        }
    }
    println!("{report}");
}

/// Three balls with a vase in front: the level depends on the state only, not on what was
/// drawn before or on which thread.
#[test]
fn the_level_depends_on_the_state_and_not_on_the_way_there() {
    use pcadlang_engine::lang::value::Value;
    use pcadlang_engine::trace::{Draws, Trace};
    use pcadlang_library::scene::{ImageValue, ViewValue};
    let text = "include \"std/scene.pcad\" as scene;
         data photo: image \"contours\";
         for k in [\"x\", \"z\"] { t[k] ~ uniform(-12, 4); }
         let balls = map(fn(x) { scene.affine(translate = [x, 0.6, -1]) * scene.sphere(0.5) }, [-1, 0.1, 1]);
         let ys = linspace(0, 1.2, 20);
         let vase = scene.affine(translate = [t.x, 0, t.z]) * scene.lathe([{ y: ys, r: 0.3 + 0.1 * sin(5 * ys) }]);
         assume view = scene.render(scene.group([scene.group(balls), vase]), detail = 0.5);
         observe scene.contour(view) = photo;";
    let circle = (0..200).map(|i| f64::from(i) * std::f64::consts::TAU / 200.0);
    let point =
        |f: fn(f64) -> f64, r: f32| circle.clone().map(|a| r * f(a) as f32).collect::<Vec<f32>>();
    let (x, y) = (point(f64::cos, 30.0), point(f64::sin, 30.0));
    let [x, y] = [x, y].map(|v| v.into_iter().map(|v| v + 64.0).collect());
    let [tx, ty] = [point(f64::sin, 1.0), point(f64::cos, -1.0)];
    let map = ContourMap { x, y, tx, ty, strength: vec![1.0; 200], ..ContourMap::new(SIZE, SIZE) };
    let image = Value::object(ImageValue::contours(map, None));
    let model = pcadlang::Program::parse(text)
        .and_then(|p| p.observe("photo", image).camera(Camera::default_for(SIZE, SIZE)).compile())
        .unwrap_or_else(|e| panic!("{e}"));
    // The depth sets the level: each path ends at `place`, from far away and from near.
    let at = |trace: &mut Trace, [x, z]: [f64; 2]| {
        for (address, value) in [("@t[x]", x), ("@t[z]", z)] {
            trace.set(address, value, Draws::default()).unwrap();
        }
        let view = trace.global("view", Draws::default()).unwrap().unwrap();
        let view = &view.downcast::<ViewValue>().unwrap().0;
        (trace.log_joint().to_bits(), view.triangles(SIZE), view.contours(SIZE).as_ref().clone())
    };
    let place = [0.2, 0.5];
    let direct = std::thread::scope(|s| {
        s.spawn(|| at(&mut model.simulate(1, 0).unwrap(), place)).join().unwrap()
    });
    let mut trace = model.simulate(2, 0).unwrap();
    let mut levels = Vec::new();
    for way in [
        vec![[0.0, -12.0]],
        vec![[0.1, 3.0], [0.2, 2.9]],
        vec![[-9.0, 0.5], [0.2, 0.6], [0.21, 0.6]],
    ] {
        for step in way {
            levels.push(at(&mut trace, step).1);
        }
        assert_eq!(at(&mut trace, place), direct);
    }
    levels.sort_unstable();
    levels.dedup();
    assert!(levels.len() >= 3, "other levels were drawn on the way: {levels:?}");
}
