//! Benchmarks of comparators, and of loading an observation: one evaluation of each
//! comparator for a picture of a lathe and the photograph, at 128 and 512 pixels; and, at
//! 512 pixels, every step from the file to prepared comparators.
//!
//!     cargo bench -p pcadlang-benches --bench compare -- "prepare" --quick

mod common;

use common::{photograph, picture, pose, short, vase};
use criterion::{Criterion, criterion_group, criterion_main};
use pcadlang_scene::render::{Camera, Channels, Contours, Frame};
use pcadlang_scene::vision::features::{Query, contour_features, observed, rendered};
use pcadlang_scene::vision::{
    Chamfer, ChamferOptions, ContourMap, ContourRatio, ContourRatioOptions, DepthLikelihood,
    DepthMap, GradientDetector, Limits, Mask, MaskLikelihood, Region, RegionOptions, chamfer,
    contour_ratio, distance_transform, gradient, photo,
};
use std::hint::black_box;

/// The side of the loaded picture, in pixels.
const SIDE: u32 = 512;

/// Returns the kinds of chamfer comparators.
fn chamfers() -> [(&'static str, ChamferOptions); 3] {
    let plain = ChamferOptions::default();
    [
        ("plain", plain.clone()),
        ("oriented", ChamferOptions { oriented: Some(1.0), ..plain.clone() }),
        ("symmetric", ChamferOptions { symmetric: true, ..plain }),
    ]
}

/// Returns the region comparator without and with its shading term.
fn regions() -> [(&'static str, RegionOptions); 2] {
    let colours = RegionOptions::default();
    [
        ("colours", colours.clone()),
        ("colours and shading", RegionOptions { shading: 0.05, ..colours }),
    ]
}

/// Measures comparators of contours.
fn contours(c: &mut Criterion) {
    let map = GradientDetector::default().contours(&photograph(SIDE));
    for size in [128, SIDE] {
        let contours =
            Contours::of(&vase().placed(pose(&mut 0.0)), &Camera::default_for(size, size));
        let elements = contours.slice();
        for (name, options) in chamfers() {
            let chamfer = Chamfer::prepare(&map, size, size, &options).expect("a chamfer");
            let mut scratch = chamfer::Scratch::default();
            c.bench_function(&format!("score/chamfer {name} at {size}"), |b| {
                b.iter(|| chamfer.log_likelihood_with(black_box(&elements), &mut scratch))
            });
        }
        let ratio = ContourRatio::prepare(&map, size, size, &ContourRatioOptions::default())
            .expect("a ratio");
        let mut scratch = contour_ratio::Scratch::default();
        c.bench_function(&format!("score/contour ratio at {size}"), |b| {
            b.iter(|| ratio.log_likelihood_with(black_box(&elements), &mut scratch))
        });
        let query = Query::contours(&observed(&map));
        c.bench_function(&format!("score/features at {size}"), |b| {
            b.iter(|| query.distance(&contour_features(&rendered(black_box(&elements)))))
        });
    }
}

/// Measures comparators of pixels.
fn pixels(c: &mut Criterion) {
    let photo = photograph(SIDE);
    for size in [128, SIDE] {
        let frame = Frame::render(
            &vase().placed(pose(&mut 0.0)),
            &Camera::default_for(size, size),
            Channels::All,
        );
        let seen: Vec<bool> = frame.mask().collect();
        let groups: Vec<u8> = seen.iter().copied().map(u8::from).collect();
        for (name, options) in regions() {
            let region = Region::prepare(&photo, size, size, &options).expect("a region");
            c.bench_function(&format!("score/region, {name} at {size}"), |b| {
                b.iter(|| region.log_likelihood(black_box(&groups), &frame.normal))
            });
        }
        let depth = DepthMap::new(size, size, frame.depth.clone()).expect("a depth map");
        let depth = DepthLikelihood::new(&depth, 0.05, 0.05, (0.1, 100.0)).expect("a likelihood");
        c.bench_function(&format!("score/depth at {size}"), |b| {
            b.iter(|| depth.log_likelihood(black_box(&frame.depth), size, size))
        });
        let mask = Mask::new(size, size, seen.clone()).expect("a mask");
        let mask = MaskLikelihood::new(&mask, 0.02, 0.02).expect("a likelihood");
        c.bench_function(&format!("score/mask at {size}"), |b| {
            b.iter(|| mask.log_likelihood(black_box(&seen), size, size))
        });
    }
}

/// Measures the steps from a file to contours.
fn load(c: &mut Criterion) {
    let file = std::fs::read(picture("skier.jpg")).expect("a file");
    c.bench_function("load/decode 344 x 425", |b| {
        b.iter(|| photo::decode(black_box(&file), &Limits::default()))
    });
    let photo = photograph(SIDE);
    c.bench_function("load/linear light", |b| b.iter(|| photo.linear(SIDE, SIDE)));
    let linear = photo.linear(SIDE, SIDE).rgb;
    c.bench_function("load/gradient", |b| {
        b.iter(|| gradient::colour_gradient(SIDE, SIDE, black_box(&linear), 1.6))
    });
    let slopes = gradient::colour_gradient(SIDE, SIDE, &linear, 1.6);
    c.bench_function("load/maxima", |b| b.iter(|| gradient::suppress(black_box(&slopes), 0.0)));
    let fine = GradientDetector { size: SIDE, ..GradientDetector::default() };
    for (size, detector) in [(256, GradientDetector::default()), (SIDE, fine)] {
        c.bench_function(&format!("load/detect at {size}"), |b| {
            b.iter(|| detector.contours(black_box(&photo)))
        });
    }
    let drawn = fine.contours(&photo).to_image();
    c.bench_function("load/contour map", |b| b.iter(|| ContourMap::from_image(black_box(&drawn))));
}

/// Measures the steps from contours, or the photograph, to comparators.
fn prepare(c: &mut Criterion) {
    let photo = photograph(SIDE);
    let map = GradientDetector::default().contours(&photo);
    let fine = GradientDetector { size: SIDE, ..GradientDetector::default() };
    let set: Vec<bool> = fine.contours(&photo).to_image().pixels().map(|p| p.0[0] > 0).collect();
    c.bench_function("prepare/distance transform", |b| {
        b.iter(|| distance_transform(SIDE, SIDE, black_box(&set)))
    });
    for (name, options) in chamfers() {
        c.bench_function(&format!("prepare/chamfer {name}"), |b| {
            b.iter(|| Chamfer::prepare(black_box(&map), SIDE, SIDE, &options))
        });
    }
    let options = ContourRatioOptions::default();
    c.bench_function("prepare/contour ratio", |b| {
        b.iter(|| ContourRatio::prepare(black_box(&map), SIDE, SIDE, &options))
    });
    for (name, options) in regions() {
        c.bench_function(&format!("prepare/region, {name}"), |b| {
            b.iter(|| Region::prepare(black_box(&photo), SIDE, SIDE, &options))
        });
    }
    c.bench_function("prepare/features", |b| {
        b.iter(|| Query::contours(&observed(black_box(&map))))
    });
}

criterion_group! { name = benches; config = short(); targets = contours, pixels, load, prepare }
criterion_main!(benches);
