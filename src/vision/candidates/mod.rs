//! Regions of a photograph that may be an object of revolution (vases, bottles, cups,
//! lamps), without learned weights.
//!
//! Of clean contours without a photograph they are what the contours enclose. Of a
//! photograph:
//!
//! Segments and clusters of colour are joined into regions, the most promising are cut
//! out along edges, and what is symmetric, stands out from what is around it and lies
//! within the picture comes first. A function of the picture alone, with the same bits on
//! any machine. Not here: what is made of the candidates, and three dimensions.

mod area;
mod clusters;
mod cut;
mod enclosed;
mod felzenszwalb;
mod merge;
mod mirror;
mod picture;
mod profile;
mod rim;
mod score;
#[cfg(test)]
mod tests;

use crate::vision::{Mask, Photo};
use area::Area;
use cut::Field;
pub use enclosed::enclosed;
use felzenszwalb::{Edges, felzenszwalb};
use merge::{Rule, merge};
use picture::Picture;
pub use rim::tilts;
use score::{Judge, suppressed};

/// Regions are at least and at most this part of the picture.
const LEAST: f64 = 0.004;
const MOST: f64 = 0.65;
/// Of two regions that overlap more than this (intersection over union) the better one is
/// kept.
const OVERLAP: f64 = 0.85;
/// How many of the regions are cut out.
const SEEDS: usize = 30;
/// How many of the best are put together with their neighbours.
const PARTS: usize = 30;
/// Neighbours touch in at least this many pixels.
const TOUCHING: usize = 4;

/// How candidates are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CandidateOptions {
    /// The longer side, in pixels, that the picture is made smaller to; 16 to 1024.
    pub size: u32,
    /// How many candidates there are at most.
    pub most: usize,
}

impl Default for CandidateOptions {
    fn default() -> Self {
        CandidateOptions { size: 128, most: 20 }
    }
}

/// An axis in which a mask is nearly its own mirror image.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// How nearly: intersection over union of the mask and its mirror image, 0 to 1.
    pub symmetry: f64,
    /// Where the mask ends along the axis, in pixels of the photograph: the lower end in
    /// the picture.
    pub foot: [f64; 2],
    /// The other end.
    pub top: [f64; 2],
    /// Half-widths across the axis in the middles of 24 equal parts from foot to top, in
    /// pixels of the photograph; smoothed lightly, above 0.
    pub widths: Vec<f64>,
    /// How much speaks for each of the [`tilts`], 0 to 1: whether a flat end, a rim or a
    /// foot, is seen as an ellipse so high.
    pub rims: Vec<f64>,
}

/// A region that may be an object of revolution.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// How much it looks like one, above 0; only comparable within a picture.
    pub score: f64,
    /// Its pixels, at the working resolution.
    pub mask: Mask,
    /// The best axis, and the best of those at least 30 degrees from it.
    pub axes: Vec<Axis>,
}

/// The candidates of a photograph, the best first.
pub fn candidates(photo: &Photo, options: &CandidateOptions) -> Vec<Candidate> {
    let picture = Picture::of(photo, options.size.clamp(16, 1024));
    let (width, height) = (f64::from(photo.width()), f64::from(photo.height()));
    let scale = [width / picture.width as f64, height / picture.height as f64];
    let edges = rim::Edges { gradient: &picture.gradient, strong: picture.strong };
    let candidate = |(score, area)| Candidate::new(score, area, &edges, scale);
    found(&picture, options.most).into_iter().filter_map(candidate).collect()
}

impl Candidate {
    /// Of a region of a picture with these edges, where a pixel is `scale` pixels of the
    /// photograph.
    fn new(score: f64, area: Area, edges: &rim::Edges, scale: [f64; 2]) -> Option<Candidate> {
        let axes =
            mirror::mirrors(&area).iter().map(|m| profile::axis(edges, &area, m, scale)).collect();
        let mask = Mask::new(area.width as u32, area.height as u32, area.on).ok()?;
        Some(Candidate { score, mask, axes })
    }
}

/// The best regions with their scores.
fn found(picture: &Picture, most: usize) -> Vec<(f64, Area)> {
    let field = Field::new(picture, clusters::codebook(picture));
    let judge = Judge::new(picture, &field.letters);
    let scored = |area: Area| (judge.score(&area), area);
    let regions =
        suppressed(regions(picture).into_iter().map(scored).collect(), OVERLAP, SEEDS.max(most));
    let cuts = regions.iter().take(SEEDS).filter_map(|(_, seed)| field.cut(seed));
    let cuts: Vec<_> = cuts.map(scored).collect();
    let parts = suppressed(cuts.into_iter().chain(regions).collect(), OVERLAP, most.max(PARTS));
    let wholes: Vec<_> = wholes(&parts).into_iter().map(scored).collect();
    suppressed(wholes.into_iter().chain(parts).collect(), OVERLAP, most)
}

/// Neighbours among the best regions put together: objects of two colours, such as a
/// lamp's foot and its shade.
fn wholes(parts: &[(f64, Area)]) -> Vec<Area> {
    let parts: Vec<&Area> = parts.iter().take(PARTS).map(|(_, area)| area).collect();
    let near: Vec<Area> =
        parts.iter().filter_map(|a| Area::new(a.width, a.height, a.dilated(1))).collect();
    let mut out = Vec::new();
    for (i, a) in parts.iter().enumerate() {
        for (b, near) in parts.iter().zip(&near).take(i) {
            // Side by side: they have little in common, and touch.
            if 20 * a.shared(b) <= a.count.min(b.count) && a.shared(near) >= TOUCHING {
                out.extend(a.union(b).map(Area::filled));
            }
        }
    }
    out
}

/// All regions that segments and clusters make, without holes.
fn regions(picture: &Picture) -> Vec<Area> {
    let part = |p: f64| (p * picture.pixels() as f64).ceil() as usize;
    let (least, most) = (part(LEAST), part(MOST));
    let edges = Edges::of(picture);
    let mut out = Vec::new();
    for (k, smallest) in [(20.0, 25), (60.0, 40)] {
        let segments = felzenszwalb(&edges, k, smallest);
        for rule in [Rule::Likeness, Rule::Edges] {
            out.extend(merge(picture, &segments, rule, least, most));
        }
    }
    out.extend(clusters::regions(picture, least));
    let filled = out.into_iter().map(Area::filled);
    filled.filter(|a| a.count <= most).collect()
}
