//! Tests with good and bad pictures, in memory and in a temporary folder.

use super::*;
use image::{GrayAlphaImage, GrayImage, ImageBuffer, Luma, LumaA, Rgb, Rgba, RgbaImage};

fn encoded(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    picture.into().write_to(&mut out, format).unwrap();
    out.into_inner()
}

fn read(bytes: &[u8]) -> Result<Photo, VisionError> {
    decode(bytes, &Limits::default())
}

fn colours(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |i, j| {
        Rgb([(i * 17 % 256) as u8, (j * 31 % 256) as u8, ((i + j) * 7 % 256) as u8])
    })
}

/// A PNG chunk.
fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut crc = u32::MAX;
    for &b in kind.iter().chain(data) {
        crc ^= u32::from(b);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
        }
    }
    [&(data.len() as u32).to_be_bytes()[..], kind, data, &(!crc).to_be_bytes()].concat()
}

fn png_header(width: u32, height: u32) -> Vec<u8> {
    let ihdr = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 2, 0, 0, 0]].concat();
    [
        b"\x89PNG\r\n\x1a\n".as_slice(),
        &chunk(b"IHDR", &ihdr),
        &chunk(b"IDAT", &[0x78, 0x9c]),
        &chunk(b"IEND", &[]),
    ]
    .concat()
}

#[test]
fn every_kind_of_pixel() {
    let rgb = colours(9, 5);
    assert_eq!(read(&encoded(rgb.clone(), ImageFormat::Png)).unwrap().rgb(), &rgb);
    let grey = GrayImage::from_fn(4, 3, |i, j| Luma([(i * 60 + j) as u8]));
    let photo = read(&encoded(grey.clone(), ImageFormat::Png)).unwrap();
    assert!(photo.rgb().pixels().zip(grey.pixels()).all(|(p, g)| p.0 == [g.0[0]; 3]));
    let deep = ImageBuffer::<Luma<u16>, _>::from_raw(3, 1, vec![0u16, 257 * 100, 65535]).unwrap();
    let photo = read(&encoded(deep, ImageFormat::Png)).unwrap();
    assert_eq!(photo.rgb().as_raw()[..], [0, 0, 0, 100, 100, 100, 255, 255, 255]);
    // Alpha is composited over white.
    let alpha =
        RgbaImage::from_raw(3, 1, vec![10, 20, 30, 255, 10, 20, 30, 0, 0, 0, 0, 128]).unwrap();
    let photo = read(&encoded(alpha, ImageFormat::Png)).unwrap();
    assert_eq!(photo.rgb().as_raw()[..], [10, 20, 30, 255, 255, 255, 127, 127, 127]);
    let alpha =
        ImageBuffer::<Rgba<u16>, _>::from_raw(2, 1, vec![0u16, 65535, 0, 65535, 0, 0, 0, 32768])
            .unwrap();
    let photo = read(&encoded(alpha, ImageFormat::Png)).unwrap();
    assert_eq!(photo.rgb().as_raw()[..], [0, 255, 0, 127, 127, 127]);
    let alpha = GrayAlphaImage::from_pixel(1, 1, LumaA([0, 51]));
    assert_eq!(
        read(&encoded(alpha, ImageFormat::Png)).unwrap().rgb().as_raw()[..],
        [204, 204, 204]
    );
    let flat = read(&encoded(RgbImage::from_pixel(20, 10, Rgb([200, 100, 50])), ImageFormat::Jpeg))
        .unwrap();
    assert!(
        flat.rgb().pixels().all(|p| p
            .0
            .iter()
            .zip([200u8, 100, 50])
            .all(|(a, b)| a.abs_diff(b) <= 3))
    );
    assert!(read(&encoded(grey, ImageFormat::Jpeg)).is_ok());
}

