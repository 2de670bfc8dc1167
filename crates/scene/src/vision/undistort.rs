//! Photographs, masks, depth maps, contours and hints as the pinhole of a [`Lens`] would have
//! them. Each is resampled once, when it is read; keypoints are in `keypoints`.

use super::lens::Lens;
use super::pictures::color::{linear_table, linear_to_byte};
use super::pictures::contour_map::ContourMap;
use super::{AxisHint, DepthMap, Hint, Mask, Photo, VisionError};
use image::RgbImage;

/// The lens for a picture of this size; an error for one of other proportions.
fn of(lens: &Lens, (width, height): (u32, u32)) -> Result<Lens, VisionError> {
    let wrong = || VisionError::Lens { lens: lens.size(), picture: (width, height) };
    let (w, h) = lens.size();
    let (a, b) = (f64::from(w) * f64::from(height), f64::from(h) * f64::from(width));
    match (a - b).abs() <= 0.03 * a.max(b) {
        true => lens.scaled((width, height)).ok_or_else(wrong),
        false => Err(wrong()),
    }
}

/// For each pixel of the undistorted picture, in row-major order, its centre.
fn centres((width, height): (u32, u32)) -> impl Iterator<Item = [f64; 2]> {
    (0..height).flat_map(move |j| (0..width).map(move |i| [f64::from(i) + 0.5, f64::from(j) + 0.5]))
}

/// For each pixel of the undistorted picture, the pixel of the photograph that it shows, if there
/// is one.
fn sources(lens: &Lens) -> impl Iterator<Item = Option<usize>> {
    let (width, height) = lens.size();
    centres(lens.pinhole().size).map(move |at| {
        let [x, y] = lens.distorted(at)?;
        let inside = x >= 0.0 && y >= 0.0 && x < f64::from(width) && y < f64::from(height);
        inside.then_some(y as usize * width as usize + x as usize)
    })
}

impl Photo {
    /// The photograph as a pinhole would have taken it: interpolated in linear light; where it
    /// shows nothing, its nearest pixel. It does not state a focal length.
    ///
    /// # Errors
    /// If its proportions are not those of the lens's picture.
    pub fn undistorted(&self, lens: &Lens) -> Result<Photo, VisionError> {
        let lens = of(lens, (self.width(), self.height()))?;
        let (w, h) = (self.width() as usize, self.height() as usize);
        let (table, bytes) = (linear_table(), self.rgb().as_raw());
        // The pixels on both sides of a position, and how far it is from the first one.
        let around = |x: f64, n: usize| {
            let x = (x - 0.5).clamp(0.0, (n - 1) as f64);
            (x as usize, (x as usize + 1).min(n - 1), (x - x.floor()) as f32)
        };
        let (width, height) = lens.pinhole().size;
        let mut rgb = RgbImage::new(width, height);
        for (to, at) in rgb.pixels_mut().zip(centres((width, height))) {
            let [x, y] = lens.nearest(at);
            let ((x0, x1, u), (y0, y1, v)) = (around(x, w), around(y, h));
            for c in 0..3 {
                let light = |x: usize, y: usize| table[usize::from(bytes[3 * (y * w + x) + c])];
                let row = |y: usize| light(x0, y) * (1.0 - u) + light(x1, y) * u;
                to.0[c] = linear_to_byte(row(y0) * (1.0 - v) + row(y1) * v);
            }
        }
        Photo::from_rgb(rgb)
    }
}

impl Mask {
    /// The mask of the undistorted photograph, of any resolution: the nearest pixel; beside the
    /// photograph there is no object.
    ///
    /// # Errors
    /// If its proportions are not those of the lens's picture.
    pub fn undistorted(&self, lens: &Lens) -> Result<Mask, VisionError> {
        let lens = of(lens, (self.width(), self.height()))?;
        let (width, height) = lens.pinhole().size;
        let data = sources(&lens).map(|i| i.is_some_and(|i| self.data()[i])).collect();
        Mask::new(width, height, data)
    }
}

impl DepthMap {
    /// The depth map of the undistorted photograph, of any resolution: the nearest pixel; beside
    /// the photograph nothing was measured.
    ///
    /// # Errors
    /// If its proportions are not those of the lens's picture.
    pub fn undistorted(&self, lens: &Lens) -> Result<DepthMap, VisionError> {
        let lens = of(lens, (self.width(), self.height()))?;
        let (width, height) = lens.pinhole().size;
        let data = sources(&lens).map(|i| i.map_or(f32::NAN, |i| self.data()[i])).collect();
        DepthMap::new(width, height, data)
    }
}

