//! Measures a change of one joint of the shipped body: skinning and contours at 128
//! pixels, for each joint, in comparison with a full redraw.
//!
//!     cargo run --release -p pcadlang-benches --bin joint_speed -- [LOD [JOINT]]     (such as human.lod2 hand_l; all if left out)
//!
//! Prints medians of processor-bound wall time on one thread, alternating between full
//! drawings and joints. Only ratios within one run are meaningful; single times depend on
//! the machine.

mod shipped;

use glam::DVec3;
use pcadlang_scene::geom::armature::{JointPose, Rules};
use pcadlang_scene::geom::{Affine, GeomError};
use pcadlang_scene::render::{Camera, View};
use std::cell::RefCell;
use std::time::Instant;

fn median(mut xs: Vec<f64>) -> f64 {
    xs.sort_by(f64::total_cmp);
    xs.get(xs.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() -> Result<(), GeomError> {
    const REPEATS: usize = 201;
    let camera = Camera::default_for(128, 128);
    let place =
        Affine::new(DVec3::new(0.0, -1.8, 0.0), DVec3::new(0.05, 0.5, 0.0), DVec3::splat(2.1));
    let rules = Rules::default();
    let args: Vec<String> = std::env::args().skip(1).collect();
    let chosen = |i: usize, name: &str| args.get(i).is_none_or(|wanted| wanted == name);
    for lod in ["human.lod2", "human.lod1", "human"].into_iter().filter(|lod| chosen(0, lod)) {
        let body = shipped::human(lod)?;
        let joints = body.rig().joints();
        let (solid, posed) = body.posed_after(&[], &rules, None)?;
        let state = RefCell::new((posed, View::new(solid.placed(place), camera)));
        // As in a trace: each pose starts from the one before.
        let draw = |pose: &[JointPose]| -> Result<f64, GeomError> {
            let begun = Instant::now();
            let (solid, posed) = body.posed_after(pose, &rules, Some(&state.borrow().0))?;
            let view = View::new(solid.placed(place), camera).after(&state.borrow().1);
            std::hint::black_box(view.contours(128).len());
            state.replace((posed, view));
            Ok(begun.elapsed().as_secs_f64() * 1e6)
        };
        // The rotation differs slightly each time, so that no cached result can be used.
        let time = |joint: usize, from: usize, times: &mut Vec<f64>| -> Result<(), GeomError> {
            let mut pose = vec![JointPose::REST; joints.len()];
            for k in from..from + REPEATS {
                pose[joint] =
                    JointPose::turned(DVec3::new(0.1, 0.05, 0.02) * (1.0 + k as f64 * 1e-3));
                times.push(draw(&pose)?);
            }
            Ok(())
        };
        let wanted: Vec<usize> =
            (0..joints.len()).filter(|j| chosen(1, &joints[*j].name)).collect();
        // The root moves every part, which is a full redraw.
        let (mut full, mut each) = (Vec::new(), vec![Vec::new(); wanted.len()]);
        for (i, (joint, times)) in wanted.iter().zip(&mut each).enumerate() {
            time(0, i * REPEATS, &mut full)?;
            time(*joint, 0, times)?;
        }
        let full = median(full);
        println!("{lod}: {} triangles, full redraw {full:.0} us", body.triangles().len());
        let all: Vec<f64> = each.into_iter().map(median).collect();
        for (j, t) in wanted.iter().zip(&all) {
            println!("  {:<12} {t:>6.0} us  {:>5.1} times less", joints[*j].name, full / t);
        }
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        println!(
            "  a joint at random: {mean:.0} us, {:.1} times less than a full redraw",
            full / mean
        );
        let ends = ["hand_l", "hand_r", "foot_l", "foot_r", "head"];
        let ends: Vec<f64> = wanted
            .iter()
            .zip(&all)
            .filter(|(j, _)| ends.contains(&&*joints[**j].name))
            .map(|(_, t)| full / t)
            .collect();
        println!("  hands, feet and head: {:.1} times less (median)", median(ends));
    }
    Ok(())
}
