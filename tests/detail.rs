//! What levels of detail do to the score, on a lathe, the shipped body and a dense mesh, over fixed poses.
//!
//! Two bounds. Of the contours themselves: their mean distance from those of meshes as they are is at most `detail`, in every pose. Of
//! rho, the mean distance from the contours of another pose: at most three times `detail` in 49 of 50, where `detail` is at most half a
//! pixel. It is a mean over what is seen, so a fold that appears or is hidden counts with its distance from the other contours, not with
//! how far anything moved.

#[path = "../examples/detail_price/subjects.rs"]
mod subjects;

use pcadlang::geom::Solid;
use pcadlang::render::{Camera, Contours, View};
use pcadlang::vision::ContourMap;
use pcadlang::vision::chamfer::{Chamfer, ChamferOptions};
use pcadlang::vision::elements::Elements;
use std::sync::Arc;
use subjects::Subject;

const SIZE: u32 = 128;
const POSES: usize = 50;

fn contours(solid: &Solid, detail: f64) -> Arc<Contours> {
    View::with_detail(solid.clone(), Camera::default_for(SIZE, SIZE), detail).contours(SIZE)
}

/// Mean distances from some contours, in pixels.
fn to(c: &Contours) -> impl Fn(&Contours) -> f64 {
    let (x, y, tx, ty) = (c.x.clone(), c.y.clone(), c.tx.clone(), c.ty.clone());
    let map = ContourMap { x, y, tx, ty, strength: vec![1.0; c.len()], ..ContourMap::new(SIZE, SIZE) };
    let chamfer = Chamfer::prepare(&map, SIZE, SIZE, &ChamferOptions::default()).unwrap();
    let pixels = f64::from(SIZE) * 2f64.sqrt() / 100.0;
    move |c| {
        let elements =
            Elements { x: &c.x, y: &c.y, tx: &c.tx, ty: &c.ty, length: &c.length, width: c.width, height: c.height };
        chamfer.distance(&elements) * pixels
    }
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
                // Contours are kept as a grid of distances, so those of a pose from themselves are not quite 0.
                own.push(distances[i](&c) - distances[i](&exact[i]));
                off.push((other(&c) - other(&exact[i])).abs());
            }
            [&mut own, &mut off].into_iter().for_each(|list| list.sort_by(f64::total_cmp));
            let (own, off) = (own[POSES - 1] / detail, off[POSES * 99 / 100 - 1] / detail);
            report += &format!("{} {detail}: contours {own:.3}, rho {off:.3} of it\n", subject.name);
            assert!(own <= 1.0 && off <= 3.0, "{report}");
        }
    }
    println!("{report}");
}
