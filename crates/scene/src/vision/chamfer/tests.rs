//! Tests of the chamfer comparator against a brute-force reference.

use super::super::testing::{clutter, comings_and_goings, numbers};
use super::*;
use crate::contours::Contours;

fn options() -> ChamferOptions {
    ChamferOptions::default()
}

fn variants() -> Vec<ChamferOptions> {
    let mut all = Vec::new();
    for mode in [Mode::Mean, Mode::Sum] {
        for symmetric in [false, true] {
            for (truncate, oriented) in [(None, None), (Some(3.0), None), (None, Some(2.0))] {
                all.push(ChamferOptions { sigma: 0.4, mode, symmetric, truncate, oriented });
            }
        }
    }
    all
}

/// Distance from a point to a piece, in pixels.
fn to_piece(x: f32, y: f32, p: &Contours, i: usize, half: f32) -> f64 {
    let (dx, dy) = (x - p.x[i], y - p.y[i]);
    let s = (dx * p.tx[i] + dy * p.ty[i]).clamp(-half, half);
    f64::from(dx - s * p.tx[i]).hypot(f64::from(dy - s * p.ty[i]))
}

fn turn(a: &Contours, i: usize, b: &Contours, j: usize) -> f64 {
    let cos = f64::from(a.tx[i] * b.tx[j] + a.ty[i] * b.ty[j]).abs().min(1.0);
    cos.acos()
}

/// Mean distance in percent from the pieces of `a` to those of `b`.
fn slow(a: &Contours, b: &Contours, half: impl Fn(usize) -> f32, per_radian: f64) -> f64 {
    let percent = 100.0 / a.slice().diagonal();
    let (mut sum, mut length) = (0.0, 0.0);
    for i in 0..a.x.len() {
        let near = (0..b.x.len())
            .map(|j| {
                to_piece(a.x[i], a.y[i], b, j, half(j)) * percent + per_radian * turn(a, i, b, j)
            })
            .fold(f64::INFINITY, f64::min);
        sum += f64::from(a.length[i]) * near;
        length += f64::from(a.length[i]);
    }
    sum / length
}

/// Half lengths of the observed pieces: half the chord of a pixel.
fn chord(p: &Contours) -> impl Fn(usize) -> f32 {
    |j| 0.5 / p.tx[j].abs().max(p.ty[j].abs())
}

#[test]
fn one_sided_distance_is_the_plain_one() {
    for size in [128, 256] {
        let seen = clutter(size, size, 12, 3);
        let drawn = Contours::new(size, size).circle(0.5, 0.45, 0.3);
        let fast =
            Chamfer::prepare(&seen.map(), size, size, &options()).unwrap().distance(&drawn.slice());
        let plain = slow(&drawn, &seen, chord(&seen), 0.0);
        assert!((fast - plain).abs() < 0.02 * plain, "{size}: {fast} {plain}");
    }
}

#[test]
fn orientation_costs_as_the_plain_one() {
    let seen = Contours::new(128, 128).circle(0.5, 0.5, 0.3).circle(0.3, 0.6, 0.12);
    let drawn = Contours::new(128, 128).circle(0.55, 0.5, 0.25);
    let turned = ChamferOptions { oriented: Some(3.0), ..options() };
    let fast = Chamfer::prepare(&seen.map(), 128, 128, &turned).unwrap().distance(&drawn.slice());
    let plain = slow(&drawn, &seen, chord(&seen), 3.0);
    // Orientations are quantised to eight channels.
    assert!((fast - plain).abs() < 0.12 * plain, "{fast} {plain}");
}

