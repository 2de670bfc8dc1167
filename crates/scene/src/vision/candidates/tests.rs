//! Tests of the detection of a drawn vase, and of the individual steps.

use super::*;
use crate::vision::ContourMap;
use crate::vision::drawn::{HEIGHT, LENGTH, MIDDLE, WIDTH, noise, profile, vase, vessel};
use image::{Rgb, RgbImage};

fn check_vase(lean: f64) {
    let (photo, truth) = vase(lean);
    let found = candidates(&photo, &CandidateOptions::default());
    check_first(&found, &truth, lean);
}

/// Checks that the vase comes first in a list, with its axis and its widths.
fn check_first(found: &[Candidate], truth: &Mask, lean: f64) {
    let first = found.first().expect("nothing was found");
    let overlap = first.mask.overlap(truth);
    assert!(overlap > 0.9, "{overlap}");
    let axis = &first.axes[0];
    assert!(axis.symmetry > 0.9, "{}", axis.symmetry);
    let [x, y] = [0, 1].map(|c| axis.top[c] - axis.foot[c]);
    let (s, c) = (libm::sin(lean), libm::cos(lean));
    assert!(
        (libm::atan2(x, -y) - lean).abs() < 3.0_f64.to_radians(),
        "leans by {}",
        libm::atan2(x, -y)
    );
    for (end, sign) in [(axis.foot, -0.5), (axis.top, 0.5)] {
        let expected = [MIDDLE[0] + sign * LENGTH * s, MIDDLE[1] - sign * LENGTH * c];
        let off = [end[0] - expected[0], end[1] - expected[1]];
        assert!(
            (off[0] * c + off[1] * s).abs() < 2.0,
            "{end:?} is beside the axis at {expected:?}"
        );
        assert!((off[0] * s - off[1] * c).abs() < 4.0, "{end:?} is not the end {expected:?}");
    }
    assert_eq!(axis.widths.len(), 24);
    for (i, width) in axis.widths.iter().enumerate().skip(1).take(22) {
        let expected = profile((i as f64 + 0.5) / 24.0);
        assert!((width - expected).abs() < 3.0, "width {i} is {width}, not {expected}");
    }
    let second = &first.axes[1];
    let [u, v] = [0, 1].map(|c| second.top[c] - second.foot[c]);
    let cosine = (x * u + y * v).abs() / (libm::hypot(x, y) * libm::hypot(u, v));
    assert!(cosine < libm::cos(29.0_f64.to_radians()) && second.symmetry < axis.symmetry);
}

#[test]
fn a_vase_comes_first() {
    check_vase(0.0);
}

#[test]
fn a_leaning_vase_comes_first() {
    check_vase(0.45);
}

#[test]
fn the_same_photo_gives_the_same_list() {
    let (photo, _) = vase(-0.2);
    let all = candidates(&photo, &CandidateOptions { size: 96, most: 64 });
    assert_eq!(all, candidates(&photo, &CandidateOptions { size: 96, most: 64 }));
    assert!(all.windows(2).all(|w| w[0].score >= w[1].score));
    assert!((5..=64).contains(&all.len()) && all.iter().all(|c| c.mask.width() == 96));
    let three = candidates(&photo, &CandidateOptions { size: 96, most: 3 });
    assert_eq!(three[0].mask, all[0].mask);
    assert_eq!(three.len(), 3);
    assert!(candidates(&photo, &CandidateOptions { size: 96, most: 0 }).is_empty());
}

/// Checks the properties that any list has, whatever the picture.
fn check_list(photo: &Photo, options: &CandidateOptions) -> Vec<Candidate> {
    let found = candidates(photo, options);
    assert!(found.len() <= options.most);
    for c in &found {
        let longer = c.mask.width().max(c.mask.height());
        assert!(longer <= options.size.clamp(16, 1024) && c.mask.data().contains(&true));
        assert!(c.score > 0.0 && (1..=2).contains(&c.axes.len()));
        for a in &c.axes {
            assert!((0.0..=1.0).contains(&a.symmetry) && a.foot[1] >= a.top[1] - 1e-9);
            assert!(a.foot.iter().chain(&a.top).all(|v| v.is_finite()));
            assert!(a.widths.len() == 24 && a.widths.iter().all(|w| *w > 0.0 && w.is_finite()));
        }
    }
    found
}

