//! A picture of each mode, if the chains are in several: the best state of the mode's
//! chains over the photograph.

use crate::failure::{Failure, plain};
use crate::files::write_in;
use crate::scene;
use image::RgbImage;
use pcadlang_inference::{BestSoFar, BestState};
use pcadlang_library::Model;
use pcadlang_report::pictures::{contact_sheet, png, scaled};
use pcadlang_report::{Mode, RunDir};
use pcadlang_scene::vision::Photo;
use pcadlang_workbench::session::over;
use std::io::ErrorKind;
use std::sync::Arc;

/// The maximum number of modes shown, the same as in the table.
const SHOWN: usize = 5;
/// The number of pictures in a row, and the longer side of each in pixels.
const COLUMNS: u32 = 3;
const SIDE: u32 = 384;

/// The best state of a mode.
pub struct ModeBest {
    /// The number of the mode, from 1.
    number: usize,
    best: Arc<BestState>,
}

/// Returns the file name of a mode's picture.
pub fn name(mode: usize) -> String {
    format!("mode-{mode}.png")
}

/// Returns the best state of each mode.
pub fn best_of_each(modes: &[Mode], best: &BestSoFar) -> Vec<ModeBest> {
    let state = |m: &Mode| {
        let all = m.chains.iter().filter_map(|c| best.of_chain(c.checked_sub(1)?));
        all.max_by(|a, b| a.log_joint.total_cmp(&b.log_joint))
    };
    let place = |(i, m): (usize, &Mode)| Some(ModeBest { number: i + 1, best: state(m)? });
    modes.iter().take(SHOWN).enumerate().filter_map(place).collect()
}

/// Scales a picture to a longer side of `side` pixels.
pub fn sized(picture: &RgbImage, side: u32) -> RgbImage {
    let scale = f64::from(side) / f64::from(picture.width().max(picture.height()).max(1));
    let [w, h] =
        [picture.width(), picture.height()].map(|v| ((f64::from(v) * scale) as u32).max(1));
    scaled(picture, w, h)
}

/// Writes `modes.png`, in the order of the table of modes, and `mode-N.png` for each mode, if there are several modes and the
/// program has a view. Files of an earlier part of the run are removed.
pub fn show_places(
    dir: &RunDir,
    seed: u64,
    model: &Model,
    places: &[ModeBest],
    photo: Option<&Photo>,
) -> Result<(), Failure> {
    for old in (1..=SHOWN).map(name).chain(["modes.png".to_owned()]).map(|name| dir.file(&name)) {
        match std::fs::remove_file(&old) {
            Err(e) if e.kind() != ErrorKind::NotFound => {
                return Err(plain(format!("{}: {e}", old.display())));
            }
            _ => {}
        }
    }
    let mut pictures = Vec::new();
    for place in places {
        let draws = scene::predictive(seed, 3);
        let mut trace = scene::rebuilt(model, &place.best.choices, draws)?;
        let Some(view) = scene::view(&mut trace, draws, None) else { return Ok(()) };
        let camera = view.camera();
        let size = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
        let picture = over(&view, photo.map(Photo::rgb), size);
        pictures.push(sized(&picture, SIDE));
    }
    if pictures.len() < 2 {
        return Ok(());
    }
    let encoded = |picture: &RgbImage| png(picture).map_err(|e| plain(e.to_string()));
    for (place, picture) in places.iter().zip(&pictures) {
        write_in(dir, &name(place.number), &encoded(picture)?)?;
    }
    write_in(dir, "modes.png", &encoded(&contact_sheet(&pictures, COLUMNS))?)
}
