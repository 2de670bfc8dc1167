//! Area-averaged resizing: every target pixel is the mean of the source over the
//! rectangle it covers, so the overall mean is preserved. It is not meant for enlarging:
//! enlarged pixels become blocks.

/// The source pixels `first..` that each target pixel covers along one axis, with weights
/// that sum to 1.
fn spans(from: u32, to: u32) -> Vec<(usize, Vec<f64>)> {
    let ratio = f64::from(from) / f64::from(to);
    (0..to)
        .map(|i| {
            // Span ends are exact where they fall on pixel borders.
            let end = |k: u32| (u64::from(k) * u64::from(from)) as f64 / f64::from(to);
            let (a, b) = (end(i), end(i + 1));
            let first = a.floor() as usize;
            let last = (b.ceil() as usize).clamp(first + 1, from as usize);
            let weights = (first..last)
                .map(|s| ((b.min((s + 1) as f64) - a.max(s as f64)) / ratio).max(0.0))
                .collect();
            (first, weights)
        })
        .collect()
}

/// Resizes a picture by area averaging, reading its rows on demand: `row(j, buffer)`
/// fills row `j` (of `width` pixels). A side of 0 gives an empty picture.
pub fn resize_rows<const N: usize>(
    (width, height): (u32, u32),
    (to_width, to_height): (u32, u32),
    mut row: impl FnMut(u32, &mut [[f32; N]]),
) -> Vec<[f32; N]> {
    if width == 0 || height == 0 || to_width == 0 || to_height == 0 {
        return Vec::new();
    }
    let columns = spans(width, to_width);
    let mut source = vec![[0.0f32; N]; width as usize];
    let mut narrow = vec![[0.0f64; N]; to_width as usize];
    let mut read = None;
    let mut out = Vec::with_capacity(to_width as usize * to_height as usize);
    for (first, weights) in spans(height, to_height) {
        let mut sum = vec![[0.0f64; N]; to_width as usize];
        for (k, &wy) in weights.iter().enumerate() {
            if read != Some(first + k) {
                row((first + k) as u32, &mut source);
                read = Some(first + k);
                for (n, (x0, wx)) in narrow.iter_mut().zip(&columns) {
                    *n = [0.0; N];
                    for (p, w) in source.iter().skip(*x0).zip(wx) {
                        for c in 0..N {
                            n[c] += w * f64::from(p[c]);
                        }
                    }
                }
            }
            for (s, n) in sum.iter_mut().zip(&narrow) {
                for c in 0..N {
                    s[c] += wy * n[c];
                }
            }
        }
        out.extend(sum.into_iter().map(|s| s.map(|v| v as f32)));
    }
    out
}

/// Returns the size with the same aspect ratio whose longer side is at most `longer` (at
/// least 1); never larger than the original.
pub fn fitted(width: u32, height: u32, longer: u32) -> (u32, u32) {
    let (side, longer) = (width.max(height), longer.max(1));
    if side <= longer {
        return (width, height);
    }
    let scale = |v: u32| {
        ((u64::from(v) * u64::from(longer) + u64::from(side) / 2) / u64::from(side))
            .clamp(1, u64::from(longer)) as u32
    };
    (scale(width), scale(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resize(w: u32, h: u32, data: &[f32], to: (u32, u32)) -> Vec<f32> {
        resize_rows((w, h), to, |j, row| {
            for (p, v) in row.iter_mut().zip(&data[(j * w) as usize..]) {
                *p = [*v];
            }
        })
        .into_iter()
        .map(|[v]| v)
        .collect()
    }

    #[test]
    fn same_size_is_a_copy() {
        let data: Vec<f32> = (0..35).map(|i| (i * 7 % 11) as f32 / 3.0).collect();
        assert_eq!(resize(7, 5, &data, (7, 5)), data);
    }

    #[test]
    fn halves_average_blocks_and_fractions_are_weighted() {
        assert_eq!(resize(4, 2, &[1.0, 3.0, 5.0, 7.0, 1.0, 3.0, 5.0, 7.0], (2, 1)), [2.0, 6.0]);
        // 3 -> 2: a target pixel is one pixel and half of the next.
        let out = resize(3, 1, &[0.0, 3.0, 6.0], (2, 1));
        assert!((out[0] - 1.0).abs() < 1e-6 && (out[1] - 5.0).abs() < 1e-6, "{out:?}");
    }

    #[test]
    fn the_mean_is_kept() {
        let data: Vec<f32> = (0..31 * 17).map(|i| ((i * 37) % 101) as f32).collect();
        let mean = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / v.len() as f64;
        for to in [(7, 5), (31, 3), (1, 1), (50, 40), (13, 17)] {
            let out = resize(31, 17, &data, to);
            assert_eq!(out.len(), (to.0 * to.1) as usize);
            assert!((mean(&out) - mean(&data)).abs() < 1e-4);
        }
    }

    #[test]
    fn fitted_sizes() {
        assert_eq!(fitted(4000, 3000, 256), (256, 192));
        assert_eq!(fitted(100, 50, 256), (100, 50));
        assert_eq!(fitted(16384, 1, 256), (256, 1));
        assert_eq!(fitted(5, 9, 0), (1, 1));
        assert!(resize(3, 1, &[1.0; 3], (0, 4)).is_empty());
    }
}
