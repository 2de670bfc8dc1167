//! Undistorted pictures against `cv2.undistort` of OpenCV 5.0.0, whose first pixel has its centre
//! at 0; the new matrix has the mean focal length.

use super::*;
use crate::vision::keypoints::{Keypoint, Keypoints};
use crate::vision::lens::Distortion;

fn lens() -> Lens {
    let distortion = Distortion {
        radial: [-0.28, 0.09, -0.015, 0.0],
        tangential: [0.0012, -0.0007],
        ..Distortion::default()
    };
    Lens::new((640, 480), [520.5, 518.75], [321.75, 240.0], distortion).unwrap()
}

/// Pixels of the undistorted picture, and the positions of the photograph that
/// `cv2.initUndistortRectifyMap` names for them.
const MAP: [([u32; 2], [f64; 2]); 5] = [
    ([320, 240], [319.9979, 239.99916]),
    ([10, 10], [49.879738, 40.57112]),
    ([600, 440], [570.66376, 418.68164]),
    ([100, 300], [110.720795, 296.97684]),
    ([639, 0], [595.3268, 33.817238]),
];

#[test]
fn positions_are_those_of_opencv() {
    for (pixel, [x, y]) in MAP {
        let [u, v] = lens().distorted(pixel.map(|n| f64::from(n) + 0.5)).unwrap();
        assert!((u - 0.5 - x).hypot(v - 0.5 - y) < 1e-3, "{pixel:?} {u} {v}");
    }
}

#[test]
fn photographs_are_those_of_opencv() {
    let ramp = RgbImage::from_fn(640, 480, |x, y| {
        image::Rgb([(x * 255 / 639) as u8, (y * 255 / 479) as u8, 128])
    });
    let photo = Photo::from_rgb(ramp).unwrap().undistorted(&lens()).unwrap();
    let seen = [[127, 127], [19, 21], [227, 223], [44, 158], [237, 18]];
    for (([x, y], _), [r, g]) in MAP.iter().zip(seen) {
        let [a, b, c] = photo.rgb().get_pixel(*x, *y).0;
        assert!(a.abs_diff(r) <= 1 && b.abs_diff(g) <= 1 && c == 128, "{x} {y}: {a} {b} {c}");
    }
}

#[test]
fn masks_and_depths_take_the_nearest_pixel() {
    let at = |[x, y]: [f64; 2]| (y + 0.5) as usize * 640 + (x + 0.5) as usize;
    let mut depths = vec![1.0; 640 * 480];
    let mut on = vec![false; 640 * 480];
    for (i, (_, source)) in MAP.iter().enumerate() {
        depths[at(*source)] = 2.0 + i as f32;
        on[at(*source)] = true;
    }
    let depth = DepthMap::new(640, 480, depths).unwrap().undistorted(&lens()).unwrap();
    let mask = Mask::new(640, 480, on).unwrap().undistorted(&lens()).unwrap();
    for (i, ([x, y], _)) in MAP.iter().enumerate() {
        let k = (y * 640 + x) as usize;
        assert!(depth.data()[k] == 2.0 + i as f32 && mask.data()[k], "{i}");
    }
    // Other proportions are an error; at twice the size it is the same lens.
    assert!(Mask::new(640, 640, vec![true; 640 * 640]).unwrap().undistorted(&lens()).is_err());
    let large = Mask::new(1280, 960, vec![true; 1280 * 960]).unwrap().undistorted(&lens()).unwrap();
    assert!(large.data().iter().all(|on| *on), "a barrel shows more than the pinhole");
    // A cushion shows less: beside it nothing is measured.
    let cushion = Distortion { radial: [0.2, 0.0, 0.0, 0.0], ..Distortion::default() };
    let cushion = Lens::new((64, 48), [50.0; 2], [32.0, 24.0], cushion).unwrap();
    let depth = DepthMap::new(64, 48, vec![1.0; 64 * 48]).unwrap().undistorted(&cushion).unwrap();
    assert!(depth.data()[0].is_nan() && depth.data()[24 * 64 + 32] == 1.0);
    let mask = Mask::new(64, 48, vec![true; 64 * 48]).unwrap().undistorted(&cushion).unwrap();
    assert!(!mask.data()[0] && mask.data()[24 * 64 + 32]);
}

#[test]
fn keypoints_contours_and_hints_move_with_the_picture() {
    let lens = lens();
    let near = |[x, y]: [f64; 2], [u, v]: [f64; 2], most: f64| {
        assert!((x - u).hypot(y - v) < most, "{x} {y} {u} {v}")
    };
    for ([i, j], [x, y]) in MAP {
        let (at, to) = ([x + 0.5, y + 0.5], [i, j].map(|n| f64::from(n) + 0.5));
        let one = Keypoints::new(vec![Keypoint::new("nose", at, 0.5)]).unwrap().in_image(640, 480);
        let moved = one.undistorted(&lens);
        near(moved.position(&moved.points()[0], (640, 480)), to, 2e-3);
        let mut map = ContourMap::new(640, 480);
        map.x.push(at[0] as f32);
        map.y.push(at[1] as f32);
        map.tx.push(1.0);
        map.ty.push(0.0);
        map.strength.push(0.75);
        let moved = map.undistorted(&lens).unwrap();
        near([f64::from(moved.x[0]), f64::from(moved.y[0])], to, 2e-3);
        assert!((f64::from(moved.tx[0]).hypot(f64::from(moved.ty[0])) - 1.0).abs() < 1e-6);
        let hint = Hint {
            at: vec![at],
            bounds: Some([at[0] - 2.0, at[1] - 2.0, 4.0, 4.0]),
            ..Hint::default()
        };
        let moved = hint.undistorted(&lens, (640, 480)).unwrap();
        near(moved.at[0], to, 2e-3);
        let [x, y, w, h] = moved.bounds.unwrap();
        assert!(x < to[0] && to[0] < x + w && y < to[1] && to[1] < y + h && w < 8.0 && h < 8.0);
    }
    // Fractions of a picture stay fractions, also of one of another shape.
    let wide =
        Lens::new((640, 480), [400.0, 800.0], [320.0, 240.0], Distortion::default()).unwrap();
    let at = Keypoints::new(vec![Keypoint::new("nose", [160.0, 120.0], 1.0)]).unwrap();
    let moved = at.in_image(640, 480).undistorted(&wide);
    assert_eq!(moved.size(), Some((1280, 480)));
    near(moved.position(&moved.points()[0], (1280, 480)), [320.0, 120.0], 1e-9);
    let axis = AxisHint { foot: [300.0, 400.0], top: [300.0, 100.0], width: 80.0 };
    let hint = Hint { axis: Some(axis), ..Hint::default() };
    let moved = hint.undistorted(&wide, (640, 480)).unwrap().axis.unwrap();
    assert!((moved.foot[0] - 600.0).abs() < 1e-6 && (moved.width - 160.0).abs() < 1e-6);
}
