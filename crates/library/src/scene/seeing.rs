//! Cameras and views.

use super::{CAMERA, CameraValue, SOLID, SolidValue, VIEW, ViewValue, incremental, native};
use glam::DVec3;
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{Args, Default, Row, Type, arg, int, num, opt};
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::render::{Camera, View};
use smallvec::smallvec;
use std::sync::Arc;

const SECTION: &str = "Seeing";

pub(super) const TABLE: &[Row] = &[
    native(
        "camera",
        SECTION,
        &[
            arg("position", Type::Array, "The position of the camera.")
                .or(Default::Nums(&[0.0, 0.0, 8.0]))
                .unit("scene units"),
            arg("look_at", Type::Array, "The point it looks at, at the centre of the picture.")
                .or(Default::Nums(&[0.0, 0.0, 0.0]))
                .unit("scene units"),
            arg("up", Type::Array, "The direction that points up in the picture.")
                .or(Default::Nums(&[0.0, 1.0, 0.0])),
            num("focal", 8.0 / 4.4, "The focal length as a multiple of the picture's longer side.")
                .positive(),
            int("width", 256, [1, 16384], "The width of the picture.").unit("pixels"),
            int("height", 256, [1, 16384], "The height of the picture.").unit("pixels"),
        ],
        CAMERA,
        "A pinhole camera. By default a view uses the camera of the run: `--camera`, or the default view.",
        |a| {
            let vector = |name: &str| a.vec3(name).map(DVec3::from);
            let places = [vector("position")?, vector("look_at")?, vector("up")?];
            let (focal, width, height) = (a.num("focal")?, a.int("width")?, a.int("height")?);
            let focal_px = focal * f64::from(width.max(height));
            let camera = Camera::looking_at(places, focal_px, (width, height));
            camera.map(|c| Value::object(CameraValue::new(c))).ok_or_else(|| {
                Fault::domain(
                    "scene.camera: the viewing direction must not be zero or parallel to `up`",
                )
            })
        },
    ),
    incremental(
        "render",
        SECTION,
        &[
            arg("solid", SOLID, "The solid to view."),
            opt("camera", CAMERA, "the run's", "The camera; by default, that of the run."),
            opt(
                "metre",
                Type::Num,
                "none",
                "The length of a metre, such as the scale of a body. Files of the scene are then in metres.",
            )
            .positive()
            .unit("scene units"),
        ],
        VIEW,
        "A solid seen by a camera. It is rendered only when a likelihood or report needs it.",
        |a, previous| {
            let solid = a.object::<SolidValue>(0, "a solid")?;
            let view = View::new(solid.0.clone(), camera(a, (256, 256))?);
            let view = match a.given("metre") {
                true => view.in_metres(a.num("metre")?),
                false => view,
            };
            let view = match previous.and_then(|p| p.value.downcast::<ViewValue>()) {
                Some(previous) => view.after(&previous.0),
                None => view,
            };
            // The view holds all that the next one needs.
            Ok((Value::object(ViewValue(Arc::new(view))), Arc::new(())))
        },
    )
    // The picture does not depend on the unit of files.
    .vjp(|_, _, by| Some(smallvec![by.clone(), Adjoint::Unknown, Adjoint::Zero])),
    native(
        "bounds",
        SECTION,
        &[arg("view", VIEW, "The view.")],
        Type::Array,
        "The bounding box of a solid in the picture: left, top, right and bottom of all its \
         vertices, as fractions of the picture's sides, so that values below 0 or above 1 are \
         outside the picture. Infinite if it extends behind the camera, or has no vertices.",
        |a| {
            let view = a.object::<ViewValue>(0, "a view")?;
            let b = view.0.image_bounds();
            Ok(Value::array(b.to_vec()))
        },
    ),
];

/// The camera of a call, or the default view with a picture of this size.
pub(super) fn camera(a: &Args, (width, height): (u32, u32)) -> Result<Camera, Fault> {
    match a.given("camera") {
        true => Ok(a.object::<CameraValue>("camera", "a camera")?.0),
        false => Ok(Camera::default_for(width, height)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use pcadlang_scene::geom::Affine;

    fn bounds(at: DVec3) -> Vec<f64> {
        let cube = pcadlang_scene::geom::cuboid(DVec3::splat(1.0))
            .map(|m| pcadlang_scene::geom::Solid::new(Arc::new(m)))
            .unwrap();
        let solid = cube.placed(Affine::new(at, DVec3::ZERO, DVec3::ONE));
        let view =
            Value::object(ViewValue(Arc::new(View::new(solid, Camera::default_for(256, 256)))));
        let table = crate::standard::table();
        let builtin = table.get(table.find("scene", "bounds").unwrap());
        builtin.apply(&[&view]).unwrap().numbers()
    }

    #[test]
    fn an_argument_that_is_gone_says_so() {
        let text = "include \"std/scene.pcad\" as scene;
            let view = scene.render(scene.sphere(1), detail = 0.5);";
        let error = crate::Program::parse(text).and_then(crate::Program::compile).unwrap_err();
        assert!(error.to_string().contains("no argument `detail` any more"), "{error}");
    }

    #[test]
    fn bounds_of_a_cube() {
        // Half a unit at depth 7.5 is 8 / 4.4 * 0.5 / 7.5 of the picture.
        let half = 8.0 / 4.4 * 0.5 / 7.5;
        let b = bounds(DVec3::ZERO);
        for (b, expected) in b.iter().zip([0.5 - half, 0.5 - half, 0.5 + half, 0.5 + half]) {
            assert!((b - expected).abs() < 1e-9, "{b} {expected}");
        }
        let out = bounds(DVec3::new(4.0, 0.0, 0.0));
        assert!(out[0] > 1.0 && out[2] > out[0], "{out:?}");
        assert_eq!(bounds(DVec3::new(0.0, 0.0, 8.0))[2], f64::INFINITY);
    }
}
