//! Likelihoods of observed pictures given a view.

use super::adjoints::BySolid;
use super::observed::ImageValue;
use super::observed_maps::{DepthValue, MaskValue};
use super::{VIEW, ViewValue, incremental, native};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{
    Arg, ArgAdjoints, Args, PreviousEvaluation, Row, State, Type, arg, flag, int, num, opt, word,
};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::{Likelihood, Object, Value};
use pcadlang_numerics::rng::Stream;
use pcadlang_scene::render::{Camera, Channel, Frame, View};
use pcadlang_scene::vision::chamfer::{self, Mode};
use pcadlang_scene::vision::contour_ratio;
use pcadlang_scene::vision::{
    Chamfer, ChamferOptions, ContourRatio, ContourRatioOptions, DepthLikelihood, DepthMap,
    DepthTally, MaskLikelihood,
};
use std::cell::{OnceCell, RefCell};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

pub(super) const SECTION: &str = "Comparing";
pub(super) const SEEN: Arg = arg("view", VIEW, "The view.");
pub(super) const SIZE: Arg =
    int("size", 128, [8, 4096], "The longer side of the rendered picture.").unit("pixels");

const RATIO: ContourRatioOptions = ContourRatioOptions::USUAL;

pub(super) const TABLE: &[Row] = &[
    incremental(
        "contour",
        SECTION,
        &[
            SEEN,
            SIZE,
            num("foreground", RATIO.foreground, "The fraction of rendered contour that produces an observed edge."),
            num("sd", RATIO.sd, "The standard deviation of its distance to that edge.")
                .unit("percent of the diagonal"),
            num("truncate", RATIO.truncate, "The distance beyond which an edge is not matched.")
                .unit("percent of the diagonal"),
            num("credit", RATIO.credit, "The number of times that one observed edge can be matched."),
            num("weight", RATIO.weight, "The power of the likelihood ratio per two pixels of contour, in a picture of 256 pixels."),
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
            num("sigma", ChamferOptions::USUAL.sigma, "The standard deviation of the distance.").positive().unit("percent of the diagonal"),
            word("mode", &["mean", "sum"], "\"mean\": one term for the mean distance, as in the paper; \"sum\": one term per percent of contour."),
            flag("symmetric", "Also measures from the observed to the rendered contours."),
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
            num("eps_in", 0.05, "The probability that an object pixel is observed as background."),
            num("eps_out", 0.05, "The probability that a background pixel is observed as object."),
            SIZE,
            flag("partial", "Whether pixels that the object covers in part count in part. The score is then nearly continuous, as Hamiltonian kernels need it."),
        ],
        Type::Likelihood,
        "The probability of an observed mask: pixels flip independently.",
        |a| {
            let (eps, partial) = ([a.num("eps_in")?, a.num("eps_out")?], a.bool("partial")?);
            let channel = if partial { Channel::Fractions } else { Channel::Depth };
            let (view, size) = reading(a, channel)?;
            likelihood(MaskOf { view, size, eps, partial })
        },
    )
    .vjp(|_, _, by| Some(by_view(by.clone(), 4))),
    incremental(
        "depth",
        SECTION,
        &[
            SEEN,
            num("sd", 0.05, "The standard deviation of measured depths.").positive().unit("scene units"),
            num("outlier", 0.05, "The fraction of outliers."),
            num("near", 0.0, "The minimum depth of an outlier.").unit("scene units"),
            num("far", 100.0, "The maximum depth of an outlier.").unit("scene units"),
            SIZE,
        ],
        Type::Likelihood,
        "The density of an observed depth map: normal about the rendered depth, with outliers; \
         missing pixels are ignored.",
        |a, previous| {
            let options = [a.num("sd")?, a.num("outlier")?, a.num("near")?, a.num("far")?];
            let (view, size) = reading(a, Channel::Depth)?;
            tallying(previous, |tally| DepthOf { view, size, options, tally })
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

/// The view and the size of the picture that a comparator reads a channel of.
pub(super) fn reading(a: &Args, channel: Channel) -> Result<(Arc<View>, u32), Fault> {
    let (view, size) = (view(a)?, a.int("size")?);
    view.declare(channel, size);
    Ok((view, size))
}

/// Sums over the contours that stay, of the comparator that counted them last. Likelihoods
/// of one node of a trace share them, as their views share a canvas.
pub(super) struct SharedTally<C, T>(Mutex<(Option<Arc<C>>, T)>);

impl<C, T> fmt::Debug for SharedTally<C, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SharedTally")
    }
}

impl<C: Send + Sync + 'static, T: Default + Send + 'static> SharedTally<C, T> {
    /// The sums of the previous evaluation; new ones while another thread counts: forks that
    /// run side by side would disturb each other.
    pub fn after(previous: Option<&PreviousEvaluation>) -> Arc<SharedTally<C, T>> {
        let kept = previous.and_then(|p| Arc::clone(&p.state).downcast::<SharedTally<C, T>>().ok());
        kept.filter(|kept| !matches!(kept.0.try_lock(), Err(TryLockError::WouldBlock)))
            .unwrap_or_else(|| Arc::new(SharedTally(Mutex::default())))
    }

    /// Calls a function with the sums of a comparator, empty ones if they were of another
    /// one.
    pub fn with<R>(&self, comparator: &Arc<C>, f: impl FnOnce(&mut T) -> R) -> R {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !kept.0.as_ref().is_some_and(|of| Arc::ptr_eq(of, comparator)) {
            *kept = (Some(Arc::clone(comparator)), T::default());
        }
        f(&mut kept.1)
    }
}

/// A likelihood that shares the sums of the previous evaluation.
pub(super) fn tallying<C, T, L: Likelihood + 'static>(
    previous: Option<&PreviousEvaluation>,
    make: impl FnOnce(Arc<SharedTally<C, T>>) -> L,
) -> Result<(Value, State), Fault>
where
    C: Send + Sync + 'static,
    T: Default + Send + 'static,
{
    let tally = SharedTally::after(previous);
    Ok((likelihood(make(Arc::clone(&tally)))?, tally))
}

