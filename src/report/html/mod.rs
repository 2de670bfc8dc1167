//! `report.html`: one file that holds everything: pictures, plots, tables, the mesh to
//! turn round, the program.
//!
//! Invariant: the page asks nothing of the network, and whatever it quotes is escaped.

mod encode;
mod pictures;
mod plots;
mod tables;

use super::{Mode, Quantity};
use crate::infer::draws::KernelStats;
pub use encode::base64;
use encode::escaped;
use std::fmt::Write;

/// What a page shows.
#[derive(Clone, Debug, Default)]
pub struct Page<'a> {
    /// The program's name.
    pub title: &'a str,
    /// What is said below it: when it was, how long it took, and the like.
    pub facts: Vec<String>,
    /// What is typed to have the run again; nothing if that is not known.
    pub command: &'a str,
    /// Pairs of setting and value.
    pub settings: Vec<(&'a str, String)>,
    /// Pictures; those that belong side by side together.
    pub pictures: Vec<Vec<Picture<'a>>>,
    /// The scalar quantities.
    pub quantities: &'a [Quantity],
    /// The modes that the chains are in, if there are several.
    pub modes: &'a [Mode],
    /// A picture of each of the first modes, as files.
    pub mode_pictures: Vec<Option<Vec<u8>>>,
    /// The kernels.
    pub kernels: &'a [KernelStats],
    /// What a reader should know first.
    pub warnings: &'a [String],
    /// What is approximate.
    pub approximate: &'a [String],
    /// The mesh of the best state.
    pub mesh: Option<MeshData<'a>>,
    /// The program's text.
    pub program: &'a str,
}

/// A picture on the page.
#[derive(Clone, Debug, Default)]
pub struct Picture<'a> {
    /// What is said below it.
    pub caption: &'a str,
    /// The bytes of a PNG or JPEG file.
    pub file: Vec<u8>,
    /// Whether it is bright lines on black: a bright page shows them dark on white.
    pub lines: bool,
}

/// A mesh to turn round.
#[derive(Clone, Copy, Debug)]
pub struct MeshData<'a> {
    /// Vertices.
    pub positions: &'a [[f32; 3]],
    /// Vertices of each triangle; a triangle with a number that is no vertex is left out.
    pub triangles: &'a [[u32; 3]],
}

/// Quantities that get plots.
const PLOTTED: usize = 40;
const STYLE: &str = include_str!("style.css");
const COPY: &str = include_str!("copy.js");

/// The page. Writing to a text does not fail, so results of `write!` are not looked at
/// here.
pub fn page(p: &Page) -> String {
    let mut s = String::new();
    let title = escaped(p.title);
    let _ = write!(
        s,
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta name=\"color-scheme\" content=\"light dark\"><title>{title}</title>\
         <style>\n{STYLE}</style>\n<h1>{title}</h1>\n"
    );
    if !p.facts.is_empty() {
        let facts: Vec<String> = p.facts.iter().map(|f| escaped(f)).collect();
        let _ = writeln!(s, "<p class=\"facts\">{}</p>", facts.join(" · "));
    }
    if !p.command.is_empty() {
        let _ = writeln!(
            s,
            "<div class=\"command\"><pre id=\"command\">{}</pre></div>",
            escaped(p.command)
        );
        let _ = writeln!(s, "<script>\n{COPY}</script>");
    }
    for w in p.warnings {
        let _ = writeln!(s, "<p class=\"warning\">{}</p>", escaped(w));
    }
    let parts = parts(p);
    s.push_str("<nav>");
    for (id, heading, _) in &parts {
        let _ = write!(s, "<a href=\"#{id}\">{heading}</a> ");
    }
    s.push_str("</nav>\n");
    for (id, heading, body) in &parts {
        let _ = write!(s, "<section id=\"{id}\">\n<h2>{heading}</h2>\n{body}</section>\n");
    }
    s.push_str("</html>");
    s
}

/// What the page is made of, without what is empty: names to link to, headings, contents.
fn parts(p: &Page) -> Vec<(&'static str, &'static str, String)> {
    let mut all = vec![
        ("pictures", "Pictures", pictures::pictures(p)),
        ("quantities", "Quantities", tables::quantities(p.quantities)),
        ("modes", "Modes", tables::modes(p)),
        ("draws", "Draws", draws(p.quantities)),
        ("kernels", "Kernels", tables::kernels(p.kernels)),
        ("approximate", "Approximations", tables::list(p.approximate)),
        ("settings", "Settings", tables::settings(&p.settings)),
    ];
    if !p.program.is_empty() {
        all.push(("program", "Program", format!("<pre>{}</pre>\n", escaped(p.program))));
    }
    all.retain(|(.., body)| !body.is_empty());
    all
}

fn draws(quantities: &[Quantity]) -> String {
    let mut s = String::new();
    if quantities.is_empty() {
        return s;
    }
    s.push_str(
        "<p class=\"note\">One colour per chain. First: trace plot. Second: density. Third: rank plot, flat if the chains agree.</p>\n",
    );
    for (i, q) in quantities.iter().take(PLOTTED).enumerate() {
        let (a, b, c) = (plots::traces(q), plots::marginal(q), plots::ranks(q));
        let name = encode::breakable(&q.name);
        let _ = writeln!(s, "<div class=\"plots\" id=\"q{i}\"><b>{name}</b>{a}{b}{c}</div>");
    }
    if let Some(more) = quantities.len().checked_sub(PLOTTED + 1) {
        let _ = writeln!(s, "<p class=\"note\">… and {} more, in the draw files.</p>", more + 1);
    }
    s
}

#[cfg(test)]
mod tests;
