//! Letters for captions: five pixels high, drawn here pixel by pixel, so that no font
//! file is needed.
//!
//! Lower-case letters look like capitals; a character without a glyph is shown as a small
//! box. This is not a typesetter: one line, no kerning.

use image::{Rgb, RgbImage};

/// The height of a line in pixels at scale 1, without the gap to the next line.
pub(super) const HEIGHT: u32 = 5;

/// The rows of each glyph from top to bottom, separated by `/`.
#[rustfmt::skip]
const GLYPHS: [(char, &str); 54] = [
    ('0', "###/#.#/#.#/#.#/###"), ('1', ".#./##./.#./.#./###"), ('2', "###/..#/###/#../###"),
    ('3', "###/..#/.##/..#/###"), ('4', "#.#/#.#/###/..#/..#"), ('5', "###/#../###/..#/###"),
    ('6', "###/#../###/#.#/###"), ('7', "###/..#/.#./.#./.#."), ('8', "###/#.#/###/#.#/###"),
    ('9', "###/#.#/###/..#/###"), ('A', ".#./#.#/###/#.#/#.#"), ('B', "##./#.#/##./#.#/##."),
    ('C', ".##/#../#../#../.##"), ('D', "##./#.#/#.#/#.#/##."), ('E', "###/#../##./#../###"),
    ('F', "###/#../##./#../#.."), ('G', ".###/#.../#.##/#..#/.###"), ('H', "#.#/#.#/###/#.#/#.#"),
    ('I', "###/.#./.#./.#./###"), ('J', "..#/..#/..#/#.#/.#."), ('K', "#.#/#.#/##./#.#/#.#"),
    ('L', "#../#../#../#../###"), ('M', "#...#/##.##/#.#.#/#...#/#...#"), ('N', "#..#/##.#/#.##/#..#/#..#"),
    ('O', ".##./#..#/#..#/#..#/.##."), ('P', "##./#.#/##./#../#.."), ('Q', ".##./#..#/#..#/#.#./.#.#"),
    ('R', "##./#.#/##./#.#/#.#"), ('S', ".##/#../.#./..#/##."), ('T', "###/.#./.#./.#./.#."),
    ('U', "#.#/#.#/#.#/#.#/###"), ('V', "#.#/#.#/#.#/#.#/.#."), ('W', "#...#/#...#/#.#.#/##.##/#...#"),
    ('X', "#.#/#.#/.#./#.#/#.#"), ('Y', "#.#/#.#/.#./.#./.#."), ('Z', "###/..#/.#./#../###"),
    (' ', "../../../../.."), ('.', "././././#"), (',', "../../../.#/#."), (':', "./#/./#/."),
    ('-', ".../.../###/.../..."), ('+', ".../.#./###/.#./..."), ('=', ".../###/.../###/..."),
    ('/', "..#/..#/.#./#../#.."), ('(', ".#/#./#./#./.#"), (')', "#./.#/.#/.#/#."), ('[', "##/#./#./#./##"),
    (']', "##/.#/.#/.#/##"), ('_', ".../.../.../.../###"), ('%', "#.#/..#/.#./#../#.#"),
    ('*', ".../#.#/.#./#.#/..."), ('<', "..#/.#./#../.#./..#"), ('>', "#../.#./..#/.#./#.."),
    ('@', ".##./#..#/#.##/#.../.###"),
];
/// The glyph of characters without one.
const UNKNOWN: &str = ".../###/#.#/###/...";

/// Returns the rows of a glyph, and its width in pixels.
fn glyph(c: char) -> (&'static str, u32) {
    let c = if c == '\u{2212}' || c == '–' { '-' } else { c.to_ascii_uppercase() };
    let rows = GLYPHS.iter().find(|(g, _)| *g == c).map_or(UNKNOWN, |(_, rows)| rows);
    (rows, rows.find('/').unwrap_or(0) as u32)
}

/// Returns the width of a text in pixels at scale 1.
pub(super) fn width(text: &str) -> u32 {
    text.chars().map(|c| glyph(c).1 + 1).sum::<u32>().saturating_sub(1)
}

/// Returns the longest prefix of a text that is at most `room` pixels wide at scale 1.
pub(super) fn fitting(text: &str, room: u32) -> &str {
    let mut used = 0;
    for (at, c) in text.char_indices() {
        used += glyph(c).1;
        if used > room {
            return &text[..at];
        }
        used += 1;
    }
    text
}

/// Writes a text with its upper left corner at (x, y); every pixel of a glyph is `scale`
/// pixels large. Pixels outside the picture are left out.
pub(super) fn write(out: &mut RgbImage, x: u32, y: u32, scale: u32, color: Rgb<u8>, text: &str) {
    let mut left = x;
    for c in text.chars() {
        let (rows, wide) = glyph(c);
        for (row, line) in rows.split('/').enumerate() {
            for (column, _) in line.bytes().enumerate().filter(|(_, b)| *b == b'#') {
                for (dx, dy) in (0..scale * scale).map(|i| (i % scale, i / scale)) {
                    let at = (left + column as u32 * scale + dx, y + row as u32 * scale + dy);
                    if let Some(p) = out.get_pixel_mut_checked(at.0, at.1) {
                        *p = color;
                    }
                }
            }
        }
        left += (wide + 1) * scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_five_rows_of_one_width_and_all_different() {
        for (i, (c, rows)) in GLYPHS.iter().enumerate() {
            let lines: Vec<&str> = rows.split('/').collect();
            assert_eq!(lines.len() as u32, HEIGHT, "{c}");
            assert!(
                lines
                    .iter()
                    .all(|l| l.len() == lines[0].len() && l.bytes().all(|b| b".#".contains(&b))),
                "{c}"
            );
            assert!(GLYPHS[..i].iter().all(|(d, r)| d != c && r != rows), "{c}");
        }
        for c in ('a'..='z').chain('0'..='9') {
            assert_ne!(glyph(c).0, UNKNOWN, "{c}");
        }
    }

    #[test]
    fn texts_are_as_wide_as_said() {
        let mut p = RgbImage::new(60, 10);
        write(&mut p, 1, 1, 2, Rgb([255; 3]), "H1é");
        assert_eq!(width("H1é"), 11);
        let on = |p: &RgbImage| {
            p.enumerate_pixels()
                .filter(|(.., p)| p.0[0] > 0)
                .map(|(x, y, _)| (x, y))
                .collect::<Vec<_>>()
        };
        let all = on(&p);
        assert_eq!(
            (all.iter().map(|a| a.0).min(), all.iter().map(|a| a.0).max()),
            (Some(1), Some(22))
        );
        assert_eq!(all.iter().map(|a| a.1).max(), Some(9), "what lies outside is left out");
        assert_eq!(
            (fitting("H1é", 11), fitting("H1é", 10), fitting("H1é", 7), fitting("H1é", 2)),
            ("H1é", "H1", "H1", "")
        );
    }
}
