//! Measures how well objects are found in photographs with known masks, given boxes or axes.
//!
//!     cargo run --release -p pcadlang-benches --bin segmentation -- FOLDER...
//!
//! A folder holds `image.png` and the ground truth `mask.png`. Prints for each folder the
//! intersection over union of the first guess by each method, of the best of all guesses and
//! of the one that agrees best with the other methods, how much that agrees, all given the
//! exact box of the mask, and the processor seconds of each method; then the means, medians
//! and numbers of at least 0.8, also for boxes with sides that are off by up to 8 % of the
//! size and for the mask's axis with ends and width that are off by up to 3 % of the length,
//! five for each photograph.

#[path = "clock/mod.rs"]
mod clock;

use clock::processor_seconds;
use pcadlang_scene::vision::segmentation::{Guess, Method, from_mask, guesses};
use pcadlang_scene::vision::{AxisHint, Hint, Limits, Mask, mask, photo};
use std::path::{Path, PathBuf};

const NAMES: [&str; 6] = ["ellipse", "cut", "symmetric", "best", "most", "agreed"];
/// How far sides of boxes are off, as a part of the size, and axes, as a part of the length;
/// and the number of both per photograph.
const OFF: f64 = 0.08;
const AXIS_OFF: f64 = 0.03;
const TRIED: u64 = 5;

/// A number in -1..1 that is the same each time.
fn noise(seed: u64) -> f64 {
    let x = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((x ^ x >> 29) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The overlaps by name, and the score of the guess with the highest one.
fn overlaps(all: &[Guess], truth: &Mask) -> [f64; NAMES.len()] {
    let of = |g: &Guess| truth.overlap(&g.mask);
    let first = |m: Method| all.iter().find(|g| g.method == m).map_or(0.0, of);
    let top = all.iter().reduce(|a, b| if b.score > a.score { b } else { a });
    [
        first(Method::Ellipse),
        first(Method::Cut),
        first(Method::Symmetric),
        all.iter().map(of).fold(0.0, f64::max),
        top.map_or(0.0, of),
        top.map_or(0.0, |g| g.score),
    ]
}

fn summary(name: &str, all: &[[f64; NAMES.len()]]) {
    for (k, method) in NAMES.iter().enumerate() {
        let mut values: Vec<f64> = all.iter().map(|o| o[k]).collect();
        values.sort_by(f64::total_cmp);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let found = values.iter().filter(|v| **v >= 0.8).count();
        let median = values[values.len() / 2];
        println!("{name:12} {method:10} {mean:.3} {median:.3} {found:3} of {}", values.len());
    }
}

fn look(folder: &Path) -> Result<[Vec<[f64; NAMES.len()]>; 3], String> {
    let read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| e.to_string());
    let (limits, image, truth) = (Limits::default(), read("image.png")?, read("mask.png")?);
    let photo = photo::decode(&image, &limits).map_err(|e| e.to_string())?;
    let truth = mask::decode(&truth, None, &limits).map_err(|e| e.to_string())?;
    let [x0, y0, x1, y1] = truth.bounds().ok_or("an empty mask")?;
    let hint = |off: [f64; 4]| {
        let (w, h) = (x1 - x0, y1 - y0);
        let (left, right) = (x0 + OFF * w * off[0], x1 + OFF * w * off[1]);
        let (top, bottom) = (y0 + OFF * h * off[2], y1 + OFF * h * off[3]);
        Hint { bounds: Some([left, top, right - left, bottom - top]), ..Hint::default() }
    };
    let look = |hint: &Hint| overlaps(&guesses(&photo, hint, &Method::ALL), &truth);
    let [a, b, c, d, e, f] = look(&hint([0.0; 4]));
    let seconds = Method::ALL.map(|method| {
        let start = processor_seconds();
        guesses(&photo, &hint([0.0; 4]), &[method]);
        processor_seconds() - start
    });
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    println!("{name:30} {a:.3} {b:.3} {c:.3}  {d:.3} {e:.3} {f:.3}  {seconds:.3?}");
    let off = |n: u64| std::array::from_fn(|k| noise(4 * n + k as u64));
    let loose = (0..TRIED).map(|n| look(&hint(off(n)))).collect();
    let axis = from_mask(&photo, &truth).into_iter().next().ok_or("the mask is empty")?;
    let length = (axis.top[0] - axis.foot[0]).hypot(axis.top[1] - axis.foot[1]);
    let width = 2.0 * axis.widths.iter().copied().fold(0.0, f64::max);
    let near = |n: u64| {
        let off = |k: u64| AXIS_OFF * length * noise(1000 + 5 * n + k);
        let foot = [axis.foot[0] + off(0), axis.foot[1] + off(1)];
        let top = [axis.top[0] + off(2), axis.top[1] + off(3)];
        let axis = AxisHint { foot, top, width: (width + off(4)).max(1.0) };
        look(&Hint { axis: Some(axis), ..Hint::default() })
    };
    Ok([vec![[a, b, c, d, e, f]], loose, (0..TRIED).map(near).collect()])
}

fn main() -> Result<(), String> {
    let folders: Vec<PathBuf> = std::env::args().skip(1).map(PathBuf::from).collect();
    if folders.is_empty() {
        return Err("usage: segmentation FOLDER...".into());
    }
    println!("{:30} ellip cut   symm   best  most  agreed [seconds]", "");
    let mut all = [const { Vec::new() }; 3];
    for folder in &folders {
        all.iter_mut().zip(look(folder)?).for_each(|(all, new)| all.extend(new));
    }
    for (name, all) in ["exact", "off by 8 %", "axis"].iter().zip(&all) {
        summary(name, all);
    }
    Ok(())
}
