//! Positions of the landmarks of a program's view in the photograph, over all draws:
//! `keypoints.json`.

use crate::scene::view_operand;
use pcadlang_engine::lang::code::Operand;
use pcadlang_engine::lang::value::Located;
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_inference::{Callback, StateError};
use pcadlang_library::scene::ViewValue;
use pcadlang_report::{Mode, Moments};
use pcadlang_scene::vision::Mask;
use pcadlang_scene::vision::keypoints::COCO;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The landmarks over the draws of all chains so far. Clones share them.
#[derive(Clone, Debug)]
pub struct Joints {
    /// The width and height of the photograph in pixels; if there is none, positions are
    /// in pixels of the camera.
    size: Option<(u32, u32)>,
    chains: Arc<[Mutex<Chain>]>,
}

#[derive(Debug, Default)]
struct Chain {
    /// The operand of the view, if there is one; it is searched for only once.
    view: Option<Option<Operand>>,
    seen: LandmarkMoments,
}

/// Moments of the positions of landmarks.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct LandmarkMoments {
    /// Positions in the picture given both the scene and the detected keypoints.
    joints: Moments,
    /// Positions of the scene's landmarks in the picture, and in the scene.
    own: Moments,
    scene: Moments,
}

impl Joints {
    /// Makes moments for a number of chains, over a photograph of this size.
    pub fn new(chains: u32, size: Option<(u32, u32)>) -> Joints {
        Joints { size, chains: (0..chains).map(|_| Mutex::default()).collect() }
    }

    fn chain(&self, chain: u32) -> Option<MutexGuard<'_, Chain>> {
        Some(self.chains.get(chain as usize)?.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns the width and height of the picture that positions refer to.
    fn pixels(&self, view: &ViewValue) -> (u32, u32) {
        self.size.unwrap_or((view.0.camera().width, view.0.camera().height))
    }

    /// Returns means and standard deviations of the joints' positions, over all draws so
    /// far.
    pub fn moments(&self) -> Moments {
        self.all().joints
    }

    fn all(&self) -> LandmarkMoments {
        self.of(0..self.chains.len())
    }

    /// Merges the draws of some chains, numbered from 0.
    fn of(&self, chains: impl Iterator<Item = usize>) -> LandmarkMoments {
        let mut all = LandmarkMoments::default();
        for chain in chains.filter_map(|c| self.chains.get(c)) {
            let LandmarkMoments { joints, own, scene } =
                &chain.lock().unwrap_or_else(PoisonError::into_inner).seen;
            all.joints.merge(joints);
            all.own.merge(own);
            all.scene.merge(scene);
        }
        all
    }

    /// Merges the draws of all chains, weighting the modes by their probabilities if
    /// these are known.
    fn by_probability(&self, modes: &[Mode]) -> LandmarkMoments {
        let each = modes
            .iter()
            .map(|m| Some((m.probability?, self.of(m.chains.iter().map(|c| c.wrapping_sub(1))))));
        let Some(each) = each.collect::<Option<Vec<_>>>().filter(|e| !e.is_empty()) else {
            return self.all();
        };
        let mixed = |part: fn(&LandmarkMoments) -> &Moments| {
            Moments::mixture(&each.iter().map(|(p, s)| (*p, part(s))).collect::<Vec<_>>())
        };
        LandmarkMoments {
            joints: mixed(|s| &s.joints),
            own: mixed(|s| &s.own),
            scene: mixed(|s| &s.scene),
        }
    }

    /// Returns the landmarks of a view; a position is `None` if it is not in front of the
    /// camera.
    pub fn positions(&self, view: &ViewValue) -> Vec<(Arc<str>, Option<[f64; 2]>)> {
        let (width, height) = self.pixels(view);
        view.landmarks(width, height).map(|(name, at)| (Arc::clone(name), at)).collect()
    }

    /// Makes the contents of the file: means and standard deviations over all draws, with
    /// modes weighted by their probabilities, and the best state, which has this `view`.
    /// `None` if the view has no landmarks.
    pub fn report(&self, view: &ViewValue, modes: &[Mode], seconds: f64) -> Option<Value> {
        let best = self.positions(view);
        if best.is_empty() {
            return None;
        }
        let numbers = |xs: &mut dyn Iterator<Item = f64>| xs.map(rounded).collect::<Value>();
        let spread = |m: &Moments| -> Map<String, Value> {
            let each = m.iter().map(|(name, p)| {
                (name.to_owned(), numbers(&mut p.mean.iter().copied().chain([p.sd()])))
            });
            each.collect()
        };
        let LandmarkMoments { joints, own, scene } = self.by_probability(modes);
        let best: Map<String, Value> = best
            .iter()
            .filter_map(|(name, at)| Some((name.to_string(), numbers(&mut (*at)?.into_iter()))))
            .collect();
        Some(json!({
            "keypoints": spread(&joints),
            "body": spread(&own),
            "scene": spread(&scene),
            "best": best,
            "seconds": rounded(seconds),
        }))
    }
}

/// Returns the number of a picture in results for COCO's tools: what the user says, or the
/// number that its file is named by, as COCO's are, or else that name.
pub fn image_id(given: Option<u64>, picture: &str) -> Value {
    let number = given.or_else(|| picture.parse().ok());
    number.map_or_else(|| json!(picture), |n| json!(n))
}

/// Returns the joints of [`Joints::report`] in the format of results of the COCO keypoint
/// challenge: one person in the picture of this number. A joint that is not there has
/// visibility 0, any other 2. The mask, if there is one, is the body's; without it, readers
/// take the area from the joints, in which those at 0, 0 count. `None` if there are none of
/// COCO's joints.
pub fn coco(found: &Value, image: &Value, mask: Option<&Mask>) -> Option<Value> {
    let joint = |name: &&str| {
        let at = &found["keypoints"][name];
        let known = at[0].is_number() && at[1].is_number();
        if known { json!([at[0], at[1], 2]) } else { json!([0, 0, 0]) }
    };
    let joints: Vec<Value> = COCO.iter().map(joint).collect();
    if joints.iter().all(|j| j[2] == 0) {
        return None;
    }
    let numbers: Vec<&Value> = joints.iter().filter_map(Value::as_array).flatten().collect();
    let mut person =
        json!({ "image_id": image, "category_id": 1, "keypoints": numbers, "score": 1 });
    if let Some(mask) = mask {
        person["segmentation"] = segmentation(mask);
    }
    Some(json!([person]))
}

/// Returns a mask as the results of COCO's segmentation challenge. They have no box: a reader
/// that finds one takes the area from it.
pub fn coco_mask(mask: &Mask, image: &Value, category: u64) -> Value {
    let segmentation = segmentation(mask);
    let result = json!({
        "image_id": image, "category_id": category, "segmentation": segmentation, "score": 1,
    });
    json!([result])
}

fn segmentation(mask: &Mask) -> Value {
    json!({ "size": [mask.height(), mask.width()], "counts": mask.coco_counts() })
}

/// Rounds a number of pixels or seconds to a thousandth.
fn rounded(x: f64) -> Value {
    json!((x * 1000.0).round() / 1000.0)
}

impl Callback for Joints {
    fn save(&self, chain: u32) -> Vec<u8> {
        self.chain(chain).and_then(|c| serde_json::to_vec(&c.seen).ok()).unwrap_or_default()
    }

