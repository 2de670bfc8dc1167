//! Measures the savings of levels of detail and their effect on the score: triangles,
//! time and the mean chamfer distance for several values of `detail`.
//!
//!     cargo run --release -p pcadlang-benches --bin detail_price [-- POSES]
//!
//! The subjects are a lathe of the language (a new shape each time), the shipped body in
//! its three levels of detail (a new pose each time, skinned again) and a mesh of 100,352
//! triangles (placed again), at 128 and 256 pixels, in POSES (64) random poses that fill
//! half to all of the picture. The columns, for each `detail` in pixels: triangles in the
//! picture (median); processor time of an evaluation on one thread (making the shape,
//! contours, and their mean distance from those of another pose; mean of 512, the best of
//! three); the mean distance of contours from those with `detail` 0 (maximum); and the
//! change of rho, the mean distance from the contours of another pose, from its value
//! with `detail` 0: median, 99th percentile, maximum. Distances are in pixels, except in
//! the last column, which is in percent of the diagonal, like rho.

mod clock;
#[path = "detail_price/subjects.rs"]
mod subjects;

use clock::processor_seconds;
use pcadlang_scene::geom::Solid;
use pcadlang_scene::render::{Camera, View};
use pcadlang_scene::vision::ContourMap;
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions};
use std::error::Error;
use subjects::Subject;

const DETAILS: [f64; 6] = [0.0, 0.05, 0.1, 0.25, 0.5, 1.0];

fn main() -> Result<(), Box<dyn Error>> {
    let poses: usize = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(64);
    println!(
        "| mesh | pixels | `detail` | triangles | µs | contours off | rho off: median | 99 % | most | most, % |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for subject in Subject::all()? {
        let begun = processor_seconds();
        view(&subject.at(0)?, 128, 1e-3).triangles(128);
        eprintln!("{}: levels in {:.2} s", subject.name, processor_seconds() - begun);
        for size in [128, 256] {
            measure(&subject, size, poses)?;
        }
    }
    Ok(())
}

fn measure(subject: &Subject, size: u32, poses: usize) -> Result<(), Box<dyn Error>> {
    let mut chamfers = Vec::new();
    for i in 0..poses {
        let seen = map(&view(&subject.at(i)?, size, 0.0), size);
        chamfers.push(Chamfer::prepare(&seen, size, size, &ChamferOptions::default())?);
    }
    // The distances from the contours of the same pose and of another pose.
    let (mut exact_own, mut exact) = (Vec::new(), Vec::new());
    for detail in DETAILS {
        let (mut own, mut rhos, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..poses {
            let view = view(&subject.at(i)?, size, detail);
            own.push(rho(&chamfers[i], &view, size));
            rhos.push(rho(&chamfers[(i + 1) % poses], &view, size));
            triangles.push(view.triangles(size) as f64);
        }
        let mut best = f64::INFINITY;
        for round in 0..3 {
            let begun = processor_seconds();
            for i in 0..512 {
                let solid = subject.at(i + round)?;
                std::hint::black_box(rho(&chamfers[i % poses], &view(&solid, size, detail), size));
            }
            best = best.min(1e6 * (processor_seconds() - begun) / 512.0);
        }
        if exact.is_empty() {
            (exact_own, exact) = (own.clone(), rhos.clone());
        }
        let off = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect::<Vec<f64>>()
        };
        let (own, off) = (off(&own, &exact_own), off(&rhos, &exact));
        let pixels = f64::from(size) * 2f64.sqrt() / 100.0;
        println!(
            "| {} | {size} | {detail} | {:.0} | {best:.0} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} |",
            subject.name,
            quantile(&triangles, 0.5),
            quantile(&own, 1.0) * pixels,
            quantile(&off, 0.5) * pixels,
            quantile(&off, 0.99) * pixels,
            quantile(&off, 1.0) * pixels,
            quantile(&off, 1.0),
        );
    }
    Ok(())
}

fn view(solid: &Solid, size: u32, detail: f64) -> View {
    View::with_detail(solid.clone(), Camera::default_for(size, size), detail)
}

/// Returns the mean distance of a view's contours from others, in percent of the
/// diagonal.
fn rho(chamfer: &Chamfer, view: &View, size: u32) -> f64 {
    let c = view.contours(size);
    chamfer.distance(&c.slice())
}

fn map(view: &View, size: u32) -> ContourMap {
    ContourMap::of(&view.contours(size).slice())
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(f64::NAN)
}
