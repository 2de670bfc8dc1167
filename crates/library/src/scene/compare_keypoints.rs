//! The likelihood of detected joints given a view: its projected landmarks are compared
//! with the detections.
//!
//! A thin layer over [`pcadlang_scene::vision::keypoints`]: here landmarks become positions in
//! pixels of the picture in which the joints were detected.

use super::adjoints::BySolid;
use super::compare::{
    SECTION, SEEN, by_view, likelihood, observation, same_shape, unsuitable, view,
};
use super::observed::KeypointsValue;
use super::{ViewValue, incremental};
use glam::DVec3;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{
    Args, Default, Domain, PreviousEvaluation, Row, State, Type, arg, flag, num, word,
};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Likelihood, Located, Value};
use pcadlang_numerics::rng::Stream;
use pcadlang_scene::geom::Landmark;
use pcadlang_scene::render::{Camera, View};
use pcadlang_scene::vision::keypoints::{
    Detection, DetectionConstants, KeypointLikelihood, KeypointOptions, Keypoints, Unit, matching,
};
use pcadlang_syntax::diag::nearest;
use std::sync::{Arc, Mutex, PoisonError};

pub(super) const TABLE: &[Row] = &[incremental(
    "keypoints",
    SECTION,
    &[
        SEEN,
        arg(
            "sd",
            Type::Any,
            "The standard deviation of an inlier detection along each axis: a number, or a record \
             of numbers by joint, with `other` for the rest.",
        )
        .or(Default::Num(1.5))
        .positive()
        .unit("percent of the diagonal"),
        num("outlier", 0.05, "The fraction of outliers among detections of full confidence.")
            .within(Domain::Between01),
        num(
            "offset",
            0.0,
            "The standard deviation of a joint about its position in \
                                       the scene, along each axis, since bodies differ.",
        )
        .within(Domain::NotNegative)
        .unit("percent of the diagonal"),
        word(
            "unit",
            &["diagonal", "torso"],
            "The unit of `sd`, `offset` and `systematic`: \"diagonal\", percent of the picture's \
             diagonal; \"torso\", lengths of the detected torso.",
        ),
        flag("confidence", "Whether detections of low confidence are more often outliers.")
            .or(Default::Bool(true)),
        num(
            "misses",
            0.0,
            "The fraction of joints whose position in the scene is \
                                       further off, with 8 times the standard deviation.",
        )
        .within(Domain::Below1),
        num(
            "systematic",
            0.0,
            "The standard deviation of the error common to detector and scene: it widens the \
             reported uncertainty of joints, not the density.",
        )
        .within(Domain::NotNegative)
        .unit("percent of the diagonal"),
    ],
    Type::Likelihood,
    "The density of detected joints: each near its landmark, or an outlier anywhere in the \
     picture; undetected joints are ignored.",
    keypoints,
)
.vjp(|_, _, by| Some(by_view(by.clone(), 7)))];

