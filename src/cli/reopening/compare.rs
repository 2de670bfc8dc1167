//! `pcadlang compare`: two runs side by side: their different settings, their quantities
//! and their pictures.

use crate::cli::args::Compare;
use crate::cli::failure::{Failure, plain};
use crate::cli::reopening::reopened::quoted;
use crate::cli::running::places::sized;
use crate::cli::running::{files, resume};
use pcadlang::report::pictures::{captioned_sheet, png};
use pcadlang::report::{number, table};
use serde_json::Value;
use std::path::Path;

/// The maximum number of quantities listed, those that differ most.
const LISTED: usize = 40;
/// The longer side of each picture, in pixels.
const SIDE: u32 = 512;

/// A run as recorded in its folder.
struct RunSummary {
    run: Value,
    summary: Value,
}

impl RunSummary {
    fn of(folder: &Path) -> Result<RunSummary, Failure> {
        let run = resume::run(folder)?;
        let path = folder.join("summary.json");
        let summary = serde_json::from_slice(&files::read(&path)?);
        Ok(RunSummary {
            run,
            summary: summary.map_err(|e| plain(format!("{}: {e}", path.display())))?,
        })
    }

    /// Returns the arguments of its command.
    fn arguments(&self) -> Vec<String> {
        let all = self.run["arguments"].as_array();
        all.into_iter().flatten().filter_map(|a| a.as_str().map(str::to_owned)).collect()
    }

    /// Returns the program, and the options with their values.
    fn settings(&self) -> Vec<String> {
        let (mut all, mut arguments) = (Vec::new(), self.arguments().into_iter());
        while let Some(a) = arguments.next() {
            all.push(if a.starts_with("--") {
                format!("{a} {}", arguments.next().unwrap_or_default())
            } else {
                a
            });
        }
        all
    }

    fn number(&self, quantity: &str, what: &str) -> f64 {
        self.summary["quantities"][quantity][what].as_f64().unwrap_or(f64::NAN)
    }
}

/// Compares two runs.
pub fn compare(a: &Compare) -> Result<(), Failure> {
    let (one, two) = (RunSummary::of(&a.a)?, RunSummary::of(&a.b)?);
    for (name, told) in [("A", &one), ("B", &two)] {
        print_line!("{name}: pcadlang run {}", quoted(&told.arguments()));
    }
    let (left, right) = (one.settings(), two.settings());
    let only = |mine: &[String], other: &[String]| {
        let own: Vec<&str> =
            mine.iter().filter(|s| !other.contains(s)).map(String::as_str).collect();
        if own.is_empty() { "-".to_owned() } else { own.join(" ") }
    };
    let same = left == right;
    match (
        same,
        one.run["program_hash"] == two.run["program_hash"],
        one.run["inputs_hash"] == two.run["inputs_hash"],
    ) {
        (true, true, true) => print_line!("\nThe commands, programs and data are the same."),
        (_, program, data) => {
            print_line!("\nonly A: {}\nonly B: {}", only(&left, &right), only(&right, &left));
            if !program {
                print_line!("the programs differ");
            }
            if !data {
                print_line!("the observed data differ");
            }
        }
    }
    print_line!("\n{}", quantities(&one, &two));
    a.out.as_ref().map_or(Ok(()), |out| pictures(a, out))
}

/// Formats a table of the quantities of both runs, in decreasing order of the difference
/// of means in units of their standard deviation.
fn quantities(one: &RunSummary, two: &RunSummary) -> String {
    let names = one.summary["quantities"].as_object();
    let both = names.into_iter().flatten().map(|(name, _)| name);
    let apart = |name: &str| {
        let [a, b] = [one, two].map(|t| (t.number(name, "mean"), t.number(name, "sd")));
        (a.0 - b.0).abs() / (0.5 * (a.1 * a.1 + b.1 * b.1)).sqrt()
    };
    let mut both: Vec<(&str, f64)> = both
        .map(String::as_str)
        .filter(|name| two.summary["quantities"].get(name).is_some())
        .map(|name| (name, apart(name)))
        .collect();
    both.sort_by(|a, b| b.1.total_cmp(&a.1));
    let head =
        ["quantity", "mean A", "sd A", "mean B", "sd B", "difference/sd", "r_hat A", "r_hat B"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, apart) in both.iter().take(LISTED) {
        let of = |t: &RunSummary, what: &str| number(t.number(name, what));
        let mut row = vec![
            (*name).to_owned(),
            of(one, "mean"),
            of(one, "sd"),
            of(two, "mean"),
            of(two, "sd"),
        ];
        row.extend([number(*apart), of(one, "r_hat"), of(two, "r_hat")]);
        rows.push(row);
    }
    let mut text = table::aligned(&rows);
    if both.len() > LISTED {
        text += &format!("… and {} more\n", both.len() - LISTED);
    }
    text
}

/// Writes the overlays side by side.
fn pictures(a: &Compare, out: &Path) -> Result<(), Failure> {
    let overlay = |folder: &Path| {
        let path = folder.join("overlay.png");
        let picture = image::load_from_memory(&files::read(&path)?);
        let picture = picture.map_err(|e| plain(format!("{}: {e}", path.display())))?.to_rgb8();
        Ok::<_, Failure>(sized(&picture, SIDE))
    };
    let both = [overlay(&a.a)?, overlay(&a.b)?];
    let captions = [&a.a, &a.b].map(|path| path.display().to_string());
    let sheet = captioned_sheet(&both, 2, &captions);
    files::write(out, &png(&sheet).map_err(|e| plain(e.to_string()))?)
}
