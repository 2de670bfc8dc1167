//! Scores how much a region looks like the silhouette of an object of revolution.

use super::area::Area;
use super::clusters::LETTERS;
use super::features::PictureFeatures;
use super::mirror::symmetry;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Minimum symmetry of an object of revolution, whatever its other properties.
const SYMMETRIC: f64 = 0.5;

/// Data for scoring regions of a picture.
pub struct Scorer<'a> {
    codewords: &'a [u8],
    /// The edge strength at a pixel or beside it, 0 to 1.
    edges: Vec<f32>,
}

impl Scorer<'_> {
    /// Prepares a picture with its letters.
    pub fn new<'a>(picture: &PictureFeatures, codewords: &'a [u8]) -> Scorer<'a> {
        let (w, h) = (picture.width, picture.height);
        let most = |p: usize| {
            let (i, j) = (p % w, p / w);
            let rows = j.saturating_sub(1)..(j + 2).min(h);
            let near =
                rows.flat_map(|j| (i.saturating_sub(1)..(i + 2).min(w)).map(move |i| j * w + i));
            near.map(|q| picture.gradient.magnitude[q]).fold(0.0, f32::max)
        };
        Scorer {
            codewords,
            edges: (0..w * h).map(|p| (most(p) / picture.strong).min(1.0)).collect(),
        }
    }

    /// Returns the factors of a region's score that are fast to compute: edges along the
    /// outline, little outline at the picture's frame, and a sufficient size; at least 0.
    pub fn bound(&self, area: &Area) -> f64 {
        let part = area.count as f64 / self.edges.len() as f64;
        let fade = ((0.65 - part) / 0.15).clamp(0.0, 1.0);
        if fade == 0.0 {
            return 0.0;
        }
        let (outline, framed) = area.outline();
        let border = framed as f64 / outline.len() as f64;
        let inside = (1.0 - 4.0 * border).max(0.0);
        let support =
            outline.iter().map(|p| f64::from(self.edges[*p])).sum::<f64>() / outline.len() as f64;
        support * inside * part.min(0.15).sqrt() * fade
    }

    /// Returns the other factors, 0 to 1. Symmetry is what distinguishes objects of
    /// revolution from others; the other one is contrast with the surrounding colours.
    pub fn likeness(&self, area: &Area) -> f64 {
        let symmetry = symmetry(area);
        if symmetry < SYMMETRIC {
            return 0.0;
        }
        let chi = self.contrast(area);
        symmetry.powi(4) * chi * chi
    }

    /// Returns one minus the Bhattacharyya coefficient between the letters of a region
    /// and of a ring around it; 0 without a ring.
    fn contrast(&self, area: &Area) -> f64 {
        let ring = area.dilated((0.15 * (area.count as f64).sqrt()).max(3.0) as usize);
        let mut counts = [[0u32; LETTERS]; 2];
        for (i, j) in ring.points() {
            let letter = self.codewords[j * ring.width + i];
            counts[usize::from(area.pixels.has(i, j))][usize::from(letter)] += 1;
        }
        let totals = counts.map(|c| f64::from(c.iter().sum::<u32>()));
        if totals[0] == 0.0 {
            return 0.0;
        }
        let both = |l: usize| (f64::from(counts[0][l]) * f64::from(counts[1][l])).sqrt();
        let shared: f64 = (0..LETTERS).map(both).sum();
        1.0 - shared / (totals[0] * totals[1]).sqrt()
    }
}

/// A region with its score.
pub struct Scored {
    pub score: f64,
    pub area: Area,
    /// True if the score is only a bound so far.
    bound: bool,
}

impl Scored {
    /// A region with a bound on its score.
    pub fn bounded(bound: f64, area: Area) -> Scored {
        Scored { score: bound, area, bound: true }
    }
}

/// Returns the best regions by score, at most `most`, none of which overlaps a better one
/// by more than `overlap` (intersection over union). The score is the bound times `likeness`,
/// 0 to 1, which is worked out only for regions that may be among the best.
pub fn suppressed(
    regions: impl IntoIterator<Item = Scored>,
    likeness: impl Fn(&Area) -> f64,
    overlap: f64,
    most: usize,
) -> Vec<Scored> {
    let mut waiting: BinaryHeap<Waiting> = regions
        .into_iter()
        .enumerate()
        .map(|(number, scored)| Waiting { scored, number })
        .collect();
    let mut kept: Vec<Scored> = Vec::new();
    while kept.len() < most
        && let Some(Waiting { mut scored, number }) = waiting.pop()
        && scored.score > 0.0
    {
        if kept.iter().any(|k| k.area.overlaps(&scored.area, overlap)) {
            continue;
        }
        if scored.bound {
            scored.score *= likeness(&scored.area);
            scored.bound = false;
            waiting.push(Waiting { scored, number });
        } else {
            kept.push(scored);
        }
    }
    kept
}

/// A region in the queue: the highest score first, and the first in the list among equals.
struct Waiting {
    scored: Scored,
    number: usize,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.scored.score.total_cmp(&other.scored.score).then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Waiting {}
