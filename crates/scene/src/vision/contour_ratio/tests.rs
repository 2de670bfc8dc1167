//! Tests of the contour ratio: a closed-form reference for one element, and properties.

use super::super::testing::{clutter, comings_and_goings};
use super::*;
use crate::contours::Contours;

fn options() -> ContourRatioOptions {
    ContourRatioOptions::default()
}

fn prepare(seen: &Contours, size: u32) -> ContourRatio {
    ContourRatio::prepare(&seen.map(), size, size, &options()).unwrap()
}

/// With a single vertical line of edges the scores have a closed form, given the counts
/// in the window, which are simple sums.
#[test]
fn scores_follow_the_formula() {
    let mut seen = Contours::new(256, 256);
    for i in 0..256 {
        seen.stroke(128.0, i as f32 + 0.5, std::f32::consts::FRAC_PI_2, 1.0);
    }
    let o = ContourRatioOptions { least: 1e-9, ..options() };
    let c = ContourRatio::prepare(&seen.map(), 256, 256, &o).unwrap();
    let percent = 100.0 / (256.0 * std::f64::consts::SQRT_2);
    for offset in [0.5, 1.0, 2.0, 3.0, 5.5, 9.0, 20.0] {
        let mut one = Contours::new(256, 256);
        one.stroke(128.0 + offset, 128.0, std::f32::consts::FRAC_PI_2, 1.0);
        let got = c.log_likelihood(&one.slice()) / (o.weight / o.unit) / percent;
        // A window of 64 pixels in the middle, in which the distance changes by a pixel
        // per pixel on both sides; 5 % of the density comes from the whole picture.
        let d = f64::from(offset) * percent;
        let expected = if d >= 3.3 {
            0.25f64.ln()
        } else {
            let density = (0.95 * 2.0 / 64.0 + 0.05 * 2.0 / 256.0) / percent;
            let own =
                2.0 / (2.0 * std::f64::consts::PI).sqrt() / 0.4 * (-0.5 * (d / 0.4).powi(2)).exp();
            (0.75 * own / density + 0.25).ln()
        };
        assert!((got - expected).abs() < 0.2, "{offset}: {got} {expected}");
    }
}

#[test]
fn edges_pay_no_more_than_their_credit() {
    let seen = Contours::new(128, 128).circle(0.5, 0.5, 0.3);
    let c = prepare(&seen, 128);
    let times = |n: usize| {
        let mut drawn = Contours::new(128, 128);
        for _ in 0..n {
            drawn = drawn.circle(0.5, 0.5, 0.3);
        }
        c.log_likelihood(&drawn.slice())
    };
    let scores = [1, 2, 3, 8].map(times);
    assert!(scores[1] > 1.7 * scores[0], "{scores:?}");
    assert!(scores[2] < 1.25 * scores[1] && scores[3] < 1.25 * scores[1], "{scores:?}");
}

#[test]
fn the_true_circle_wins() {
    let seen = clutter(128, 128, 30, 8).circle(0.5, 0.5, 0.3);
    let c = prepare(&seen, 128);
    let score = |x, y, r| c.log_likelihood(&Contours::new(128, 128).circle(x, y, r).slice());
    let truth = score(0.5, 0.5, 0.3);
    assert!(truth > 0.0);
    for (x, y, r) in
        [(0.53, 0.5, 0.3), (0.5, 0.5, 0.33), (0.5, 0.5, 0.15), (0.3, 0.4, 0.1), (0.7, 0.6, 0.02)]
    {
        assert!(score(x, y, r) < truth, "{x} {y} {r}");
    }
}

#[test]
fn resolution_does_not_matter() {
    let seen = clutter(256, 256, 30, 8).circle(0.5, 0.5, 0.3);
    for (x, r) in [(0.5, 0.3), (0.51, 0.3), (0.55, 0.2)] {
        let scores = [64u32, 128, 256].map(|size| {
            prepare(&seen, size)
                .log_likelihood(&Contours::new(size, size).circle(x, 0.5, r).slice())
        });
        let spread = scores.iter().fold(0.0f64, |m, s| m.max((s - scores[2]).abs()));
        assert!(spread < 0.04 * scores[2].abs() + 1.0, "{scores:?}");
    }
}

