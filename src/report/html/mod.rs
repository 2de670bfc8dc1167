//! `report.html`: one file that holds everything: pictures, plots, tables, the mesh to turn round, the program.
//!
//! Invariant: the page asks nothing of the network, and whatever it quotes is escaped.

mod encode;
mod plots;

use super::{Mode, Quantity, number, r_hat_text, seconds};
use crate::infer::draws::KernelStats;
pub use encode::base64;
use encode::{coordinates, escaped};
use std::fmt::Write;

/// What a page shows.
#[derive(Clone, Debug, Default)]
pub struct Page<'a> {
    /// The program's name.
    pub title: &'a str,
    /// Pairs of setting and value.
    pub settings: Vec<(&'a str, String)>,
    /// PNG files with their captions.
    pub pictures: Vec<(&'a str, Vec<u8>)>,
    /// The scalar quantities.
    pub quantities: &'a [Quantity],
    /// The modes that the chains are in, if there are several.
    pub modes: &'a [Mode],
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
const VIEWER: &str = include_str!("viewer.js");

/// The page. Writing to a text does not fail, so results of `write!` are not looked at here.
pub fn page(p: &Page) -> String {
    let mut s = String::new();
    let title = escaped(p.title);
    let _ = write!(
        s,
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>{title}</title>\
         <style>\n{STYLE}</style>\n<h1>{title}</h1>\n"
    );
    for w in p.warnings {
        let _ = writeln!(s, "<p class=\"warning\">{}</p>", escaped(w));
    }
    pictures(&mut s, p);
    quantities(&mut s, p.quantities);
    modes(&mut s, p.modes, p.quantities);
    kernels(&mut s, p.kernels);
    draws(&mut s, p.quantities);
    if !p.approximate.is_empty() {
        s.push_str("<h2>What is approximate</h2>\n<ul>\n");
        p.approximate.iter().for_each(|a| {
            let _ = writeln!(s, "<li>{}", escaped(a));
        });
        s.push_str("</ul>\n");
    }
    s.push_str("<h2>Settings</h2>\n<table class=\"settings\">\n");
    for (k, v) in &p.settings {
        let _ = writeln!(s, "<tr><td>{}<td>{}</tr>", escaped(k), escaped(v));
    }
    let _ = write!(s, "</table>\n<h2>Program</h2>\n<pre>{}</pre></html>", escaped(p.program));
    s
}

fn pictures(s: &mut String, p: &Page) {
    if p.pictures.is_empty() && p.mesh.is_none() {
        return;
    }
    s.push_str("<div class=\"pictures\">\n");
    for (caption, png) in &p.pictures {
        let (caption, data) = (escaped(caption), base64(png));
        let _ = writeln!(
            s,
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
        );
    }
    if let Some(m) = &p.mesh {
        let known = |t: &&[u32; 3]| t.iter().all(|i| (*i as usize) < m.positions.len());
        let triangles: Vec<String> = m.triangles.iter().filter(known).flatten().map(u32::to_string).collect();
        let _ = writeln!(
            s,
            "<figure><canvas id=\"mesh\" width=\"384\" height=\"384\" tabindex=\"0\"></canvas>\
             <figcaption>the best state; drag to turn it, wheel to come closer, double click to go back</figcaption></figure>\n\
             <script type=\"application/json\" id=\"mesh-data\">{{\"positions\":[{}],\"triangles\":[{}]}}</script>\n\
             <script>\n{VIEWER}</script>",
            coordinates(m.positions),
            triangles.join(",")
        );
    }
    s.push_str("</div>\n");
}

fn quantities(s: &mut String, quantities: &[Quantity]) {
    s.push_str(
        "<h2>Quantities</h2>\n<table>\n<tr><th>quantity<th>mean<th>sd<th>5%<th>median<th>95%<th>\
         <abbr title=\"Monte Carlo standard error of the mean\">error</abbr><th>ESS bulk<th>ESS tail<th>R-hat</tr>\n",
    );
    for q in quantities {
        let m = &q.summary;
        let _ = write!(s, "<tr><td>{}", escaped(&q.name));
        for x in [m.mean, m.sd, m.q05, m.q50, m.q95, m.mcse_mean, m.ess_bulk.round(), m.ess_tail.round()] {
            let _ = write!(s, "<td>{}", number(x));
        }
        let class = if m.r_hat > 1.01 { " class=\"bad\"" } else { "" };
        let r_hat = escaped(&r_hat_text(m.r_hat));
        let _ = writeln!(s, "<td{class}>{r_hat}</tr>");
    }
    s.push_str("</table>\n");
}

/// The modes that the chains are in, if there are several.
fn modes(s: &mut String, found: &[Mode], quantities: &[Quantity]) {
    let rows = super::modes::modes_rows(found, quantities);
    let Some((head, body)) = rows.split_first() else { return };
    let _ = writeln!(s, "<h2>Modes</h2>\n<p class=\"note\">The chains are in {} different modes.</p>", found.len());
    s.push_str("<table>\n<tr>");
    head.iter().for_each(|h| {
        let _ = write!(s, "<th>{}", escaped(h));
    });
    s.push_str("</tr>\n");
    for row in body {
        s.push_str("<tr>");
        row.iter().for_each(|c| {
            let _ = write!(s, "<td>{}", escaped(c));
        });
        s.push_str("</tr>\n");
    }
    s.push_str("</table>\n");
}

fn kernels(s: &mut String, kernels: &[KernelStats]) {
    if kernels.is_empty() {
        return;
    }
    s.push_str("<h2>Kernels</h2>\n<table>\n<tr><th>kernel<th>proposals<th>accepted<th>failed<th>time</tr>\n");
    for k in kernels {
        let rate = k.acceptance().map_or("-".to_owned(), |r| format!("{:.0}%", 100.0 * r));
        let (name, time) = (escaped(&k.name), seconds(k.seconds));
        let _ = writeln!(s, "<tr><td>{name}<td>{}<td>{rate}<td>{}<td>{time}</tr>", k.proposals, k.failed);
    }
    s.push_str(
        "</table>\n<p class=\"note\">After warm-up. Failed: the program has no value at what was proposed.</p>\n",
    );
}

fn draws(s: &mut String, quantities: &[Quantity]) {
    s.push_str(
        "<h2>Draws</h2>\n<p class=\"note\">One colour a chain. Left: in order. Middle: their distribution. Right: how often \
         each rank among all draws is the chain's, level where chains agree.</p>\n",
    );
    for q in quantities.iter().take(PLOTTED) {
        let (a, b, c) = (plots::traces(q), plots::marginal(q), plots::ranks(q));
        let _ = writeln!(s, "<div class=\"plots\"><b>{}</b>{a}{b}{c}</div>", escaped(&q.name));
    }
    if let Some(more) = quantities.len().checked_sub(PLOTTED + 1) {
        let _ = writeln!(s, "<p class=\"note\">… and {} more, in the files of draws.</p>", more + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::diagnostics::summary;

    #[test]
    fn the_page_is_whole_and_escapes_what_it_quotes() {
        let text = "</pre><script>alert(1)</script> & \"s\" 'q'";
        let chains = vec![vec![1.0, 2.0, 4.0, 3.0, 2.0], vec![9.0, 8.0, 9.5, 9.0, 8.5]];
        let q = Quantity { name: text.into(), column: Some(0), summary: summary(&chains), chains };
        let kernel = KernelStats { name: text.into(), ..Default::default() };
        let page = page(&Page {
            title: text,
            program: text,
            pictures: vec![(text, vec![1, 2, 3])],
            mesh: Some(MeshData { positions: &[[0.0, f32::NAN, 2.0]; 3], triangles: &[[0, 1, 2], [0, 1, 3]] }),
            settings: vec![("seed", text.into())],
            modes: &super::super::modes(std::slice::from_ref(&q), None),
            quantities: &[q],
            kernels: &[kernel],
            warnings: &[text.into()],
            approximate: &[text.into()],
        });
        assert!(!page.contains("alert(1)</") && !page.contains("& ") && !page.contains("alert(1)<"), "escaped");
        assert_eq!(page.matches("&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;s&quot;").count(), 12);
        assert!(page.contains("data:image/png;base64,AQID"));
        assert!(page.contains("{\"positions\":[0,0,2,0,0,2,0,0,2],\"triangles\":[0,1,2]}"));
        assert!(page.contains("<td class=\"bad\">") && page.contains("<td>0<td>-<td>0<td>0.00 s"));
        assert!(page.ends_with("</html>") && !page.contains("http"), "nothing comes from the network");
        for tag in ["table", "div", "figure", "script", "svg", "canvas", "pre", "h2"] {
            let (opened, closed) = (format!("<{tag}"), format!("</{tag}>"));
            assert_eq!(page.matches(&opened).count(), page.matches(&closed).count(), "{tag}");
        }
    }

    #[test]
    fn a_page_of_nothing() {
        let page = page(&Page::default());
        assert!(page.ends_with("</html>") && !page.contains("<canvas") && !page.contains("more, in the files"));
    }

    #[test]
    fn many_quantities_are_listed_but_not_all_plotted() {
        let chains = vec![vec![1.0, 2.0]];
        let q = |i| Quantity { name: format!("q{i}"), column: None, summary: summary(&chains), chains: chains.clone() };
        let all: Vec<Quantity> = (0..PLOTTED + 3).map(q).collect();
        let page = page(&Page { quantities: &all, ..Page::default() });
        assert_eq!(page.matches("class=\"plots\"").count(), PLOTTED);
        assert!(page.contains("and 3 more") && page.contains("<td>q42<"));
    }
}
