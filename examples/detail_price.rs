//! What levels of detail save, and what they cost in the score: triangles, time and the mean chamfer distance for several `detail`s.
//!
//!     cargo run --release --example detail_price [-- POSES]
//!
//! A lathe of the language (a new shape each time), the shipped body by its three assets (a new pose each time, skinned anew) and a mesh of
//! 100,352 triangles (placed anew), at 128 and 256 pixels, before POSES (64) random poses that fill half to all of the picture. For each
//! `detail` in pixels: triangles in the picture (median), processor time of an evaluation on one thread (median; making the shape,
//! contours and their mean distance from the contours of the pose before), and how far that distance is from the one with `detail` 0:
//! median, 99th percentile and greatest, in pixels and (greatest) in percent of the diagonal, which is what rho is given in.

mod clock;
#[path = "detail_price/subjects.rs"]
mod subjects;

use clock::processor_seconds;
use pcadlang::geom::Solid;
use pcadlang::render::{Camera, View};
use pcadlang::vision::ContourMap;
use pcadlang::vision::chamfer::{Chamfer, ChamferOptions};
use pcadlang::vision::elements::Elements;
use std::error::Error;
use subjects::Subject;

const DETAILS: [f64; 6] = [0.0, 0.05, 0.1, 0.25, 0.5, 1.0];

fn main() -> Result<(), Box<dyn Error>> {
    let poses: usize = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(64);
    println!("| mesh | pixels | `detail` | triangles | time, µs | off by, px: median | 99 % | most | most, % |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for subject in Subject::all()? {
        for size in [128, 256] {
            let maps: Vec<ContourMap> =
                (0..poses).map(|i| Ok(map(&view(&subject.at(i)?, size, 0.0), size))).collect::<Result<_, Box<dyn Error>>>()?;
            let chamfers = maps
                .iter()
                .map(|m| Chamfer::prepare(m, size, size, &ChamferOptions::default()))
                .collect::<Result<Vec<_>, _>>()?;
            let mut exact = Vec::new();
            for detail in DETAILS {
                let (mut rhos, mut triangles) = (Vec::new(), Vec::new());
                for i in 0..poses {
                    let view = view(&subject.at(i)?, size, detail);
                    rhos.push(rho(&chamfers[(i + poses - 1) % poses], &view, size));
                    triangles.push(view.triangles(size) as f64);
                }
                let mut times = Vec::new();
                for round in 0..9 {
                    let begun = processor_seconds();
                    for i in 0..poses {
                        let solid = subject.at(i + round)?;
                        std::hint::black_box(rho(&chamfers[i], &view(&solid, size, detail), size));
                    }
                    times.push(1e6 * (processor_seconds() - begun) / poses as f64);
                }
                if exact.is_empty() {
                    exact.clone_from(&rhos);
                }
                let off: Vec<f64> = rhos.iter().zip(&exact).map(|(a, b)| (a - b).abs()).collect();
                let pixels = f64::from(size) * 2f64.sqrt() / 100.0;
                println!(
                    "| {} | {size} | {detail} | {:.0} | {:.0} | {:.4} | {:.4} | {:.4} | {:.4} |",
                    subject.name,
                    quantile(&triangles, 0.5),
                    quantile(&times, 0.5),
                    quantile(&off, 0.5) * pixels,
                    quantile(&off, 0.99) * pixels,
                    quantile(&off, 1.0) * pixels,
                    quantile(&off, 1.0),
                );
            }
        }
    }
    Ok(())
}

fn view(solid: &Solid, size: u32, detail: f64) -> View {
    View::with_detail(solid.clone(), Camera::default_for(size, size), detail)
}

/// The mean distance of a view's contours from others, in percent of the diagonal.
fn rho(chamfer: &Chamfer, view: &View, size: u32) -> f64 {
    let c = view.contours(size);
    let elements =
        Elements { x: &c.x, y: &c.y, tx: &c.tx, ty: &c.ty, length: &c.length, width: c.width, height: c.height };
    chamfer.distance(&elements)
}

fn map(view: &View, size: u32) -> ContourMap {
    let c = view.contours(size);
    let (x, y, tx, ty) = (c.x.clone(), c.y.clone(), c.tx.clone(), c.ty.clone());
    ContourMap { x, y, tx, ty, strength: vec![1.0; c.len()], ..ContourMap::new(size, size) }
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(f64::NAN)
}
