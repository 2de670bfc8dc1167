//! The tables at the end of a run, and what to make of them.

use super::{Quantity, number};
use crate::infer::draws::KernelStats;
use std::fmt::Write;

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
    let mut text = aligned(&rows);
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
    aligned(&rows)
}

/// What a reader should know before believing the numbers.
pub fn warnings(quantities: &[Quantity], kernels: &[KernelStats], chains: usize) -> Vec<String> {
    let mut out = Vec::new();
    let worst = |f: &dyn Fn(&Quantity) -> f64| {
        let with = quantities.iter().map(|q| (f(q), q)).filter(|(x, _)| !x.is_nan());
        with.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(x, q)| (x, q.name.clone()))
    };
    if let Some((r, name)) = worst(&|q| q.summary.r_hat)
        && r > 1.01
    {
        let what = if r > 1.1 { "the chains disagree" } else { "the chains may not have mixed" };
        out.push(format!(
            "{what}: R-hat of {name} is {r:.2} (1.01 or less is wanted); run longer with --time or --steps"
        ));
    }
    if let Some((e, name)) = worst(&|q| -q.summary.ess_bulk)
        && -e < 100.0 * chains as f64
    {
        out.push(format!("few independent draws: {:.0} of {name} ({} are wanted)", -e, 100 * chains));
    }
    for k in kernels.iter().filter(|k| k.proposals >= 200 && k.accepted == 0) {
        out.push(format!("{} accepted none of {} proposals; it only costs time", k.name, k.proposals));
    }
    out
}

/// Adds up the kernels of several chains.
pub fn merged<'a>(chains: impl IntoIterator<Item = &'a [KernelStats]>) -> Vec<KernelStats> {
    let mut all: Vec<KernelStats> = Vec::new();
    for k in chains.into_iter().flatten() {
        match all.iter_mut().find(|a| a.name == k.name) {
            Some(a) => {
                a.proposals += k.proposals;
                a.accepted += k.accepted;
                a.failed += k.failed;
                a.seconds += k.seconds;
            }
            None => all.push(k.clone()),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(name: &str, proposals: u64, accepted: u64) -> KernelStats {
        KernelStats { name: name.into(), proposals, accepted, seconds: 0.5, failed: 1 }
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
        assert!(warnings(&[], &[kernel("mh(@x)", 500, 0)], 2)[0].contains("none of 500"));
    }
}
