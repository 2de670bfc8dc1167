//! Places in a photograph where an object of revolution may be, as values: a thin layer over
//! [`super::places`].

use super::hint::{HINT, asked};
use super::observed_maps::MaskValue;
use super::places::{Place, PlaceAxis};
use super::seeing::camera;
use super::{CAMERA, IMAGE, ImageValue, native};
use glam::DVec3;
use pcadlang_engine::lang::builtins::{Row, Type, arg, int, opt};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::render::{Camera, Projection};
use pcadlang_scene::vision::Mask;
use pcadlang_scene::vision::candidates::{CandidateOptions, tilts};
use std::sync::Arc;

pub(super) const TABLE: &[Row] = &[native(
    "candidates",
    "Finding",
    &[
        arg(
            "photo",
            IMAGE,
            "The photograph; from a contour map alone, the enclosed regions are used.",
        ),
        int("most", 20, [1, 64], "The maximum number of regions."),
        int(
            "size",
            128,
            [32, 512],
            "The longer side of the picture in which regions are searched; 256 for a contour map.",
        )
        .unit("pixels"),
        opt("camera", CAMERA, "the run's", "The camera; by default, that of the run."),
        HINT,
    ],
    Type::Array,
    "Places in a photograph where an object of revolution may be, the most probable first: the one \
     that the hint points out, by a mask or an outline, an axis, or a box; or else up to three boxes \
     of vessels and fruit that the built-in detector sees, or of anything at a click, and regions \
     that are nearly mirror-symmetric. Each is a record: `score`, its probability; `source`, \
     \"drawn\", \"axis\", \"box\", the class that the detector sees, or \"region\"; `box`, [x, y, \
     width, height] in pixels, or [] if none points to it; `masks`, the outline that was drawn, or \
     guesses of it, the best symmetric one, a graph cut, then others; `axes`, records with a \
     `weight`, all of a place adding up to 1; `mask`, the index of the outline; `symmetry`, 0 to 1; the ends `foot` and \
     `top`, in a fronto-parallel plane at about the distance of the origin; their distance `length`; \
     the unit vectors `along`, from foot to top, and `toward` the camera, which is at `distance`; \
     `widths`, 24 half-widths from foot to top; `tilts`, 80 angles by which the axis may be turned \
     towards the camera, radians, and `rims`, the evidence for each of them, 0 to 1: whether a flat \
     end would appear as an ellipse of that height. Lengths are in scene units. Depends only on the \
     picture, the hint and the camera, and is computed once.",
    |a| {
        if matches!(a.values.first(), Some(Value::Unit)) {
            let nowhere = value(&Place::anywhere(1.0), &Camera::default_for(1, 1), [1.0; 2]);
            return Ok(Value::List(Arc::from([nowhere])));
        }
        let image = a.object::<ImageValue>(0, "an image")?;
        let (width, height) = image.size();
        // Regions of a contour map are enclosed by thin lines.
        let size = match image.as_photo() {
            None if !a.is_written("size") => 256,
            _ => a.int("size")?,
        };
        let camera = camera(a, (width, height))?;
        let options = CandidateOptions { most: a.int("most")? as usize, size };
        let key = (options, asked(a, image)?.into_owned(), camera);
        let all = image.prepared().get(key, |(options, hint, camera)| {
            let found = image.places(options, hint).map_err(|f| f.of("scene.candidates"))?;
            let scale = [
                f64::from(camera.width) / f64::from(width.max(1)),
                f64::from(camera.height) / f64::from(height.max(1)),
            ];
            Ok(Value::List(found.iter().map(|p| value(p, camera, scale)).collect()))
        })?;
        Ok(Value::clone(&all))
    },
)];

/// Converts a place to a record; `scale` is the size of a photograph's pixel in pixels of
/// the camera.
fn value(p: &Place, camera: &Camera, scale: [f64; 2]) -> Value {
    let axes = p.axes.iter().map(|a| axis(a, camera, scale)).collect();
    let mask = |m: &Mask| Value::object(MaskValue::new(m.clone()));
    Value::record([
        ("score", Value::Num(p.score)),
        ("source", Value::str(&p.source)),
        ("box", Value::array(p.bounds.map_or(Vec::new(), |b| b.to_vec()))),
        ("masks", Value::List(p.masks.iter().map(mask).collect())),
        ("axes", Value::List(axes)),
    ])
}

