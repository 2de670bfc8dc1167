//! Likelihoods of observed pictures given a view.

use super::adjoints::BySolid;
use super::observed::{DepthValue, ImageValue, MaskValue};
use super::shared_tally::SharedTally;
use super::{VIEW, ViewValue, incremental, native};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{
    Arg, ArgAdjoints, Args, PreviousEvaluation, Row, State, Type, arg, opt,
};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Likelihood, Value};
use pcadlang_numerics::rng::Stream;
use pcadlang_scene::render::{Camera, Frame, View};
use pcadlang_scene::vision::chamfer::{self, Mode};
use pcadlang_scene::vision::contour_ratio;
use pcadlang_scene::vision::{
    Chamfer, ChamferOptions, ContourRatio, ContourRatioOptions, DepthLikelihood, DepthMap,
    DepthTally, MaskLikelihood, VisionError,
};
use std::cell::{OnceCell, RefCell};
use std::sync::Arc;

pub(super) const SECTION: &str = "Comparing";
pub(super) const SEEN: Arg = arg("view", VIEW, "The view.");
pub(super) const SIZE: Arg =
    opt("size", Type::Int, "128", "The longer side of the rendered picture, 8 to 4096.")
        .unit("pixels");

pub(super) const TABLE: &[Row] = &[
    incremental(
        "contour",
        SECTION,
        &[
            SEEN,
            SIZE,
            opt("foreground", Type::Num, "0.75", "The fraction of rendered contour that produces an observed edge."),
            opt("sd", Type::Num, "0.4", "The standard deviation of its distance to that edge.")
                .unit("percent of the diagonal"),
            opt("truncate", Type::Num, "3.3", "The distance beyond which an edge is not matched.")
                .unit("percent of the diagonal"),
            opt("credit", Type::Num, "2", "The number of times that one observed edge can be matched."),
            opt(
                "weight",
                Type::Num,
                "0.5",
                "The power of the likelihood ratio per two pixels of contour, in a picture of 256 pixels.",
            ),
        ],
        Type::Likelihood,
        "The likelihood ratio of the observed contours: object against clutter. The default for photographs.",
        contour,
    )
    .vjp(|_, _, by| Some(by_view(by.clone(), 6))),
    incremental(
        "chamfer",
        SECTION,
        &[
            SEEN,
            opt("sigma", Type::Num, "0.4", "The standard deviation of the distance.").unit("percent of the diagonal"),
            opt(
                "mode",
                Type::Str,
                "\"mean\"",
                "\"mean\": one term for the mean distance, as in the paper; \"sum\": one term per percent of contour.",
            ),
            opt("symmetric", Type::Bool, "false", "Also measures from the observed to the rendered contours."),
            opt("truncate", Type::Num, "none", "Truncates distances at this value.").unit("percent of the diagonal"),
            opt("oriented", Type::Num, "none", "The distance equivalent to an orientation difference of one radian.")
                .unit("percent of the diagonal"),
            SIZE,
        ],
        Type::Likelihood,
        "The probabilistic chamfer distance of Kulkarni et al. 2014, section 2(c): an \
         unnormalised score, not a density over photographs.",
        chamfer,
    )
    .vjp(|_, _, by| {
        let mut pulled = by_view(by.element(0), 6);
        pulled[1] = by.element(1);
        Some(pulled)
    }),
    native(
        "mask",
        SECTION,
        &[
            SEEN,
            opt("eps_in", Type::Num, "0.05", "The probability that an object pixel is observed as background."),
            opt("eps_out", Type::Num, "0.05", "The probability that a background pixel is observed as object."),
            SIZE,
            opt("partial", Type::Bool, "false", "Whether pixels that the object covers in part count in part. The score is then nearly continuous, as Hamiltonian kernels need it."),
        ],
        Type::Likelihood,
        "The probability of an observed mask: pixels flip independently.",
        |a| {
            let (eps_in, eps_out) = (a.num_or(1, 0.05)?, a.num_or(2, 0.05)?);
            let partial = a.bool_or(4, false)?;
            let (view, size) = (view(a)?, size(a, 3)?);
            likelihood(MaskOf { view, size, eps: [eps_in, eps_out], partial })
        },
    )
    .vjp(|_, _, by| Some(by_view(by.clone(), 4))),
    incremental(
        "depth",
        SECTION,
        &[
            SEEN,
            opt("sd", Type::Num, "0.05", "The standard deviation of measured depths.").unit("scene units"),
            opt("outlier", Type::Num, "0.05", "The fraction of outliers."),
            opt("near", Type::Num, "0", "The minimum depth of an outlier.").unit("scene units"),
            opt("far", Type::Num, "100", "The maximum depth of an outlier.").unit("scene units"),
            SIZE,
        ],
        Type::Likelihood,
        "The density of an observed depth map: normal about the rendered depth, with outliers; \
         missing pixels are ignored.",
        |a, previous| {
            let options = [a.positive_or(1, 0.05)?, a.num_or(2, 0.05)?, a.num_or(3, 0.0)?, a.num_or(4, 100.0)?];
            let tally = SharedTally::after(previous);
            let value = likelihood(DepthOf { view: view(a)?, size: size(a, 5)?, options, tally: Arc::clone(&tally) })?;
            Ok((value, tally))
        },
    )
    .vjp(|_, _, by| Some(by_view(by.clone(), 5))),
];

