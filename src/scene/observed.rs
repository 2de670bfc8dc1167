//! What is observed: photographs and ready contour maps, masks, depth maps, keypoints.
//! What comparators prepare from them alone is made once, on first use, and kept beside
//! them.

use crate::lang::value::{Object, Value};
use crate::vision::candidates::{Candidate, CandidateOptions};
use crate::vision::people::Person;
use crate::vision::{
    Chamfer, ChamferOptions, ContourMap, ContourRatio, ContourRatioOptions, DepthLikelihood,
    DepthMap, FileDetector, GradientDetector, Keypoints, Mask, MaskLikelihood, Photo, Region,
    RegionOptions, SoftMap,
};
use std::any::Any;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The most prepared things of a kind that are kept: options may be choices, such as the
/// `sigma` of a chamfer distance.
const MOST: usize = 32;

/// Prepared things by what they were prepared for.
#[derive(Debug)]
pub(super) struct Prepared<K, T>(Mutex<Vec<(K, Arc<T>)>>);

impl<K, T> Default for Prepared<K, T> {
    fn default() -> Self {
        Prepared(Mutex::default())
    }
}

impl<K: PartialEq, T> Prepared<K, T> {
    /// The one for a key, made if it is new.
    pub fn get(
        &self,
        key: K,
        make: impl FnOnce(&K) -> Result<T, String>,
    ) -> Result<Arc<T>, String> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, t)) = all.iter().find(|(k, _)| *k == key) {
            return Ok(Arc::clone(t));
        }
        let made = Arc::new(make(&key)?);
        if all.len() == MOST {
            // The first one may not be as it would be made again: what a likelihood draws
            // is put there.
            all.remove(1);
        }
        all.push((key, Arc::clone(&made)));
        Ok(made)
    }

    /// The first that was made.
    pub fn any(&self) -> Option<Arc<T>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).first().map(|(_, t)| Arc::clone(t))
    }
}

/// Options and the size of the frame.
type Key<O> = (O, u32, u32);

/// A photograph, a ready contour map, or both.
#[derive(Debug, Default)]
pub struct ImageValue {
    photo: Option<Photo>,
    /// Its contours, once they were asked for, or given.
    map: OnceLock<Result<ContourMap, String>>,
    /// Whether the contours were given.
    ready: bool,
    /// What finds its contours where a program says nothing of it.
    by: OnceLock<DetectorValue>,
    pub(super) ratios: Prepared<Key<ContourRatioOptions>, ContourRatio>,
    pub(super) chamfers: Prepared<Key<ChamferOptions>, Chamfer>,
    pub(super) regions: Prepared<Key<RegionOptions>, Region>,
    /// The same photograph with contours found otherwise: by what, and how strong they
    /// must be.
    detected: Prepared<(Detecting, f32), Value>,
    /// What detectors from files say of its pixels, at a size.
    soft: Prepared<(DetectorValue, u32), SoftMap>,
    /// What may be objects in it, by how they were looked for.
    pub(super) candidates: Prepared<CandidateOptions, Vec<Candidate>>,
    /// The people in the photograph, by how they were looked for: views, and how many at
    /// most.
    pub(super) people: Prepared<(u32, u32), Vec<(Person, Value)>>,
}

impl ImageValue {
    /// Points weaker than this are more often texture than outline: the detector's own
    /// best threshold against human outlines is 0.47, and a few more edges help where the
    /// object is dim (docs/objects.md).
    pub(super) const STRONG: f32 = 0.4;

    /// A photograph; its contours are found when they are needed.
    pub fn photo(photo: Photo) -> Self {
        ImageValue { photo: Some(photo), ..ImageValue::default() }
    }

    /// A ready contour map, with the photograph if there is one.
    pub fn contours(map: ContourMap, photo: Option<Photo>) -> Self {
        ImageValue { photo, map: OnceLock::from(Ok(map)), ready: true, ..ImageValue::default() }
    }

    /// The photograph.
    pub fn as_photo(&self) -> Option<&Photo> {
        self.photo.as_ref()
    }

    /// The people that programs found in it, most prominent first; none if no program has
    /// asked.
    pub fn people(&self) -> Option<Vec<Person>> {
        self.people.any().map(|all| all.iter().map(|(p, _)| p.clone()).collect())
    }

    /// Its contours.
    ///
    /// # Errors
    /// If a detector was chosen for it that fails on it.
    pub fn map(&self) -> Result<&ContourMap, String> {
        let found = self.map.get_or_init(|| match &self.photo {
            Some(photo) => {
                let (by, least) = Detecting::usual(self.by.get());
                self.found(photo, &by).map(|map| strong(map, least))
            }
            None => Ok(ContourMap::default()),
        });
        found.as_ref().map_err(String::clone)
    }

    /// The contours that programs looked at; none if none has asked.
    pub fn seen(&self) -> Option<ContourMap> {
        let otherwise = self.detected.any();
        let image = otherwise.as_ref().and_then(|v| v.downcast::<ImageValue>()).unwrap_or(self);
        image.map.get()?.as_ref().ok().cloned()
    }

