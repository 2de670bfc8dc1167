//! The contours of a photograph, found otherwise than by default.

use super::{IMAGE, native};
use crate::lang::builtins::scene::ImageValue;
use crate::lang::builtins::{Row, Type, arg, opt};
use crate::lang::error::Fault;
use crate::lang::value::Value;
use crate::vision::GradientDetector;

pub(super) const TABLE: &[Row] = &[native(
    "edges",
    "Comparing",
    &[
        arg("image", IMAGE, "The photograph. A ready contour map stays as it is."),
        opt("size", Type::Int, "256", "The longer side of the picture worked on, 8 to 8192.").unit("pixels"),
        opt(
            "smooth",
            Type::Num,
            "1.6",
            "The spread of the smoothing, 0.3 to 32: more finds fewer and longer contours.",
        )
        .unit("pixels"),
        opt(
            "strength",
            Type::Num,
            "0.4",
            "Points weaker than this, of 1, are left out: they are more often texture than outline.",
        ),
    ],
    IMAGE,
    "The photograph with its contours found by these settings, for comparators. Of one photograph and one setting they are found once.",
    |a| {
        // A photograph that is not given, where a program is looked at without one.
        if matches!(a.values.first(), Some(Value::Unit)) {
            return Ok(Value::Unit);
        }
        let image = a.object::<ImageValue>(0, "an image")?;
        let by = GradientDetector::default();
        let size = if a.given(1) { a.int_in(1, 8, 8192)? as u32 } else { by.size };
        let sigma = a.num_or(2, f64::from(by.sigma))?;
        let strength = a.num_or(3, f64::from(ImageValue::STRONG))?;
        if !(0.3..=32.0).contains(&sigma) {
            return Err(a.outside(2, "from 0.3 to 32"));
        }
        if !(0.0..=1.0).contains(&strength) {
            return Err(a.outside(3, "from 0 to 1"));
        }
        image
            .detected_by(GradientDetector { size, sigma: sigma as f32, ..by }, strength as f32)
            .map_err(Fault::domain)
            .map(|found| found.unwrap_or_else(|| a.get(0).clone()))
    },
)];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::{ContourMap, Photo};

    fn edges(image: &Value, more: &[f64]) -> Result<Value, Fault> {
        let table = crate::lang::builtins::Table::default();
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
        let count = |v: &Value| v.downcast::<ImageValue>().unwrap().map().len();
        let (plain, smooth) = (edges(&photo, &[]).unwrap(), edges(&photo, &[256.0, 6.0]).unwrap());
        assert_eq!(count(&plain), count(&photo), "the defaults are those of a photograph by itself");
        assert!(count(&smooth) < count(&plain) && count(&smooth) > 0);
        let again = edges(&photo, &[256.0, 6.0]).unwrap();
        assert!(std::ptr::eq(smooth.downcast::<ImageValue>().unwrap(), again.downcast::<ImageValue>().unwrap()));
        assert!(smooth.downcast::<ImageValue>().unwrap().as_photo().is_some());
        assert!(edges(&photo, &[4.0]).is_err() && edges(&photo, &[64.0, f64::NAN]).is_err());
        let map = Value::object(ImageValue::contours(ContourMap::new(9, 9), None));
        assert_eq!(count(&edges(&map, &[]).unwrap()), 0);
        assert!(matches!(edges(&Value::Unit, &[]), Ok(Value::Unit)));
    }
}
