//! `:render`, and the picture of the scene, rendered only when a front end needs its pixels.

use super::reply::Reply;
use super::state::Session;
use crate::bank;
use crate::failure::{Failure, plain};
use image::RgbImage;
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::value::{Located, Value};
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_report::pictures;
use pcadlang_scene::render::View;
use pcadlang_scene::vision::Photo;
use pcadlang_syntax::diag::nearest;
use std::path::PathBuf;
use std::sync::Arc;

/// A view, drawn over the photograph if there is one.
#[derive(Clone, Debug)]
pub struct ViewPicture {
    pub(super) view: Arc<View>,
    /// The observed image, an [`ImageValue`], if there is one.
    pub(super) image: Option<Value>,
    /// The file that the user named, if any.
    pub file: Option<PathBuf>,
}

/// The longer side of a picture is scaled down to at most this, in pixels.
const LARGEST: u32 = 1024;

impl ViewPicture {
    /// Renders the picture; its longer side has between [`pictures::LONGER_SIDE`] and
    /// 1024 pixels.
    pub fn pixels(&self) -> RgbImage {
        let camera = self.view.camera();
        let image = self.image.as_ref().and_then(|i| i.downcast::<ImageValue>());
        let photo = image.and_then(ImageValue::as_photo).map(Photo::rgb);
        let (width, height) = photo.map_or((camera.width, camera.height), RgbImage::dimensions);
        let longer = width.max(height).max(1);
        let scaled = |x: u32| (u64::from(x) * u64::from(LARGEST) / u64::from(longer)).max(1) as u32;
        let fit = |x| if longer > LARGEST { scaled(x) } else { x };
        over(&self.view, photo, (fit(width), fit(height)))
    }
}

/// Draws the surface of a view with its contours and landmarks, over a photograph if
/// there is one. The picture has the given size, enlarged by [`pictures::picture_size`].
pub fn over(view: &Arc<View>, photo: Option<&RgbImage>, (width, height): (u32, u32)) -> RgbImage {
    let large = pictures::picture_size(width, height);
    let (contours, picture) = (view.contours(width.max(height)), view.frame(large.0.max(large.1)));
    let mut out = pictures::overlay(photo, &picture, &contours.slice());
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

impl Session {
    /// `:render [name] [file]`.
    pub(super) fn render(&mut self, text: &str) -> Result<Reply, Failure> {
        let mut words: Vec<&str> = text.split_whitespace().collect();
        let is_file = |w: &&str| [".png", ".PNG"].iter().any(|e| w.ends_with(e));
        let file = words.last().copied().filter(is_file).map(|f| f.trim_matches('"'));
        words.truncate(words.len() - usize::from(file.is_some()));
        file.map_or(Ok(()), |f| self.permit(f))?;
        let draws = self.looks();
        let operand = match words[..] {
            [] => bank::picture(&mut self.trace, draws).ok_or_else(|| {
                plain("the program has no view and no solid")
                    .hint("let view = scene.render(solid);")
            })?,
            [name] => self.global(name)?,
            _ => return Err(plain("`:render` takes a name and a file that ends in .png")),
        };
        let values =
            self.trace.query(&[operand], draws).map_err(|e| Failure::run(&self.model, *e))?;
        let Some(view) = values.first().and_then(|v| bank::as_view(v, None)) else {
            let what = values.first().map_or("nothing", |v| v.type_name());
            return Err(plain(format!("`{text}` is {what}: only views and solids can be seen")));
        };
        let picture = ViewPicture {
            view,
            image: observed_image(self.model.code()),
            file: file.map(PathBuf::from),
        };
        Ok(Reply { picture: Some(picture), ..Reply::default() })
    }

    fn global(&self, name: &str) -> Result<Operand, Failure> {
        let globals = &self.model.code().globals;
        globals.get(name).copied().ok_or_else(|| {
            let failure = plain(format!("there is no `{name}`"));
            match nearest(name, globals.keys().map(|n| &**n)) {
                Some(n) => failure.hint(format!("did you mean `{n}`?")),
                None => failure,
            }
        })
    }
}

/// Returns the first photograph, or contour map, among a program's data: an
/// [`ImageValue`].
pub fn observed_image(code: &Code) -> Option<Value> {
    let of = |o: &Operand| match o {
        Operand::Const(i) => Some(code.const_value(*i).clone()),
        _ => None,
    };
    let is_image = |v: &Value| v.downcast::<ImageValue>().is_some();
    code.globals.values().filter_map(of).find(is_image)
}
