//! The table of settings at different times with their errors, and its Pareto front.

use super::interval::{Interval, mean_interval};
use super::runs::RunRecord;
use super::setting::Setting;
use indexmap::IndexMap;
use serde::Serialize;

/// The result of a setting at one time, over all cases it was run on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The name of the setting.
    pub setting: String,
    /// True at the end of its runs. Only an end can be reproduced by a run with
    /// that time limit, because schedules depend on the limit.
    pub end: bool,
    /// Seconds from the start, the mean over the runs.
    pub seconds: f64,
    /// The error, the mean over cases.
    pub error: f64,
    /// The lower end of the error's 90 % interval over cases.
    pub low: f64,
    /// The upper end of that interval.
    pub high: f64,
    /// The number of cases.
    pub cases: usize,
    /// The number of runs measured at this time.
    pub runs: usize,
    /// The number of failed runs of the setting.
    pub failed: usize,
    /// The means of all scores of the final answers.
    pub scores: IndexMap<String, f64>,
    /// Effective sample size per second, the median over runs, if known.
    pub ess_per_second: Option<f64>,
    /// True if the row is on the front.
    pub front: bool,
}

/// Returns the table: every setting at every time at which it was measured, in the order
/// of the settings.
pub fn rows(settings: &[Setting], runs: &[RunRecord]) -> Vec<Row> {
    let mut all = Vec::new();
    for name in settings.iter().map(Setting::name) {
        let of: Vec<&RunRecord> = runs.iter().filter(|r| r.setting == name).collect();
        let mut times: Vec<Option<f64>> =
            of.iter().flat_map(|r| r.marks.iter().map(|m| m.at)).collect();
        times.sort_by(|a, b| a.unwrap_or(f64::INFINITY).total_cmp(&b.unwrap_or(f64::INFINITY)));
        times.dedup();
        all.extend(times.into_iter().filter_map(|at| row(&name, at, &of)));
    }
    let front = front(&all);
    for i in front {
        all[i].front = true;
    }
    all
}

fn row(name: &str, at: Option<f64>, runs: &[&RunRecord]) -> Option<Row> {
    let mut by_case: IndexMap<&str, Vec<f64>> = IndexMap::new();
    let (mut seconds, mut n) = (0.0, 0);
    for run in runs {
        let Some(mark) = run.marks.iter().find(|m| m.at == at) else { continue };
        let Some(error) = mark.error.filter(|e| e.is_finite()) else { continue };
        by_case.entry(&run.case).or_default().push(error);
        (seconds, n) = (seconds + mark.seconds, n + 1);
    }
    if n == 0 {
        return None;
    }
    let errors: Vec<Vec<f64>> = by_case.into_values().collect();
    let Interval { mean, low, high } = mean_interval(&errors);
    let end = at.is_none();
    let mut scores: IndexMap<String, Vec<f64>> = IndexMap::new();
    for (name, x) in runs.iter().filter(|_| end).flat_map(|r| &r.scores).filter(|s| s.1.is_finite())
    {
        scores.entry(name.clone()).or_default().push(*x);
    }
    let mut rates: Vec<f64> =
        runs.iter().filter(|_| end).filter_map(|r| r.ess_per_second).collect();
    rates.sort_by(f64::total_cmp);
    Some(Row {
        setting: name.to_owned(),
        end,
        seconds: seconds / n as f64,
        error: mean,
        low,
        high,
        cases: errors.len(),
        runs: n,
        failed: runs.iter().filter(|r| r.failed.is_some()).count(),
        scores: scores
            .into_iter()
            .map(|(k, xs)| (k, xs.iter().sum::<f64>() / xs.len() as f64))
            .collect(),
        ess_per_second: (!rates.is_empty()).then(|| rates[rates.len() / 2]),
        front: false,
    })
}