    /// The photograph with its contours found by a detector wherever a program says
    /// nothing of it; contours that were given stay.
    pub fn detecting(image: &Value, by: &DetectorValue) -> Value {
        match image.downcast::<ImageValue>() {
            Some(ImageValue { photo: Some(photo), ready: false, map, by: known, .. }) => {
                // Contours that were looked at before were found by what was chosen then.
                if map.get().is_none() {
                    let _ = known.set(by.clone());
                }
                if known.get() == Some(by) {
                    return image.clone();
                }
                Value::object(ImageValue {
                    by: OnceLock::from(by.clone()),
                    ..ImageValue::photo(photo.clone())
                })
            }
            _ => image.clone(),
        }
    }

    /// The same photograph with contours found in a way of its own, those at least so
    /// strong; `None` if there is no photograph.
    pub(super) fn detected_by(&self, by: Detecting, least: f32) -> Result<Option<Value>, String> {
        let Some(photo) = &self.photo else { return Ok(None) };
        let found = self.detected.get((by, least), |(by, least)| {
            let map = strong(self.found(photo, by)?, *least);
            Ok(Value::object(ImageValue::contours(map, Some(photo.clone()))))
        })?;
        Ok(Some(Value::clone(&found)))
    }

    fn found(&self, photo: &Photo, by: &Detecting) -> Result<ContourMap, String> {
        match by {
            Detecting::Gradients(detector) => Ok(detector.contours(photo)),
            Detecting::File { detector, size, sigma } => {
                let Some(file) = &detector.0 else { return Err("the detector has no file".into()) };
                let soft = self.soft.get((detector.clone(), *size), |_| {
                    file.map(photo, *size).map_err(|e| e.to_string())
                })?;
                Ok(file.contours(&soft, photo, *sigma))
            }
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        match &self.photo {
            Some(p) => (p.width(), p.height()),
            None => self.map().map_or((0, 0), |m| (m.width, m.height)),
        }
    }
}

/// What finds contours, from a file; without one the detector that is built in. Clones
/// share it.
#[derive(Clone, Debug, Default)]
pub struct DetectorValue(pub Option<Arc<FileDetector>>);

impl PartialEq for DetectorValue {
    /// Whether they were read at once: a detector that is read again may be another.
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
pub(super) enum Detecting {
    /// The one that is built in.
    Gradients(GradientDetector),
    /// One that was read from a file.
    File {
        /// Which one.
        detector: DetectorValue,
        /// The longer side of the picture worked on.
        size: u32,
        /// The spread of the smoothing.
        sigma: f32,
    },
}

impl Detecting {
    /// A detector with the settings that suit it, and how strong its contours must be.
    pub fn usual(detector: Option<&DetectorValue>) -> (Detecting, f32) {
        match detector.and_then(|d| d.0.as_ref().map(|file| (d, file))) {
            Some((d, file)) => {
                let (detector, size, sigma) = (d.clone(), FileDetector::SIZE, file.sigma());
                (Detecting::File { detector, size, sigma }, file.strength())
            }
            None => (Detecting::Gradients(GradientDetector::default()), ImageValue::STRONG),
        }
    }
}

/// The points that count as edges.
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
            _ => None,
        }
    }

    fn summary(&self) -> Option<String> {
        let (w, h) = self.size();
        Some(format!("{w} x {h} pixels"))
    }
}

/// An observed mask.
#[derive(Debug)]
pub struct MaskValue {
    /// The mask.
    pub mask: Mask,
    pub(super) prepared: Prepared<Key<[f64; 2]>, MaskLikelihood>,
}

impl MaskValue {
    /// A mask.
    pub fn new(mask: Mask) -> Self {
        MaskValue { mask, prepared: Prepared::default() }
    }
}

impl Object for MaskValue {
    fn type_name(&self) -> &'static str {
        "a mask"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn numbers(&self) -> Option<Vec<f64>> {
        Some(self.mask.data().iter().map(|m| f64::from(u8::from(*m))).collect())
    }
}

/// An observed depth map.
#[derive(Debug)]
pub struct DepthValue {
    /// The depth map.
    pub depth: DepthMap,
    pub(super) prepared: Prepared<Key<[f64; 4]>, DepthLikelihood>,
}

impl DepthValue {
    /// A depth map.
    pub fn new(depth: DepthMap) -> Self {
        DepthValue { depth, prepared: Prepared::default() }
    }
}

impl Object for DepthValue {
    fn type_name(&self) -> &'static str {
        "a depth map"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    /// The depths; background is infinite.
    fn numbers(&self) -> Option<Vec<f64>> {
        Some(self.depth.data().iter().map(|d| f64::from(*d)).collect())
    }
}

/// The joints of a person that a detector found; none where there is no detection.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_move_do_not_fill_the_memory() {
        let prepared: Prepared<u32, u32> = Prepared::default();
        prepared.get(0, |_| Ok(7)).unwrap();
        let first = Arc::downgrade(&prepared.get(1, |_| Ok(2)).unwrap());
        for key in 0..1000 {
            assert_eq!(
                *prepared.get(key, |k| Ok(k + 1)).unwrap(),
                if key == 0 { 7 } else { key + 1 }
            );
        }
        assert_eq!(prepared.0.lock().unwrap().len(), MOST);
        assert!(first.upgrade().is_none() && *prepared.get(0, |_| Ok(8)).unwrap() == 7);
    }
}
