//! `report.html`: a single file that contains the pictures, plots, tables, draws to look at
//! from all sides, and the program.
//!
//! Invariant: the page loads nothing from the network, and all quoted text is escaped.

mod encode;
mod pictures;
mod plots;
mod tables;

use super::{Mode, Quantity};
pub(super) use encode::escaped;
use pcadlang_inference::draws::KernelStats;
use std::fmt::Write;

/// The contents of a page.
#[derive(Clone, Debug, Default)]
pub struct Page<'a> {
    /// The program's name.
    pub title: &'a str,
    /// Whether the object of the photograph was found, and why, in one sentence.
    pub found: Option<&'a str>,
    /// Facts shown below the title, such as the date and the time taken.
    pub facts: Vec<String>,
    /// The command that repeats the run; empty if it is not known.
    pub command: &'a str,
    /// Pairs of setting and value.
    pub settings: Vec<(&'a str, String)>,
    /// Pictures in groups; those of a group are side by side.
    pub pictures: Vec<Vec<Figure<'a>>>,
    /// The scalar quantities.
    pub quantities: &'a [Quantity],
    /// The modes that the chains are in, if there are several.
    pub modes: &'a [Mode],
    /// A picture of each of the first modes, as the bytes of a file.
    pub mode_pictures: Vec<Option<Vec<u8>>>,
    /// The statistics of the kernels.
    pub kernels: &'a [KernelStats],
    /// Warnings that a reader should see first.
    pub warnings: &'a [String],
    /// The approximations that were made.
    pub approximate: &'a [String],
    /// The data of the viewer ([`super::embedded`]), as JSON.
    pub scene: Option<&'a str>,
    /// The program's text.
    pub program: &'a str,
}

/// A picture on the page.
#[derive(Clone, Debug, Default)]
pub struct Figure<'a> {
    /// The text below it.
    pub caption: &'a str,
    /// The bytes of a PNG or JPEG file.
    pub file: Vec<u8>,
    /// True if it shows bright lines on black; on a bright page they are shown dark on
    /// white.
    pub lines: bool,
}

/// The maximum number of quantities with plots.
const PLOTTED: usize = 40;
const STYLE: &str = include_str!("style.css");
const COPY: &str = include_str!("copy.js");

/// Returns the page. Writing to a string cannot fail, so the results of `write!` are
/// ignored in this module.
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
    if let Some(found) = p.found {
        let _ = writeln!(s, "<p class=\"found\">{}</p>", escaped(found));
    }
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

/// Returns the sections of the page that are not empty: identifiers for links, headings,
/// contents.
fn parts(p: &Page) -> Vec<(&'static str, &'static str, String)> {
    let mut all = vec![
        ("states", "Scene", pictures::viewer(p)),
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
        "<p class=\"note\">One colour per chain. First: trace plot; drag to enlarge a part. Second: density. Third: rank plot, flat if the chains agree.</p>\n",
    );
    let plotted = &quantities[..quantities.len().min(PLOTTED)];
    for (i, q) in plotted.iter().enumerate() {
        let name = encode::breakable(&q.name);
        let _ = writeln!(s, "<div class=\"plots\" id=\"q{i}\"><b>{name}</b></div>");
    }
    s.push_str(&plots::scripts(plotted));
    if let Some(more) = quantities.len().checked_sub(PLOTTED + 1) {
        let _ = writeln!(s, "<p class=\"note\">… and {} more, in the draw files.</p>", more + 1);
    }
    s
}

#[cfg(test)]
mod tests;
