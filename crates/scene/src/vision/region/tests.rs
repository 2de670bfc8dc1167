//! Comparisons with a brute-force urn, enumeration of all pictures of a few pixels, and
//! calibration on simulated pictures.

use super::*;
use pcadlang_numerics::rng::{Purpose, StreamKey};

const GLOBAL: RegionOptions =
    RegionOptions { power: 1.0, tiles: 0, tile_power: 0.0, colours: 4, prior: 0.5, shading: 0.0 };

/// The weighted log-probability of the colours if everything is background. Added to the
/// log-likelihood it gives the log-probability itself (without shading).
fn log_background(region: &Region) -> f64 {
    region.options.power * region.empty
        + region.options.by_tile() * region.empty_tiles.iter().sum::<f64>()
}

fn stream(step: u64) -> Stream {
    StreamKey::new(11, 0, Purpose::PREDICT).stream(step, 0, 0)
}

fn random(n: usize, below: usize, step: u64) -> Vec<u8> {
    let mut rng = stream(step);
    (0..n).map(|_| rng.index(below) as u8).collect()
}

/// The log-probability of labels, pixel by pixel.
fn reference(
    labels: &[u8],
    groups: &[u8],
    size: (u32, u32),
    colours: usize,
    o: &RegionOptions,
) -> f64 {
    let term = |tiles: u32| {
        let mut urns = std::collections::BTreeMap::<_, Vec<f64>>::new();
        let mut sum = 0.0;
        for (i, (l, g)) in labels.iter().zip(groups).enumerate() {
            let (x, y) = (i as u32 % size.0, i as u32 / size.0);
            let urn = urns.entry((x * tiles / size.0, y * tiles / size.1, *g));
            let urn = urn.or_insert_with(|| vec![o.prior; colours]);
            sum += libm::log(urn[usize::from(*l)] / urn.iter().sum::<f64>());
            urn[usize::from(*l)] += 1.0;
        }
        sum
    };
    let tiles = if o.tiles > 0 { o.tile_power * term(o.tiles) } else { 0.0 };
    o.power * term(1) + tiles
}

#[test]
fn agrees_with_one_pixel_after_another() {
    for (step, (w, h)) in [(17, 13), (8, 8), (3, 20), (1, 1), (40, 31)].into_iter().enumerate() {
        let n = (w * h) as usize;
        let labels = random(n, 5, step as u64);
        let picture = Quantised::new(w, h, 5, labels.clone()).unwrap();
        for (tiles, power, tile_power, most) in
            [(3, 0.3, 0.7, 2), (0, 1.0, 0.4, 4), (8, 0.0, 1.0, 16), (5, 1.0, 0.0, 3)]
        {
            let o = RegionOptions { power, tiles, tile_power, ..GLOBAL };
            let region = Region::of(&picture, &o).unwrap();
            let groups = random(n, most, 100 + step as u64);
            let (got, background) = (region.log_likelihood(&groups, &[]), log_background(&region));
            let expected = reference(&labels, &groups, (w, h), 5, &o);
            assert!(
                (got + background - expected).abs() < 1e-9 * expected.abs().max(1.0),
                "{got} {expected}"
            );
            let nothing = reference(&labels, &vec![0; n], (w, h), 5, &o);
            assert!((background - nothing).abs() < 1e-9 * nothing.abs().max(1.0));
            assert_eq!(region.log_likelihood(&vec![0; n], &[]), 0.0);
            assert_eq!(region.log_likelihood(&[], &[]), 0.0);
            // If all of it is the object, in one group, only the name of the group
            // changes.
            assert!(region.log_likelihood(&vec![1; n], &[]).abs() < 1e-9 * expected.abs().max(1.0));
        }
    }
}

#[test]
fn probabilities_of_all_pictures_sum_to_one() {
    for (colours, tiles, groups) in [
        (3usize, 0, [0, 1, 1, 0, 2, 1]),
        (3, 2, [0, 1, 1, 0, 2, 1]),
        (2, 3, [1, 1, 1, 0, 0, 1]),
        (2, 0, [0; 6]),
    ] {
        let (power, tile_power) = if tiles == 0 { (1.0, 0.0) } else { (0.0, 1.0) };
        let o = RegionOptions { power, tiles, tile_power, ..GLOBAL };
        assert!(o.is_proper());
        let mut sum = 0.0;
        for code in 0..colours.pow(6) {
            let labels = (0..6).map(|i| (code / colours.pow(i) % colours) as u8).collect();
            let region = Region::of(&Quantised::new(3, 2, colours, labels).unwrap(), &o).unwrap();
            sum += libm::exp(region.log_likelihood(&groups, &[]) + log_background(&region));
        }
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }
}

