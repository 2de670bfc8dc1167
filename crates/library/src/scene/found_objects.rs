//! The objects in a photograph, as values: a thin layer over [`pcadlang_detectors::objects`].

use super::{IMAGE, ImageValue, native};
use pcadlang_detectors::objects::{CLASSES, FoundObject, ObjectFinder, ObjectOptions, View};
use pcadlang_engine::lang::builtins::{Args, Default, Domain, Row, Type, arg, int, num};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::Value;
use std::sync::Arc;

/// The minimum score that a program can choose. All objects above are found once, and
/// programs choose among them.
const LEAST: f64 = 0.01;

/// The key of the objects prepared from views of a photograph.
#[derive(Clone, PartialEq)]
struct Viewed(Vec<View>);

pub(super) const TABLE: &[Row] = &[native(
    "objects",
    "Finding",
    &[
        arg("photo", IMAGE, "The photograph; objects cannot be detected in a contour map."),
        int("most", 20, [1, 100], "The maximum number of objects."),
        num("least", 0.3, "The minimum score.").within(Domain::From([LEAST, 1.0])),
        arg("classes", Type::Array, "Names of classes; without them, all.").or(Default::Nums(&[])),
    ],
    Type::Array,
    "The objects of COCO's 80 classes in a photograph, those with the highest scores first. Each \
     is a record: `box`, [x, y, width, height] in pixels of the photograph; `class`, such as \
     \"cup\" or \"wine glass\"; `score`, 0 to 1. Depends only on the picture, and is computed \
     once.",
    |a| {
        let image = a.object::<ImageValue>(0, "an image")?;
        let (most, least, classes) = (a.int("most")?, a.num("least")?, classes(a)?);
        let found = found(image, &[View::WHOLE])?;
        let wanted = |o: &&FoundObject| {
            o.score >= least && (classes.is_empty() || classes.contains(&o.name()))
        };
        Ok(Value::List(found.iter().filter(wanted).take(most as usize).map(value).collect()))
    },
)];

/// Returns all objects that are seen in some views of a photograph, each once for each view,
/// those with the highest scores first; none in a contour map.
///
/// # Errors
/// Those of the detector.
pub(super) fn found(image: &ImageValue, views: &[View]) -> Result<Arc<Vec<FoundObject>>, Fault> {
    image.prepared().get(Viewed(views.to_vec()), |Viewed(views)| {
        let Some(photo) = image.as_photo() else { return Ok(Vec::new()) };
        let options = ObjectOptions { least: LEAST, most: usize::MAX };
        let found = ObjectFinder::included().find_in_views(photo, views, &options);
        found.map_err(|e| Fault::new(FaultKind::Other, format!("scene.objects: {e}")))
    })
}

/// Reads the names of classes.
fn classes(a: &Args) -> Result<Vec<&'static str>, Fault> {
    const WANTED: &str = "an array of names of classes";
    let items = match a.get("classes") {
        Value::Array(numbers) if numbers.is_empty() => return Ok(Vec::new()),
        Value::List(items) => items,
        _ => return Err(a.wrong("classes", WANTED)),
    };
    let known = || CLASSES.iter().map(|(name, _)| *name);
    let read = |item: &Value| {
        let Value::Str(name) = item else { return Err(a.element_wrong("classes", WANTED, item)) };
        known().find(|k| *k == &**name).ok_or_else(|| {
            let why = format!("scene.objects: there is no class \"{name}\"");
            Fault::type_error(why).with_nearest(name, "the classes are", known())
        })
    };
    items.iter().map(read).collect()
}

/// Converts an object to a record.
fn value(o: &FoundObject) -> Value {
    let [left, top, right, bottom] = o.bounds;
    Value::record([
        ("box", Value::array(vec![left, top, right - left, bottom - top])),
        ("class", Value::str(o.name())),
        ("score", Value::Num(o.score)),
    ])
}
