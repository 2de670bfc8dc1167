//! Contact sheets: many pictures in rows, like the draws from a prior in Figure 1 of
//! Kulkarni et al. (2014).

use super::font;
use image::imageops::replace;
use image::{Rgb, RgbImage};

/// The number of pixels between pictures and around them.
const GAP: u32 = 2;
/// The colour between pictures.
const LINE: Rgb<u8> = Rgb([200; 3]);
/// The colour of the letters of captions.
const INK: Rgb<u8> = Rgb([30; 3]);
/// The colour behind captions.
const PAPER: Rgb<u8> = Rgb([250; 3]);

/// Arranges pictures in rows, with thin lines between them. Cells have the size of the
/// largest picture; smaller pictures are in the upper left corners of their cells.
/// Without pictures, the sheet is a single pixel.
pub fn contact_sheet(pictures: &[RgbImage], columns: u32) -> RgbImage {
    captioned_sheet(pictures, columns, &[])
}

/// Does the same as [`contact_sheet`], with a line of text below each picture that has a
/// caption; captions wider than the picture are cut off.
pub fn captioned_sheet(pictures: &[RgbImage], columns: u32, captions: &[String]) -> RgbImage {
    let Some(w) = pictures.iter().map(|p| p.width()).max() else { return RgbImage::new(1, 1) };
    let h = pictures.iter().map(|p| p.height()).max().unwrap_or(0);
    let count = pictures.len() as u32;
    let columns = columns.clamp(1, count);
    let scale = (w / 96).clamp(1, 4);
    let line = if captions.iter().all(String::is_empty) { 0 } else { (font::HEIGHT + 4) * scale };
    let (step_x, step_y) = (w + GAP, h + line + GAP);
    let mut sheet =
        RgbImage::from_pixel(columns * step_x + GAP, count.div_ceil(columns) * step_y + GAP, LINE);
    for (i, p) in pictures.iter().enumerate() {
        let (x, y) = (GAP + i as u32 % columns * step_x, GAP + i as u32 / columns * step_y);
        replace(&mut sheet, p, i64::from(x), i64::from(y));
        if line > 0 {
            replace(
                &mut sheet,
                &RgbImage::from_pixel(w, line, PAPER),
                i64::from(x),
                i64::from(y + h),
            );
            let text =
                captions.get(i).map_or("", |t| font::fitting(t, (w / scale).saturating_sub(4)));
            let left = x + (w.saturating_sub(font::width(text) * scale)) / 2;
            font::write(&mut sheet, left, y + h + 2 * scale, scale, INK, text);
        }
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

    #[test]
    fn captions_stay_below_their_pictures() {
        let pictures = vec![RgbImage::from_pixel(40, 20, Rgb([9; 3])); 2];
        let sheet = captioned_sheet(&pictures, 2, &["draw 1 is much too long a text".into()]);
        assert_eq!(sheet.dimensions(), (2 * 42 + 2, 20 + 9 + 4));
        let ink: Vec<(u32, u32)> =
            sheet.enumerate_pixels().filter(|(.., p)| **p == INK).map(|(x, y, _)| (x, y)).collect();
        assert!(
            !ink.is_empty() && ink.iter().all(|(x, y)| (2..42).contains(x) && (24..29).contains(y)),
            "{ink:?}"
        );
        assert_eq!(sheet.get_pixel(2, 2).0, [9; 3]);
        assert_eq!(sheet.get_pixel(50, 25), &PAPER);
    }
}
