//! What the page draws over a photograph while the user points out the object in it.

use pcadlang_engine::lang::value::Value as Image;
use pcadlang_library::scene::ImageValue;
use pcadlang_library::scene::places::Place;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_scene::vision::{Hint, Mask};
use serde_json::{Value, json};

/// Returns the place that a hint points out, `null` if nothing is known of it.
///
/// # Errors
/// Without a photograph, for a hint that does not suit it, and if a detector fails.
pub fn of(image: Option<&Image>, hint: &Hint, quick: bool) -> Result<Value, Failure> {
    let image = image.and_then(|i| i.downcast::<ImageValue>()).filter(|i| i.as_photo().is_some());
    let image = image.ok_or_else(|| {
        plain("the session has no photograph").hint("give it one first: `observe`")
    })?;
    let place = image.pointed_out(hint, quick);
    let place = place.map_err(|f| Failure::Plain(f.message, f.hint))?;
    Ok(json!({ "place": place.map(|p| described(&p, hint, image.size())) }))
}

fn described(place: &Place, hint: &Hint, size: (u32, u32)) -> Value {
    // An outline is its own answer, corner by corner.
    let outlines: Vec<Vec<Vec<[f64; 2]>>> = match hint.outline.is_empty() || hint.mask.is_some() {
        true => place.masks.iter().map(|mask| outlines(mask, size)).collect(),
        false => vec![vec![hint.outline.clone()]],
    };
    json!({
        "source": place.source, "score": place.score, "box": place.bounds, "outlines": outlines,
    })
}

/// The outlines of a mask in pixels of a photograph of `size`, to a tenth.
fn outlines(mask: &Mask, size: (u32, u32)) -> Vec<Vec<[f64; 2]>> {
    let scale =
        [f64::from(size.0) / f64::from(mask.width()), f64::from(size.1) / f64::from(mask.height())];
    let tenth = |x: f64| (10.0 * x).round() / 10.0;
    let moved = |[x, y]: [f64; 2]| [tenth(x * scale[0]), tenth(y * scale[1])];
    let all = mask.outlines().into_iter();
    all.map(|polygon| polygon.into_iter().map(moved).collect()).collect()
}
