//! Tests of features against their definition, of leaves against the rules, and of
//! invalid files.

use super::features::{Features, Plane, smoothed};
use super::writer::{Text, difference, gzip, options, small};
use super::*;
use image::{Rgb, RgbImage};
use pcadlang_numerics::num::fnv1a;

fn forest(text: &Text) -> Result<Forest, String> {
    Forest::read(text.yaml().as_bytes()).map_err(|e| e.to_string())
}

/// A picture of blobs, ramps and noise.
fn picture(width: usize, height: usize) -> Vec<[f32; 3]> {
    let noise = |k: usize| (fnv1a(&k.to_le_bytes()) % 1000) as f32 / 1000.0;
    (0..width * height)
        .map(|k| {
            let (x, y) = ((k % width) as f32, (k / width) as f32);
            let blob = if (x - 20.0).hypot(y - 15.0) < 9.0 { 0.7 } else { 0.2 };
            [
                blob,
                (x / width as f32) * 0.8 + 0.1 * noise(k),
                0.5 + 0.4 * libm::sinf(y / 3.0) * noise(3 * k + 1),
            ]
        })
        .collect()
}

/// The features by their definition, one value at a time in double precision: slow, and
/// independent of the fast code except for the constants.
mod plainly {
    pub struct Picture {
        pub size: [i64; 2],
        pub luv: Vec<[f64; 3]>,
    }

    /// Position `i`, reflected at the ends until it is inside; `twice`: the end pixel is
    /// repeated.
    fn reflected(mut i: i64, n: i64, twice: bool) -> i64 {
        let shift = i64::from(twice);
        loop {
            i = match i {
                _ if n == 1 => return 0,
                i if i < 0 => -i - shift,
                i if i >= n => 2 * n - 2 - i + shift,
                i => return i,
            };
        }
    }

    pub fn luv(p: [f32; 3]) -> [f64; 3] {
        let [r, g, b] = p.map(f64::from);
        let x = 0.430574 * r + 0.341550 * g + 0.178325 * b;
        let y = 0.222015 * r + 0.706655 * g + 0.071330 * b;
        let z = 0.020183 * r + 0.129553 * g + 0.939180 * b;
        let step = (1024.0 * y).floor() / 1024.0;
        let l = if step > 0.008856451679 {
            116.0 * step.powf(1.0 / 3.0) - 16.0
        } else {
            903.2962962963 * step
        };
        let all = x + 15.0 * y + 3.0 * z;
        let (u, v) = (13.0 * l * (4.0 * x / all - 0.197833), 13.0 * l * (9.0 * y / all - 0.468331));
        [l / 270.0, (u + 88.0) / 270.0, (v + 134.0) / 270.0]
    }

    /// Adds 8 reflected pixels around the picture, and more on the right and below up to
    /// a multiple of 4.
    pub fn bordered(rgb: &[[f32; 3]], w: i64, h: i64) -> Picture {
        let up = |n: i64| (n + 16 + 3) / 4 * 4;
        let (bw, bh) = (up(w), up(h));
        let at = |i: i64, j: i64| {
            luv(rgb[(reflected(j - 8, h, true) * w + reflected(i - 8, w, true)) as usize])
        };
        Picture { size: [bw, bh], luv: (0..bw * bh).map(|k| at(k % bw, k / bw)).collect() }
    }

    impl Picture {
        pub fn halved(&self) -> Picture {
            let [w, h] = self.size.map(|n| n / 2);
            let at = |i: i64, j: i64, c: usize| {
                let one = |di, dj| self.luv[((2 * j + dj) * 2 * w + 2 * i + di) as usize][c];
                (one(0, 0) + one(1, 0) + one(0, 1) + one(1, 1)) / 4.0
            };
            let luv = (0..w * h).map(|k| [0, 1, 2].map(|c| at(k % w, k / w, c))).collect();
            Picture { size: [w, h], luv }
        }

