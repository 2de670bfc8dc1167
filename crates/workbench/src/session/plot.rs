//! `:plot x`: a text plot of a quantity of the last inference.

use super::reply::Reply;
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_report::{Quantity, number, quantities};
use pcadlang_syntax::diag::nearest;

/// The number of bins of a histogram.
const BARS: usize = 12;
/// The width of the longest bar, and of the trace plot, in characters.
const WIDTH: usize = 50;
/// Up to this many distinct values are counted one by one.
const FEW: usize = 12;
/// Blocks in eighths of a character, from the left and from below.
const LEFT: [&str; 8] = ["", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];
const BELOW: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

impl Session {
    /// `:plot x`.
    pub(super) fn plot(&self, name: &str) -> Result<Reply, Failure> {
        let (said, draws) = self.latest_draws()?;
        let all = quantities(&[draws]);
        if let Some(q) = all.iter().find(|q| q.name == name) {
            return Ok(Reply::text(said + &plotted(q)));
        }
        let names = all.iter().map(|q| q.name.as_str());
        let failure = plain(format!("the last inference has no quantity `{name}`"));
        Err(match nearest(name, names.clone()) {
            Some(n) => failure.hint(format!("did you mean `{n}`?")),
            None => {
                failure.hint(format!("it has {}", names.take(20).collect::<Vec<_>>().join(", ")))
            }
        })
    }

    /// Returns the names of the quantities of the last inference.
    pub(super) fn quantity_names(&self) -> Vec<String> {
        let all = self.latest_draws().map(|(_, d)| quantities(&[d])).unwrap_or_default();
        all.into_iter().map(|q| q.name).collect()
    }
}

/// Formats the summary, histogram and trace plot of a quantity.
fn plotted(q: &Quantity) -> String {
    let xs: Vec<f64> = q.chains.concat().into_iter().filter(|x| x.is_finite()).collect();
    let s = &q.summary;
    let ess = if s.ess_bulk.is_nan() { "-".to_owned() } else { format!("{:.0}", s.ess_bulk) };
    let mut text = format!(
        "{}: {} draws, mean {}, sd {}, 5% {}, 95% {}, ess {ess}\n",
        q.name,
        xs.len(),
        number(s.mean),
        number(s.sd),
        number(s.q05),
        number(s.q95)
    );
    if xs.is_empty() {
        return text;
    }
    let bins = histogram(&xs);
    let label = bins.iter().map(|b| b.0.chars().count()).max().unwrap_or(0);
    let most = bins.iter().map(|b| b.1).max().unwrap_or(1).max(1);
    for (name, count) in &bins {
        text += format!("{name:>label$} │{}\n", bar(*count as f64 / most as f64)).trim_end();
        text.push('\n');
    }
    text += &format!("{:>label$}  {}\n", "", course(&xs));
    text
}

/// Counts draws by value if there are few distinct values, otherwise in bins of equal
/// width.
fn histogram(xs: &[f64]) -> Vec<(String, usize)> {
    let mut values = xs.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    if values.len() <= FEW {
        let count = |v: &f64| xs.iter().filter(|x| *x == v).count();
        return values.iter().map(|v| (number(*v), count(v))).collect();
    }
    let (low, high) = (values[0], values[values.len() - 1]);
    let width = (high / BARS as f64) - (low / BARS as f64);
    let mut counts = [0; BARS];
    for x in xs {
        counts[(((x - low) / width) as usize).min(BARS - 1)] += 1;
    }
    counts.iter().enumerate().map(|(i, n)| (number(low + (i as f64 + 0.5) * width), *n)).collect()
}

/// Draws a bar with this fraction of the full width.
fn bar(share: f64) -> String {
    let eighths = (share * (WIDTH * 8) as f64).round() as usize;
    "█".repeat(eighths / 8) + LEFT[eighths % 8]
}

/// Draws a trace plot; each character is the mean of a stretch of draws.
fn course(xs: &[f64]) -> String {
    let n = xs.len().min(WIDTH);
    let mean = |i: usize| {
        let part = &xs[i * xs.len() / n..(i + 1) * xs.len() / n];
        part.iter().map(|x| x / part.len() as f64).sum::<f64>()
    };
    let means: Vec<f64> = (0..n).map(mean).collect();
    let low = means.iter().copied().fold(f64::INFINITY, f64::min);
    let high = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let level = |x: f64| ((x / 8.0 - low / 8.0) / (high / 64.0 - low / 64.0)) as usize;
    means.iter().map(|x| BELOW[if high > low { level(*x).min(7) } else { 0 }]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_bars_and_course() {
        let xs: Vec<f64> = (0..1200).map(|i| (i % 120) as f64).collect();
        let bins = histogram(&xs);
        assert_eq!(bins.len(), BARS);
        assert!(bins.iter().all(|b| b.1 == 100), "{bins:?}");
        assert_eq!(histogram(&[1.0, 0.0, 1.0]), [("0".to_owned(), 1), ("1".to_owned(), 2)]);
        assert_eq!(
            (bar(1.0).chars().count(), bar(0.5).as_str(), bar(0.0).as_str()),
            (WIDTH, &*"█".repeat(25), "")
        );
        assert_eq!(bar(0.01), "▌");
        let rising: Vec<f64> = (0..200).map(f64::from).collect();
        let c = course(&rising);
        assert!(c.starts_with('▁') && c.ends_with('█') && c.chars().count() == WIDTH, "{c}");
        assert_eq!(course(&[3.0, 3.0]), "▁▁");
    }

    #[test]
    fn huge_values_are_no_trouble() {
        for xs in [
            vec![f64::MAX, -f64::MAX, 0.0],
            (0..50).map(|i| f64::MAX * (f64::from(i) / 25.0 - 1.0)).collect(),
        ] {
            assert_eq!(histogram(&xs).iter().map(|b| b.1).sum::<usize>(), xs.len());
            assert_eq!(course(&xs).chars().count(), xs.len());
        }
    }
}
