//! Shows pictures in the terminal, or writes them to files. kitty takes a PNG in base64, in
//! chunks of 4096 characters; iTerm2, and others like it, an inline file in base64.

use super::super::args::Graphics;
use super::blocks;
use base64::prelude::{BASE64_STANDARD, Engine as _};
use image::RgbImage;
use image::imageops::{FilterType, resize};
use pcadlang_report::pictures::png;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::files;
use pcadlang_workbench::session::ViewPicture;
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
    let scaled = |x: u32| (x * LONGER_SIDE / longer).max(1);
    let fitting =
        || resize(&pixels, scaled(pixels.width()), scaled(pixels.height()), FilterType::Triangle);
    Ok(match graphics {
        Graphics::Kitty => kitty(&encoded(&fitting())?),
        Graphics::Iterm => iterm(&encoded(&fitting())?),
        _ => blocks::encode(&pixels, columns(), graphics == Graphics::Blocks),
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

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

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
}