        /// The magnitude of the steepest channel's change and its direction in degrees, 0
        /// to 180.
        fn change(&self, i: i64, j: i64) -> (f64, f64) {
            let [w, h] = self.size;
            let at = |i: i64, j: i64, c: usize| {
                self.luv[(reflected(j, h, true) * w + reflected(i, w, true)) as usize][c]
            };
            let all = [0, 1, 2]
                .map(|c| [at(i + 1, j, c) - at(i - 1, j, c), at(i, j + 1, c) - at(i, j - 1, c)]);
            let [x, y] = all
                .into_iter()
                .max_by(|a, b| a[0].hypot(a[1]).total_cmp(&b[0].hypot(b[1])))
                .unwrap();
            (x.hypot(y), y.atan2(x).to_degrees().rem_euclid(180.0))
        }

        /// That magnitude divided by those around it, in a triangle of radius 4, plus
        /// 0.01.
        pub fn magnitude(&self, i: i64, j: i64) -> f64 {
            let [w, h] = self.size;
            let mut around = 0.0;
            for dj in -4..=4i64 {
                for di in -4..=4i64 {
                    let weight = ((5 - di.abs()) * (5 - dj.abs())) as f64 / 625.0;
                    around += weight
                        * self.change(reflected(i + di, w, false), reflected(j + dj, h, false)).0;
                }
            }
            self.change(i, j).0 / (around + 0.01)
        }

        /// The index of a change's direction, of four.
        pub fn bin(&self, i: i64, j: i64) -> usize {
            let (length, angle) = self.change(i, j);
            if length < 1e-5 { 2 } else { (angle / 45.0).round() as usize % 4 }
        }
    }

    /// All 13 channels at half the size.
    pub fn channels(full: &Picture) -> Vec<Vec<f64>> {
        let half = full.halved();
        let [w, h] = half.size;
        let places = || (0..w * h).map(|k| (k % w, k / w));
        let mut all: Vec<Vec<f64>> =
            (0..3).map(|c| half.luv.iter().map(|p| p[c]).collect()).collect();
        let four = |i: i64, j: i64| {
            [(2 * i, 2 * j), (2 * i + 1, 2 * j), (2 * i, 2 * j + 1), (2 * i + 1, 2 * j + 1)]
        };
        let mean = |f: &dyn Fn(i64, i64) -> f64, i, j| {
            four(i, j).iter().map(|(i, j)| f(*i, *j)).sum::<f64>() / 4.0
        };
        all.push(places().map(|(i, j)| mean(&|i, j| full.magnitude(i, j), i, j)).collect());
        for b in 0..4 {
            let part = |i, j| if full.bin(i, j) == b { full.magnitude(i, j) } else { 0.0 };
            all.push(places().map(|(i, j)| mean(&part, i, j)).collect());
        }
        all.push(places().map(|(i, j)| half.magnitude(i, j)).collect());
        for b in 0..4 {
            all.push(
                places()
                    .map(|(i, j)| if half.bin(i, j) == b { half.magnitude(i, j) } else { 0.0 })
                    .collect(),
            );
        }
        all
    }

    /// A sample smoothed in both directions by a triangle.
    pub fn triangle(channel: &[f64], w: i64, h: i64, i: i64, j: i64, r: i64) -> f64 {
        let mut sum = 0.0;
        for dj in -r..=r {
            for di in -r..=r {
                let weight = ((r + 1 - di.abs()) * (r + 1 - dj.abs())) as f64
                    / ((r + 1) * (r + 1)).pow(2) as f64;
                sum += weight
                    * channel
                        [(reflected(j + dj, h, false) * w + reflected(i + di, w, false)) as usize];
            }
        }
        sum
    }
}

#[test]
fn features_are_what_the_definition_says() {
    let o = *forest(&small()).unwrap().options();
    for (w, h) in [(40, 28), (37, 23), (3, 50)] {
        let rgb = picture(w, h);
        let fast = Features::of(&rgb, w, h, &o);
        let full = plainly::bordered(&rgb, w as i64, h as i64);
        let slow = plainly::channels(&full);
        let [fw, fh] = full.size.map(|n| n / 2);
        assert_eq!((fast.width as i64, fast.height as i64, fast.channels), (fw, fh, 13));
        // A direction halfway between two may fall to either in single precision; such
        // pixels are rare.
        let (mut off, mut all) = (0, 0);
        for (c, channel) in slow.iter().enumerate() {
            for k in 0..fw * fh {
                let (i, j) = (k % fw, k / fw);
                for (values, radius) in [(&fast.plain, 1), (&fast.similar, 4)] {
                    let expected = plainly::triangle(channel, fw, fh, i, j, radius);
                    let got = f64::from(values[k as usize * 13 + c]);
                    all += 1;
                    off += usize::from((got - expected).abs() > 2e-5 * (1.0 + expected.abs()));
                }
            }
        }
        assert!(off * 1000 <= all, "{off} of {all} features of {w} x {h} pixels differ");
    }
}

