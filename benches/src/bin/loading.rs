//! Measures loading an observation at 512 x 512 pixels, stage by stage, on the two
//! shipped photographs and on one with added noise.
//!
//!     cargo run --release -p pcadlang-benches --bin loading [-- digest]
//!
//! Prints milliseconds of this thread's processor time and of wall time. The oriented
//! chamfer and the contour ratio use additional threads, whose time only the wall time
//! includes (`taskset -c 0` measures a single core). With `digest`, each line also has a
//! hash of every bit of the result, to check whether two versions agree.

mod clock;

use clock::processor_seconds;
use image::imageops::{FilterType, resize};
use image::{DynamicImage, GrayImage, Luma, RgbImage};
use pcadlang_scene::vision::chamfer::{Chamfer, ChamferOptions};
use pcadlang_scene::vision::features::{Query, observed};
use pcadlang_scene::vision::{
    ContourMap, ContourRatio, ContourRatioOptions, DepthMap, GradientDetector, Limits, Mask, Photo,
    Region, RegionOptions, distance_transform, gradient, photo,
};
use std::error::Error;
use std::fmt::Debug;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::time::Instant;

const SIDE: u32 = 512;
/// The duration in seconds for which runs of a stage are timed together, because the
/// resolution of processor time is some milliseconds.
const TOGETHER: f64 = 0.03;

/// Runs a stage many times and prints the mean time, the smaller of two.
fn stage<T: Debug>(picture: &str, name: &str, digest: bool, mut run: impl FnMut() -> T) {
    let (mut processor, mut wall) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..2 {
        let (begun, clock) = (processor_seconds(), Instant::now());
        let mut runs = 0.0;
        while clock.elapsed().as_secs_f64() < TOGETHER {
            std::hint::black_box(run());
            runs += 1.0;
        }
        processor = processor.min(1e3 * (processor_seconds() - begun) / runs);
        wall = wall.min(1e3 * clock.elapsed().as_secs_f64() / runs);
    }
    let sum = match digest {
        true => {
            let mut hash = DefaultHasher::new();
            format!("{:?}", run()).hash(&mut hash);
            format!("  {:016x}", hash.finish())
        }
        false => String::new(),
    };
    println!("{picture:<8} {name:<34} {processor:>8.2} {wall:>8.2}{sum}");
}

fn main() -> Result<(), Box<dyn Error>> {
    let digest = std::env::args().any(|a| a == "digest");
    println!("{:<43} {:>8} {:>8}", "", "proc. ms", "wall ms");
    for (name, file) in [("cup", "coffee_cup.png"), ("skier", "skier.jpg"), ("noise", "skier.jpg")]
    {
        let file = format!("{}/../examples/images/{file}", env!("CARGO_MANIFEST_DIR"));
        let bytes = std::fs::read(file)?;
        let whole = photo::decode(&bytes, &Limits::default())?;
        let mut rgb = resize(whole.rgb(), SIDE, SIDE, FilterType::Triangle);
        if name == "noise" {
            noisy(&mut rgb);
        } else {
            stage(name, "file decoded (its own size)", digest, || {
                photo::decode(&bytes, &Limits::default()).ok()
            });
        }
        picture(name, &Photo::from_rgb(rgb)?, digest)?;
    }
    Ok(())
}

/// Changes every byte by up to 60 in either direction, so that there are edges
/// everywhere.
fn noisy(rgb: &mut RgbImage) {
    let mut seed = 1u64;
    for v in rgb.iter_mut() {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        *v = (i32::from(*v) + ((seed >> 33) % 121) as i32 - 60).clamp(0, 255) as u8;
    }
}

fn picture(name: &str, photo: &Photo, digest: bool) -> Result<(), Box<dyn Error>> {
    let stage = |what: &str, run: Work<'_>| stage(name, what, digest, run);
    stage("linear light", &mut || Box::new(photo.linear(SIDE, SIDE)));
    let linear = photo.linear(SIDE, SIDE).rgb;
    stage("gradient of three channels", &mut || {
        Box::new(gradient::colour_gradient(SIDE, SIDE, &linear, 1.6))
    });
    let slopes = gradient::colour_gradient(SIDE, SIDE, &linear, 1.6);
    stage("maxima", &mut || Box::new(gradient::suppress(&slopes, 0.0)));
    let fine = GradientDetector { size: SIDE, ..GradientDetector::default() };
    for (size, detector) in [(256, GradientDetector::default()), (SIDE, fine)] {
        stage(&format!("detector at {size}"), &mut || Box::new(detector.contours(photo)));
        let map = detector.contours(photo);
        compare(&format!("{size}"), &map, &stage);
    }
    let map = fine.contours(photo);
    let drawn = map.to_image();
    stage("contour map from a picture", &mut || Box::new(ContourMap::from_image(&drawn)));
    let grey: GrayImage = DynamicImage::from(photo.rgb().clone()).to_luma8();
    let soft = GrayImage::from_fn(SIDE, SIDE, |i, j| Luma([255 - grey.get_pixel(i, j).0[0]]));
    stage("contour map from a grey photograph", &mut || Box::new(ContourMap::from_image(&soft)));
    let set: Vec<bool> = drawn.pixels().map(|p| p.0[0] > 0).collect();
    stage("distance transform", &mut || Box::new(distance_transform(SIDE, SIDE, &set)));
    stage("contour features", &mut || Box::new(Query::contours(&observed(&map))));
    for (what, options) in [
        ("region", RegionOptions::default()),
        ("region, 256 colours", RegionOptions { colours: 256, ..RegionOptions::default() }),
        ("region with shading", RegionOptions { shading: 0.05, ..RegionOptions::default() }),
    ] {
        stage(what, &mut || Box::new(Region::prepare(photo, SIDE, SIDE, &options)));
    }
    let mask = Mask::new(SIDE, SIDE, set)?;
    stage("mask, to 256", &mut || Box::new(mask.resized(256, 256)));
    let depth = DepthMap::new(SIDE, SIDE, grey.pixels().map(|p| f32::from(p.0[0])).collect())?;
    stage("depth, to 256", &mut || Box::new(depth.resized(256, 256)));
    Ok(())
}

/// A timed stage, which returns its result.
type Work<'a> = &'a mut dyn FnMut() -> Box<dyn Debug>;

/// Measures the preparation of contour comparators, for frames of 512 pixels.
fn compare(from: &str, map: &ContourMap, stage: &dyn Fn(&str, Work<'_>)) {
    let plain = ChamferOptions::default();
    for (what, options) in [
        ("chamfer", plain.clone()),
        ("chamfer, symmetric", ChamferOptions { symmetric: true, ..plain.clone() }),
        ("chamfer, oriented", ChamferOptions { oriented: Some(1.0), ..plain }),
    ] {
        stage(&format!("{what}, map of {from}"), &mut || {
            Box::new(Chamfer::prepare(map, SIDE, SIDE, &options))
        });
    }
    let options = ContourRatioOptions::default();
    stage(&format!("contour ratio, map of {from}"), &mut || {
        Box::new(ContourRatio::prepare(map, SIDE, SIDE, &options))
    });
}
