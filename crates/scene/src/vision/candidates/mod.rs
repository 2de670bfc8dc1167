//! Regions of a photograph that may be objects of revolution (vases, bottles, cups,
//! lamps), without learned weights.
//!
//! For clean contours without a photograph, the candidates are the regions that the
//! contours enclose. For a photograph, segments and clusters of colour are merged into
//! regions, and the most promising ones are cut out along edges. Regions are ranked by
//! symmetry, contrast with their surroundings, and distance from the picture's border.
//!
//! The result is a function of the picture alone, with the same bits on any machine. The
//! use of the candidates, and anything in three dimensions, is elsewhere.

pub(super) mod area;
pub(super) mod clusters;
pub(super) mod components;
mod cut;
mod enclosed;
pub(super) mod features;
mod felzenszwalb;
mod merge;
pub(super) mod mirror;
pub(super) mod pixels;
pub(super) mod profile;
pub(super) mod rim;
mod score;
#[cfg(test)]
mod tests;

use crate::vision::{Mask, Photo};
use area::Area;
use cut::Field;
pub use enclosed::enclosed;
use features::PictureFeatures;
use felzenszwalb::{Edges, felzenszwalb};
use merge::{Rule, merge};
use pcadlang_numerics::platform::threads::map_side_by_side;
use pixels::Pixels;
pub use rim::tilts;
use score::{Scored, Scorer, suppressed};

/// Minimum and maximum size of regions, as a fraction of the picture.
const LEAST: f64 = 0.004;
const MOST: f64 = 0.65;
/// Of two regions with a larger intersection over union than this, only the better one is
/// kept.
const OVERLAP: f64 = 0.85;
/// Number of regions that are cut out.
const SEEDS: usize = 30;
/// Number of best regions that are joined with their neighbours.
const PARTS: usize = 30;
/// Minimum number of pixels in which neighbours touch.
const TOUCHING: usize = 4;

/// Options of the search for candidates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CandidateOptions {
    /// The longer side, in pixels, that the picture is shrunk to; 16 to 1024.
    pub size: u32,
    /// The maximum number of candidates.
    pub most: usize,
}

impl Default for CandidateOptions {
    fn default() -> Self {
        CandidateOptions { size: 128, most: 20 }
    }
}

/// An axis about which a mask is nearly mirror-symmetric.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Intersection over union of the mask and its mirror image, 0 to 1.
    pub symmetry: f64,
    /// The end of the mask along the axis that is lower in the picture, in pixels of the
    /// photograph.
    pub foot: [f64; 2],
    /// The other end.
    pub top: [f64; 2],
    /// Half-widths across the axis at the centres of 24 equal parts from foot to top, in
    /// pixels of the photograph; lightly smoothed, above 0.
    pub widths: Vec<f64>,
    /// The evidence for each of the [`tilts`], 0 to 1: whether a flat end, a rim or a
    /// foot, is visible as an ellipse of the corresponding height.
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

/// Returns the candidates of a photograph, the best first.
pub fn candidates(photo: &Photo, options: &CandidateOptions) -> Vec<Candidate> {
    let picture = PictureFeatures::of(photo, options.size.clamp(16, 1024));
    let (width, height) = (f64::from(photo.width()), f64::from(photo.height()));
    let scale = [width / picture.width as f64, height / picture.height as f64];
    let edges = rim::Edges { gradient: &picture.gradient, strong: picture.strong };
    let found = found(&picture, options.most);
    let all = map_side_by_side(&found, |scored| Candidate::new(scored, &edges, scale));
    all.into_iter().flatten().collect()
}

impl Candidate {
    /// Builds a candidate from a region of a picture with these edges, where a pixel is
    /// `scale` pixels of the photograph.
    fn new(scored: &Scored, edges: &rim::Edges, scale: [f64; 2]) -> Option<Candidate> {
        let Scored { score, area, .. } = scored;
        let axes =
            mirror::mirrors(area).iter().map(|m| profile::axis(edges, area, m, scale)).collect();
        let Pixels { width, height, .. } = &area.pixels;
        let mask = Mask::new(*width as u32, *height as u32, area.pixels.bools()).ok()?;
        Some(Candidate { score: *score, mask, axes })
    }
}

/// Returns the best regions with their scores.
fn found(picture: &PictureFeatures, most: usize) -> Vec<Scored> {
    let field = Field::new(picture, clusters::codebook(picture));
    let scorer = Scorer::new(picture, &field.codewords);
    let bounded = |area: Area| Scored::bounded(scorer.bound(&area), area);
    let best =
        |all: Vec<Scored>, most| suppressed(all, |area| scorer.likeness(area), OVERLAP, most);
    let regions = best(regions(picture).into_iter().map(bounded).collect(), SEEDS.max(most));
    let cuts = map_side_by_side(&regions[..SEEDS.min(regions.len())], |seed| field.cut(&seed.area));
    let cuts = cuts.into_iter().flatten().map(bounded);
    let parts = best(cuts.chain(regions).collect(), most.max(PARTS));
    let wholes: Vec<Scored> = wholes(&parts).into_iter().map(bounded).collect();
    best(wholes.into_iter().chain(parts).collect(), most)
}

/// Joins neighbours among the best regions, for objects of two colours, such as a lamp's
/// foot and shade.
fn wholes(parts: &[Scored]) -> Vec<Area> {
    let parts: Vec<&Area> = parts.iter().take(PARTS).map(|scored| &scored.area).collect();
    let near: Vec<Pixels> = parts.iter().map(|a| a.dilated(1)).collect();
    let mut out = Vec::new();
    for (i, a) in parts.iter().enumerate() {
        for (b, near) in parts.iter().zip(&near).take(i) {
            // Side by side: they overlap little, and touch.
            if 20 * a.shared(&b.pixels) <= a.count.min(b.count) && a.shared(near) >= TOUCHING {
                out.extend(a.union(b).map(Area::filled));
            }
        }
    }
    out
}

/// The ways of making regions.
enum RegionMethod<'a> {
    /// Segments that are merged.
    Segments(&'a (Vec<u32>, usize), Rule),
    /// Clusters of colours, with these weights of position and variation.
    Colours([f32; 2]),
}

/// Returns all regions from segments and clusters, without holes.
fn regions(picture: &PictureFeatures) -> Vec<Area> {
    let part = |p: f64| (p * picture.pixels() as f64).ceil() as usize;
    let (least, most) = (part(LEAST), part(MOST));
    let edges = Edges::of(picture);
    let segments = [(20.0, 25), (60.0, 40)].map(|(k, smallest)| felzenszwalb(&edges, k, smallest));
    let rules = [Rule::Likeness, Rule::Edges];
    let merges = segments.iter().flat_map(|s| rules.map(|rule| RegionMethod::Segments(s, rule)));
    let methods: Vec<RegionMethod> =
        merges.chain(clusters::WEIGHTS.map(RegionMethod::Colours)).collect();
    let out = map_side_by_side(&methods, |method| {
        let areas = match method {
            RegionMethod::Segments(segments, rule) => merge(picture, segments, *rule, least, most),
            RegionMethod::Colours(weights) => clusters::regions(picture, *weights, least),
        };
        let filled = areas.into_iter().map(Area::filled);
        filled.filter(|a| a.count <= most).collect::<Vec<_>>()
    });
    out.into_iter().flatten().collect()
}
