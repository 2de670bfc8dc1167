//! Focal lengths of Exif data; the chunks are made here.

use super::focal;

/// A number of a field.
#[derive(Clone, Copy)]
pub(in crate::vision::pictures) enum Field {
    Short(u16),
    Rational(u32, u32),
}
use Field::{Rational, Short};

/// A little-endian Exif chunk with an orientation, and fields of the camera.
pub(in crate::vision::pictures) fn chunk(orientation: u16, fields: &[(u16, Field)]) -> Vec<u8> {
    let mut out = b"II\x2a\0\x08\0\0\0".to_vec();
    let mut entry = |tag: u16, kind: u16, value: u32| {
        out.extend(tag.to_le_bytes());
        out.extend(kind.to_le_bytes());
        out.extend(1u32.to_le_bytes());
        out.extend(value.to_le_bytes());
    };
    // Counts are of two bytes, so they are put in afterwards.
    entry(0x0112, 3, u32::from(orientation));
    entry(0x8769, 4, 38);
    let mut behind = 38 + 2 + 12 * fields.len() as u32 + 4;
    let mut numbers = Vec::new();
    for (tag, field) in fields {
        match field {
            Short(n) => entry(*tag, 3, u32::from(*n)),
            Rational(a, b) => {
                entry(*tag, 5, behind);
                numbers.extend([a.to_le_bytes(), b.to_le_bytes()].concat());
                behind += 8;
            }
        }
    }
    let at = out.split_off(32);
    [
        &out[..8],
        &2u16.to_le_bytes(),
        &out[8..],
        &[0; 4],
        &(fields.len() as u16).to_le_bytes(),
        &at,
        &[0; 4],
        &numbers,
    ]
    .concat()
}

const F35: u16 = 0xA405;

#[test]
fn the_equivalent_is_by_the_diagonal() {
    let of = |mm: u16, size| focal(&chunk(1, &[(F35, Short(mm))]), size);
    let near = |a: Option<f64>, b: f64| assert!((a.unwrap() - b).abs() < 1e-3, "{a:?} {b}");
    near(of(36, (6000, 4000)), 1.0);
    near(of(28, (4000, 3000)), 28.0 / 43.2666 * 1.25);
    near(of(28, (3000, 4000)), 28.0 / 43.2666 * 1.25);
    // A phone's 16:9 is its sensor without top and bottom.
    near(of(36, (3840, 2160)), 1.0);
    let with = [b"Exif\0\0".as_slice(), &chunk(1, &[(F35, Short(50))])].concat();
    near(focal(&with, (3, 2)), 50.0 / 36.0);
    assert_eq!(of(0, (3, 2)), None);
}

#[test]
fn or_by_the_pixels_of_the_sensor() {
    // A full frame of 6000 x 4000, 24 mm high: 50 mm is 1.39 widths, whatever the copy's size.
    let fields = [
        (0x920A, Rational(50, 1)),
        (0xA20E, Rational(6_000_000, 36 * 1000)),
        (0xA210, Short(4)),
        (0xA002, Short(6000)),
        (0xA003, Short(4000)),
    ];
    for size in [(6000, 4000), (600, 400)] {
        assert!((focal(&chunk(1, &fields), size).unwrap() - 50.0 / 36.0).abs() < 1e-6);
    }
    // Without the size that the resolution is of, it is ignored.
    assert_eq!(focal(&chunk(1, &fields[..3]), (600, 400)), None);
}

#[test]
fn a_crop_states_no_lens() {
    let of = |size| {
        focal(&chunk(1, &[(F35, Short(28)), (0xA002, Short(4000)), (0xA003, Short(3000))]), size)
    };
    assert!(of((4000, 3000)).is_some() && of((400, 300)).is_some() && of((300, 400)).is_some());
    assert_eq!(of((600, 400)), None, "of other proportions than stated");
    assert_eq!(
        focal(&chunk(1, &[(F35, Short(28))]), (500, 430)),
        None,
        "of no camera's proportions"
    );
}

#[test]
fn damaged_chunks_are_none() {
    let good = chunk(6, &[(F35, Short(35))]);
    for n in 0..good.len() {
        let _ = focal(&good[..n], (4, 3));
    }
    assert_eq!(focal(&good[..40], (4, 3)), None);
    let mut wild = good;
    wild[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(focal(&wild, (4, 3)), None);
}
