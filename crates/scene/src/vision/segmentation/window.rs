//! The part of a photograph around an object, at a size at which the object has a certain
//! number of pixels.

use super::frame::Frame;
use crate::vision::candidates::Axis;
use crate::vision::candidates::area::Area;
use crate::vision::candidates::features::PictureFeatures;
use crate::vision::candidates::mirror::Mirror;
use crate::vision::candidates::profile;
use crate::vision::candidates::rim::Edges;
use crate::vision::pictures::color::linear_table;
use crate::vision::pictures::photo::fitted;
use crate::vision::{Mask, Photo};

/// What is seen around the object, as a fraction of its longer side, at each side.
const MARGIN: f64 = 0.35;
/// Maximum number of positions at which the photograph is read per pixel and direction.
const READINGS: f64 = 4.0;
/// Maximum longer side of the mask of a whole photograph.
const LARGEST: u32 = 1024;

/// A window on a photograph.
pub struct Window {
    pub picture: PictureFeatures,
    /// Where the object is thought to be, pixels of the window.
    pub frame: Frame,
    /// The position in the photograph of the window's top left corner.
    corner: [f64; 2],
    /// Pixels of the photograph per pixel of the window.
    scale: f64,
    /// Size of the photograph.
    size: [u32; 2],
}

impl Window {
    /// Cuts out the surroundings of a frame of a photograph, whose longer side becomes
    /// `longer` pixels. Beyond the photograph its last pixels continue.
    pub fn new(photo: &Photo, frame: &Frame, longer: f64) -> Window {
        let side = 2.0 * frame.half[0].max(frame.half[1]);
        let scale = side / longer;
        let reach = frame.reach().map(|r| r + MARGIN * side);
        let corner = [0, 1].map(|c| frame.centre[c] - reach[c]);
        let [width, height] = reach.map(|r| ((2.0 * r / scale).round() as u32).max(1));
        let rgb = cut_out(photo, corner, scale, [width, height]);
        let within = Frame {
            centre: [0, 1].map(|c| (frame.centre[c] - corner[c]) / scale),
            half: frame.half.map(|h| h / scale),
            ..*frame
        };
        let picture = PictureFeatures::of_linear(width, height, &rgb);
        Window { picture, frame: within, corner, scale, size: [photo.width(), photo.height()] }
    }

    /// Converts a position in the photograph to one in the window.
    pub fn within(&self, position: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|c| (position[c] - self.corner[c]) / self.scale)
    }

    /// Converts a position in the window to one in the photograph.
    pub fn outside(&self, position: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|c| self.corner[c] + self.scale * position[c])
    }

    /// True if a position in the window is one in the photograph.
    pub fn shown(&self, position: [f64; 2]) -> bool {
        let [x, y] = self.outside(position);
        let [w, h] = self.size.map(f64::from);
        x >= 0.0 && y >= 0.0 && x < w && y < h
    }

    /// Positions of the centres of the window's pixels, in row-major order.
    pub fn centres(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let (w, h) = (self.picture.width, self.picture.height);
        (0..w * h).map(move |p| [(p % w) as f64 + 0.5, (p / w) as f64 + 0.5])
    }

    /// Returns the axis of an area of the window about a mirror, in pixels of the
    /// photograph, with the evidence of its rims in the window's own edges.
    pub fn axis(&self, area: &Area, mirror: &Mirror) -> Axis {
        let edges = Edges { gradient: &self.picture.gradient, strong: self.picture.strong };
        let axis = profile::axis(&edges, area, mirror, [self.scale; 2]);
        let moved = |end: [f64; 2]| [end[0] + self.corner[0], end[1] + self.corner[1]];
        Axis { foot: moved(axis.foot), top: moved(axis.top), ..axis }
    }

    /// Returns the mask of the whole photograph that shows an area of the window. Its pixels
    /// are about as large as those of the window, unless it became larger than the
    /// photograph or than [`LARGEST`]. `None` if nothing of the area is in it.
    pub fn mask(&self, area: &Area) -> Option<Mask> {
        let longer = f64::from(self.size[0].max(self.size[1])) / self.scale;
        let (width, height) =
            fitted(self.size[0], self.size[1], (longer.ceil() as u32).clamp(1, LARGEST));
        let at = |i: u32, n: u32, c: usize| {
            let position = (f64::from(i) + 0.5) / f64::from(n) * f64::from(self.size[c]);
            (position - self.corner[c]) / self.scale
        };
        let columns: Vec<f64> = (0..width).map(|i| at(i, width, 0)).collect();
        let on: Vec<bool> = (0..height)
            .flat_map(|j| {
                let y = at(j, height, 1);
                columns.iter().map(move |x| area.at(*x, y))
            })
            .collect();
        on.contains(&true).then(|| Mask::new(width, height, on).ok()).flatten()
    }
}

/// Returns a part of a photograph in linear light: the mean of the positions read per pixel,
/// each between four pixels of the photograph.
fn cut_out(photo: &Photo, corner: [f64; 2], scale: f64, size: [u32; 2]) -> Vec<[f32; 3]> {
    let table = linear_table();
    let columns = readings(corner[0], scale, size[0], photo.width());
    let rows = readings(corner[1], scale, size[1], photo.height());
    let bytes = photo.rgb().as_raw();
    let mut out = Vec::with_capacity(columns.len() * rows.len());
    for row in &rows {
        let start = out.len();
        out.resize(start + columns.len(), [0.0f32; 3]);
        for (j, weight) in row {
            let line = &bytes[3 * *j * photo.width() as usize..];
            for (pixel, column) in out[start..].iter_mut().zip(&columns) {
                for (i, part) in column {
                    for c in 0..3 {
                        pixel[c] += weight * part * table[usize::from(line[3 * i + c])];
                    }
                }
            }
        }
    }
    out
}

/// Returns for each of `count` pixels along a direction the pixels of the photograph that it
/// is read from, of which there are `size`, and their weights.
fn readings(from: f64, scale: f64, count: u32, size: u32) -> Vec<Vec<(usize, f32)>> {
    let parts = scale.ceil().clamp(1.0, READINGS);
    let last = f64::from(size.max(1) - 1);
    let pixel = |i: u32| {
        let read = |part: u32| {
            let at = f64::from(i) + (f64::from(part) + 0.5) / parts;
            let at = (from + scale * at - 0.5).clamp(0.0, last);
            let (low, rest) = (at.floor(), at - at.floor());
            [(low, 1.0 - rest), ((low + 1.0).min(last), rest)]
        };
        let all = (0..parts as u32).flat_map(read);
        let all = all.filter(|(_, weight)| *weight > 0.0);
        all.map(|(j, weight)| (j as usize, (weight / parts) as f32)).collect()
    };
    (0..count).map(pixel).collect()
}