#[test]
fn order_does_not_matter_to_the_last_bit() {
    let seen = clutter(128, 128, 40, 9);
    let c = prepare(&seen, 128);
    let drawn = Contours::new(128, 128)
        .circle(0.5, 0.5, 0.35)
        .circle(0.5, 0.5, 0.352)
        .circle(0.51, 0.5, 0.35);
    let mut scratch = Scratch::default();
    let a = c.log_likelihood_with(&drawn.slice(), &mut scratch);
    let b = c.log_likelihood_with(&drawn.reversed().slice(), &mut scratch);
    assert_eq!(a, b);
    assert_eq!(a, c.log_likelihood(&drawn.slice()));
}

#[test]
fn small_moves_change_little() {
    let seen = clutter(128, 128, 40, 11).circle(0.5, 0.5, 0.35);
    let c = prepare(&seen, 128);
    let drawn = Contours::new(128, 128)
        .circle(0.5, 0.5, 0.35)
        .circle(0.5, 0.5, 0.353)
        .circle(1.0, 0.4, 0.2);
    let mut scratch = Scratch::default();
    let mut last = c.log_likelihood_with(&drawn.slice(), &mut scratch);
    for i in 1..3000 {
        let now = c.log_likelihood_with(
            &drawn.moved(0.001 * i as f32, 0.0007 * i as f32).slice(),
            &mut scratch,
        );
        // There are about 700 pieces, each of which can change by a few hundredths per
        // hundredth of a pixel.
        assert!((now - last).abs() < 0.5, "step {i}: {last} {now}");
        last = now;
    }
    // The same for rotations.
    let turned = |i: usize| {
        let mut p = drawn.clone();
        let a = 0.001 * i as f32;
        for j in 0..p.x.len() {
            let (tx, ty) = (p.tx[j], p.ty[j]);
            p.tx[j] = tx * libm::cosf(a) - ty * libm::sinf(a);
            p.ty[j] = tx * libm::sinf(a) + ty * libm::cosf(a);
        }
        p
    };
    let mut last = c.log_likelihood(&drawn.slice());
    for i in 1..400 {
        let now = c.log_likelihood_with(&turned(i).slice(), &mut scratch);
        assert!((now - last).abs() < 5.0, "turn {i}: {last} {now}");
        last = now;
    }
}

#[test]
fn nothing_in_view_is_worse_than_a_bad_match() {
    let seen = clutter(128, 128, 10, 11);
    let c = prepare(&seen, 128);
    let nothing = c.log_likelihood(&Contours::new(128, 128).slice());
    let exact = 1000.0 * 0.25f64.ln() * 0.5 * 256.0 * std::f64::consts::SQRT_2 / 200.0;
    assert!((nothing - exact).abs() < 1e-6, "{nothing} {exact}");
    assert_eq!(nothing, c.log_likelihood(&Contours::new(128, 128).circle(5.0, 5.0, 0.3).slice()));
    let bad = c.log_likelihood(&Contours::new(128, 128).circle(0.5, 0.5, 0.49).slice());
    assert!(nothing < bad);
    // Shrinking the contour does not escape the penalty.
    let mut last = f64::INFINITY;
    for r in [0.02, 0.01, 0.005, 0.002] {
        let now = c.log_likelihood(&Contours::new(128, 128).circle(0.5, 0.5, r).slice());
        assert!(now < last, "{r}: {now}");
        last = now;
    }
}

#[test]
fn dense_texture_pays_little() {
    let mut seen = Contours::new(128, 128);
    for row in 0..64 {
        for x in 0..128 {
            seen.stroke(x as f32 + 0.5, row as f32 * 2.0 + 0.5, 0.0, 1.0);
        }
    }
    let texture = prepare(&seen, 128);
    let mut line = Contours::new(128, 128);
    for x in 0..128 {
        line.stroke(x as f32 + 0.5, 64.5, 0.0, 1.0);
    }
    let alone = prepare(&line, 128);
    let (t, a) = (texture.log_likelihood(&line.slice()), alone.log_likelihood(&line.slice()));
    assert!(t < 0.35 * a, "{t} {a}");
}

