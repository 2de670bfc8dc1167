//! What hides pieces of contour: for each pixel at which some are tested, the nearest
//! surface in front of the farthest depth that a test asks about. Surfaces behind that, most
//! of them, are not looked at.

use super::Posed;
#[cfg(test)]
use super::lanes::Plain;
use super::lanes::{Lanes, Work, widest};
use super::rays::{Asked, GROUP, Rays};
use crate::render::Camera;
use crate::render::lines::visibility::{Depths, Piece};
use smallvec::SmallVec;

/// Depth at the pixels where pieces are tested. Reused from image to image.
#[derive(Default)]
pub(in crate::render) struct Hiding {
    /// By pixel. All are [`UNASKED`] between images.
    asked: Vec<Asked>,
    /// For each tile, the first of its pixels in `list`, plus 1; 0 between images.
    tiles: Vec<u32>,
    /// Tiles that have some.
    used: Vec<u32>,
    /// The pixels asked for, and for each the index plus 1 of the next one of its tile.
    list: Vec<(u32, u32)>,
    /// The least depth at which the test of each piece passes.
    least: Vec<f64>,
    /// The depth at pixels, or infinity if it is beyond all limits; meaningless at others.
    depth: Vec<f32>,
    /// Faces tested against lines of sight so far, and faces of which depth was computed.
    pub tested: usize,
    pub drawn: usize,
}

const UNASKED: Asked = Asked { all: 0.0, any: f64::INFINITY };

/// Pixels in a square of this side are looked up together: fewer if the clusters are smaller
/// than this, in pixels.
const TILES: [u32; 2] = [4, 8];
const FINE: f64 = 3.0;

impl Hiding {
    /// Clears `hidden` for the pieces that pass their test on a side, of those that are set.
    pub fn test(
        &mut self,
        posed: &[Posed<'_>],
        camera: &Camera,
        extent: f64,
        (side, pieces, hidden): (usize, &[Piece], &mut [bool]),
    ) {
        let fine = posed.iter().any(|posed| posed.grain < FINE);
        let tile_side = TILES[usize::from(!fine)];
        let (pixels, across) = (camera.pixels(), camera.width.div_ceil(tile_side));
        if self.asked.len() < pixels {
            self.asked.resize(pixels, UNASKED);
            self.depth.resize(pixels, f32::INFINITY);
        }
        let tiles = (across * camera.height.div_ceil(tile_side)) as usize;
        if self.tiles.len() < tiles {
            self.tiles.resize(tiles, 0);
        }
        let Hiding { asked, tiles, used, list, least, depth, tested, drawn } = self;
        let Some(depths) = Depths::new(&depth[..pixels], camera.width, camera.height, extent)
        else {
            return;
        };
        used.clear();
        list.clear();
        least.clear();
        for (hidden, piece) in hidden.iter().zip(pieces) {
            if !*hidden {
                least.push(f64::INFINITY);
                continue;
            }
            let (pixel, own) = depths.least_by(piece, side).unwrap_or((u32::MAX, f64::INFINITY));
            least.push(own);
            let Some(asked) = asked.get_mut(pixel as usize) else { continue };
            if *asked == UNASKED {
                let (row, column) = (pixel / camera.width, pixel % camera.width);
                let tile = row / tile_side * across + column / tile_side;
                if let Some(first) = tiles.get_mut(tile as usize) {
                    if *first == 0 {
                        used.push(tile);
                    }
                    list.push((pixel, *first));
                    *first = list.len() as u32;
                }
            }
            asked.all = if own > asked.all { own } else { asked.all };
            asked.any = if own < asked.any { own } else { asked.any };
        }
        let mut rays: SmallVec<[Rays<'_>; 1]> =
            posed.iter().filter(|p| !p.outside).map(|p| Rays::new(p, camera)).collect();
        widest(LookUp { tiles, used, list, asked, depth, width: camera.width, rays: &mut rays });
        for rays in rays {
            (*tested, *drawn) = (*tested + rays.tested, *drawn + rays.drawn);
        }
        for ((hidden, piece), least) in hidden.iter_mut().zip(pieces).zip(least) {
            let passes = piece.pixel(side).is_some_and(|pixel| {
                depth.get(pixel as usize).is_some_and(|depth| f64::from(*depth) >= *least)
            });
            *hidden &= !passes;
        }
    }
}

/// The pixels asked for, and where their depth goes.
struct LookUp<'a, 'b> {
    tiles: &'a mut [u32],
    used: &'a [u32],
    list: &'a [(u32, u32)],
    asked: &'a mut [Asked],
    depth: &'a mut [f32],
    width: u32,
    rays: &'a mut [Rays<'b>],
}

impl Work for LookUp<'_, '_> {
    type Out = ();

    /// Looks all pixels up, and makes `asked` and `tiles` what they are between images.
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for tile in self.used {
            let Some(first) = self.tiles.get_mut(*tile as usize) else { continue };
            let mut next = std::mem::take(first);
            while next != 0 {
                let mut group = [(0, UNASKED, f32::INFINITY); GROUP];
                let mut count = 0;
                while let Some((pixel, after)) = self.list.get((next as usize).wrapping_sub(1))
                    && count < GROUP
                {
                    if let Some(asked) = self.asked.get_mut(*pixel as usize) {
                        group[count] = (*pixel, *asked, f32::INFINITY);
                        *asked = UNASKED;
                        count += 1;
                    }
                    next = *after;
                }
                for rays in &mut *self.rays {
                    rays.nearest(lanes, &mut group, count, self.width);
                }
                for (pixel, _, own) in &group[..count] {
                    if let Some(depth) = self.depth.get_mut(*pixel as usize) {
                        *depth = *own;
                    }
                }
            }
        }
    }
}

/// The depth at all pixels, in groups of pixels that are `step` apart; with AVX if there is
/// any, or without.
#[cfg(test)]
pub(super) fn depth(posed: &Posed<'_>, camera: &Camera, step: u32, plain: bool) -> Vec<f32> {
    let pixels = camera.pixels() as u32;
    let mut rays = [Rays::new(posed, camera)];
    let mut depth = vec![0.0; camera.pixels()];
    let mut asked = vec![Asked { all: f64::INFINITY, any: 0.0 }; camera.pixels()];
    let list: Vec<(u32, u32)> =
        (0..pixels).map(|i| (i * step % pixels, (i + 2) % (pixels + 1))).collect();
    let look_up = LookUp {
        tiles: &mut [1],
        used: &[0],
        list: &list,
        asked: &mut asked,
        depth: &mut depth,
        width: camera.width,
        rays: &mut rays,
    };
    match plain {
        true => look_up.run(Plain),
        false => widest(look_up),
    }
    depth
}