#[test]
fn triangles() {
    let plane = Plane { width: 5, height: 1, data: vec![0.0, 0.0, 9.0, 0.0, 0.0] };
    assert_eq!(smoothed(&plane, 0), plane);
    // There is only one row, which is its own mirror image.
    let close = |a: &[f32], b: [f32; 5]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(close(&smoothed(&plane, 1).data, [0.0, 2.25, 4.5, 2.25, 0.0]));
    // The end pixels count once: the first pixel has the second one on both sides.
    assert!(close(&smoothed(&plane, 2).data, [2.0, 2.0, 3.0, 2.0, 2.0]));
}

#[test]
fn a_small_forest_finds_the_sides_of_a_square() {
    let photo = Photo::from_rgb(RgbImage::from_fn(160, 120, |x, y| {
        Rgb(if (50..110).contains(&x) && (30..90).contains(&y) {
            [230, 228, 225]
        } else {
            [40, 42, 45]
        })
    }))
    .unwrap();
    let forest = forest(&small()).unwrap();
    let map = forest.map(&photo, 512);
    assert_eq!((map.width, map.height, map.values.len()), (160, 120, 160 * 120));
    assert!(map.values.iter().all(|v| (0.0..=2.0).contains(v)));
    let found = map.contours(1.0);
    let mut sides = [0; 4];
    for k in 0..found.len() {
        let (x, y) = (found.x[k], found.y[k]);
        // In the middle of a side, far from the corners.
        if found.strength[k] > 0.08 && (55.0..105.0).contains(&x) && (y - 60.0).abs() > 20.0 {
            assert!(found.tx[k].abs() > 0.9, "{x} {y}");
            sides[usize::from(y > 60.0)] +=
                i32::from((y - 30.0).abs() < 2.0 || (y - 90.0).abs() < 2.0);
        }
        if found.strength[k] > 0.08 && (35.0..85.0).contains(&y) && (x - 80.0).abs() > 20.0 {
            assert!(found.ty[k].abs() > 0.9, "{x} {y}");
            sides[2 + usize::from(x > 80.0)] +=
                i32::from((x - 50.0).abs() < 2.0 || (x - 110.0).abs() < 2.0);
        }
    }
    assert!(sides.iter().all(|n| *n >= 40), "{sides:?}");
    // The compressed file gives the same forest.
    assert_eq!(Forest::read(&gzip(small().yaml().as_bytes())).unwrap(), forest);
}

/// OpenCV's rules for one patch, worked out by hand: position selects the tree, and one
/// feature the leaf.
#[test]
fn leaves_fall_where_the_rules_say() {
    // One tree of one leaf with one pixel, in row 3 and column 5 of the central part of a
    // patch.
    let one = Text {
        options: options(1, 1),
        children: vec![0],
        features: vec![0],
        thresholds: vec![0.0],
        boundaries: vec![0, 1],
        pixels: vec![5 * 16 + 3],
    };
    let forest = forest(&one).unwrap();
    let photo = Photo::from_rgb(RgbImage::from_pixel(24, 20, Rgb([90, 90, 90]))).unwrap();
    let map = forest.map(&photo, 512);
    // With a border of 8 there are (40 - 32) / 2 = 4 patches across and 2 down; each
    // contributes 2 * 4 / 256.
    let mut said = vec![0.0f32; 24 * 20];
    for (i, j) in (0..2).flat_map(|i| (0..4).map(move |j| (i, j))) {
        said[(2 * i + 3) * 24 + 2 * j + 5] = 8.0 / 256.0;
    }
    let expected = smoothed(&Plane { width: 24, height: 20, data: said }, 1).data;
    assert_eq!(map.values, expected);
}