#[test]
fn palettes() {
    // Two 1-bit pixels: red, then partly transparent green.
    let ihdr = [&2u32.to_be_bytes()[..], &1u32.to_be_bytes(), &[1, 3, 0, 0, 0]].concat();
    // zlib, one stored block: filter 0, bits 01.
    let idat = [0x78, 0x01, 0x01, 2, 0, 0xfd, 0xff, 0, 0b0100_0000, 0, 0x42, 0, 0x41];
    let png = [
        b"\x89PNG\r\n\x1a\n".as_slice(),
        &chunk(b"IHDR", &ihdr),
        &chunk(b"PLTE", &[255, 0, 0, 0, 255, 0]),
        &chunk(b"tRNS", &[255, 51]),
        &chunk(b"IDAT", &idat),
        &chunk(b"IEND", &[]),
    ]
    .concat();
    assert_eq!(read(&png).unwrap().rgb().as_raw()[..], [255, 0, 0, 204, 255, 204]);
}

#[test]
fn orientation_and_focal_length() {
    use crate::vision::pictures::exif::tests::{Field, chunk as exif};
    let chunk_of = |orientation| exif(orientation, &[(0xA405, Field::Short(28))]);
    let rgb =
        RgbImage::from_fn(32, 24, |i, _| if i < 16 { Rgb([255, 0, 0]) } else { Rgb([0, 0, 255]) });
    let jpeg = encoded(rgb, ImageFormat::Jpeg);
    let with = |orientation| {
        let body = [b"Exif\0\0".as_slice(), &chunk_of(orientation)].concat();
        let length = (body.len() as u16 + 2).to_be_bytes();
        [&jpeg[..2], &[0xff, 0xe1], &length, &body, &jpeg[2..]].concat()
    };
    let red = |p: &Photo, x, y| p.rgb().get_pixel(x, y).0[0] > 128;
    let photo = read(&with(1)).unwrap();
    assert_eq!((photo.width(), photo.height()), (32, 24));
    // 28 mm, by the diagonals: 40 pixels for 43.27 mm.
    assert!((photo.focal().unwrap() * 32.0 - 28.0 / 43.2666 * 40.0).abs() < 1e-3);
    assert_eq!(photo.shrunk(8).focal(), photo.focal());
    assert!(red(&photo, 3, 8) && !red(&photo, 28, 8));
    let photo = read(&with(3)).unwrap();
    assert!(!red(&photo, 3, 8) && red(&photo, 28, 8));
    // 6: rotated clockwise by a quarter turn, so the left side is at the top.
    let photo = read(&with(6)).unwrap();
    assert_eq!((photo.width(), photo.height()), (24, 32));
    assert!(photo.focal().is_some());
    assert!(red(&photo, 8, 3) && !red(&photo, 8, 28));
    let photo = read(&with(8)).unwrap();
    assert!(!red(&photo, 8, 3) && red(&photo, 8, 28));
    assert_eq!(read(&with(99)).unwrap().width(), 32);
}

#[test]
fn bad_bytes_say_what_is_wrong() {
    assert!(matches!(read(b""), Err(VisionError::Empty)));
    assert!(matches!(
        read(b"hello, I am no picture"),
        Err(VisionError::NotAnImage(" (it is text)"))
    ));
    assert!(matches!(read(b"GIF89a\x01\0"), Err(VisionError::NotAnImage(_))));
    assert!(matches!(read(b"\x89PN"), Err(VisionError::Truncated)));
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let good = encoded(colours(40, 30), format);
        assert!(read(&good).is_ok());
        // The last bytes of a PNG are its end chunk, after all pixels.
        for n in (9..good.len() - 14).step_by(good.len() / 50) {
            let error = read(&good[..n]).unwrap_err();
            assert!(
                matches!(error, VisionError::Truncated | VisionError::Damaged(_)),
                "{format:?} {n}: {error}"
            );
        }
        let half = read(&good[..good.len() / 2]).unwrap_err();
        assert!(matches!(half, VisionError::Truncated), "{format:?}: {half:?}");
    }
    // Damage in the middle never panics.
    let good = encoded(colours(40, 30), ImageFormat::Png);
    for at in 8..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 0x55;
        let _ = read(&bad);
    }
}

