//! Tests of boxes from outputs made by hand, and with the included network of photographs.

use super::boxes::{best, decode};
use super::sample::Placed;
use super::{BINS, CLASSES, FoundObject, ObjectFinder, ObjectOptions, View};
use pcadlang_scene::vision::{Limits, Photo, photo};

/// Outputs of all strides without an object, and with equal probabilities of all distances.
fn outputs() -> [[Vec<f32>; 2]; 3] {
    [52, 26, 13].map(|n| [vec![0.0; n * n * CLASSES.len()], vec![0.0; n * n * 4 * BINS]])
}

/// Makes distance `bin` of a side certain.
fn certain(sides: &mut [f32], cell: usize, side: usize, bin: usize) {
    sides[(cell * 4 + side) * BINS + bin] = 100.0;
}

fn decoded(outputs: &[[Vec<f32>; 2]; 3], least: f64) -> Vec<FoundObject> {
    let grids = [0, 1, 2].map(|k| [&outputs[k][0][..], &outputs[k][1][..]]);
    // Half a sample to a pixel across, a whole one down.
    let placed = Placed {
        input: [416; 2],
        origin: [0; 2],
        samples: [350, 400],
        size: [700.0, 400.0],
        mirrored: false,
    };
    decode(&grids, &placed, least)
}

#[test]
fn boxes_are_distances_from_cells() {
    let mut all = outputs();
    // Row 2, column 3 of the grid with stride 16: its centre is at samples 55.5 and 39.5.
    let cell = 2 * 26 + 3;
    all[1][0][cell * CLASSES.len() + 41] = 0.75;
    for (side, bin) in [(0, 1), (1, 2), (2, 3), (3, 10)] {
        certain(&mut all[1][1], cell, side, bin);
    }
    // Equal probabilities: 5 strides of 32 on every side, around 15.5.
    all[2][0][0] = 0.5;
    let found = decoded(&all, 0.4);
    let near = |a: [f64; 4], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
    assert_eq!((found.len(), found[0].name(), found[0].score), (2, "cup", 0.75));
    assert!(near(found[0].bounds, [79.0, 7.5, 207.0, 199.5]), "{:?}", found[0]);
    assert_eq!((found[1].name(), found[1].score), ("person", 0.5));
    assert!(near(found[1].bounds, [0.0, 0.0, 351.0, 175.5]), "clipped: {:?}", found[1]);
    assert_eq!(decoded(&all, 0.5).len(), 2);
    assert_eq!(decoded(&all, 0.6).len(), 1);
    // Outputs that are no numbers are no objects.
    all[1][1][cell * 4 * BINS] = f32::NAN;
    all[2][0][0] = f32::NAN;
    assert!(decoded(&all, 0.0).iter().all(|o| o.score == 0.0));
}

#[test]
fn the_best_of_overlapping_boxes_of_a_class_is_kept() {
    let object = |left: f64, class: usize, score: f64| FoundObject {
        bounds: [left, 0.0, left + 10.0, 10.0],
        class,
        score,
    };
    // Intersections over union with the first one: 7/13, 8/12, 1.
    let all =
        vec![object(0.0, 0, 0.9), object(3.0, 0, 0.8), object(2.0, 0, 0.7), object(0.0, 1, 0.6)];
    assert_eq!(best(all.clone(), 9), [all[0], all[1], all[3]]);
    assert_eq!(best(all.clone(), 1), [all[0]]);
}

fn example(name: &str) -> Photo {
    let path = format!("{}/../../examples/images/{name}", env!("CARGO_MANIFEST_DIR"));
    photo::decode(&std::fs::read(path).unwrap(), &Limits::default()).unwrap()
}

fn found(photo: &Photo) -> Vec<FoundObject> {
    seen(photo, View::WHOLE)
}

fn seen(photo: &Photo, view: View) -> Vec<FoundObject> {
    let options = ObjectOptions::default();
    ObjectFinder::included().find_in_views(photo, &[view], &options).unwrap()
}

#[test]
fn objects_are_found_in_photographs() {
    let near = |a: [f64; 4], b: [f64; 4], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() < by);
    let skier = found(&example("skier.jpg"))[0];
    assert!(skier.name() == "person" && skier.score > 0.8, "{skier:?}");
    // From glove to boot and from hat to boot, as read off the picture.
    assert!(near(skier.bounds, [62.0, 44.0, 277.0, 392.0], 12.0), "{skier:?}");
    let all = found(&example("coffee_cup.png"));
    let cup = all.iter().find(|o| o.name() == "cup").unwrap();
    // Without its handle.
    assert!(near(cup.bounds, [92.0, 9.0, 219.0, 146.0], 15.0), "{cup:?}");
    assert!(all.windows(2).all(|w| w[0].score >= w[1].score));
}

#[test]
fn every_view_has_its_boxes_in_the_photograph() {
    let photo = example("skier.jpg");
    for (part, mirrored) in [(1.0, true), (0.6, false), (0.6, true)] {
        let skier = seen(&photo, View { part, mirrored })[0];
        let wanted = [62.0, 44.0, 277.0, 392.0];
        let near = skier.bounds.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 20.0);
        assert!(skier.name() == "person" && near, "{part} {mirrored}: {skier:?}");
    }
}

#[test]
fn nothing_is_found_where_there_is_nothing() {
    let plain = |width, height, rgb| {
        Photo::from_rgb(image::RgbImage::from_pixel(width, height, image::Rgb(rgb))).unwrap()
    };
    for photo in [plain(300, 200, [128; 3]), plain(1, 1, [0; 3]), plain(16_000, 3, [90, 20, 200])] {
        assert_eq!(found(&photo), []);
    }
}

#[test]
fn a_network_for_something_else_is_refused() {
    let (json, weights) = crate::nn::tests::graph::small().files();
    let refused = |model, weights| {
        let photo = Photo::from_rgb(image::RgbImage::new(9, 9)).unwrap();
        let finder = ObjectFinder::new(model, weights);
        let found = finder.find_in_views(&photo, &[View::WHOLE], &ObjectOptions::default());
        found.unwrap_err().to_string()
    };
    let other = refused(json.leak(), weights.leak());
    assert!(other.contains("it is not a detector of objects"), "{other}");
    let swapped = refused(pcadlang_nanodet::WEIGHTS, pcadlang_nanodet::MODEL);
    assert!(swapped.contains("not a TensorFlow.js graph model"), "{swapped}");
}
