//! What the page draws over a photograph while the user points out the object in it.

use pcadlang_engine::lang::value::Value as Image;
use pcadlang_library::scene::ImageValue;
use pcadlang_library::scene::places::Place;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_scene::vision::{Hint, Mask};
use serde_json::{Value, json};

/// How far pixels are compared with those around them, pixels of a guess.
const REACH: usize = 3;

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
        false => vec![vec![hint.curve()]],
    };
    json!({
        "source": place.source, "score": place.score, "box": place.bounds, "outlines": outlines,
    })
}

/// The outlines of a mask, smoothed, in pixels of a photograph of `size`, to a tenth.
fn outlines(mask: &Mask, size: (u32, u32)) -> Vec<Vec<[f64; 2]>> {
    let mask = smoothed(mask);
    let scale =
        [f64::from(size.0) / f64::from(mask.width()), f64::from(size.1) / f64::from(mask.height())];
    let tenth = |x: f64| (10.0 * x).round() / 10.0;
    let moved = |[x, y]: [f64; 2]| [tenth(x * scale[0]), tenth(y * scale[1])];
    let all = mask.outlines().into_iter();
    all.map(|polygon| polygon.into_iter().map(moved).collect()).collect()
}

/// Returns a mask without teeth: a pixel is on the object if most pixels around it are. An
/// object of which nothing would be left stays as it is.
fn smoothed(mask: &Mask) -> Mask {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    // Sums of all pixels above and to the left.
    let mut sums = vec![0_u32; (width + 1) * (height + 1)];
    for y in 0..height {
        let mut row = 0;
        for x in 0..width {
            row += u32::from(mask.data()[y * width + x]);
            sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
        }
    }
    let most = |p: usize| {
        let (x, y) = (p % width, p / width);
        let (left, right) = (x.saturating_sub(REACH), (x + REACH + 1).min(width));
        let (top, bottom) = (y.saturating_sub(REACH), (y + REACH + 1).min(height));
        let sum = |x: usize, y: usize| sums[y * (width + 1) + x];
        let on = sum(right, bottom) + sum(left, top) - sum(left, bottom) - sum(right, top);
        2 * on as usize > (right - left) * (bottom - top)
    };
    let pixels: Vec<bool> = (0..width * height).map(most).collect();
    let kept = pixels.contains(&true).then(|| Mask::new(mask.width(), mask.height(), pixels).ok());
    kept.flatten().unwrap_or_else(|| mask.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(on: impl Fn(u32, u32) -> bool) -> Mask {
        let pixels = (0..40 * 30).map(|p| on(p % 40, p / 40)).collect();
        Mask::new(40, 30, pixels).unwrap()
    }

    #[test]
    fn teeth_are_short_and_the_rest_stays() {
        let comb = mask(|x, y| {
            let end = if y % 3 == 0 { 28 } else { 20 };
            (5..=25).contains(&y) && (10..end).contains(&x)
        });
        let whole: Vec<[f64; 2]> = outlines(&comb, (80, 60)).concat();
        for (c, wanted) in [(0, [20.0, 40.0]), (1, [10.0, 52.0])] {
            let ends = [f64::min, f64::max].map(|f| whole.iter().map(|p| p[c]).reduce(f).unwrap());
            assert!(ends.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 6.5), "{ends:?}");
        }
        let thin = mask(|x, _| x == 7);
        assert_eq!(outlines(&thin, (40, 30)), thin.outlines());
    }
}
