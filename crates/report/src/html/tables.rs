//! The tables of a page. The most important columns come first; tables that are too wide
//! scroll separately.

use super::encode::{breakable, escaped};
use super::pictures::source;
use super::{PLOTTED, Page};
use crate::{Quantity, r_hat_text, seconds};
use pcadlang_inference::draws::KernelStats;
use std::fmt::Write;

/// Formats a table that may be wider than the page.
fn wide(head: &str, rows: &str) -> String {
    format!("<div class=\"wide\"><table>\n<tr>{head}</tr>\n{rows}</table></div>\n")
}

pub(super) fn quantities(quantities: &[Quantity]) -> String {
    if quantities.is_empty() {
        return String::new();
    }
    let head = "<th>quantity<th>mean<th>sd<th>R-hat<th>5%<th>median<th>95%<th>ESS bulk<th>ESS tail<th>\
                <abbr title=\"Monte Carlo standard error of the mean\">error</abbr>";
    let mut s = String::new();
    for (i, q) in quantities.iter().enumerate() {
        let (m, name) = (&q.summary, breakable(&q.name));
        let class = if m.r_hat > 1.01 || q.is_stuck() { " class=\"bad\"" } else { "" };
        let r_hat = escaped(&r_hat_text(m.r_hat));
        match i < PLOTTED {
            true => _ = write!(s, "<tr><th><a href=\"#q{i}\">{name}</a>"),
            false => _ = write!(s, "<tr><th>{name}"),
        }
        let known = |x: f64| if q.frequent.is_some() { f64::NAN } else { x };
        let frequent = q.frequent.as_ref().map(|f| escaped(&f.to_string()));
        let mean = frequent.unwrap_or_else(|| q.number(m.mean));
        let _ = write!(s, "<td>{mean}<td>{}<td{class}>{r_hat}", q.number(known(m.sd)));
        let [low, median, high, error] = [m.q05, m.q50, m.q95, m.mcse_mean].map(known);
        for x in [low, median, high, m.ess_bulk.round(), m.ess_tail.round(), error] {
            let _ = write!(s, "<td>{}", q.number(x));
        }
        s.push_str("</tr>\n");
    }
    wide(head, &s)
}

/// Formats a table of the modes that the chains are in, if there are several, each with
/// its picture.
pub(super) fn modes(p: &Page) -> String {
    let rows = crate::modes::modes_rows(p.modes, p.quantities);
    let Some((names, body)) = rows.split_first() else { return String::new() };
    let (mut head, mut s) = (String::new(), String::new());
    for (i, name) in names.iter().enumerate() {
        let name = escaped(name);
        head.push_str("<th>");
        // The first two columns are the names and the means over all chains.
        if let Some(file) = i.checked_sub(2).and_then(|i| p.mode_pictures.get(i)?.as_deref()) {
            let _ = write!(
                head,
                "<img class=\"thumb\" alt=\"the best state of {name}\" src=\"{}\"><br>",
                source(file)
            );
        }
        head.push_str(&name);
    }
    for row in body {
        s.push_str("<tr>");
        row.iter().enumerate().for_each(|(i, c)| match i {
            0 => _ = write!(s, "<th>{}", breakable(c)),
            _ => _ = write!(s, "<td>{}", escaped(c)),
        });
        s.push_str("</tr>\n");
    }
    let text = wide(&head, &s);
    format!("<p class=\"note\">The chains are in {} different modes.</p>\n{text}", p.modes.len())
}

pub(super) fn kernels(kernels: &[KernelStats]) -> String {
    if kernels.is_empty() {
        return String::new();
    }
    let mut s = String::new();
    for k in kernels {
        let rate = k.acceptance().map_or("-".to_owned(), |r| format!("{:.0}%", 100.0 * r));
        let (name, time) = (breakable(&k.name), seconds(k.seconds));
        let _ = writeln!(
            s,
            "<tr><th>{name}<td>{}<td>{rate}<td>{}<td>{time}</tr>",
            k.proposals, k.failed
        );
    }
    let text = wide("<th>kernel<th>proposals<th>accepted<th>failed<th>time", &s);
    format!(
        "{text}<p class=\"note\">After warm-up. Failed: the log density of the proposal is undefined.</p>\n"
    )
}

pub(super) fn list(items: &[String]) -> String {
    if items.is_empty() {
        return String::new();
    }
    let items = items.iter().fold(String::new(), |s, item| s + "<li>" + &escaped(item) + "\n");
    format!("<ul>\n{items}</ul>\n")
}

pub(super) fn settings(settings: &[(&str, String)]) -> String {
    if settings.is_empty() {
        return String::new();
    }
    let rows = settings.iter().fold(String::new(), |mut s, (k, v)| {
        let _ = writeln!(s, "<tr><th>{}<td>{}</tr>", escaped(k), escaped(v));
        s
    });
    format!("<table class=\"settings\">\n{rows}</table>\n")
}