/// Returns the Pareto front, from the fastest to the most accurate. It contains the ends
/// of settings that ran on the largest number of cases, never failed, and are more
/// accurate than all faster ones.
pub fn front(rows: &[Row]) -> Vec<usize> {
    let mut ends: Vec<usize> =
        (0..rows.len()).filter(|&i| rows[i].end && rows[i].failed == 0).collect();
    let most = ends.iter().map(|&i| rows[i].cases).max();
    ends.retain(|&i| Some(rows[i].cases) == most);
    // Runs with the same time limit differ by a few per cent, so times are compared in
    // steps of 5 %.
    let time = |i: usize| (rows[i].seconds.max(1e-9).ln() * 20.0).round();
    ends.sort_by(|&a, &b| {
        time(a).total_cmp(&time(b)).then(rows[a].error.total_cmp(&rows[b].error))
    });
    let mut best = f64::INFINITY;
    ends.retain(|&i| {
        let better = rows[i].error < best;
        best = best.min(rows[i].error);
        better
    });
    ends
}

/// Returns the table as comma-separated values.
pub fn to_csv(rows: &[Row]) -> String {
    let mut scores: Vec<&str> =
        rows.iter().flat_map(|r| r.scores.keys().map(String::as_str)).collect();
    scores.sort_unstable();
    scores.dedup();
    let head = [
        "setting",
        "end",
        "seconds",
        "error",
        "low",
        "high",
        "cases",
        "runs",
        "failed",
        "ess_per_second",
        "front",
    ];
    let mut text =
        head.into_iter().chain(scores.iter().copied()).collect::<Vec<_>>().join(",") + "\n";
    for r in rows {
        let number = |x: f64| format!("{x:.6}");
        let optional = |x: Option<f64>| x.map_or(String::new(), number);
        let mut cells = vec![
            // Names of settings may contain commas and quotes, as parameter values do.
            format!("\"{}\"", r.setting.replace('"', "\"\"")),
            r.end.to_string(),
            format!("{:.3}", r.seconds),
            number(r.error),
            number(r.low),
            number(r.high),
            r.cases.to_string(),
            r.runs.to_string(),
            r.failed.to_string(),
            optional(r.ess_per_second),
            r.front.to_string(),
        ];
        cells.extend(scores.iter().map(|s| optional(r.scores.get(*s).copied())));
        text += &(cells.join(",") + "\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::runs::Mark;
    use super::*;

    fn run(setting: &str, case: &str, marks: &[(Option<f64>, f64, f64)]) -> RunRecord {
        let mark = |(at, seconds, error): &(Option<f64>, f64, f64)| Mark {
            at: *at,
            seconds: *seconds,
            error: Some(*error),
        };
        RunRecord {
            setting: setting.into(),
            case: case.into(),
            marks: marks.iter().map(mark).collect(),
            ..Default::default()
        }
    }

    fn setting(time: f64) -> Setting {
        Setting { time: Some(time), ..Setting::default() }
    }

    #[test]
    fn the_front_is_of_ends_through_most_cases() {
        let both =
            |s: &str, marks: &[(Option<f64>, f64, f64)]| [run(s, "a", marks), run(s, "b", marks)];
        let mut runs = Vec::new();
        runs.extend(both("time=1", &[(Some(0.1), 0.1, 0.01), (None, 1.0, 0.5)]));
        runs.extend(both("time=2", &[(None, 2.0, 0.6)]));
        runs.extend(both("time=3", &[(None, 3.0, 0.2)]));
        runs.push(run("time=4", "a", &[(None, 4.0, 0.0)]));
        runs.extend(both("time=5", &[(None, 5.0, 0.1)]));
        runs.push(RunRecord {
            setting: "time=5".into(),
            failed: Some("no".into()),
            ..RunRecord::default()
        });
        let table = rows(&[1.0, 2.0, 3.0, 4.0, 5.0].map(setting), &runs);
        let on: Vec<&str> = table.iter().filter(|r| r.front).map(|r| r.setting.as_str()).collect();
        assert_eq!(on, ["time=1", "time=3"]);
        assert_eq!(table.len(), 6);
        assert_eq!((table[0].end, table[0].seconds, table[1].end), (false, 0.1, true));
        assert_eq!((table[4].cases, table[4].runs), (1, 1));
    }

    #[test]
    fn the_table_is_text() {
        let mut one = run("time=1", "a", &[(None, 1.0, 0.5)]);
        one.scores.insert("iou".into(), 0.75);
        let expected = "setting,end,seconds,error,low,high,cases,runs,failed,ess_per_second,front,iou\n\
                        \"time=1\",true,1.000,0.500000,0.500000,0.500000,1,1,0,,true,0.750000\n";
        assert_eq!(to_csv(&rows(&[setting(1.0)], &[one])), expected);
    }
}