/// The fault of an observation that a comparator cannot use.
pub(super) fn unsuitable<E: fmt::Display>(comparator: &str) -> impl Fn(E) -> Fault {
    move |e| Fault::type_error(format!("{comparator}: {e}"))
}

/// Returns the observation, if it is of the type that a comparator takes.
pub(super) fn observation<'a, T: Object>(
    observed: &'a Value,
    comparator: &str,
    wanted: &str,
) -> Result<&'a T, Fault> {
    observed.downcast::<T>().ok_or_else(|| {
        let got = observed.type_name();
        Fault::type_error(format!("{comparator}: the observed value must be {wanted}, got {got}"))
    })
}

fn contour(a: &Args, previous: Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> {
    let options = ContourRatioOptions {
        foreground: a.num("foreground")?,
        sd: a.num("sd")?,
        truncate: a.num("truncate")?,
        credit: a.num("credit")?,
        weight: a.num("weight")?,
        ..RATIO
    };
    let (view, size) = reading(a, Channel::Contours)?;
    tallying(previous, |tally| ContourOf { view, size, options, tally })
}

fn chamfer(a: &Args, previous: Option<&PreviousEvaluation>) -> Result<(Value, State), Fault> {
    let options = ChamferOptions {
        sigma: a.num("sigma")?,
        mode: if a.word("mode")? == "sum" { Mode::Sum } else { Mode::Mean },
        symmetric: a.bool("symmetric")?,
        truncate: a.num_if_given("truncate")?,
        oriented: a.num_if_given("oriented")?,
    };
    let (view, size) = reading(a, Channel::Contours)?;
    tallying(previous, |tally| ChamferOf { view, size, options, tally })
}

/// The adjoints of a likelihood's arguments: `by` for the view, unknown for `others`
/// more.
pub(super) fn by_view(by: Adjoint, others: usize) -> ArgAdjoints {
    std::iter::once(by).chain((0..others).map(|_| Adjoint::Unknown)).collect()
}

/// The adjoint of the view, given derivatives with respect to the pieces of its contours.
pub(crate) fn by_contours(view: &View, size: u32, by_piece: &[[f64; 4]]) -> Adjoint {
    BySolid::of_all(view.vjp_contours(size, by_piece)).into_adjoint()
}

/// The adjoint of the view, given derivatives with respect to the coverage of each pixel.
pub(crate) fn by_silhouette(view: &View, size: u32, gains: &[f64]) -> Adjoint {
    BySolid::of_all(view.vjp_mask(size, gains)).into_adjoint()
}

/// Returns the observed image, if its aspect ratio matches that of the view's picture.
pub(super) fn image<'a>(
    observed: &'a Value,
    view: &View,
    comparator: &str,
) -> Result<&'a ImageValue, Fault> {
    let image: &ImageValue = observation(observed, comparator, "an image")?;
    same_shape(image.size(), view, comparator)?;
    Ok(image)
}

