//! The evaluation of a program on a dataset: one row per case, a table of all rows, and
//! keypoints for scorers.
//!
//! This module neither runs programs nor compares results with ground truth. Rows are
//! read from `run.json`, so that cases completed earlier and cases completed now give the
//! same rows. Invariant: the folder holds evaluations only, and its files are complete or
//! absent.

use super::atomic_write::is_partial;
use super::{RunDir, RunDirError};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The file that marks the folder of an evaluation.
pub const MARK: &str = "evaluation.json";
/// The table for human readers.
pub const TABLE: &str = "table.md";
/// The keypoints of all cases.
pub const PREDICTIONS: &str = "predictions.json";

/// Creates the folder of an evaluation, or opens one that an earlier evaluation left;
/// nothing is removed.
///
/// # Errors
/// Returns an error if it cannot be created, or holds files but no evaluation.
pub fn open(path: &Path) -> Result<RunDir, RunDirError> {
    let io = |error| RunDirError::Io { path: path.to_owned(), error };
    std::fs::create_dir_all(path).map_err(io)?;
    let (mut marked, mut occupied) = (false, false);
    for entry in std::fs::read_dir(path).map_err(io)? {
        let name = entry.map_err(io)?.file_name();
        let name = name.to_str().unwrap_or("");
        marked |= name == MARK;
        occupied |= !is_partial(name);
    }
    if occupied && !marked {
        return Err(RunDirError::NoEvaluation(path.to_owned()));
    }
    Ok(RunDir::of(path))
}

/// The results of a case.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// The name of the case.
    pub case: String,
    /// `done`, `failed`, `interrupted`, or `pending`: not run yet.
    pub status: String,
    /// Wall time until the last draw, including reading and compiling.
    pub seconds: Option<f64>,
    /// Wall time until every file was written.
    pub wall_seconds: Option<f64>,
    /// The log joint density of the best state.
    pub best_log_joint: Option<f64>,
    /// The largest R-hat of any recorded quantity.
    pub r_hat_max: Option<f64>,
    /// The number of draws over all chains.
    pub draws: Option<u64>,
    /// The number of kernel applications over all chains, including warm-up.
    pub steps: Option<u64>,
    /// The reason for a failure.
    pub error: Option<String>,
}

impl Row {
    /// Returns the row of a case that has not been run.
    pub fn pending(case: &str) -> Row {
        Row { case: case.to_owned(), status: "pending".into(), ..Row::default() }
    }

    /// Reads a row from a `run.json`. A run that neither ended nor failed is pending.
    pub fn of(case: &str, run: &Value) -> Row {
        let status =
            run["state"].as_str().filter(|s| ["done", "failed", "interrupted"].contains(s));
        let Some(status) = status else { return Row::pending(case) };
        let sum = |keys: &[&str]| {
            let chains = run["chains"].as_array()?;
            Some(chains.iter().flat_map(|c| keys.iter().filter_map(|k| c[*k].as_u64())).sum())
        };
        Row {
            case: case.to_owned(),
            status: status.to_owned(),
            seconds: run["sampling_seconds"].as_f64(),
            wall_seconds: run["seconds"].as_f64(),
            best_log_joint: run["best_log_joint"].as_f64(),
            r_hat_max: run["r_hat_max"].as_f64(),
            draws: sum(&["draws"]),
            steps: sum(&["steps", "warmup"]),
            error: run["error"].as_str().map(str::to_owned),
        }
    }
}

/// Formats the rows as a Markdown table that is also aligned as plain text; errors of
/// failed cases are listed below it.
pub fn markdown(rows: &[Row]) -> String {
    let head =
        ["case", "status", "seconds", "wall seconds", "best log joint", "R-hat", "draws", "steps"];
    let mut cells = vec![head.map(str::to_owned)];
    let fixed = |x: Option<f64>, digits: usize| x.map_or("-".into(), |x| format!("{x:.digits$}"));
    let count = |n: Option<u64>| n.map_or("-".into(), |n| n.to_string());
    for r in rows {
        cells.push([
            r.case.replace('|', "\\|"),
            r.status.clone(),
            fixed(r.seconds, 1),
            fixed(r.wall_seconds, 1),
            fixed(r.best_log_joint, 1),
            r.r_hat_max.map_or_else(
                || fixed(None, 2),
                |x| if x > 100.0 { ">100".into() } else { fixed(Some(x), 2) },
            ),
            count(r.draws),
            count(r.steps),
        ]);
    }
    let width = |c: usize| cells.iter().map(|r| r[c].chars().count()).max().unwrap_or(0);
    let widths: [usize; 8] = std::array::from_fn(width);
    // Words are aligned to the left, numbers to the right.
    let left = |c: usize| c < 2;
    let rule: [String; 8] = std::array::from_fn(|c| {
        if left(c) { "-".repeat(widths[c]) } else { format!("{}:", "-".repeat(widths[c] - 1)) }
    });
    cells.insert(1, rule);
    let mut text = String::new();
    for row in &cells {
        for (c, cell) in row.iter().enumerate() {
            let pad = " ".repeat(widths[c] - cell.chars().count());
            text.push_str(&if left(c) {
                format!("| {cell}{pad} ")
            } else {
                format!("| {pad}{cell} ")
            });
        }
        text.push_str("|\n");
    }
    let failed: Vec<_> = rows.iter().filter_map(|r| Some((r, r.error.as_ref()?))).collect();
    for (i, (row, error)) in failed.iter().enumerate() {
        let first = error.lines().next().unwrap_or_default();
        text.push_str(&format!("{}* {}: {first}\n", if i == 0 { "\n" } else { "" }, row.case));
    }
    text
}

