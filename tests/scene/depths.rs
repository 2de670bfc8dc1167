//! Depth maps as other programs write them (`tests/data/make_depths.py`).

use pcadlang_scene::vision::{DepthMap, Limits, depth};

fn read(name: &str) -> DepthMap {
    let path = format!("{}/tests/data/depths/{name}", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(&path).unwrap();
    depth::decode(&bytes, None, 0.0, &Limits::default()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// What is made of 0, NaN and infinity, and of 1.5 and 2.25 metres, at their pixels.
#[test]
fn the_same_map_by_every_program() {
    for name in [
        "opencv_float.tiff",
        "deflate.tiff",
        "half.tiff",
        "big_endian.tiff",
        "passes.exr",
        "half.exr",
        "grey.exr",
    ] {
        let map = read(name);
        assert_eq!((map.width(), map.height()), (8, 6), "{name}");
        let at = |x: usize, y: usize| map.data()[8 * y + x];
        assert!(at(0, 0).is_nan() && at(1, 1).is_nan(), "{name}");
        assert_eq!((at(2, 2), at(3, 3), at(7, 5)), (f32::INFINITY, 1.5, 2.25), "{name}");
    }
}

#[test]
fn whole_numbers_are_millimetres() {
    let map = read("opencv_16.tiff");
    let at = |x: usize, y: usize| map.data()[8 * y + x];
    assert!(at(0, 0).is_nan() && at(1, 1).is_nan() && at(2, 2).is_nan());
    assert_eq!((at(3, 3), at(7, 5)), (1.5, 2.25));
}

/// Pixels outside of the data window are 0, that is not measured.
#[test]
fn a_data_window_is_placed_in_the_picture() {
    let map = read("cropped.exr");
    assert_eq!((map.width(), map.height()), (10, 8));
    let at = |x: usize, y: usize| map.data()[10 * y + x];
    assert!(at(0, 0).is_nan() && at(3, 0).is_nan() && at(9, 7).is_nan());
    assert_eq!((at(3, 1), at(9, 6), at(4, 3)), (1.5, 2.25, f32::INFINITY));
}

#[test]
fn files_without_depths_say_what_is_wanted() {
    let message =
        |bytes: &[u8]| depth::decode(bytes, None, 0.0, &Limits::default()).unwrap_err().to_string();
    let path = |name: &str| format!("{}/tests/data/depths/{name}", env!("CARGO_MANIFEST_DIR"));
    let exr = std::fs::read(path("passes.exr")).unwrap();
    // The channel of depths under another name.
    let renamed = exr.windows(7).position(|w| w == b"Depth.Z").unwrap();
    let mut other = exr.clone();
    other[renamed..renamed + 7].copy_from_slice(b"Depth.Q");
    assert!(message(&other).contains("must be called Z, depth, V or Y"), "{}", message(&other));
    for name in ["deflate.tiff", "passes.exr", "half.exr"] {
        let bytes = std::fs::read(path(name)).unwrap();
        for cut in 0..bytes.len() - 1 {
            let _ = depth::decode(&bytes[..cut], None, 0.0, &Limits::default());
        }
    }
}
