//! Lenses of photographs that are not simple pinholes: pixels that are not square, and the
//! distortion of Brown and Conrady, with its inverse; and the pinhole that shows the same.
//!
//! Fisheye lenses are not of this kind. The picture is undistorted in `undistort`.

use super::pictures::photo::Limits;

/// Radial, tangential and thin-prism distortion of normalised image positions (x right, y down,
/// at depth 1), as OpenCV has it (`cv::projectPoints`): with r² = x² + y²,
///
/// ```text
/// f  = (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) / (1 + d1 r² + d2 r⁴ + d3 r⁶)
/// x' = x f + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴
/// y' = y f + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴
/// ```
///
/// OpenCV calls d1 to d3 k4 to k6; k4 of nerfstudio is the one above.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// k1 to k4.
    pub radial: [f64; 4],
    /// d1 to d3.
    pub divisor: [f64; 3],
    /// p1 and p2.
    pub tangential: [f64; 2],
    /// s1 to s4.
    pub prism: [f64; 4],
    /// Tangential terms use x f and y f for x and y, as RealSense's "modified" model does.
    pub modified: bool,
}

impl Distortion {
    /// True if nothing is moved.
    pub fn is_none(&self) -> bool {
        let all = [&self.radial[..], &self.divisor, &self.tangential, &self.prism];
        all.concat().iter().all(|c| *c == 0.0)
    }

    /// How much further from the axis a position at squared radius `r2` is seen.
    fn factor(&self, r2: f64) -> f64 {
        let [k1, k2, k3, k4] = self.radial;
        let [d1, d2, d3] = self.divisor;
        (1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4))))
            / (1.0 + r2 * (d1 + r2 * (d2 + r2 * d3)))
    }

    fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        let f = self.factor(r2);
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.prism);
        let (u, v) = if self.modified { (x * f, y * f) } else { (x, y) };
        [
            x * f + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u) + r2 * (s1 + r2 * s2),
            y * f + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v + r2 * (s3 + r2 * s4),
        ]
    }

    /// The radius up to which positions further from the axis are seen further from it. Beyond
    /// it the polynomial turns back, and means nothing.
    fn limit(&self) -> f64 {
        const STEP: f64 = 1.0 / 256.0;
        let mut before = 0.0;
        for i in 1..=4096 {
            let r = f64::from(i) * STEP;
            let now = r * self.factor(r * r);
            if now.is_nan() || now <= before {
                return r - STEP;
            }
            before = now;
        }
        f64::INFINITY
    }
}

/// The lens of a photograph of `size` pixels. Positions are in pixels from the corner of the
/// first pixel, whose centre is (0.5, 0.5).
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    size: (u32, u32),
    focal: [f64; 2],
    centre: [f64; 2],
    distortion: Distortion,
    limit: f64,
    pinhole: Pinhole,
}

/// A camera with square pixels and no distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// The focal length, pixels.
    pub focal_px: f64,
    /// The principal point, pixels from the corner of the first pixel.
    pub centre: [f64; 2],
}

/// The most by which focal lengths may differ for a picture to keep its size: its edges then move
/// by less than a hundredth of it.
const NEARLY_SQUARE: f64 = 0.02;
/// Displacements below this many pixels do not matter.
const NEGLIGIBLE: f64 = 0.05;
/// The most that a pixel's sides may differ.
const MOST_ASPECT: f64 = 8.0;

impl Lens {
    /// A lens with these focal lengths and principal point, pixels. `None` if a number is not
    /// finite, a focal length not positive, a side of the picture too long or 0, or a pixel
    /// longer than eight times its width.
    pub fn new(
        size: (u32, u32),
        focal: [f64; 2],
        centre: [f64; 2],
        distortion: Distortion,
    ) -> Option<Lens> {
        let sound = |(w, h): (u32, u32)| Limits::default().check(w, h).is_ok();
        let Distortion { radial, divisor, tangential, prism, .. } = &distortion;
        let numbers = [&focal[..], &centre, radial, divisor, tangential, prism].concat();
        let ratio = focal[0] / focal[1];
        if !numbers.iter().all(|x| x.abs() < 1e12)
            || !focal.iter().all(|f| *f > 1e-9)
            || !(1.0 / MOST_ASPECT..=MOST_ASPECT).contains(&ratio)
        {
            return None;
        }
        let (w, h) = (f64::from(size.0), f64::from(size.1));
        // With f at most the larger one, no detail is lost.
        let pinhole = if (ratio - 1.0).abs() <= NEARLY_SQUARE {
            Pinhole { size, focal_px: (focal[0] * focal[1]).sqrt(), centre }
        } else {
            let f = focal[0].max(focal[1]);
            let by = focal.map(|g| f / g);
            Pinhole {
                size: ((w * by[0]).round() as u32, (h * by[1]).round() as u32),
                focal_px: f,
                centre: [centre[0] * by[0], centre[1] * by[1]],
            }
        };
        let limit = distortion.limit();
        (sound(size) && sound(pinhole.size)).then_some(Lens {
            size,
            focal,
            centre,
            distortion,
            limit,
            pinhole,
        })
    }

