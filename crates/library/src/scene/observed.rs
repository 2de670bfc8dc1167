//! Observations: photographs and ready-made contour maps, and keypoints; and the contours of a
//! photograph, detected with other settings than the default.
//! Data that comparators derive from an observation alone are computed on first use and
//! cached with it.

use super::{IMAGE, native};
use pcadlang_detectors::people::Person;
use pcadlang_engine::lang::builtins::{Domain, Row, Type, arg, int, num, opt};
use pcadlang_engine::lang::error::{Fault, FaultKind};
use pcadlang_engine::lang::value::{Object, Value};
use pcadlang_scene::vision::{
    ContourDetector, ContourMap, GradientDetector, Hint, Keypoints, Lens, MAP_SIZE, MOST_MAP_SIZE,
    Photo, SoftMap, VisionError,
};
use std::any::Any;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The maximum number of prepared items of a type: options can be choices of the program,
/// such as the `sigma` of a chamfer distance.
const MOST: usize = 32;

/// Data prepared from one observation, each item by its type and options.
#[derive(Debug, Default)]
pub(super) struct Prepared(Mutex<Vec<Box<dyn Any + Send + Sync>>>);

/// One prepared item; threads that ask for it at once make it once.
struct Item<K, T>(K, Arc<OnceLock<Result<Arc<T>, Fault>>>);

impl Prepared {
    /// Returns the item for a key; makes it if it is new.
    pub fn get<K, T>(
        &self,
        key: K,
        make: impl FnOnce(&K) -> Result<T, Fault>,
    ) -> Result<Arc<T>, Fault>
    where
        K: PartialEq + Clone + Send + Sync + 'static,
        T: Send + Sync + 'static,
    {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut known = all.iter().filter_map(|i| i.downcast_ref::<Item<K, T>>());
        let item = match known.find(|i| i.0 == key) {
            Some(item) => Arc::clone(&item.1),
            None => {
                let own = (0..all.len()).filter(|i| all[*i].is::<Item<K, T>>());
                let own: Vec<usize> = own.collect();
                if own.len() == MOST {
                    // Keeps the first item, which may be a simulated observation that cannot
                    // be remade.
                    all.remove(own[1]);
                }
                let made = Arc::default();
                all.push(Box::new(Item(key.clone(), Arc::clone(&made))));
                made
            }
        };
        // Making one item may need another one.
        drop(all);
        item.get_or_init(|| make(&key).map(Arc::new)).clone()
    }

    /// Returns the newest item of a type whose key fulfils a condition, if it was made.
    pub fn known<K: 'static, T: 'static>(&self, is: impl Fn(&K) -> bool) -> Option<Arc<T>> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut items = all.iter().rev().filter_map(|i| i.downcast_ref::<Item<K, T>>());
        items.find(|i| is(&i.0))?.1.get()?.clone().ok()
    }

    /// Returns the item of a type that was made first.
    pub fn first<K: 'static, T: 'static>(&self) -> Option<Arc<T>> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.iter().find_map(|i| i.downcast_ref::<Item<K, T>>())?.1.get()?.clone().ok()
    }
}

/// The key of contours to look at.
#[derive(Clone, Copy, PartialEq)]
struct Shown;

/// A search for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PeopleKey {
    /// The number of views.
    pub views: u32,
    /// The maximum number of people per view.
    pub most: u32,
    /// The box that is searched, left, top, right and bottom; without it, all of the photograph.
    pub within: Option<[f64; 4]>,
}

/// A photograph, a ready-made contour map, or both, and what a user pointed out in it.
/// Images of one picture with different hints share what was found in it.
#[derive(Debug, Default)]
pub struct ImageValue {
    picture: Arc<Picture>,
    hint: Hint,
}

/// A picture, and what was found in it.
#[derive(Debug, Default)]
struct Picture {
    photo: Option<Photo>,
    /// The photograph at a size to look at, if it is larger.
    shown: OnceLock<Photo>,
    /// Its contours, given or detected on first use.
    map: OnceLock<Result<ContourMap, Fault>>,
    /// The contours were given.
    ready: bool,
    /// The detector to use where the program does not choose one.
    by: OnceLock<DetectorValue>,
    /// Contours by other detectors, candidate objects, people, and the reference data of
    /// comparators. What depends on the hint, too, has it in its key.
    prepared: Prepared,
}

