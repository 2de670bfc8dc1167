//! The pictures of a page and its mesh.

use super::encode::{coordinates, escaped};
use super::{MeshData, Page, Picture};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use std::fmt::Write;

const VIEWER: &str = include_str!("viewer.js");

/// Returns the file of a picture as a `data:` URL.
pub(super) fn source(file: &[u8]) -> String {
    let kind = if file.starts_with(b"\xff\xd8") { "jpeg" } else { "png" };
    format!("data:image/{kind};base64,{}", BASE64_STANDARD.encode(file))
}

pub(super) fn pictures(p: &Page) -> String {
    let mut s = String::new();
    if p.pictures.is_empty() && p.mesh.is_none() {
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
    if let Some(mesh) = &p.mesh {
        mesh_viewer(&mut s, mesh);
    }
    s.push_str("</div>\n");
    s
}

fn figure(s: &mut String, picture: &Picture) {
    let (caption, source) = (escaped(picture.caption), source(&picture.file));
    let class = if picture.lines { " class=\"lines\"" } else { "" };
    let _ = writeln!(
        s,
        "<figure><img{class} alt=\"{caption}\" src=\"{source}\"><figcaption>{caption}</figcaption></figure>"
    );
}

fn mesh_viewer(s: &mut String, m: &MeshData) {
    let known = |t: &&[u32; 3]| t.iter().all(|i| (*i as usize) < m.positions.len());
    let triangles: Vec<String> =
        m.triangles.iter().filter(known).flatten().map(u32::to_string).collect();
    let _ = writeln!(
        s,
        "<figure><canvas id=\"mesh\" width=\"384\" height=\"384\" tabindex=\"0\"></canvas>\
         <figcaption>the best state; drag to rotate, scroll to zoom, double-click to reset</figcaption></figure>\n\
         <script type=\"application/json\" id=\"mesh-data\">{{\"positions\":[{}],\"triangles\":[{}]}}</script>\n\
         <script>\n{VIEWER}</script>",
        coordinates(m.positions),
        triangles.join(",")
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_belong_together_are_side_by_side() {
        let of = |lines| Picture { caption: "a picture", file: b"\xff\xd8\xff".to_vec(), lines };
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
