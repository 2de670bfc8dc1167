//! Scores how much a region looks like the silhouette of an object of revolution.

use super::area::Area;
use super::clusters::LETTERS;
use super::mirror::symmetry;
use super::picture::Picture;

/// Minimum symmetry of an object of revolution, whatever its other properties.
const SYMMETRIC: f64 = 0.5;

/// Data for scoring regions of a picture.
pub struct Judge<'a> {
    codewords: &'a [u8],
    /// The edge strength at a pixel or beside it, 0 to 1.
    edges: Vec<f32>,
}

impl Judge<'_> {
    /// Prepares a picture with its letters.
    pub fn new<'a>(picture: &Picture, codewords: &'a [u8]) -> Judge<'a> {
        let (w, h) = (picture.width, picture.height);
        let most = |p: usize| {
            let (i, j) = (p % w, p / w);
            let rows = j.saturating_sub(1)..(j + 2).min(h);
            let near =
                rows.flat_map(|j| (i.saturating_sub(1)..(i + 2).min(w)).map(move |i| j * w + i));
            near.map(|q| picture.gradient.magnitude[q]).fold(0.0, f32::max)
        };
        Judge {
            codewords,
            edges: (0..w * h).map(|p| (most(p) / picture.strong).min(1.0)).collect(),
        }
    }

    /// Returns the score of a region, at least 0. Symmetry is what distinguishes objects
    /// of revolution from others. The other factors are edges along the outline, contrast
    /// with the surrounding colours, little outline at the picture's frame, and a
    /// sufficient size.
    pub fn score(&self, area: &Area) -> f64 {
        let part = area.count as f64 / area.on.len() as f64;
        let fade = ((0.65 - part) / 0.15).clamp(0.0, 1.0);
        let (outline, framed) = area.outline();
        let border = framed as f64 / outline.len() as f64;
        let inside = (1.0 - 4.0 * border).max(0.0);
        if fade * inside == 0.0 {
            return 0.0;
        }
        let support =
            outline.iter().map(|p| f64::from(self.edges[*p])).sum::<f64>() / outline.len() as f64;
        let size = part.min(0.15).sqrt();
        let symmetry = symmetry(area);
        if symmetry < SYMMETRIC {
            return 0.0;
        }
        let chi = self.contrast(area);
        let symmetry = symmetry * symmetry;
        symmetry * symmetry * support * chi * chi * inside * size * fade
    }

    /// Returns one minus the Bhattacharyya coefficient between the letters of a region
    /// and of a ring around it; 0 without a ring.
    fn contrast(&self, area: &Area) -> f64 {
        let ring = area.dilated((0.15 * (area.count as f64).sqrt()).max(3.0) as usize);
        let mut counts = [[0u32; LETTERS]; 2];
        for (p, _) in ring.iter().enumerate().filter(|(_, inside)| **inside) {
            counts[usize::from(area.on[p])][usize::from(self.codewords[p])] += 1;
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

/// Returns the best regions by score, at most `most`, none of which overlaps a better one
/// by more than `overlap` (intersection over union).
pub fn suppressed(mut scored: Vec<(f64, Area)>, overlap: f64, most: usize) -> Vec<(f64, Area)> {
    // A stable sort: equal scores stay in their original order.
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f64, Area)> = Vec::new();
    for (score, area) in scored {
        if kept.len() == most {
            break;
        }
        if score > 0.0 && kept.iter().all(|(_, k)| !k.overlaps(&area, overlap)) {
            kept.push((score, area));
        }
    }
    kept
}
