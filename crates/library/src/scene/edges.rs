//! The contours of a photograph, detected with other settings than the default.

use super::observed::{DetectorSettings, DetectorValue};
use super::{IMAGE, ImageValue, native};
use pcadlang_engine::lang::builtins::{Domain, Row, Type, arg, int, num, opt};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::vision::MOST_MAP_SIZE;

pub(super) const TABLE: &[Row] = &[native(
    "edges",
    "Comparing",
    &[
        arg("image", IMAGE, "The photograph. A contour map is returned unchanged."),
        int(
            "size",
            256,
            [8, 8192],
            "The longer side of the picture that is analysed; with a detector from a \
             file 512, at most 2048, and ignored by a network of fixed size.",
        )
        .unit("pixels"),
        num(
            "smooth",
            1.6,
            "The standard deviation of the smoothing: larger values give fewer and \
             longer contours. With a detector from a file it smooths the map, by 1.",
        )
        .within(Domain::From([0.3, 32.0]))
        .unit("pixels"),
        num(
            "strength",
            0.4,
            "The minimum strength of a contour point: weaker points are more often \
             texture than outline. 0.1 with a structured forest, 0.5 with a network.",
        )
        .within(Domain::From([0.0, 1.0])),
        opt(
            "detector",
            Type::Object("a detector"),
            "the run's",
            "The contour detector, `data d = detector(\"model.yml.gz\");`. By default that of the \
             run (`--edges`), or the built-in one, which uses colour gradients.",
        ),
    ],
    IMAGE,
    "The photograph with contours detected by these settings, for comparators. They are detected \
     once for each photograph and setting; a detector from a file runs once for each size.",
    |a| {
        // The photograph is missing when a program is examined without its data.
        if matches!(a.values.first(), Some(Value::Unit)) {
            return Ok(Value::Unit);
        }
        let image = a.object::<ImageValue>(0, "an image")?;
        let detector = match a.given("detector") {
            true => Some(a.object::<DetectorValue>("detector", "a detector")?),
            false => None,
        };
        let (mut by, usual) = DetectorSettings::usual(detector);
        let (most, old_size, old_sigma) = match &by {
            DetectorSettings::Gradients(g) => (8192, g.size, g.sigma),
            DetectorSettings::File { size, sigma, .. } => (MOST_MAP_SIZE, *size, *sigma),
        };
        // The defaults are those of the detector.
        let number = |name: &str, usual: f32| match a.is_written(name) {
            true => a.num(name),
            false => Ok(f64::from(usual)),
        };
        let asked = match a.is_written("size") {
            true => a.int_in("size", 8, i64::from(most))? as u32,
            false => old_size,
        };
        let (smooth, strength) = (number("smooth", old_sigma)?, number("strength", usual)?);
        match &mut by {
            DetectorSettings::Gradients(g) => (g.size, g.sigma) = (asked, smooth as f32),
            DetectorSettings::File { size, sigma, .. } => (*size, *sigma) = (asked, smooth as f32),
        }
        let found = image.detected_by(by, strength as f32).map_err(|f| f.of("scene.edges"))?;
        Ok(found.unwrap_or_else(|| a.get(0).clone()))
    },
)];

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_engine::lang::error::Fault;
    use pcadlang_scene::vision::{ContourMap, Photo};

    fn edges(image: &Value, more: &[f64]) -> Result<Value, Fault> {
        let table = crate::standard::table();
        let builtin = table.get(table.find("scene", "edges").unwrap());
        let numbers: Vec<Value> = more.iter().map(|x| Value::Num(*x)).collect();
        let values: Vec<&Value> = std::iter::once(image).chain(&numbers).collect();
        builtin.apply(&values)
    }

    #[test]
    fn they_are_found_once_for_each_setting() {
        let rgb = image::RgbImage::from_fn(64, 48, |x, y| {
            image::Rgb(if (x / 16 + y / 16) % 2 == 0 { [240, 30, 20] } else { [10, 60, 200] })
        });
        let photo = Value::object(ImageValue::photo(Photo::from_rgb(rgb).unwrap()));
        let count = |v: &Value| v.downcast::<ImageValue>().unwrap().map().unwrap().len();
        let (plain, smooth) = (edges(&photo, &[]).unwrap(), edges(&photo, &[256.0, 6.0]).unwrap());
        assert_eq!(
            count(&plain),
            count(&photo),
            "the defaults are those of a photograph by itself"
        );
        assert!(count(&smooth) < count(&plain) && count(&smooth) > 0);
        let again = edges(&photo, &[256.0, 6.0]).unwrap();
        assert!(std::ptr::eq(
            smooth.downcast::<ImageValue>().unwrap(),
            again.downcast::<ImageValue>().unwrap()
        ));
        assert!(smooth.downcast::<ImageValue>().unwrap().as_photo().is_some());
        assert!(edges(&photo, &[4.0]).is_err() && edges(&photo, &[64.0, f64::NAN]).is_err());
        let map = Value::object(ImageValue::contours(ContourMap::new(9, 9), None));
        assert_eq!(count(&edges(&map, &[]).unwrap()), 0);
        assert!(matches!(edges(&Value::Unit, &[]), Ok(Value::Unit)));
    }
}
