//! A picture of each mode that chains are in, where they do not agree: the best state of its chains over the photograph.

use super::best::Shown;
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
use std::sync::Arc;

/// How many modes are shown, as many as the table has.
const SHOWN: usize = 5;
/// Pictures in a row, and the longer side of each, pixels.
const COLUMNS: u32 = 3;
const SIDE: u32 = 384;

/// Each mode's best state, with what is said below its picture.
pub fn best_of_each(modes: &[Mode], best: &BestSoFar) -> Vec<(String, Arc<BestState>)> {
    let chains: usize = modes.iter().map(|m| m.chains.len()).sum();
    let state = |m: &Mode| {
        let all = m.chains.iter().filter_map(|c| best.of_chain(c.checked_sub(1)?));
        all.max_by(|a, b| a.log_joint.total_cmp(&b.log_joint))
    };
    let said = |(i, m): (usize, &Mode)| {
        let best = state(m)?;
        let probability = m.probability.map_or(String::new(), |p| format!(", {:.0}%", 100.0 * p));
        let text = format!("{}: {} of {chains}{probability}, {:.0}", i + 1, m.chains.len(), best.log_joint);
        Some((text, best))
    };
    modes.iter().take(SHOWN).enumerate().filter_map(said).collect()
}

/// A picture with a longer side of so many pixels.
pub fn sized(picture: &RgbImage, side: u32) -> RgbImage {
    let scale = f64::from(side) / f64::from(picture.width().max(picture.height()).max(1));
    let [w, h] = [picture.width(), picture.height()].map(|v| ((f64::from(v) * scale) as u32).max(1));
    resize(picture, w, h, FilterType::Triangle)
}

/// Writes `modes.png` and shows it on the page, if there are several modes and something is seen.
pub fn show_places(
    dir: &RunDir,
    seed: u64,
    model: &Model,
    places: &[(String, Arc<BestState>)],
    photo: Option<&Photo>,
    shown: &mut Shown,
) -> Result<(), Failure> {
    let (mut pictures, mut captions) = (Vec::new(), Vec::new());
    for (text, best) in places {
        let draws = scene::predictive(seed, 3);
        let mut trace = scene::rebuilt(model, &best.choices, draws)?;
        let Some(view) = scene::view(&mut trace, draws, None) else { return Ok(()) };
        let camera = view.camera();
        let size = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
        let picture = over(&view, photo.map(Photo::rgb), size);
        pictures.push(sized(&picture, SIDE));
        captions.push(text.clone());
    }
    if pictures.len() < 2 {
        return Ok(());
    }
    let sheet = captioned_sheet(&pictures, COLUMNS, &captions);
    let bytes = png(&sheet).map_err(|e| plain(e.to_string()))?;
    write(dir, "modes.png", &bytes)?;
    shown.pictures.push((
        "the modes found by the chains: number of chains, estimated probability, log joint \
         density of the best state",
        bytes,
    ));
    Ok(())
}
