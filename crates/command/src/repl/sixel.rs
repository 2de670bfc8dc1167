//! Sixels: six rows at a time, one colour after the other, in a fixed palette of 252
//! colours with error diffusion (Floyd and Steinberg 1976).

use image::RgbImage;
use std::fmt::Write;

/// Levels of red, green and blue in the palette; the eye is most sensitive to green.
const STEPS: [usize; 3] = [6, 7, 6];

/// Encodes a picture for display at the cursor.
pub fn encode(picture: &RgbImage) -> String {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let indices = quantised(picture);
    // The pixel aspect ratio, 1:1, and the size.
    let mut out = format!("\x1bPq\"1;1;{width};{height}");
    for i in 0..STEPS.iter().product() {
        let [r, g, b] = color(i).map(|c| (c / 2.55).round() as u32);
        let _ = write!(out, "#{i};2;{r};{g};{b}");
    }
    for top in (0..height).step_by(6) {
        let rows = &indices[top * width..(top + 6).min(height) * width];
        let mut used = rows.to_vec();
        used.sort_unstable();
        used.dedup();
        for (n, index) in used.iter().enumerate() {
            let _ = write!(out, "{}#{index}", if n > 0 { "$" } else { "" });
            let column = |x: usize| {
                let set = |(y, row): (usize, &[u8])| u8::from(row[x] == *index) << y;
                rows.chunks(width).enumerate().map(set).sum::<u8>()
            };
            let (mut last, mut run) = (0, 0);
            for x in 0..width {
                let bits = column(x);
                if run > 0 && bits != last {
                    repeated(&mut out, last, run);
                    run = 0;
                }
                (last, run) = (bits, run + 1);
            }
            if last != 0 {
                repeated(&mut out, last, run);
            }
        }
        out.push('-');
    }
    out += "\x1b\\\n";
    out
}

/// Writes a number of columns with the same six pixels, run-length encoded if shorter.
fn repeated(out: &mut String, bits: u8, run: usize) {
    let letter = char::from(63 + bits);
    if run > 3 {
        let _ = write!(out, "!{run}{letter}");
    } else {
        (0..run).for_each(|_| out.push(letter));
    }
}

/// Returns the colour of a palette index; components range from 0 to 255.
fn color(i: usize) -> [f32; 3] {
    let digits = [i / (STEPS[1] * STEPS[2]), i / STEPS[2] % STEPS[1], i % STEPS[2]];
    [0, 1, 2].map(|c| digits[c] as f32 * 255.0 / (STEPS[c] - 1) as f32)
}

/// Returns the palette index of each pixel, row by row.
fn quantised(picture: &RgbImage) -> Vec<u8> {
    let width = picture.width() as usize;
    let mut out = Vec::with_capacity(width * picture.height() as usize);
    // Errors diffused to this row and the next, with a spare element at each end.
    let mut rows = [vec![[0.0f32; 3]; width + 2], vec![[0.0f32; 3]; width + 2]];
    for row in picture.rows() {
        for (x, p) in row.enumerate() {
            let wanted =
                [0, 1, 2].map(|c| (f32::from(p.0[c]) + rows[0][x + 1][c]).clamp(0.0, 255.0));
            let digit = |c: usize| (wanted[c] / 255.0 * (STEPS[c] - 1) as f32).round() as usize;
            let index = (digit(0) * STEPS[1] + digit(1)) * STEPS[2] + digit(2);
            let got = color(index);
            for c in 0..3 {
                let error = wanted[c] - got[c];
                rows[0][x + 2][c] += error * 7.0 / 16.0;
                rows[1][x][c] += error * 3.0 / 16.0;
                rows[1][x + 1][c] += error * 5.0 / 16.0;
                rows[1][x + 2][c] += error / 16.0;
            }
            out.push(index as u8);
        }
        rows.swap(0, 1);
        rows[1].fill([0.0; 3]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::testing::noise;
    use super::*;

    /// Returns the width, the height and the palette indices that a terminal would paint.
    fn decode(sent: &str) -> (usize, usize, Vec<Option<u8>>) {
        let body =
            sent.strip_prefix("\x1bPq").and_then(|s| s.trim_end().strip_suffix("\x1b\\")).unwrap();
        let (size, body) = body.strip_prefix('"').unwrap().split_once('#').unwrap();
        let size: Vec<usize> = size.split(';').map(|n| n.parse().unwrap()).collect();
        let (width, height) = (size[2], size[3]);
        let mut picture = vec![None; width * height];
        let (mut x, mut top, mut color, mut run) = (0, 0, 0u8, None);
        let text = format!("#{body}");
        let mut chars = text.chars().peekable();
        while let Some(c) = chars.next() {
            let mut number = || {
                let mut n = String::new();
                while let Some(d) = chars.next_if(|c| c.is_ascii_digit() || *c == ';') {
                    n.push(d);
                }
                n
            };
            match c {
                // With more numbers, it defines the colour.
                '#' => color = number().split(';').next().unwrap().parse().unwrap(),
                '!' => run = Some(number().parse().unwrap()),
                '$' => x = 0,
                '-' => (x, top) = (0, top + 6),
                c => {
                    let bits = c as u8 - 63;
                    for _ in 0..run.take().unwrap_or(1) {
                        (0..6)
                            .filter(|y| bits >> y & 1 == 1)
                            .for_each(|y| picture[(top + y) * width + x] = Some(color));
                        x += 1;
                    }
                }
            }
        }
        (width, height, picture)
    }

    #[test]
    fn what_is_painted_is_the_picture_in_the_palette() {
        for (w, h) in [(40, 23), (1, 1), (7, 6), (5, 13)] {
            let picture = noise(w, h);
            let (width, height, painted) = decode(&encode(&picture));
            assert_eq!((width, height), (w as usize, h as usize));
            assert_eq!(painted, quantised(&picture).into_iter().map(Some).collect::<Vec<_>>());
        }
    }

    #[test]
    fn colours_are_right_on_average() {
        let picture = RgbImage::from_pixel(60, 60, image::Rgb([100, 150, 33]));
        let all = quantised(&picture);
        for c in 0..3 {
            let mean =
                all.iter().map(|i| color(usize::from(*i))[c]).sum::<f32>() / all.len() as f32;
            assert!((mean - f32::from(picture.get_pixel(0, 0).0[c])).abs() < 2.0, "{c} {mean}");
        }
    }
}
