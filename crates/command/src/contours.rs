//! `pcadlang contours`.

use super::args::Contours;
use pcadlang_library::scene::DetectorValue;
use pcadlang_report::pictures::png;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::{files, inputs};
use pcadlang_scene::vision::{GradientDetector, MAP_SIZE, MOST_MAP_SIZE};

/// Detects the contours of a photograph and writes them as a map.
pub fn contours(a: &Contours) -> Result<(), Failure> {
    let photo = inputs::photo(&a.image)?;
    let map = match &a.edges {
        None => {
            let by = GradientDetector::default();
            GradientDetector { size: a.size.unwrap_or(by.size), ..by }.contours(&photo)
        }
        Some(spec) => {
            let DetectorValue(detector) = inputs::detector(spec)?;
            let detector = detector.ok_or_else(|| plain(format!("{spec} is not a detector")))?;
            let size = a.size.unwrap_or(MAP_SIZE);
            if size > MOST_MAP_SIZE {
                return Err(plain(format!(
                    "--size {size}: with --edges the longer side may be at most {MOST_MAP_SIZE} pixels"
                )));
            }
            let map =
                detector.map(&photo, size.max(1)).map_err(|e| plain(format!("{spec}: {e}")))?;
            map.contours_of(&photo, detector.sigma())
        }
    };
    let picture = png(&map.to_image()).map_err(|e| plain(e.to_string()))?;
    files::write(&a.out, &picture)?;
    print_line!(
        "{}: {} contour points in {} x {} pixels",
        a.out.display(),
        map.len(),
        map.width,
        map.height
    );
    Ok(())
}
