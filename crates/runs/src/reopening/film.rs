//! `pcadlang film`: the way of a run from the prior to the posterior, over the photograph,
//! and the best state turning.

use crate::args::Film;
use crate::failure::{Failure, plain};
use crate::files;
use crate::inputs::{self, Ready};
use crate::reopening::reopened::Reopened;
use crate::scene;
use glam::{DMat3, DVec3};
use image::RgbImage;
use pcadlang_engine::trace::SavedTrace;
use pcadlang_inference::TrajectoryState;
use pcadlang_report::film::{FilmFrame, apng};
use pcadlang_report::pictures::png;
use pcadlang_scene::geom::{Solid, glb};
use pcadlang_scene::render::{Camera, View};
use pcadlang_workbench::session::Layer;
use std::sync::Arc;
use std::time::Instant;

/// How long a state is shown, the first and the last one, and a picture of the turn, in
/// milliseconds.
const STATE: u16 = 90;
const FIRST: u16 = 800;
const LAST: u16 = 1200;
const TURN: u16 = 70;
/// The pictures of one turn, and of the change from the photograph to the scene alone.
const TURNS: u32 = 36;
const FADE: u32 = 4;

/// Writes the film of a run, and prints its name.
pub fn film(a: &Film) -> Result<(), Failure> {
    write(a)?;
    print_line!("{}", a.out.display());
    Ok(())
}

/// Writes the film of a run.
pub fn write(a: &Film) -> Result<(), Failure> {
    let run = Reopened::open(&a.run)?;
    let ready = inputs::prepare_program(run.program()?, &run.job, Instant::now())?;
    let states = way(&run, a.states as usize)?;
    match a.out.extension().and_then(|e| e.to_str()) {
        Some("glb") => files::write(&a.out, &animation(&run, &ready, &states)?)?,
        Some("png") => {
            let frames = frames(&run, &ready, &states, a)?;
            // What does not play shows the best state, which is the last of the way.
            let best = states.len().checked_sub(1).and_then(|last| frames.get(last));
            let still = best.ok_or_else(|| plain("the run kept no states"))?;
            files::write(&a.out, &apng(&frames, &still.picture).map_err(plain)?)?;
        }
        None => {
            std::fs::create_dir_all(&a.out)
                .map_err(|e| plain(format!("{}: {e}", a.out.display())))?;
            for (i, f) in frames(&run, &ready, &states, a)?.iter().enumerate() {
                let bytes = png(&f.picture).map_err(|e| plain(e.to_string()))?;
                files::write(&a.out.join(format!("frame-{i:04}.png")), &bytes)?;
            }
        }
        Some(_) => {
            let said = format!("{}: the file name must end in .png or .glb", a.out.display());
            let hint = "a name without an ending is a folder for one PNG file per picture";
            return Err(Failure::Plain(said, Some(hint.into())));
        }
    }
    Ok(())
}

/// Returns the states of the chain that ended best, at most `most`, and the best state.
fn way(run: &Reopened, most: usize) -> Result<Vec<SavedTrace>, Failure> {
    let all = run.trajectory()?;
    let mut states = best_chain(&all);
    let every = states.len().div_ceil(most.max(1)).max(1);
    states = states.into_iter().step_by(every).collect();
    let mut states: Vec<SavedTrace> = states.into_iter().map(|s| s.trace.clone()).collect();
    states.push(run.best()?);
    Ok(states)
}

/// Returns the states of the chain whose last state has the highest log joint density.
pub fn best_chain(all: &[TrajectoryState]) -> Vec<&TrajectoryState> {
    let mut last: Vec<&TrajectoryState> = Vec::new();
    for s in all {
        match last.last_mut().filter(|l| l.chain == s.chain) {
            Some(l) => *l = s,
            None => last.push(s),
        }
    }
    let best = last.iter().max_by(|a, b| a.log_joint.total_cmp(&b.log_joint)).map(|s| s.chain);
    all.iter().filter(|s| Some(s.chain) == best).collect()
}

fn view_of(run: &Reopened, ready: &Ready, saved: &SavedTrace) -> Result<Arc<View>, Failure> {
    let mut trace = run.trace(&ready.model, saved)?;
    let draws = scene::predictive(run.job.sampling.seed, 0);
    scene::view(&mut trace, draws, None).ok_or_else(|| plain("the program has no view"))
}

/// Returns the states as an animation of meshes.
fn animation(run: &Reopened, ready: &Ready, states: &[SavedTrace]) -> Result<Vec<u8>, Failure> {
    let solids: Result<Vec<Solid>, Failure> =
        states.iter().map(|s| Ok(view_of(run, ready, s)?.solid_in_files())).collect();
    glb::write_animation(&solids?, f64::from(STATE) / 1000.0)
        .map_err(|e| plain(format!("cannot make an animation: {e}")))
}

fn frames(
    run: &Reopened,
    ready: &Ready,
    states: &[SavedTrace],
    a: &Film,
) -> Result<Vec<FilmFrame>, Failure> {
    let drawn = |layer: Layer, view: &Arc<View>, image| layer.draw(view, image, &[], a.size);
    let mut frames = Vec::new();
    let mut best = None;
    for saved in states {
        let view = view_of(run, ready, saved)?;
        let picture = drawn(Layer::Overlay, &view, ready.image())?;
        let milliseconds = if frames.is_empty() { FIRST } else { STATE };
        frames.push(FilmFrame { picture, milliseconds });
        best = Some(view);
    }
    let (Some(view), Some(last)) = (best, frames.last_mut()) else { return Ok(frames) };
    last.milliseconds = LAST;
    if a.no_turn {
        return Ok(frames);
    }
    let (over, alone) = (last.picture.clone(), drawn(Layer::Scene, &view, None)?);
    for i in 1..=FADE {
        let picture = between(&over, &alone, i as f32 / FADE as f32);
        frames.push(FilmFrame { picture, milliseconds: TURN });
    }
    for i in 1..=TURNS {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(TURNS);
        let turned = Arc::new(View::new(view.solid().clone(), turned(&view, angle)));
        let picture = drawn(Layer::Scene, &turned, None)?;
        frames.push(FilmFrame { picture, milliseconds: TURN });
    }
    Ok(frames)
}

/// Mixes two pictures of one size.
fn between(a: &RgbImage, b: &RgbImage, share: f32) -> RgbImage {
    let mut out = a.clone();
    for (p, q) in out.pixels_mut().zip(b.pixels()) {
        for (x, y) in p.0.iter_mut().zip(q.0) {
            *x = (f32::from(*x) * (1.0 - share) + f32::from(y) * share).round() as u8;
        }
    }
    out
}

/// Returns the camera of a view, gone around the scene by an angle, about what is up in
/// the picture.
fn turned(view: &View, angle: f64) -> Camera {
    let camera = *view.camera();
    let centre = view.solid().bounds().map_or(DVec3::ZERO, |b| b.centre());
    let by = DMat3::from_axis_angle(camera.up, angle);
    Camera {
        eye: centre + by * (camera.eye - centre),
        right: by * camera.right,
        forward: by * camera.forward,
        ..camera
    }
}
