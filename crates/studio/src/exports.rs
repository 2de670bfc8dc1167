//! Files that show a run, written into its folder.

use super::run::Run;
use pcadlang_runs::args::{Film, Report};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::reopening::page::PAGE;
use pcadlang_runs::reopening::{film, report};

/// Writes a file of a kind, and returns its name.
pub fn export(run: &Run, kind: &str) -> Result<String, Failure> {
    if run.is_active() {
        return Err(plain("the run has not ended").hint("stop it first; it can go on later"));
    }
    match kind {
        PAGE => {
            report::written(&Report { run: run.folder.clone() })?;
            Ok(PAGE.to_owned())
        }
        "film.png" | "film.glb" => {
            let out = run.folder.join(kind);
            let (size, states, no_turn) = (480, 60, false);
            film::write(&Film { run: run.folder.clone(), out, size, states, no_turn })?;
            Ok(kind.to_owned())
        }
        _ => {
            let problem = plain(format!("a run cannot be exported as `{kind}`"));
            Err(problem.hint("film.png, film.glb or report.html"))
        }
    }
}