pub(super) fn same_shape((w, h): (u32, u32), view: &View, comparator: &str) -> Result<(), Fault> {
    let (cw, ch) = (view.camera().width, view.camera().height);
    let (a, b) = (f64::from(w) * f64::from(ch), f64::from(h) * f64::from(cw));
    if (a - b).abs() > 0.03 * a.max(b) {
        return Err(Fault::type_error(format!(
            "{comparator}: the observed picture has {w} x {h} pixels, but the camera's has {cw} x \
             {ch}: the aspect ratios differ"
        )));
    }
    Ok(())
}

thread_local! {
    static RATIO_SCRATCH: RefCell<contour_ratio::Scratch> = RefCell::default();
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
    fn prepared(&self, observed: &Value) -> Result<Arc<ContourRatio>, Fault> {
        let image = image(observed, &self.view, self.name())?;
        let Camera { width, height, .. } = self.view.camera().scaled_to(self.size);
        image.prepared().get((self.options.clone(), width, height), |(options, w, h)| {
            ContourRatio::prepare(image.map()?, *w, *h, options).map_err(unsuitable(self.name()))
        })
    }
}

impl Likelihood for ContourOf {
    fn name(&self) -> &'static str {
        "scene.contour"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let (ratio, change) = (self.prepared(observed)?, self.view.change(self.size));
        let whole = OnceCell::new();
        let whole = || whole.get_or_init(|| self.view.contours(self.size)).slice();
        Ok(self.tally.with(&ratio, |tally| ratio.log_likelihood_after(&change, whole, tally)))
    }

    /// With respect to the view.
    fn gradient(&self, observed: &Value) -> Option<Adjoint> {
        let (ratio, contours) = (self.prepared(observed).ok()?, self.view.contours(self.size));
        let mut by_piece = Vec::new();
        RATIO_SCRATCH
            .with_borrow_mut(|scratch| ratio.gradient(&contours.slice(), scratch, &mut by_piece));
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
    fn prepared(&self, observed: &Value) -> Result<Arc<Chamfer>, Fault> {
        let image = image(observed, &self.view, self.name())?;
        let Camera { width, height, .. } = self.view.camera().scaled_to(self.size);
        image.prepared().get((self.options.clone(), width, height), |(options, w, h)| {
            Chamfer::prepare(image.map()?, *w, *h, options).map_err(unsuitable(self.name()))
        })
    }
}

impl Likelihood for ChamferOf {
    fn name(&self) -> &'static str {
        "scene.chamfer"
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
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
    /// Pixels may be covered in part.
    partial: bool,
}

impl MaskOf {
    /// Returns the observed mask, prepared at the rendered size.
    fn prepared(&self, observed: &Value) -> Result<Arc<MaskLikelihood>, Fault> {
        let MaskValue { mask, prepared } = observation(observed, self.name(), "a mask")?;
        same_shape((mask.width(), mask.height()), &self.view, self.name())?;
        let Camera { width, height, .. } = self.view.camera().scaled_to(self.size);
        prepared.get((self.eps, width, height), |([i, o], w, h)| {
            let whole = MaskLikelihood::new(mask, *i, *o).map_err(unsuitable(self.name()))?;
            Ok(whole.resized(*w, *h))
        })
    }

