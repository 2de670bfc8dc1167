//! The likelihood of detected joints given a view: its landmarks projected, compared with where a detector found them.
//!
//! A thin layer over [`crate::vision::keypoints`]: here landmarks become positions in pixels of the picture that the
//! detections belong to.

use super::adjoints::BySolid;
use super::compare::{SECTION, SEEN, likelihood, same_shape, view};
use super::observed::KeypointsValue;
use super::{ViewValue, native};
use crate::diag::nearest;
use crate::geom::Landmark;
use crate::lang::adjoint::Adjoint;
use crate::lang::builtins::{Row, Type, opt};
use crate::lang::value::{Likelihood, Located, Value};
use crate::render::{Camera, View};
use crate::rng::Stream;
use crate::vision::keypoints::{KeypointLikelihood, KeypointOptions, matching};
use glam::DVec3;
use smallvec::smallvec;
use std::sync::Arc;

pub(super) const TABLE: &[Row] = &[native(
    "keypoints",
    SECTION,
    &[
        SEEN,
        opt("sd", Type::Num, "1.5", "The spread of a good detection along each axis.").unit("percent of the diagonal"),
        opt("outlier", Type::Num, "0.05", "The share of detections of full confidence that are off."),
        opt("offset", Type::Num, "0", "The spread of a joint about where the scene has it, along each axis: bodies differ.")
            .unit("percent of the diagonal"),
    ],
    Type::Likelihood,
    "The density of detected joints: each near its landmark or anywhere in the picture; what was not found says nothing.",
    |a| {
        let (sd, outlier, offset) = (a.positive_or(1, 1.5)?, a.num_or(2, 0.05)?, a.num_or(3, 0.0)?);
        let options = KeypointOptions { sd, outlier, offset };
        if !(options.outlier > 0.0 && options.outlier < 1.0) {
            return Err(a.outside(2, "strictly between 0 and 1"));
        }
        if !(options.offset >= 0.0 && options.offset.is_finite()) {
            return Err(a.outside(3, "not negative and finite"));
        }
        likelihood(KeypointsOf { view: view(a)?, options })
    },
)
.pull(|_, _, by| Some(smallvec![by.clone(), Adjoint::Unknown, Adjoint::Unknown, Adjoint::Unknown]))];

#[derive(Debug)]
struct KeypointsOf {
    view: Arc<View>,
    options: KeypointOptions,
}

/// Where a landmark is in a picture of some size; none behind the camera.
fn project(l: &Landmark, camera: &Camera, (width, height): (u32, u32)) -> Option<[f64; 2]> {
    let (x, y, depth) = camera.project(l.position);
    let (sx, sy) = (f64::from(width) / f64::from(camera.width), f64::from(height) / f64::from(camera.height));
    (depth > Camera::NEAR && x.is_finite() && y.is_finite()).then_some([x * sx, y * sy])
}

impl ViewValue {
    /// The landmarks of its solid, each with its place in a picture of this size (pixels): none of those behind the camera.
    pub fn landmarks(&self, width: u32, height: u32) -> impl Iterator<Item = (&Arc<str>, Option<[f64; 2]>)> {
        let camera = self.0.camera();
        self.0.solid().landmarks().iter().map(move |l| (&l.name, project(l, camera, (width, height))))
    }
}

impl Likelihood for KeypointsOf {
    fn name(&self) -> &'static str {
        "scene.keypoints"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, String> {
        let mut sum = 0.0;
        self.each(observed, |term| sum += term.model.log_density(term.seen, term.confidence, term.joint))?;
        Ok(sum)
    }

