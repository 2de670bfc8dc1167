//! The likelihood of relative depths: the depths of a person's landmarks relative to the
//! hips, as estimated by a network.

use super::adjoints::BySolid;
use super::compare::{SECTION, SEEN, by_view, likelihood, view};
use super::native;
use glam::DVec3;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{Row, Type, arg, num};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Likelihood, Value};
use pcadlang_numerics::rng::Stream;
use pcadlang_scene::geom::Landmark;
use pcadlang_scene::render::View;
use pcadlang_scene::vision::keypoints::RelativeDepthLikelihood;
use std::sync::Arc;

pub(super) const TABLE: &[Row] = &[native(
    "relative_depth",
    SECTION,
    &[
        SEEN,
        arg("scale", Type::Num, "The length of a metre: the scale of the body.")
            .positive()
            .unit("scene units"),
        num(
            "share",
            1.0,
            "The fraction of the true depth that the network reports: \
                                      from a single picture it underestimates depth.",
        )
        .positive(),
        num("sd", 0.1, "The standard deviation of an inlier depth.").positive().unit("metres"),
        num("outlier", 0.05, "The fraction of outliers."),
    ],
    Type::Likelihood,
    "The density of landmark depths relative to the mid-hip, as estimated by a network from a \
     single picture: the third number of each point [right, down, away] in a record, in metres, \
     such as `metres` of `scene.people`. Names that the scene lacks are ignored.",
    |a| {
        let (sd, outlier) = (a.num("sd")?, a.num("outlier")?);
        let model = RelativeDepthLikelihood::new(sd, outlier).map_err(|_| match sd < 1e9 {
            true => a.outside("outlier", "strictly between 0 and 1"),
            false => a.outside("sd", "less than 1e9"),
        })?;
        let (scale, share) = (a.num("scale")?, a.num("share")?);
        likelihood(RelativeDepthOf { view: view(a)?, scale, share, model })
    },
)
.vjp(|_, _, by| {
    let mut pulled = by_view(by.element(0), 4);
    pulled[1] = by.element(1);
    Some(pulled)
})];

#[derive(Debug)]
struct RelativeDepthOf {
    view: Arc<View>,
    /// Scene units per metre.
    scale: f64,
    /// The fraction of the true depth that the network reports.
    share: f64,
    model: RelativeDepthLikelihood,
}

/// One observed depth and its landmark.
struct Term<'a> {
    name: &'a Arc<str>,
    point: &'a [f64],
    /// The landmark's index in the solid, and the depth that the network is expected to
    /// report for it: relative to the mid-hip, in metres, times `share`.
    landmark: usize,
    depth: f64,
}

impl RelativeDepthOf {
    /// Returns the indices of the two hip landmarks.
    fn hips(&self, landmarks: &[Landmark]) -> Result<[usize; 2], Fault> {
        let find = |name: &str| landmarks.iter().position(|l| &*l.name == name);
        find("l_hip").zip(find("r_hip")).map(|(l, r)| [l, r]).ok_or_else(|| {
            Fault::type_error(
                "scene.relative_depth: depths are relative to the mid-hip, but the scene has no \
                 landmarks `l_hip` and `r_hip`",
            )
        })
    }

    fn each<'a>(&self, observed: &'a Value, mut f: impl FnMut(Term<'a>)) -> Result<(), Fault> {
        let Value::Record(points) = observed else {
            return Err(Fault::type_error(format!(
                "scene.relative_depth: the observed value must be a record of points [right, down, away], got {}",
                observed.type_name()
            )));
        };
        let landmarks = self.view.solid().landmarks();
        let hips = self.hips(landmarks)?;
        let along = |i: usize| {
            (landmarks[i].position - self.view.camera().eye).dot(self.view.camera().forward)
        };
        let middle = 0.5 * (along(hips[0]) + along(hips[1]));
        for (name, point) in points.iter() {
            let point = match point {
                Value::Array(p) if p.len() == 3 && p.iter().all(|x| x.is_finite()) => p,
                other => {
                    return Err(Fault::type_error(format!(
                        "scene.relative_depth: `{name}` must be three numbers [right, down, away], got {}",
                        other.type_name()
                    )));
                }
            };
            let Some(landmark) = landmarks.iter().position(|l| l.name == *name) else { continue };
            let depth = self.share * (along(landmark) - middle) / self.scale;
            f(Term { name, point, landmark, depth });
        }
        Ok(())
    }
}

impl Likelihood for RelativeDepthOf {
    fn name(&self) -> &'static str {
        "scene.relative_depth"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let mut sum = 0.0;
        self.each(observed, |t| sum += self.model.log_density(t.point[2], t.depth))?;
        Ok(sum)
    }

    /// Draws depths of the landmarks in the scene; the other landmarks, and the numbers
    /// to the right and down, stay as observed.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, Fault>> {
        let Value::Record(points) = observed else { return None };
        let mut drawn = (**points).clone();
        let each = self.each(observed, |t| {
            let away = self.model.sample(t.depth, rng);
            drawn.insert(Arc::clone(t.name), Value::array(vec![t.point[0], t.point[1], away]));
        });
        Some(each.map(|()| Value::Record(Arc::new(drawn))))
    }

    /// With respect to the view and the scale.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let landmarks = self.view.solid().landmarks();
        let hips = self.hips(landmarks).ok()?;
        let toward = self.view.camera().forward * (self.share / self.scale);
        let mut all = vec![DVec3::ZERO; landmarks.len()];
        let mut by_scale = 0.0;
        let add = |t: Term| {
            let slope = self.model.slope(t.point[2], t.depth);
            all[t.landmark] += toward * slope;
            hips.iter().for_each(|h| all[*h] -= toward * (0.5 * slope));
            by_scale -= slope * t.depth / self.scale;
        };
        self.each(observed, add).ok()?;
        let by_view = BySolid { landmarks: all, vertices: Vec::new() }.into_adjoint();
        Some(Adjoint::List(vec![by_view, Adjoint::Num(by_scale)]))
    }
}
