//! The picture of the scene: the view of a program, `:render`, rendered only when a front end
//! needs its pixels, and the layers: surface over the photograph, depth, contours and others.

use super::reply::Reply;
use super::state::Session;
use crate::failure::{Failure, plain};
use image::RgbImage;
use pcadlang_engine::lang::code::{Code, Operand};
use pcadlang_engine::lang::value::{Located, Value};
use pcadlang_engine::trace::{Draws, Trace};
use pcadlang_library::scene::{ImageValue, SolidValue, ViewValue};
use pcadlang_report::pictures;
use pcadlang_scene::render::{Camera, View};
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
    let size = width.max(height);
    let mut out = pictures::overlay(photo, &view.frame(size), &view.contours(size).slice());
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

/// Returns the operand of a program's picture: the last top-level name that is a view,
/// otherwise the last that is a solid.
pub fn picture_operand(trace: &mut Trace, draws: Draws) -> Option<Operand> {
    let globals: Vec<Operand> = trace.code().globals.values().rev().copied().collect();
    let mut solid = None;
    for o in globals {
        let Ok(values) = trace.query(&[o], draws) else { continue };
        let Some(v) = values.first() else { continue };
        if v.downcast::<ViewValue>().is_some() {
            return Some(o);
        }
        if solid.is_none() && v.downcast::<SolidValue>().is_some() {
            solid = Some(o);
        }
    }
    solid
}

/// Converts a value to a view: a view itself, or a solid seen from `camera` (by default,
/// the default camera at 256 x 256).
pub fn as_view(value: &Value, camera: Option<Camera>) -> Option<Arc<View>> {
    if let Some(v) = value.downcast::<ViewValue>() {
        return Some(Arc::clone(&v.0));
    }
    let camera = camera.unwrap_or_else(|| Camera::default_for(256, 256));
    value.downcast::<SolidValue>().map(|s| Arc::new(View::new(s.0.clone(), camera)))
}

/// Returns a program's view: the last top-level name that is a view, or else the last
/// solid, seen from a camera.
pub fn view(trace: &mut Trace, draws: Draws, camera: Option<Camera>) -> Option<Arc<View>> {
    let at = picture_operand(trace, draws)?;
    let values = trace.query(&[at], draws).ok()?;
    as_view(values.first()?, camera)
}

impl Session {
    /// Returns the view of the scene in the present state; `None` if the program has no view
    /// and no solid.
    pub fn view(&mut self) -> Option<Arc<View>> {
        let draws = self.looks();
        view(&mut self.trace, draws, None)
    }