    fn load(&self, chain: u32, state: &[u8]) -> Result<(), StateError> {
        if let Some(mut chain) = self.chain(chain) {
            chain.seen = serde_json::from_slice(state).map_err(|e| StateError(e.to_string()))?;
        }
        Ok(())
    }

    fn draw(&self, chain: u32, trace: &mut Trace, draws: Draws) {
        let Some(mut chain) = self.chain(chain) else { return };
        let Some(at) = *chain.view.get_or_insert_with(|| view_operand(trace, draws)) else {
            return;
        };
        let Ok(values) = trace.query(&[at], draws) else { return };
        let Some(view) = values.first().and_then(|v| v.downcast::<ViewValue>()) else { return };
        if view.0.solid().landmarks().is_empty() {
            return;
        }
        let found = trace.located();
        let (width, height) = self.pixels(view);
        let (width, height) = (f64::from(width), f64::from(height));
        let seen = &mut chain.seen;
        for (landmark, (name, at)) in view.0.solid().landmarks().iter().zip(self.positions(view)) {
            seen.scene.add(&name, &landmark.position.to_array(), 0.0);
            // If several solids have a landmark of the same name, the second is called
            // NAME#2, but its observations use the plain name.
            let same = |l: &&Located| {
                let near = |k: usize, size: f64| {
                    at.is_some_and(|at| (l.own[k] * size - at[k]).abs() < 1e-6 * size)
                };
                name.split('#').next() == Some(&*l.name) && near(0, width) && near(1, height)
            };
            let located = found.iter().find(same);
            let diagonal = width * width + height * height;
            if let Some(at) = at {
                seen.own.add(&name, &at, located.map_or(0.0, |l| l.own_variance * diagonal));
            }
            match (located, at) {
                (Some(l), _) => {
                    seen.joints.add(
                        &name,
                        &[l.at[0] * width, l.at[1] * height],
                        l.variance * diagonal,
                    );
                }
                (None, Some(at)) => seen.joints.add(&name, &at, 0.0),
                (None, None) => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_are_in_the_order_of_coco() {
        let found = json!({ "keypoints": { "nose": [3.5, 4, 1], "r_ankle": [7, 8, 1], "pelvis": [1, 1, 1] } });
        let picture = |name: &str| image_id(None, name);
        let all = coco(&found, &picture("000000442619"), None).unwrap();
        assert_eq!((&all[0]["image_id"], &all[0]["category_id"]), (&json!(442_619), &json!(1)));
        let numbers = all[0]["keypoints"].as_array().unwrap();
        assert_eq!(numbers.len(), 51);
        assert_eq!(
            (&numbers[..3], &numbers[48..]),
            (&[json!(3.5), json!(4), json!(2)][..], &[json!(7), json!(8), json!(2)][..])
        );
        assert!(numbers[3..48].iter().all(|n| *n == 0));
        assert_eq!(coco(&found, &picture("skier"), None).unwrap()[0]["image_id"], "skier");
        let none = json!({ "keypoints": { "pelvis": [1, 1, 1] } });
        assert!(coco(&none, &picture("a"), None).is_none());
        assert_eq!(image_id(Some(7), "000000442619"), 7);
    }

    #[test]
    fn masks_are_as_coco_has_them() {
        // pycocotools 2.0.11 encodes it so.
        let rows = [1, 1, 0, 1, 0, 0, 1, 0, 1, 0, 1, 1].map(|x| x == 1).to_vec();
        let mask = Mask::new(4, 3, rows).unwrap();
        let runs = json!({ "size": [3, 4], "counts": "011121NN" });
        let one = json!({ "image_id": 5, "category_id": 62, "segmentation": runs, "score": 1 });
        assert_eq!(coco_mask(&mask, &json!(5), 62), json!([one]));
        let found = json!({ "keypoints": { "nose": [3.5, 4, 1] } });
        let person = coco(&found, &json!(5), Some(&mask)).unwrap();
        assert_eq!((&person[0]["segmentation"], person[0].get("bbox")), (&runs, None));
    }
}
