//! `pcadlang report`: rebuilds the page of a run from the contents of its folder.

use crate::args::Report;
use crate::failure::{Failure, plain};
use crate::reopening::page::{PAGE, write_page};
use crate::watched::ROOM;
use crate::{files, resume};
use pcadlang_report::{Quantity, RunDir, modes, quantities, rename, reread, warnings};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Rebuilds the page of a run.
pub fn report(a: &Report) -> Result<(), Failure> {
    let page = written(a)?;
    print_line!("{}", page.display());
    Ok(())
}

/// Writes the page of a run, and returns its path.
pub fn written(a: &Report) -> Result<PathBuf, Failure> {
    let run = resume::run(&a.run)?;
    let dir = RunDir::open(&a.run).map_err(|e| plain(e.to_string()))?;
    let draws = reread(&dir, ROOM).map_err(|e| plain(e.to_string()))?;
    if draws.iter().all(|d| d.rows.is_empty()) {
        let hint = run["error"].as_str().map(|e| format!("the run failed: {e}"));
        return Err(Failure::Plain(format!("{} holds no draws to report", a.run.display()), hint));
    }
    let mut quantities = quantities(&draws);
    let summary = match dir.file("summary.json") {
        path if path.is_file() => {
            let summary = serde_json::from_slice(&files::read(&path)?);
            summary.map_err(|e| plain(format!("{}: {e}", path.display())))?
        }
        // The run has not ended, or was killed.
        _ => so_far(&quantities, draws.len()),
    };
    let names: Vec<&String> =
        summary["quantities"].as_object().into_iter().flat_map(|q| q.keys()).collect();
    rename(&mut quantities, names.into_iter().map(String::as_str));
    write_page(&dir, &run, &summary, &quantities)?;
    Ok(dir.file(PAGE))
}

/// Makes a summary from the draws alone.
fn so_far(quantities: &[Quantity], chains: usize) -> Value {
    let modes = modes(quantities, None);
    json!({ "modes": modes, "warnings": warnings(quantities, &modes, &[], chains) })
}
