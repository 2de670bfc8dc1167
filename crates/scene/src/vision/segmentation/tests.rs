//! Tests of guesses about drawn vases and vessels.

use super::*;
use crate::vision::AxisHint;
use crate::vision::candidates::tilts;
use crate::vision::drawn::{HEIGHT, LENGTH, MIDDLE, WIDTH, noise, profile, vase, vessel};
use image::{Rgb, RgbImage};
use pcadlang_numerics::num::simd::portable;

/// Left, top, width and height of a mask.
fn bounds(mask: &Mask) -> [f64; 4] {
    let w = mask.width() as usize;
    let on = Area::of(Pixels::new(w, mask.height() as usize, |p| mask.data()[p])).unwrap();
    let [x0, y0, x1, y1] = on.bounds.map(|b| b as f64);
    [x0, y0, x1 - x0, y1 - y0]
}

fn in_box(bounds: [f64; 4]) -> Hint {
    Hint { bounds: Some(bounds), ..Hint::default() }
}

/// The first guess by a method.
fn first(all: &[Guess], method: Method) -> &Guess {
    all.iter().find(|g| g.method == method).expect("no guess")
}

fn overlap(guess: &Guess, truth: &Mask) -> f64 {
    guess.mask.overlap(truth)
}

/// How far an axis leans to the right, radians.
fn lean(axis: &Axis) -> f64 {
    libm::atan2(axis.top[0] - axis.foot[0], axis.foot[1] - axis.top[1])
}

/// Checks foot, top and widths of the drawn vase.
fn check_axis(axis: &Axis, leaning: f64, within: f64) {
    assert!((lean(axis) - leaning).abs() < 0.04, "leans by {}", lean(axis));
    let (s, c) = (libm::sin(leaning), libm::cos(leaning));
    for (end, sign) in [(axis.foot, -0.5), (axis.top, 0.5)] {
        let expected = [MIDDLE[0] + sign * LENGTH * s, MIDDLE[1] - sign * LENGTH * c];
        let off = libm::hypot(end[0] - expected[0], end[1] - expected[1]);
        assert!(off < 1.5 * within, "{end:?} instead of {expected:?}");
    }
    for (i, width) in axis.widths.iter().enumerate().skip(1).take(22) {
        let expected = profile((i as f64 + 0.5) / 24.0);
        assert!((width - expected).abs() < within, "width {i} is {width}, not {expected}");
    }
}

#[test]
fn a_box_gives_the_vase() {
    let (photo, truth) = vase(0.0);
    let all = guesses(&photo, &in_box(bounds(&truth)), &Method::ALL);
    let found = Method::ALL.map(|m| overlap(first(&all, m), &truth));
    assert!(found[0] > 0.7 && found[1] > 0.93 && found[2] > 0.89, "{found:?}");
    assert!(first(&all, Method::Cut).score > first(&all, Method::Ellipse).score);
    assert!(lean(&first(&all, Method::Ellipse).axes[0]).abs() < 1e-9);
    check_axis(&first(&all, Method::Symmetric).axes[0], 0.0, 3.5);
    check_axis(&first(&all, Method::Cut).axes[0], 0.0, 3.5);
}

#[test]
fn a_box_gives_the_leaning_vase() {
    for leaning in [0.45, -0.3] {
        let (photo, truth) = vase(leaning);
        let all = guesses(&photo, &in_box(bounds(&truth)), &Method::ALL);
        let symmetric = first(&all, Method::Symmetric);
        assert!(overlap(symmetric, &truth) > 0.8, "{}", overlap(symmetric, &truth));
        assert!((lean(&symmetric.axes[0]) - leaning).abs() < 0.12, "{}", lean(&symmetric.axes[0]));
    }
}

#[test]
fn an_axis_gives_the_leaning_vase() {
    let leaning = 0.6;
    let (s, c) = (libm::sin(leaning), libm::cos(leaning));
    let end = |along: f64| [MIDDLE[0] + along * s + 2.0, MIDDLE[1] - along * c - 2.0];
    let axis = AxisHint { foot: end(-0.5 * LENGTH), top: end(0.5 * LENGTH), width: 70.0 };
    let (photo, truth) = vase(leaning);
    let all = guesses(&photo, &Hint { axis: Some(axis), ..Hint::default() }, &Method::ALL);
    let found = Method::ALL.map(|m| overlap(first(&all, m), &truth));
    assert!(found[0] > 0.65 && found[1] > 0.85 && found[2] > 0.87, "{found:?}");
    check_axis(&first(&all, Method::Symmetric).axes[0], leaning, 3.5);
    assert_eq!(all.iter().filter(|g| g.method == Method::Ellipse).count(), 1);
}

