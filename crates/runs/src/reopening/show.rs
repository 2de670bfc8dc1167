//! `pcadlang show`: a state of a finished run as a picture, a mesh or a list.

use crate::args::Show;
use crate::failure::{Failure, plain};
use crate::reopening::reopened::{Reopened, quoted};
use crate::scene;
use crate::{files, inputs};
use pcadlang_report::pictures::png;
use pcadlang_report::{number, table};
use pcadlang_scene::geom::{glb, obj};
use pcadlang_scene::vision::Photo;
use pcadlang_workbench::session::over;
use std::path::Path;
use std::time::Instant;

/// The maximum number of choices listed.
const LISTED: usize = 200;

/// Shows a state of a run.
pub fn show(a: &Show) -> Result<(), Failure> {
    let run = Reopened::open(&a.run)?;
    let kept = run.traces()?;
    let saved = match a.draw {
        None => run.best()?,
        Some(n) => {
            let found = kept.get(n as usize - 1);
            let there =
                format!("{} states of {} are kept (--keep of `run`)", kept.len(), a.run.display());
            found
                .ok_or_else(|| Failure::Plain(format!("no kept state {n}"), Some(there)))?
                .trace
                .clone()
        }
    };
    let ready = inputs::prepare_program(run.program()?, &run.job, Instant::now())?;
    let mut trace = run.trace(&ready.model, &saved)?;
    let Some(out) = &a.out else {
        print_line!("pcadlang run {}", quoted(&run.arguments));
        for (k, n) in kept.iter().zip(1..).filter(|_| a.draw.is_none()) {
            print_line!(
                "{n}: chain {}, draw {}, log joint {}",
                k.chain,
                k.draw,
                number(k.log_joint)
            );
        }
        let choices = trace.choices();
        let row = |(address, value, score): &(_, pcadlang_engine::lang::value::Value, f64)| {
            vec![format!("{address}"), pcadlang_workbench::session::short(value), number(*score)]
        };
        let mut rows = vec![["choice", "value", "log density"].map(str::to_owned).to_vec()];
        rows.extend(choices.iter().take(LISTED).map(row));
        print_text!("{}", table::aligned(&rows));
        if choices.len() > LISTED {
            print_line!("… and {} more", choices.len() - LISTED);
        }
        return Ok(());
    };
    let draws = scene::predictive(run.job.sampling.seed, 0);
    let view =
        scene::view(&mut trace, draws, None).ok_or_else(|| plain("the program has no view"))?;
    let failed = |e| plain(format!("cannot make a mesh: {e}"));
    let objects = || view.solid_in_files().objects().map_err(failed);
    let bytes = match out.extension().and_then(|e| e.to_str()) {
        Some("png") => {
            let (camera, photo) = (view.camera(), ready.photo());
            let size = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
            png(&over(&view, photo.map(Photo::rgb), size)).map_err(|e| plain(e.to_string()))?
        }
        Some("obj") => obj::write(&objects()?).into_bytes(),
        Some("glb") => glb::write(&objects()?),
        _ => {
            return Err(plain(format!(
                "{}: the file name must end in .png, .obj or .glb",
                out.display()
            )));
        }
    };
    files::write(Path::new(out), &bytes)
}
