//! Distance transforms and comparators: pictures without contours and full of them,
//! scales from 1e-300 to 1e300, values that are not numbers.

use super::points::Points;
use super::table::agree;
use pcadlang_numerics::rng::{Purpose, StreamKey};
use pcadlang_scene::vision::chamfer::Mode;
use pcadlang_scene::vision::keypoints::{Detection, RelativeDepthLikelihood};
use pcadlang_scene::vision::{
    Chamfer, ChamferOptions, ContourMap, ContourRatio, ContourRatioOptions, ContourSlice,
    DepthLikelihood, DepthMap, GradientDetector, KeypointLikelihood, KeypointOptions, Mask,
    MaskLikelihood, Photo, Region, RegionOptions, distance_transform,
};

/// Contour pieces that own their lists.
#[derive(Clone, Debug, Default)]
struct Pieces {
    lists: [Vec<f32>; 5],
    size: (u32, u32),
}

impl Pieces {
    fn new(size: (u32, u32)) -> Pieces {
        Pieces { size, ..Pieces::default() }
    }

    fn with(mut self, piece: [f32; 5]) -> Pieces {
        self.lists.iter_mut().zip(piece).for_each(|(l, v)| l.push(v));
        self
    }

    /// Returns a piece at the middle of every pixel.
    fn full(size: (u32, u32)) -> Pieces {
        let all = (0..size.1).flat_map(|j| {
            (0..size.0).map(move |i| [i as f32 + 0.5, j as f32 + 0.5, 1.0, 0.0, 1.0])
        });
        all.fold(Pieces::new(size), Pieces::with)
    }

    fn elements(&self) -> ContourSlice<'_> {
        let [x, y, tx, ty, length] = &self.lists;
        ContourSlice { x, y, tx, ty, length, width: self.size.0, height: self.size.1 }
    }

    fn map(&self) -> ContourMap {
        let [x, y, tx, ty, _] = self.lists.clone();
        let strength = vec![1.0; x.len()];
        ContourMap { width: self.size.0, height: self.size.1, x, y, tx, ty, strength }
    }
}

/// Returns the outline of a square in the middle of a picture.
fn square(size: (u32, u32)) -> Pieces {
    let (w, h) = (size.0 as f32, size.1 as f32);
    let steps = 24;
    let along = |k: u32| (k as f32 + 0.5) / steps as f32;
    (0..steps).fold(Pieces::new(size), |p, k| {
        let (x, y) = (w * (0.25 + 0.5 * along(k)), h * (0.25 + 0.5 * along(k)));
        let (dx, dy) = (0.5 * w / steps as f32, 0.5 * h / steps as f32);
        p.with([x, 0.25 * h, 1.0, 0.0, dx])
            .with([x, 0.75 * h, 1.0, 0.0, dx])
            .with([0.25 * w, y, 0.0, 1.0, dy])
            .with([0.75 * w, y, 0.0, 1.0, dy])
    })
}

/// Returns the contours of test pictures: none, one, all, ordinary ones, and non-finite
/// ones.
fn scenes(size: (u32, u32)) -> Vec<(&'static str, Pieces)> {
    let middle = [size.0 as f32 / 2.0, size.1 as f32 / 2.0];
    let one =
        |x: f32, y: f32, tx: f32, ty: f32, length: f32| square(size).with([x, y, tx, ty, length]);
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    vec![
        ("nothing", Pieces::new(size)),
        ("one", Pieces::new(size).with([middle[0], middle[1], 1.0, 0.0, 1.0])),
        ("everything", Pieces::full(size)),
        ("a square", square(size)),
        ("NaN", one(nan, 0.0, nan, 0.0, 1.0)),
        ("infinite", one(inf, -inf, 1.0, 0.0, inf)),
        ("far away", one(f32::MAX, f32::MIN, 1.0, 0.0, f32::MAX)),
        ("long", one(middle[0], middle[1], 1.0, 0.0, f32::MAX)),
        ("without length", Pieces::new(size).with([middle[0], middle[1], 0.0, 0.0, 0.0])),
        ("tiny", one(1e-45, 1e-30, 1e-30, 1e-30, 1e-45)),
    ]
}