#[test]
fn clicks_decide_what_belongs_to_the_object() {
    // A bright body with a lid of another colour, both within the box.
    let colour = |i: u32, j: u32| match (i, j) {
        (60..140, 80..160) => [210, 190, 150],
        (60..140, 50..80) => [150, 60, 60],
        _ => [50, 70, 90],
    };
    let photo = Photo::from_rgb(RgbImage::from_fn(200, 200, |i, j| Rgb(colour(i, j)))).unwrap();
    let hint = in_box([60.0, 50.0, 80.0, 110.0]);
    let lid = [100.0, 65.0];
    let with = |at: Vec<[f64; 2]>, not: Vec<[f64; 2]>, method: Method| {
        let all = guesses(&photo, &Hint { at, not, ..hint.clone() }, &[method]);
        let mask = first(&all, method).mask.resized(200, 200);
        mask.data()[lid[1] as usize * 200 + lid[0] as usize]
    };
    for method in [Method::Cut, Method::Symmetric] {
        assert!(with(vec![lid], vec![], method), "{method:?}");
        assert!(!with(vec![], vec![lid], method), "{method:?}");
    }
}

/// The tilt with the most evidence, and that evidence.
fn best_tilt(axis: &Axis) -> (f64, f64) {
    let all = tilts().zip(axis.rims.iter().copied());
    all.reduce(|a, b| if b.1 > a.1 { b } else { a }).expect("no tilts")
}

#[test]
fn rims_in_the_photograph_tell_from_where_a_vessel_is_seen() {
    for (tilt, below) in [(0.3, false), (0.5, false), (0.45, true)] {
        let photo = vessel(tilt, below);
        let (flat, long) = (40.0 * libm::sin(tilt), 80.0 * libm::cos(tilt));
        let top = if below { f64::from(HEIGHT) - 75.0 - long - flat } else { 75.0 - flat };
        let bounds = [80.0, top, 80.0, long + 2.0 * flat];
        let wanted = if below { -tilt } else { tilt };
        let mask: Vec<bool> = (0..WIDTH * HEIGHT)
            .map(|p| {
                let at = [f64::from(p % WIDTH) + 0.5, f64::from(p / WIDTH) + 0.5];
                let y = if below { f64::from(HEIGHT) - at[1] } else { at[1] };
                let ellipse = |m: f64| {
                    let (u, v) = ((at[0] - 120.0) / 40.0, (y - m) / flat);
                    u * u + v * v <= 1.0
                };
                let body = (at[0] - 120.0).abs() <= 40.0 && (75.0..75.0 + long).contains(&y);
                body || ellipse(75.0) || ellipse(75.0 + long)
            })
            .collect();
        let drawn = from_mask(&photo, &Mask::new(WIDTH, HEIGHT, mask).unwrap());
        let upright = drawn.iter().find(|a| lean(a).abs() < 0.1).expect("no upright axis");
        let all = guesses(&photo, &in_box(bounds), &[Method::Symmetric]);
        for axis in [upright, &first(&all, Method::Symmetric).axes[0]] {
            let (found, evidence) = best_tilt(axis);
            assert!((found - wanted).abs() < 0.08, "{wanted}: {found} by {evidence}");
            assert!(evidence > 0.3, "{wanted}: {evidence}");
        }
    }
}

#[test]
fn a_drawn_mask_has_its_axis_at_any_resolution() {
    for leaning in [0.0, 0.5] {
        let (photo, truth) = vase(leaning);
        for (w, h) in [(WIDTH, HEIGHT), (120, 100), (960, 800)] {
            check_axis(&from_mask(&photo, &truth.resized(w, h))[0], leaning, 3.5);
        }
    }
    let (photo, _) = vase(0.0);
    assert!(from_mask(&photo, &Mask::new(3, 2, vec![false; 6]).unwrap()).is_empty());
    assert!(!from_mask(&photo, &Mask::new(1, 1, vec![true]).unwrap()).is_empty());
}

#[test]
fn without_a_place_in_the_picture_there_are_no_guesses() {
    let (photo, _) = vase(0.0);
    let axis =
        |foot, top, width| Hint { axis: Some(AxisHint { foot, top, width }), ..Hint::default() };
    for hint in [
        Hint::default(),
        Hint { at: vec![[100.0, 100.0]], ..Hint::default() },
        in_box([-50.0, 10.0, 50.0, 20.0]),
        in_box([10.0, 200.0, 50.0, 20.0]),
        in_box([1e300, 1e300, 1e300, 1e300]),
        axis([5.0, 5.0], [5.0, 5.0], 10.0),
        axis([-500.0, 50.0], [-500.0, 10.0], 10.0),
        axis([0.0, 1e200], [0.0, -1e200], 10.0),
        axis([0.0, 1e5], [0.0, -1e5], 10.0),
    ] {
        assert_eq!(guesses(&photo, &hint, &Method::ALL), [], "{hint:?}");
    }
    assert_eq!(guesses(&photo, &in_box([50.0, 50.0, 50.0, 50.0]), &[]), []);
}

