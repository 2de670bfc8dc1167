//! The tables at the end of a run: aligned text, at most [`COLUMNS`] wide; numbers for people.

use super::Quantity;
use pcadlang_inference::draws::{KernelStats, SiteStats};
use std::fmt::Write;

/// The maximum width of a table of a run, in characters.
pub const COLUMNS: usize = 100;
/// The number of elements of a vector that are shown.
const SHOWN: usize = 6;

/// Aligns the columns of rows; the first column is flush left, the others flush right.
pub fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| {
        rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut s = String::new();
    for row in rows {
        let mut line = String::new();
        for (c, cell) in row.iter().enumerate() {
            let pad = " ".repeat(widths[c] - cell.chars().count());
            let _ =
                if c == 0 { write!(line, "{cell}{pad}") } else { write!(line, "  {pad}{cell}") };
        }
        let _ = writeln!(s, "{}", line.trim_end());
    }
    s
}

/// Formats mean, standard deviation, 90 % interval, effective sample size (also per
/// second of the kernels' time) and R-hat of each quantity; of a category its most frequent
/// value and the share of that.
pub fn quantities(quantities: &[Quantity], kernel_seconds: f64) -> String {
    summaries(quantities, Some(kernel_seconds))
}

/// Formats the same table for a single chain, without R-hat and times.
pub fn means(quantities: &[Quantity]) -> String {
    summaries(quantities, None)
}

fn summaries(quantities: &[Quantity], seconds: Option<f64>) -> String {
    let row = |cells: [String; 6], last: [String; 2]| {
        cells.into_iter().chain(seconds.map(|_| last).into_iter().flatten()).collect::<Vec<_>>()
    };
    let heads = ["quantity", "mean", "sd", "5%", "95%", "ess"].map(str::to_owned);
    let mut rows = vec![row(heads, ["ess/s", "r_hat"].map(str::to_owned))];
    let mut left_out = 0;
    let mut run = (None, 0);
    for q in quantities {
        run = if q.column.is_some() && q.column == run.0 {
            (q.column, run.1 + 1)
        } else {
            (q.column, 1)
        };
        if run.1 > SHOWN {
            left_out += 1;
            continue;
        }
        let s = &q.summary;
        // The number of a category means nothing as a number.
        let [mean, sd, low, high] = match &q.frequent {
            Some(f) => [f.to_string(), "-".into(), "-".into(), "-".into()],
            None => [s.mean, s.sd, s.q05, s.q95].map(|x| q.number(x)),
        };
        let ess = if s.ess_bulk.is_nan() { "-".into() } else { format!("{:.0}", s.ess_bulk) };
        let cells = [q.name.clone(), mean, sd, low, high, ess];
        let rate = seconds.and_then(|t| per_second(s.ess_bulk, t)).map_or("-".into(), whole);
        rows.push(row(cells, [rate, r_hat_text(s.r_hat)]));
    }
    let mut text = aligned(&narrowed(rows));
    if left_out > 0 {
        let place = if seconds.is_some() { ", in summary.json" } else { "" };
        let _ = writeln!(text, "… and {left_out} more elements of vectors{place}");
    }
    text
}

/// Returns the number of effective draws per second, if it is defined.
pub fn per_second(ess: f64, seconds: f64) -> Option<f64> {
    Some(ess / seconds).filter(|r| r.is_finite() && seconds > 0.0)
}

/// Formats a number with one decimal below 10, and as an integer otherwise.
fn whole(x: f64) -> String {
    if x < 10.0 { number((x * 10.0).round() / 10.0) } else { number(x.round()) }
}

/// Formats the choices that single-site kernels move least often, over all chains; empty
/// if there are fewer than two choices.
pub fn sites(sites: &[SiteStats]) -> String {
    if sites.len() < 2 {
        return String::new();
    }
    let mut worst: Vec<&SiteStats> = sites.iter().collect();
    let rate = |s: &SiteStats| s.acceptance().unwrap_or(f64::INFINITY);
    worst.sort_by(|a, b| rate(a).total_cmp(&rate(b)));
    let mut rows = vec![
        ["single-site moves, least accepted first", "proposals", "accepted"]
            .map(str::to_owned)
            .to_vec(),
    ];
    for s in worst.iter().take(SHOWN) {
        let rate = s.acceptance().map_or("-".into(), |r| format!("{:.0}%", 100.0 * r));
        rows.push(vec![s.address.clone(), s.proposals.to_string(), rate]);
    }
    let mut text = aligned(&narrowed(rows));
    if sites.len() > SHOWN {
        let _ = writeln!(text, "… and {} more choices, in summary.json", sites.len() - SHOWN);
    }
    text
}

/// Formats the statistics of the kernels, over all chains.
pub fn kernels(kernels: &[KernelStats]) -> String {
    let mut rows =
        vec![["kernel", "proposals", "accepted", "failed", "time"].map(str::to_owned).to_vec()];
    for k in kernels {
        let rate = if k.proposals == 0 {
            "-".into()
        } else {
            format!("{:.0}%", 100.0 * k.accepted as f64 / k.proposals as f64)
        };
        rows.push(vec![
            k.name.clone(),
            k.proposals.to_string(),
            rate,
            k.failed.to_string(),
            seconds(k.seconds),
        ]);
    }
    let mut text = aligned(&narrowed(rows));
    for k in kernels {
        if let Some(log) = k.log_evidence {
            text += &format!("log evidence by {}: {log:.3}\n", k.name);
        }
    }
    text
}