#[test]
fn draws_have_the_probabilities_that_are_scored() {
    let groups = [0, 1, 0, 1];
    for (power, tiles, tile_power) in [(1.0, 0, 0.0), (0.0, 2, 1.0)] {
        let o = RegionOptions { power, tiles, tile_power, ..GLOBAL };
        let template = Region::of(&Quantised::new(4, 1, 2, vec![0; 4]).unwrap(), &o).unwrap();
        let mut rng = stream(5);
        let (n, mut seen) = (40_000, [0.0; 16]);
        for _ in 0..n {
            let labels = template.simulate(&groups, &mut rng);
            seen[labels.iter().fold(0, |code, l| code * 2 + usize::from(*l))] += 1.0;
        }
        let mut chi2 = 0.0;
        for (code, seen) in seen.into_iter().enumerate() {
            let labels = (0..4).rev().map(|i| (code >> i & 1) as u8).collect();
            let region = Region::of(&Quantised::new(4, 1, 2, labels).unwrap(), &o).unwrap();
            let expected = f64::from(n)
                * libm::exp(region.log_likelihood(&groups, &[]) + log_background(&region));
            chi2 += (seen - expected) * (seen - expected) / expected;
        }
        // 15 degrees of freedom: exceeded with probability 0.001.
        assert!(chi2 < 37.7, "{chi2}");
    }
}

#[test]
fn draws_are_within_tiles_only_where_nothing_else_counts() {
    let picture = Quantised::new(16, 16, 3, vec![0; 256]).unwrap();
    let groups = random(256, 3, 31);
    let draws = |power: f64, tiles: u32, tile_power: f64| {
        let o = RegionOptions { power, tiles, tile_power, ..GLOBAL };
        Region::of(&picture, &o).unwrap().simulate(&groups, &mut stream(32))
    };
    let whole = draws(1.0, 0, 0.0);
    assert_eq!(draws(0.3, 4, 0.7), whole);
    assert_eq!(draws(1.0, 4, 0.0), whole);
    assert_ne!(draws(0.0, 4, 1.0), whole);
}

/// Discs of unknown position and radius on 24 x 24 pixels: ranks of the truth in exact
/// posteriors of pictures simulated from it. Returns the chi-square of 10 bins (9 degrees
/// of freedom) for the horizontal position and for the radius.
fn calibration(simulated: &RegionOptions, scored: &RegionOptions) -> [f64; 2] {
    const SIDE: usize = 24;
    let mut states = Vec::new();
    for i in 0..6 {
        for j in 0..6 {
            for r in 0..5 {
                states.push((
                    7.0 + 2.0 * f64::from(i),
                    7.0 + 2.0 * f64::from(j),
                    3.0 + f64::from(r),
                ));
            }
        }
    }
    let disc = |&(cx, cy, r): &(f64, f64, f64)| -> Vec<u8> {
        let at = |i: usize, c: f64| i as f64 + 0.5 - c;
        let inside = |p: usize| at(p % SIDE, cx).powi(2) + at(p / SIDE, cy).powi(2) < r * r;
        (0..SIDE * SIDE).map(|p| u8::from(inside(p))).collect()
    };
    let groups: Vec<Vec<u8>> = states.iter().map(disc).collect();
    let blank = Quantised::new(SIDE as u32, SIDE as u32, 4, vec![0; SIDE * SIDE]).unwrap();
    let template = Region::of(&blank, simulated).unwrap();
    let mut rng = stream(9);
    let (runs, mut bins) = (600, [[0.0; 10]; 2]);
    for _ in 0..runs {
        let truth = rng.index(states.len());
        let labels = template.simulate(&groups[truth], &mut rng);
        let region =
            Region::of(&Quantised::new(SIDE as u32, SIDE as u32, 4, labels).unwrap(), scored)
                .unwrap();
        let mut tally = Tally::default();
        let logs: Vec<f64> =
            groups.iter().map(|g| region.log_likelihood_after(g, &[], &mut tally)).collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|l| libm::exp(l - most)).collect();
        let all: f64 = weights.iter().sum();
        let of = |s: &(f64, f64, f64)| [s.0, s.2];
        for (d, bins) in bins.iter_mut().enumerate() {
            let x = of(&states[truth])[d];
            // Ties are broken at random, so that the rank of a discrete quantity is
            // uniform too.
            let (mut below, mut equal) = (0.0, 0.0);
            for (s, w) in states.iter().zip(&weights) {
                below += if of(s)[d] < x { *w } else { 0.0 };
                equal += if of(s)[d] == x { *w } else { 0.0 };
            }
            let rank = (below + rng.uniform() * equal) / all;
            bins[((rank * 10.0) as usize).min(9)] += 1.0;
        }
    }
    let expected = f64::from(runs) / 10.0;
    bins.map(|b| b.iter().map(|n| (n - expected) * (n - expected) / expected).sum())
}

