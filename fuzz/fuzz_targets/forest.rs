//! A structured forest: one that was read gives a finite value for each pixel of a picture.
#![no_main]

use pcadlang_contour_detectors::Forest;
use pcadlang_scene::vision::{Limits, Photo, photo};
use std::sync::OnceLock;

/// Returns the picture to which forests are applied.
fn looked_at() -> &'static Photo {
    static PHOTO: OnceLock<Photo> = OnceLock::new();
    let read = || {
        photo::decode(include_bytes!("../../examples/images/table_lamp.png"), &Limits::default())
    };
    PHOTO.get_or_init(|| read().unwrap_or_else(|e| panic!("{e}")).shrunk(48))
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match Forest::read(bytes) {
        Ok(forest) => {
            let map = forest.map(looked_at(), 48);
            assert_eq!(map.values.len(), map.width as usize * map.height as usize);
            assert!(map.values.iter().all(|v| v.is_finite()));
            let contours = map.contours(1.0);
            assert!(contours.strength.iter().all(|s| (0.0..=1.0).contains(s)));
        }
        Err(e) => assert!(!e.to_string().is_empty()),
    }
});
