//! Tapes of scenes: poses, shapes, placements, landmarks and pictures, and choices stored
//! as white noise, compared with the traces from which they were recorded.

use crate::common::tape::{TapeReport, compare_tape};
use pcadlang::{Model, Program};

/// Compares tape and trace at draws from the prior, and sums what was found.
fn told(model: &Model, draws: u64, what: &str) -> TapeReport {
    let mut all = TapeReport { recorded: true, ..TapeReport::default() };
    for seed in 0..draws {
        let Ok(mut trace) = model.simulate(seed, 0) else { continue };
        let one = compare_tape(&mut trace, what);
        all.recorded &= one.recorded;
        (all.points, all.asked, all.moved) =
            (all.points + one.points, all.asked + one.asked, all.moved + one.moved);
    }
    all
}

fn shipped(name: &str, given: &[(&str, &str)], set: &[(&str, &str)]) -> Model {
    let program = Program::open(name).unwrap_or_else(|e| panic!("{e}"));
    let program = set.iter().fold(program, |p, (name, x)| p.set(name, x));
    let observed = |p: Program, (data, file): &(&str, &str)| {
        let path = format!("{}/examples/images/{file}", env!("CARGO_MANIFEST_DIR"));
        p.observe_file(data, &path).unwrap_or_else(|e| panic!("{e}"))
    };
    given.iter().fold(program, observed).compile().unwrap_or_else(|e| panic!("{e}"))
}

const SKIER: (&str, &str) = ("photo", "skier.jpg");
const JOINTS: (&str, &str) = ("points", "skier.keypoints.json");

/// The mixture of poses, the shape, the placement and the joints of the shipped program.
#[test]
fn a_body_with_joints() {
    let found = told(&shipped("human.pcad", &[SKIER, JOINTS], &[]), 3, "human.pcad with joints");
    assert!(found.recorded && found.points >= 30 && found.moved >= 20, "{found:?}");
}

/// The same with the depths and the mask that the detector finds.
#[test]
fn a_body_with_joints_depths_and_mask() {
    let found = told(&shipped("human.pcad", &[SKIER], &[]), 2, "human.pcad");
    assert!(found.recorded && found.points >= 20 && found.moved >= 12, "{found:?}");
}

#[test]
fn a_lathe_with_a_picture() {
    for likelihood in [
        "scene.chamfer(view, sigma = 1, size = 64) = photo",
        "scene.chamfer(view, sigma = s, symmetric = true, size = 64) = photo",
        "scene.contour(view, size = 64) = photo",
        "scene.region(view, size = 64) = photo",
    ] {
        let text = format!(
            "include \"std/scene.pcad\" as scene;
             data photo: image \"the photograph\";
             assume s ~ lognormal(0, 0.3);
             assume f ~ gp(mean = 0, cov = sq_exp(0.2, 0.4), at = linspace(0, 1, 8));
             assume x ~ normal(0, 0.3);
             assume tilt ~ normal(0, 0.2);
             let profile = {{ y: linspace(0, 2, 8), r: 0.6 * exp(f) }};
             assume object = scene.affine(translate = [x, 0, 0], rotate = [tilt, 0, 0])
               * scene.lathe(profile, sides = 20);
             assume view = scene.render(object);
             observe {likelihood};"
        );
        let path = format!("{}/examples/images/table_lamp.png", env!("CARGO_MANIFEST_DIR"));
        let program = Program::parse(&text).unwrap_or_else(|e| panic!("{e}"));
        let program = program.observe_file("photo", &path).unwrap_or_else(|e| panic!("{e}"));
        let model = program.compile().unwrap_or_else(|e| panic!("{e}"));
        let found = told(&model, 2, likelihood);
        assert!(found.recorded && found.points >= 20 && found.moved >= 12, "{found:?}");
    }
}

/// The noise moves, and so do the parameters that give it its mean and covariance.
#[test]
fn white_noise_with_parameters_that_move() {
    for program in [
        "assume m ~ normal(0, 1);
         assume f ~ gp(mean = m, cov = sq_exp(1, 0.5), at = [0, 0.3, 1]);
         observe normal(f, 0.5) = [0.2, -0.3, 1];",
        "assume l ~ lognormal(0, 0.3); assume s ~ lognormal(0, 0.3);
         assume f ~ gp(mean = 0, cov = sq_exp(s, l), at = [0, 0.3, 1]);
         observe normal(f, 0.5) = [0.2, -0.3, 1];",
        "assume m ~ normal(0, 1); assume c ~ normal(0, 1);
         assume v ~ mv_normal([m, 0.5], chol = [[1, 0], [c, 2]], whitened = true);
         observe normal(v[0] * v[1], 1) = 0.5;",
        "assume a ~ lognormal(0, 0.3);
         assume v ~ mv_normal([0, 1], cov = [[a + 1, 0.5], [0.5, 2]], whitened = true);
         assume w ~ mv_normal(v, cov = [[1, 0], [0, 1]]);
         observe normal(w, 1) = [0.5, 0];",
    ] {
        let model = Model::from_text(program).unwrap_or_else(|e| panic!("{e}"));
        let found = told(&model, 3, program);
        assert!(found.recorded && found.points >= 30 && found.moved >= 20, "{found:?}");
    }
}