#[test]
fn places_of_the_grid_and_numbers_of_features() {
    // 16 x 16 cells of 13 channels, and differences of 25 positions; the last one is of
    // positions 23 and 24.
    let o = *forest(&small()).unwrap().options();
    assert_eq!((o.plain(), o.pairs()), (3328, 3900));
    assert_eq!(
        (difference(0, 1), difference(0, 24), difference(1, 2), difference(23, 24)),
        (3328, 3351, 3352, 3627)
    );
}

#[test]
fn tiny_pictures_have_no_contours() {
    let forest = forest(&small()).unwrap();
    for (w, h) in [(1, 1), (1, 300), (7, 2), (16, 16)] {
        let photo = Photo::from_rgb(RgbImage::from_pixel(w, h, Rgb([5, 90, 200]))).unwrap();
        let map = forest.map(&photo, 512);
        assert!(map.values.len() == (w * h) as usize && map.values.iter().all(|v| *v == 0.0));
    }
}

#[test]
fn files_that_cannot_be_used() {
    let changed = |change: &dyn Fn(&mut Text)| {
        let mut text = small();
        change(&mut text);
        forest(&text).map(|_| ()).unwrap_err()
    };
    let set = |name: &'static str, value: usize| {
        changed(&move |t: &mut Text| {
            t.options.iter_mut().filter(|o| o.0 == name).for_each(|o| o.1 = value)
        })
    };
    for (why, text) in [
        (set("stride", 0), "`stride` must be from 1 to 128, not 0"),
        (set("stride", 3), "`stride` must be a multiple"),
        (set("shrinkNumber", 3), "must be even"),
        (set("patchSize", 1000), "`patchSize` must be from 2 to 128"),
        (set("patchInnerSize", 64), "must be even"),
        (set("numberOfTrees", 3), "14 nodes cannot be those of 3 trees"),
        (set("numberOfTreesToEvaluate", 3), "at most `numberOfTrees`"),
        (set("selfsimilarityGridSize", 9), "at most half"),
        (changed(&|t| t.options.truncate(5)), "the option `gradientSmoothingRadius` is missing"),
        (changed(&|t| t.options.push(("stride", 2))), "the option `stride` occurs twice"),
        (changed(&|t| t.options.clear()), "there are no `options`"),
        (changed(&|t| t.children[2] = 3), "node 2 of tree 0 has the child 3"),
        (changed(&|t| t.children[0] = 7), "node 0 of tree 0 has the child 7"),
        (changed(&|t| t.children[7 + 2] = 2), "node 2 of tree 1 has the child 2"),
        (changed(&|t| t.features[0] = 7228), "node 0 of tree 0 asks for feature 7228 of 7228"),
        (changed(&|t| t.thresholds.truncate(13)), "14 numbers of `childs`, but 13 of `thresholds`"),
        (
            changed(&|t| t.boundaries.truncate(10)),
            "14 nodes need 15 numbers of `edgeBoundaries`, not 10",
        ),
        (changed(&|t| t.boundaries[3] = 40), "must be ascending"),
        (changed(&|t| *t.boundaries.last_mut().unwrap() = 129), "at most 128"),
        (changed(&|t| t.pixels[0] = 13 * 256), "a patch's middle has 256 pixels"),
        (changed(&|t| t.pixels[0] = 70_000), "70000 is not a whole number from 0 to 65535"),
    ] {
        assert!(why.contains(text), "{why:?} does not say {text:?}");
    }
    let read = |text: &str| Forest::read(text.as_bytes()).unwrap_err().to_string();
    assert!(read("1").contains("a number without a name"));
    assert!(read("options:\n  stride: 2\noptions:\n").contains("line 3: `options` occurs twice"));
    assert!(read("childs:\n  x: 2\n").contains("line 2: unexpected `x`"));
    assert!(read("options: [ 2 ]").contains("an option has no name"));
    assert!(read("childs: [ 1.5 ]").contains("1.5 is not a whole number"));
    assert!(read("childs: [ -1 ]").contains("-1 is not a whole number"));
    assert!(read("").contains("there are no `options`"));
}