fn keypoints(a: &Args, previous: Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> {
    let unit = if a.word("unit")? == "torso" { Unit::Torso } else { Unit::Diagonal };
    let (sd, by_joint) = spreads(a)?;
    let options = KeypointOptions {
        sd,
        outlier: a.num("outlier")?,
        offset: a.num("offset")?,
        unit,
        misses: a.num("misses")?,
        systematic: a.num("systematic")?,
    };
    let kept = previous.and_then(|p| Arc::clone(&p.state).downcast::<Kept>().ok());
    let kept = kept.unwrap_or_default();
    let value = likelihood(KeypointsOf {
        view: view(a)?,
        model: Model { options, by_joint, confident: a.bool("confidence")? },
        kept: Arc::clone(&kept),
    })?;
    Ok((value, kept))
}

#[derive(Debug)]
struct KeypointsOf {
    view: Arc<View>,
    model: Model,
    kept: Arc<Kept>,
}

/// The arguments besides the view.
#[derive(Clone, Debug, PartialEq)]
struct Model {
    options: KeypointOptions,
    by_joint: ByJoint,
    /// The confidence of detections is used.
    confident: bool,
}

/// Shared by the likelihoods of one node of a trace: the detections with their landmarks
/// and models, which stay the same while the scene moves.
type Kept = Mutex<Option<Arc<Matched>>>;

/// Detections matched to the landmarks of a scene.
#[derive(Debug)]
struct Matched {
    observed: Value,
    model: Model,
    /// The width and height of the camera's picture.
    camera: (u32, u32),
    /// The names of the landmarks.
    names: Vec<Arc<str>>,
    /// The width and height of the picture in which joints were detected.
    size: (u32, u32),
    /// The length of the detected torso, in pixels of that picture.
    torso: f64,
    terms: Vec<MatchedTerm>,
}

/// One detection, the index of its landmark, and the model of its error.
#[derive(Debug)]
struct MatchedTerm {
    model: Arc<KeypointLikelihood>,
    seen: Detection,
    constants: DetectionConstants,
    landmark: usize,
    point: usize,
}

/// Joints with individual standard deviations.
type ByJoint = Vec<(Arc<str>, f64)>;

/// Reads the default standard deviation, and those of individual joints.
fn spreads(a: &Args) -> Result<(f64, ByJoint), Fault> {
    let Value::Record(record) = a.get("sd") else { return Ok((a.num("sd")?, Vec::new())) };
    let positive = |v: &Value| match v {
        Value::Num(x) if *x > 0.0 && x.is_finite() => Ok(*x),
        v => Err(a.element_wrong("sd", "a positive number, or a record of them with `other`", v)),
    };
    let Some(other) = record.get("other") else {
        return Err(Fault::type_error(
            "scene.keypoints: the record `sd` needs a field `other` for the rest of the joints",
        ));
    };
    let named = record.iter().filter(|(name, _)| &***name != "other");
    let named = named
        .map(|(name, v)| Ok((Arc::clone(name), positive(v)?)))
        .collect::<Result<_, Fault>>()?;
    Ok((positive(other)?, named))
}

/// Projects a landmark into a picture of this size; `None` if it is behind the camera.
fn project(l: &Landmark, camera: &Camera, (width, height): (u32, u32)) -> Option<[f64; 2]> {
    let (x, y, depth) = camera.project(l.position);
    let (sx, sy) =
        (f64::from(width) / f64::from(camera.width), f64::from(height) / f64::from(camera.height));
    (depth > Camera::NEAR && x.is_finite() && y.is_finite()).then_some([x * sx, y * sy])
}

impl ViewValue {
    /// Returns the landmarks of its solid, each with its position in a picture of this
    /// size (pixels); `None` for those behind the camera.
    pub fn landmarks(
        &self,
        width: u32,
        height: u32,
    ) -> impl Iterator<Item = (&Arc<str>, Option<[f64; 2]>)> {
        let camera = self.0.camera();
        self.0
            .solid()
            .landmarks()
            .iter()
            .map(move |l| (&l.name, project(l, camera, (width, height))))
    }
}

impl Likelihood for KeypointsOf {
    fn name(&self) -> &'static str {
        "scene.keypoints"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let mut sum = 0.0;
        self.each(observed, |term| {
            sum += term.model.log_density_with(term.constants, term.seen, term.joint)
        })?;
        Ok(sum)
    }

    /// Draws positions for the detected joints, with the same confidence. A detection
    /// without a landmark in the scene stays as observed.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, Fault>> {
        let KeypointsValue(seen) = observed.downcast::<KeypointsValue>()?;
        let mut points = seen.points().to_vec();
        let mut torso = 0.0;
        let drawn = self.each(observed, |t| {
            let at = t.model.sample(t.seen, t.joint, rng);
            let [w, h] = if seen.is_normalised() { [t.size.0, t.size.1] } else { [1.0; 2] };
            torso = t.torso;
            if let (Some(p), Some((first, rest))) = (points.get_mut(t.point), at.split_first()) {
                (p.x, p.y) = (first[0] / w, first[1] / h);
                p.others
                    .iter_mut()
                    .zip(rest)
                    .for_each(|(o, at)| (o.x, o.y) = (at[0] / w, at[1] / h));
            }
        });
        // The unit of length stays the same, wherever the shoulders and hips were drawn.
        let moved = || seen.moved(&points);
        Some(drawn.map(|()| {
            Value::object(KeypointsValue(if torso > 0.0 {
                moved().with_torso(torso)
            } else {
                moved()
            }))
        }))
    }

    /// The detected landmarks, at positions that combine those of the scene and of the
    /// detector.
    fn located(&self, observed: &Value) -> Vec<Located> {
        let mut all = Vec::new();
        let landmarks = self.view.solid().landmarks();
        let add = |term: Term| {
            let Some(joint) = term.joint else { return };
            let (at, variance) = term.model.located(term.seen, joint);
            let seen = term.model.meant(term.seen, joint);
            let (width, height) = term.size;
            all.push(Located {
                name: Arc::clone(&landmarks[term.landmark].name),
                at: [at[0] / width, at[1] / height],
                variance: variance / (width * width + height * height),
                observed: [seen[0] / width, seen[1] / height],
                own: [joint[0] / width, joint[1] / height],
                own_variance: term.model.systematic_variance() / (width * width + height * height),
            });
        };
        // A value that cannot be compared has already failed in `log_density`.
        let _ = self.each(observed, add);
        all
    }

    /// With respect to the view.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let (camera, landmarks) = (self.view.camera(), self.view.solid().landmarks());
        let mut all = vec![DVec3::ZERO; landmarks.len()];
        let add = |term: Term| {
            let Some(joint) = term.joint else { return };
            let by = term.model.gradient_with(term.constants, term.seen, joint);
            let by = [by[0] * term.scale[0], by[1] * term.scale[1]];
            all[term.landmark] += camera.vjp_point(landmarks[term.landmark].position, by);
        };
        self.each(observed, add).ok()?;
        Some(BySolid { landmarks: all, vertices: Vec::new() }.into_adjoint())
    }
}

