//! Lenses against OpenCV.

use super::*;

fn lens() -> Lens {
    let distortion = Distortion {
        radial: [-0.28, 0.09, -0.015, 0.0],
        tangential: [0.0012, -0.0007],
        ..Distortion::default()
    };
    Lens::new((640, 480), [520.5, 518.75], [321.75, 240.0], distortion).unwrap()
}

#[test]
fn the_inverse_undoes_distortion() {
    let lens = lens();
    for i in 0..=64 {
        for j in 0..=48 {
            let at = [10.0 * f64::from(i), 10.0 * f64::from(j)];
            let seen = lens.undistorted(at).unwrap();
            let back = lens.distorted(seen).unwrap();
            assert!((back[0] - at[0]).hypot(back[1] - at[1]) < 1e-6, "{at:?} {seen:?} {back:?}");
        }
    }
    let middle = lens.undistorted([321.75, 240.0]).unwrap();
    assert!((middle[0] - 321.75).hypot(middle[1] - 240.0) < 1e-9);
}

#[test]
fn beyond_the_turning_point_there_is_nothing() {
    // r (1 - 0.3 r²) grows up to r = sqrt(1 / 0.9).
    let distortion = Distortion { radial: [-0.3, 0.0, 0.0, 0.0], ..Distortion::default() };
    let lens = Lens::new((100, 100), [50.0; 2], [50.0; 2], distortion).unwrap();
    assert!(lens.distorted([50.0 + 50.0 * 1.04, 50.0]).is_some());
    assert_eq!(lens.distorted([50.0 + 50.0 * 1.07, 50.0]), None);
    assert_eq!(lens.undistorted([50.0 + 50.0 * 0.71, 50.0]), None);
    let edge = lens.nearest([1000.0, 50.0]);
    assert!((edge[0] - 85.1).abs() < 0.1 && (edge[1] - 50.0).abs() < 1e-9, "{edge:?}");
}

#[test]
fn lenses_that_cannot_be() {
    let of = |focal, centre| Lens::new((64, 48), focal, centre, Distortion::default());
    assert!(of([50.0, 50.0], [32.0, 24.0]).is_some());
    for focal in [[0.0, 50.0], [-50.0, -50.0], [f64::NAN, 50.0], [50.0, 500.0], [1e300, 1e300]] {
        assert_eq!(of(focal, [32.0, 24.0]), None);
    }
    assert_eq!(of([50.0; 2], [f64::INFINITY, 0.0]), None);
    assert!(Lens::new((0, 48), [50.0; 2], [0.0; 2], Distortion::default()).is_none());
    assert!(Lens::new((16000, 16000), [50.0; 2], [0.0; 2], Distortion::default()).is_none());
}
