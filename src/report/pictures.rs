//! Pictures of a draw over the photograph, from plain buffers.

use image::{Rgb, RgbImage};

/// A drawn scene: row by row, `width` x `height` pixels.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<'a> {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Depth along the viewing axis, infinite off the object.
    pub depth: &'a [f32],
    /// Unit normals in the camera's frame: x right, y up, z towards the camera.
    pub normal: &'a [[f32; 3]],
}

/// Short straight pieces of contour in pixels of a picture of `width` x `height`.
#[derive(Clone, Copy, Debug)]
pub struct Strokes<'a> {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Middles.
    pub x: &'a [f32],
    /// Middles.
    pub y: &'a [f32],
    /// Unit tangents.
    pub tx: &'a [f32],
    /// Unit tangents.
    pub ty: &'a [f32],
    /// Lengths.
    pub length: &'a [f32],
}

/// The colour of contours.
const STROKE: [f32; 3] = [255.0, 60.0, 20.0];
/// Pictures are enlarged until their longer side has this many pixels.
pub const LONGER_SIDE: u32 = 768;

/// The size of pictures of a photograph of some size: at least [`LONGER_SIDE`] along the longer side.
pub fn picture_size(width: u32, height: u32) -> (u32, u32) {
    let longer = width.max(height).max(1);
    if longer >= LONGER_SIDE {
        return (width, height);
    }
    let scale = |x: u32| (u64::from(x) * u64::from(LONGER_SIDE) / u64::from(longer)).max(1) as u32;
    (scale(width), scale(height))
}

/// The shading of a pixel: a light at the camera and a little to its upper left; `None` off the object.
fn shade(d: &Drawn, i: usize) -> Option<[f32; 3]> {
    if !d.depth.get(i)?.is_finite() {
        return None;
    }
    let [x, y, z] = *d.normal.get(i)?;
    let light = (0.35 * (0.6 * z - 0.5 * x + 0.62 * y).max(0.0) + 0.5 * z.max(0.0) + 0.2).min(1.0);
    Some([150.0 * light + 60.0, 190.0 * light + 55.0, 235.0 * light + 20.0])
}

/// The surface drawn over the photograph, half transparent, with its contours on top. The drawing's size decides.
pub fn overlay(photo: Option<&RgbImage>, drawn: &Drawn, strokes: &Strokes) -> RgbImage {
    let mut out = match photo {
        Some(p) => image::imageops::resize(p, drawn.width, drawn.height, image::imageops::FilterType::Triangle),
        None => RgbImage::from_pixel(drawn.width, drawn.height, Rgb([245; 3])),
    };
    for (i, p) in out.pixels_mut().enumerate() {
        if let Some(s) = shade(drawn, i) {
            p.0 = mix(p.0, s, 0.55);
        }
    }
    draw_strokes(&mut out, strokes, STROKE);
    out
}

/// The shaded surface on a light ground.
pub fn shaded(drawn: &Drawn) -> RgbImage {
    let mut out = RgbImage::from_pixel(drawn.width, drawn.height, Rgb([250; 3]));
    for (i, p) in out.pixels_mut().enumerate() {
        if let Some(s) = shade(drawn, i) {
            p.0 = mix(p.0, s, 1.0);
        }
    }
    out
}

/// Contours on black, bright, as a ready contour map has them.
pub fn contours(width: u32, height: u32, strokes: &Strokes) -> RgbImage {
    let mut out = RgbImage::new(width, height);
    draw_strokes(&mut out, strokes, [255.0; 3]);
    out
}

/// How often each pixel showed the object, from black (never) to white (always).
pub fn frequency(width: u32, height: u32, counts: &[u32], of: u32) -> image::GrayImage {
    let value = |i: usize| (255.0 * counts.get(i).copied().unwrap_or(0) as f64 / f64::from(of.max(1))).round() as u8;
    image::GrayImage::from_fn(width, height, |x, y| image::Luma([value((y * width + x) as usize)]))
}

/// Pictures of one size in rows, with thin lines between them.
pub fn contact_sheet(pictures: &[RgbImage], columns: u32) -> RgbImage {
    let Some(first) = pictures.first() else { return RgbImage::new(1, 1) };
    let (w, h) = first.dimensions();
    let columns = columns.clamp(1, pictures.len() as u32);
    let rows = (pictures.len() as u32).div_ceil(columns);
    let mut sheet = RgbImage::from_pixel(columns * (w + 2) + 2, rows * (h + 2) + 2, Rgb([200; 3]));
    for (i, p) in pictures.iter().enumerate() {
        let (x, y) = (i as u32 % columns, i as u32 / columns);
        image::imageops::replace(&mut sheet, p, i64::from(2 + x * (w + 2)), i64::from(2 + y * (h + 2)));
    }
    sheet
}

