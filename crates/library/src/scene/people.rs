//! The people in a photograph, as values: a thin layer over [`pcadlang_detectors::people`].

use super::hint::{self, HINT};
use super::observed::{KeypointsValue, MaskValue, PeopleKey};
use super::{IMAGE, ImageValue, native};
use pcadlang_detectors::boxes::{contains, overlap};
use pcadlang_detectors::people::{FindOptions, Person, networks};
use pcadlang_engine::lang::builtins::{Row, Type, arg, int};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::vision::keypoints::{Alternative, Keypoint, Keypoints, MEDIAPIPE};
use pcadlang_scene::vision::{Hint, Mask, Photo};
use std::sync::Arc;

/// The maximum length of the longer side of a person's mask, in pixels.
const MASK: u32 = 256;
/// The weight of an alternative pose relative to that on which most views agree, if
/// equally many views support both; proportional to the number of its views.
const ELSEWHERE: f64 = 0.05;

pub(super) const TABLE: &[Row] = &[native(
    "people",
    "Finding",
    &[
        arg("photo", IMAGE, "The photograph; people cannot be detected in a contour map."),
        int(
            "views",
            2,
            [2, 8],
            "The number of views: with increasing padding, each also mirrored.",
        ),
        int("most", 2, [1, 100], "The maximum number of people per view."),
        HINT,
    ],
    Type::Array,
    "The people in a photograph: first those at most positions `at` of the hint, then those who \
     fill its box (or else its mask or outline) best, then the most prominent; last those at its \
     positions `not`. Each is a record: `keypoints`, 33 joints, with alternative positions where \
     views disagree; `landmarks`, by name `at`, `spread` over agreeing views and `visibility`; \
     `metres`, by name [right, down, away] from the mid-hip; `mask`; `box`, [x, y, width, height] \
     around all joints, and `torso`, in pixels; `score`; `sure`, the confidence from 0 to 1 that \
     this is a person; `views`, the number of views in which the person was found, and \
     `agreeing`, how many of them agree. Who is found depends only on the picture, and is \
     computed once.",
    |a| {
        let image = a.object::<ImageValue>(0, "an image")?;
        let Some(photo) = image.as_photo() else { return Ok(Value::List(Arc::from([]))) };
        let (views, most, hint) = (a.int("views")?, a.int("most")?, hint::asked(a, image)?);
        let key: PeopleKey = (views, most);
        let found = image.prepared().get(key, |_| {
            let options = FindOptions { views, most: most as usize, ..FindOptions::default() };
            let fault = |why: String| Fault::new(FaultKind::Other, format!("scene.people: {why}"));
            let finder = networks::finder().map_err(|why| fault(why.into()))?;
            let found = finder.find(photo, &options, 0).map_err(|e| fault(e.to_string()))?;
            found.into_iter().map(|p| Ok((p.clone(), value(&p, photo).map_err(fault)?))).collect()
        });
        let found: Arc<Vec<(Person, Value)>> = found?;
        let order = order(&found, &hint, (photo.width(), photo.height()));
        Ok(Value::List(order.into_iter().map(|i| found[i].1.clone()).collect()))
    },
)];

/// Returns the order of people by a hint; without one, as they are.
pub(super) fn order(
    found: &[(Person, Value)],
    hint: &Hint,
    (width, height): (u32, u32),
) -> Vec<usize> {
    let mut order: Vec<usize> = (0..found.len()).collect();
    let wanted = hint.around(width, height).map(|[x, y, w, h]| [x, y, x + w, y + h]);
    let filled = |(p, _): &(Person, Value)| wanted.map_or(0.0, |w| overlap(p.bounds, w));
    let filled: Vec<f64> = found.iter().map(filled).collect();
    let count = |positions: &[[f64; 2]]| {
        let mut counts = vec![0_u32; found.len()];
        for p in positions {
            let at = [p[0] / f64::from(width), p[1] / f64::from(height)];
            let on: Vec<usize> = (0..found.len()).filter(|i| on_mask(&found[*i].1, at)).collect();
            let within = || (0..found.len()).filter(|i| contains(found[*i].0.bounds, *p)).collect();
            let on = if on.is_empty() { within() } else { on };
            on.into_iter().for_each(|i| counts[i] += 1);
        }
        counts
    };
    let (on, beside) = (count(&hint.at), count(&hint.not));
    order.sort_by(|i, j| {
        let positions = beside[*i].cmp(&beside[*j]).then(on[*j].cmp(&on[*i]));
        positions.then(filled[*j].total_cmp(&filled[*i]))
    });
    order
}

/// Returns whether a position, a fraction of the picture's width and height, is on a
/// person's mask.
fn on_mask(person: &Value, at: [f64; 2]) -> bool {
    let Value::Record(fields) = person else { return false };
    let Some(MaskValue { mask, .. }) = fields.get("mask").and_then(|m| m.downcast()) else {
        return false;
    };
    mask.at(at)
}

fn number(x: f64) -> Value {
    Value::Num(x)
}

/// Converts a person to a record.
fn value(p: &Person, photo: &Photo) -> Result<Value, String> {
    let point =
        |(i, (name, l)): (usize, (&&'static str, &pcadlang_detectors::people::Landmark))| {
            let elsewhere = p.others.iter().map(|h| {
                let [x, y] = h.landmarks[i].at;
                Alternative { x, y, weight: ELSEWHERE * h.views as f64 / p.agreeing.max(1) as f64 }
            });
            let one = Keypoint::new(*name, l.at, l.visibility.clamp(0.0, 1.0));
            Keypoint { others: elsewhere.collect(), ..one }
        };
    let named = || MEDIAPIPE.iter().zip(&p.landmarks);
    let keypoints =
        Keypoints::new(named().enumerate().map(point).collect()).map_err(|e| e.to_string())?;
    let keypoints = keypoints.in_image(photo.width(), photo.height());
    let landmarks = named().map(|(name, l)| {
        let fields = [
            ("at", Value::array(l.at.to_vec())),
            ("spread", number(l.spread)),
            ("visibility", number(l.visibility)),
        ];
        (*name, Value::record(fields))
    });
    let metres = named().map(|(name, l)| (*name, Value::array(l.metres.to_vec())));
    let longer = photo.width().max(photo.height()).max(1);
    let side =
        |s: u32| (u64::from(s) * u64::from(MASK.min(longer)) / u64::from(longer)).max(1) as u32;
    let (width, height) = (side(photo.width()), side(photo.height()));
    let pixels = p.mask(width, height, photo.width()).into_iter().map(|m| m > 0.5).collect();
    let mask = Mask::new(width, height, pixels).map_err(|e| e.to_string())?;
    let [left, top, right, bottom] = p.bounds;
    Ok(Value::record([
        ("keypoints", Value::object(KeypointsValue(keypoints))),
        ("landmarks", Value::record(landmarks)),
        ("metres", Value::record(metres)),
        ("mask", Value::object(MaskValue::new(mask))),
        ("box", Value::array(vec![left, top, right - left, bottom - top])),
        ("torso", number(p.torso)),
        ("score", number(p.score)),
        ("sure", number(p.sure)),
        ("views", number(p.views as f64)),
        ("agreeing", number(p.agreeing as f64)),
    ]))
}
