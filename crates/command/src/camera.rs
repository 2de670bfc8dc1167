//! `pcadlang camera`.

use clap::Args;
use glam::DVec3;
use image::{Rgb, RgbImage};
use pcadlang_report::pictures::{limbs, picture_size, png};
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{files, inputs};
use pcadlang_scene::cameras::{CameraFile, Seen};
use pcadlang_scene::render::{Camera, Projection};
use pcadlang_scene::vision::{Lens, Photo};
use std::path::PathBuf;

/// `camera`.
#[derive(Args, Debug)]
#[command(after_help = "\
The picture of the axes shows x red, y green, z blue, and a grid on the plane y = 0, at the origin of the \
world; if the camera does not see that, straight ahead.")]
pub struct CameraOf {
    /// A camera as `--camera` of `run` takes it: a file of OpenCV, ROS, COLMAP (or its folder), a
    /// NeRF's transforms.json, BOP, Open3D, RealSense, Kinect, glTF, or this program's, or a
    /// photograph with Exif; `#PICTURE` selects one of several, options follow:
    /// 'cameras.txt#a.jpg, up = "z", unit = 0.001, at = "view"'
    #[arg(value_name = "FILE[#PICTURE]")]
    pub file: PathBuf,
    /// The picture, of a file with several: its name, the end of its path, or its number
    #[arg(long, value_name = "NAME")]
    pub picture: Option<String>,
    /// The photograph: its name selects the picture, its size is the camera's if the file states
    /// none, and the axes are drawn over it, undistorted
    #[arg(long, value_name = "IMG")]
    pub observe: Option<PathBuf>,
    /// A picture of the world's axes as the camera sees them, to write
    #[arg(short, long, value_name = "PNG")]
    pub out: Option<PathBuf>,
}

/// Prints what was understood of a camera file, and draws the axes of its world.
pub fn camera(a: &CameraOf) -> Result<(), Failure> {
    let photo = a.observe.as_deref().map(inputs::photo).transpose()?;
    let path = a.observe.as_ref().map(|p| p.display().to_string());
    let file = inputs::camera(&a.file, a.picture.as_deref(), path.as_deref())?;
    let shown = a.file.display();
    let seen = file.seen(photo.as_ref().map(|p| (p.width(), p.height())));
    let seen = seen.map_err(|e| plain(format!("{shown}: {e}")))?;
    say(&file, &seen);
    let at = anchor(&seen.camera);
    if let Some(out) = &a.out {
        let picture = axes(&seen, photo.as_ref(), at)?;
        files::write(out, &png(&picture).map_err(|e| plain(e.to_string()))?)?;
        print_line!("{}: the axes at {}", out.display(), triple(at));
    }
    Ok(())
}

fn say(file: &CameraFile, Seen { camera, lens }: &Seen) {
    let line = |what: &str, text: String| print_line!("{what:<12} {text}");
    line("format", file.format.to_owned());
    line("model", file.model.clone());
    file.picture.iter().for_each(|p| line("picture", p.clone()));
    let size = lens.as_ref().map_or((camera.width, camera.height), Lens::size);
    line("image", format!("{} x {} pixels", size.0, size.1));
    let (focal, centre) = match (lens, camera.projection) {
        (Some(lens), _) => {
            let [x, y] = lens.focal().map(short);
            (if x == y { x } else { format!("{x} across, {y} down") }, lens.centre())
        }
        (None, Projection::Pinhole { focal_px, cx, cy }) => (short(focal_px), [cx, cy]),
        (None, Projection::Orthographic { units_per_pixel, cx, cy }) => {
            line("pixel", format!("{} units", short(units_per_pixel)));
            (String::new(), [cx, cy])
        }
    };
    if !focal.is_empty() {
        line("focal", format!("{focal} pixels"));
    }
    let [x, y] = centre.map(short);
    line("principal", format!("({x}, {y}) pixels; the first pixel's centre is (0.5, 0.5)"));
    let coefficients = lens.as_ref().map_or_else(Vec::new, |lens| {
        let d = lens.distortion();
        let all = [("k", &d.radial[..]), ("d", &d.divisor), ("p", &d.tangential), ("s", &d.prism)];
        let name = |(name, c): (&'static str, &[f64])| {
            let some = c.iter().enumerate().filter(|(_, x)| **x != 0.0);
            some.map(|(i, x)| format!("{name}{} {x}", i + 1)).collect::<Vec<_>>()
        };
        all.map(name).concat()
    });
    line(
        "distortion",
        match coefficients.is_empty() {
            true => "none".to_owned(),
            false => coefficients.join(", "),
        },
    );
    if let Projection::Pinhole { focal_px, .. } = camera.projection {
        let angle = |side: u32| 2.0 * (f64::from(side) / 2.0 / focal_px).atan().to_degrees();
        let (w, h) = (angle(camera.width), angle(camera.height));
        line("view", format!("{w:.1}° across, {h:.1}° down"));
    }
    let from = if file.has_position() { "" } else { "; the file states none" };
    line("position", format!("{}{from}", triple(camera.eye)));
    line("looks along", triple(camera.forward));
    line("up", triple(camera.up));
    let (x, y, depth) = camera.project(DVec3::ZERO);
    line(
        "origin",
        match depth > Camera::NEAR {
            true => format!("at ({x:.1}, {y:.1}) pixels, depth {}", short(depth)),
            false => "behind the camera".to_owned(),
        },
    );
    if let (Some(_), Projection::Pinhole { focal_px, .. }) = (lens, camera.projection) {
        let (w, h) = (camera.width, camera.height);
        line("undistorted", format!("{w} x {h} pixels, focal {} pixels", short(focal_px)));
    }
    file.remarks.iter().for_each(|r| line("note", r.clone()));
}

