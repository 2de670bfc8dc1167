//! Errors of a visible surface with respect to the true one, in a picture of both (the
//! measures of Kulkarni et al. 2014, section 3.1, after Barron and Malik 2013).

/// The visible surface in each pixel, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// The width in pixels.
    pub width: usize,
    /// Distance along the viewing axis in scene units; background pixels have a value
    /// that is not finite or not positive.
    pub depth: Vec<f32>,
    /// Unit normals; x right, y up, z towards the camera. Ignored in background pixels.
    pub normal: Vec<[f32; 3]>,
}

impl Surface {
    fn seen(&self, i: usize) -> Option<f64> {
        let z = f64::from(*self.depth.get(i)?);
        (z.is_finite() && z > 0.0).then_some(z)
    }

    /// Returns the width and height of the visible surface, in scene units, at its mean
    /// depth; `pixel` gives the width of a pixel at a depth.
    pub fn extent(&self, pixel: impl Fn(f64) -> f64) -> (f64, f64) {
        let w = self.width.max(1);
        let seen: Vec<(usize, f64)> =
            (0..self.depth.len()).filter_map(|i| Some((i, self.seen(i)?))).collect();
        let span = |of: fn(usize, usize) -> usize| {
            let at = seen.iter().map(|(i, _)| of(*i, w));
            at.clone().max().zip(at.min()).map_or(0.0, |(hi, lo)| (hi - lo + 1) as f64)
        };
        let mean = seen.iter().map(|(_, z)| z).sum::<f64>() / seen.len().max(1) as f64;
        let pixel = pixel(mean);
        (span(|i, w| i % w) * pixel, span(|i, w| i / w) * pixel)
    }
}

/// The ground truth of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceTruth {
    /// The true surface.
    pub surface: Surface,
    /// The object's height along its axis in scene units, in which depth errors are
    /// expressed.
    pub height: f64,
    /// Its width in scene units. A pixel that is in only one of the two masks costs half
    /// of it.
    pub width: f64,
}

/// The error of a surface. "Both" are the pixels in both masks, "either" those in at
/// least one of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceError {
    /// Mean absolute difference of depth over both, after the best common shift of depth,
    /// in object heights. NaN if there are no such pixels.
    pub z_mae: f64,
    /// The same over either, where a pixel in only one mask costs half the object's
    /// width, so that a small, safe answer has no advantage.
    pub z_mae_u: f64,
    /// Mean squared distance of unit normals over both. NaN if there are no such pixels.
    pub n_mse: f64,
    /// The same over either, where a pixel in only one mask costs 2, as for orthogonal
    /// normals.
    pub n_mse_u: f64,
    /// Intersection over union: the number of pixels in both divided by that in either.
    pub iou: f64,
}

impl SurfaceTruth {
    /// Computes the error of an answer; a missing one (`None`) counts like one that does
    /// not overlap the true surface. An answer of another size is sampled at the nearest
    /// pixel.
    pub fn error(&self, found: Option<&Surface>) -> SurfaceError {
        let truth = &self.surface;
        let rows = |s: &Surface| s.depth.len() / s.width.max(1);
        let (mut both, mut either, mut only_truth) = (Vec::new(), 0usize, 0usize);
        for i in 0..truth.depth.len() {
            let there = found.filter(|f| !f.depth.is_empty()).map(|f| {
                let (x, y) = (i % truth.width.max(1), i / truth.width.max(1));
                // The pixel that contains the centre of this one.
                let nearest = |at: usize, to: usize, of: usize| (2 * at + 1) * to / (2 * of.max(1));
                (f, nearest(y, rows(f), rows(truth)) * f.width + nearest(x, f.width, truth.width))
            });
            match (truth.seen(i), there.and_then(|(f, j)| Some((f, j, f.seen(j)?)))) {
                (Some(z), Some((f, j, found))) => {
                    both.push((z - found, normal_gap(truth, i, f, j)))
                }
                (Some(_), None) => only_truth += 1,
                (None, Some(_)) => either += 1,
                (None, None) => {}
            }
        }
        let only = (either + only_truth) as f64;
        let n = both.len() as f64;
        let half = self.width / 2.0;
        if both.is_empty() {
            let (z_mae, n_mse) = (f64::NAN, f64::NAN);
            return SurfaceError {
                z_mae,
                z_mae_u: half / self.height,
                n_mse,
                n_mse_u: 2.0,
                iou: 0.0,
            };
        }
        let mut gaps: Vec<f64> = both.iter().map(|b| b.0).collect();
        let shift = median(&mut gaps);
        let depth: f64 = both.iter().map(|(gap, _)| (gap - shift).abs()).sum();
        let normals: f64 = both.iter().map(|b| b.1).sum();
        SurfaceError {
            z_mae: depth / n / self.height,
            z_mae_u: (depth + only * half) / (n + only) / self.height,
            n_mse: normals / n,
            n_mse_u: (normals + 2.0 * only) / (n + only),
            iou: n / (n + only),
        }
    }
}