impl ImageValue {
    /// The minimum strength of a contour point: weaker ones are more often texture than
    /// outline. The detector's own best threshold against human outlines is 0.47, and a
    /// few more edges help where the object is dim
    /// (docs/measurements/objects.md).
    pub(super) const STRONG: f32 = 0.4;

    /// The focal length of the default view in longer sides of the picture, as programs write it.
    const USUAL_FOCAL: f64 = 1.818;

    /// The longer side of pictures to look at in pixels: more show no more of a scene that is
    /// compared at a few hundred.
    pub const SHOWN: u32 = 1600;

    /// Creates an image of a photograph; its contours are detected when they are needed.
    pub fn photo(photo: Photo) -> Self {
        ImageValue::of(Picture { photo: Some(photo), ..Picture::default() })
    }

    /// Creates an image of a ready-made contour map, and its photograph if available.
    pub fn contours(map: ContourMap, photo: Option<Photo>) -> Self {
        ImageValue::of(Picture::contours(map, photo))
    }

    fn of(picture: Picture) -> Self {
        ImageValue { picture: Arc::new(picture), hint: Hint::default() }
    }

    /// Returns the image with another hint, which must suit its size ([`Hint::check`]).
    #[must_use]
    pub fn with_hint(&self, hint: Hint) -> Self {
        ImageValue { picture: Arc::clone(&self.picture), hint }
    }

    /// Returns what was pointed out in it.
    pub fn hint(&self) -> &Hint {
        &self.hint
    }

    /// Returns the photograph.
    pub fn as_photo(&self) -> Option<&Photo> {
        self.picture.photo.as_ref()
    }

    /// Returns the photograph for looking at: shrunk, once, to a longer side of
    /// [`SHOWN`](Self::SHOWN) pixels if it is larger.
    pub fn shown(&self) -> Option<&Photo> {
        let photo = self.as_photo()?;
        match photo.width().max(photo.height()) > Self::SHOWN {
            true => Some(self.picture.shown.get_or_init(|| photo.shrunk(Self::SHOWN))),
            false => Some(photo),
        }
    }

    /// Returns what was prepared from the picture.
    pub(super) fn prepared(&self) -> &Prepared {
        &self.picture.prepared
    }

    /// Returns the people that programs detected in it, in the order of its hint, the most
    /// prominent first; `None` if no program did.
    pub fn people(&self) -> Option<Vec<Person>> {
        self.people_by(&self.hint)
    }

    /// Returns its contours, detecting them if necessary.
    ///
    /// # Errors
    /// If the detector chosen for it fails.
    pub fn map(&self) -> Result<&ContourMap, Fault> {
        self.picture.map()
    }

    /// Returns contours to look at: those that programs have used or, if they have used none,
    /// those of the built-in detector, found once. `None` without a photograph.
    pub fn contours_shown(&self) -> Option<ContourMap> {
        let found = || {
            let found = self.prepared().get(Shown, |_| {
                // Of a copy, so that they do not count as used.
                let copy = self.shown().map(|photo| ImageValue::photo(photo.clone()));
                Ok(copy.and_then(|image| image.map().ok().cloned()))
            });
            found.ok()?.as_ref().clone()
        };
        self.seen().or_else(found)
    }

    /// Returns the contours that programs have used; `None` if they have used none.
    pub fn seen(&self) -> Option<ContourMap> {
        let otherwise = self.prepared().first::<Detected, Picture>();
        let picture = otherwise.as_ref().unwrap_or(&self.picture);
        picture.map.get()?.as_ref().ok().cloned()
    }

    /// Returns the focal length that the photograph states, in its longer sides.
    pub(super) fn focal(&self) -> Option<f64> {
        self.as_photo()?.focal()
    }

    /// Returns the image as the pinhole of a lens would have it, with its hint; made once. `None`
    /// if it is not of the lens's proportions.
    pub(super) fn undistorted(&self, lens: &Lens) -> Option<ImageValue> {
        let picture = self.prepared().get(lens.clone(), |lens| {
            let fault = |e: VisionError| Fault::new(FaultKind::Other, e.to_string());
            let photo = self.as_photo().map(|p| p.undistorted(lens)).transpose().map_err(fault)?;
            let Picture { ready, map, .. } = &*self.picture;
            match map.get() {
                Some(Ok(map)) if *ready => {
                    Ok(Picture::contours(map.undistorted(lens).map_err(fault)?, photo))
                }
                _ => Ok(Picture { photo, ..Picture::default() }),
            }
        });
        let hint = self.hint.undistorted(lens, self.size()).ok()?;
        Some(ImageValue { picture: picture.ok()?, hint })
    }

