//! Observed data as files beside the best state: the photograph, its contours, and the
//! joints detected in it.

use crate::failure::{Failure, plain};
use crate::files::write_in;
use crate::places::sized;
use crate::reopening::page::{PagePicture, on_page};
use image::RgbImage;
use image::imageops::crop_imm;
use pcadlang_engine::lang::value::Located;
use pcadlang_library::scene::ImageValue;
use pcadlang_report::RunDir;
use pcadlang_report::pictures::{self, DETECTED, LONGER_SIDE, OF_SCENE, jpeg, png};

/// The maximum longer side of the photograph, in pixels.
const LARGEST: u32 = 1024;
/// The JPEG quality of the photograph.
const QUALITY: u8 = 90;
/// The margin around the joints, as a fraction of their extent.
const MARGIN: f64 = 0.15;

/// Writes a photograph at the size of pictures, `photo.jpg`.
pub fn show_photo(dir: &RunDir, photo: &RgbImage) -> Result<(), Failure> {
    let (w, h) = pictures::picture_size(photo.width(), photo.height());
    let small = sized(photo, w.max(h).min(LARGEST));
    let bytes = jpeg(&small, QUALITY).map_err(|e| plain(e.to_string()))?;
    write_in(dir, "photo.jpg", &bytes)
}

/// Writes `joints.png`, if any were detected; returns it as it is on a page.
pub fn show_joints(
    dir: &RunDir,
    photo: &RgbImage,
    located: &[Located],
) -> Result<Option<PagePicture>, Failure> {
    let Some(joints) = joints(photo, located) else { return Ok(None) };
    let bytes = png(&joints).map_err(|e| plain(e.to_string()))?;
    write_in(dir, "joints.png", &bytes)?;
    Ok(Some(("joints.png", on_page(&joints, bytes))))
}

/// Writes the contours of what was observed as `photo_contours.png`, of this size.
pub fn show_contours(dir: &RunDir, image: &ImageValue, size: (u32, u32)) -> Result<(), Failure> {
    let Some(map) = image.contours_shown() else { return Ok(()) };
    let lines = pictures::contour_map(size.0, size.1, &map);
    write_in(dir, "photo_contours.png", &png(&lines).map_err(|e| plain(e.to_string()))?)
}

/// Warns of observed data that do not constrain the scene: a photograph without contours,
/// or keypoints that the scene does not have.
pub fn warnings(
    image: Option<(&str, &ImageValue)>,
    keypoints: Option<&str>,
    located: &[Located],
) -> Vec<String> {
    let mut all = Vec::new();
    if let Some((name, image)) = image
        && image.seen().is_some_and(|map| map.is_empty())
    {
        all.push(format!(
            "no contours were found in `{name}`, so it does not constrain the scene: draws come from \
             the prior (`pcadlang contours` shows what is found)"
        ));
    }
    if let Some(path) = keypoints.filter(|_| located.is_empty()) {
        all.push(format!(
            "{path} has no keypoint that the scene has, so it does not constrain the pose"
        ));
    }
    all
}

/// Crops a photograph to the joints, and draws a line from each detected position to the
/// position in the scene.
fn joints(photo: &RgbImage, located: &[Located]) -> Option<RgbImage> {
    let (w, h) = (f64::from(photo.width()), f64::from(photo.height()));
    let ends: Vec<[[f64; 2]; 2]> =
        located.iter().map(|l| [l.own, l.observed].map(|[x, y]| [x * w, y * h])).collect();
    let along = |k: usize, most: f64| {
        let all = || ends.iter().flatten().map(|p| p[k]).filter(|x| (0.0..=most).contains(x));
        let (low, high) =
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        (low <= high).then_some((low, high))
    };
    let ((left, right), (top, bottom)) = (along(0, w)?, along(1, h)?);
    let margin = MARGIN * (right - left).max(bottom - top).max(1.0);
    let (x, y) = ((left - margin).max(0.0).floor(), (top - margin).max(0.0).floor());
    let size = [(right + margin).min(w).ceil() - x, (bottom + margin).min(h).ceil() - y]
        .map(|v| (v as u32).max(1));
    let part = crop_imm(photo, x as u32, y as u32, size[0], size[1]).to_image();
    let mut out = sized(&part, LONGER_SIDE);
    let (size, moved) = ((size[0], size[1]), |p: [f64; 2]| [p[0] - x, p[1] - y]);
    let ends: Vec<[[f64; 2]; 2]> = ends.iter().map(|e| e.map(moved)).collect();
    let [own, seen] = [0, 1].map(|k| ends.iter().map(|e| e[k]).collect::<Vec<_>>());
    pictures::limbs(&mut out, size, &ends, DETECTED);
    pictures::dots(&mut out, size, &seen, DETECTED);
    pictures::dots(&mut out, size, &own, OF_SCENE);
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_scene::vision::ContourMap;

    fn located(own: [f64; 2], observed: [f64; 2]) -> Located {
        Located { name: "a".into(), at: own, variance: 0.0, observed, own, own_variance: 0.0 }
    }

    #[test]
    fn what_says_nothing_is_named() {
        let blank =
            ImageValue::contours(ContourMap::from_image(&image::GrayImage::new(40, 30)), None);
        let said = warnings(Some(("photo", &blank)), Some("joints.json"), &[]);
        assert!(said[0].starts_with("no contours were found in `photo`"), "{said:?}");
        assert!(said[1].starts_with("joints.json has no keypoint"), "{said:?}");
        let mut disc = image::GrayImage::new(40, 30);
        (5..25).for_each(|x| disc.put_pixel(x, 9, image::Luma([255])));
        let seen = ImageValue::contours(ContourMap::from_image(&disc), None);
        let all = [located([0.25, 0.5], [0.5, 0.5])];
        assert!(warnings(Some(("photo", &seen)), Some("joints.json"), &all).is_empty());
        assert!(warnings(None, None, &[]).is_empty());
    }

    #[test]
    fn joints_are_shown_close_by() {
        let photo = RgbImage::from_pixel(400, 200, image::Rgb([100; 3]));
        let all = [
            located([0.25, 0.5], [0.5, 0.5]),
            located([0.3, 0.25], [0.3, 0.3]),
            located([7.0, 0.5], [0.4, 0.4]),
        ];
        let out = joints(&photo, &all).unwrap();
        // From 100 to 200 horizontally with a margin of 15, from 50 to 100 vertically.
        assert_eq!((out.width(), out.height()), (768, 472));
        let at = |x: f64, y: f64| {
            out.get_pixel(((x - 85.0) * 768.0 / 130.0) as u32, ((y - 35.0) * 768.0 / 130.0) as u32)
                .0
        };
        assert_eq!(
            (at(100.0, 100.0), at(200.0, 100.0)),
            ([255, 220, 0], [90, 220, 255]),
            "own yellow, detected blue"
        );
        // Lines are thin and antialiased.
        let [red, green, blue] = at(150.0, 100.0);
        assert!(
            red < 100 && green > 140 && blue > 140,
            "a line between them: {red} {green} {blue}"
        );
        assert_eq!(at(150.0, 90.0), [100; 3], "and nothing beside it");
        assert!(
            joints(&photo, &[]).is_none()
                && joints(&photo, &[located([f64::NAN; 2], [2.0, 2.0])]).is_none()
        );
    }
}
