//! The people in a photograph, as values: a thin layer over [`pcadlang_detectors::people`].

use super::observed::{KeypointsValue, MaskValue, PeopleKey};
use super::{IMAGE, ImageValue, native};
use pcadlang_detectors::boxes::overlap;
use pcadlang_detectors::people::{FindOptions, Person, networks};
use pcadlang_engine::lang::builtins::{Default, Row, Type, arg, int};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::vision::keypoints::{Alternative, Keypoint, Keypoints, MEDIAPIPE};
use pcadlang_scene::vision::{Mask, Photo};
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
        arg(
            "near",
            Type::Array,
            "A box [x, y, width, height]: people who fill it best come first.",
        )
        .or(Default::Nums(&[]))
        .unit("pixels"),
    ],
    Type::Array,
    "The people in a photograph, the most prominent first. Each is a record: `keypoints`, 33 \
     joints, with alternative positions where views disagree; `landmarks`, by name `at`, `spread` \
     over agreeing views and `visibility`; `metres`, by name [right, down, away] from the \
     mid-hip; `mask`; `box`, [x, y, width, height] around all joints, and `torso`, in pixels; \
     `score`; `sure`, the confidence from 0 to 1 that this is a person; `views`, the number of \
     views in which the person was found, and `agreeing`, how many of them agree. Depends only on \
     the picture, and is computed once.",
    |a| {
        let image = a.object::<ImageValue>(0, "an image")?;
        let Some(photo) = image.as_photo() else { return Ok(Value::List(Arc::from([]))) };
        let (views, most, near) = (a.int("views")?, a.int("most")?, a.array("near")?);
        if !near.is_empty() && near.len() != 4 {
            return Err(a.wrong_length("near", "4 numbers"));
        }
        let key: PeopleKey = (views, most);
        let found = image.prepared.get(key, |_| {
            let options = FindOptions { views, most: most as usize, ..FindOptions::default() };
            let fault = |why: String| Fault::new(FaultKind::Other, format!("scene.people: {why}"));
            let finder = networks::finder().map_err(|why| fault(why.into()))?;
            let found = finder.find(photo, &options, 0).map_err(|e| fault(e.to_string()))?;
            found.into_iter().map(|p| Ok((p.clone(), value(&p, photo).map_err(fault)?))).collect()
        });
        let found: Arc<Vec<(Person, Value)>> = found?;
        let mut order: Vec<usize> = (0..found.len()).collect();
        if let [x, y, w, h] = near[..] {
            let wanted = [x, y, x + w, y + h];
            let filled: Vec<f64> = found.iter().map(|(p, _)| overlap(p.bounds, wanted)).collect();
            order.sort_by(|i, j| filled[*j].total_cmp(&filled[*i]));
        }
        Ok(Value::List(order.into_iter().map(|i| found[i].1.clone()).collect()))
    },
)];

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
