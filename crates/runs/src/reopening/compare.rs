//! `pcadlang compare`: two runs side by side: their different settings, their quantities
//! and their pictures.

use crate::args::Compare;
use crate::failure::{Failure, plain};
use crate::places::sized;
use crate::reopening::reopened::quoted;
use crate::{files, resume};
use pcadlang_report::pictures::{contact_sheet, png};
use pcadlang_report::{Frequent, number, table};
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
        let (mut all, mut arguments) = (Vec::new(), self.arguments().into_iter().peekable());
        while let Some(a) = arguments.next() {
            // Some options have no value.
            let value = arguments.next_if(|v| a.starts_with("--") && !v.starts_with("--"));
            all.push(value.map_or(a.clone(), |value| format!("{a} {value}")));
        }
        all
    }

    fn number(&self, quantity: &str, what: &str) -> f64 {
        self.summary["quantities"][quantity][what].as_f64().unwrap_or(f64::NAN)
    }
}

/// Two runs side by side.
pub struct Comparison {
    runs: [RunSummary; 2],
}

/// A quantity of both runs.
pub struct QuantityDifference {
    /// Its name.
    pub name: String,
    /// Its summary in the first run.
    pub a: Value,
    /// Its summary in the second run.
    pub b: Value,
    /// The difference of its means in units of its standard deviations.
    pub difference: f64,
}

impl Comparison {
    /// Reads both folders.
    pub fn of(a: &Path, b: &Path) -> Result<Comparison, Failure> {
        Ok(Comparison { runs: [RunSummary::of(a)?, RunSummary::of(b)?] })
    }

    /// Compares runs whose `run.json` and summary are known, for example so far.
    pub fn between(runs: [(Value, Value); 2]) -> Comparison {
        Comparison { runs: runs.map(|(run, summary)| RunSummary { run, summary }) }
    }

    /// Returns what only one of the commands has.
    pub fn settings(&self) -> [Vec<String>; 2] {
        let [left, right] = self.runs.each_ref().map(RunSummary::settings);
        let only = |mine: &[String], other: &[String]| -> Vec<String> {
            mine.iter().filter(|s| !other.contains(s)).cloned().collect()
        };
        [only(&left, &right), only(&right, &left)]
    }

    /// Returns whether both runs have the same value in a field of `run.json`. Programs are
    /// the same whatever their settings, which are compared apart.
    pub fn has_same(&self, field: &str) -> bool {
        let known = self.runs.iter().all(|r| !r.run["source_hash"].is_null());
        let field = if field == "program_hash" && known { "source_hash" } else { field };
        self.runs[0].run[field] == self.runs[1].run[field]
    }

    /// Returns the quantities of both runs, in decreasing order of their difference.
    pub fn quantities(&self) -> Vec<QuantityDifference> {
        let [one, two] = &self.runs;
        let difference = |name: &str| {
            let [a, b] = [one, two].map(|t| (t.number(name, "mean"), t.number(name, "sd")));
            (a.0 - b.0).abs() / (0.5 * (a.1 * a.1 + b.1 * b.1)).sqrt()
        };
        let names = one.summary["quantities"].as_object().into_iter().flatten();
        let both = |(name, a): (&String, &Value)| {
            let b = two.summary["quantities"].get(name)?.clone();
            Some(QuantityDifference {
                name: name.clone(),
                a: a.clone(),
                b,
                difference: difference(name),
            })
        };
        let mut all: Vec<QuantityDifference> = names.filter_map(both).collect();
        all.sort_by(|a, b| b.difference.total_cmp(&a.difference));
        all
    }
}

/// Compares two runs.
pub fn compare(a: &Compare) -> Result<(), Failure> {
    let both = Comparison::of(&a.a, &a.b)?;
    for (name, told) in ["A", "B"].iter().zip(&both.runs) {
        print_line!("{name}: pcadlang run {}", quoted(&told.arguments()));
    }
    let said = |only: &[String]| if only.is_empty() { "-".to_owned() } else { only.join(" ") };
    let [left, right] = both.settings();
    let same = both.runs[0].settings() == both.runs[1].settings();
    match (same, both.has_same("program_hash"), both.has_same("inputs_hash")) {
        (true, true, true) => print_line!("\nThe commands, programs and data are the same."),
        (_, program, data) => {
            print_line!("\nonly A: {}\nonly B: {}", said(&left), said(&right));
            if program && data {
                print_line!("only settings differ: the programs and data are the same");
            }
            if !program {
                print_line!("the programs differ");
            }
            if !data {
                print_line!("the observed data differ");
            }
        }
    }
    print_line!("\n{}", quantities(&both));
    a.out.as_ref().map_or(Ok(()), |out| pictures(a, out))
}

/// Formats a table of the quantities of both runs.
fn quantities(compared: &Comparison) -> String {
    let both = compared.quantities();
    let head =
        ["quantity", "mean A", "sd A", "mean B", "sd B", "difference/sd", "r_hat A", "r_hat B"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for QuantityDifference { name, a, b, difference } in both.iter().take(LISTED) {
        let of = |summary: &Value, what: &str| number(summary[what].as_f64().unwrap_or(f64::NAN));
        // The numbers of categories have no mean.
        let frequent = |summary: &Value| {
            let f = &summary["most_frequent"];
            let text = f["text"].as_str().map(str::to_owned);
            let (value, share) = (f["value"].as_f64()?, f["share"].as_f64()?);
            Some(Frequent { value, text, share }.to_string())
        };
        let [left, right] = [a, b].map(|s| match frequent(s) {
            Some(frequent) => [frequent, "-".into()],
            None => [of(s, "mean"), of(s, "sd")],
        });
        let is_category = frequent(a).is_some() || frequent(b).is_some();
        let apart = if is_category { "-".into() } else { number(*difference) };
        let mut row = vec![name.clone()];
        row.extend(left.into_iter().chain(right));
        row.extend([apart, of(a, "r_hat"), of(b, "r_hat")]);
        rows.push(row);
    }
    let mut text = table::aligned(&rows);
    if both.len() > LISTED {
        text += &format!("… and {} more\n", both.len() - LISTED);
    }
    text
}

/// Writes the overlays side by side, A on the left.
fn pictures(a: &Compare, out: &Path) -> Result<(), Failure> {
    let overlay = |folder: &Path| {
        let path = folder.join("overlay.png");
        let picture = image::load_from_memory(&files::read(&path)?);
        let picture = picture.map_err(|e| plain(format!("{}: {e}", path.display())))?.to_rgb8();
        Ok::<_, Failure>(sized(&picture, SIDE))
    };
    let both = [overlay(&a.a)?, overlay(&a.b)?];
    files::write(out, &png(&contact_sheet(&both, 2)).map_err(|e| plain(e.to_string()))?)
}
