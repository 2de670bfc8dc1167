//! Contact sheets: many pictures in rows, like the draws from a prior in Figure 1 of
//! Kulkarni et al. (2014).

use image::imageops::replace;
use image::{Rgb, RgbImage};

/// The number of pixels between pictures and around them.
const GAP: u32 = 2;
/// The colour between pictures.
const LINE: Rgb<u8> = Rgb([200; 3]);

/// Arranges pictures in rows, with thin lines between them. Cells have the size of the
/// largest picture; smaller pictures are in the upper left corners of their cells.
/// Without pictures, the sheet is a single pixel.
pub fn contact_sheet(pictures: &[RgbImage], columns: u32) -> RgbImage {
    let Some(w) = pictures.iter().map(|p| p.width()).max() else { return RgbImage::new(1, 1) };
    let h = pictures.iter().map(|p| p.height()).max().unwrap_or(0);
    let count = pictures.len() as u32;
    let columns = columns.clamp(1, count);
    let (step_x, step_y) = (w + GAP, h + GAP);
    let mut sheet =
        RgbImage::from_pixel(columns * step_x + GAP, count.div_ceil(columns) * step_y + GAP, LINE);
    for (i, p) in pictures.iter().enumerate() {
        let (x, y) = (GAP + i as u32 % columns * step_x, GAP + i as u32 / columns * step_y);
        replace(&mut sheet, p, i64::from(x), i64::from(y));
    }
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_lie_in_rows() {
        let of = |c: u8| RgbImage::from_pixel(10, 5, Rgb([c; 3]));
        let sheet = contact_sheet(&(1..=5).map(of).collect::<Vec<_>>(), 3);
        assert_eq!(sheet.dimensions(), (3 * 12 + 2, 2 * 7 + 2));
        for (i, (x, y)) in [(2, 2), (14, 2), (26, 2), (2, 9), (14, 9)].into_iter().enumerate() {
            assert_eq!(sheet.get_pixel(x, y).0, [i as u8 + 1; 3]);
            assert_eq!(sheet.get_pixel(x + 9, y + 4).0, [i as u8 + 1; 3]);
            assert_eq!(sheet.get_pixel(x - 1, y), &LINE);
        }
        assert_eq!(sheet.get_pixel(30, 12), &LINE, "the last cell is empty");
        assert_eq!(contact_sheet(&[], 3).dimensions(), (1, 1));
        assert_eq!(contact_sheet(&[of(1)], 0).dimensions(), (14, 9));
    }
}
