//! The tables at the end of a run: aligned text, at most [`COLUMNS`] wide.

use super::{Quantity, number};
use crate::infer::draws::KernelStats;
use std::fmt::Write;

pub use super::warnings::warnings;

/// Letters in a line of the tables of a run.
pub const COLUMNS: usize = 100;
/// Elements of one vector that are shown.
const SHOWN: usize = 6;

/// Rows of aligned columns; the first is flush left.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut s = String::new();
    for row in rows {
        let mut line = String::new();
        for (c, cell) in row.iter().enumerate() {
            let pad = " ".repeat(widths[c] - cell.chars().count());
            let _ = if c == 0 { write!(line, "{cell}{pad}") } else { write!(line, "  {pad}{cell}") };
        }
        let _ = writeln!(s, "{}", line.trim_end());
    }
    s
}

/// Mean, spread, 90 % interval, effective sample size and R-hat of each quantity.
pub fn quantities(quantities: &[Quantity]) -> String {
    let mut rows = vec![["quantity", "mean", "sd", "5%", "95%", "ess", "r_hat"].map(str::to_owned).to_vec()];
    let mut left_out = 0;
    let mut run = (None, 0);
    for q in quantities {
        run = if q.column.is_some() && q.column == run.0 { (q.column, run.1 + 1) } else { (q.column, 1) };
        if run.1 > SHOWN {
            left_out += 1;
            continue;
        }
        let s = &q.summary;
        let ess = if s.ess_bulk.is_nan() { "-".into() } else { format!("{:.0}", s.ess_bulk) };
        let r_hat = if s.r_hat.is_nan() { "-".into() } else { format!("{:.3}", s.r_hat) };
        rows.push(vec![q.name.clone(), number(s.mean), number(s.sd), number(s.q05), number(s.q95), ess, r_hat]);
    }
    let mut text = aligned(&narrowed(rows));
    if left_out > 0 {
        let _ = writeln!(text, "… and {left_out} more elements of vectors, in summary.json");
    }
    text
}

/// What the kernels did, over all chains.
pub fn kernels(kernels: &[KernelStats]) -> String {
    let mut rows = vec![["kernel", "proposals", "accepted", "failed", "time"].map(str::to_owned).to_vec()];
    for k in kernels {
        let rate = if k.proposals == 0 {
            "-".into()
        } else {
            format!("{:.0}%", 100.0 * k.accepted as f64 / k.proposals as f64)
        };
        rows.push(vec![k.name.clone(), k.proposals.to_string(), rate, k.failed.to_string(), super::seconds(k.seconds)]);
    }
    aligned(&narrowed(rows))
}

/// Names (the first column) are cut in their middle until the lines fit, for their ends tell them apart.
fn narrowed(mut rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    let width = |rows: &[Vec<String>], c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max();
    let others: usize = (1..rows.first().map_or(0, Vec::len)).filter_map(|c| width(&rows, c)).map(|w| w + 2).sum();
    let room = COLUMNS.saturating_sub(others).max(16);
    for name in rows.iter_mut().filter_map(|r| r.first_mut()) {
        let n = name.chars().count();
        if n > room {
            let (head, tail) = (room / 2, room - room / 2 - 1);
            *name = name.chars().take(head).chain(['…']).chain(name.chars().skip(n - tail)).collect();
        }
    }
    rows
}

/// Adds up the kernels of several chains by name, in order of first appearance.
pub fn merged<'a>(chains: impl IntoIterator<Item = &'a [KernelStats]>) -> Vec<KernelStats> {
    KernelStats::total(chains.into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(name: &str, proposals: u64, accepted: u64) -> KernelStats {
        KernelStats { name: name.into(), proposals, accepted, seconds: 0.5, failed: 1, divergent: 0 }
    }

    #[test]
    fn tables_are_aligned_and_kernels_add_up() {
        let (a, b) = ([kernel("mh(@x)", 100, 25)], [kernel("mh(@x)", 100, 75), kernel("drift(one(@**))", 0, 0)]);
        let all = merged([&a[..], &b[..]]);
        let expected = "\
kernel           proposals  accepted  failed    time
mh(@x)                 200       50%       2  1.00 s
drift(one(@**))          0         -       1  0.50 s
";
        assert_eq!(kernels(&all), expected);
    }

    #[test]
    fn long_names_are_cut_and_lines_fit() {
        let chains = vec![vec![-1.234_567e-7, 1.0e9, 3.0, 4.0]; 2];
        let of = |name: String| Quantity {
            name,
            column: Some(0),
            summary: crate::infer::diagnostics::summary(&chains),
            chains: chains.clone(),
        };
        let long = format!("{}/last[3]", "deep/".repeat(40));
        let text = quantities(&[of(long), of("é".repeat(200))]);
        assert!(text.lines().all(|l| l.chars().count() <= COLUMNS), "{text}");
        assert!(
            text.lines()
                .nth(1)
                .is_some_and(|l| l.starts_with("deep/deep/") && l.contains("…") && l.contains("/last[3] "))
        );
        let many: Vec<Quantity> = (0..9).map(|i| of(format!("v[{i}]"))).collect();
        assert!(quantities(&many).ends_with("… and 3 more elements of vectors, in summary.json\n"));
    }
}