#[test]
fn extremes_give_numbers_or_errors() {
    let seen = clutter(64, 64, 8, 2).map();
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let all = [
            ContourRatioOptions { foreground: bad, ..options() },
            ContourRatioOptions { sd: bad, ..options() },
            ContourRatioOptions { truncate: bad, ..options() },
            ContourRatioOptions { window: bad, ..options() },
            ContourRatioOptions { credit: bad, ..options() },
            ContourRatioOptions { weight: bad, ..options() },
            ContourRatioOptions { unit: bad, ..options() },
            ContourRatioOptions { least: bad, ..options() },
            ContourRatioOptions { nothing: bad, ..options() },
        ];
        for o in all {
            assert!(ContourRatio::prepare(&seen, 64, 64, &o).is_err(), "{o:?}");
        }
    }
    let blank = ContourRatio::prepare(&Contours::new(64, 64).map(), 64, 64, &options()).unwrap();
    let mut drawn = Contours::new(64, 64).circle(0.5, 0.5, 0.3);
    let length = 100.0 * 2.0 * std::f64::consts::PI * 0.3 / std::f64::consts::SQRT_2;
    let expected = length * 0.25f64.ln() * 0.5 / options().unit;
    assert!((blank.log_likelihood(&drawn.slice()) / expected - 1.0).abs() < 1e-4);
    drawn.x[0] = f32::NAN;
    drawn.length[1] = f32::MAX;
    for (sd, truncate) in [(1e-12, 3.3), (1e6, 3.3), (0.4, 1e-9), (0.4, 1e9)] {
        let o = ContourRatioOptions { sd, truncate, ..options() };
        let c = ContourRatio::prepare(&seen, 64, 64, &o).unwrap();
        assert!(c.log_likelihood(&drawn.slice()).is_finite(), "{o:?}");
    }
    let one =
        ContourRatio::prepare(&Contours::new(1, 1).circle(0.5, 0.5, 0.1).map(), 1, 1, &options())
            .unwrap();
    assert!(one.log_likelihood(&Contours::new(1, 1).circle(0.5, 0.5, 0.4).slice()).is_finite());
}

#[test]
fn gradient_is_that_of_differences() {
    let seen = clutter(128, 128, 12, 21).circle(0.5, 0.5, 0.3).map();
    let mut drawn = Contours::new(128, 128).circle(0.52, 0.49, 0.29);
    drawn.stroke(-0.2, 50.3, 1.0, 1.0);
    drawn.stroke(70.3, 128.3, 1.0, 1.0);
    // Smooth scores, so that finite differences approximate derivatives; then too little
    // contour in view, and groups beyond their match capacity.
    let smooth =
        ContourRatioOptions { sd: 3.0, truncate: 12.0, weight: 0.05, credit: 1e9, ..options() };
    for o in [
        smooth.clone(),
        ContourRatioOptions { least: 1e3, ..smooth.clone() },
        ContourRatioOptions { credit: 0.7, ..smooth },
    ] {
        let c = ContourRatio::prepare(&seen, 128, 128, &o).unwrap();
        let mut out = Vec::new();
        c.gradient(&drawn.slice(), &mut Scratch::default(), &mut out);
        let bad = drawn.differing(&out, |e| c.log_likelihood(e));
        assert!(bad <= out.len() / 5, "{o:?}: {bad} of {} differ", 4 * out.len());
    }
}

#[test]
fn what_comes_and_goes_gives_what_is_there_to_the_last_bit() {
    let seen = Contours::new(96, 96).circle(0.5, 0.5, 0.3).circle(0.3, 0.6, 0.2);
    let all =
        Contours::new(96, 96).circle(0.5, 0.5, 0.3).circle(0.5, 0.5, 0.305).circle(0.4, 0.4, 0.35);
    // A small match capacity, so that groups are assigned more than they can match.
    let ratio = ContourRatio::prepare(
        &seen.map(),
        96,
        96,
        &ContourRatioOptions { credit: 0.8, ..options() },
    )
    .unwrap();
    let (mut scratch, mut asked) = (Scratch::default(), 0);
    comings_and_goings(&all, |step, whole| {
        let mut count = 0;
        let elements = || {
            count += 1;
            whole.slice()
        };
        let score = ratio.log_likelihood_after(step, elements, &mut scratch);
        assert_eq!(score.to_bits(), ratio.log_likelihood(&whole.slice()).to_bits());
        // Repeating the same contours does not ask for all of them.
        let again = ratio.log_likelihood_after(step, || panic!("they are known"), &mut scratch);
        assert_eq!(again.to_bits(), score.to_bits());
        asked += count;
    });
    assert!((1..39).contains(&asked), "{asked}");
}