    /// The pinhole that an undistorted photograph is seen by.
    pub fn pinhole(&self) -> Pinhole {
        self.pinhole
    }

    /// Width and height of the photograph that the numbers are of.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Focal lengths across and down, pixels.
    pub fn focal(&self) -> [f64; 2] {
        self.focal
    }

    /// The principal point, pixels from the corner of the first pixel.
    pub fn centre(&self) -> [f64; 2] {
        self.centre
    }

    /// The distortion.
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// True if a photograph is as a pinhole sees it, to a twentieth of a pixel.
    pub fn is_pinhole(&self) -> bool {
        let longer = f64::from(self.size.0.max(self.size.1));
        let off = (self.focal[0] / self.focal[1] - 1.0).abs() * longer / 2.0;
        self.distortion.is_none() && off < NEGLIGIBLE
    }

    /// Where the photograph shows what the pinhole sees at a position (pixels of either). `None`
    /// further from the axis than the distortion is defined.
    pub fn distorted(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let Pinhole { focal_px, centre, .. } = self.pinhole;
        let [x, y] = [(x - centre[0]) / focal_px, (y - centre[1]) / focal_px];
        let radius = libm::hypot(x, y);
        if radius.is_nan() || radius > self.limit {
            return None;
        }
        let seen = self.distortion.apply([x, y]);
        Some([0, 1].map(|i| self.focal[i] * seen[i] + self.centre[i]))
    }

    /// As [`Lens::distorted`]; beyond its limit, the position at the limit in that direction.
    pub(super) fn nearest(&self, at: [f64; 2]) -> [f64; 2] {
        let Pinhole { focal_px, centre, .. } = self.pinhole;
        let off = [0, 1].map(|i| at[i] - centre[i]);
        let by = (self.limit * focal_px / libm::hypot(off[0], off[1])).min(1.0) * (1.0 - 1e-9);
        let inside = || self.distorted([0, 1].map(|i| centre[i] + by * off[i]));
        self.distorted(at).or_else(inside).unwrap_or(at)
    }

    /// Where the pinhole sees what the photograph shows at a position: the inverse of
    /// [`Lens::distorted`], by bisection along the radius, then Newton's method. `None` if the
    /// pinhole sees it nowhere.
    pub fn undistorted(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let seen = [0, 1].map(|i| (at[i] - self.centre[i]) / self.focal[i]);
        let radius = libm::hypot(seen[0], seen[1]);
        let along = |r: f64| r * self.distortion.factor(r * r);
        let (mut low, mut high) = (0.0, self.limit.min(16.0));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if along(middle) < radius { &mut low } else { &mut high }) = middle;
        }
        let mut p = if radius > 0.0 { seen.map(|s| s * low / radius) } else { [0.0; 2] };
        for _ in 0..30 {
            let here = self.distortion.apply(p);
            let miss = [seen[0] - here[0], seen[1] - here[1]];
            if libm::hypot(miss[0], miss[1]) < 1e-13 * (1.0 + radius) {
                break;
            }
            const H: f64 = 1e-6;
            let slope = |q: [f64; 2]| self.distortion.apply(q).into_iter().zip(here);
            let by_x: Vec<f64> = slope([p[0] + H, p[1]]).map(|(a, b)| (a - b) / H).collect();
            let by_y: Vec<f64> = slope([p[0], p[1] + H]).map(|(a, b)| (a - b) / H).collect();
            let det = by_x[0] * by_y[1] - by_x[1] * by_y[0];
            p[0] += (miss[0] * by_y[1] - miss[1] * by_y[0]) / det;
            p[1] += (miss[1] * by_x[0] - miss[0] * by_x[1]) / det;
        }
        let here = self.distortion.apply(p);
        let near = (0..2).all(|i| (here[i] - seen[i]).abs() < 1e-7 * (1.0 + radius));
        let Pinhole { focal_px, centre, .. } = self.pinhole;
        (near && libm::hypot(p[0], p[1]) <= self.limit)
            .then(|| [0, 1].map(|i| focal_px * p[i] + centre[i]))
    }

    /// The same lens for a photograph at another resolution.
    pub fn scaled(&self, (width, height): (u32, u32)) -> Option<Lens> {
        let by =
            [f64::from(width) / f64::from(self.size.0), f64::from(height) / f64::from(self.size.1)];
        let scaled = |of: [f64; 2]| [of[0] * by[0], of[1] * by[1]];
        let size = (width, height);
        Lens::new(size, scaled(self.focal), scaled(self.centre), self.distortion)
    }
}

#[cfg(test)]
#[path = "lens_tests.rs"]
mod tests;