    /// `:render [name] [file]`.
    pub(super) fn render(&mut self, text: &str) -> Result<Reply, Failure> {
        let mut words: Vec<&str> = text.split_whitespace().collect();
        let is_file = |w: &&str| [".png", ".PNG"].iter().any(|e| w.ends_with(e));
        let file = words.last().copied().filter(is_file).map(|f| f.trim_matches('"'));
        words.truncate(words.len() - usize::from(file.is_some()));
        file.map_or(Ok(()), |f| self.permit(f))?;
        let draws = self.looks();
        let operand = match words[..] {
            [] => picture_operand(&mut self.trace, draws).ok_or_else(|| {
                plain("the program has no view and no solid")
                    .hint("let view = scene.render(solid);")
            })?,
            [name] => self.global(name)?,
            _ => return Err(plain("`:render` takes a name and a file that ends in .png")),
        };
        let values =
            self.trace.query(&[operand], draws).map_err(|e| Failure::run(&self.model, *e))?;
        let Some(view) = values.first().and_then(|v| as_view(v, None)) else {
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

/// A layer of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// The surface and its contours over the photograph, with detected joints.
    Overlay,
    /// The photograph.
    Photo,
    /// The surface alone.
    Scene,
    /// Distances from the camera, near ones bright.
    Depth,
    /// The directions that surfaces face.
    Normals,
    /// Each part in a colour of its own.
    Regions,
    /// The contours of the scene.
    Contours,
    /// The contours of the photograph.
    PhotoContours,
    /// Both contours, coloured by how far the next one of the other kind is.
    Residuals,
    /// The detected joints, each joined to its position in the scene.
    Joints,
    /// The pixels that the scene covers.
    Mask,
}

/// A distance of this part of the longer side is drawn as the farthest of residuals.
const FAR: f32 = 0.05;

impl Layer {
    /// All layers.
    pub const ALL: [Layer; 11] = [
        Layer::Overlay,
        Layer::Photo,
        Layer::Scene,
        Layer::Depth,
        Layer::Normals,
        Layer::Regions,
        Layer::Contours,
        Layer::PhotoContours,
        Layer::Residuals,
        Layer::Joints,
        Layer::Mask,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Layer::Overlay => "overlay",
            Layer::Photo => "photo",
            Layer::Scene => "scene",
            Layer::Depth => "depth",
            Layer::Normals => "normals",
            Layer::Regions => "regions",
            Layer::Contours => "contours",
            Layer::PhotoContours => "photo_contours",
            Layer::Residuals => "residuals",
            Layer::Joints => "joints",
            Layer::Mask => "mask",
        }
    }

    /// Draws it. `size` is the longer side in pixels; `image` is what was observed, and
    /// `located` are the joints that were found in it.
    ///
    /// # Errors
    /// If it needs a photograph, contours or joints that are not there.
    pub fn draw(
        self,
        view: &Arc<View>,
        image: Option<&ImageValue>,
        located: &[Located],
        size: u32,
    ) -> Result<RgbImage, Failure> {
        let photo = image.and_then(ImageValue::as_photo);
        let seen = || {
            let map = image.and_then(ImageValue::contours_shown);
            map.ok_or_else(|| plain("there is no photograph"))
        };
        let camera = view.camera();
        let of = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
        let (width, height) = scaled(of, size);
        let photo =
            if size > ImageValue::SHOWN { photo } else { image.and_then(ImageValue::shown) };
        let needed = || photo.ok_or_else(|| plain("there is no photograph"));
        let frame = || view.frame(size);
        Ok(match self {
            Layer::Overlay => {
                let contours = view.contours(size);
                let mut out =
                    pictures::overlaid(photo.map(Photo::rgb), &frame(), &contours.slice());
                let size = out.dimensions();
                detected(&mut out, located, size);
                out
            }
            Layer::Photo => pictures::scaled(needed()?.rgb(), width, height),
            Layer::Scene => pictures::shaded(&frame()),
            Layer::Depth => pictures::depth(&frame()),
            Layer::Normals => pictures::normals(&frame()),
            Layer::Regions => pictures::parts(&frame()),
            Layer::Mask => image::DynamicImage::ImageLuma8(pictures::mask(&frame())).to_rgb8(),
            Layer::Contours => pictures::contours(width, height, &view.contours(size).slice()),
            Layer::PhotoContours => pictures::contour_map(width, height, &seen()?),
            Layer::Residuals => {
                let map = seen()?;
                let contours = view.contours(map.width.max(map.height));
                let far = FAR * map.width.max(map.height) as f32;
                pictures::residuals((width, height), &contours.slice(), &map, far)
            }
            Layer::Joints => {
                if located.is_empty() {
                    return Err(plain("no joints were found in the photograph"));
                }
                let mut out = match photo {
                    Some(p) => pictures::scaled(p.rgb(), width, height),
                    None => RgbImage::new(width, height),
                };
                detected(&mut out, located, (width, height));
                let own: Vec<[f64; 2]> = located
                    .iter()
                    .map(|l| [l.own[0] * f64::from(width), l.own[1] * f64::from(height)])
                    .collect();
                pictures::dots(&mut out, (width, height), &own, pictures::OF_SCENE);
                out
            }
        })
    }
}

/// Returns what was observed at the size of layers and with its contours, for several of them:
/// each would scale the photograph, and look for contours if the program used none. `None` without
/// either.
pub fn reduced(image: &ImageValue, size: u32) -> Option<ImageValue> {
    let map = image.contours_shown()?;
    let photo = image.shown().map(|p| {
        let (width, height) = scaled((p.width(), p.height()), size);
        Photo::from_rgb(pictures::scaled(p.rgb(), width, height))
    });
    Some(ImageValue::contours(map, photo.and_then(Result::ok)))
}

/// Returns a size with this longer side.
fn scaled((width, height): (u32, u32), longer: u32) -> (u32, u32) {
    let by = f64::from(longer.max(1)) / f64::from(width.max(height).max(1));
    let side = |x: u32| ((f64::from(x) * by).round() as u32).max(1);
    (side(width), side(height))
}
