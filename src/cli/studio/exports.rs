//! Files that show a run, written into its folder.

use super::answer::Problem;
use super::run::Run;
use crate::cli::args::Report;
use crate::cli::reopening::page::PAGE;
use crate::cli::reopening::report;

/// Writes a file of a kind, and returns its name.
pub fn export(run: &Run, kind: &str) -> Result<String, Problem> {
    if run.is_active() {
        return Err(
            Problem::plain("the run has not ended").hint("stop it first; it can go on later")
        );
    }
    match kind {
        PAGE => {
            report::written(&Report { run: run.folder.clone() })?;
            Ok(PAGE.to_owned())
        }
        _ => {
            let problem = Problem::plain(format!("a run cannot be exported as `{kind}`"));
            Err(problem.hint("film.png, film.glb or report.html"))
        }
    }
}