/// Returns the entry of `predictions.json` for a case: the points of its `keypoints.json`
/// without their standard deviations, or null if there are none, and the seconds it took.
pub fn prediction(keypoints: Option<&Value>, seconds: Option<f64>) -> Value {
    let points = keypoints.and_then(|k| k["keypoints"].as_object()).map(|all| {
        let xy = |p: &Value| Some(json!([p.get(0)?.as_f64()?, p.get(1)?.as_f64()?]));
        all.iter().filter_map(|(name, p)| Some((name.clone(), xy(p)?))).collect::<Map<_, _>>()
    });
    let points = points.filter(|p| !p.is_empty());
    let seconds = keypoints.and_then(|k| k["seconds"].as_f64()).or(seconds).unwrap_or(0.0);
    json!({ "keypoints": points, "seconds": seconds })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_say_what_run_json_says() {
        let run = json!({
            "state": "done", "sampling_seconds": 2.0, "seconds": 2.5, "best_log_joint": -3.25, "r_hat_max": null,
            "chains": [{ "steps": 10, "warmup": 5, "draws": 7 }, { "steps": 20, "warmup": 5, "draws": 8 }],
        });
        let row = Row::of("a", &run);
        assert_eq!((row.status.as_str(), row.draws, row.steps), ("done", Some(15), Some(40)));
        assert_eq!((row.seconds, row.wall_seconds), (Some(2.0), Some(2.5)));
        assert_eq!((row.best_log_joint, row.r_hat_max, &row.error), (Some(-3.25), None, &None));
        for unfinished in
            [json!({ "state": "running" }), json!({}), json!([1]), json!({ "state": 3 })]
        {
            assert_eq!(Row::of("a", &unfinished), Row::pending("a"));
        }
    }

    #[test]
    fn the_table_is_aligned_and_says_what_failed() {
        let failed = Row {
            case: "b|c".into(),
            status: "failed".into(),
            error: Some("no picture\nat all".into()),
            ..Row::default()
        };
        let done = Row {
            case: "a".into(),
            status: "done".into(),
            seconds: Some(1.25),
            wall_seconds: Some(10.0),
            best_log_joint: Some(-24.5),
            r_hat_max: Some(1.01234),
            draws: Some(40),
            steps: Some(1200),
            error: None,
        };
        let expected = "\
| case | status | seconds | wall seconds | best log joint | R-hat | draws | steps |
| ---- | ------ | ------: | -----------: | -------------: | ----: | ----: | ----: |
| a    | done   |     1.2 |         10.0 |          -24.5 |  1.01 |    40 |  1200 |
| b\\|c | failed |       - |            - |              - |     - |     - |     - |

* b|c: no picture
";
        assert_eq!(markdown(&[done, failed]), expected);
    }

    #[test]
    fn predictions_are_points_without_spread() {
        let file = json!({ "keypoints": { "l_hip": [1.5, 2.0, 0.3], "odd": "x", "cut": [1] }, "seconds": 4.0 });
        let expected = json!({ "keypoints": { "l_hip": [1.5, 2.0] }, "seconds": 4.0 });
        assert_eq!(prediction(Some(&file), Some(9.0)), expected);
        assert_eq!(prediction(None, Some(9.0)), json!({ "keypoints": null, "seconds": 9.0 }));
        for nothing in [json!({ "keypoints": null }), json!({ "keypoints": {} }), json!(3)] {
            assert_eq!(
                prediction(Some(&nothing), None),
                json!({ "keypoints": null, "seconds": 0.0 })
            );
        }
    }

    #[test]
    fn folders_of_something_else_are_left_alone() {
        let base = std::env::temp_dir().join(format!("pcadlang-evaluation-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&base);
        std::fs::create_dir_all(&base).unwrap();
        std::fs::write(base.join(".evaluation.json.partial"), b"{").unwrap();
        open(&base).unwrap().write(MARK, b"{}").unwrap();
        std::fs::write(base.join("notes.txt"), b"x").unwrap();
        open(&base).unwrap();
        std::fs::remove_file(base.join(MARK)).unwrap();
        assert!(matches!(open(&base), Err(RunDirError::NoEvaluation(_))));
        std::fs::remove_dir_all(&base).unwrap();
    }
}
