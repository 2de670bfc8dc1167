//! Regions: whether the silhouette separates the photograph's colours. The photograph is
//! reduced to few colours; the colour indices of each group of pixels (background,
//! object, or parts of it) are an exchangeable sequence whose colour probabilities are
//! integrated out under a Dirichlet prior, over the whole picture and again within each
//! of a grid of tiles. A shading term is optional.
//!
//! This is not a segmentation, and everything is learnt from the picture itself. Colours,
//! tiles and scored pixels (all of them) are fixed before inference. With a power of 1
//! for one of the two grids and 0 for everything else, the score is a normalised
//! distribution over quantised pictures, and [`Region::simulate`] samples from it. Pixels
//! are correlated, so the default powers are well below 1 and the result is a
//! pseudo-likelihood. Invariant: scores are finite, and a silhouette without pixels
//! scores 0.

mod counts;
mod palette;
mod shading;
mod tally;

pub use palette::Quantised;
pub use tally::Tally;

use self::counts::DirichletMultinomial;
use super::elements::{ComparatorError, check, check_size};
use super::pictures::photo::Photo;
use pcadlang_numerics::rng::Stream;

/// Options of [`Region`].
#[derive(Debug, Clone, PartialEq)]
pub struct RegionOptions {
    /// Power of the term of the whole picture, at least 0. Default 0.05.
    pub power: f64,
    /// Number of tiles along each side, at most 64; 0 for none. Default 8.
    pub tiles: u32,
    /// Power of the term of the tiles, at least 0. Default 0.1.
    pub tile_power: f64,
    /// Number of colours, 2 to 256; fewer if the picture has fewer. Default 32.
    pub colours: usize,
    /// Prior counts of each colour in each group, 1e-6 to 1e6. Default 0.5.
    pub prior: f64,
    /// Power of the shading term, at least 0. Default 0: no shading.
    pub shading: f64,
}

impl RegionOptions {
    /// The defaults.
    pub const USUAL: RegionOptions = RegionOptions {
        power: 0.05,
        tiles: 8,
        tile_power: 0.1,
        colours: 32,
        prior: 0.5,
        shading: 0.0,
    };
}

impl Default for RegionOptions {
    fn default() -> Self {
        RegionOptions::USUAL
    }
}

impl RegionOptions {
    /// Returns an error that names an option out of its range.
    pub fn check(&self) -> Result<(), ComparatorError> {
        check("power", "at least 0", self.power, self.power >= 0.0)?;
        check("tiles", "0 to 64", f64::from(self.tiles), self.tiles <= 64)?;
        check("tile_power", "at least 0", self.tile_power, self.tile_power >= 0.0)?;
        check("colours", "2 to 256", self.colours as f64, (2..=256).contains(&self.colours))?;
        check("prior", "1e-6 to 1e6", self.prior, (1e-6..=1e6).contains(&self.prior))?;
        check("shading", "at least 0", self.shading, self.shading >= 0.0)
    }

    /// True if the score is a normalised distribution over quantised pictures: one of the
    /// two terms has power 1, and nothing else counts.
    pub fn is_proper(&self) -> bool {
        let tiles = if self.tiles == 0 { 0.0 } else { self.tile_power };
        self.shading == 0.0 && matches!((self.power, tiles), (1.0, 0.0) | (0.0, 1.0))
    }

    /// Number of tiles along a side for counting pixels.
    fn grid(&self) -> u32 {
        if self.tile_power > 0.0 { self.tiles.max(1) } else { 1 }
    }

    /// The power of the tiles' term, 0 without tiles.
    fn by_tile(&self) -> f64 {
        if self.tiles == 0 { 0.0 } else { self.tile_power }
    }
}

/// A photograph's colours, prepared for scoring many silhouettes.
#[derive(Debug, Clone)]
pub struct Region {
    options: RegionOptions,
    colours: usize,
    /// For each pixel: its tile times the number of colours, plus its colour.
    cells: Vec<u32>,
    /// Number of pixels of each cell.
    totals: Vec<u32>,
    /// Number of pixels of each colour.
    whole: Vec<u32>,
    urn: DirichletMultinomial,
    /// The score of each tile, and of the picture, if all of it is background.
    empty_tiles: Vec<f64>,
    empty: f64,
    /// Log brightness, if shading is scored.
    brightness: Vec<f32>,
}

impl Region {
    /// Prepares a photograph for silhouettes of `width` x `height` pixels.
    ///
    /// # Errors
    /// A side outside 1 to 16384 pixels, or an option out of its range.
    pub fn prepare(
        photo: &Photo,
        width: u32,
        height: u32,
        options: &RegionOptions,
    ) -> Result<Self, ComparatorError> {
        check_size(width, height)?;
        options.check()?;
        let linear = photo.linear(width, height);
        let mut region = Region::of(&Quantised::of(&linear, options.colours)?, options)?;
        if options.shading > 0.0 {
            region.brightness = shading::log_brightness(&linear);
        }
        Ok(region)
    }