    /// Returns the image with `by` as the detector where the program does not choose one;
    /// given contours stay.
    pub fn detecting(image: &Value, by: &DetectorValue) -> Value {
        let own = image.downcast::<ImageValue>();
        let Some((own, photo)) = own.and_then(|i| Some((i, i.as_photo()?))) else {
            return image.clone();
        };
        let Picture { ready, map, by: known, .. } = &*own.picture;
        // Contours already detected belong to the detector chosen at that time.
        if map.get().is_none() {
            let _ = known.set(by.clone());
        }
        if *ready || known.get() == Some(by) {
            return image.clone();
        }
        let (photo, by) = (Some(photo.clone()), OnceLock::from(by.clone()));
        let other = ImageValue::of(Picture { photo, by, ..Picture::default() });
        Value::object(other.with_hint(own.hint.clone()))
    }

    /// Returns the same photograph with the contours of a given detector that have at
    /// least strength `least`; `None` if there is no photograph.
    pub(super) fn detected_by(
        &self,
        by: DetectorSettings,
        least: f32,
    ) -> Result<Option<Value>, Fault> {
        let Some(photo) = self.as_photo() else { return Ok(None) };
        let picture = self.prepared().get((by.clone(), least), |(by, least)| {
            let map = strong(self.picture.found(photo, by)?, *least);
            Ok(Picture::contours(map, Some(photo.clone())))
        })?;
        let found = self.prepared().get((by, least, self.hint.clone()), |(.., hint)| {
            Ok(Value::object(ImageValue { picture, hint: hint.clone() }))
        })?;
        Ok(Some(Value::clone(&found)))
    }

    /// Returns the width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        match self.as_photo() {
            Some(p) => (p.width(), p.height()),
            None => self.map().map_or((0, 0), |m| (m.width, m.height)),
        }
    }
}

/// A detector with its settings, and the minimum strength of its contours.
type Detected = (DetectorSettings, f32);

impl Picture {
    fn contours(map: ContourMap, photo: Option<Photo>) -> Self {
        Picture { photo, map: OnceLock::from(Ok(map)), ready: true, ..Picture::default() }
    }

    fn map(&self) -> Result<&ContourMap, Fault> {
        let found = self.map.get_or_init(|| match &self.photo {
            Some(photo) => {
                let (by, least) = DetectorSettings::usual(self.by.get());
                self.found(photo, &by).map(|map| strong(map, least))
            }
            None => Ok(ContourMap::default()),
        });
        found.as_ref().map_err(Fault::clone)
    }

    fn found(&self, photo: &Photo, by: &DetectorSettings) -> Result<ContourMap, Fault> {
        match by {
            DetectorSettings::Gradients(detector) => Ok(detector.contours(photo)),
            DetectorSettings::File { detector, size, sigma } => {
                let fault = |why: String| Fault::new(FaultKind::Other, why);
                let file =
                    detector.0.as_ref().ok_or_else(|| fault("the detector has no file".into()))?;
                let soft: Arc<SoftMap> = self.prepared.get((detector.clone(), *size), |_| {
                    file.map(photo, *size).map_err(|e| fault(e.to_string()))
                })?;
                Ok(soft.contours_of(photo, *sigma))
            }
        }
    }
}

/// A contour detector from a file, or the built-in one if there is no file. Clones share
/// it.
#[derive(Clone, Debug, Default)]
pub struct DetectorValue(pub Option<Arc<dyn ContourDetector>>);

impl PartialEq for DetectorValue {
    /// Equal if both come from the same reading of a file, which may have changed in
    /// between.
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        }
    }
}

impl Object for DetectorValue {
    fn type_name(&self) -> &'static str {
        "a detector"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// A detector with its settings.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DetectorSettings {
    /// The built-in detector.
    Gradients(GradientDetector),
    /// A detector from a file.
    File {
        /// The detector.
        detector: DetectorValue,
        /// The longer side of the picture that is analysed, in pixels.
        size: u32,
        /// The standard deviation of the smoothing, in pixels.
        sigma: f32,
    },
}

