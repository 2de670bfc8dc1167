//! Thinning a map of strengths to lines one pixel wide without tearing them: pixels are removed from the weakest to the
//! strongest, and from the rim inwards among equals, as long as the lines around stay connected (ordered homotopic thinning,
//! Pudney 1998, "Distance-ordered homotopic thinning", CVIU 72, 404-413).

use super::distance_transform::distance_transform;

/// The eight neighbours in circular order, from the north.
const RING: [(i64, i64); 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// Which pixels of a map (0: nothing) are left; `width * height` values.
pub(super) fn thinned(width: u32, height: u32, map: &[u8]) -> Vec<bool> {
    let (w, h) = (width as i64, height as i64);
    let mut set: Vec<bool> = map.iter().map(|&v| v > 0).collect();
    // Distances to the nearest empty pixel; beyond the border nothing is set.
    let (pw, ph) = (width as usize + 2, height as usize + 2);
    let mut empty = vec![true; pw * ph];
    for (k, &s) in set.iter().enumerate() {
        empty[(k / width.max(1) as usize + 1) * pw + k % width.max(1) as usize + 1] = !s;
    }
    let padded = distance_transform(width + 2, height + 2, &empty).values;
    let depth = |k: usize| padded[(k / width as usize + 1) * pw + k % width as usize + 1];

    let mut order: Vec<usize> = (0..set.len()).filter(|&k| set[k]).collect();
    order.sort_by(|&a, &b| map[a].cmp(&map[b]).then(depth(a).total_cmp(&depth(b))).then(a.cmp(&b)));
    let neighbour = |k: usize, (dx, dy): (i64, i64)| {
        let (x, y) = (k as i64 % w + dx, k as i64 / w + dy);
        (x >= 0 && y >= 0 && x < w && y < h).then_some((y * w + x) as usize)
    };
    // Removing a pixel may free an earlier one, so until nothing changes.
    loop {
        let before = order.len();
        order.retain(|&k| {
            let ring = RING.map(|o| neighbour(k, o).filter(|&n| set[n]));
            let remove = is_simple(&ring.map(|n| n.is_some())) && !is_end(k, &ring, map, &depth);
            if remove {
                set[k] = false;
            }
            !remove
        });
        if order.len() == before {
            return set;
        }
    }
}

/// Whether the set neighbours stay in one piece, and the empty ones too, without the pixel: the 8-connectivity number is 1
/// (Yokoi, Toriwaki & Fukumura 1975), which is false inside areas and for lone pixels.
fn is_simple(ring: &[bool; 8]) -> bool {
    let empty = |i: usize| u8::from(!ring[i % 8]);
    let number: u8 = (0..4).map(|i| empty(2 * i) - empty(2 * i) * empty(2 * i + 1) * empty(2 * i + 2)).sum();
    number == 1
}

/// Whether a pixel is the end of a line, rather than of a spur: one neighbour, or two side by side, that are neither much
/// stronger nor deeper inside.
fn is_end(k: usize, ring: &[Option<usize>; 8], map: &[u8], depth: &dyn Fn(usize) -> f32) -> bool {
    let count = ring.iter().flatten().count();
    let close = (0..8).any(|i| ring[i].is_some() && ring[(i + 1) % 8].is_some());
    (count == 1 || count == 2 && close)
        && ring.iter().flatten().all(|&n| 10 * u16::from(map[k]) >= 8 * u16::from(map[n]) && depth(k) >= depth(n) - 0.3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(set: &[bool]) -> usize {
        set.iter().filter(|&&s| s).count()
    }

    /// Number of 8-connected pieces.
    fn pieces(w: usize, set: &[bool]) -> usize {
        let mut left: Vec<bool> = set.to_vec();
        let mut n = 0;
        while let Some(k) = left.iter().position(|&s| s) {
            n += 1;
            let mut todo = vec![k];
            left[k] = false;
            while let Some(k) = todo.pop() {
                for (dx, dy) in RING {
                    let (x, y) = (k as i64 % w as i64 + dx, k as i64 / w as i64 + dy);
                    let m = (y * w as i64 + x) as usize;
                    if x >= 0 && y >= 0 && x < w as i64 && m < left.len() && left[m] {
                        left[m] = false;
                        todo.push(m);
                    }
                }
            }
        }
        n
    }

    #[test]
    fn thin_lines_stay() {
        let mut map = vec![0u8; 400];
        for i in 2..18 {
            map[5 * 20 + i] = 255;
            map[i * 20 + i] = map[i * 20 + i].max(120);
        }
        map[19 * 20] = 9;
        let set = thinned(20, 20, &map);
        let gone = (0..400).filter(|&k| (map[k] > 0) != set[k]).count();
        // Where they cross they are thicker than a pixel.
        assert!(gone <= 2, "{gone}");
        assert!(set[19 * 20] && set[5 * 20 + 2] && set[17 * 20 + 17]);
    }

    #[test]
    fn bars_become_their_middle() {
        for thick in [2usize, 3, 4, 5] {
            for upright in [false, true] {
                let mut map = vec![0u8; 900];
                for j in 0..thick {
                    for i in 4..26 {
                        map[if upright { i * 30 + 12 + j } else { (12 + j) * 30 + i }] = 255;
                    }
                }
                let set = thinned(30, 30, &map);
                assert_eq!(pieces(30, &set), 1, "{thick} {upright}");
                assert!((22 - thick..=23).contains(&count(&set)), "{thick} {upright}: {}", count(&set));
                let middle = 12.0 + (thick as f32 - 1.0) / 2.0;
                for k in (0..900).filter(|&k| set[k]) {
                    let across = if upright { k % 30 } else { k / 30 } as f32;
                    assert!((across - middle).abs() <= 1.0, "{thick} {upright} {across}");
                }
            }
        }
    }

    #[test]
    fn soft_rings_become_rings() {
        let map: Vec<u8> = (0..3600)
            .map(|k| {
                let (x, y) = ((k % 60) as f32 - 29.7, (k / 60) as f32 - 30.2);
                let r = (x * x + y * y).sqrt() - 20.0;
                (250.0 * (-r * r / 8.0).exp()) as u8
            })
            .collect();
        let set = thinned(60, 60, &map);
        assert_eq!(pieces(60, &set), 1);
        assert!((100..=130).contains(&count(&set)), "{}", count(&set));
        assert!((0..3600).filter(|&k| set[k]).all(|k| map[k] > 200));
    }
}
