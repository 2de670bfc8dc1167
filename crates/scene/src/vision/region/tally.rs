//! Counts of the colours in each group of pixels, kept from one picture to the next.
//!
//! Invariant: scores are those of counting the picture anew, bit for bit: counts are whole
//! numbers, and each tile's score is computed from its counts alone.

use super::Region;

/// Number of pixels that are compared at a time.
const SOME: usize = 64;

/// The groups of a picture, the counts of their colours, and the scores of its tiles.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    groups: Vec<u8>,
    /// Number of pixels whose group is not 0.
    inside: usize,
    /// Number of pixels of each cell, group after group, starting with group 1.
    counts: Vec<u32>,
    /// Number of pixels of each colour, likewise.
    colours: Vec<u32>,
    /// The score of each tile relative to all background, and whether its counts have
    /// changed since it was computed.
    tiles: Vec<f64>,
    changed: Vec<bool>,
    /// Scratch memory: counts of the background.
    ground: Vec<u32>,
}

impl Tally {
    /// True if all is background.
    pub(super) fn is_empty(&self) -> bool {
        self.inside == 0
    }

    /// Counts the pixels whose group differs; missing ones are background.
    pub(super) fn follow(&mut self, region: &Region, groups: &[u8]) {
        let pixels = region.cells.len();
        if self.groups.len() != pixels {
            let tiles = region.empty_tiles.len();
            *self = Tally {
                groups: vec![0; pixels],
                tiles: vec![0.0; tiles],
                changed: vec![false; tiles],
                ..Tally::default()
            };
        }
        let mut here = std::mem::take(&mut self.groups);
        let (known, missing) = here.split_at_mut(groups.len().min(pixels));
        let known = known.chunks_mut(SOME).zip(groups.chunks(SOME));
        for (i, (known, groups)) in known.enumerate().filter(|(_, (known, groups))| known != groups)
        {
            for (j, (known, group)) in known.iter_mut().zip(groups).enumerate() {
                self.move_pixel(region, SOME * i + j, known, *group);
            }
        }
        for (i, known) in missing.iter_mut().enumerate() {
            self.move_pixel(region, groups.len() + i, known, 0);
        }
        self.groups = here;
    }

    #[inline]
    fn move_pixel(&mut self, region: &Region, pixel: usize, known: &mut u8, group: u8) {
        if *known == group {
            return;
        }
        let Some(cell) = region.cells.get(pixel).map(|cell| *cell as usize) else { return };
        let (cells, k) = (region.totals.len(), region.colours);
        if let Some(before) = usize::from(*known).checked_sub(1) {
            self.counts[before * cells + cell] -= 1;
            self.colours[before * k + cell % k] -= 1;
            self.inside -= 1;
        }
        if let Some(now) = usize::from(group).checked_sub(1) {
            if (now + 1) * cells > self.counts.len() {
                self.counts.resize((now + 1) * cells, 0);
                self.colours.resize((now + 1) * k, 0);
            }
            self.counts[now * cells + cell] += 1;
            self.colours[now * k + cell % k] += 1;
            self.inside += 1;
        }
        self.changed[cell / k] = true;
        *known = group;
    }

    /// The sum of the scores of the tiles, relative to all background.
    pub(super) fn tiles(&mut self, region: &Region) -> f64 {
        let (cells, k) = (region.totals.len(), region.colours);
        let Tally { counts, tiles, changed, ground, .. } = self;
        let totals = region.totals.chunks_exact(k).zip(&region.empty_tiles);
        let lists = tiles.iter_mut().zip(changed).zip(totals).enumerate();
        for (i, ((tile, changed), (total, empty))) in lists.filter(|(_, ((_, c), _))| **c) {
            *changed = false;
            ground.clear();
            ground.extend_from_slice(total);
            let (mut seen, mut score) = (false, 0.0);
            for group in counts.chunks_exact(cells) {
                let here = &group[i * k..(i + 1) * k];
                if here.iter().any(|n| *n > 0) {
                    seen = true;
                    ground.iter_mut().zip(here).for_each(|(g, n)| *g -= n);
                    score += region.urn.score(here.iter().copied());
                }
            }
            let all = || score + region.urn.score(ground.iter().copied()) - empty;
            *tile = if seen { all() } else { 0.0 };
        }
        tiles.iter().sum()
    }

    /// The score of the whole picture, relative to all background.
    pub(super) fn whole(&mut self, region: &Region) -> f64 {
        self.ground.clone_from(&region.whole);
        let mut score = 0.0;
        for group in self.colours.chunks_exact(region.colours) {
            self.ground.iter_mut().zip(group).for_each(|(g, n)| *g -= n);
            score += region.urn.score(group.iter().copied());
        }
        score + region.urn.score(self.ground.iter().copied()) - region.empty
    }
}
