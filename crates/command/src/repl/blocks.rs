//! Half blocks: each character shows two pixels, one above the other, by its foreground
//! and background colours.

use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};
use std::fmt::Write;

/// Encodes a picture in the given number of columns, in 24-bit colours or xterm's 256.
pub fn encode(picture: &RgbImage, columns: u32, full_colors: bool) -> String {
    let (w, h) = picture.dimensions();
    if w == 0 || h == 0 || columns == 0 {
        return String::new();
    }
    let rows = (u64::from(columns) * u64::from(h)).div_ceil(2 * u64::from(w)).clamp(1, 1000) as u32;
    let small = resize(picture, columns, 2 * rows, FilterType::Triangle);
    let mut out = String::new();
    for y in 0..rows {
        let mut colors = None;
        for x in 0..columns {
            let pair = (*small.get_pixel(x, 2 * y), *small.get_pixel(x, 2 * y + 1));
            if colors != Some(pair) {
                let _ = write!(
                    out,
                    "\x1b[38;{};48;{}m",
                    color(pair.0, full_colors),
                    color(pair.1, full_colors)
                );
                colors = Some(pair);
            }
            out.push('▀');
        }
        out += "\x1b[0m\n";
    }
    out
}

/// Formats a colour as parameters of an escape sequence.
fn color(Rgb([r, g, b]): Rgb<u8>, full: bool) -> String {
    if full {
        return format!("2;{r};{g};{b}");
    }
    format!("5;{}", nearest(r, g, b))
}

/// Returns the nearest of xterm's 256 colours, from the 6 x 6 x 6 cube or the greys.
fn nearest(r: u8, g: u8, b: u8) -> u8 {
    let step = |x: u8| if x < 48 { 0 } else { ((i32::from(x) - 35) / 40).clamp(1, 5) };
    let level = |s: i32| if s == 0 { 0 } else { 55 + 40 * s };
    let [sr, sg, sb] = [r, g, b].map(step);
    let mean = (i32::from(r) + i32::from(g) + i32::from(b)) / 3;
    let grey = ((mean - 3) / 10).clamp(0, 23);
    let distance =
        |c: [i32; 3]| [r, g, b].iter().zip(c).map(|(x, y)| (i32::from(*x) - y).pow(2)).sum::<i32>();
    let (in_cube, in_grey) = (distance([sr, sg, sb].map(level)), distance([8 + 10 * grey; 3]));
    if in_grey < in_cube { 232 + grey as u8 } else { (16 + 36 * sr + 6 * sg + sb) as u8 }
}

#[cfg(test)]
mod tests {
    use super::super::testing::noise;
    use super::*;

    /// Returns the pixels that a terminal would paint.
    fn decode(sent: &str) -> Vec<Vec<[u8; 3]>> {
        let mut rows = Vec::new();
        for line in sent.lines() {
            let (mut upper, mut lower) = (Vec::new(), Vec::new());
            for part in line.split("\x1b[").filter(|p| !p.is_empty() && *p != "0m") {
                let (codes, letters) = part.split_once('m').unwrap();
                let n: Vec<u8> = codes.split(';').map(|n| n.parse().unwrap()).collect();
                assert_eq!((n[0], n[1], n[5], n[6]), (38, 2, 48, 2));
                for _ in letters.chars() {
                    upper.push([n[2], n[3], n[4]]);
                    lower.push([n[7], n[8], n[9]]);
                }
            }
            rows.extend([upper, lower]);
        }
        rows
    }

    #[test]
    fn every_letter_is_two_pixels() {
        let picture = noise(24, 10);
        let rows = decode(&encode(&picture, 24, true));
        assert_eq!((rows.len(), rows[0].len()), (10, 24));
        for (x, y, p) in picture.enumerate_pixels() {
            assert_eq!(rows[y as usize][x as usize], p.0, "{x} {y}");
        }
        assert_eq!(
            decode(&encode(&picture, 12, true)).len(),
            6,
            "half as wide, half as high, in pairs"
        );
        assert_eq!(encode(&RgbImage::new(0, 0), 80, true), "");
    }

    #[test]
    fn the_nearest_of_256() {
        assert_eq!(
            [nearest(0, 0, 0), nearest(255, 255, 255), nearest(255, 0, 0), nearest(95, 135, 175)],
            [16, 231, 196, 67]
        );
        assert_eq!(nearest(128, 128, 128), 244);
        let sent = encode(&RgbImage::from_pixel(2, 2, Rgb([255, 0, 0])), 2, false);
        assert_eq!(sent, "\x1b[38;5;196;48;5;196m▀▀\x1b[0m\n");
    }
}
