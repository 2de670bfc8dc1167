//! The lens that a camera recorded in a photograph's Exif data.
//!
//! Damaged data count as missing: they never make a picture unreadable. Editors may crop a picture
//! and keep its lens, so one that is not of the stated proportions, or of none that cameras have,
//! states no lens.

use exif::{Exif, In, Reader, Tag, Value};

/// The sides of a 35 mm frame. Focal lengths are equivalent if the diagonal angles of view are
/// (CIPA DCG-001).
const FRAME: [f64; 2] = [36.0, 24.0];

/// Proportions of pictures that cameras take, longer to shorter side: of sensors, and 16:9, for
/// which the top and bottom of a sensor are left out and the equivalent stays that of the sensor.
const PROPORTIONS: [f64; 3] = [4.0 / 3.0, 1.5, 16.0 / 9.0];

/// Returns the focal length that the Exif data of a picture of this size state, in longer sides of
/// the picture: by the 35 mm equivalent, or else by the focal length and the sensor's pixels.
pub(super) fn focal(chunk: &[u8], (width, height): (u32, u32)) -> Option<f64> {
    let chunk = chunk.strip_prefix(b"Exif\0\0").unwrap_or(chunk);
    let exif = Reader::new()
        .continue_on_error(true)
        .read_raw(chunk.to_vec())
        .or_else(|e| e.distill_partial_result(|_| ()))
        .ok()?;
    let (longer, shorter) = (f64::from(width.max(height)), f64::from(width.min(height)));
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.01;
    let stated = number(&exif, Tag::PixelXDimension)
        .zip(number(&exif, Tag::PixelYDimension))
        .map(|(x, y)| (x.max(y), x.min(y)));
    let proportions = longer / shorter;
    if !PROPORTIONS.iter().any(|p| near(proportions, *p))
        || stated.is_some_and(|(x, y)| !near(x / y, proportions))
    {
        return None;
    }
    let equivalent = || {
        let mm = number(&exif, Tag::FocalLengthIn35mmFilm)?;
        let whole = if proportions > 1.6 { longer / 1.5 } else { shorter };
        Some(mm / libm::hypot(FRAME[0], FRAME[1]) * libm::hypot(longer, whole) / longer)
    };
    // Pixels of the whole picture per millimetre, so of the stated size, not of a smaller copy.
    let by_sensor = || {
        let mm = number(&exif, Tag::FocalLength)?;
        let across = number(&exif, Tag::FocalPlaneXResolution)?;
        let unit = match number(&exif, Tag::FocalPlaneResolutionUnit).map_or(2, |u| u as u32) {
            2 => 25.4,
            3 => 10.0,
            4 => 1.0,
            _ => return None,
        };
        Some(mm * across / unit / stated?.0)
    };
    equivalent().or_else(by_sensor).filter(|f| (0.2..=50.0).contains(f))
}

/// The number of a field, above 0.
fn number(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Short(v) => f64::from(*v.first()?),
        Value::Long(v) => f64::from(*v.first()?),
        Value::Rational(v) => v.first()?.to_f64(),
        _ => return None,
    };
    (value > 0.0 && value.is_finite()).then_some(value)
}

#[cfg(test)]
#[path = "exif_tests.rs"]
pub(super) mod tests;
