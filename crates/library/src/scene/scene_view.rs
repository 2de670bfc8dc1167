//! A host comparator's access to a rendered scene.

use super::ViewValue;
use super::compare::{by_contours, by_silhouette};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::Args;
use pcadlang_engine::lang::error::Fault;
use pcadlang_scene::render::View;
use std::fmt;
use std::sync::Arc;

/// A solid in front of a camera (the result of `scene.render`), rendered on first use and
/// once per size. `longer` is the longer side of the picture in pixels.
///
/// ```
/// use pcadlang::host::{Adjoint, Entry, Host, Likelihood, Type};
/// use pcadlang::scene::SceneView;
/// use pcadlang::{Program, Value};
/// /// The number of pixels that a solid covers, observed with some noise: a comparator with a gradient.
/// #[derive(Debug)]
/// struct Area {
///     view: SceneView,
///     sd: f64,
/// }
///
/// impl Area {
///     fn off(&self, observed: &Value) -> Result<f64, String> {
///         let Value::Num(wanted) = observed else { return Err("an area is a number".into()) };
///         Ok((self.view.mask(64).iter().filter(|covered| **covered).count() as f64 - wanted) / self.sd)
///     }
/// }
///
/// impl Likelihood for Area {
///     fn name(&self) -> &str {
///         "area"
///     }
///     fn log_density(&self, observed: &Value) -> Result<f64, String> {
///         self.off(observed).map(|z| -0.5 * z * z)
///     }
///     fn gradient(&self, observed: &Value) -> Option<Adjoint> {
///         let (width, height) = self.view.size(64);
///         let each = -self.off(observed).ok()? / self.sd;
///         let by_view = self.view.by_mask(64, &vec![each; (width * height) as usize]);
///         Some(Adjoint::List(vec![by_view, Adjoint::Unknown]))
///     }
/// }
///
/// let area = Entry::likelihood("area", |a| Ok(Area { view: SceneView::of(a, 0)?, sd: a.positive_or(1, 20.0)? }))
///     .argument("view", Type::Object("a view"), "What is seen.")
///     .optional("sd", Type::Num, 20.0, "The noise.").unit("pixels");
/// let text = r#"include "std/scene.pcad" as scene;
///     assume size ~ uniform(0.3, 2);
///     let ball = scene.affine(scale = size) * scene.sphere(1);
///     observe area(scene.render(ball)) = 800 as seen;
///     infer { warmup 60 { hmc(@size, steps = 3); } repeat 60 { hmc(@size, steps = 3); } }"#;
/// let model = Program::parse(text)?.host(&Host::new().with(area))?.compile()?;
/// let size = model.run(&Default::default(), 1, 1)?.quantity("size").unwrap().summary.mean;
/// assert!((0.8..1.3).contains(&size), "{size}");
/// # Ok::<(), pcadlang::Error>(())
/// ```
#[derive(Clone)]
pub struct SceneView(Arc<View>);

impl fmt::Debug for SceneView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a view")
    }
}

/// A view that was rendered elsewhere.
impl From<Arc<View>> for SceneView {
    fn from(view: Arc<View>) -> SceneView {
        SceneView(view)
    }
}

impl SceneView {
    /// Returns argument `i` as a view.
    ///
    /// # Errors
    /// If it is not a view.
    pub fn of(a: &Args, i: usize) -> Result<SceneView, Fault> {
        a.object::<ViewValue>(i, "a view").map(|v| SceneView(Arc::clone(&v.0)))
    }

    /// Returns the width and height of the picture.
    pub fn size(&self, longer: u32) -> (u32, u32) {
        let camera = self.0.camera().scaled_to(longer);
        (camera.width, camera.height)
    }

    /// Returns whether each pixel shows the solid, row by row.
    pub fn mask(&self, longer: u32) -> Vec<bool> {
        self.0.frame(longer).mask().collect()
    }

    /// Returns the depth of each pixel, row by row, in scene units; infinite where the
    /// pixel does not show the solid.
    pub fn depth(&self, longer: u32) -> Vec<f32> {
        self.0.depth(longer).depth.clone()
    }

    /// Returns the pieces of the contours: x, y and length in pixels, and the angle in
    /// radians, measured from right towards down.
    ///
    /// ```
    /// use pcadlang::host::{Entry, Host, Type};
    /// use pcadlang::scene::SceneView;
    /// use pcadlang::{Program, Value};
    /// let outline = Entry::function("outline", |a| {
    ///     let view = SceneView::of(a, 0)?;
    ///     let nearest = view.depth(64).into_iter().fold(f32::INFINITY, f32::min);
    ///     assert!((6.9..7.1).contains(&nearest));
    ///     let pieces = view.contours(64);
    ///     // The derivative of the sum of the lengths with respect to each is 1.
    ///     let by_view = view.by_contours(64, &vec![[0.0, 0.0, 1.0, 0.0]; pieces.len()]);
    ///     assert!(!by_view.is_zero());
    ///     Ok(Value::Num(pieces.iter().map(|p| p[2]).sum()))
    /// })
    /// .argument("view", Type::Object("a view"), "What is seen.");
    /// let text = r#"include "std/scene.pcad" as scene;
    ///     assume shift ~ normal(0, 0.01);
    ///     observe normal(outline(scene.render(scene.affine(translate = [shift, 0, 0]) * scene.sphere(1))), 1) = 90;"#;
    /// Program::parse(text)?.host(&Host::new().with(outline))?.compile()?.simulate(0, 0)?;
    /// # Ok::<(), pcadlang::Error>(())
    /// ```
    pub fn contours(&self, longer: u32) -> Vec<[f64; 4]> {
        let c = self.0.contours(longer);
        let piece = |i: usize| {
            let angle = libm::atan2(f64::from(c.ty[i]), f64::from(c.tx[i]));
            [f64::from(c.x[i]), f64::from(c.y[i]), f64::from(c.length[i]), angle]
        };
        (0..c.x.len()).map(piece).collect()
    }

    /// Returns the adjoint of the view, given the derivatives with respect to the pieces
    /// of its contours.
    pub fn by_contours(&self, longer: u32, by_piece: &[[f64; 4]]) -> Adjoint {
        by_contours(&self.0, longer, by_piece)
    }

    /// Returns the adjoint of the view, given the derivative with respect to the coverage
    /// of each pixel: the outline moves and covers or uncovers pixels.
    pub fn by_mask(&self, longer: u32, gains: &[f64]) -> Adjoint {
        by_silhouette(&self.0, longer, gains)
    }
}