impl ContourMap {
    /// The contours of the undistorted photograph; points beyond the lens are left out.
    ///
    /// # Errors
    /// If its proportions are not those of the lens's picture.
    pub fn undistorted(&self, lens: &Lens) -> Result<ContourMap, VisionError> {
        let lens = of(lens, (self.width, self.height))?;
        let (width, height) = lens.pinhole().size;
        let mut map = ContourMap::new(width, height);
        for i in 0..self.len() {
            let (x, y) = (f64::from(self.x[i]), f64::from(self.y[i]));
            let (tx, ty) = (f64::from(self.tx[i]), f64::from(self.ty[i]));
            let ends = [-0.5, 0.5].map(|s| lens.undistorted([x + s * tx, y + s * ty]));
            let (Some([x, y]), [Some(a), Some(b)]) = (lens.undistorted([x, y]), ends) else {
                continue;
            };
            let along = [b[0] - a[0], b[1] - a[1]];
            let length = libm::hypot(along[0], along[1]);
            if length > 0.0
                && (0.0..=f64::from(width)).contains(&x)
                && (0.0..=f64::from(height)).contains(&y)
            {
                map.x.push(x as f32);
                map.y.push(y as f32);
                map.tx.push((along[0] / length) as f32);
                map.ty.push((along[1] / length) as f32);
                map.strength.push(self.strength[i]);
            }
        }
        Ok(map)
    }
}

impl Hint {
    /// The hint in the pixels of the undistorted photograph; `size` is the photograph's.
    ///
    /// # Errors
    /// If the photograph's proportions are not those of the lens's picture, or something that was
    /// pointed out is beyond the lens.
    pub fn undistorted(&self, lens: &Lens, size: (u32, u32)) -> Result<Hint, VisionError> {
        let lens = of(lens, size)?;
        let outside = || VisionError::Hint("it is beyond what the lens shows".to_owned());
        let one = |p: &[f64; 2]| lens.undistorted(*p).ok_or_else(outside);
        let all = |ps: &[[f64; 2]]| ps.iter().map(one).collect::<Result<Vec<_>, _>>();
        let axis = |a: &AxisHint| -> Result<AxisHint, VisionError> {
            let (foot, top) = (one(&a.foot)?, one(&a.top)?);
            // The width, across the middle of the axis.
            let middle = [0, 1].map(|i| 0.5 * (a.foot[i] + a.top[i]));
            let along = [0, 1].map(|i| a.top[i] - a.foot[i]);
            let half = 0.5 * a.width / libm::hypot(along[0], along[1]);
            let side =
                |s: f64| one(&[middle[0] - s * half * along[1], middle[1] + s * half * along[0]]);
            let (l, r) = (side(-1.0)?, side(1.0)?);
            Ok(AxisHint { foot, top, width: libm::hypot(r[0] - l[0], r[1] - l[1]) })
        };
        let bounds = |[x, y, w, h]: &[f64; 4]| -> Result<[f64; 4], VisionError> {
            let corners =
                [0.0, 0.5, 1.0].map(|u| [0.0, 0.5, 1.0].map(|v| [x + u * w, y + v * h])).concat();
            let seen = all(&corners)?;
            let end = |i: usize, f: fn(f64, f64) -> f64, from: f64| {
                seen.iter().map(|p| p[i]).fold(from, f)
            };
            let low = [0, 1].map(|i| end(i, f64::min, f64::INFINITY));
            let high = [0, 1].map(|i| end(i, f64::max, f64::NEG_INFINITY));
            Ok([low[0], low[1], high[0] - low[0], high[1] - low[1]])
        };
        Ok(Hint {
            mask: self.mask.as_ref().map(|m| m.undistorted(&lens)).transpose()?,
            outline: all(&self.outline)?,
            bounds: self.bounds.as_ref().map(bounds).transpose()?,
            axis: self.axis.as_ref().map(axis).transpose()?,
            at: all(&self.at)?,
            not: all(&self.not)?,
        })
    }
}

#[cfg(test)]
#[path = "undistort_tests.rs"]
mod tests;
