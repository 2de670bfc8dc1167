//! The pictures of a page, and the viewer of its draws.

use super::encode::escaped;
use super::{Figure, Page};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use std::fmt::Write;

/// The viewer, which is bundled ahead from `web/`.
const VIEWER: &str = include_str!("../../../../web/dist/report.js");

/// Returns the file of a picture as a `data:` URL.
pub(super) fn source(file: &[u8]) -> String {
    let kind = if file.starts_with(b"\xff\xd8") { "jpeg" } else { "png" };
    format!("data:image/{kind};base64,{}", BASE64_STANDARD.encode(file))
}

pub(super) fn pictures(p: &Page) -> String {
    let mut s = String::new();
    if p.pictures.is_empty() {
        return s;
    }
    s.push_str("<div class=\"pictures\">\n");
    for group in &p.pictures {
        match &group[..] {
            [one] => figure(&mut s, one),
            several => {
                s.push_str("<div class=\"pair\">");
                several.iter().for_each(|one| figure(&mut s, one));
                s.push_str("</div>\n");
            }
        }
    }
    s.push_str("</div>\n");
    s
}

fn figure(s: &mut String, picture: &Figure) {
    let (caption, source) = (escaped(picture.caption), source(&picture.file));
    let class = if picture.lines { " class=\"lines\"" } else { "" };
    let _ = writeln!(
        s,
        "<figure><img{class} alt=\"{caption}\" src=\"{source}\"><figcaption>{caption}</figcaption></figure>"
    );
}

/// Returns the place of the viewer, its data and its program.
pub(super) fn viewer(p: &Page) -> String {
    let Some(scene) = p.scene else { return String::new() };
    // Within a script, `</` could end it.
    let (scene, program) = (scene.replace("</", "<\\/"), VIEWER.replace("</script", "<\\/script"));
    format!(
        "<div id=\"viewer\"><noscript>The scene can be turned only with JavaScript.</noscript></div>\n\
         <script type=\"application/json\" id=\"scene\">{scene}</script>\n\
         <script>\n{program}</script>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_belong_together_are_side_by_side() {
        let of = |lines| Figure { caption: "a picture", file: b"\xff\xd8\xff".to_vec(), lines };
        let text = pictures(&Page {
            pictures: vec![vec![of(false)], vec![of(true), of(true)]],
            ..Page::default()
        });
        assert_eq!(text.matches("data:image/jpeg;base64,/9j/").count(), 3);
        assert_eq!(text.matches("<div class=\"pair\"><figure>").count(), 1);
        assert_eq!(text.matches("<img class=\"lines\"").count(), 2);
        assert_eq!(text.matches("<div").count(), text.matches("</div>").count());
    }
}
