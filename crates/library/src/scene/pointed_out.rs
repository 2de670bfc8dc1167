//! What a user is shown while pointing out an object: the place that is meant, without axes
//! and before anything is sampled.

use super::ImageValue;
use super::found_objects::found;
use super::places::{Place, boxes, sized};
use pcadlang_detectors::objects::VIEWS;
use pcadlang_detectors::people::Person;
use pcadlang_engine::lang::error::Fault;
use pcadlang_scene::vision::candidates::CandidateOptions;
use pcadlang_scene::vision::photo::fitted;
use pcadlang_scene::vision::segmentation::{Method, guesses};
use pcadlang_scene::vision::{Hint, Mask, Photo};

/// The maximum longer side of masks, pixels.
const LARGEST: u32 = 256;

impl ImageValue {
    /// Returns the place in the photograph that a hint points out, with guesses of its outline,
    /// the best first, and mostly without axes: what a user is shown while pointing. `None` if
    /// the hint is empty, which only finds the objects on which later answers are based, and if
    /// nothing is known of the place.
    ///
    /// A quick answer comes within a tenth of a second once the objects are found: for a box,
    /// and for a click on an object, it is an ellipse. Otherwise the outlines are those of
    /// [`ImageValue::places`], after a search of regions if no object was clicked.
    ///
    /// # Errors
    /// If the hint does not suit the photograph ([`Hint::check`]) or a detector fails.
    pub fn pointed_out(&self, hint: &Hint, quick: bool) -> Result<Option<Place>, Fault> {
        let Some(photo) = self.as_photo() else { return Ok(None) };
        hint.check(photo.width(), photo.height()).map_err(|e| Fault::domain(e.to_string()))?;
        if let Some(mask) = drawn(photo, hint) {
            return Ok(Some(Place::outlined("drawn", 1.0, None, vec![mask])));
        }
        // A program about people takes the one at the hint, wherever objects are.
        if let Some(person) = self.person_at(hint, quick) {
            return Ok((!hint.is_empty()).then(|| of_person(photo, &person)));
        }
        if hint.is_empty() {
            return found(self, &VIEWS).map(|_| None);
        }
        let (source, score, bounds) = match (hint.axis, hint.bounds) {
            (Some(_), bounds) => ("axis", 1.0, bounds),
            (None, Some(bounds)) => ("box", 1.0, Some(bounds)),
            (None, None) => {
                let seen = boxes(photo, &found(self, &VIEWS)?, hint);
                let total: f64 = seen.iter().map(|(_, weight)| weight).sum();
                match seen.first() {
                    Some((o, weight)) => (o.class, weight / total, Some(sized(o.bounds))),
                    None if quick => return Ok(None),
                    None => {
                        let places = self.places(&CandidateOptions::default(), hint)?;
                        return Ok(places.first().cloned());
                    }
                }
            }
        };
        let hint = Hint { bounds, ..hint.clone() };
        if !quick {
            let all = self.guesses(photo, &hint)?;
            return Ok(Some(Place::guessed(source, score, bounds, &all)));
        }
        let ellipse = guesses(photo, &hint, &[Method::Ellipse]);
        let masks = ellipse.into_iter().take(1).map(|g| g.mask).collect();
        Ok(Some(Place::outlined(source, score, bounds, masks)))
    }
}

/// Returns what the user drew, at a size at which that takes no time.
fn drawn(photo: &Photo, hint: &Hint) -> Option<Mask> {
    let (width, height) = fitted(photo.width(), photo.height(), LARGEST);
    let scale = [
        f64::from(width) / f64::from(photo.width()),
        f64::from(height) / f64::from(photo.height()),
    ];
    let outline = hint.outline.iter().map(|[x, y]| [x * scale[0], y * scale[1]]).collect();
    Hint { mask: hint.mask.clone(), outline, ..Hint::default() }.drawn(width, height)
}

fn of_person(photo: &Photo, person: &Person) -> Place {
    let (width, height) = fitted(photo.width(), photo.height(), LARGEST);
    let pixels = person.mask(width, height, photo.width());
    let mask = Mask::new(width, height, pixels.into_iter().map(|m| m > 0.5).collect());
    let bounds = Some(sized(person.bounds));
    Place::outlined("person", person.sure, bounds, mask.into_iter().collect())
}