#[test]
fn no_part_of_a_file_is_a_file() {
    let packed = gzip(small().yaml().as_bytes());
    for n in 0..packed.len() {
        assert!(Forest::read(&packed[..n]).is_err(), "the first {n} of {} bytes", packed.len());
    }
    let mut x = 9u64;
    for _ in 0..3000 {
        let mut text = small().yaml().into_bytes();
        for _ in 0..3 {
            x = x.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let at = (x >> 33) as usize % text.len();
            text[at] = b"0123456789-.,[]e: \n\xff"[(x >> 20) as usize % 20];
        }
        // Every forest that can be read can be evaluated.
        if let Ok(forest) = Forest::read(&text) {
            let photo = Photo::from_rgb(RgbImage::from_fn(30, 20, |x, y| {
                Rgb([(8 * x) as u8, 99, (9 * y) as u8])
            }))
            .unwrap();
            assert_eq!(forest.map(&photo, 64).values.len(), 600);
        }
    }
}

/// A file of a few kilobytes that decompresses to much more is rejected before it takes
/// memory.
#[test]
fn bombs_do_not_go_off() {
    let mut bomb = b"childs:\n   - [".to_vec();
    bomb.resize(bomb.len() + (64 << 20), b' ');
    assert!(Forest::read(&gzip(&bomb)).unwrap_err().to_string().contains("a list has no end"));
    let mut numbers = b"childs:\n   - [ 1".to_vec();
    (0..(1 << 23) + 1).for_each(|_| numbers.extend(b",1"));
    assert!(
        Forest::read(&gzip(&numbers)).unwrap_err().to_string().contains("the forest is too large")
    );
}

/// Measures the time to read a text as long as the paper's forest:
/// `cargo test --release --lib forest_of_full_size -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn forest_of_full_size() {
    let say = |text: String| {
        std::io::Write::write_all(&mut std::io::stdout(), format!("{text}\n").as_bytes()).unwrap()
    };
    let (trees, each, leaf) = (8usize, 60_001usize, 100usize);
    let mut text = Text { options: options(trees, 4), ..small() };
    text.children = (0..trees * each)
        .map(|k| k % each)
        .map(|k| if 2 * k + 2 < each { 2 * k as u32 + 2 } else { 0 })
        .collect();
    text.features = (0..trees * each).map(|k| (fnv1a(&k.to_le_bytes()) % 7228) as u32).collect();
    text.thresholds =
        (0..trees * each).map(|k| (fnv1a(&(k + 7).to_le_bytes()) % 1000) as f32 / 5000.0).collect();
    let is_leaf = |k: usize| text.children[k] == 0;
    text.boundaries = (0..trees * each)
        .scan(0, |n, k| {
            *n += if is_leaf(k) { leaf as u32 } else { 0 };
            Some(*n)
        })
        .collect();
    text.boundaries.insert(0, 0);
    text.pixels = (0..*text.boundaries.last().unwrap()).map(|k| k * 7 % 256).collect();
    let (yaml, begun) = (text.yaml(), std::time::Instant::now());
    let forest = Forest::read(yaml.as_bytes()).unwrap();
    say(format!("{} MB of text: {:.2} s", yaml.len() >> 20, begun.elapsed().as_secs_f64()));
    let (packed, begun) = (gzip(yaml.as_bytes()), std::time::Instant::now());
    Forest::read(&packed).unwrap();
    say(format!("{} MB packed: {:.2} s", packed.len() >> 20, begun.elapsed().as_secs_f64()));
    let rgb = RgbImage::from_fn(481, 321, |x, y| {
        Rgb([(x * 7 % 256) as u8, (y * 5 % 256) as u8, ((x / 40 + y / 40) * 60) as u8])
    });
    let (photo, begun) = (Photo::from_rgb(rgb).unwrap(), std::time::Instant::now());
    let map = forest.map(&photo, 512);
    say(format!("a map of {} x {}: {:.3} s", map.width, map.height, begun.elapsed().as_secs_f64()));
}