#[test]
fn symmetric_distance_is_the_plain_one() {
    let seen = clutter(128, 96, 9, 5).circle(0.4, 0.4, 0.2);
    let mut seen = Contours { length: vec![0.0; seen.x.len()], ..seen };
    for j in 0..seen.x.len() {
        let length = 2.0 * chord(&seen)(j);
        seen.length[j] = length;
    }
    let keep: Vec<usize> = (0..seen.x.len())
        .filter(|&i| {
            seen.x[i] >= 0.0 && seen.y[i] >= 0.0 && seen.x[i] <= 128.0 && seen.y[i] <= 96.0
        })
        .collect();
    let pick = |v: &[f32]| keep.iter().map(|&i| v[i]).collect();
    let seen = Contours {
        x: pick(&seen.x),
        y: pick(&seen.y),
        tx: pick(&seen.tx),
        ty: pick(&seen.ty),
        length: pick(&seen.length),
        ..seen
    };
    for radius in [0.02, 0.1, 0.3] {
        for per_radian in [0.0, 2.0] {
            let drawn = Contours::new(128, 96).circle(0.5, 0.35, radius);
            let both = ChamferOptions {
                symmetric: true,
                oriented: (per_radian > 0.0).then_some(per_radian),
                ..options()
            };
            let one = ChamferOptions { symmetric: false, ..both.clone() };
            let both =
                Chamfer::prepare(&seen.map(), 128, 96, &both).unwrap().distance(&drawn.slice());
            let one =
                Chamfer::prepare(&seen.map(), 128, 96, &one).unwrap().distance(&drawn.slice());
            let back = slow(&seen, &drawn, |j| 0.5 * drawn.length[j], per_radian);
            assert!((2.0 * both - one - back).abs() < 1e-3 * back, "{radius}: {both} {one} {back}");
        }
    }
}

#[test]
fn log_normal_of_the_distance() {
    let seen = Contours::new(64, 64).circle(0.5, 0.5, 0.3);
    let drawn = Contours::new(64, 64).circle(0.5, 0.5, 0.32);
    let c =
        Chamfer::prepare(&seen.map(), 64, 64, &ChamferOptions { sigma: 0.7, ..options() }).unwrap();
    let rho = c.distance(&drawn.slice());
    let exact = -0.5 * (rho / 0.7).powi(2) - 0.7f64.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln();
    assert!((c.log_likelihood(&drawn.slice()) - exact).abs() < 1e-12);
    // The radius is off by 0.02 of the width: 2 / sqrt 2 percent of the diagonal.
    assert!((rho - std::f64::consts::SQRT_2).abs() < 0.05, "{rho}");
    // With all pieces equally far, the sum is the length in percent times one log
    // density.
    let sum = ChamferOptions { sigma: 0.7, mode: Mode::Sum, ..options() };
    let sum = Chamfer::prepare(&seen.map(), 64, 64, &sum).unwrap().log_likelihood(&drawn.slice());
    let length = 100.0 * 2.0 * std::f64::consts::PI * 0.32 / std::f64::consts::SQRT_2;
    assert!((sum / (length * exact) - 1.0).abs() < 0.03, "{sum} {}", length * exact);
}

#[test]
fn resolution_does_not_matter() {
    for o in variants() {
        let scores = [64u32, 128, 256].map(|size| {
            let seen = Contours::new(256, 256).circle(0.5, 0.5, 0.3).circle(0.75, 0.7, 0.1);
            let drawn = Contours::new(size, size).circle(0.52, 0.5, 0.31);
            Chamfer::prepare(&seen.map(), size, size, &o).unwrap().log_likelihood(&drawn.slice())
        });
        let spread = scores.iter().fold(0.0f64, |m, s| m.max((s - scores[2]).abs()));
        assert!(spread < 0.03 * scores[2].abs() + 0.02, "{o:?} {scores:?}");
    }
}

#[test]
fn order_does_not_matter() {
    let seen = clutter(128, 128, 20, 9);
    let drawn = Contours::new(128, 128).circle(0.5, 0.5, 0.35);
    for o in variants() {
        let c = Chamfer::prepare(&seen.map(), 128, 128, &o).unwrap();
        let (a, b) =
            (c.log_likelihood(&drawn.slice()), c.log_likelihood(&drawn.reversed().slice()));
        assert!((a - b).abs() <= 1e-10 * a.abs(), "{o:?} {a} {b}");
    }
}

#[test]
fn small_moves_change_little() {
    let seen = clutter(128, 128, 20, 11);
    let drawn = Contours::new(128, 128).circle(0.5, 0.5, 0.35).circle(1.0, 0.5, 0.2);
    for o in variants() {
        let c = Chamfer::prepare(&seen.map(), 128, 128, &o).unwrap();
        let mut scratch = Scratch::default();
        let mut last = c.distance_with(&drawn.slice(), &mut scratch);
        for i in 1..2000 {
            let now = c.distance_with(
                &drawn.moved(0.001 * i as f32, 0.0007 * i as f32).slice(),
                &mut scratch,
            );
            // 0.0012 pixels are 0.0007 percent; a piece that enters or leaves at the
            // border shifts the mean by a little more.
            assert!((now - last).abs() < 0.002, "{o:?} step {i}: {last} {now}");
            last = now;
        }
    }
}