    fn rendered(&self) -> Vec<bool> {
        let frame = self.view.depth(self.size);
        let mut covered = vec![false; frame.depth.len()];
        covered.iter_mut().zip(&frame.depth).for_each(|(c, depth)| *c = depth.is_finite());
        covered
    }
}

impl Likelihood for MaskOf {
    fn name(&self) -> &'static str {
        "scene.mask"
    }

    fn approximations(&self) -> Vec<String> {
        vec![drawn(self.size)]
    }

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let prepared = self.prepared(observed)?;
        let (width, height) = (prepared.observed().width(), prepared.observed().height());
        match self.partial {
            true => {
                let fractions = self.view.fractions(self.size);
                prepared.log_likelihood_coverage(&fractions, width, height)
            }
            false => prepared.log_likelihood(&self.rendered(), width, height),
        }
        .map_err(unsuitable(self.name()))
    }

    /// Draws a mask of the rendered size.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, Fault>> {
        let draw = |prepared: Arc<MaskLikelihood>| {
            let drawn = match self.partial {
                true => prepared.simulate_coverage(&self.view.fractions(self.size), rng),
                false => prepared.simulate(&self.rendered(), rng),
            };
            let drawn = drawn.map_err(unsuitable(self.name()))?;
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
        let fractions = self.view.fractions(self.size);
        let gain = |pixel: usize| {
            fractions.get(pixel).map_or(0.0, |fraction| prepared.gain_coverage(pixel, *fraction))
        };
        let vertices = self.view.vjp_fractions(self.size, gain);
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
    fn prepared(&self, observed: &Value) -> Result<(Arc<DepthLikelihood>, Arc<Frame>), Fault> {
        let DepthValue { depth, prepared } = observation(observed, self.name(), "a depth map")?;
        same_shape((depth.width(), depth.height()), &self.view, self.name())?;
        let frame = self.view.depth(self.size);
        let key = (self.options, frame.width, frame.height);
        let prepared = prepared.get(key, |([sd, outlier, near, far], w, h)| {
            let whole = DepthLikelihood::new(depth, *sd, *outlier, (*near, *far));
            Ok(whole.map_err(unsuitable(self.name()))?.resized(*w, *h))
        })?;
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

    fn log_density(&self, observed: &Value) -> Result<f64, Fault> {
        let (prepared, frame) = self.prepared(observed)?;
        let Frame { depth, width, height, .. } = &*frame;
        self.tally
            .with(&prepared, |tally| prepared.log_likelihood_after(depth, *width, *height, tally))
            .map_err(unsuitable(self.name()))
    }

    /// Draws a depth map of the rendered size; pixels missing in the observed one stay
    /// missing.
    fn sample(&self, observed: &Value, rng: &mut Stream) -> Option<Result<Value, Fault>> {
        let wrong = unsuitable(self.name());
        let draw = |(prepared, frame): (Arc<DepthLikelihood>, Arc<Frame>)| {
            let mut drawn = prepared.simulate(&frame.depth, rng).map_err(&wrong)?;
            let missing = prepared.observed().data().iter().map(|d| d.is_nan());
            drawn.iter_mut().zip(missing).filter(|(_, m)| *m).for_each(|(d, _)| *d = f32::NAN);
            let map = DepthMap::new(frame.width, frame.height, drawn).map_err(&wrong)?;
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
        let within = self.view.vjp_depth(self.size, &prepared.slopes(&frame.depth));
        let outline = self.view.vjp_mask(self.size, &prepared.gains(&frame.depth));
        let both = within.iter().zip(outline).map(|(within, outline)| *within + outline);
        Some(BySolid::of_all(both).into_adjoint())
    }
}
