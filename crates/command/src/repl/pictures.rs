//! Shows pictures in the terminal, or writes them to files. kitty takes a PNG in base64, in
//! chunks of 4096 characters; iTerm2, and others like it, an inline file in base64.

use super::super::args::Graphics;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use image::{Rgb, RgbImage};
use pcadlang_report::pictures::{png, scaled};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files;
use pcadlang_workbench::session::ViewPicture;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The longer side of a picture in pixels, on terminals that show pixels.
const LONGER_SIDE: u32 = 640;
/// The maximum width of a picture in half blocks.
const COLUMNS: u32 = 72;

/// Chooses how to show pictures by the environment; the terminal itself is not queried.
pub fn graphics_from_env(variable: impl Fn(&str) -> Option<String>, is_terminal: bool) -> Graphics {
    let get = |name| variable(name).unwrap_or_default();
    let (term, program) = (get("TERM"), get("TERM_PROGRAM"));
    let is =
        |names: &[&str]| names.iter().any(|n| term.contains(n) || program.eq_ignore_ascii_case(n));
    let blocks = match get("COLORTERM").as_str() {
        "truecolor" | "24bit" => Graphics::Blocks,
        _ => Graphics::Blocks256,
    };
    if !is_terminal || term.is_empty() || term == "dumb" {
        Graphics::File
    } else if variable("TMUX").is_some() || term.starts_with("screen") || term.starts_with("tmux") {
        // tmux and screen pass pictures on only if configured to.
        blocks
    } else if variable("KITTY_WINDOW_ID").is_some() || is(&["kitty", "ghostty"]) {
        Graphics::Kitty
    } else if is(&["iTerm.app", "WezTerm", "mintty"]) {
        Graphics::Iterm
    } else {
        blocks
    }
}

/// Returns the characters that show a picture. If the user named a file, or the terminal
/// cannot show pictures, the picture is written to a file instead.
pub fn shown(picture: &ViewPicture, graphics: Graphics) -> Result<String, Failure> {
    let pixels = picture.pixels();
    let encoded = |p: &RgbImage| png(p).map_err(|e| plain(e.to_string()));
    if picture.file.is_some() || graphics == Graphics::File {
        let path = picture.file.clone().unwrap_or_else(|| unused(Path::new("")));
        files::write(&path, &encoded(&pixels)?)?;
        return Ok(format!(
            "{}: {} x {} pixels\n",
            path.display(),
            pixels.width(),
            pixels.height()
        ));
    }
    let longer = pixels.width().max(pixels.height()).max(1);
    let fit = |x: u32| (x * LONGER_SIDE / longer).max(1);
    let fitting = || scaled(&pixels, fit(pixels.width()), fit(pixels.height()));
    Ok(match graphics {
        Graphics::Kitty => kitty(&encoded(&fitting())?),
        Graphics::Iterm => iterm(&encoded(&fitting())?),
        _ => half_blocks(&pixels, columns(), graphics == Graphics::Blocks),
    })
}

/// Returns the maximum width of a picture in columns.
fn columns() -> u32 {
    let told = std::env::var("COLUMNS").ok().and_then(|c| c.parse::<u32>().ok());
    told.map_or(COLUMNS, |c| c.saturating_sub(1).clamp(8, COLUMNS))
}

/// Returns the first of `render.png`, `render-2.png`, … that does not exist yet.
fn unused(folder: &Path) -> PathBuf {
    let name = |n: u32| {
        folder.join(if n == 1 { "render.png".to_owned() } else { format!("render-{n}.png") })
    };
    (1..10_000).map(name).find(|p| !p.exists()).unwrap_or_else(|| name(10_000))
}

/// The maximum length of a chunk; the protocol requires a multiple of 4.
const CHUNK: usize = 4096;

/// Encodes a PNG for display at the cursor.
fn kitty(png: &[u8]) -> String {
    let data = BASE64_STANDARD.encode(png);
    let chunks: Vec<&str> =
        data.as_bytes().chunks(CHUNK).filter_map(|c| std::str::from_utf8(c).ok()).collect();
    let mut out = String::with_capacity(data.len() + 64 * chunks.len());
    for (i, chunk) in chunks.iter().enumerate() {
        let more = u8::from(i + 1 < chunks.len());
        // The first chunk has the format (PNG) and the action (display), and turns off
        // responses.
        let head = if i == 0 { "f=100,a=T,q=2," } else { "" };
        out += &format!("\x1b_G{head}m={more};{chunk}\x1b\\");
    }
    out.push('\n');
    out
}

/// Encodes a PNG for display at the cursor.
fn iterm(png: &[u8]) -> String {
    format!(
        "\x1b]1337;File=inline=1;size={};preserveAspectRatio=1:{}\x07\n",
        png.len(),
        BASE64_STANDARD.encode(png)
    )
}

