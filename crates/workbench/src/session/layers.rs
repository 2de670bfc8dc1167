//! The layers of a picture of a scene: its surface over the photograph, its depth, its
//! contours beside those of the photograph.

use super::picture::detected;
use image::RgbImage;
use image::imageops::{FilterType, resize};
use pcadlang_engine::lang::value::Located;
use pcadlang_library::scene::ImageValue;
use pcadlang_report::pictures;
use pcadlang_scene::render::View;
use pcadlang_scene::vision::{ContourMap, Photo};
use std::sync::Arc;

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
    ) -> Result<RgbImage, String> {
        let photo = image.and_then(ImageValue::as_photo);
        let needed = || photo.ok_or("there is no photograph".to_owned());
        let seen = || image.and_then(photo_contours).ok_or("there is no photograph".to_owned());
        let camera = view.camera();
        let of = photo.map_or((camera.width, camera.height), |p| (p.width(), p.height()));
        let (width, height) = scaled(of, size);
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
            Layer::Photo => resize(needed()?.rgb(), width, height, FilterType::Triangle),
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
                    return Err("no joints were found in the photograph".to_owned());
                }
                let mut out = match photo {
                    Some(p) => resize(p.rgb(), width, height, FilterType::Triangle),
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

/// Returns the contours of a photograph, to look at: those that the program compared with
/// or, if it used none, those of the built-in detector. `None` if there is no photograph.
pub fn photo_contours(image: &ImageValue) -> Option<ContourMap> {
    // On a copy, so that contours detected here do not count as used.
    let found = || ImageValue::photo(image.as_photo()?.clone()).map().ok().cloned();
    image.seen().or_else(found)
}

/// Returns a size with this longer side.
fn scaled((width, height): (u32, u32), longer: u32) -> (u32, u32) {
    let by = f64::from(longer.max(1)) / f64::from(width.max(height).max(1));
    let side = |x: u32| ((f64::from(x) * by).round() as u32).max(1);
    (side(width), side(height))
}
