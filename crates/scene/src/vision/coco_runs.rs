//! Masks as COCO's results have them: run lengths in columns, compressed to text.
//!
//! Runs of 0 and 1 alternate, 0 first, down each column in turn. A run is written as its
//! difference from the one two before it (from the fourth on), in groups of five bits, the
//! lowest first, as a character from 48 on; 32 says that another group follows, and 16 in the
//! last group is the sign. Source: COCO's `maskApi.c` (`rleToString`), the definition there is.

use super::Mask;

impl Mask {
    /// Returns the `counts` of a compressed `segmentation`, whose `size` is [height, width].
    pub fn coco_counts(&self) -> String {
        let (width, height) = (self.width() as usize, self.height() as usize);
        let mut runs: Vec<i64> = vec![0];
        let mut on = false;
        for x in 0..width {
            for y in 0..height {
                if self.data()[y * width + x] != on {
                    on = !on;
                    runs.push(0);
                }
                if let Some(run) = runs.last_mut() {
                    *run += 1;
                }
            }
        }
        let mut text = String::new();
        for (i, run) in runs.iter().enumerate() {
            let mut rest = if i > 2 { run - runs[i - 2] } else { *run };
            loop {
                let group = (rest & 31) as u8;
                rest >>= 5;
                let done = rest == if group & 16 == 0 { 0 } else { -1 };
                text.push(char::from(48 + group + if done { 0 } else { 32 }));
                if done {
                    break;
                }
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(width: u32, height: u32, on: impl Fn(u32, u32) -> bool) -> String {
        let data = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let data = data.map(|(x, y)| on(x, y)).collect();
        Mask::new(width, height, data).unwrap().coco_counts()
    }

    /// The numbers are those of pycocotools 2.0.11, `mask.encode`.
    #[test]
    fn counts_are_those_of_pycocotools() {
        let rows = ["1101", "0010", "1011"];
        let on = |x: u32, y: u32| rows[y as usize].as_bytes()[x as usize] == b'1';
        assert_eq!(counts(4, 3, on), "011121NN");
        let rows = ["0100000", "0100111", "1001101", "1110100", "1110111"];
        let on = |x: u32, y: u32| rows[y as usize].as_bytes()[x as usize] == b'1';
        assert_eq!(counts(7, 5, on), "251M20OO13NM10O10O");
        let frame = |x: u32, y: u32| {
            (11..60).contains(&x)
                && (7..33).contains(&y)
                && !((20..30).contains(&x) && (15..20).contains(&y))
        };
        assert_eq!(
            counts(70, 40, frame),
            "o=j0>0000000000000000^OG59KG59KG59KG59KG59KG59KG59KG59KG59KG59=\
             0000000000000000000000000000000000000000000000000000000000Y<"
        );
        let oval = |x: u32, y: u32| {
            let (x, y) = ((f64::from(x) - 90.0) / 70.0, (f64::from(y) - 140.0) / 120.0);
            x * x + y * y < 1.0
        };
        let text = counts(200, 300, oval);
        assert!(text.starts_with(
            "dX6Y1k7`0B<E:F:G8H8I6J6J6J6J6K4L4K6K4L4L4L4M2M4L4M2M4M2M4M2N2M4M2N2N2N2N2N2N2N2N"
        ));
        assert_eq!(text.len(), 286);
        assert_eq!(
            (counts(3, 2, |_, _| true), counts(3, 2, |_, _| false)),
            ("06".into(), "6".into())
        );
    }
}