#[test]
fn gradient_is_that_of_differences() {
    let seen = clutter(128, 128, 15, 21).map();
    let mut next = numbers(4);
    let mut drawn = Contours::new(128, 128);
    for _ in 0..60 {
        drawn.stroke(next() * 129.0 - 0.5, next() * 129.0 - 0.5, next() * 3.0, 0.5 + next());
    }
    drawn.stroke(-0.2, 50.3, 1.0, 1.0);
    drawn.stroke(70.3, 128.3, 1.0, 1.0);
    for o in [
        options(),
        ChamferOptions { truncate: Some(6.0), ..options() },
        ChamferOptions { oriented: Some(1.0), ..options() },
        ChamferOptions { mode: Mode::Sum, truncate: Some(8.0), ..options() },
        ChamferOptions { symmetric: true, ..options() },
        ChamferOptions {
            symmetric: true,
            oriented: Some(2.0),
            truncate: Some(7.0),
            mode: Mode::Sum,
            ..options()
        },
    ] {
        let prepared = |sigma| {
            Chamfer::prepare(&seen, 128, 128, &ChamferOptions { sigma, ..o.clone() }).unwrap()
        };
        let c = prepared(5.0);
        let mut out = Vec::new();
        let by_sigma = c.gradient(&drawn.slice(), &mut Scratch::default(), &mut out);
        let scored = |sigma| prepared(sigma).log_likelihood(&drawn.slice());
        let numeric = (scored(5.001) - scored(4.999)) / 0.002;
        assert!((numeric - by_sigma).abs() < 1e-5 * numeric.abs(), "{o:?}: {numeric} {by_sigma}");
        let bad = drawn.differing(&out, |e| c.log_likelihood(e));
        // A finite difference across a grid line, or between two nearest pieces, may
        // differ.
        assert!(bad <= 16, "{o:?}: {bad} of 248 differ");
    }
}

#[test]
fn nothing_in_view_is_a_diagonal_away() {
    let seen = clutter(64, 48, 8, 2).map();
    let out = Contours::new(64, 48).circle(3.0, 3.0, 0.2);
    let drawn = Contours::new(64, 48).circle(0.5, 0.4, 0.3);
    for o in variants() {
        let c = Chamfer::prepare(&seen, 64, 48, &o).unwrap();
        for nothing in [&out, &Contours::new(64, 48)] {
            let expected =
                if o.symmetric { 0.5 * (100.0 + o.truncate.unwrap_or(100.0)) } else { 100.0 };
            assert!((c.distance(&nothing.slice()) - expected).abs() < 1e-4, "{o:?}");
            assert!(c.log_likelihood(&nothing.slice()) < c.log_likelihood(&drawn.slice()));
        }
        let blank = Chamfer::prepare(&Contours::new(64, 48).map(), 64, 48, &o).unwrap();
        assert!(blank.log_likelihood(&drawn.slice()).is_finite());
        assert!(blank.log_likelihood(&out.slice()).is_finite());
    }
}

#[test]
fn extremes_give_numbers_or_errors() {
    let seen = clutter(64, 64, 8, 2).map();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(
            Chamfer::prepare(&seen, 64, 64, &ChamferOptions { sigma: bad, ..options() }).is_err()
        );
        assert!(
            Chamfer::prepare(&seen, 64, 64, &ChamferOptions { truncate: Some(bad), ..options() })
                .is_err()
        );
    }
    assert!(Chamfer::prepare(&seen, 0, 64, &options()).is_err());
    let mut torn = seen.clone();
    torn.tx.pop();
    assert_eq!(Chamfer::prepare(&torn, 64, 64, &options()).unwrap_err(), ComparatorError::Map);
    let mut odd = seen.clone();
    odd.x[0] = f32::NAN;
    odd.tx[1] = f32::NAN;
    odd.y[2] = f32::INFINITY;
    let mut drawn = Contours::new(64, 64).circle(0.5, 0.5, 0.3);
    drawn.x[0] = f32::NAN;
    drawn.length[1] = f32::MAX;
    for mut o in variants() {
        for sigma in [1e-200, 1e-6, 1e6] {
            o.sigma = sigma;
            let c = Chamfer::prepare(&odd, 64, 64, &o).unwrap();
            assert!(c.log_likelihood(&drawn.slice()).is_finite(), "{o:?}");
        }
    }
    // One pixel.
    let c = Chamfer::prepare(&Contours::new(1, 1).circle(0.5, 0.5, 0.1).map(), 1, 1, &options())
        .unwrap();
    assert!(c.distance(&Contours::new(1, 1).circle(0.5, 0.5, 0.4).slice()).is_finite());
}