/// Cuts names (the first column) in the middle until the lines fit, because their ends
/// distinguish them.
pub(super) fn narrowed(mut rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    let width = |rows: &[Vec<String>], c: usize| {
        rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max()
    };
    let others: usize =
        (1..rows.first().map_or(0, Vec::len)).filter_map(|c| width(&rows, c)).map(|w| w + 2).sum();
    let room = COLUMNS.saturating_sub(others).max(16);
    for name in rows.iter_mut().filter_map(|r| r.first_mut()) {
        let n = name.chars().count();
        if n > room {
            let (head, tail) = (room / 2, room - room / 2 - 1);
            *name =
                name.chars().take(head).chain(['…']).chain(name.chars().skip(n - tail)).collect();
        }
    }
    rows
}

/// Adds up the statistics of the kernels of several chains by name, in order of first
/// appearance.
pub fn merged<'a>(chains: impl IntoIterator<Item = &'a [KernelStats]>) -> Vec<KernelStats> {
    KernelStats::total(chains.into_iter().flatten())
}

/// Formats a number with about four significant digits and without unneeded trailing
/// zeros; `-` for NaN.
pub fn number(x: f64) -> String {
    if x.is_nan() {
        return "-".into();
    }
    if x.is_infinite() {
        return if x > 0.0 { "inf" } else { "-inf" }.into();
    }
    let size = x.abs();
    if size == 0.0 {
        return "0".into();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{x:.2e}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
    let s = format!("{x:.digits$}");
    if s.contains('.') { s.trim_end_matches('0').trim_end_matches('.').to_owned() } else { s }
}

/// Formats a time: `0.42 s`, `12 s`, `3 min 5 s`.
pub fn seconds(s: f64) -> String {
    if s < 10.0 {
        format!("{s:.2} s")
    } else if s < 120.0 {
        format!("{s:.0} s")
    } else {
        format!("{} min {} s", s as u64 / 60, s as u64 % 60)
    }
}

/// Formats an R-hat for people; that of chains in different modes can be arbitrarily
/// large.
pub fn r_hat_text(r: f64) -> String {
    match r {
        r if r.is_nan() => "-".into(),
        r if r > 100.0 => ">100".into(),
        r if r >= 10.0 => format!("{r:.1}"),
        r => format!("{r:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kernel(name: &str, proposals: u64, accepted: u64) -> KernelStats {
        KernelStats {
            name: name.into(),
            proposals,
            accepted,
            seconds: 0.5,
            failed: 1,
            ..Default::default()
        }
    }

    #[test]
    fn tables_are_aligned_and_kernels_add_up() {
        let (a, b) = (
            [kernel("mh(@x)", 100, 25)],
            [kernel("mh(@x)", 100, 75), kernel("drift(one(@**))", 0, 0)],
        );
        let all = merged([&a[..], &b[..]]);
        let expected = "\
kernel           proposals  accepted  failed    time
mh(@x)                 200       50%       2  1.00 s
drift(one(@**))          0         -       1  0.50 s
";
        assert_eq!(kernels(&all), expected);
    }

    #[test]
    fn rates_and_the_least_moved_choices() {
        assert_eq!(
            (per_second(100.0, 0.5), per_second(f64::NAN, 1.0), per_second(9.0, 0.0)),
            (Some(200.0), None, None)
        );
        assert_eq!([0.04, 3.26, 123.4].map(whole), ["0", "3.3", "123"]);
        let site = |address: &str, accepted| SiteStats {
            address: address.into(),
            proposals: 100,
            accepted,
            ..Default::default()
        };
        assert_eq!(sites(&[site("@x", 5)]), "");
        let text = sites(&[site("@x", 50), site("@y", 5)]);
        let rows: Vec<&str> =
            text.lines().skip(1).map(|l| l.split_whitespace().next().unwrap()).collect();
        assert_eq!(rows, ["@y", "@x"]);
    }

    #[test]
    fn long_names_are_cut_and_lines_fit() {
        let chains = vec![vec![-1.234_567e-7, 1.0e9, 3.0, 4.0]; 2];
        let of = |name: String| Quantity::new(&name, Some(0), chains.clone());
        let long = format!("{}/last[3]", "deep/".repeat(40));
        let text = quantities(&[of(long), of("é".repeat(200))], 0.5);
        assert!(text.lines().all(|l| l.chars().count() <= COLUMNS), "{text}");
        assert!(text.lines().nth(1).is_some_and(|l| l.starts_with("deep/deep/")
            && l.contains("…")
            && l.contains("/last[3] ")));
        let many: Vec<Quantity> = (0..9).map(|i| of(format!("v[{i}]"))).collect();
        assert!(
            quantities(&many, 0.0).ends_with("… and 3 more elements of vectors, in summary.json\n")
        );
    }

    #[test]
    fn four_digits_are_enough() {
        for (x, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (1.60042, "1.6"),
            (0.012345, "0.01235"),
            (-123.456, "-123.5"),
            (123456.0, "123456"),
            (1e-9, "1.00e-9"),
            (f64::NAN, "-"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(number(x), text);
        }
        assert_eq!(
            (seconds(0.5), seconds(61.0), seconds(125.0)),
            ("0.50 s".into(), "61 s".into(), "2 min 5 s".into())
        );
    }

    #[test]
    fn r_hat_reads_well() {
        let texts = [f64::NAN, 1.0042, 12.345, 3e6, f64::INFINITY].map(r_hat_text);
        assert_eq!(texts, ["-", "1.004", "12.3", ">100", ">100"]);
    }
}