/// Encodes a picture in the given number of columns, in 24-bit colours or xterm's 256.
fn half_blocks(picture: &RgbImage, columns: u32, full_colors: bool) -> String {
    let (w, h) = picture.dimensions();
    if w == 0 || h == 0 || columns == 0 {
        return String::new();
    }
    let rows = (u64::from(columns) * u64::from(h)).div_ceil(2 * u64::from(w)).clamp(1, 1000) as u32;
    let small = scaled(picture, columns, 2 * rows);
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
    use super::*;

    #[test]
    fn terminals_are_told_by_their_environment() {
        let told = |vars: &[(&str, &str)]| {
            let get =
                |name: &str| vars.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_owned());
            graphics_from_env(get, true)
        };
        assert_eq!(told(&[("TERM", "xterm-kitty")]), Graphics::Kitty);
        assert_eq!(told(&[("TERM", "xterm-256color"), ("KITTY_WINDOW_ID", "1")]), Graphics::Kitty);
        assert_eq!(
            told(&[("TERM", "xterm-256color"), ("TERM_PROGRAM", "iTerm.app")]),
            Graphics::Iterm
        );
        assert_eq!(
            told(&[("TERM", "xterm-256color"), ("COLORTERM", "truecolor")]),
            Graphics::Blocks
        );
        assert_eq!(told(&[("TERM", "xterm-256color")]), Graphics::Blocks256);
        assert_eq!(
            told(&[("TERM", "tmux-256color"), ("TMUX", "x"), ("KITTY_WINDOW_ID", "1")]),
            Graphics::Blocks256
        );
        assert_eq!(told(&[("TERM", "dumb")]), Graphics::File);
        assert_eq!(told(&[]), Graphics::File);
        assert_eq!(
            graphics_from_env(|n| (n == "TERM").then(|| "xterm-kitty".to_owned()), false),
            Graphics::File
        );
    }

    #[test]
    fn what_kitty_is_sent_is_the_picture() {
        let picture = noise(90, 70);
        let sent = kitty(&png_of(&picture));
        let mut data = String::new();
        let parts: Vec<&str> = sent.trim_end().split("\x1b\\").filter(|p| !p.is_empty()).collect();
        assert!(parts.len() > 1, "the picture takes several chunks");
        for (i, part) in parts.iter().enumerate() {
            let (control, chunk) = part.strip_prefix("\x1b_G").unwrap().split_once(';').unwrap();
            assert_eq!(control.ends_with("m=1"), i + 1 < parts.len());
            assert_eq!(control.contains("a=T"), i == 0);
            assert!(chunk.len() <= CHUNK && (chunk.len() % 4 == 0));
            data += chunk;
        }
        let back =
            image::load_from_memory(&BASE64_STANDARD.decode(&data).unwrap()).unwrap().to_rgb8();
        assert_eq!(back, picture);
    }

    #[test]
    fn what_iterm_is_sent_is_the_picture() {
        let picture = noise(31, 17);
        let png = png_of(&picture);
        let sent = iterm(&png);
        let body = sent
            .strip_prefix("\x1b]1337;File=")
            .and_then(|s| s.trim_end().strip_suffix('\x07'))
            .unwrap();
        let (settings, data) = body.split_once(':').unwrap();
        assert!(settings.contains("inline=1") && settings.contains(&format!("size={}", png.len())));
        assert_eq!(
            image::load_from_memory(&BASE64_STANDARD.decode(data).unwrap()).unwrap().to_rgb8(),
            picture
        );
    }

    /// Returns a picture of pseudo-random pixels.
    fn noise(width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |x, y| {
            let h = (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503).wrapping_mul(x + 7))
                .wrapping_mul(2_246_822_519);
            Rgb([(h >> 24) as u8, (h >> 16) as u8, (h >> 8) as u8])
        })
    }

    /// Encodes a picture as a PNG.
    fn png_of(picture: &RgbImage) -> Vec<u8> {
        pcadlang_report::pictures::png(picture).unwrap()
    }

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
        let rows = decode(&half_blocks(&picture, 24, true));
        assert_eq!((rows.len(), rows[0].len()), (10, 24));
        for (x, y, p) in picture.enumerate_pixels() {
            assert_eq!(rows[y as usize][x as usize], p.0, "{x} {y}");
        }
        assert_eq!(
            decode(&half_blocks(&picture, 12, true)).len(),
            6,
            "half as wide, half as high, in pairs"
        );
        assert_eq!(half_blocks(&RgbImage::new(0, 0), 80, true), "");
    }

    #[test]
    fn the_nearest_of_256() {
        assert_eq!(
            [nearest(0, 0, 0), nearest(255, 255, 255), nearest(255, 0, 0), nearest(95, 135, 175)],
            [16, 231, 196, 67]
        );
        assert_eq!(nearest(128, 128, 128), 244);
        let sent = half_blocks(&RgbImage::from_pixel(2, 2, Rgb([255, 0, 0])), 2, false);
        assert_eq!(sent, "\x1b[38;5;196;48;5;196m▀▀\x1b[0m\n");
    }
}
