//! Making pictures smaller: each new pixel is the mean over the area it covers.

/// A plane of numbers, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl Plane {
    /// The mean over the area of each new pixel; also enlarges, by repetition.
    pub fn resized(&self, width: usize, height: usize) -> Plane {
        if (width, height) == (self.width, self.height) {
            return self.clone();
        }
        let (columns, rows) = (covers(self.width, width), covers(self.height, height));
        let mut narrow = vec![0.0f32; width * self.height];
        for y in 0..self.height {
            let row = &self.values[y * self.width..(y + 1) * self.width];
            for (x, cover) in columns.iter().enumerate() {
                narrow[y * width + x] = cover.iter().map(|(i, w)| row[*i] * w).sum();
            }
        }
        let mut values = vec![0.0f32; width * height];
        for (y, cover) in rows.iter().enumerate() {
            for (i, w) in cover {
                for x in 0..width {
                    values[y * width + x] += narrow[i * width + x] * w;
                }
            }
        }
        Plane { width, height, values }
    }
}

/// For each new place the old ones under it and their shares, which sum to 1.
fn covers(old: usize, new: usize) -> Vec<Vec<(usize, f32)>> {
    let scale = old as f64 / new as f64;
    (0..new)
        .map(|i| {
            let (a, b) = (i as f64 * scale, (i + 1) as f64 * scale);
            let last = (b.ceil() as usize).min(old);
            let share = |k: usize| ((b.min(k as f64 + 1.0) - a.max(k as f64)) / scale) as f32;
            (a as usize..last).map(|k| (k, share(k))).filter(|(_, w)| *w > 0.0).collect()
        })
        .collect()
}

/// Width and height with the longer side at most `side`, at least 1 pixel each.
pub(super) fn fitted(width: u32, height: u32, side: u32) -> (u32, u32) {
    let longer = width.max(height).max(1);
    if longer <= side {
        return (width, height);
    }
    let scale = |x: u32| ((u64::from(x) * u64::from(side) + u64::from(longer) / 2) / u64::from(longer)).max(1) as u32;
    (scale(width), scale(height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_stays() {
        let p = Plane { width: 7, height: 5, values: (0..35).map(|i| (i * i % 11) as f32).collect() };
        let mean = |p: &Plane| p.values.iter().sum::<f32>() / p.values.len() as f32;
        for (w, h) in [(3, 2), (7, 5), (1, 1), (14, 10)] {
            let q = p.resized(w, h);
            assert_eq!(q.values.len(), w * h);
            assert!((mean(&q) - mean(&p)).abs() < 1e-4);
        }
        assert_eq!(fitted(512, 256, 128), (128, 64));
        assert_eq!(fitted(10000, 3, 100), (100, 1));
        assert_eq!(fitted(50, 60, 100), (50, 60));
    }
}
