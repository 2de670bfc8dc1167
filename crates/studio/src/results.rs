//! Results of a run: its draws, its summary, their comparison with another run's, its meshes,
//! and files that show it.

use super::run::Run;
use pcadlang_inference::{KeptTrace, TrajectoryState};
use pcadlang_report::embedded::topology;
use pcadlang_report::{
    ChainDraws, Memory, Quantity, RunDir, modes, quantities, rename, reread, warnings,
};
use pcadlang_runs::args::{Film, Report};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::reopening::compare::Comparison;
use pcadlang_runs::reopening::page::PAGE;
use pcadlang_runs::reopening::reopened::{Reopened, quoted};
use pcadlang_runs::reopening::{film, page};
use pcadlang_runs::watched::ROOM;
use pcadlang_scene::geom::{GeomError, Solid};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Maximum numbers sent per chain and quantity.
const NUMBERS: usize = 2000;
/// Maximum draws, over all chains, in the summary of a run under way.
const LIVE: usize = 4000;

/// Returns the draws of a run, from memory or from its folder.
fn draws(run: &Run) -> Result<Vec<ChainDraws>, Failure> {
    match run.watched() {
        Some(w) => Ok(w.memories.iter().map(Memory::draws).collect()),
        None => {
            let dir = RunDir::open(&run.folder).map_err(|e| plain(e.to_string()))?;
            reread(&dir, ROOM).map_err(|e| plain(e.to_string()))
        }
    }
}

fn all_quantities(run: &Run) -> Result<Vec<Quantity>, Failure> {
    let mut draws = draws(run)?;
    if run.watched().is_some() {
        let all: usize = draws.iter().map(|d| d.rows.len()).sum();
        let every = all.div_ceil(LIVE).max(1);
        for d in &mut draws {
            let mut i = 0;
            d.rows.retain(|_| {
                i += 1;
                (i - 1) % every == 0
            });
        }
    }
    let mut all = quantities(&draws);
    let summary = run.summary_file();
    let names: Vec<&String> =
        summary["quantities"].as_object().into_iter().flat_map(|q| q.keys()).collect();
    rename(&mut all, names.into_iter().map(String::as_str));
    Ok(all)
}

/// Lists the kept draws.
pub fn kept(run: &Run) -> Result<Value, Failure> {
    let of = |k: &KeptTrace| json!({ "chain": k.chain, "draw": k.draw, "log_joint": finite(k.log_joint) });
    let kept = run.kept()?;
    let film = run.film()?;
    let on_the_way =
        |s: &TrajectoryState| json!({ "step": s.step, "log_joint": finite(s.log_joint) });
    Ok(json!({
        "draws": kept.iter().map(of).collect::<Vec<_>>(),
        "film": film.iter().map(on_the_way).collect::<Vec<_>>(),
        "chains": run.job.as_ref().map(|j| j.sampling.chains()),
    }))
}

/// Summarises a run: from its file, or the draws so far.
pub fn summary(run: &Run) -> Result<Value, Failure> {
    let mut out = run.summary_file();
    if out.is_null() {
        let all = all_quantities(run)?;
        let found = modes(&all, None);
        let chains = run.job.as_ref().map_or(1, |j| j.sampling.chains()) as usize;
        let said = match run.watched() {
            // Chains that have not converged yet are expected.
            Some(_) => Vec::new(),
            None => warnings(&all, &found, &[], chains),
        };
        out = json!({
            "modes": found, "warnings": said, "approximate": [], "kernels": [], "choices": [],
            "quantities": all.iter().map(|q| (q.name.clone(), json!(q.summary))).collect::<BTreeMap<_, _>>(),
        });
    }
    out["files"] = json!(files(run));
    let command =
        Reopened::open(&run.folder).map(|r| format!("pcadlang run {}", quoted(&r.arguments)));
    out["command"] = json!(command.ok());
    Ok(out)
}

/// Lists the files of a run.
fn files(run: &Run) -> Vec<String> {
    let entries = std::fs::read_dir(&run.folder).into_iter().flatten().flatten();
    let is_file = |e: &std::fs::DirEntry| e.file_type().is_ok_and(|t| t.is_file());
    let mut all: Vec<String> =
        entries.filter(is_file).filter_map(|e| e.file_name().into_string().ok()).collect();
    all.sort();
    all
}