fn axis(placed: &PlaceAxis, camera: &Camera, scale: [f64; 2]) -> Value {
    let a = &placed.axis;
    // The midpoint of the axis is placed at the depth of the origin; the axis lies in the
    // plane through it that faces the camera.
    let depth = (-camera.eye).dot(camera.forward).max(Camera::NEAR);
    let at = |[x, y]: [f64; 2], depth| camera.unproject(x * scale[0], y * scale[1], depth);
    let middle = at([0.5 * (a.foot[0] + a.top[0]), 0.5 * (a.foot[1] + a.top[1])], depth);
    let (toward, distance) = match camera.projection {
        Projection::Pinhole { .. } => {
            ((camera.eye - middle).normalize_or(-camera.forward), camera.eye.distance(middle))
        }
        Projection::Orthographic { .. } => (-camera.forward, f64::INFINITY),
    };
    let there = |pixel: [f64; 2]| {
        let (near, far) = (at(pixel, 0.0), at(pixel, depth));
        let ray = far - near;
        near + ray * ((middle - near).dot(toward) / ray.dot(toward))
    };
    let (foot, top) = (there(a.foot), there(a.top));
    let [dx, dy] = [a.top[0] - a.foot[0], a.top[1] - a.foot[1]];
    let pixels = f64::hypot(dx, dy).max(1e-9);
    let last = a.widths.len() as f64;
    let width = |(i, w): (usize, &f64)| {
        let (t, across) = ((i as f64 + 0.5) / last, [-dy / pixels * w, dx / pixels * w]);
        let side = |s: f64| {
            there([a.foot[0] + t * dx + s * across[0], a.foot[1] + t * dy + s * across[1]])
        };
        0.5 * side(1.0).distance(side(-1.0))
    };
    let vector = |v: DVec3| Value::array(v.to_array().to_vec());
    Value::record([
        ("weight", Value::Num(placed.weight)),
        ("mask", Value::Num(placed.mask as f64)),
        ("symmetry", Value::Num(a.symmetry)),
        ("foot", vector(foot)),
        ("top", vector(top)),
        ("length", Value::Num(foot.distance(top))),
        ("along", vector((top - foot).normalize_or(camera.up))),
        ("toward", vector(toward)),
        ("distance", Value::Num(distance)),
        ("widths", Value::array(a.widths.iter().enumerate().map(width).collect::<Vec<_>>())),
        ("tilts", Value::array(tilts().collect::<Vec<_>>())),
        ("rims", Value::array(a.rims.clone())),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_scene::vision::candidates::Axis;

    /// A disc that faces the camera, far from the centre of the picture, is as long as it
    /// is wide in every direction.
    #[test]
    fn lengths_are_those_of_a_plane_that_faces_the_eye() {
        let camera = Camera::default_for(256, 256);
        let (middle, radius) = (DVec3::new(1.7, -1.4, 0.0), 0.3);
        let toward = (camera.eye - middle).normalize();
        let across = toward.cross(DVec3::Y).normalize();
        for i in 0..6 {
            let angle = f64::from(i) * 0.5;
            let along = libm::cos(angle) * across + libm::sin(angle) * toward.cross(across);
            let pixel = |by: f64| {
                let (x, y, _) = camera.project(middle + by * radius * along);
                [x, y]
            };
            let (foot, top) = (pixel(-1.0), pixel(1.0));
            let (x, y, _) = camera.project(middle + radius * toward.cross(along));
            let [ux, uy] = [top[0] - foot[0], top[1] - foot[1]];
            let (mx, my) = (0.5 * (foot[0] + top[0]), 0.5 * (foot[1] + top[1]));
            let width = ((x - mx) * uy - (y - my) * ux).abs() / f64::hypot(ux, uy);
            let seen = Axis { symmetry: 1.0, foot, top, widths: vec![width], rims: Vec::new() };
            let made = axis(&PlaceAxis { axis: seen, weight: 1.0, mask: 0 }, &camera, [1.0, 1.0]);
            let Value::Record(fields) = &made else { panic!("no record") };
            let number = |name: &str| match fields.get(name) {
                Some(Value::Num(x)) => *x,
                Some(Value::Array(xs)) => xs[0],
                _ => panic!("{name}"),
            };
            assert!(
                (number("length") / (2.0 * radius) - 1.0).abs() < 0.004,
                "{i}: {}",
                number("length")
            );
            assert!((number("widths") / radius - 1.0).abs() < 0.012, "{i}: {}", number("widths"));
            assert!((number("distance") - camera.eye.distance(middle)).abs() < 0.02);
        }
    }
}
