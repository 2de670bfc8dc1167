//! The people in a photograph, as values: a thin layer over [`pcadlang_detectors::people`].

use super::found_objects::found;
use super::hint::{self, HINT};
use super::observed::{KeypointsValue, PeopleKey};
use super::observed_maps::MaskValue;
use super::{IMAGE, ImageValue, native};
use pcadlang_detectors::boxes::{contains, sides};
use pcadlang_detectors::people::{FindOptions, Person, Search, VIEWS_OF_PEOPLE, networks};
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
/// The sides of the squares around a click on someone whom nothing else sees, as fractions of
/// the photograph's longer side.
const AROUND: [f64; 2] = [0.5, 0.25];

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
    "The people in a photograph, the most prominent first, in the whole of it and in the boxes \
     of a detector, which sees it in four views. With a box (or else a mask or an outline) in the hint, only \
     whoever fills it; with positions `at`, first those at most of them, and last those at its \
     positions `not`: an error if there is nobody. Each is a record: `keypoints`, 33 joints, with \
     alternative positions where views disagree; `landmarks`, by name `at`, `spread` over agreeing \
     views and `visibility`; `metres`, by name [right, down, away] from the mid-hip; `mask`; `box`, \
     [x, y, width, height] around all joints, and `torso`, in pixels; `score`; `sure`, the \
     confidence from 0 to 1 that this is a person; `views`, the number of views in which the person \
     was found, and `agreeing`, how many of them agree. Computed once.",
    |a| {
        let image = a.object::<ImageValue>(0, "an image")?;
        let (views, most, hint) = (a.int("views")?, a.int("most")?, hint::asked(a, image)?);
        let found = image.search_people(views, most, &hint)?;
        Ok(Value::List(found.into_iter().map(|(_, value)| value).collect()))
    },
)];

/// People and the records of them.
type Found = Vec<(Person, Value)>;

impl ImageValue {
    /// Looks for people where a hint says, the most prominent first.
    ///
    /// # Errors
    /// If the hint points to nobody, or a detector fails.
    pub(super) fn search_people(&self, views: u32, most: u32, hint: &Hint) -> Result<Found, Fault> {
        let Some(photo) = self.as_photo() else { return Ok(Vec::new()) };
        let (width, height) = (photo.width(), photo.height());
        let key = PeopleKey { views, most, within: None };
        if let Some(bounds) = hint.around(width, height) {
            let within = Some(sides(bounds));
            let found = self.people_of(photo, PeopleKey { within, ..key })?;
            return match found.is_empty() {
                true => Err(nobody(format!("fills the box {bounds:.0?}"))),
                false => Ok(found.to_vec()),
            };
        }
        let found = self.people_of(photo, key)?;
        let Some(at) = hint.at.first() else { return Ok(ordered(&found, hint, self.size())) };
        let near = |found: &Found| !on(found, *at, self.size()).is_empty();
        if near(&found) {
            return Ok(ordered(&found, hint, self.size()));
        }
        // Someone whom nothing saw: what is around the click, larger and smaller.
        for part in AROUND {
            let reach = 0.5 * part * f64::from(width.max(height));
            let within = Some([at[0] - reach, at[1] - reach, at[0] + reach, at[1] + reach]);
            let found = self.people_of(photo, PeopleKey { within, ..key })?;
            if near(&found) {
                return Ok(found.to_vec());
            }
        }
        Err(nobody(format!("is seen at {:.0}, {:.0}", at[0], at[1])))
    }

    fn people_of(&self, photo: &Photo, key: PeopleKey) -> Result<Arc<Found>, Fault> {
        self.prepared().get(key, |key| {
            let options =
                FindOptions { views: key.views, most: key.most as usize, ..FindOptions::default() };
            let fault = |why: String| Fault::new(FaultKind::Other, format!("scene.people: {why}"));
            let objects = match key.within {
                Some(_) => Arc::default(),
                None => found(self, VIEWS_OF_PEOPLE)?,
            };
            // One detector's networks after the other's: together they take more memory.
            let finder = networks::finder().map_err(fault)?;
            let search = key.within.map_or(Search::Everywhere(&objects), Search::Within);
            let found = finder.find(photo, search, &options, 0);
            drop(finder);
            found.into_iter().map(|p| Ok((p.clone(), value(&p, photo).map_err(fault)?))).collect()
        })
    }

    /// Returns the people that programs found where a hint says; `None` if none looked there.
    pub(super) fn people_by(&self, hint: &Hint) -> Option<Vec<Person>> {
        let around = hint.around(self.size().0, self.size().1).map(sides);
        let all = self.prepared().known::<PeopleKey, Found>(|key| key.within == around)?;
        Some(ordered(&all, hint, self.size()).into_iter().map(|(p, _)| p).collect())
    }

    /// Returns the person at a hint, if programs looked for people here; quickly, only of those
    /// who were found.
    pub(super) fn person_at(&self, hint: &Hint, quick: bool) -> Option<Person> {
        let seen = self.prepared().first::<PeopleKey, Found>()?;
        let known = self.people_by(hint);
        if quick || seen.is_empty() || known.is_some() {
            return known?.into_iter().next();
        }
        let FindOptions { views, most, .. } = FindOptions::default();
        let found = self.search_people(views, most as u32, hint).ok()?;
        found.into_iter().next().map(|(person, _)| person)
    }
}

fn nobody(why: String) -> Fault {
    Fault::new(FaultKind::Other, format!("scene.people: no person {why}")).with_hint(
        "a box is drawn around the whole of a person; without --box and --at, everyone is looked \
         for (`pcadlang detect` lists them)",
    )
}

/// Returns people in the order of the positions of a hint: first those at most of `at`, last
/// those at `not`.
fn ordered(found: &Found, hint: &Hint, size: (u32, u32)) -> Found {
    let count = |positions: &[[f64; 2]]| {
        let mut counts = vec![0_u32; found.len()];
        positions.iter().flat_map(|p| on(found, *p, size)).for_each(|i| counts[i] += 1);
        counts
    };
    let (at, beside) = (count(&hint.at), count(&hint.not));
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|i, j| beside[*i].cmp(&beside[*j]).then(at[*j].cmp(&at[*i])));
    order.into_iter().map(|i| found[i].clone()).collect()
}

/// Returns who is at a position: on whose mask it is, or else in whose box.
fn on(found: &Found, p: [f64; 2], (width, height): (u32, u32)) -> Vec<usize> {
    let at = [p[0] / f64::from(width), p[1] / f64::from(height)];
    let masked: Vec<usize> = (0..found.len()).filter(|i| on_mask(&found[*i].1, at)).collect();
    match masked.is_empty() {
        true => (0..found.len()).filter(|i| contains(found[*i].0.bounds, p)).collect(),
        false => masked,
    }
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