/// Returns the draws of some quantities, thinned evenly.
pub fn quantity(run: &Run, names: &[String]) -> Result<Value, Failure> {
    let all = all_quantities(run)?;
    let mut found = Vec::new();
    for name in names {
        let q = all.iter().find(|q| q.name == *name);
        let q = q.ok_or_else(|| plain(format!("the run has no quantity `{name}`")))?;
        let thinned = |c: &Vec<f64>| -> Vec<Value> {
            let every = c.len().div_ceil(NUMBERS).max(1);
            c.iter().step_by(every).map(|x| finite(*x)).collect()
        };
        let chains: Vec<Vec<Value>> = q.chains.iter().map(thinned).collect();
        found.push(json!({ "name": q.name, "chains": chains, "summary": q.summary }));
    }
    let longest = all.iter().flat_map(|q| &q.chains).map(Vec::len).max().unwrap_or(0);
    Ok(json!({ "quantities": found, "every": longest.div_ceil(NUMBERS).max(1) }))
}

/// Compares two runs.
pub fn compared(a: &Run, b: &Run) -> Result<Value, Failure> {
    let of = |r: &Run| Ok::<_, Failure>((r.record(), summary(r)?));
    let both = Comparison::between([of(a)?, of(b)?]);
    let of = |q: &pcadlang_runs::reopening::compare::QuantityDifference| json!({ "name": q.name, "a": q.a, "b": q.b, "apart": finite(q.difference) });
    let [only_a, only_b] = both.settings();
    Ok(json!({
        "settings": { "a": only_a, "b": only_b },
        "same_program": both.has_same("program_hash"),
        "same_data": both.has_same("inputs_hash"),
        "quantities": both.quantities().iter().map(of).collect::<Vec<_>>(),
    }))
}

/// Returns the acceptance rate of each choice in a run, by address.
pub fn acceptance(run: &Run) -> BTreeMap<String, f64> {
    let summary = run.summary_file();
    let rate = |c: &Value| {
        let (tried, accepted) = (c["proposals"].as_f64()?, c["accepted"].as_f64()?);
        (tried > 0.0).then_some((c["address"].as_str()?.to_owned(), accepted / tried))
    };
    summary["choices"].as_array().into_iter().flatten().filter_map(rate).collect()
}

/// Returns a number as JSON: null if it is not finite.
pub fn finite(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

/// Returns the header and the data of a mesh: positions, normals, corners, parts.
///
/// # Errors
/// If the solid has no mesh, or one of more than `limit` triangles.
pub fn mesh(solid: &Solid, limit: Option<usize>) -> Result<(Map<String, Value>, Vec<u8>), String> {
    let mesh = solid.to_mesh().map_err(|e: GeomError| e.to_string())?;
    let triangles = &mesh.topology.triangles;
    if let Some(most) = limit.filter(|most| triangles.len() > *most) {
        return Err(format!("the mesh has {} triangles, more than {most}", triangles.len()));
    }
    let mut data = Vec::with_capacity(24 * mesh.positions.len() + 14 * triangles.len() + 2);
    for v in mesh.positions.iter().chain(&mesh.normals) {
        v.to_array().iter().for_each(|x| data.extend_from_slice(&x.to_le_bytes()));
    }
    triangles.iter().flatten().for_each(|i| data.extend_from_slice(&i.to_le_bytes()));
    let part = |i: usize| mesh.topology.parts.get(i).copied().unwrap_or(0);
    (0..triangles.len()).for_each(|i| data.extend_from_slice(&part(i).to_le_bytes()));
    data.resize(data.len().next_multiple_of(4), 0);
    let Value::Object(header) = json!({
        "type": "mesh", "vertices": mesh.positions.len(), "triangles": triangles.len(),
        "topology": topology(&mesh),
    }) else {
        return Err("no header".to_owned());
    };
    Ok((header, data))
}

/// Writes a file of a kind, and returns its name.
pub fn export(run: &Run, kind: &str) -> Result<String, Failure> {
    if run.is_active() {
        return Err(plain("the run has not ended").hint("stop it first; it can go on later"));
    }
    match kind {
        PAGE => {
            page::written(&Report { run: run.folder.clone() })?;
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