/// Describes the approximations in rendering.
pub(super) fn drawn(size: u32) -> String {
    format!("rendered at {size} pixels in single precision")
}

pub(super) fn likelihood(l: impl Likelihood + 'static) -> Result<Value, Fault> {
    Ok(Value::Likelihood(Arc::new(l)))
}

pub(super) fn view(a: &Args) -> Result<Arc<View>, Fault> {
    a.object::<ViewValue>(0, "a view").map(|v| Arc::clone(&v.0))
}

pub(super) fn size(a: &Args, i: usize) -> Result<u32, Fault> {
    if a.given(i) { a.int_in(i, 8, 4096).map(|n| n as u32) } else { Ok(128) }
}

fn optional(a: &Args, i: usize) -> Result<Option<f64>, Fault> {
    if a.given(i) { a.num(i).map(Some) } else { Ok(None) }
}

fn contour(a: &Args, previous: Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> {
    let d = ContourRatioOptions::default();
    let options = ContourRatioOptions {
        foreground: a.num_or(2, d.foreground)?,
        sd: a.num_or(3, d.sd)?,
        truncate: a.num_or(4, d.truncate)?,
        credit: a.num_or(5, d.credit)?,
        weight: a.num_or(6, d.weight)?,
        ..d
    };
    let tally = SharedTally::after(previous);
    let value = likelihood(ContourOf {
        view: view(a)?,
        size: size(a, 1)?,
        options,
        tally: Arc::clone(&tally),
    })?;
    Ok((value, tally))
}

fn chamfer(a: &Args, previous: Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> {
    let mode = match a.choice(2, &["mean", "sum"])? {
        "sum" => Mode::Sum,
        _ => Mode::Mean,
    };
    let options = ChamferOptions {
        sigma: a.positive_or(1, ChamferOptions::default().sigma)?,
        mode,
        symmetric: a.bool_or(3, false)?,
        truncate: optional(a, 4)?,
        oriented: optional(a, 5)?,
    };
    let tally = SharedTally::after(previous);
    let value = likelihood(ChamferOf {
        view: view(a)?,
        size: size(a, 6)?,
        options,
        tally: Arc::clone(&tally),
    })?;
    Ok((value, tally))
}

/// The adjoints of a likelihood's arguments: `by` for the view, unknown for `others`
/// more.
pub(super) fn by_view(by: Adjoint, others: usize) -> ArgAdjoints {
    std::iter::once(by).chain((0..others).map(|_| Adjoint::Unknown)).collect()
}

/// The adjoint of the view, given derivatives with respect to the pieces of its contours.
pub(crate) fn by_contours(view: &View, size: u32, by_piece: &[[f64; 4]]) -> Adjoint {
    BySolid { landmarks: Vec::new(), vertices: view.vjp_contours(size, by_piece) }.into_adjoint()
}

/// The adjoint of the view, given derivatives with respect to the coverage of each pixel.
pub(crate) fn by_silhouette(view: &View, size: u32, gains: &[f64]) -> Adjoint {
    BySolid { landmarks: Vec::new(), vertices: view.vjp_mask(size, gains) }.into_adjoint()
}

/// Returns the observed image, if its aspect ratio matches that of the view's picture.
pub(super) fn image<'a>(
    observed: &'a Value,
    view: &View,
    what: &str,
) -> Result<&'a ImageValue, String> {
    let Some(image) = observed.downcast::<ImageValue>() else {
        return Err(format!(
            "{what}: the observed value must be an image, got {}",
            observed.type_name()
        ));
    };
    same_shape(image.size(), view, what)?;
    Ok(image)
}

