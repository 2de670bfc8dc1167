//! What the search for candidates reads of a small picture: colours in CIE L*a*b*, local variation
//! of lightness, and gradients.

use crate::vision::Photo;
use crate::vision::detect::gradient::{Gradient, colour_gradient, derivatives, smoothed};
use crate::vision::pictures::color::linear_to_labs;

/// Standard deviation, pixels, of the smoothing before colours are compared (Felzenszwalb
/// & Huttenlocher 2004, section 4).
const SMOOTHING: f32 = 0.8;
/// Standard deviation, pixels, of the Gaussian window for the variation of lightness.
const AROUND: f32 = 2.0;
/// Quantile of a picture's gradient magnitudes above which gradients are certainly edges.
const STRONG: f64 = 0.97;

/// A picture at the working resolution; lists are in row-major order.
pub struct PictureFeatures {
    pub width: usize,
    pub height: usize,
    /// L*, a* and b*.
    pub lab: Vec<[f32; 3]>,
    /// The same, lightly smoothed.
    pub smooth: Vec<[f32; 3]>,
    /// Local standard deviation of L*.
    pub deviation: Vec<f32>,
    /// Gradient of L*, a* and b* together.
    pub gradient: Gradient,
    /// Derivatives of L* along x and y.
    pub slope: (Vec<f32>, Vec<f32>),
    /// A gradient that is certainly an edge, above 0.
    pub strong: f32,
}

impl PictureFeatures {
    /// Prepares a photo with a longer side of at most `size` pixels.
    pub fn of(photo: &Photo, size: u32) -> PictureFeatures {
        let photo = photo.shrunk(size);
        let (width, height) = (photo.width(), photo.height());
        PictureFeatures::of_linear(width, height, &photo.linear(width, height).rgb)
    }

    /// Prepares pixels in linear light.
    pub fn of_linear(width: u32, height: u32, rgb: &[[f32; 3]]) -> PictureFeatures {
        let lab = linear_to_labs(rgb);
        let channel = |c: usize| lab.iter().map(|p| p[c]).collect::<Vec<f32>>();
        let [l, a, b] = [0, 1, 2].map(|c| smoothed(width, height, &channel(c), SMOOTHING));
        let smooth = l.iter().zip(&a).zip(&b).map(|((l, a), b)| [*l, *a, *b]).collect();
        let gradient = colour_gradient(width, height, &lab, 1.0);
        let mut sorted = gradient.magnitude.clone();
        sorted.sort_by(f32::total_cmp);
        let strong =
            sorted.get((STRONG * sorted.len() as f64) as usize).map_or(1.0, |g| g.max(1.0));
        PictureFeatures {
            width: width as usize,
            height: height as usize,
            smooth,
            deviation: deviation(width, height, &channel(0)),
            slope: derivatives(width, height, &channel(0), 1.0),
            gradient,
            strong,
            lab,
        }
    }

    /// The number of pixels.
    pub fn pixels(&self) -> usize {
        self.lab.len()
    }
}

/// Returns the local standard deviation of a channel.
fn deviation(width: u32, height: u32, channel: &[f32]) -> Vec<f32> {
    let mean = smoothed(width, height, channel, AROUND);
    let squares: Vec<f32> = channel.iter().map(|v| v * v).collect();
    let squares = smoothed(width, height, &squares, AROUND);
    squares.iter().zip(&mean).map(|(s, m)| (s - m * m).max(0.0).sqrt()).collect()
}