/// One detection and its landmark.
struct Term<'a> {
    model: &'a KeypointLikelihood,
    seen: &'a Detection,
    constants: &'a DetectionConstants,
    landmark: usize,
    /// The index of the detection.
    point: usize,
    /// The projected landmark, in pixels of the picture.
    joint: Option<[f64; 2]>,
    /// Pixels of the picture per pixel of the camera.
    scale: [f64; 2],
    /// The width and height of the picture.
    size: (f64, f64),
    /// The length of the detected torso, in pixels of the picture.
    torso: f64,
}

impl KeypointsOf {
    /// Calls a function for each detection whose landmark the scene has.
    fn each(&self, observed: &Value, mut f: impl FnMut(Term)) -> Result<(), Fault> {
        let (camera, landmarks) = (self.view.camera(), self.view.solid().landmarks());
        let matched = self.matched(observed)?;
        let size = matched.size;
        let whole = (f64::from(size.0), f64::from(size.1));
        let scale = [whole.0 / f64::from(camera.width), whole.1 / f64::from(camera.height)];
        for MatchedTerm { model, seen, constants, landmark, point } in &matched.terms {
            let Some(l) = landmarks.get(*landmark) else { continue };
            f(Term {
                model,
                seen,
                constants,
                landmark: *landmark,
                point: *point,
                joint: project(l, camera, size),
                scale,
                size: whole,
                torso: matched.torso,
            });
        }
        Ok(())
    }

    /// The detections with their landmarks, from the last evaluation if nothing but the
    /// positions of the landmarks has changed.
    fn matched(&self, observed: &Value) -> Result<Arc<Matched>, Fault> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let (camera, landmarks) = (self.view.camera(), self.view.solid().landmarks());
        let names = || landmarks.iter().map(|l| &l.name);
        let holds = |m: &&Arc<Matched>| {
            m.observed.same(observed)
                && m.camera == (camera.width, camera.height)
                && m.names.len() == landmarks.len()
                && m.names.iter().zip(names()).all(|(a, b)| Arc::ptr_eq(a, b) || a == b)
                && m.model == self.model
        };
        if let Some(matched) = kept.as_ref().filter(holds) {
            return Ok(Arc::clone(matched));
        }
        let KeypointsValue(seen) = observation(observed, self.name(), "keypoints")?;
        let size = seen.size().unwrap_or((camera.width, camera.height));
        let mut matched = Matched {
            observed: observed.clone(),
            model: self.model.clone(),
            camera: (camera.width, camera.height),
            names: names().cloned().collect(),
            size,
            torso: 0.0,
            terms: Vec::new(),
        };
        if !seen.is_empty() {
            same_shape(size, &self.view, "scene.keypoints")?;
            matched.torso = seen.torso(size);
            matched.terms = self.terms(seen, &matched)?;
        }
        Ok(Arc::clone(kept.insert(Arc::new(matched))))
    }

    fn terms(&self, seen: &Keypoints, matched: &Matched) -> Result<Vec<MatchedTerm>, Fault> {
        let Matched { size, torso, .. } = *matched;
        let names: Vec<&str> = matched.names.iter().map(|name| &**name).collect();
        let near =
            |name: &str, known: &[&str]| nearest(name, known.iter().copied()).map(str::to_owned);
        let found = matching(seen, &names, near).map_err(unsuitable(self.name()))?;
        let whole = (f64::from(size.0), f64::from(size.1));
        let model = |sd: f64| {
            let options = KeypointOptions { sd, ..self.model.options.clone() };
            KeypointLikelihood::new(whole.0, whole.1, torso.max(1e-3), &options)
                .map(Arc::new)
                .map_err(unsuitable(self.name()))
        };
        let usual = model(self.model.options.sd)?;
        let mut terms = Vec::with_capacity(found.len());
        for (point, (p, at)) in seen.points().iter().zip(found).enumerate() {
            let Some(landmark) = at else { continue };
            let mut detection = seen.detection(p, size);
            if !self.model.confident {
                detection.confidence = 1.0;
            }
            // A detection may have another name than its landmark: l_big_toe, l_foot_index.
            let spread = |of: &str| self.model.by_joint.iter().find(|(name, _)| **name == *of);
            let own = spread(&p.name).or_else(|| spread(names.get(landmark)?));
            let own = own.map(|(_, sd)| model(*sd)).transpose()?;
            let model = own.unwrap_or_else(|| Arc::clone(&usual));
            let constants = model.constants(&detection);
            terms.push(MatchedTerm { model, seen: detection, constants, landmark, point });
        }
        Ok(terms)
    }
}