pub(super) fn same_shape((w, h): (u32, u32), view: &View, what: &str) -> Result<(), String> {
    let (cw, ch) = (view.camera().width, view.camera().height);
    let (a, b) = (f64::from(w) * f64::from(ch), f64::from(h) * f64::from(cw));
    if (a - b).abs() > 0.03 * a.max(b) {
        return Err(format!(
            "{what}: the observed picture has {w} x {h} pixels, but the camera's has {cw} x {ch}: \
             the aspect ratios differ"
        ));
    }
    Ok(())
}

thread_local! {
    static RATIO: RefCell<contour_ratio::Scratch> = RefCell::default();
    static CHAMFER: RefCell<chamfer::Scratch> = RefCell::default();
}

#[derive(Debug)]
struct ContourOf {
    view: Arc<View>,
    size: u32,
    options: ContourRatioOptions,
    tally: Arc<SharedTally<ContourRatio, contour_ratio::Scratch>>,
}

impl ContourOf {
    /// Returns the comparator for the observed image at the rendered size.
    fn prepared(&self, observed: &Value) -> Result<Arc<ContourRatio>, String> {
        let image = image(observed, &self.view, self.name())?;
        let camera = self.view.camera().scaled_to(self.size);
        image.ratios.get((self.options.clone(), camera.width, camera.height), |(options, w, h)| {
            ContourRatio::prepare(image.map()?, *w, *h, options)
                .map_err(|e| format!("scene.contour: {e}"))
        })
    }
}

impl Likelihood for ContourOf {
    fn name(&self) -> &'static str {
        "scene.contour"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, String> {
        let (ratio, change) = (self.prepared(observed)?, self.view.change(self.size));
        let whole = OnceCell::new();
        let whole = || whole.get_or_init(|| self.view.contours(self.size)).slice();
        Ok(self.tally.with(&ratio, |tally| ratio.log_likelihood_after(&change, whole, tally)))
    }

    /// With respect to the view.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let (ratio, contours) = (self.prepared(observed).ok()?, self.view.contours(self.size));
        let mut by_piece = Vec::new();
        RATIO.with_borrow_mut(|scratch| ratio.gradient(&contours.slice(), scratch, &mut by_piece));
        Some(by_contours(&self.view, self.size, &by_piece))
    }

    fn is_proper(&self) -> bool {
        false
    }

    fn approximations(&self) -> Vec<String> {
        let cut =
            format!("edges beyond {}% of the diagonal are not matched", self.options.truncate);
        vec![drawn(self.size), cut]
    }
}

#[derive(Debug)]
struct ChamferOf {
    view: Arc<View>,
    size: u32,
    options: ChamferOptions,
    tally: Arc<SharedTally<Chamfer, chamfer::Tally>>,
}

