//! Small plots of draws as SVG: traces, distributions, ranks.
//!
//! Invariant: only finite numbers are written, whatever the draws are. Draws that are not
//! finite are not shown.

use crate::svg::Svg;
use crate::{Quantity, number};
use std::fmt::Write;

const WIDTH: f64 = 260.0;
/// The height of the plot; `WHOLE` includes the line of labels below it.
const HEIGHT: f64 = 90.0;
const WHOLE: f64 = 103.0;
/// One colour for each chain, distinguishable for the colour-blind (Okabe and Ito 2008):
/// classes of the style sheet.
const COLORS: [&str; 6] = ["c0", "c1", "c2", "c3", "c4", "c5"];
/// The maximum number of points drawn for a chain.
const POINTS: usize = 400;
/// The number of bars of a distribution.
const BINS: usize = 40;
/// The number of bars of a histogram of ranks.
const RANK_BINS: usize = 20;

fn open(title: &str) -> Svg {
    let mut s = Svg::inline(WIDTH, WHOLE, title);
    s.field(WIDTH, HEIGHT, "class=\"field\"");
    s
}

/// Writes a label below the plot, at its left or right end.
fn label(s: &mut Svg, right: bool, text: &str) {
    let (x, anchor) = if right { (WIDTH, "end") } else { (0.0, "start") };
    s.text((x, WHOLE - 3.0), anchor, "", text);
}

/// Returns the smallest and the largest finite draw.
fn range(q: &Quantity) -> Option<(f64, f64)> {
    let all = || q.chains.iter().flatten().copied().filter(|x| x.is_finite());
    let (lo, hi) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    (lo <= hi).then_some((lo, hi))
}

/// Returns the relative position of a draw between two ends, from 0 to 1, or 0.5 if the
/// ends are equal. The values are halved so that the largest doubles do not overflow.
fn place(x: f64, (lo, hi): (f64, f64)) -> f64 {
    let share = (0.5 * x - 0.5 * lo) / (0.5 * hi - 0.5 * lo);
    if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 }
}

/// Returns the path of a step function with the given heights, in pixels from the top.
fn steps(heights: &[f64]) -> String {
    let width = WIDTH / heights.len().max(1) as f64;
    let mut path = String::new();
    for (i, y) in heights.iter().enumerate() {
        let (x0, x1) = (width * i as f64, width * (i + 1) as f64);
        let _ = write!(path, "{}{x0:.1},{y:.1}H{x1:.1}", if i == 0 { 'M' } else { 'L' });
    }
    path
}

/// Returns the style of a chain's line.
fn stroke(chain: usize) -> String {
    format!("class=\"{}\" fill=\"none\" stroke=\"currentColor\"", color(chain))
}

fn color(chain: usize) -> &'static str {
    COLORS[chain % COLORS.len()]
}

/// Plots the draws of each chain in order; the labels are the smallest and the largest.
pub(super) fn traces(q: &Quantity) -> String {
    let mut s = open("draws in order, one line a chain");
    if let Some(ends) = range(q) {
        for (c, xs) in q.chains.iter().enumerate() {
            let across = WIDTH / (xs.len().max(2) - 1) as f64;
            let some = xs.iter().enumerate().step_by(xs.len().div_ceil(POINTS).max(1));
            let points = some
                .filter(|(_, x)| x.is_finite())
                .map(|(i, x)| (across * i as f64, HEIGHT - 2.0 - (HEIGHT - 4.0) * place(*x, ends)));
            let style =
                format!("class=\"{}\" stroke=\"currentColor\" stroke-width=\"0.8\"", color(c));
            s.line(points, &style, "");
        }
        label(&mut s, false, &format!("{} to {}", number(ends.0), number(ends.1)));
        label(&mut s, true, &format!("{} draws", q.chains.iter().map(Vec::len).max().unwrap_or(0)));
    }
    s.end()
}

/// Plots the distribution of the draws of each chain; the labels are the ends of the
/// axis.
pub(super) fn marginal(q: &Quantity) -> String {
    let mut s = open("distribution of the draws, one line a chain");
    if let Some(ends) = range(q) {
        let count = |xs: &Vec<f64>| {
            let mut bins = [0.0f64; BINS];
            for x in xs.iter().filter(|x| x.is_finite()) {
                bins[((place(*x, ends) * BINS as f64) as usize).min(BINS - 1)] +=
                    1.0 / xs.len() as f64;
            }
            bins
        };
        let all: Vec<_> = q.chains.iter().map(count).collect();
        let top = all.iter().flatten().copied().fold(1e-9, f64::max);
        for (c, bins) in all.iter().enumerate() {
            let path = steps(&bins.map(|b| HEIGHT - (HEIGHT - 4.0) * b / top));
            let style = "fill=\"currentColor\" fill-opacity=\"0.15\"";
            s.path(&format!("{path}V{HEIGHT}H0Z"), &format!("class=\"{}\" {style}", color(c)));
            s.path(&path, &stroke(c));
        }
        label(&mut s, false, &number(ends.0));
        label(&mut s, true, &number(ends.1));
    }
    s.end()
}