#[test]
fn posteriors_of_simulated_pictures_are_calibrated() {
    // With many prior counts the two groups look much alike, so that posteriors are wide.
    let global = RegionOptions { prior: 12.0, ..GLOBAL };
    let tiled = RegionOptions { power: 0.0, tiles: 3, tile_power: 1.0, ..global.clone() };
    for o in [&global, &tiled] {
        let chi2 = calibration(o, o);
        // Exceeded with probability 0.001.
        assert!(chi2.iter().all(|c| *c < 27.9), "{chi2:?}");
    }
    // Deliberate errors are detected: a power of 3, and a wrong prior.
    let thrice = RegionOptions { power: 3.0, ..global.clone() };
    let other = RegionOptions { prior: 0.05, ..global.clone() };
    for wrong in [thrice, other] {
        let chi2 = calibration(&global, &wrong);
        assert!(chi2.iter().any(|c| *c > 50.0), "{chi2:?}");
    }
}

#[test]
fn the_true_silhouette_wins_on_a_photograph() {
    let side = 48u32;
    let inside = |cx: f64, x: u32, y: u32| {
        let (dx, dy) = (f64::from(x) + 0.5 - cx, f64::from(y) + 0.5 - 24.0);
        dx * dx + dy * dy < 144.0
    };
    let mut rng = stream(21);
    let rgb = image::RgbImage::from_fn(side, side, |x, y| {
        let base = if inside(20.0, x, y) { [180, 90, 40] } else { [90, 110, 60] };
        image::Rgb(base.map(|b: u8| b.saturating_add(rng.index(50) as u8)))
    });
    let photo = Photo::from_rgb(rgb).unwrap();
    let groups = |cx: f64| -> Vec<u8> {
        (0..side * side).map(|p| u8::from(inside(cx, p % side, p / side))).collect()
    };
    for o in [RegionOptions::default(), RegionOptions { power: 0.0, ..RegionOptions::default() }] {
        let region = Region::prepare(&photo, side, side, &o).unwrap();
        let at = |cx: f64| region.log_likelihood(&groups(cx), &[]);
        assert!(
            at(20.0) > at(21.0) && at(21.0) > at(23.0) && at(23.0) > at(30.0) && at(20.0) > 0.0
        );
    }
}

#[test]
fn options_are_checked_and_uniform_pictures_say_nothing() {
    let picture = Quantised::new(4, 4, 1, vec![0; 16]).unwrap();
    let d = RegionOptions::default;
    for bad in [
        RegionOptions { power: -0.1, ..d() },
        RegionOptions { power: f64::NAN, ..d() },
        RegionOptions { tiles: 65, ..d() },
        RegionOptions { tile_power: f64::INFINITY, ..d() },
        RegionOptions { colours: 1, ..d() },
        RegionOptions { colours: 257, ..d() },
        RegionOptions { prior: 0.0, ..d() },
        RegionOptions { shading: -1.0, ..d() },
    ] {
        assert!(Region::of(&picture, &bad).is_err(), "{bad:?}");
    }
    let region = Region::of(&picture, &d()).unwrap();
    assert!(region.log_likelihood(&random(16, 2, 3), &[]).abs() < 1e-12);
    assert_eq!(region.options(), &d());
    assert!(
        !d().is_proper()
            && GLOBAL.is_proper()
            && !RegionOptions { shading: 0.1, ..GLOBAL }.is_proper()
    );
}

#[test]
fn a_tally_follows_pictures_bit_for_bit() {
    let (w, h, n) = (37, 29, 37 * 29);
    let picture = Quantised::new(w, h, 5, random(n, 5, 1)).unwrap();
    for o in [
        RegionOptions { power: 0.3, tiles: 6, tile_power: 0.7, ..GLOBAL },
        RegionOptions { power: 0.0, tiles: 3, tile_power: 1.0, ..GLOBAL },
        GLOBAL,
    ] {
        let region = Region::of(&picture, &o).unwrap();
        let (mut tally, mut groups) = (Tally::default(), vec![0; n]);
        let mut rng = stream(4);
        for step in 0..80 {
            // A few pixels, all of another picture, none, or pixels cut off at the end.
            match step % 5 {
                0..3 => {
                    for _ in 0..rng.index(90) {
                        groups[rng.index(n)] = rng.index(4) as u8;
                    }
                }
                3 if step % 2 == 0 => groups = random(n, 1 + step % 6, 50 + step as u64),
                3 => groups.fill(0),
                _ => {}
            }
            let end = if step % 7 == 6 { n - 100 } else { n };
            let got = region.log_likelihood_after(&groups[..end], &[], &mut tally);
            let plain = region.log_likelihood(&groups[..end], &[]);
            assert_eq!(got.to_bits(), plain.to_bits(), "step {step}");
        }
    }
}