impl ChamferOf {
    /// Returns the comparator for the observed image at the rendered size.
    fn prepared(&self, observed: &Value) -> Result<Arc<Chamfer>, String> {
        let image = image(observed, &self.view, self.name())?;
        let camera = self.view.camera().scaled_to(self.size);
        image.chamfers.get(
            (self.options.clone(), camera.width, camera.height),
            |(options, w, h)| {
                Chamfer::prepare(image.map()?, *w, *h, options)
                    .map_err(|e| format!("scene.chamfer: {e}"))
            },
        )
    }
}

impl Likelihood for ChamferOf {
    fn name(&self) -> &'static str {
        "scene.chamfer"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, String> {
        let (chamfer, change) = (self.prepared(observed)?, self.view.change(self.size));
        let whole = OnceCell::new();
        let whole = || whole.get_or_init(|| self.view.contours(self.size)).slice();
        let score = |tally: &mut _| {
            CHAMFER.with_borrow_mut(|scratch| {
                chamfer.log_likelihood_after(&change, whole, tally, scratch)
            })
        };
        Ok(self.tally.with(&chamfer, score))
    }

    /// With respect to the view and sigma.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let (chamfer, contours) = (self.prepared(observed).ok()?, self.view.contours(self.size));
        let mut by_piece = Vec::new();
        let by_sigma = CHAMFER
            .with_borrow_mut(|scratch| chamfer.gradient(&contours.slice(), scratch, &mut by_piece));
        Some(Adjoint::List(vec![
            by_contours(&self.view, self.size, &by_piece),
            Adjoint::Num(by_sigma),
        ]))
    }

    fn is_proper(&self) -> bool {
        false
    }

    fn approximations(&self) -> Vec<String> {
        let cut = self
            .options
            .truncate
            .map(|t| format!("distances are truncated at {t}% of the diagonal"));
        let most = format!(
            "of more than {} observed points, an evenly spaced subset is used",
            chamfer::MOST_OBSERVED
        );
        [Some(drawn(self.size)), cut, self.options.symmetric.then_some(most)]
            .into_iter()
            .flatten()
            .collect()
    }
}

#[derive(Debug)]
struct MaskOf {
    view: Arc<View>,
    size: u32,
    eps: [f64; 2],
    /// Whether pixels are covered in part.
    partial: bool,
}

impl MaskOf {
    /// Returns the observed mask, prepared at the rendered size.
    fn prepared(&self, observed: &Value) -> Result<Arc<MaskLikelihood>, String> {
        let Some(mask) = observed.downcast::<MaskValue>() else {
            return Err(format!(
                "scene.mask: the observed value must be a mask, got {}",
                observed.type_name()
            ));
        };
        same_shape((mask.mask.width(), mask.mask.height()), &self.view, self.name())?;
        let Camera { width, height, .. } = self.view.camera().scaled_to(self.size);
        mask.prepared.get((self.eps, width, height), |([i, o], w, h)| {
            MaskLikelihood::new(&mask.mask, *i, *o)
                .map(|l| l.resized(*w, *h))
                .map_err(|e| format!("scene.mask: {e}"))
        })
    }

    fn rendered(&self) -> Vec<bool> {
        self.view.depth(self.size).mask().collect()
    }
}