#[test]
fn any_photo_gives_a_sane_list() {
    let photo = |w, h, pixel: &dyn Fn(u32, u32) -> [u8; 3]| {
        Photo::from_rgb(RgbImage::from_fn(w, h, |i, j| Rgb(pixel(i, j)))).unwrap()
    };
    let options = CandidateOptions::default();
    let speckled = |i: u32, j: u32| [(255.0 * noise(i * 7919 + j)) as u8; 3];
    for (w, h) in [(1, 1), (1, 2), (64, 48), (3, 200)] {
        assert!(check_list(&photo(w, h, &|_, _| [90, 120, 40]), &options).is_empty(), "{w} x {h}");
    }
    for (w, h) in [(2, 2), (1, 300), (3000, 10), (10, 3000), (33, 17), (90, 90)] {
        check_list(&photo(w, h, &speckled), &options);
    }
    for size in [0, 1, u32::MAX] {
        check_list(&photo(40, 30, &speckled), &CandidateOptions { size, most: 5 });
    }
    // Two halves: all regions are cut off by the frame.
    check_list(&photo(60, 40, &|i, _| if i < 30 { [0; 3] } else { [255; 3] }), &options);
}

fn pixels_where(width: usize, height: usize, on: impl Fn(usize) -> bool) -> Option<Area> {
    Area::of(Pixels::new(width, height, on))
}

/// An area drawn in rows, where `#` is on.
fn area(rows: &[&str]) -> Area {
    let width = rows[0].len();
    pixels_where(width, rows.len(), |p| rows[p / width].as_bytes()[p % width] == b'#').unwrap()
}

#[test]
fn areas() {
    let ring = area(&["......", ".####.", ".#..#.", ".####.", "......"]);
    assert_eq!((ring.count, ring.bounds), (10, [1, 1, 5, 4]));
    assert_eq!(ring.clone().filled(), area(&["......", ".####.", ".####.", ".####.", "......"]));
    assert_eq!(ring.iou(&ring.clone().filled()), 10.0 / 12.0);
    assert!(
        ring.overlaps(&ring.clone().filled(), 0.8) && !ring.overlaps(&ring.clone().filled(), 0.84)
    );
    let open = area(&["......", ".####.", ".#..#.", ".##.#.", "......"]);
    assert_eq!(open.clone().filled(), open);
    assert_eq!(open.union(&ring), Some(ring.clone()));
    assert!(pixels_where(2, 1, |_| false).is_none());
    let dot = area(&["....", "....", ".#..", "...."]);
    let dilated = area(&["....", "###.", "###.", "###."]);
    assert_eq!(dot.dilated(1), dilated.pixels);
    assert_eq!(dilated.outline(), (vec![4, 5, 6, 8, 10, 12, 13, 14], 5));
    let two = area(&["##..#", "....#", ".#..#"]);
    assert_eq!(area::largest(5, &two.pixels.bools()), Some(area(&["....#", "....#", "....#"])));
    let (of, sizes) = components::components(5, &two.pixels.bools());
    assert_eq!((sizes, of[0], of[4], of[14]), (vec![2, 9, 3, 1], 0, 2, 2));
}

#[test]
fn mirrors_of_a_leaning_ellipse() {
    let lean: f64 = 0.6;
    let inside = |i: usize, j: usize| {
        let (x, y) = (i as f64 + 0.5 - 40.0, j as f64 + 0.5 - 31.0);
        let (s, c) = (libm::sin(lean), libm::cos(lean));
        let (along, across) = (x * s - y * c, x * c + y * s);
        (along / 25.0).powi(2) + (across / 11.0).powi(2) <= 1.0
    };
    let area = pixels_where(80, 60, |p| inside(p % 80, p / 80)).unwrap();
    let mirrors = mirror::mirrors(&area);
    assert_eq!(mirrors.len(), 2);
    let off = mirrors.iter().map(|m| (m.angle - lean).rem_euclid(std::f64::consts::FRAC_PI_2));
    for off in off {
        assert!(off.min(std::f64::consts::FRAC_PI_2 - off) < 0.03, "{off}");
    }
    assert!(mirrors.iter().all(|m| m.symmetry > 0.95 && m.offset.abs() < 0.3));
    assert!(mirror::symmetry(&area) > 0.93);
    // A half of it, cut obliquely to its axes, is less symmetric.
    let half = |p: usize| inside(p % 80, p / 80) && p % 80 < 40;
    let half = pixels_where(80, 60, half).unwrap();
    assert!(mirror::symmetry(&half) < 0.9);
}

