//! Small plots of draws as SVG.

use super::Quantity;
use std::fmt::Write;

const WIDTH: f64 = 260.0;
const HEIGHT: f64 = 90.0;
/// One colour for each chain, told apart also by the colour blind (Okabe and Ito 2008).
const COLORS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];
/// At most this many points of a chain are drawn.
const POINTS: usize = 400;

fn open(s: &mut String, title: &str) {
    let _ = write!(
        s,
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\"><title>{title}</title>\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fafafa\"/>"
    );
}

fn range(q: &Quantity) -> Option<(f64, f64)> {
    let all = || q.chains.iter().flatten().copied().filter(|x| x.is_finite());
    let (lo, hi) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    (lo <= hi).then_some(if hi > lo { (lo, hi) } else { (lo - 0.5, hi + 0.5) })
}

/// The draws of each chain in order.
pub(super) fn traces(q: &Quantity) -> String {
    let mut s = String::new();
    open(&mut s, "draws in order, one line a chain");
    if let Some((lo, hi)) = range(q) {
        for (c, xs) in q.chains.iter().enumerate() {
            let step = xs.len().div_ceil(POINTS).max(1);
            let points: String = xs
                .iter()
                .enumerate()
                .step_by(step)
                .filter(|(_, x)| x.is_finite())
                .map(|(i, x)| {
                    let px = WIDTH * i as f64 / (xs.len().max(2) - 1) as f64;
                    format!("{px:.1},{:.1} ", (HEIGHT - 4.0) * (1.0 - (x - lo) / (hi - lo)) + 2.0)
                })
                .collect();
            let color = COLORS[c % COLORS.len()];
            let _ = write!(s, "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"0.8\"/>");
        }
    }
    s.push_str("</svg>");
    s
}

/// The distribution of the draws of each chain.
pub(super) fn marginal(q: &Quantity) -> String {
    let mut s = String::new();
    open(&mut s, "distribution of the draws, one line a chain");
    if let Some((lo, hi)) = range(q) {
        const BINS: usize = 40;
        let count = |xs: &[f64]| {
            let mut bins = [0.0f64; BINS];
            for x in xs.iter().filter(|x| x.is_finite()) {
                bins[(((x - lo) / (hi - lo) * BINS as f64) as usize).min(BINS - 1)] += 1.0 / xs.len() as f64;
            }
            bins
        };
        let all: Vec<_> = q.chains.iter().map(|xs| count(xs)).collect();
        let top = all.iter().flatten().copied().fold(1e-9, f64::max);
        for (c, bins) in all.iter().enumerate() {
            let mut path = format!("M0,{HEIGHT}");
            for (i, b) in bins.iter().enumerate() {
                let y = HEIGHT - (HEIGHT - 4.0) * b / top;
                let (x0, x1) = (WIDTH * i as f64 / BINS as f64, WIDTH * (i + 1) as f64 / BINS as f64);
                let _ = write!(path, "L{x0:.1},{y:.1}L{x1:.1},{y:.1}");
            }
            let color = COLORS[c % COLORS.len()];
            let _ = write!(
                s,
                "<path d=\"{path}L{WIDTH},{HEIGHT}\" fill=\"{color}\" fill-opacity=\"0.15\" stroke=\"{color}\"/>"
            );
        }
    }
    s.push_str("</svg>");
    s
}

/// Histograms of the ranks of each chain's draws among all: level if the chains agree (Vehtari et al. 2021, section 4.3).
pub(super) fn ranks(q: &Quantity) -> String {
    let mut s = String::new();
    open(&mut s, "ranks of each chain's draws among all; level lines mean that the chains agree");
    const BINS: usize = 20;
    let mut order: Vec<(f64, usize)> =
        q.chains.iter().enumerate().flat_map(|(c, xs)| xs.iter().map(move |x| (*x, c))).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut counts = vec![[0.0f64; BINS]; q.chains.len()];
    for (rank, (_, c)) in order.iter().enumerate() {
        counts[*c][rank * BINS / order.len()] += 1.0 / q.chains[*c].len() as f64;
    }
    for (c, bins) in counts.iter().enumerate() {
        let mut path = String::new();
        for (i, b) in bins.iter().enumerate() {
            // The level of agreement is a third of the height.
            let y = (HEIGHT - HEIGHT / 3.0 * b * BINS as f64).max(2.0);
            let (x0, x1) = (WIDTH * i as f64 / BINS as f64, WIDTH * (i + 1) as f64 / BINS as f64);
            let _ = write!(path, "{}{x0:.1},{y:.1}L{x1:.1},{y:.1}", if i == 0 { 'M' } else { 'L' });
        }
        let _ = write!(s, "<path d=\"{path}\" fill=\"none\" stroke=\"{}\"/>", COLORS[c % COLORS.len()]);
    }
    s.push_str("</svg>");
    s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::infer::diagnostics::summary;

    #[test]
    fn plots_hold_every_chain_and_only_finite_numbers() {
        for chains in [vec![vec![1.0, 2.0, f64::NAN, 4.0], vec![3.0, 1.0, 2.0, 2.5]], vec![vec![2.0; 5]], vec![vec![]]]
        {
            let q = Quantity { name: "x".into(), column: None, summary: summary(&chains), chains };
            for svg in [traces(&q), marginal(&q), ranks(&q)] {
                assert!(svg.starts_with("<svg") && svg.ends_with("</svg>"));
                assert!(!svg.contains("NaN") && !svg.contains("inf,"), "{svg}");
            }
        }
    }
}