/// Returns the squared distance of two unit normals; 2, as for orthogonal normals, if one
/// is missing.
fn normal_gap(a: &Surface, i: usize, b: &Surface, j: usize) -> f64 {
    let unit = |s: &Surface, i: usize| {
        let n = s.normal.get(i)?.map(f64::from);
        let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
        (length.is_finite() && length > 0.0).then(|| n.map(|x| x / length))
    };
    match (unit(a, i), unit(b, j)) {
        (Some(x), Some(y)) => (0..3).map(|k| (x[k] - y[k]) * (x[k] - y[k])).sum(),
        _ => 2.0,
    }
}

/// Returns the median.
fn median(xs: &mut [f64]) -> f64 {
    xs.sort_by(f64::total_cmp);
    let n = xs.len();
    if n == 0 { f64::NAN } else { (xs[(n - 1) / 2] + xs[n / 2]) / 2.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth() -> SurfaceTruth {
        let depth = vec![0.0, 5.0, 6.0, 0.0, 5.0, 7.0];
        let surface = Surface { width: 3, depth, normal: vec![[0.0, 0.0, 1.0]; 6] };
        SurfaceTruth { surface, height: 2.0, width: 1.0 }
    }

    #[test]
    fn the_truth_is_without_error_wherever_along_the_axis() {
        let t = truth();
        let mut found = t.surface.clone();
        found.depth.iter_mut().filter(|z| **z > 0.0).for_each(|z| *z += 1.5);
        let e = t.error(Some(&found));
        assert_eq!((e.z_mae, e.z_mae_u, e.n_mse, e.n_mse_u, e.iou), (0.0, 0.0, 0.0, 0.0, 1.0));
    }

    #[test]
    fn errors_by_hand() {
        let t = truth();
        // One pixel is off by 1, one is missing, one is extra, and one normal is rotated
        // by a right angle.
        let mut found = t.surface.clone();
        found.depth = vec![4.0, 5.0, 7.0, f32::INFINITY, 5.0, f32::NAN];
        found.normal[1] = [2.0, 0.0, 0.0];
        let e = t.error(Some(&found));
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} is not {b}");
        close(e.z_mae, 1.0 / 3.0 / 2.0);
        close(e.z_mae_u, (1.0 + 2.0 * 0.5) / 5.0 / 2.0);
        close(e.n_mse, 2.0 / 3.0);
        close(e.n_mse_u, (2.0 + 4.0) / 5.0);
        close(e.iou, 0.6);
        let none = t.error(None);
        assert!(none.z_mae.is_nan());
        assert_eq!((none.z_mae_u, none.n_mse_u, none.iou), (0.25, 2.0, 0.0));
        assert_eq!(t.error(Some(&Surface::default())).z_mae_u, 0.25);
    }

    #[test]
    fn other_sizes_are_read_at_the_nearest_pixel() {
        let t = truth();
        let twice = |row: &[f32]| row.iter().flat_map(|z| [*z, *z]).collect::<Vec<f32>>();
        let rows: Vec<f32> =
            t.surface.depth.chunks(3).flat_map(|r| [twice(r), twice(r)].concat()).collect();
        let found = Surface { width: 6, depth: rows, normal: vec![[0.0, 0.0, 1.0]; 24] };
        assert_eq!(t.error(Some(&found)).z_mae_u, 0.0);
    }

    #[test]
    fn extents_are_in_scene_units() {
        let (width, height) = truth().surface.extent(|z| 0.1 * z);
        assert!((width - 2.0 * 0.1 * 5.75).abs() < 1e-12 && (height - width).abs() < 1e-12);
    }
}
