//! Does the true outline score higher than wrong ones? For each picture of
//! `../shared/data/objects`, the outline of the true mask is compared with 2,000 random
//! lathe outlines, and with the best of them after hill climbing that must stay away from
//! the truth. The intersection over union of a wrong outline and the true mask is less
//! than 0.7. Prints a table and the time of an evaluation.

mod canny;
mod lathe;
mod outline;

use lathe::{Lathe, Numbers};
use outline::{Outline, overlap};
use pcadlang_scene::vision::ContourSlice;
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions, Scratch};
use pcadlang_scene::vision::contour_ratio::{self, ContourRatio, ContourRatioOptions};
use std::time::Instant;

type Score = Box<dyn FnMut(&ContourSlice<'_>) -> f64>;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .join(std::env::args().nth(1).unwrap_or("../shared/data/objects".into()));
    let mut cases: Vec<_> =
        std::fs::read_dir(folder)?.filter_map(|e| Some(e.ok()?.path())).collect();
    cases.retain(|c| c.join("mask.png").exists() && c.join("image.png").exists());
    cases.sort();
    let full = std::env::args().nth(2).is_some();
    let mut wins: Vec<(String, usize, usize, f64)> = Vec::new();
    for case in &cases {
        let mask = image::open(case.join("mask.png"))?.into_luma8();
        let size = mask.width() as usize;
        let truth: Vec<bool> = mask.pixels().map(|p| p.0[0] > 127).collect();
        let map = canny::detect(&image::open(case.join("image.png"))?.into_rgb8());
        let true_outline = Outline::of(&truth, size);
        let mut numbers = Numbers(7);
        let mut wrong = Vec::new();
        while wrong.len() < 2000 {
            let lathe = Lathe::draw(&mut numbers);
            let mask = lathe.mask(size);
            if mask.iter().filter(|m| **m).count() > 400 && overlap(&mask, &truth) < 0.7 {
                wrong.push((Outline::of(&mask, size), lathe));
            }
        }
        print!(
            "{:14} {:5} edges",
            case.file_name().unwrap_or_default().to_string_lossy(),
            map.x.len()
        );
        for (i, (name, mut score)) in comparators(&map, size as u32, full)?.into_iter().enumerate()
        {
            let own = score(&true_outline.elements());
            let clock = Instant::now();
            let mut order: Vec<(f64, usize)> =
                wrong.iter().enumerate().map(|(i, w)| (score(&w.0.elements()), i)).collect();
            let micros = clock.elapsed().as_secs_f64() * 1e6 / 2000.0;
            order.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut climbed = f64::MIN;
            for &(start, at) in order.iter().take(4) {
                let (mut best, mut lathe) = (start, wrong[at].1.clone());
                for _ in 0..250 {
                    let next = lathe.changed(&mut numbers);
                    let mask = next.mask(size);
                    if mask.iter().filter(|m| **m).count() > 400 && overlap(&mask, &truth) < 0.7 {
                        let s = score(&Outline::of(&mask, size).elements());
                        if s > best {
                            (best, lathe) = (s, next);
                        }
                    }
                }
                climbed = climbed.max(best);
            }
            print!(" | {own:.1} {:.1} {climbed:.1}", order[0].0);
            if wins.len() <= i {
                wins.push((name, 0, 0, 0.0));
            }
            wins[i].1 += usize::from(own > order[0].0);
            wins[i].2 += usize::from(own > climbed);
            wins[i].3 += micros / cases.len() as f64;
        }
        println!();
    }
    println!(
        "truth beats: the best of 2,000 random wrong outlines; the best after climbing (of {})",
        cases.len()
    );
    for (name, random, climbed, micros) in wins {
        println!("{name:40} {random:3} {climbed:3}   {micros:.0} us an evaluation");
    }
    Ok(())
}

fn comparators(
    map: &pcadlang_scene::vision::ContourMap,
    size: u32,
    full: bool,
) -> Result<Vec<(String, Score)>, Box<dyn std::error::Error>> {
    let mut all: Vec<(String, Score)> = Vec::new();
    let chamfer = |name: &str,
                   o: ChamferOptions|
     -> Result<(String, Score), Box<dyn std::error::Error>> {
        let c = Chamfer::prepare(map, size, size, &o)?;
        let mut scratch = Scratch::default();
        Ok((
            name.to_string(),
            Box::new(move |e: &ContourSlice<'_>| c.log_likelihood_with(e, &mut scratch)) as Score,
        ))
    };
    let ratio = |name: &str,
                 o: ContourRatioOptions|
     -> Result<(String, Score), Box<dyn std::error::Error>> {
        let c = ContourRatio::prepare(map, size, size, &o)?;
        let mut scratch = contour_ratio::Scratch::default();
        Ok((
            name.to_string(),
            Box::new(move |e: &ContourSlice<'_>| c.log_likelihood_with(e, &mut scratch)) as Score,
        ))
    };
    let (co, ro) = (ChamferOptions::default, ContourRatioOptions::default);
    all.push(chamfer("one-sided chamfer", co())?);
    all.push(chamfer("symmetric chamfer", ChamferOptions { symmetric: true, ..co() })?);
    all.push(ratio("contour ratio", ro())?);
    if full {
        all.push(chamfer("oriented chamfer", ChamferOptions { oriented: Some(2.0), ..co() })?);
        all.push(ratio("ratio, window 0.5", ContourRatioOptions { window: 0.5, ..ro() })?);
        all.push(ratio("ratio, whole picture", ContourRatioOptions { window: 2.0, ..ro() })?);
        all.push(ratio("ratio, credit 1", ContourRatioOptions { credit: 1.0, ..ro() })?);
        all.push(ratio("ratio, credit unlimited", ContourRatioOptions { credit: 1e6, ..ro() })?);
        all.push(ratio("ratio, foreground 0.9", ContourRatioOptions { foreground: 0.9, ..ro() })?);
        all.push(ratio("ratio, sd 0.25", ContourRatioOptions { sd: 0.25, ..ro() })?);
        all.push(ratio("ratio, sd 0.6", ContourRatioOptions { sd: 0.6, ..ro() })?);
    }
    Ok(all)
}