/// A number with at most six digits.
fn short(x: f64) -> String {
    let digits = (5.0 - x.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{x:.digits$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &*text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn triple(v: DVec3) -> String {
    format!("({})", v.to_array().map(short).join(", "))
}

/// Where the axes are drawn: at the origin if the camera sees it, or else straight ahead.
fn anchor(camera: &Camera) -> DVec3 {
    let (x, y, depth) = camera.project(DVec3::ZERO);
    let within = |x: f64, side: u32| (0.0..=f64::from(side)).contains(&x);
    match depth > Camera::NEAR && within(x, camera.width) && within(y, camera.height) {
        true => DVec3::ZERO,
        false => camera.eye + camera.forward * camera.eye.length().max(1.0),
    }
}

/// Draws axes and a grid over the photograph, undistorted, or over grey.
fn axes(seen: &Seen, photo: Option<&Photo>, at: DVec3) -> Result<RgbImage, Failure> {
    let camera = &seen.camera;
    let (width, height) = picture_size(camera.width, camera.height);
    let mut out = match (photo, &seen.lens) {
        (Some(photo), Some(lens)) => {
            let photo = photo.undistorted(lens).map_err(|e| plain(e.to_string()))?;
            photo.shrunk(width.max(height)).rgb().clone()
        }
        (Some(photo), None) => photo.shrunk(width.max(height)).rgb().clone(),
        (None, _) => RgbImage::from_pixel(width, height, Rgb([48; 3])),
    };
    // An axis as long as a fifth of the picture, if seen from the side, in steps of 1, 2 or 5.
    let (_, _, depth) = camera.project(at);
    let unit = match camera.projection {
        Projection::Pinhole { focal_px, .. } => depth / focal_px,
        Projection::Orthographic { units_per_pixel, .. } => units_per_pixel,
    };
    let long = 0.2 * unit * f64::from(camera.width.max(camera.height));
    let ten = 10f64.powf(long.log10().floor());
    let long = ten
        * if long >= 5.0 * ten {
            5.0
        } else if long >= 2.0 * ten {
            2.0
        } else {
            1.0
        };
    let mut draw = |lines: &[[DVec3; 2]], color: [f32; 3]| {
        // In pieces, so that what is behind the camera can be left out.
        const PIECES: i32 = 32;
        let pieces = lines.iter().flat_map(|[a, b]| {
            (0..PIECES).filter_map(|i| {
                let end = |i: i32| {
                    let (x, y, depth) =
                        camera.project(a.lerp(*b, f64::from(i) / f64::from(PIECES)));
                    (depth > Camera::NEAR && x.abs() < 1e5 && y.abs() < 1e5).then_some([x, y])
                };
                Some([end(i)?, end(i + 1)?])
            })
        });
        let pieces: Vec<_> = pieces.collect();
        limbs(&mut out, (camera.width, camera.height), &pieces, color);
    };
    let half = 5.0 * long;
    let grid: Vec<_> = (-5..=5)
        .flat_map(|i| {
            let s = f64::from(i) * long;
            let line = |a: [f64; 2], b: [f64; 2]| [a, b].map(|[x, z]| at + DVec3::new(x, 0.0, z));
            [line([s, -half], [s, half]), line([-half, s], [half, s])]
        })
        .collect();
    draw(&grid, [150.0, 150.0, 150.0]);
    let colors = [[230.0, 60.0, 50.0], [60.0, 200.0, 90.0], [70.0, 130.0, 255.0]];
    for (axis, color) in DVec3::AXES.into_iter().zip(colors) {
        draw(&[[at, at + axis * long]], color);
    }
    print_line!("{:<12} {} units an axis", "grid", short(long));
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (x, text) in [
            (520.5, "520.5"),
            (0.1 + 0.2, "0.3"),
            (-1e-17, "0"),
            (1234567.8, "1234568"),
            (0.00123456789, "0.00123457"),
            (100.0, "100"),
        ] {
            assert_eq!(short(x), text);
        }
    }

    #[test]
    fn the_axes_are_where_the_camera_sees_them() {
        let camera = Camera::default_for(200, 200);
        let seen = Seen { camera, lens: None };
        let picture = axes(&seen, None, anchor(&camera)).unwrap();
        // 4.4 units across the picture; axes of 0.5 units are 0.114 of it.
        let side = picture.width();
        let is = |x: f64, y: f64, c: usize| {
            let [x, y] = [x, y].map(|f| (f * f64::from(side)) as u32);
            let p = picture.get_pixel(x, y).0;
            (0..3).all(|o| o == c || p[c] > p[o].saturating_add(40))
        };
        assert!(is(0.55, 0.5, 0) && is(0.61, 0.5, 0) && is(0.5, 0.45, 1));
        assert!(!is(0.63, 0.5, 0) && !is(0.5, 0.37, 1));
        assert_eq!(picture.get_pixel(50, 20).0, [48; 3]);
        let behind = Camera { forward: DVec3::Z, right: -DVec3::X, ..camera };
        assert_eq!(anchor(&behind), DVec3::new(0.0, 0.0, 16.0));
    }
}
