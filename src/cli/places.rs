//! A picture of each mode that chains are in, where they do not agree: the best state of
//! its chains over the photograph.

use super::job::write;
use super::{Failure, plain, scene};
use image::RgbImage;
use image::imageops::{FilterType, resize};
use pcadlang::Model;
use pcadlang::infer::{BestSoFar, BestState};
use pcadlang::report::pictures::{captioned_sheet, png};
use pcadlang::report::{Mode, RunDir};
use pcadlang::session::over;
use pcadlang::vision::Photo;
use std::io::ErrorKind;
use std::sync::Arc;

/// How many modes are shown, as many as the table has.
const SHOWN: usize = 5;
/// Pictures in a row, and the longer side of each, pixels.
const COLUMNS: u32 = 3;
const SIDE: u32 = 384;

/// A mode's best state.
pub struct Place {
    /// Which mode, from 1.
    number: usize,
    /// What is said below its picture.
    said: String,
    best: Arc<BestState>,
}

/// The file of a mode's picture.
pub fn name(mode: usize) -> String {
    format!("mode-{mode}.png")
}

/// Each mode's best state.
pub fn best_of_each(modes: &[Mode], best: &BestSoFar) -> Vec<Place> {
    let chains: usize = modes.iter().map(|m| m.chains.len()).sum();
    let state = |m: &Mode| {
        let all = m.chains.iter().filter_map(|c| best.of_chain(c.checked_sub(1)?));
        all.max_by(|a, b| a.log_joint.total_cmp(&b.log_joint))
    };
    let place = |(i, m): (usize, &Mode)| {
        let best = state(m)?;
        let probability = m.probability.map_or(String::new(), |p| format!(", {:.0}%", 100.0 * p));
        let said = format!(
            "{}: {} of {chains}{probability}, {:.0}",
            i + 1,
            m.chains.len(),
            best.log_joint
        );
        Some(Place { number: i + 1, said, best })
    };
    modes.iter().take(SHOWN).enumerate().filter_map(place).collect()
}

/// A picture with a longer side of so many pixels.
pub fn sized(picture: &RgbImage, side: u32) -> RgbImage {
    let scale = f64::from(side) / f64::from(picture.width().max(picture.height()).max(1));
    let [w, h] =
        [picture.width(), picture.height()].map(|v| ((f64::from(v) * scale) as u32).max(1));
    resize(picture, w, h, FilterType::Triangle)
}

/// Writes `modes.png`, and `mode-N.png` of each, if there are several modes and something
/// is seen. Those of an earlier part of the run are removed.
pub fn show_places(
    dir: &RunDir,
    seed: u64,
    model: &Model,
    places: &[Place],
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
    let (mut pictures, mut captions) = (Vec::new(), Vec::new());
    for place in places {
        let draws = scene::predictive(seed, 3);
        let mut trace = scene::rebuilt(model, &place.best.choices, draws)?;
        let Some(view) = scene::view(&mut trace, draws, None) else { return Ok(()) };
        let camera = view.camera();
        let size = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
        let picture = over(&view, photo.map(Photo::rgb), size);
        pictures.push(sized(&picture, SIDE));
        captions.push(place.said.clone());
    }
    if pictures.len() < 2 {
        return Ok(());
    }
    let encoded = |picture: &RgbImage| png(picture).map_err(|e| plain(e.to_string()));
    for (place, picture) in places.iter().zip(&pictures) {
        write(dir, &name(place.number), &encoded(picture)?)?;
    }
    write(dir, "modes.png", &encoded(&captioned_sheet(&pictures, COLUMNS, &captions))?)
}