impl DetectorSettings {
    /// Returns a detector with its default settings, and the minimum strength of its
    /// contours.
    pub fn usual(detector: Option<&DetectorValue>) -> (DetectorSettings, f32) {
        match detector.and_then(|d| d.0.as_ref().map(|file| (d, file))) {
            Some((d, file)) => {
                let (detector, size, sigma) = (d.clone(), MAP_SIZE, file.sigma());
                (DetectorSettings::File { detector, size, sigma }, file.strength())
            }
            None => (DetectorSettings::Gradients(GradientDetector::default()), ImageValue::STRONG),
        }
    }
}

/// Returns the points of at least a given strength, which count as edges.
fn strong(map: ContourMap, least: f32) -> ContourMap {
    let mut kept = ContourMap::new(map.width, map.height);
    for i in (0..map.len()).filter(|i| map.strength[*i] >= least) {
        kept.x.push(map.x[i]);
        kept.y.push(map.y[i]);
        kept.tx.push(map.tx[i]);
        kept.ty.push(map.ty[i]);
        kept.strength.push(map.strength[i]);
    }
    kept
}

impl Object for ImageValue {
    fn type_name(&self) -> &'static str {
        "an image"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn field(&self, name: &str) -> Option<Value> {
        match name {
            "width" => Some(Value::Num(f64::from(self.size().0))),
            "height" => Some(Value::Num(f64::from(self.size().1))),
            "focal" => Some(Value::Num(self.focal().unwrap_or(ImageValue::USUAL_FOCAL))),
            "focal_sd" => Some(Value::Num(if self.focal().is_some() { 0.05 } else { 0.4 })),
            _ => None,
        }
    }

    fn summary(&self) -> Option<String> {
        let (w, h) = self.size();
        Some(format!("{w} x {h} pixels"))
    }
}

/// The joints of a person from a pose detector; empty without a detection.
#[derive(Clone, Debug, Default)]
pub struct KeypointsValue(pub Keypoints);

impl Object for KeypointsValue {
    fn type_name(&self) -> &'static str {
        "keypoints"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn field(&self, name: &str) -> Option<Value> {
        (name == "count").then(|| Value::Num(self.0.points().len() as f64))
    }

    fn summary(&self) -> Option<String> {
        Some(format!("{} joints", self.0.points().len()))
    }

    /// The x and y of each joint.
    fn numbers(&self) -> Option<Vec<f64>> {
        Some(self.0.points().iter().flat_map(|p| [p.x, p.y]).collect())
    }
}

