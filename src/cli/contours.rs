//! `pcadlang contours`.

use super::args::Contours;
use super::{Failure, files, plain};
use pcadlang::report::pictures::png;
use pcadlang::vision::{ContourDetector, GradientDetector};

/// Finds the contours of a photograph and writes them as a map.
pub fn contours(a: &Contours) -> Result<(), Failure> {
    let photo = files::photo(&a.image)?;
    let map = GradientDetector { size: a.size, ..GradientDetector::default() }.detect(&photo);
    let picture = png(&map.to_image()).map_err(|e| plain(e.to_string()))?;
    files::write(&a.out, &picture)?;
    println!("{}: {} contour points in {} x {} pixels", a.out.display(), map.len(), map.width, map.height);
    Ok(())
}