    /// Prepares a picture whose colours are already reduced; it has no shading term.
    ///
    /// # Errors
    /// An option out of its range.
    pub fn of(picture: &Quantised, options: &RegionOptions) -> Result<Self, ComparatorError> {
        options.check()?;
        let (w, h, colours) = (picture.width(), picture.height(), picture.colours());
        let tiles = options.grid();
        let tile = |i: u32, side: u32| (u64::from(i) * u64::from(tiles) / u64::from(side)) as u32;
        let pixels = (0..h).flat_map(|j| (0..w).map(move |i| (i, j))).zip(picture.labels());
        let cell = |((i, j), l): ((u32, u32), &u8)| {
            (tile(j, h) * tiles + tile(i, w)) * colours as u32 + u32::from(*l)
        };
        let cells: Vec<u32> = pixels.map(cell).collect();
        let mut totals = vec![0; (tiles * tiles) as usize * colours];
        count(&mut totals, &cells);
        let urn = DirichletMultinomial::new(colours, options.prior, cells.len());
        let empty_tiles =
            totals.chunks_exact(colours).map(|t| urn.score(t.iter().copied())).collect();
        let mut whole = vec![0; colours];
        totals.chunks_exact(colours).for_each(|t| add(&mut whole, t));
        let empty = urn.score(whole.iter().copied());
        Ok(Region {
            options: options.clone(),
            colours,
            cells,
            totals,
            whole,
            urn,
            empty_tiles,
            empty,
            brightness: Vec::new(),
        })
    }

    /// The options it was prepared with.
    pub fn options(&self) -> &RegionOptions {
        &self.options
    }

    /// The number of colours.
    pub fn colours(&self) -> usize {
        self.colours
    }

    /// Returns the weighted log ratio of the picture's colours, and of its shading if
    /// scored, relative to a picture that is all background. `groups` has a number for
    /// each pixel in row-major order: 0 is background, and each other group has its own
    /// colour distribution. `normals` are unit normals in the camera's frame, used only
    /// for shading and where the group is not 0. Elements missing at the slices' ends
    /// count as background.
    pub fn log_likelihood(&self, groups: &[u8], normals: &[[f32; 3]]) -> f64 {
        self.log_likelihood_after(groups, normals, &mut Tally::default())
    }

    /// [`Region::log_likelihood`], bit for bit, counting only the pixels whose group differs
    /// from that in the picture before. A tally belongs to one region.
    pub fn log_likelihood_after(
        &self,
        groups: &[u8],
        normals: &[[f32; 3]],
        tally: &mut Tally,
    ) -> f64 {
        tally.follow(self, groups);
        if tally.is_empty() {
            return 0.0;
        }
        let mut sum = 0.0;
        let by_tile = self.options.by_tile();
        if by_tile > 0.0 {
            sum += by_tile * tally.tiles(self);
        }
        if self.options.power > 0.0 {
            sum += self.options.power * tally.whole(self);
        }
        if self.options.shading > 0.0 {
            sum += self.options.shading * shading::log_ratio(groups, normals, &self.brightness);
        }
        sum
    }

    /// Returns for each pixel the increase of the score without shading if the pixel
    /// moves from the background to the object (all groups except 0 count as one).
    pub fn gains(&self, groups: &[u8]) -> Vec<f64> {
        let k = self.colours;
        let mut own = vec![0; self.totals.len()];
        for (_, cell) in groups.iter().zip(&self.cells).filter(|(g, _)| **g > 0) {
            own[*cell as usize] += 1;
        }
        // Per cell: the gain within its tile and in the whole picture.
        let gain = |own: &[u32], total: &[u32], power: f64| -> Vec<f64> {
            let (inside, all) = (own.iter().sum::<u32>(), total.iter().sum::<u32>());
            let one = |(n, t): (&u32, &u32)| {
                power
                    * (self.urn.slope(*n, inside)
                        - self.urn.slope(t.saturating_sub(*n), all.saturating_sub(inside)))
            };
            own.iter().zip(total).map(one).collect()
        };
        let mut inside = vec![0; k];
        own.chunks_exact(k).for_each(|t| add(&mut inside, t));
        let whole = gain(&inside, &self.whole, self.options.power);
        let tiles = own.chunks_exact(k).zip(self.totals.chunks_exact(k));
        let tiles: Vec<f64> = tiles.flat_map(|(o, t)| gain(o, t, self.options.by_tile())).collect();
        self.cells.iter().map(|c| tiles[*c as usize] + whole[*c as usize % k]).collect()
    }

    /// Samples labels given groups (row-major, one per pixel; missing ones are
    /// background), each group by Polya's urn: within tiles if the tiles' term is the
    /// only one, over the whole picture otherwise. If the options are
    /// [proper](RegionOptions::is_proper), these are samples from the distribution that
    /// is scored.
    pub fn simulate(&self, groups: &[u8], rng: &mut Stream) -> Vec<u8> {
        let k = self.colours;
        let within = self.options.power == 0.0 && self.options.by_tile() > 0.0;
        let tiles = self.totals.len() / k;
        let mut urns: Vec<(Vec<u32>, u32)> = vec![(vec![0; k], 0); tiles * 256];
        let groups = groups.iter().copied().chain(std::iter::repeat(0));
        let draw = |(cell, group): (&u32, u8)| {
            let tile = if within { *cell as usize / k } else { 0 };
            let Some((counts, n)) = urns.get_mut(tile * 256 + usize::from(group)) else { return 0 };
            let mut left = rng.uniform() * (self.options.prior * k as f64 + f64::from(*n));
            let mut label = 0;
            for (i, c) in counts.iter().enumerate() {
                label = i;
                left -= self.options.prior + f64::from(*c);
                if left < 0.0 {
                    break;
                }
            }
            *n += 1;
            if let Some(c) = counts.get_mut(label) {
                *c += 1;
            }
            label as u8
        };
        self.cells.iter().zip(groups).map(draw).collect()
    }
}

fn count(counts: &mut [u32], cells: &[u32]) {
    for c in cells {
        if let Some(n) = counts.get_mut(*c as usize) {
            *n += 1;
        }
    }
}

fn add(to: &mut [u32], from: &[u32]) {
    to.iter_mut().zip(from).for_each(|(t, f)| *t += f);
}

#[cfg(test)]
mod tests;
