//! Thins a map of strengths to connected lines one pixel wide. Pixels are removed from
//! the weakest to the strongest, and among equals from the rim inwards, as long as the
//! lines around them stay connected (ordered homotopic thinning, Pudney 1998,
//! "Distance-ordered homotopic thinning", CVIU 72, 404-413).

use crate::vision::distance_transform::distance_transform;

/// The eight neighbours in circular order, starting in the north.
const RING: [(i64, i64); 8] =
    [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// Returns which pixels of a map of `width * height` strengths (0: empty) are kept.
pub(in crate::vision) fn thinned(width: u32, height: u32, map: &[u8]) -> Vec<bool> {
    let (w, h) = (width as usize, height as usize);
    // Padded by an empty pixel on every side, so that all pixels of the map have eight
    // neighbours.
    let across = w + 2;
    let mut strength = vec![0u8; across * (h + 2)];
    for (row, out) in map.chunks_exact(w.max(1)).zip(strength.chunks_exact_mut(across).skip(1)) {
        out[1..=w].copy_from_slice(row);
    }
    let mut set: Vec<bool> = strength.iter().map(|&s| s > 0).collect();
    // Distances to the nearest empty pixel.
    let empty: Vec<bool> = set.iter().map(|s| !s).collect();
    let depth = distance_transform(width + 2, height + 2, &empty).values;
    let ring = RING.map(|(dx, dy)| dy * across as i64 + dx);
    let around = |k: usize| ring.map(|o| (k as i64 + o) as usize);

    // The bit patterns of non-negative floats are ordered like the floats.
    let key = |k: usize| (u64::from(strength[k]) << 32 | u64::from(depth[k].to_bits()), k);
    let mut order: Vec<(u64, usize)> = (0..set.len()).filter(|&k| set[k]).map(key).collect();
    order.sort_unstable();
    let simple = SIMPLE;
    // Removing a pixel may make an earlier one removable, so repeat until nothing
    // changes.
    loop {
        let before = order.len();
        order.retain(|&(_, k)| {
            let around = around(k);
            let ring = (0..8).fold(0u8, |bits, i| bits | u8::from(set[around[i]]) << i);
            let remove = simple[usize::from(ring)] && !is_end(k, ring, &around, &strength, &depth);
            set[k] &= !remove;
            !remove
        });
        if order.len() == before {
            return set
                .chunks_exact(across)
                .skip(1)
                .take(h)
                .flat_map(|row| &row[1..=w])
                .copied()
                .collect();
        }
    }
}

/// For every set of neighbours (bit i: the i-th of [`RING`]) whether the set ones stay
/// connected, and the empty ones too, without the pixel: the 8-connectivity number is 1
/// (Yokoi, Toriwaki & Fukumura 1975). False inside areas and for isolated pixels.
const SIMPLE: [bool; 256] = {
    let mut table = [false; 256];
    let mut ring = 0;
    while ring < 256 {
        let (mut number, mut i) = (0, 0);
        while i < 8 {
            let empty =
                [ring >> i & 1 == 0, ring >> (i + 1) & 1 == 0, ring >> ((i + 2) % 8) & 1 == 0];
            if empty[0] && !(empty[1] && empty[2]) {
                number += 1;
            }
            i += 2;
        }
        table[ring] = number == 1;
        ring += 1;
    }
    table
};

/// True if a pixel is the end of a line rather than of a spur: it has one neighbour, or
/// two adjacent ones, which are neither much stronger nor farther inside.
fn is_end(k: usize, ring: u8, around: &[usize; 8], strength: &[u8], depth: &[f32]) -> bool {
    let close = ring & ring.rotate_left(1) != 0;
    let few = ring.count_ones() == 1 || ring.count_ones() == 2 && close;
    let weak = |n: usize| {
        10 * u16::from(strength[k]) >= 8 * u16::from(strength[n]) && depth[k] >= depth[n] - 0.3
    };
    few && (0..8).filter(|i| ring >> i & 1 == 1).all(|i| weak(around[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(set: &[bool]) -> usize {
        set.iter().filter(|&&s| s).count()
    }

    /// Number of 8-connected components.
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
        // Crossings are thicker than a pixel.
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
                assert!(
                    (22 - thick..=23).contains(&count(&set)),
                    "{thick} {upright}: {}",
                    count(&set)
                );
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
