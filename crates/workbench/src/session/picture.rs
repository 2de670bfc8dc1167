//! A picture of the scene, which is rendered only when a front end asks for its pixels.

use image::RgbImage;
use pcadlang_engine::lang::value::{Located, Value};
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_report::pictures;
use pcadlang_scene::render::View;
use pcadlang_scene::vision::Photo;
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