/// The bytes of a PNG file.
///
/// # Errors
/// If the picture has no pixels.
pub fn png<P>(picture: &image::ImageBuffer<P, Vec<u8>>) -> Result<Vec<u8>, image::ImageError>
where
    P: image::Pixel<Subpixel = u8> + image::PixelWithColorType,
{
    let mut bytes = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png)?;
    Ok(bytes)
}

fn mix(under: [u8; 3], over: [f32; 3], share: f32) -> [u8; 3] {
    [0, 1, 2].map(|c| (f32::from(under[c]) * (1.0 - share) + over[c].clamp(0.0, 255.0) * share).round() as u8)
}

/// Anti-aliased strokes, about 2 pixels wide in a picture of [`LONGER_SIDE`].
fn draw_strokes(out: &mut RgbImage, s: &Strokes, color: [f32; 3]) {
    let (w, h) = (out.width() as f32, out.height() as f32);
    let (sx, sy) = (w / s.width.max(1) as f32, h / s.height.max(1) as f32);
    let half_width = (w.max(h) / LONGER_SIDE as f32).max(0.7);
    let mut cover = vec![0.0f32; (w * h) as usize];
    let lists = s.x.iter().zip(s.y).zip(s.tx.iter().zip(s.ty)).zip(s.length);
    for (((x, y), (tx, ty)), length) in lists {
        let (x, y, dx, dy) = (x * sx, y * sy, tx * sx * length * 0.5, ty * sy * length * 0.5);
        let reach_x = dx.abs() + half_width + 1.0;
        let reach_y = dy.abs() + half_width + 1.0;
        let square = dx * dx + dy * dy;
        for v in (y - reach_y).max(0.0) as u32..((y + reach_y + 1.0).clamp(0.0, h) as u32) {
            for u in (x - reach_x).max(0.0) as u32..((x + reach_x + 1.0).clamp(0.0, w) as u32) {
                let (px, py) = (u as f32 + 0.5 - x, v as f32 + 0.5 - y);
                let t = if square > 0.0 { ((px * dx + py * dy) / square).clamp(-1.0, 1.0) } else { 0.0 };
                let d = (px - t * dx).hypot(py - t * dy);
                let c = (half_width + 0.5 - d).clamp(0.0, 1.0);
                let at = &mut cover[v as usize * w as usize + u as usize];
                *at = at.max(c);
            }
        }
    }
    for (p, c) in out.pixels_mut().zip(cover) {
        if c > 0.0 {
            p.0 = mix(p.0, color, c);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_shines_through_and_strokes_are_drawn() {
        let (depth, normal) = ([f32::INFINITY, 3.0, 3.0, f32::INFINITY], [[0.0, 0.0, 1.0]; 4]);
        let drawn = Drawn { width: 2, height: 2, depth: &depth, normal: &normal };
        let none = Strokes { width: 2, height: 2, x: &[], y: &[], tx: &[], ty: &[], length: &[] };
        let photo = RgbImage::from_pixel(2, 2, Rgb([0, 0, 0]));
        let o = overlay(Some(&photo), &drawn, &none);
        assert_eq!(o.get_pixel(0, 0).0, [0, 0, 0]);
        assert!(o.get_pixel(1, 0).0[2] > 80);
        let stroke = Strokes { width: 20, height: 20, x: &[10.0], y: &[10.0], tx: &[1.0], ty: &[0.0], length: &[8.0] };
        let c = contours(20, 20, &stroke);
        assert!(c.get_pixel(8, 10).0[0] > 100 && c.get_pixel(8, 14).0[0] == 0 && c.get_pixel(17, 10).0[0] == 0);
    }

    #[test]
    fn sheets_and_sizes() {
        let p = RgbImage::from_pixel(10, 5, Rgb([1, 2, 3]));
        let sheet = contact_sheet(&vec![p; 5], 3);
        assert_eq!(sheet.dimensions(), (3 * 12 + 2, 2 * 7 + 2));
        assert_eq!(sheet.get_pixel(2, 2).0, [1, 2, 3]);
        assert_eq!(picture_size(256, 128), (768, 384));
        assert_eq!(picture_size(4000, 10), (4000, 10));
        assert_eq!(frequency(2, 1, &[0, 3], 4).into_raw(), [0, 191]);
        assert!(png(&sheet).unwrap().starts_with(b"\x89PNG"));
    }
}