impl Likelihood for MaskOf {
    fn name(&self) -> &'static str {
        "scene.mask"
    }

    fn approximations(&self) -> Vec<String> {
        vec![drawn(self.size)]
    }

    fn log_density(&self, observed: &Value) -> Result<f64, String> {
        let prepared = self.prepared(observed)?;
        let (width, height) = (prepared.observed().width(), prepared.observed().height());
        match self.partial {
            true => {
                let fractions = self.view.fractions(self.size);
                prepared.log_likelihood_coverage(&fractions, width, height)
            }
            false => prepared.log_likelihood(&self.rendered(), width, height),
        }
        .map_err(|e| format!("scene.mask: {e}"))
    }

    /// Draws a mask of the rendered size.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, String>> {
        let draw = |prepared: Arc<MaskLikelihood>| {
            let drawn = match self.partial {
                true => prepared.simulate_coverage(&self.view.fractions(self.size), rng),
                false => prepared.simulate(&self.rendered(), rng),
            };
            let drawn = drawn.map_err(|e| format!("scene.mask: {e}"))?;
            Ok(Value::object(MaskValue::new(drawn)))
        };
        Some(self.prepared(observed).and_then(draw))
    }

    fn has_steps(&self) -> bool {
        !self.partial
    }

    /// With respect to the view.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let prepared = self.prepared(observed).ok()?;
        if !self.partial {
            return Some(by_silhouette(&self.view, self.size, &prepared.gains()));
        }
        let gains = prepared.gains_coverage(&self.view.fractions(self.size));
        let vertices = self.view.vjp_fractions(self.size, &gains);
        Some(BySolid { landmarks: Vec::new(), vertices }.into_adjoint())
    }
}

#[derive(Debug)]
struct DepthOf {
    view: Arc<View>,
    size: u32,
    options: [f64; 4],
    tally: Arc<SharedTally<DepthLikelihood, DepthTally>>,
}

impl DepthOf {
    /// Returns the observed depths, prepared at the rendered size, and the rendered
    /// frame.
    fn prepared(&self, observed: &Value) -> Result<(Arc<DepthLikelihood>, Arc<Frame>), String> {
        let Some(depth) = observed.downcast::<DepthValue>() else {
            return Err(format!(
                "scene.depth: the observed value must be a depth map, got {}",
                observed.type_name()
            ));
        };
        same_shape((depth.depth.width(), depth.depth.height()), &self.view, "scene.depth")?;
        let frame = self.view.depth(self.size);
        let prepared = depth.prepared.get(
            (self.options, frame.width, frame.height),
            |([sd, outlier, near, far], w, h)| {
                let whole = DepthLikelihood::new(&depth.depth, *sd, *outlier, (*near, *far));
                whole.map(|l| l.resized(*w, *h)).map_err(|e| format!("scene.depth: {e}"))
            },
        )?;
        Ok((prepared, frame))
    }
}

impl Likelihood for DepthOf {
    fn name(&self) -> &'static str {
        "scene.depth"
    }

    fn approximations(&self) -> Vec<String> {
        vec![drawn(self.size)]
    }

    fn log_density(&self, observed: &Value) -> Result<f64, String> {
        let (prepared, frame) = self.prepared(observed)?;
        let Frame { depth, width, height, .. } = &*frame;
        self.tally
            .with(&prepared, |tally| prepared.log_likelihood_after(depth, *width, *height, tally))
            .map_err(|e| format!("scene.depth: {e}"))
    }

    /// Draws a depth map of the rendered size; pixels missing in the observed one stay
    /// missing.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, String>> {
        let wrong = |e: VisionError| format!("scene.depth: {e}");
        let draw = |(prepared, frame): (Arc<DepthLikelihood>, Arc<Frame>)| {
            let mut drawn = prepared.simulate(&frame.depth, rng).map_err(wrong)?;
            let missing = prepared.observed().data().iter().map(|d| d.is_nan());
            drawn.iter_mut().zip(missing).filter(|(_, m)| *m).for_each(|(d, _)| *d = f32::NAN);
            let map = DepthMap::new(frame.width, frame.height, drawn).map_err(wrong)?;
            Ok(Value::object(DepthValue::new(map)))
        };
        Some(self.prepared(observed).and_then(draw))
    }

    fn has_steps(&self) -> bool {
        true
    }

    /// With respect to the view.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let (prepared, frame) = self.prepared(observed).ok()?;
        let mut vertices = self.view.vjp_depth(self.size, &prepared.slopes(&frame.depth));
        let outline = self.view.vjp_mask(self.size, &prepared.gains(&frame.depth));
        vertices.iter_mut().zip(outline).for_each(|(v, o)| *v += o);
        Some(BySolid { landmarks: Vec::new(), vertices }.into_adjoint())
    }
}