#[test]
fn distances_are_exact_in_pictures_of_any_kind() {
    let mut points = Points::of("distance transforms");
    for (w, h) in [(1usize, 1usize), (1, 8192), (8192, 1), (3, 5), (300, 200), (2, 4096)] {
        let pixels = w * h;
        let diagonal = ((w * w + h * h) as f64).sqrt() as f32;
        let of = |set: &[bool]| distance_transform(w as u32, h as u32, set);
        points.check(of(&vec![false; pixels]).values.iter().all(|d| *d == diagonal), || {
            format!("{w} x {h}, none set")
        });
        points.check(of(&vec![true; pixels]).values.iter().all(|d| *d == 0.0), || {
            format!("{w} x {h}, all set")
        });
        points.check(of(&[]).values.len() == pixels, || format!("{w} x {h}, no list"));
        for place in [0, pixels - 1, pixels / 2] {
            let mut set = vec![false; pixels];
            set[place] = true;
            let map = of(&set);
            let exact = |i: usize| {
                let (dx, dy) = ((i % w).abs_diff(place % w), (i / w).abs_diff(place / w));
                ((dx * dx + dy * dy) as f64).sqrt() as f32
            };
            let right =
                (0..pixels).all(|i| map.values[i] == exact(i) && map.nearest[i] == place as u32);
            points.check(right, || format!("{w} x {h}, {place} set"));
            let odd = [
                f32::NAN,
                f32::INFINITY,
                f32::NEG_INFINITY,
                f32::MAX,
                f32::MIN,
                1e30,
                -1e30,
                0.0,
                1e-45,
            ];
            for x in odd {
                for (x, y) in [(x, 0.5), (0.5, x), (x, x)] {
                    let (d, dx, dy) = map.sample(x, y);
                    let right =
                        d >= 0.0 && [dx, dy].iter().all(|s| s.is_finite() && s.abs() <= 1.5);
                    points.check(right && (d.is_finite() || x.abs() == f32::MAX), || {
                        format!("{w} x {h} at {x}, {y}: {d}, {dx}, {dy}")
                    });
                }
            }
        }
    }
    points.finish();
}

const SPREADS: [f64; 9] = [1e-300, 1e-200, 1e-100, 1e-6, 0.4, 1e6, 1e100, 1e200, 1e300];

#[test]
fn chamfer_scores_anything_against_anything() {
    let mut points = Points::of("chamfer");
    let size = (32, 24);
    for (seen, map) in scenes(size) {
        let map = map.map();
        for sigma in SPREADS {
            for (mode, symmetric) in [(Mode::Mean, false), (Mode::Mean, true), (Mode::Sum, true)] {
                let options =
                    ChamferOptions { sigma, mode, symmetric, ..ChamferOptions::default() };
                let chamfer = Chamfer::prepare(&map, size.0, size.1, &options).unwrap();
                for (drawn, pieces) in scenes(size) {
                    let (d, p) = (
                        chamfer.distance(&pieces.elements()),
                        chamfer.log_likelihood(&pieces.elements()),
                    );
                    let mut right = (0.0..=100.0).contains(&d) && p.is_finite();
                    if mode == Mode::Mean {
                        let z = d / sigma;
                        let expected = -0.5 * z * z - sigma.ln() - 0.918_938_533_204_672_8;
                        right &= agree(p, expected.max(f64::MIN), 1e-12, 1e-12);
                    }
                    let nothing = ["nothing", "without length"].contains(&drawn);
                    right &= !nothing || symmetric || d == 100.0;
                    points.check(right, || {
                        format!(
                            "{drawn} on {seen}, sigma {sigma:e}, {mode:?}, {symmetric}: {d}, {p:e}"
                        )
                    });
                    let mut slopes = Vec::new();
                    let by =
                        chamfer.gradient(&pieces.elements(), &mut Default::default(), &mut slopes);
                    let right = !by.is_nan() && slopes.iter().flatten().all(|s| !s.is_nan());
                    points.check(right, || {
                        format!("{drawn} on {seen}, sigma {sigma:e}: a slope is NaN ({by:e})")
                    });
                }
            }
        }
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = ChamferOptions { sigma: bad, ..ChamferOptions::default() };
        let end = Chamfer::prepare(&square(size).map(), size.0, size.1, &options);
        points.check(end.is_err(), || format!("sigma {bad}"));
    }
    for (w, h) in [(0, 24), (32, 0), (16385, 1)] {
        let end = Chamfer::prepare(&square(size).map(), w, h, &ChamferOptions::default());
        points.check(end.is_err(), || format!("{w} x {h}"));
    }
    points.finish();
}

