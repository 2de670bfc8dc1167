//! A simple edge detector, so that the comparison does not depend on the library's own:
//! smoothed colour gradients, ridges with sub-pixel offsets, hysteresis.

use pcadlang_scene::vision::ContourMap;

/// Detects the edges of a picture.
pub fn detect(img: &image::RgbImage) -> ContourMap {
    let (w, h) = (img.width() as usize, img.height() as usize);
    let sigma = 1.4f32;
    let k: Vec<f32> = (-5..=5).map(|i| (-(i * i) as f32 / 2.0 / sigma / sigma).exp()).collect();
    let s: f32 = k.iter().sum();
    let (mut gx, mut gy, mut best) = (vec![0f32; w * h], vec![0f32; w * h], vec![0f32; w * h]);
    for c in 0..3 {
        let mut a: Vec<f32> = img.pixels().map(|p| f32::from(p.0[c])).collect();
        for (dx, dy) in [(1i64, 0i64), (0, 1)] {
            let b = a.clone();
            for y in 0..h as i64 {
                for x in 0..w as i64 {
                    a[y as usize * w + x as usize] = (-5..=5i64)
                        .map(|i| {
                            let u = (x + i * dx).clamp(0, w as i64 - 1) as usize;
                            let v = (y + i * dy).clamp(0, h as i64 - 1) as usize;
                            b[v * w + u] * k[(i + 5) as usize] / s
                        })
                        .sum();
                }
            }
        }
        for y in 1..h - 1 {
            for x in 1..w - 1 {
                let i = y * w + x;
                let (p, q) = (a[i + 1] - a[i - 1], a[i + w] - a[i - w]);
                let m = p.hypot(q);
                if m > best[i] {
                    best[i] = m;
                    gx[i] = p;
                    gy[i] = q;
                }
            }
        }
    }
    let mut ridge = vec![0f32; w * h];
    let mut off = vec![0f32; w * h];
    for y in 1..h - 1 {
        for x in 1..w - 1 {
            let i = y * w + x;
            let m = best[i];
            if m < 1e-3 {
                continue;
            }
            let (nx, ny) = (gx[i] / m, gy[i] / m);
            let at = |t: f32| {
                let (px, py) = (x as f32 + t * nx, y as f32 + t * ny);
                let (x0, y0) = (px as usize, py as usize);
                let (fx, fy) = (px - x0 as f32, py - y0 as f32);
                let (x1, y1) = ((x0 + 1).min(w - 1), (y0 + 1).min(h - 1));
                (best[y0 * w + x0] * (1.0 - fx) + best[y0 * w + x1] * fx) * (1.0 - fy)
                    + (best[y1 * w + x0] * (1.0 - fx) + best[y1 * w + x1] * fx) * fy
            };
            let (a, b) = (at(-1.0), at(1.0));
            if m >= a && m > b {
                ridge[i] = m;
                off[i] = (0.5 * (a - b) / (a - 2.0 * m + b).min(-1e-6)).clamp(-0.5, 0.5);
            }
        }
    }
    let mut sorted: Vec<f32> = best.clone();
    sorted.sort_by(f32::total_cmp);
    let high = sorted[w * h * 88 / 100].max(6.0);
    let low = 0.4 * high;
    let mut keep = vec![false; w * h];
    let mut stack: Vec<usize> = (0..w * h).filter(|&i| ridge[i] >= high).collect();
    while let Some(i) = stack.pop() {
        if keep[i] {
            continue;
        }
        keep[i] = true;
        for d in [1, w - 1, w, w + 1] {
            for j in [i.wrapping_sub(d), i + d] {
                if j < w * h && ridge[j] >= low && !keep[j] {
                    stack.push(j);
                }
            }
        }
    }
    let mut map = ContourMap { width: w as u32, height: h as u32, ..ContourMap::default() };
    for i in (0..w * h).filter(|&i| keep[i]) {
        let (nx, ny) = (gx[i] / best[i], gy[i] / best[i]);
        map.x.push((i % w) as f32 + 0.5 + off[i] * nx);
        map.y.push((i / w) as f32 + 0.5 + off[i] * ny);
        map.tx.push(-ny);
        map.ty.push(nx);
        map.strength.push(best[i]);
    }
    map
}
