//! `pcadlang sample`: draws from the prior on a contact sheet, like Figure 1 of Kulkarni
//! et al. 2014.

use super::args::Sample;
use pcadlang_engine::lang::error::FaultKind;
use pcadlang_engine::lang::value::Value;
use pcadlang_engine::trace::Trace;
use pcadlang_report::pictures::{contact_sheet, png, shaded};
use pcadlang_report::{number, table};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::scene;
use pcadlang_runs::{files, inputs};
use std::sync::Arc;

/// Draws scenes from the prior; a program without a scene gets a table of its values.
pub fn sample(a: &Sample) -> Result<(), Failure> {
    a.inputs.hint.none_for("sample")?;
    let model = inputs::program(&a.inputs, false)?.without_data().compile()?;
    let mut pictures = Vec::new();
    let mut rows = Vec::new();
    for i in 0..a.n {
        let draws = scene::predictive(a.seed, u64::from(i));
        let mut trace = Trace::prior(Arc::clone(model.code()), model.limits().clone());
        if i == 0 {
            // What ends a run is an error here, too, and not a picture of what else there is.
            for o in model.code().globals.values() {
                if let Err(e) = trace.query(&[*o], draws)
                    && e.kind == FaultKind::Other
                {
                    return Err(model.run_error(*e).into());
                }
            }
        }
        let view = scene::view(&mut trace, draws, None);
        match view {
            Some(view) => pictures.push(shaded(&view.frame(a.size))),
            None => {
                let mut row = vec![(i + 1).to_string()];
                for (name, o) in &model.code().assumed {
                    let value = trace
                        .query(&[*o], draws)
                        .map_err(|e| Failure::from(model.run_error(*e)))?;
                    row.push(value.first().map_or_else(|| name.to_string(), short));
                }
                rows.push(row);
            }
        }
    }
    if pictures.is_empty() {
        let head = std::iter::once("draw".to_owned())
            .chain(model.code().assumed.iter().map(|(n, _)| n.to_string()));
        rows.insert(0, head.collect());
        print_text!("{}", table::aligned(&rows));
        print_line!("seed {}", a.seed);
        return Ok(());
    }
    let columns = (a.n as f64).sqrt().ceil() as u32;
    let sheet = png(&contact_sheet(&pictures, columns)).map_err(|e| plain(e.to_string()))?;
    files::write(&a.out, &sheet)?;
    print_line!("{}: {} draws from the prior, seed {}", a.out.display(), pictures.len(), a.seed);
    Ok(())
}

/// Formats a value briefly.
fn short(v: &Value) -> String {
    match v {
        Value::Num(x) => number(*x),
        v => {
            let s = v.to_string();
            if s.chars().count() > 24 { s.chars().take(23).chain(['…']).collect() } else { s }
        }
    }
}