#[test]
fn contour_ratios_score_anything_against_anything() {
    let mut points = Points::of("contour ratios");
    let size = (32, 24);
    for (seen, map) in scenes(size) {
        for sd in [1e-300, 1e-6, 0.4, 1e6, 1e300] {
            for truncate in [1e-300, 3.3, 1e300] {
                let options =
                    ContourRatioOptions { sd, truncate, ..ContourRatioOptions::default() };
                let ratio = ContourRatio::prepare(&map.map(), size.0, size.1, &options).unwrap();
                for (drawn, pieces) in scenes(size) {
                    let p = ratio.log_likelihood(&pieces.elements());
                    points.check(p.is_finite(), || {
                        format!("{drawn} on {seen}, sd {sd:e}, truncate {truncate:e}: {p}")
                    });
                }
            }
        }
        for unit in [1e-300, 1e-6, 1e6, 1e300] {
            let options = [
                ContourRatioOptions { unit, ..ContourRatioOptions::default() },
                ContourRatioOptions { weight: unit, ..ContourRatioOptions::default() },
                ContourRatioOptions { least: unit, ..ContourRatioOptions::default() },
                ContourRatioOptions { nothing: unit, ..ContourRatioOptions::default() },
                ContourRatioOptions { credit: unit, ..ContourRatioOptions::default() },
            ];
            for o in options {
                let ratio = ContourRatio::prepare(&map.map(), size.0, size.1, &o).unwrap();
                let p = ratio.log_likelihood(&square(size).elements());
                points.check(!p.is_nan(), || format!("a square on {seen}, {o:?}: {p}"));
            }
        }
    }
    points.finish();
}

#[test]
fn depths_masks_and_keypoints_score_anything() {
    let mut points = Points::of("depth, masks, keypoints");
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let observed = DepthMap::new(4, 2, vec![1.0, 2.0, 1e-30, 1e30, nan, inf, 0.5, 0.0]).unwrap();
    let rendered = [1.0, f32::MAX, 1e-45, 1e30, 1.0, inf, 2.0, 5.0];
    for sd in SPREADS {
        let likelihood = DepthLikelihood::new(&observed, sd, 0.05, (0.0, 1e38));
        let p = likelihood.as_ref().ok().and_then(|l| l.log_likelihood(&rendered, 4, 2).ok());
        points.check(p.is_some_and(f64::is_finite), || format!("depths with sd {sd:e}: {p:?}"));
        let Ok(l) = likelihood else { continue };
        let numbers = [l.slopes(&rendered), l.gains(&rendered)].concat();
        points.check(numbers.iter().all(|v| !v.is_nan()), || {
            format!("depths with sd {sd:e}: {numbers:?}")
        });
    }
    for share in [1e-300, 1e-16, 0.5, 1.0 - 1e-16] {
        let mask = Mask::new(3, 1, vec![true, false, true]).unwrap();
        let l = MaskLikelihood::new(&mask, share, share).unwrap();
        for drawn in [[true; 3], [false; 3], [true, false, true]] {
            let p = l.log_likelihood(&drawn, 3, 1).unwrap();
            let wrong = drawn.iter().zip(mask.data()).filter(|(a, b)| a != b).count() as f64;
            let expected = wrong * share.ln() + (3.0 - wrong) * (-share).ln_1p();
            points.check(agree(p, expected, 1e-12, 1e-12), || {
                format!("{drawn:?} with {share:e}: {p}, expected {expected}")
            });
        }
        for odd in [nan, inf, -inf, 1e30, -1e30] {
            let end = l.log_likelihood_coverage(&[odd, 0.5, 1.0], 3, 1);
            points.check(end.is_err(), || format!("a coverage of {odd} with {share:e}: {end:?}"));
        }
    }
    for bad in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
        let mask = Mask::new(1, 1, vec![true]).unwrap();
        points.check(MaskLikelihood::new(&mask, bad, 0.1).is_err(), || format!("a share of {bad}"));
        points.check(DepthLikelihood::new(&observed, 1.0, bad, (0.0, 1e38)).is_err(), || {
            format!("outliers {bad}")
        });
    }
    for (sd, outlier) in [(1e-300, 1e-300), (0.1, 0.05), (1e8, 0.999)] {
        let l = RelativeDepthLikelihood::new(sd, outlier).unwrap();
        for (seen, model) in
            [(0.0, 0.0), (1e-300, 1e300), (-1e150, 0.0), (0.3, f64::INFINITY), (0.3, f64::NAN)]
        {
            let (p, slope) = (l.log_density(seen, model), l.slope(seen, model));
            points.check(p.is_finite() && slope.is_finite(), || {
                format!("depth {seen} {model} {sd}: {p} {slope}")
            });
        }
    }
    for sd in [1e-300, 1e-6, 1.0, 1e6, 1e8] {
        let l = KeypointLikelihood::new(
            640.0,
            480.0,
            0.0,
            &KeypointOptions { sd, ..KeypointOptions::default() },
        )
        .unwrap();
        for c in [0.0, 1e-300, 320.0, -1e150, 1e300, f64::MAX, f64::INFINITY, f64::NAN] {
            for confidence in [0.0, 1e-300, 1.0, 7.0, f64::NAN] {
                let seen = Detection::new([320.0, 240.0], confidence)
                    .or([([1e9, -1e300], 1e-300)].into_iter());
                let p = l.log_density(&seen, Some([c, 240.0]));
                let g = l.gradient(&seen, [c, 240.0]);
                let (at, variance) = l.located(&seen, [c, 240.0]);
                let right = p.is_finite() && g.iter().all(|g| !g.is_nan());
                let right = right && (!c.is_finite() || !at[0].is_nan() && !variance.is_nan());
                points.check(right, || {
                    format!("sd {sd:e}, joint at {c:e}, confidence {confidence}: {p}, {g:?}, {at:?}, {variance}")
                });
            }
        }
    }
    points.finish();
}