#[test]
fn any_photo_and_place_give_sane_guesses() {
    let photo = |w, h, pixel: &dyn Fn(u32, u32) -> [u8; 3]| {
        Photo::from_rgb(RgbImage::from_fn(w, h, |i, j| Rgb(pixel(i, j)))).unwrap()
    };
    let speckled = |i: u32, j: u32| [(255.0 * noise(i * 7919 + j)) as u8; 3];
    let grey = |_: u32, _: u32| [90; 3];
    let axis =
        |foot, top, width| Hint { axis: Some(AxisHint { foot, top, width }), ..Hint::default() };
    for (w, h) in [(1, 1), (2, 300), (60, 40), (8000, 50)] {
        for pixel in [&speckled as &dyn Fn(u32, u32) -> [u8; 3], &grey] {
            let photo = photo(w, h, pixel);
            let (x, y) = (f64::from(w), f64::from(h));
            for hint in [
                in_box([0.0, 0.0, x, y]),
                in_box([0.3 * x, 0.3 * y, 1.0, 1.0]),
                in_box([0.5 * x, 0.5 * y, 1e-9, 1e-9]),
                in_box([-5.0, -1e9, 5.0 + 0.5 * x, 2e9]),
                in_box([0.0, 0.0, x, 0.01]),
                axis([0.0, y], [x, 0.0], 1e-3),
                axis([x, 0.0], [0.0, y], 3.0),
                axis([0.5 * x, 1.2 * y], [0.6 * x, -0.1 * y], 1.5 * y),
            ] {
                let clicks = vec![[0.5 * x, 0.5 * y], [-1e9, 1e9]];
                for hint in [hint.clone(), Hint { at: clicks.clone(), not: clicks, ..hint }] {
                    for g in guesses(&photo, &hint, &Method::ALL) {
                        assert!(g.mask.width() <= w.min(1024) && g.mask.height() <= h);
                        assert!(g.mask.data().contains(&true) && (0.0..=1.0).contains(&g.score));
                        assert!((1..=2).contains(&g.axes.len()));
                        for a in &g.axes {
                            assert!((0.0..=1.0).contains(&a.symmetry));
                            let ends = a.foot.iter().chain(&a.top);
                            assert!(ends.chain(&a.rims).all(|v| v.is_finite()));
                            let width = |w: &f64| *w > 0.0 && w.is_finite();
                            assert!(a.widths.len() == 24 && a.widths.iter().all(width));
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn the_same_photo_gives_the_same_guesses() {
    let (photo, truth) = vase(0.2);
    let hint = in_box(bounds(&truth));
    let all = guesses(&photo, &hint, &Method::ALL);
    assert_eq!(portable(|| guesses(&photo, &hint, &Method::ALL)), all);
    let some = guesses(&photo, &hint, &[Method::Cut]);
    assert_eq!(some[0].mask, first(&all, Method::Cut).mask);
    assert_eq!((some.len(), some[0].score), (1, 0.0));
}

#[test]
fn a_small_object_in_a_large_photograph_is_found() {
    let inside = |i: u32, j: u32| {
        let (x, y) = (f64::from(i) - 3000.0, f64::from(j) - 700.0);
        (x / 45.0).powi(2) + (y / 60.0).powi(2) <= 1.0
    };
    let colour = |i: u32, j: u32| if inside(i, j) { [200, 120, 60] } else { [50, 80, 100] };
    let photo = Photo::from_rgb(RgbImage::from_fn(4000, 1000, |i, j| Rgb(colour(i, j)))).unwrap();
    let hint = in_box([2953.0, 638.0, 93.0, 125.0]);
    let all = guesses(&photo, &hint, &Method::ALL);
    for method in Method::ALL {
        let guess = first(&all, method);
        assert_eq!(guess.mask.width(), 1024);
        let upright = guess.axes.iter().find(|a| lean(a).abs() < 0.1);
        let axis = upright.expect("no upright axis");
        assert!((axis.foot[1] - 760.0).abs() < 4.0, "{method:?}: {:?}", axis.foot);
        assert!((axis.widths[12] - 45.0).abs() < 3.0, "{method:?}: {}", axis.widths[12]);
    }
}
