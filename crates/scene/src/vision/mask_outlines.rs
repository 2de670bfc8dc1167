//! Outlines of a mask as polygons, for drawing.

use super::Mask;

/// The maximum number of polygons of a mask.
const MOST: usize = 32;
/// Steps along the sides of pixels: to the right, down, to the left, up.
const STEPS: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

impl Mask {
    /// Returns closed polygons around its pixels and around holes in them, pixels, at most 32,
    /// those with the most corners first. They pass through the middles of the sides between
    /// pixels on the object and others, so that slopes are straight; filled by the even-odd
    /// rule they are the object.
    pub fn outlines(&self) -> Vec<Vec<[f64; 2]>> {
        let (width, height) = (i64::from(self.width()), i64::from(self.height()));
        // Whether an outline has passed above a pixel.
        let mut passed = vec![false; self.data().len()];
        let mut found = Vec::new();
        for y in 0..height {
            for x in 0..width {
                if self.is_side([x, y], 0) && !passed[(y * width + x) as usize] {
                    found.push(self.followed([x, y], &mut passed));
                }
            }
        }
        found.sort_by_key(|polygon| std::cmp::Reverse(polygon.len()));
        found.truncate(MOST);
        found
    }

    /// Returns whether a pixel is on the object; none beyond the mask is.
    fn has(&self, [x, y]: [i64; 2]) -> bool {
        let (width, height) = (i64::from(self.width()), i64::from(self.height()));
        (0..width).contains(&x) && (0..height).contains(&y) && self.data()[(y * width + x) as usize]
    }

    /// Returns whether a step from a corner of pixels has the object to its right and none of
    /// it to its left.
    fn is_side(&self, [x, y]: [i64; 2], step: usize) -> bool {
        let around = [[x, y], [x - 1, y], [x - 1, y - 1], [x, y - 1]];
        self.has(around[step]) && !self.has(around[(step + 3) % 4])
    }

    /// Follows an outline that begins with a step to the right until it is closed.
    fn followed(&self, start: [i64; 2], passed: &mut [bool]) -> Vec<[f64; 2]> {
        let (mut at, mut step) = (start, 0);
        let mut polygon: Vec<[f64; 2]> = Vec::new();
        loop {
            if step == 0 {
                passed[(at[1] * i64::from(self.width()) + at[0]) as usize] = true;
            }
            let middle = [0, 1].map(|c| at[c] as f64 + 0.5 * STEPS[step][c] as f64);
            if let [.., a, b] = polygon[..]
                && (b[0] - a[0]) * (middle[1] - b[1]) == (b[1] - a[1]) * (middle[0] - b[0])
            {
                polygon.pop();
            }
            polygon.push(middle);
            at = [0, 1].map(|c| at[c] + STEPS[step][c]);
            // The sharpest way to the right: pixels that touch at a corner are apart.
            let ways = [1, 0, 3].map(|by| (step + by) % 4);
            step = ways.into_iter().find(|s| self.is_side(at, *s)).unwrap_or(step);
            if at == start && step == 0 {
                return polygon;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::hint::polygon;

    fn mask(rows: &[&str]) -> Mask {
        let data = rows.iter().flat_map(|r| r.bytes().map(|b| b == b'#')).collect();
        Mask::new(rows[0].len() as u32, rows.len() as u32, data).expect("a mask")
    }

    #[test]
    fn an_outline_goes_around_a_pixel() {
        let found = mask(&["...", ".#.", "..."]).outlines();
        assert_eq!(found, [[[1.5, 1.0], [2.0, 1.5], [1.5, 2.0], [1.0, 1.5]]]);
    }

    #[test]
    fn slopes_and_sides_are_straight() {
        let found = mask(&["#...", "##..", "###.", "####"]).outlines();
        assert_eq!(found.len(), 1);
        assert!(found[0].len() <= 8, "{found:?}");
        let whole = mask(&["####", "####", "####"]).outlines();
        assert_eq!(whole[0].len(), 8, "{whole:?}");
    }

    #[test]
    fn filled_outlines_are_the_mask() {
        let drawn = mask(&[
            "##..#.....",
            "##...#####",
            "...#.#...#",
            "..###..#.#",
            ".#######.#",
            "..###....#",
            "#..#..####",
        ]);
        let mut filled = vec![false; drawn.data().len()];
        for outline in drawn.outlines() {
            let inside = polygon(&outline, drawn.width(), drawn.height()).expect("a mask");
            filled.iter_mut().zip(inside.data()).for_each(|(f, i)| *f ^= i);
        }
        assert_eq!(filled, drawn.data());
    }

    #[test]
    fn many_specks_have_few_outlines() {
        let data = (0..10_000).map(|p| p % 2 == 0 && p / 100 % 2 == 0).collect();
        let specks = Mask::new(100, 100, data).expect("a mask");
        assert_eq!(specks.outlines().len(), MOST);
        assert!(Mask::new(2, 2, vec![false; 4]).expect("a mask").outlines().is_empty());
    }
}