/// Returns the number of each chain's draws with ranks in each bin, relative to a uniform
/// distribution; `[chain][bin]`. Equal draws share their ranks, so that chains that agree
/// look alike for discrete quantities too.
fn rank_densities(chains: &[Vec<f64>]) -> Vec<[f64; RANK_BINS]> {
    let mut order: Vec<(f64, usize)> = chains
        .iter()
        .enumerate()
        .flat_map(|(c, xs)| xs.iter().map(move |x| (*x + 0.0, c)))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let scale = RANK_BINS as f64 / order.len().max(1) as f64;
    let mut shares = vec![[0.0f64; RANK_BINS]; chains.len()];
    let mut first = 0;
    for equal in order.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()) {
        // The range of the ranks of these draws, in bins.
        let (from, to) = (first as f64 * scale, (first + equal.len()) as f64 * scale);
        let mut own = vec![0.0; chains.len()];
        equal.iter().for_each(|(_, c)| own[*c] += 1.0);
        for bin in from as usize..(to.ceil() as usize).min(RANK_BINS) {
            let overlap = (to.min(bin as f64 + 1.0) - from.max(bin as f64)).max(0.0) / (to - from);
            for ((share, own), xs) in shares.iter_mut().zip(&own).zip(chains) {
                share[bin] += own * overlap * RANK_BINS as f64 / xs.len().max(1) as f64;
            }
        }
        first += equal.len();
    }
    shares
}

/// Plots histograms of the ranks of each chain's draws among all draws: uniform if the
/// chains agree (Vehtari et al. 2021, section 4.3).
pub(super) fn ranks(q: &Quantity) -> String {
    let mut s =
        open("ranks of each chain's draws among all; level lines mean that the chains agree");
    // A uniform distribution is at a third of the height; values beyond the top are
    // clipped.
    let height = |share: f64| (HEIGHT - HEIGHT / 3.0 * share).max(2.0);
    let level = format!("M0,{:.1}H{WIDTH}", height(1.0));
    s.path(&level, "class=\"level\" stroke-dasharray=\"3 3\"");
    for (c, shares) in
        rank_densities(&q.chains).iter().enumerate().filter(|(c, _)| !q.chains[*c].is_empty())
    {
        s.path(&steps(&shares.map(height)), &stroke(c));
    }
    label(&mut s, false, "lowest rank");
    label(&mut s, true, "highest");
    s.end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_inference::diagnostics::summary;

    fn quantity(chains: Vec<Vec<f64>>) -> Quantity {
        Quantity { name: "x".into(), column: None, summary: summary(&chains), chains }
    }

    #[test]
    fn only_finite_numbers_are_written() {
        let big = f64::MAX;
        for chains in [
            vec![vec![1.0, 2.0, f64::NAN, 4.0], vec![3.0, f64::INFINITY, f64::NEG_INFINITY, 2.5]],
            vec![vec![2.0; 5]],
            vec![vec![1e300; 5]],
            vec![vec![-big, big], vec![0.0]],
            vec![vec![f64::NAN; 3]],
            vec![vec![]],
            vec![],
        ] {
            let q = quantity(chains);
            for svg in [traces(&q), marginal(&q), ranks(&q)] {
                assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
                for data in svg.split("points=\"").skip(1).chain(svg.split(" d=\"").skip(1)) {
                    let data = data.split('"').next().unwrap();
                    assert!(!data.contains("NaN") && !data.contains("inf"), "{svg}");
                }
            }
        }
    }

    #[test]
    fn every_chain_is_drawn_within_the_plot() {
        let q = quantity(vec![(0..1000).map(f64::from).collect(), vec![500.0; 10]]);
        let svg = traces(&q);
        let lines: Vec<&str> =
            svg.split("points=\"").skip(1).map(|l| l.split('"').next().unwrap()).collect();
        assert_eq!(
            lines.iter().map(|l| l.split_whitespace().count()).collect::<Vec<_>>(),
            [334, 10]
        );
        assert!(lines[0].starts_with("0.0,88.0 ") && lines[1].ends_with(" 260.0,45.0"), "{svg}");
        assert!(svg.contains(">0 to 999<") && svg.contains(">1000 draws<"));
        assert_eq!(marginal(&q).matches("fill=\"none\"").count(), 2);
    }

    #[test]
    fn ranks_are_level_where_chains_agree() {
        let level =
            |shares: &[[f64; RANK_BINS]]| shares.iter().flatten().all(|s| (s - 1.0).abs() < 1e-9);
        let half = |odd: usize| (0..200).map(|i| (2 * i + odd) as f64).collect::<Vec<_>>();
        assert!(level(&rank_densities(&[half(0), half(1)])));
        let coins = |n: usize| (0..n).map(|i| f64::from(i as u32 % 2)).collect::<Vec<_>>();
        assert!(
            level(&rank_densities(&[coins(50), coins(50), coins(90)])),
            "equal draws share their ranks"
        );
        assert!(level(&rank_densities(&[vec![0.0, -0.0, 0.0], vec![-0.0; 3]])), "zeros are equal");
        let apart = rank_densities(&[vec![1.0; 30], vec![2.0; 30]]);
        assert_eq!((apart[0][0], apart[0][19], apart[1][0]), (2.0, 0.0, 0.0));
        for chain in &apart {
            assert!((chain.iter().sum::<f64>() - RANK_BINS as f64).abs() < 1e-9);
        }
    }
}