#[test]
fn photographs_of_one_colour_and_of_noise_are_read() {
    let mut points = Points::of("photographs");
    type Colour<'a> = &'a dyn Fn(u32, u32) -> u8;
    let pictures: [(&str, u32, u32, Colour); 6] = [
        ("black", 64, 48, &|_, _| 0),
        ("white", 64, 48, &|_, _| 255),
        ("one pixel", 1, 1, &|_, _| 128),
        ("a line", 300, 1, &|x, _| (x % 2 * 255) as u8),
        ("a checkerboard", 64, 48, &|x, y| ((x + y) % 2 * 255) as u8),
        ("noise", 64, 48, &|x, y| {
            StreamKey::new(7, x, Purpose::VALUES).stream(0, y.into(), 0).index(256) as u8
        }),
    ];
    for (name, w, h, colour) in pictures {
        let photo =
            Photo::from_rgb(image::RgbImage::from_fn(w, h, |x, y| image::Rgb([colour(x, y); 3])))
                .unwrap();
        let map = GradientDetector::default().contours(&photo);
        let inside = |l: &[f32], most: u32| l.iter().all(|v| (0.0..=most as f32).contains(v));
        points.check(inside(&map.x, w) && inside(&map.y, h), || {
            format!("{name}: contours beyond the picture")
        });
        points.check(!["black", "white", "one pixel"].contains(&name) || map.is_empty(), || {
            format!("{name}: {}", map.len())
        });
        for (drawn, pieces) in scenes((w, h)) {
            let chamfer = Chamfer::prepare(&map, w, h, &ChamferOptions::default()).unwrap();
            let ratio = ContourRatio::prepare(&map, w, h, &ContourRatioOptions::default()).unwrap();
            let p = [
                chamfer.log_likelihood(&pieces.elements()),
                ratio.log_likelihood(&pieces.elements()),
            ];
            points.check(p.iter().all(|p| p.is_finite()), || format!("{drawn} on {name}: {p:?}"));
        }
        for prior in [1e-6, 0.5, 1e6] {
            for power in [0.0, 1e-300, 1.0, 1e300] {
                let options = RegionOptions {
                    prior,
                    power,
                    tile_power: 0.1,
                    shading: 0.1,
                    ..RegionOptions::default()
                };
                let region = Region::prepare(&photo, w, h, &options).unwrap();
                for group in [0, 1, 255] {
                    let pixels = (w * h) as usize;
                    let p =
                        region.log_likelihood(&vec![group; pixels], &vec![[f32::NAN; 3]; pixels]);
                    points.check(!p.is_nan(), || {
                        format!("{name}, prior {prior}, power {power:e}, group {group}: {p}")
                    });
                }
            }
        }
    }
    points.finish();
}
