//! What stands still: its depth, and its pieces of contour sorted by how much they depend on what else there is.

use crate::render::Camera;
use crate::render::project::DepthRange;
use crate::render::raster::Area;
use crate::render::visibility::{Depths, Piece};

/// Half the width of the depth ranges that a backdrop is first made ready for, relatively.
const FIRST_WIDTH: f64 = 0.005;

/// A piece of the backdrop.
pub struct Live {
    pub piece: Piece,
    pub leaf: usize,
    pub shown: bool,
}

/// What stands still.
#[derive(Default)]
pub struct Still {
    pub depth: Vec<f32>,
    pub range: DepthRange,
    /// All pieces, with the number of their mesh.
    pub pieces: Vec<(Piece, usize)>,
    /// The depth ranges of the scene for which the rest holds.
    extents: [f64; 2],
    /// Half the width of those, relatively.
    width: f64,
    /// Pieces that the backdrop does not hide at the greatest of these depth ranges.
    pub live: Vec<Live>,
    /// Of those, the ones with a look that it ends at the least of them only.
    pub unsure: Vec<u32>,
    /// By pixel: the least depth that leaves any of those free that look there, whatever the depth range.
    pub nearest: Vec<f64>,
    /// Where in `looks` the pieces that look at each pixel begin.
    pub start: Vec<u32>,
    pub looks: Vec<u32>,
}

impl Still {
    /// Nothing in a picture.
    pub fn new(camera: &Camera) -> Still {
        Still { depth: vec![f32::INFINITY; camera.pixels()], width: FIRST_WIDTH, ..Still::default() }
    }

    /// Whether it hides all of a mesh with this depth range that covers pixels of an area only, contours included.
    pub fn hides(&self, range: &DepthRange, area: &Area, camera: &Camera) -> bool {
        let (limit, width) = (Depths::hiding(self.extents[1], range), camera.width as usize);
        // Pieces may lie, and look, a little beside the area.
        const REACH: usize = 4;
        let (left, right) = (area.left.saturating_sub(REACH), (area.right + REACH).min(width));
        let rows = area.top.saturating_sub(REACH)..(area.bottom + REACH).min(camera.height as usize);
        let near = |d: &f32| f64::from(*d) < limit;
        area.pixels() > 0
            && rows
                .map(|row| row * width + left..row * width + right)
                .all(|row| self.depth.get(row).is_some_and(|row| row.iter().all(near)))
    }

    /// Whether what is known of the pieces holds for a depth range.
    pub fn holds(&self, extent: f64) -> bool {
        let [least, most] = self.extents;
        least <= extent && extent <= most
    }

    /// Sorts the pieces for depth ranges about this one; for more of them if it has been done before.
    pub fn settle(&mut self, camera: &Camera, extent: f64, again: bool) -> Option<()> {
        self.width = if again { (2.0 * self.width).min(0.5) } else { self.width };
        self.extents = [extent * (1.0 - self.width), extent * (1.0 + self.width)];
        let [least, most] = self.extents.map(|extent| Depths::new(&self.depth, camera.width, camera.height, extent));
        let (least, most) = (least?, most?);
        self.nearest.clear();
        self.nearest.resize(self.depth.len(), f64::INFINITY);
        self.live.clear();
        self.unsure.clear();
        for (piece, leaf) in self.pieces.iter().filter(|(piece, _)| most.visible(piece)) {
            // By each look alone: a mover may end the other one.
            if (0..2).any(|side| most.visible_by(piece, side) && !least.visible_by(piece, side)) {
                self.unsure.push(self.live.len() as u32);
            }
            self.live.push(Live { piece: *piece, leaf: *leaf, shown: false });
            for (pixel, depth) in most.looks(piece) {
                if let Some(nearest) = self.nearest.get_mut(pixel) {
                    *nearest = nearest.min(depth);
                }
            }
        }
        // A counting sort by pixel.
        self.start.clear();
        self.start.resize(self.depth.len() + 2, 0);
        let at = |live: &Live| [0, 1].map(|side| live.piece.pixel(side).map(|p| p as usize)).into_iter().flatten();
        for pixel in self.live.iter().flat_map(at) {
            self.start[pixel + 2] += 1;
        }
        let mut sum = 0;
        for start in &mut self.start {
            sum += *start;
            *start = sum;
        }
        self.looks.clear();
        self.looks.resize(sum as usize, 0);
        for (i, live) in self.live.iter().enumerate() {
            for pixel in at(live) {
                let place = &mut self.start[pixel + 1];
                self.looks[*place as usize] = i as u32;
                *place += 1;
            }
        }
        Some(())
    }
}