#[test]
fn size_is_checked_before_pixels() {
    let huge = read(&png_header(60000, 60000)).unwrap_err();
    assert!(matches!(huge, VisionError::TooLarge { width: 60000, height: 60000, .. }), "{huge}");
    let absurd = read(&png_header(i32::MAX as u32, i32::MAX as u32)).unwrap_err();
    assert!(matches!(absurd, VisionError::TooLarge { .. }), "{absurd}");
    assert!(matches!(read(&png_header(0, 5)), Err(VisionError::Damaged(_))));
    assert!(matches!(read(&png_header(16385, 1)), Err(VisionError::TooLarge { .. })));
    assert!(matches!(read(&png_header(10001, 10000)), Err(VisionError::TooLarge { .. })));
    assert!(matches!(
        read(&png_header(100, 100)),
        Err(VisionError::Truncated | VisionError::Damaged(_))
    ));
    let long = read(&encoded(colours(16384, 1), ImageFormat::Png)).unwrap();
    assert_eq!((long.width(), long.height()), (16384, 1));
    let small = Limits { max_side: 10, max_pixels: 50 };
    assert!(decode(&encoded(colours(10, 5), ImageFormat::Png), &small).is_ok());
    assert!(decode(&encoded(colours(10, 6), ImageFormat::Png), &small).is_err());
}

#[test]
fn the_content_decides_and_not_the_name() {
    assert!(matches!(read(b"").unwrap_err(), VisionError::Empty));
    assert!(matches!(read(b"some text").unwrap_err(), VisionError::NotAnImage(_)));
    assert!(read(&encoded(colours(8, 8), ImageFormat::Jpeg)).is_ok());
}

#[test]
fn shrinking_is_in_linear_light() {
    // Black and white stripes one pixel wide: half the light is sRGB 188, not 128.
    let stripes =
        Photo::from_rgb(RgbImage::from_fn(64, 32, |i, _| Rgb([(i % 2 * 255) as u8; 3]))).unwrap();
    let small = stripes.shrunk(32);
    assert_eq!((small.width(), small.height()), (32, 16));
    assert!(small.rgb().as_raw().iter().all(|&v| v == 188));
    assert_eq!(stripes.shrunk(64), stripes);
    assert_eq!(stripes.linear(1, 1).rgb.len(), 1);
    assert!(Photo::from_rgb(RgbImage::new(0, 3)).is_err());
}

fn resize(w: u32, h: u32, data: &[f32], to: (u32, u32)) -> Vec<f32> {
    resize_rows((w, h), to, |j, row| {
        for (p, v) in row.iter_mut().zip(&data[(j * w) as usize..]) {
            *p = [*v];
        }
    })
    .into_iter()
    .map(|[v]| v)
    .collect()
}

#[test]
fn same_size_is_a_copy() {
    let data: Vec<f32> = (0..35).map(|i| (i * 7 % 11) as f32 / 3.0).collect();
    assert_eq!(resize(7, 5, &data, (7, 5)), data);
}

#[test]
fn halves_average_blocks_and_fractions_are_weighted() {
    assert_eq!(resize(4, 2, &[1.0, 3.0, 5.0, 7.0, 1.0, 3.0, 5.0, 7.0], (2, 1)), [2.0, 6.0]);
    // 3 -> 2: a target pixel is one pixel and half of the next.
    let out = resize(3, 1, &[0.0, 3.0, 6.0], (2, 1));
    assert!((out[0] - 1.0).abs() < 1e-6 && (out[1] - 5.0).abs() < 1e-6, "{out:?}");
}

#[test]
fn the_mean_is_kept() {
    let data: Vec<f32> = (0..31 * 17).map(|i| ((i * 37) % 101) as f32).collect();
    let mean = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / v.len() as f64;
    for to in [(7, 5), (31, 3), (1, 1), (50, 40), (13, 17)] {
        let out = resize(31, 17, &data, to);
        assert_eq!(out.len(), (to.0 * to.1) as usize);
        assert!((mean(&out) - mean(&data)).abs() < 1e-4);
    }
}

#[test]
fn fitted_sizes() {
    assert_eq!(fitted(4000, 3000, 256), (256, 192));
    assert_eq!(fitted(100, 50, 256), (100, 50));
    assert_eq!(fitted(16384, 1, 256), (256, 1));
    assert_eq!(fitted(5, 9, 0), (1, 1));
    assert!(resize(3, 1, &[1.0; 3], (0, 4)).is_empty());
}