#[test]
fn segments_and_regions_of_plain_colours() {
    // A square of two colours before a third.
    let colour = |i: u32, j: u32| match (i, j) {
        (20..32, 20..44) => [200, 60, 50],
        (32..44, 20..44) => [220, 90, 50],
        _ => [40, 60, 160],
    };
    let photo = Photo::from_rgb(RgbImage::from_fn(64, 64, |i, j| Rgb(colour(i, j)))).unwrap();
    let picture = PictureFeatures::of(&photo, 64);
    let segments = felzenszwalb(&Edges::of(&picture), 20.0, 25);
    let at = |i: usize, j: usize| segments.0[j * 64 + i];
    assert!(at(24, 30) != at(40, 30) && at(24, 30) != at(5, 5));
    assert!(at(24, 21) == at(24, 42) && at(5, 5) == at(60, 60));
    assert!((3..12).contains(&segments.1), "{} segments", segments.1);
    let whole = |p: usize| (20..44).contains(&(p % 64)) && (20..44).contains(&(p / 64));
    let whole = pixels_where(64, 64, whole).unwrap();
    let best = |all: &[Area]| all.iter().map(|a| a.iou(&whole)).fold(0.0, f64::max);
    for rule in [Rule::Likeness, Rule::Edges] {
        let all = merge(&picture, &segments, rule, 16, 3000);
        assert!(best(&all) > 0.85, "{}", best(&all));
        assert!(all.iter().all(|a| (16..=3000).contains(&a.count)));
    }
    assert!(best(&clusters::regions(&picture, clusters::WEIGHTS[0], 16)) > 0.9);
}

#[test]
fn a_cut_moves_to_the_object() {
    let (photo, truth) = vase(0.1);
    let picture = PictureFeatures::of(&photo, 128);
    let truth = truth.resized(picture.width as u32, picture.height as u32);
    let truth = pixels_where(picture.width, picture.height, |p| truth.data()[p]).unwrap();
    // Its shape, shifted slightly.
    let w = picture.width;
    let seed = |p: usize| p % w >= 2 && truth.pixels.has(p % w - 2, p / w);
    let seed = pixels_where(w, picture.height, seed).unwrap();
    let field = Field::new(&picture, clusters::codebook(&picture));
    let cut = field.cut(&seed).unwrap();
    let (before, after) = (seed.iou(&truth), cut.iou(&truth));
    assert!(after > 0.94 && before < 0.88, "{after} from {before}");
    let scorer = Scorer::new(&picture, &field.codewords);
    let score = |area: &Area| scorer.bound(area) * scorer.likeness(area);
    assert!(score(&truth) > score(&seed));
    let best = |all: &[(f64, &Area)], overlap| {
        let all = all.iter().map(|(score, area)| Scored::bounded(*score, (*area).clone()));
        let kept = suppressed(all, |area| if *area == seed { 0.1 } else { 1.0 }, overlap, 9);
        kept.iter().map(|scored| scored.score).collect::<Vec<_>>()
    };
    assert_eq!(best(&[(0.2, &cut), (0.3, &truth), (0.0, &seed)], 0.99), [0.3, 0.2]);
    assert_eq!(best(&[(0.2, &cut), (0.1, &truth), (1.0, &seed)], 0.99), [0.2, 0.1, 0.1]);
    assert_eq!(best(&[(0.2, &truth), (0.3, &truth)], OVERLAP).len(), 1);
}

/// The near half of the rim determines the tilt, from above and from below.
#[test]
fn rims_tell_tilts() {
    let tilts: Vec<f64> = tilts().collect();
    assert!(tilts.len() == 80 && tilts.windows(2).all(|w| w[0] < w[1]));
    for (tilt, below) in [(0.3, false), (0.45, false), (0.6, false), (0.45, true)] {
        let found = candidates(&vessel(tilt, below), &CandidateOptions::default());
        let axis = &found.first().expect("nothing was found").axes[0];
        let best = (0..80).fold(0, |best, i| if axis.rims[i] > axis.rims[best] { i } else { best });
        let (at, wanted) = (tilts[best], if below { -tilt } else { tilt });
        assert!(
            (at - wanted).abs() < 0.06 && axis.rims[best] > 0.4,
            "{wanted}: {at} {}",
            axis.rims[best]
        );
    }
    // Without a flat end there is little evidence for any tilt.
    let (photo, _) = vase(0.0);
    let rims = &candidates(&photo, &CandidateOptions::default())[0].axes[0].rims;
    assert!(rims.iter().all(|r| (0.0..0.35).contains(r)), "{rims:?}");
}