#[test]
fn what_comes_and_goes_gives_what_is_there_to_the_last_bit() {
    let seen = Contours::new(96, 96).circle(0.5, 0.5, 0.3).circle(0.3, 0.6, 0.2);
    let all =
        Contours::new(96, 96).circle(0.52, 0.5, 0.3).circle(0.4, 0.4, 0.35).circle(0.99, 0.5, 0.1);
    for options in variants() {
        let chamfer = Chamfer::prepare(&seen.map(), 96, 96, &options).unwrap();
        let (mut tally, mut asked) = (Tally::default(), 0);
        comings_and_goings(&all, |step, whole| {
            let count = std::cell::Cell::new(0);
            let elements = || {
                count.set(count.get() + 1);
                whole.slice()
            };
            let score =
                chamfer.log_likelihood_after(step, elements, &mut tally, &mut Scratch::default());
            assert_eq!(score.to_bits(), chamfer.log_likelihood(&whole.slice()).to_bits());
            asked += usize::from(count.get() > 0);
        });
        assert!(asked < 39, "{asked}");
    }
}

#[test]
fn symmetric_distances_follow_what_comes_and_goes_in_clutter() {
    // More observed points than are measured, and pieces partly or wholly out of view.
    let seen = clutter(128, 96, 80, 3).map();
    for (strokes, size) in [(2, 1.0), (40, 1.0), (400, 1.0), (60, 3.0)] {
        let mut all = clutter(128, 96, strokes, 8);
        all.length.iter_mut().for_each(|length| *length *= size);
        for (mode, oriented) in [(Mode::Sum, None), (Mode::Mean, Some(2.0))] {
            let options = ChamferOptions { mode, symmetric: true, oriented, ..options() };
            let chamfer = Chamfer::prepare(&seen, 128, 96, &options).unwrap();
            let (mut tally, mut asked) = (Tally::default(), 0);
            comings_and_goings(&all, |step, whole| {
                let elements = || {
                    asked += 1;
                    whole.slice()
                };
                let mut scratch = Scratch::default();
                let score = chamfer.log_likelihood_after(step, elements, &mut tally, &mut scratch);
                assert_eq!(score.to_bits(), chamfer.log_likelihood(&whole.slice()).to_bits());
            });
            assert!((1..39).contains(&asked), "{asked}");
        }
    }
}

#[test]
fn sums_of_a_device_give_the_same_score() {
    let seen = clutter(128, 128, 12, 3);
    let drawn = Contours::new(128, 128).circle(0.5, 0.45, 0.3);
    for options in variants() {
        let chamfer = Chamfer::prepare(&seen.map(), 128, 128, &options).unwrap();
        let Some(field) = chamfer.distance_field() else {
            assert!(options.symmetric);
            continue;
        };
        let samples = field.width as usize * field.height as usize;
        assert!(field.channels.iter().all(|channel| channel.len() == samples));
        assert_eq!(field.channels.len(), if options.oriented.is_some() { CHANNELS } else { 1 });
        assert_eq!(field.scale, [field.width as f32 / 128.0, field.height as f32 / 128.0]);
        let mut sums = [0.0; 3];
        for e in drawn.slice().in_view() {
            let length = f64::from(e.length * e.weight) * field.percent;
            let distance = f64::from(chamfer.read(&e).0).min(field.truncate.unwrap_or(f64::MAX));
            let terms = [length, length * distance, length * distance * distance];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let (got, wanted) =
            (chamfer.log_likelihood_of(sums), chamfer.log_likelihood(&drawn.slice()));
        assert!((got - wanted).abs() < 1e-6 * wanted.abs().max(1.0), "{got} {wanted}");
    }
}