pub(super) const TABLE: &[Row] = &[native(
    "edges",
    "Comparing",
    &[
        arg("image", IMAGE, "The photograph. A contour map is returned unchanged."),
        int(
            "size",
            256,
            [8, 8192],
            "The longer side of the picture that is analysed; with a detector from a \
             file 512, at most 2048, and ignored by a network of fixed size.",
        )
        .unit("pixels"),
        num(
            "smooth",
            1.6,
            "The standard deviation of the smoothing: larger values give fewer and \
             longer contours. With a detector from a file it smooths the map, by 1.",
        )
        .within(Domain::From([0.3, 32.0]))
        .unit("pixels"),
        num(
            "strength",
            0.4,
            "The minimum strength of a contour point: weaker points are more often \
             texture than outline. 0.1 with a structured forest, 0.5 with a network.",
        )
        .within(Domain::From([0.0, 1.0])),
        opt(
            "detector",
            Type::Object("a detector"),
            "the run's",
            "The contour detector, `data d = detector(\"model.yml.gz\");`. By default that of the \
             run (`--edges`), or the built-in one, which uses colour gradients.",
        ),
    ],
    IMAGE,
    "The photograph with contours detected by these settings, for comparators. They are detected \
     once for each photograph and setting; a detector from a file runs once for each size.",
    |a| {
        // The photograph is missing when a program is examined without its data.
        if matches!(a.values.first(), Some(Value::Unit)) {
            return Ok(Value::Unit);
        }
        let image = a.object::<ImageValue>(0, "an image")?;
        let detector = match a.given("detector") {
            true => Some(a.object::<DetectorValue>("detector", "a detector")?),
            false => None,
        };
        let (mut by, usual) = DetectorSettings::usual(detector);
        let (most, old_size, old_sigma) = match &by {
            DetectorSettings::Gradients(g) => (8192, g.size, g.sigma),
            DetectorSettings::File { size, sigma, .. } => (MOST_MAP_SIZE, *size, *sigma),
        };
        // The defaults are those of the detector.
        let number = |name: &str, usual: f32| match a.is_written(name) {
            true => a.num(name),
            false => Ok(f64::from(usual)),
        };
        let asked = match a.is_written("size") {
            true => a.int_in("size", 8, i64::from(most))? as u32,
            false => old_size,
        };
        let (smooth, strength) = (number("smooth", old_sigma)?, number("strength", usual)?);
        match &mut by {
            DetectorSettings::Gradients(g) => (g.size, g.sigma) = (asked, smooth as f32),
            DetectorSettings::File { size, sigma, .. } => (*size, *sigma) = (asked, smooth as f32),
        }
        let found = image.detected_by(by, strength as f32).map_err(|f| f.of("scene.edges"))?;
        Ok(found.unwrap_or_else(|| a.get(0).clone()))
    },
)];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_move_do_not_fill_the_memory() {
        let prepared = Prepared::default();
        let get = |key: u32, made: u32| *prepared.get(key, |_| Ok(made)).unwrap();
        get(0, 7);
        let first = Arc::downgrade(&prepared.get(1_u32, |_| Ok(2_u32)).unwrap());
        prepared.get("another type", |_| Ok(())).unwrap();
        for key in 0..1000 {
            assert_eq!(get(key, key + 1), if key == 0 { 7 } else { key + 1 });
        }
        assert_eq!(prepared.0.lock().unwrap().len(), MOST + 1);
        assert!(first.upgrade().is_none() && get(0, 8) == 7);
    }

    fn edges(image: &Value, more: &[f64]) -> Result<Value, Fault> {
        let table = crate::standard::table();
        let builtin = table.get(table.find("scene", "edges").unwrap());
        let numbers: Vec<Value> = more.iter().map(|x| Value::Num(*x)).collect();
        let values: Vec<&Value> = std::iter::once(image).chain(&numbers).collect();
        builtin.apply(&values)
    }

    #[test]
    fn a_hint_does_not_find_them_again() {
        let photo = ImageValue::photo(Photo::from_rgb(image::RgbImage::new(64, 48)).unwrap());
        let hinted =
            Value::object(photo.with_hint(Hint { at: vec![[3.0, 4.0]], ..Hint::default() }));
        let own = hinted.downcast::<ImageValue>().unwrap();
        assert!(std::ptr::eq(photo.map().unwrap(), own.map().unwrap()));
        let (before, found) =
            (photo.detected_by(settings(), 0.4), own.detected_by(settings(), 0.4));
        let (before, found) = (before.unwrap().unwrap(), found.unwrap().unwrap());
        let (before, found): (&ImageValue, &ImageValue) =
            (before.downcast().unwrap(), found.downcast().unwrap());
        assert!(std::ptr::eq(before.map().unwrap(), found.map().unwrap()));
        assert!(before.hint().is_empty() && found.hint() == own.hint());
        let other = ImageValue::detecting(&hinted, &DetectorValue::default());
        assert_eq!(other.downcast::<ImageValue>().unwrap().hint(), own.hint());
    }

    fn settings() -> DetectorSettings {
        DetectorSettings::usual(None).0
    }

    #[test]
    fn they_are_found_once_for_each_setting() {
        let rgb = image::RgbImage::from_fn(64, 48, |x, y| {
            image::Rgb(if (x / 16 + y / 16) % 2 == 0 { [240, 30, 20] } else { [10, 60, 200] })
        });
        let photo = Value::object(ImageValue::photo(Photo::from_rgb(rgb).unwrap()));
        let count = |v: &Value| v.downcast::<ImageValue>().unwrap().map().unwrap().len();
        let (plain, smooth) = (edges(&photo, &[]).unwrap(), edges(&photo, &[256.0, 6.0]).unwrap());
        assert_eq!(
            count(&plain),
            count(&photo),
            "the defaults are those of a photograph by itself"
        );
        assert!(count(&smooth) < count(&plain) && count(&smooth) > 0);
        let again = edges(&photo, &[256.0, 6.0]).unwrap();
        assert!(std::ptr::eq(
            smooth.downcast::<ImageValue>().unwrap(),
            again.downcast::<ImageValue>().unwrap()
        ));
        assert!(smooth.downcast::<ImageValue>().unwrap().as_photo().is_some());
        assert!(edges(&photo, &[4.0]).is_err() && edges(&photo, &[64.0, f64::NAN]).is_err());
        let map = Value::object(ImageValue::contours(ContourMap::new(9, 9), None));
        assert_eq!(count(&edges(&map, &[]).unwrap()), 0);
        assert!(matches!(edges(&Value::Unit, &[]), Ok(Value::Unit)));
    }
}