/// Adds points a pixel apart along lines between positions.
fn lines(places: &[[f64; 2]], map: &mut ContourMap) {
    for ends in places.windows(2) {
        let d = [ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]];
        let length = libm::hypot(d[0], d[1]);
        let steps = length.ceil() as usize;
        for s in 0..steps {
            let t = s as f64 / steps as f64;
            map.x.push((ends[0][0] + t * d[0]) as f32);
            map.y.push((ends[0][1] + t * d[1]) as f32);
            map.tx.push((d[0] / length) as f32);
            map.ty.push((d[1] / length) as f32);
            map.strength.push(1.0);
        }
    }
}

/// The outline of the vase from its foot up, over the top and down again, and finally
/// along the foot.
fn outline(lean: f64) -> Vec<[f64; 2]> {
    let (s, c) = (libm::sin(lean), libm::cos(lean));
    let at = |t: f64, across: f64| {
        let along = (t - 0.5) * LENGTH;
        [MIDDLE[0] + along * s + across * c, MIDDLE[1] - along * c + across * s]
    };
    let t = |i: usize| i as f64 / 40.0;
    let left = (0..=40).map(|i| at(t(i), -profile(t(i))));
    let right = (0..=40).rev().map(|i| at(t(i), profile(t(i))));
    left.chain(right).chain([at(0.0, -profile(0.0))]).collect()
}

#[test]
fn clean_contours_enclose_a_vase() {
    let options = CandidateOptions { size: 256, most: 20 };
    for lean in [0.0, -0.3] {
        let mut map = ContourMap::new(WIDTH, HEIGHT);
        lines(&outline(lean), &mut map);
        let found = enclosed(&map, &options);
        let (_, truth) = vase(lean);
        check_first(&found, &truth, lean);
        let whole = |all: &[Candidate]| all[0].mask.overlap(&truth);
        assert!(found.len() == 1 && whole(&found) > 0.95, "{}", whole(&found));
        // With gaps of six pixels, and at smaller sizes.
        let mut gaps = ContourMap::new(WIDTH, HEIGHT);
        outline(lean).chunks(20).for_each(|part| lines(part, &mut gaps));
        let closed = enclosed(&gaps, &options);
        assert!(whole(&closed) > 0.85 && closed[0].axes[0].symmetry > 0.9);
        assert!(whole(&enclosed(&map, &CandidateOptions { size: 96, most: 5 })) > 0.88);
        assert!(enclosed(&map, &CandidateOptions { most: 0, ..options }).is_empty());
    }
    // An outline that does not close, and an empty one.
    let mut open = ContourMap::new(WIDTH, HEIGHT);
    lines(&[[60.0, 40.0], [60.0, 160.0], [160.0, 160.0], [160.0, 40.0]], &mut open);
    assert!(enclosed(&open, &options).is_empty());
    assert!(enclosed(&ContourMap::new(WIDTH, HEIGHT), &options).is_empty());
    assert!(enclosed(&ContourMap::default(), &options).is_empty());
}

/// The inner edge of a rim determines the tilt in clean contours, too.
#[test]
fn rims_of_clean_contours_tell_tilts() {
    const RADIUS: f64 = 40.0;
    let tilts: Vec<f64> = tilts().collect();
    for tilt in [0.3, 0.6, 1.0] {
        let (flat, rim, foot) = (RADIUS * libm::sin(tilt), 75.0, 75.0 + 80.0 * libm::cos(tilt));
        let arc = |middle: f64, from: f64, to: f64| {
            (0..=40).map(move |i| {
                let angle = std::f64::consts::PI * (from + (to - from) * f64::from(i) / 40.0);
                [120.0 + RADIUS * libm::cos(angle), middle + flat * libm::sin(angle)]
            })
        };
        let mut map = ContourMap::new(WIDTH, HEIGHT);
        lines(&arc(rim, 0.0, 2.0).collect::<Vec<_>>(), &mut map);
        let below = [[120.0 + RADIUS, rim]]
            .into_iter()
            .chain(arc(foot, 0.0, 1.0))
            .chain([[120.0 - RADIUS, rim]]);
        lines(&below.collect::<Vec<_>>(), &mut map);
        let found = enclosed(&map, &CandidateOptions { size: 256, most: 20 });
        // The upright axis, which need not be the most symmetric one.
        let upright = |a: &&Axis| (a.top[0] - a.foot[0]).abs() < 4.0;
        let axis =
            found.first().and_then(|c| c.axes.iter().find(upright)).expect("no upright axis");
        let best = (0..80).fold(0, |best, i| if axis.rims[i] > axis.rims[best] { i } else { best });
        assert!(
            (tilts[best] - tilt).abs() < 0.06 && axis.rims[best] > 0.5,
            "{tilt}: {} {}",
            tilts[best],
            axis.rims[best]
        );
    }
}
