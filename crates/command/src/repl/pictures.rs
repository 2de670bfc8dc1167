//! Shows pictures in the terminal, or writes them to files.

use super::super::args::Graphics;
use super::{blocks, iterm, kitty};
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
        Graphics::Kitty => kitty::encode(&encoded(&fitting())?),
        Graphics::Iterm => iterm::encode(&encoded(&fitting())?),
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
}
