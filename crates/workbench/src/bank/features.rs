//! The features of a bank, computed from a rendered scene or from a run's observations.

use super::{BankError, command};
use pcadlang_engine::lang::value::Value;
use pcadlang_library::Model;
use pcadlang_library::scene::{ImageValue, KeypointsValue, ViewValue};
use pcadlang_report::pictures::shaded;
use pcadlang_scene::render::View;
use pcadlang_scene::vision::features::{self, Query};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The way in which features of a picture are computed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Features {
    /// Pooled distances to contours, and oriented histograms of contours.
    Contours {
        /// The longer side of the rendered picture, in pixels.
        size: u32,
    },
    /// The positions of landmarks.
    Keypoints {
        /// The names of the landmarks, in the order of the features; empty until a bank
        /// is made.
        names: Vec<String>,
    },
    /// Numbers that a command prints.
    Command {
        /// The command; `{png}` is replaced by the path of the picture's file.
        command: String,
        /// The longer side of the rendered picture, in pixels.
        size: u32,
    },
}

impl Features {
    /// Computes the features of a scene's picture.
    ///
    /// # Errors
    /// If a command fails, or the scene has no landmarks.
    pub fn of(&self, view: &Arc<View>) -> Result<Vec<f32>, BankError> {
        match self {
            Features::Contours { size } => {
                let contours = view.contours(*size);
                Ok(features::contour_features(&features::rendered(&contours.slice())))
            }
            Features::Keypoints { .. } => {
                let (width, height) = (view.camera().width, view.camera().height);
                let at: Vec<_> = ViewValue(Arc::clone(view))
                    .landmarks(width, height)
                    .map(|(_, at)| at)
                    .collect();
                match at.is_empty() {
                    true => Err(BankError::Observed(
                        "the scene has no landmarks; use other features".into(),
                    )),
                    false => Ok(features::keypoint_features(&at, width, height)),
                }
            }
            Features::Command { command, size } => {
                command::features(command, &shaded(&view.frame(*size)))
            }
        }
    }

    /// Returns the same features with the names of the scene's landmarks filled in.
    pub(super) fn named(self, view: &View) -> Features {
        match self {
            Features::Keypoints { .. } => {
                let names = view.solid().landmarks().iter().map(|l| l.name.to_string()).collect();
                Features::Keypoints { names }
            }
            other => other,
        }
    }
}

/// The observations of a run from which features can be computed.
#[derive(Clone, Debug, Default)]
pub struct Observed {
    image: Option<Value>,
    keypoints: Option<Value>,
}

impl Observed {
    /// Takes the first picture among the program's data, and the first set of keypoints
    /// that is not empty.
    pub fn of(model: &Model) -> Observed {
        // Data are constants of the program.
        let first =
            |fits: fn(&Value) -> bool| model.code().consts.iter().find(|v| fits(v)).cloned();
        Observed {
            image: first(|v| v.downcast::<ImageValue>().is_some()),
            keypoints: first(|v| v.downcast::<KeypointsValue>().is_some_and(|k| !k.0.is_empty())),
        }
    }

    /// Computes the features of the observed picture. `detector` is the command that the
    /// user allows to run, for banks whose features come from a command.
    ///
    /// # Errors
    /// If the observations that the features need are missing, or a command fails.
    pub fn query(&self, features: &Features, detector: Option<&str>) -> Result<Query, BankError> {
        let image = self.image.as_ref().and_then(|v| v.downcast::<ImageValue>());
        let missing = |what: &str| {
            BankError::Observed(format!("it is searched by {what}, but the run observes none"))
        };
        match features {
            Features::Contours { .. } => {
                let image = image.ok_or_else(|| missing("the contours of a picture"))?;
                Ok(Query::contours(&features::observed(
                    image.map().map_err(|f| BankError::Observed(f.message))?,
                )))
            }
            Features::Keypoints { names } => {
                let seen = self.keypoints.as_ref().and_then(|v| v.downcast::<KeypointsValue>());
                let seen = &seen.ok_or_else(|| missing("keypoints"))?.0;
                let size = match (seen.size().or(image.map(ImageValue::size)), seen.is_normalised())
                {
                    (Some(size), _) => size,
                    (None, true) => (1, 1),
                    (None, false) => {
                        let what = "the keypoints do not give the size of their picture; add \"width\" and \"height\"";
                        return Err(BankError::Observed(what.into()));
                    }
                };
                let find = |name: &String| seen.points().iter().find(|p| *p.name == **name);
                let at: Vec<_> =
                    names.iter().map(|n| find(n).map(|p| seen.position(p, size))).collect();
                if at.iter().all(Option::is_none) {
                    return Err(missing("keypoints present in the scene"));
                }
                let sure: Vec<f64> =
                    names.iter().map(|n| find(n).map_or(0.0, |p| p.confidence)).collect();
                Ok(Query::keypoints(&at, &sure, size.0, size.1))
            }
            Features::Command { command, size } => {
                if detector != Some(command) {
                    let what = format!(
                        "its features were computed by a command, which must be given again: --features-from '{command}'"
                    );
                    return Err(BankError::Observed(what));
                }
                let photo =
                    image.and_then(ImageValue::as_photo).ok_or_else(|| missing("a photograph"))?;
                Ok(Query::new(command::features(command, photo.shrunk(*size).rgb())?))
            }
        }
    }
}
