//! Tests of operators against their definitions.

use crate::nn::convolution::Convolution;
use crate::nn::depthwise::Depthwise;
use crate::nn::resampling::{Alignment, depth_to_space, mean, pad, pool, resize};
use crate::nn::shape::{Clip, Size, Window};
use crate::nn::transposed::Transposed;
use crate::nn::weights::{Kind, Numbers, Sparse, Weights};
use pcadlang_numerics::num::simd::portable;

const FREE: Clip = Clip::NONE;

/// Returns pseudo-random numbers from -1 to 1.
fn numbers(n: usize, seed: u32) -> Vec<f32> {
    let mut s = seed.wrapping_mul(2_654_435_761) | 1;
    let mut next = || {
        s = s.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (s >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..n).map(|_| next()).collect()
}

/// Returns the value at a position that may lie outside the image, where it is 0.
fn value(x: &[f32], s: Size, [row, column]: [isize; 2], channel: usize) -> f64 {
    let inside = (0..s.height as isize).contains(&row) && (0..s.width as isize).contains(&column);
    if inside { f64::from(s.pixel(x, row as usize, column as usize)[channel]) } else { 0.0 }
}

fn near(got: &[f32], expected: &[f64]) {
    near_by(got, expected, 2e-5);
}

fn near_by(got: &[f32], expected: &[f64], by: f64) {
    assert_eq!(got.len(), expected.len());
    for (i, (g, e)) in got.iter().zip(expected).enumerate() {
        assert!((f64::from(*g) - e).abs() < by * (1.0 + e.abs()), "{i}: {g}, {e}");
    }
}

fn le_bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Windows of all kinds, over images whose sizes are not multiples of anything.
fn cases() -> Vec<(Window, Size)> {
    let mut all = Vec::new();
    for (size, stride) in
        [([1, 1], [1, 1]), ([3, 3], [1, 1]), ([3, 3], [2, 2]), ([5, 2], [1, 3]), ([1, 1], [2, 2])]
    {
        for same in [true, false] {
            for (height, width, channels) in
                [(5, 7, 3), (8, 6, 19), (6, 9, 1), (7, 13, 24), (9, 6, 32)]
            {
                let window = Window { size, stride, same, shift: [0, 0] };
                all.push((window, Size { height, width, channels }));
            }
        }
    }
    all
}

/// The numbers of rows and columns that `SAME` pads before the image, by definition.
fn before(w: &Window, from: Size, to: Size) -> [isize; 2] {
    let one = |n: usize, m: usize, i: usize| {
        let all = ((m - 1) * w.stride[i] + w.size[i]) as isize - n as isize;
        if w.same { all.max(0) / 2 } else { 0 }
    };
    [one(from.height, to.height, 0), one(from.width, to.width, 1)]
}

#[test]
fn convolutions() {
    let mut tiled = 0;
    for (k, (w, from)) in cases().into_iter().enumerate() {
        for channels in [1, 16, 21] {
            let to = w.output(from, channels).unwrap();
            let depth = w.size[0] * w.size[1] * from.channels;
            let (x, weights) =
                (numbers(from.len(), k as u32), numbers(channels * depth, 99 + k as u32));
            let biases = numbers(channels, 7);
            let clip = if channels == 21 { Clip { lo: 0.0, hi: 0.5 } } else { FREE };
            let bytes = le_bytes(&weights);
            let stored = Weights::ByOutput(Numbers::new(Kind::Float, &bytes));
            let c = Convolution::new(w, (stored, depth), &biases, clip);
            let (mut out, mut plain) = (vec![9.0; to.len()], vec![9.0; to.len()]);
            let mut own = vec![5.0; c.memory(from, to)];
            c.run(&x, from, to, &mut own, &mut out);
            portable(|| c.run(&x, from, to, &mut own, &mut plain));
            assert_eq!(out, plain, "the same bits with narrow instructions");
            let [top, left] = before(&w, from, to);
            let mut expected = Vec::new();
            for (row, column) in (0..to.height).flat_map(|r| (0..to.width).map(move |c| (r, c))) {
                for o in 0..channels {
                    let mut sum = f64::from(biases[o]);
                    for (i, weight) in weights[o * depth..][..depth].iter().enumerate() {
                        let (tap, channel) = (i / from.channels, i % from.channels);
                        let (ky, kx) = (tap / w.size[1], tap % w.size[1]);
                        let at = [
                            (row * w.stride[0] + ky) as isize - top,
                            (column * w.stride[1] + kx) as isize - left,
                        ];
                        sum += f64::from(*weight) * value(&x, from, at, channel);
                    }
                    expected.push(sum.max(f64::from(clip.lo)).min(f64::from(clip.hi)));
                }
            }
            // By tiles, sums of larger numbers are rounded.
            near_by(&out, &expected, if c.is_tiled(from) { 2e-4 } else { 2e-5 });
            tiled += usize::from(c.is_tiled(from));
        }
    }
    assert!(tiled > 0);
}

/// Weights of halves, in both orders and without those that are 0, give the same bits; and so do
/// windows that are shifted as images that are padded.
#[test]
fn convolutions_whatever_the_form_of_weights_and_padding() {
    let (from, depth) = (Size { height: 6, width: 7, channels: 37 }, 9 * 37);
    for channels in [5, 8, 16, 21] {
        let halves: Vec<half::f16> = numbers(channels * depth, 3)
            .into_iter()
            .enumerate()
            .map(|(i, w)| half::f16::from_f32(if i % 3 == 0 { w } else { 0.0 }))
            .collect();
        let values: Vec<f32> = halves.iter().map(|h| h.to_f32()).collect();
        let by_output: Vec<u8> = halves.iter().flat_map(|h| h.to_le_bytes()).collect();
        let turned = (0..depth).flat_map(|k| (0..channels).map(move |o| o * depth + k));
        let by_input: Vec<u8> = turned.flat_map(|i| halves[i].to_le_bytes()).collect();
        let floats = le_bytes(&values);
        let window = Window { size: [3, 3], stride: [2, 1], same: false, shift: [1, 2] };
        let to = Size { height: 3, width: 9, channels };
        let padded = Size { height: 7, width: 11, channels: 37 };
        let (x, biases) = (numbers(from.len(), 1), numbers(channels, 2));
        let mut around = vec![9.0; padded.len()];
        pad(&x, from, padded, [1, 2, 0], 0.0, &mut around);
        let run = |window: Window, weights: Weights, x: &[f32], from: Size| {
            let c = Convolution::new(window, (weights, depth), &biases, FREE);
            let mut out = vec![9.0; to.len()];
            c.run(x, from, to, &mut vec![5.0; c.memory(from, to)], &mut out);
            out
        };
        let plain = Weights::ByOutput(Numbers::new(Kind::Float, &floats));
        let expected = run(Window { shift: [0, 0], ..window }, plain, &around, padded);
        for weights in [
            Weights::ByOutput(Numbers::new(Kind::Half, &by_output)),
            Weights::ByInput(Numbers::new(Kind::Half, &by_input)),
            Weights::Sparse(Sparse::new(&values, channels).unwrap()),
        ] {
            assert_eq!(run(window, weights, &x, from), expected, "{channels}");
        }
    }
}

#[test]
fn every_finite_half_is_decoded_exactly() {
    let all = (0..=u16::MAX).map(half::f16::from_bits).filter(|h| h.is_finite());
    let bytes: Vec<u8> = all.clone().flat_map(half::f16::to_le_bytes).collect();
    let numbers = Numbers::new(Kind::Half, &bytes);
    assert!(numbers.are_finite());
    let mut decoded = vec![[0.0; 8]; numbers.len() / 8];
    let place = (0, numbers.len() / 8);
    Weights::ByInput(numbers).panel(place, (0, 8), &mut decoded);
    let bits = |x: f32| x.to_bits();
    assert!(decoded.as_flattened().iter().copied().map(bits).eq(all.map(|h| bits(h.to_f32()))));
    for endless in [0x7c00u16, 0xfc00, 0x7e01] {
        assert!(!Numbers::new(Kind::Half, &endless.to_le_bytes()).are_finite());
    }
}

#[test]
fn depthwise_convolutions() {
    for (k, (w, from)) in cases().into_iter().enumerate() {
        let to = w.output(from, from.channels).unwrap();
        let taps = w.size[0] * w.size[1];
        let (x, weights) =
            (numbers(from.len(), k as u32), numbers(taps * from.channels, 5 + k as u32));
        let biases = numbers(from.channels, 3);
        let d =
            Depthwise { window: w, weights: weights.clone(), biases: biases.clone(), clip: FREE };
        let (mut out, mut plain) = (vec![9.0; to.len()], vec![9.0; to.len()]);
        d.run(&x, from, to, &mut out);
        portable(|| d.run(&x, from, to, &mut plain));
        assert_eq!(out, plain);
        let [top, left] = before(&w, from, to);
        let mut expected = Vec::new();
        for (row, column) in (0..to.height).flat_map(|r| (0..to.width).map(move |c| (r, c))) {
            for c in 0..from.channels {
                let each = (0..taps).map(|tap| {
                    let (ky, kx) = (tap / w.size[1], tap % w.size[1]);
                    let at = [
                        (row * w.stride[0] + ky) as isize - top,
                        (column * w.stride[1] + kx) as isize - left,
                    ];
                    f64::from(weights[tap * from.channels + c]) * value(&x, from, at, c)
                });
                expected.push(f64::from(biases[c]) + each.sum::<f64>());
            }
        }
        near(&out, &expected);
    }
}

/// A transposed convolution is the adjoint of the convolution with the same window:
/// `<C x, y> = <x, C' y>`.
#[test]
fn transposed_convolutions() {
    for (size, stride) in [([2, 2], [2, 2]), ([3, 3], [2, 2]), ([4, 3], [2, 1])] {
        let (from, channels) = (Size { height: 4, width: 5, channels: 3 }, 2);
        let window = Window { size, stride, same: true, shift: [0, 0] };
        let taps = size[0] * size[1];
        let weights = numbers(channels * taps * from.channels, 11);
        let t = Transposed { window, weights: weights.clone(), biases: vec![0.0; channels] };
        let to = t.output(from);
        // The convolution's inputs and outputs are swapped: weights by its output
        // channel, tap, and input channel.
        let mut back = vec![0.0; weights.len()];
        for (o, tap, i) in
            (0..channels).flat_map(|o| (0..taps).flat_map(move |t| (0..3).map(move |i| (o, t, i))))
        {
            back[(i * taps + tap) * channels + o] = weights[(o * taps + tap) * 3 + i];
        }
        let bytes = le_bytes(&back);
        let stored = Weights::ByOutput(Numbers::new(Kind::Float, &bytes));
        let c = Convolution::new(window, (stored, back.len() / 3), &[0.0; 3], FREE);
        let (x, y) = (numbers(from.len(), 1), numbers(to.len(), 2));
        let (mut up, mut down) = (vec![0.0; to.len()], vec![0.0; from.len()]);
        t.run(&x, from, to, &mut up);
        c.run(&y, to, from, &mut vec![5.0; c.memory(to, from)], &mut down);
        let product = |a: &[f32], b: &[f32]| {
            a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>()
        };
        assert!((product(&up, &y) - product(&x, &down)).abs() < 1e-5, "{size:?}");
        let biased = Transposed { biases: vec![0.25, -1.0], ..t };
        let mut more = vec![0.0; to.len()];
        biased.run(&x, from, to, &mut more);
        near(
            &more,
            &up.iter()
                .enumerate()
                .map(|(i, u)| f64::from(*u) + [0.25, -1.0][i % 2])
                .collect::<Vec<_>>(),
        );
    }
}

#[test]
fn pictures_of_other_sizes() {
    let row = |width| Size { height: 1, width, channels: 1 };
    let resized = |alignment| {
        let mut out = [0.0; 4];
        resize(&[0.0, 8.0], row(2), row(4), alignment, &mut out);
        out
    };
    assert_eq!(resized(Alignment::HalfPixels), [0.0, 2.0, 6.0, 8.0]);
    assert_eq!(resized(Alignment::First), [0.0, 4.0, 8.0, 8.0]);
    near(&resized(Alignment::Corners), &[0.0, 8.0 / 3.0, 16.0 / 3.0, 8.0]);

    let (from, to) =
        (Size { height: 2, width: 2, channels: 1 }, Size { height: 3, width: 4, channels: 2 });
    let mut out = vec![9.0; to.len()];
    pad(&[1.0, 2.0, 3.0, 4.0], from, to, [1, 2, 1], 0.0, &mut out);
    let places: Vec<(usize, f32)> =
        out.iter().copied().enumerate().filter(|(_, v)| *v != 0.0).collect();
    assert_eq!(places, [(13, 1.0), (15, 2.0), (21, 3.0), (23, 4.0)]);

    let mut out = [0.0; 4];
    depth_to_space(
        &[1.0, 2.0, 3.0, 4.0],
        Size { height: 1, width: 1, channels: 4 },
        from,
        2,
        &mut out,
    );
    assert_eq!(out, [1.0, 2.0, 3.0, 4.0]);

    // The last window extends beyond the border: its mean is over the values inside.
    let window = Window { size: [1, 2], stride: [1, 2], same: true, shift: [0, 0] };
    let (x, to) = ([1.0, -5.0, 7.0], window.output(row(3), 1).unwrap());
    let mut out = [0.0; 2];
    pool(&x, row(3), to, &window, false, &mut out);
    assert_eq!(out, [-2.0, 7.0]);
    pool(&x, row(3), to, &window, true, &mut out);
    assert_eq!(out, [1.0, 7.0]);
    let mut out = [0.0; 2];
    mean(&[1.0, 10.0, 3.0, 30.0], Size { height: 1, width: 2, channels: 2 }, &mut out);
    assert_eq!(out, [2.0, 20.0]);
}
