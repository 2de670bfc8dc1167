//! Regions enclosed by clean contours, for use without a photograph.

use super::area::Area;
use super::components::components;
use super::mirror::symmetry;
use super::pixels::Pixels;
use super::rim::Edges;
use super::score::{Scored, suppressed};
use super::{Candidate, CandidateOptions, LEAST, OVERLAP};
use crate::vision::ContourMap;
use crate::vision::detect::gradient::Gradient;

/// How far points are extended along their contour, to close the gaps between them,
/// pixels.
const REACH: f32 = 0.75;
/// Gaps of up to twice this many pixels are closed, since parts of a contour may be
/// missing where it is narrowly hidden.
const GAPS: [usize; 5] = [0, 1, 3, 6, 12];
/// Regions with at least this fraction of line pixels are not enclosed areas.
const LINES: f64 = 0.8;

/// Returns the regions that contours enclose, the largest and most symmetric first. Open
/// contours, such as those of an object that is cut off by the frame, do not enclose
/// anything.
pub fn enclosed(map: &ContourMap, options: &CandidateOptions) -> Vec<Candidate> {
    let longer = map.width.max(map.height);
    if map.is_empty() || longer == 0 {
        return Vec::new();
    }
    // At most the map's resolution, beyond which its points would be disconnected.
    let size = f64::from(options.size.clamp(16, 1024).min(longer));
    let side = |n: u32| (f64::from(n) * size / f64::from(longer)).round().max(1.0) as u32;
    let small = map.scaled_to(side(map.width), side(map.height));
    let (w, h) = (small.width as usize, small.height as usize);
    let lines = drawn(&small);
    let least = (LEAST * (w * h) as f64) as usize;
    let regions = GAPS.iter().flat_map(|gap| closed(&lines, *gap, least));
    let bounded = |area: Area| Scored::bounded((area.count as f64 / (w * h) as f64).sqrt(), area);
    let symmetric = |area: &Area| symmetry(area).powi(4);
    let best = suppressed(regions.map(bounded), symmetric, OVERLAP, options.most);
    let gradient = across(&small);
    let edges = Edges { gradient: &gradient, strong: 1.0 };
    let scale = [f64::from(map.width) / w as f64, f64::from(map.height) / h as f64];
    best.into_iter().filter_map(|scored| Candidate::new(&scored, &edges, scale)).collect()
}

/// Returns the regions of at least `least` pixels that lines enclose after dilation by
/// `by` pixels, with the dilation undone.
fn closed(lines: &Pixels, by: usize, least: usize) -> Vec<Area> {
    let (w, h) = (lines.width, lines.height);
    let Some(wide) = Area::of(lines.dilated(by)).map(Area::filled) else { return Vec::new() };
    let outside = wide.pixels.complement().dilated(by);
    let inside = outside.complement().bools();
    let (of, sizes) = components(w, &inside);
    let region = |(number, size): (usize, &usize)| {
        if *size < least {
            return None;
        }
        let area = Area::of(Pixels::new(w, h, |p| of[p] == number as u32 && inside[p]))?;
        ((area.shared(lines) as f64) < LINES * area.count as f64).then_some(area)
    };
    sizes.iter().enumerate().filter_map(region).collect()
}

/// Returns the pixel at a position, if it is in the picture.
fn pixel(map: &ContourMap, x: f32, y: f32) -> Option<usize> {
    let inside = x >= 0.0 && y >= 0.0 && x < map.width as f32 && y < map.height as f32;
    inside.then(|| y as usize * map.width as usize + x as usize)
}

/// Returns the pixels that contours run through.
fn drawn(map: &ContourMap) -> Pixels {
    let (width, height) = (map.width as usize, map.height as usize);
    let mut on = Pixels::none(width, height);
    for (((x, y), tx), ty) in map.x.iter().zip(&map.y).zip(&map.tx).zip(&map.ty) {
        for by in [-REACH, 0.0, REACH] {
            if let Some(p) = pixel(map, x + by * tx, y + by * ty) {
                on.insert(p % width, p / width);
            }
        }
    }
    on
}

/// Returns edges of strength 1 along contours that fade within a pixel or two.
fn across(map: &ContourMap) -> Gradient {
    let pixels = map.width as usize * map.height as usize;
    let (mut magnitude, mut tensor) = (vec![0.0f32; pixels], vec![[0.0f32; 3]; pixels]);
    for (((x, y), tx), ty) in map.x.iter().zip(&map.y).zip(&map.tx).zip(&map.ty) {
        for (i, j) in (-2..=2).flat_map(|j| (-2..=2).map(move |i| (i as f32, j as f32))) {
            let Some(p) = pixel(map, x + i, y + j) else { continue };
            let (cx, cy) = ((x + i).floor() + 0.5 - x, (y + j).floor() + 0.5 - y);
            let strength = libm::expf(-0.5 * (cx * cx + cy * cy));
            if strength > magnitude[p] {
                magnitude[p] = strength;
                let square = strength * strength;
                tensor[p] = [ty * ty * square, -tx * ty * square, tx * tx * square];
            }
        }
    }
    Gradient { width: map.width, height: map.height, magnitude, tensor }
}
