//! `:render`: a picture of the scene, which is rendered only when a front end asks for
//! its pixels.

use super::{Reply, Session, Trouble};
use crate::bank;
use crate::diag::nearest;
use crate::lang::code::{Code, Operand};
use crate::lang::value::Located;
use crate::render::{Contours, Frame, View};
use crate::report::pictures::{self, Drawn, Strokes};
use crate::scene::{ImageValue, ViewValue};
use image::RgbImage;
use std::path::PathBuf;
use std::sync::Arc;

/// A view, drawn over the photograph if there is one.
#[derive(Clone, Debug)]
pub struct Picture {
    view: Arc<View>,
    photo: Option<Arc<RgbImage>>,
    /// The file that the user named, if any.
    pub file: Option<PathBuf>,
}

/// The longer side of a picture is scaled down to at most this, in pixels.
const LARGEST: u32 = 1024;

impl Picture {
    /// Renders the picture; its longer side has between [`pictures::LONGER_SIDE`] and
    /// 1024 pixels.
    pub fn pixels(&self) -> RgbImage {
        let camera = self.view.camera();
        let (width, height) =
            self.photo.as_ref().map_or((camera.width, camera.height), |p| p.dimensions());
        let longer = width.max(height).max(1);
        let scaled = |x: u32| (u64::from(x) * u64::from(LARGEST) / u64::from(longer)).max(1) as u32;
        let fit = |x| if longer > LARGEST { scaled(x) } else { x };
        over(&self.view, self.photo.as_deref(), (fit(width), fit(height)))
    }
}

/// Draws the surface of a view with its contours and landmarks, over a photograph if
/// there is one. The picture has the given size, enlarged by [`pictures::picture_size`].
pub fn over(view: &Arc<View>, photo: Option<&RgbImage>, (width, height): (u32, u32)) -> RgbImage {
    let large = pictures::picture_size(width, height);
    let (contours, picture) = (view.contours(width.max(height)), view.frame(large.0.max(large.1)));
    let mut out = pictures::overlay(photo, &drawn(&picture), &strokes(&contours));
    let marked = ViewValue(Arc::clone(view));
    let points: Vec<[f64; 2]> = marked.landmarks(width, height).filter_map(|(_, at)| at).collect();
    pictures::dots(&mut out, (width, height), &points, pictures::OF_SCENE);
    out
}

/// Draws the observed positions of points of the scene, each joined by a line to its
/// position in the scene, over a picture of `width` x `height`.
pub fn detected(out: &mut RgbImage, located: &[Located], (width, height): (u32, u32)) {
    let scale = |[x, y]: [f64; 2]| [x * f64::from(width), y * f64::from(height)];
    let lines: Vec<_> = located.iter().map(|l| [scale(l.own), scale(l.observed)]).collect();
    let seen: Vec<_> = lines.iter().map(|[_, seen]| *seen).collect();
    pictures::limbs(out, (width, height), &lines, pictures::DETECTED);
    pictures::dots(out, (width, height), &seen, pictures::DETECTED);
}

/// Converts a frame for the reports.
pub fn drawn(f: &Frame) -> Drawn<'_> {
    Drawn { width: f.width, height: f.height, depth: &f.depth, normal: &f.normal, part: &f.part }
}

/// Converts contours for the reports.
pub fn strokes(c: &Contours) -> Strokes<'_> {
    Strokes {
        width: c.width,
        height: c.height,
        x: &c.x,
        y: &c.y,
        tx: &c.tx,
        ty: &c.ty,
        length: &c.length,
    }
}

impl Session {
    /// `:render [name] [file]`.
    pub(super) fn render(&mut self, text: &str) -> Result<Reply, Trouble> {
        let mut words: Vec<&str> = text.split_whitespace().collect();
        let is_file = |w: &&str| [".png", ".PNG"].iter().any(|e| w.ends_with(e));
        let file = words.last().copied().filter(is_file).map(|f| f.trim_matches('"'));
        words.truncate(words.len() - usize::from(file.is_some()));
        let draws = self.looks();
        let operand = match words[..] {
            [] => bank::picture(&mut self.trace, draws).ok_or_else(|| {
                Trouble::plain("the program has no view and no solid")
                    .hint("let view = scene.render(solid);")
            })?,
            [name] => self.global(name)?,
            _ => return Err(Trouble::plain("`:render` takes a name and a file that ends in .png")),
        };
        let values =
            self.trace.query(&[operand], draws).map_err(|e| Trouble::run(&self.model, *e))?;
        let Some(view) = values.first().and_then(|v| bank::as_view(v, None)) else {
            let what = values.first().map_or("nothing", |v| v.type_name());
            return Err(Trouble::plain(format!(
                "`{text}` is {what}: only views and solids can be seen"
            )));
        };
        let picture =
            Picture { view, photo: photo(self.model.code()), file: file.map(PathBuf::from) };
        Ok(Reply { picture: Some(picture), ..Reply::default() })
    }

    fn global(&self, name: &str) -> Result<Operand, Trouble> {
        let globals = &self.model.code().globals;
        globals.get(name).copied().ok_or_else(|| {
            let trouble = Trouble::plain(format!("there is no `{name}`"));
            match nearest(name, globals.keys().map(|n| &**n)) {
                Some(n) => trouble.hint(format!("did you mean `{n}`?")),
                None => trouble,
            }
        })
    }
}

/// Returns the first photograph among a program's data.
fn photo(code: &Code) -> Option<Arc<RgbImage>> {
    let of = |o: &Operand| match o {
        Operand::Const(i) => code
            .const_value(*i)
            .downcast::<ImageValue>()?
            .as_photo()
            .map(|p| Arc::new(p.rgb().clone())),
        _ => None,
    };
    code.globals.values().find_map(of)
}