    /// Detections of the joints that were detected, with the same confidence. One that is of no landmark stays.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, String>> {
        let KeypointsValue(seen) = observed.downcast::<KeypointsValue>()?;
        let mut points = seen.points().to_vec();
        let drawn = self.each(observed, |t| {
            let at = t.model.sample(t.confidence, t.joint, rng);
            let [w, h] = if seen.is_normalised() { [t.size.0, t.size.1] } else { [1.0; 2] };
            if let Some(p) = points.get_mut(t.point) {
                (p.x, p.y) = (at[0] / w, at[1] / h);
            }
        });
        Some(drawn.map(|()| Value::object(KeypointsValue(seen.moved(&points)))))
    }

    /// The landmarks that were detected, between where the scene has them and where they were seen.
    fn located(&self, observed: &Value) -> Vec<Located> {
        let mut all = Vec::new();
        let landmarks = self.view.solid().landmarks();
        let add = |term: Term| {
            let Some(joint) = term.joint else { return };
            let (at, variance) = term.model.located(term.seen, term.confidence, joint);
            let (width, height) = term.size;
            all.push(Located {
                name: Arc::clone(&landmarks[term.landmark].name),
                at: [at[0] / width, at[1] / height],
                variance: variance / (width * width + height * height),
            });
        };
        // What cannot be compared has failed before.
        let _ = self.each(observed, add);
        all
    }

    /// By the view.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let (camera, landmarks) = (self.view.camera(), self.view.solid().landmarks());
        let mut all = vec![DVec3::ZERO; landmarks.len()];
        let add = |term: Term| {
            let Some(joint) = term.joint else { return };
            let by = term.model.gradient(term.seen, term.confidence, joint);
            let by = [by[0] * term.scale[0], by[1] * term.scale[1]];
            all[term.landmark] += camera.pull_point(landmarks[term.landmark].position, by);
        };
        self.each(observed, add).ok()?;
        Some(BySolid { landmarks: all, vertices: Vec::new() }.into_adjoint())
    }
}

/// One detection and the landmark it is of.
struct Term<'a> {
    model: &'a KeypointLikelihood,
    seen: [f64; 2],
    confidence: f64,
    landmark: usize,
    /// Which of the detections it is.
    point: usize,
    /// Where the landmark is, in pixels of the picture.
    joint: Option<[f64; 2]>,
    /// Pixels of the picture in one of the camera's.
    scale: [f64; 2],
    /// The width and height of the picture.
    size: (f64, f64),
}

impl KeypointsOf {
    fn each(&self, observed: &Value, mut f: impl FnMut(Term)) -> Result<(), String> {
        let Some(KeypointsValue(seen)) = observed.downcast::<KeypointsValue>() else {
            return Err(format!("scene.keypoints: the observed value must be keypoints, got {}", observed.type_name()));
        };
        if seen.is_empty() {
            return Ok(());
        }
        let (camera, landmarks) = (self.view.camera(), self.view.solid().landmarks());
        let size = seen.size().unwrap_or((camera.width, camera.height));
        same_shape(size, &self.view, "scene.keypoints")?;
        let names: Vec<&str> = landmarks.iter().map(|l| &*l.name).collect();
        let near = |name: &str, known: &[&str]| nearest(name, known.iter().copied()).map(str::to_owned);
        let found = matching(seen, &names, near).map_err(|e| format!("scene.keypoints: {e}"))?;
        let model = KeypointLikelihood::new(f64::from(size.0), f64::from(size.1), &self.options)
            .map_err(|e| format!("scene.keypoints: {e}"))?;
        let whole = (f64::from(size.0), f64::from(size.1));
        let scale = [f64::from(size.0) / f64::from(camera.width), f64::from(size.1) / f64::from(camera.height)];
        for (point, (p, at)) in seen.points().iter().zip(found).enumerate() {
            let Some((landmark, l)) = at.and_then(|i| Some((i, landmarks.get(i)?))) else { continue };
            let joint = project(l, camera, size);
            f(Term {
                model: &model,
                seen: seen.position(p, size),
                confidence: p.confidence,
                landmark,
                point,
                joint,
                scale,
                size: whole,
            });
        }
        Ok(())
    }
}
