//! Where one contour passes behind another, and how its visible length changes when they
//! move.
//!
//! A contour that continues unseen behind a nearer one ends at the crossing of their
//! images. When the nearer one moves by v and the farther by w, the end moves along the
//! farther by (v - w) . n / (t . n), with t the tangent of the farther and n the normal
//! of the nearer. The depth image is not used: which pieces are visible is known, and the
//! nearer piece at the end is searched for. Invariant: contributions are added in the
//! order of the pieces.

use crate::geom::Instance;
use crate::render::Camera;
use crate::render::lines::extraction::Origin;
use crate::render::lines::visibility::Piece;
use crate::render::pixels::project::{Lens, Vertices};
use rustc_hash::FxHashMap;

/// A piece of contour, hidden or not, and its origin on the surface.
pub(in crate::render) struct Extracted<'a> {
    pub piece: Piece,
    pub origin: Origin,
    /// The vertices or edges that the ends of its segment lie on.
    pub ends: [End; 2],
    /// Its index among the visible pieces.
    pub seen: Option<usize>,
    pub instance: &'a Instance,
    /// The index of the instance's first vertex among all.
    pub base: usize,
}

/// How far from the last visible piece the nearer contour may be, in pixels: depth tests
/// are 1.2 pixels to the side and read whole pixels.
const REACH: f64 = 3.0;

/// The least sine of the angle between two contours that cross. Where contours nearly
/// coincide, the end runs along them too fast to be useful.
const LEAST: f64 = 0.3;

/// Hidden stretches shorter than this, in pixels, come and go with the pixels at which
/// they are tested; the motion of their ends is ignored.
const SHORT: f64 = 3.0;

/// The most pieces followed to measure a stretch.
const MOST: usize = 64;

/// The height of a band of pieces, in pixels.
const BAND: f64 = 4.0;

/// The place of the end of a segment: a vertex, or an edge between two, identified by
/// positions in the image, which parts that share a seam have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) struct End([u64; 2]);

impl End {
    /// Those of both ends of a segment.
    pub fn both(origin: &Origin, vertices: &Vertices<'_>) -> [End; 2] {
        let place = |v: u32| {
            let p = vertices.point(v);
            u64::from((p.x as f32).to_bits()) << 32 | u64::from((p.y as f32).to_bits())
        };
        let [a, b, c] = origin.corners;
        if b == c {
            return [a, b].map(|v| End([place(v); 2]));
        }
        let a = place(a);
        [b, c].map(|v| {
            let v = place(v);
            End([a.min(v), a.max(v)])
        })
    }
}

/// For each piece, its neighbour at the end against its tangent, and the one at the end
/// along it.
type Links = Vec<[Option<usize>; 2]>;

/// The derivatives with respect to each piece, with those with respect to the lengths of
/// contours passed on to the pieces that hide their ends.
pub(in crate::render) fn moved_ends(
    extracted: &[Extracted<'_>],
    camera: &Camera,
    by_piece: &[[f64; 4]],
) -> Vec<[f64; 4]> {
    let mut out = by_piece.to_vec();
    if extracted.iter().all(|t| t.seen.is_some()) {
        return out;
    }
    let links = links(extracted);
    let bands = Bands::new(extracted, camera);
    for (j, (t, next)) in extracted.iter().zip(&links).enumerate() {
        let Some(seen) = t.seen else { continue };
        for (side, sense) in [(0, -1.0), (1, 1.0)] {
            let Some(hidden) = next[side].filter(|h| extracted[*h].seen.is_none()) else {
                continue;
            };
            if is_short(extracted, &links, hidden, j) {
                continue;
            }
            let tangent = [sense * f64::from(t.piece.tx), sense * f64::from(t.piece.ty)];
            let Some((nearer, [nx, ny])) = bands.nearer(extracted, camera, t, tangent) else {
                continue;
            };
            let (Some(&[gx, gy, by_length, _]), Some(nearer)) =
                (by_piece.get(seen), extracted[nearer].seen)
            else {
                continue;
            };
            // The added length lies at the end of the piece, half its length from the
            // middle.
            let by = by_length + 0.5 * (gx * tangent[0] + gy * tangent[1]);
            let across = tangent[0] * nx + tangent[1] * ny;
            for (i, by) in [(nearer, by / across), (seen, -by / across)] {
                if let Some(place) = out.get_mut(i).filter(|_| by.is_finite()) {
                    place[0] += by * nx;
                    place[1] += by * ny;
                }
            }
        }
    }
    out
}

/// Where a piece ends along its tangent (1) or against it (0).
fn end(t: &Extracted<'_>, side: usize) -> [f64; 2] {
    let by = (side as f64 - 0.5) * f64::from(t.piece.length);
    [
        f64::from(t.piece.x) + by * f64::from(t.piece.tx),
        f64::from(t.piece.y) + by * f64::from(t.piece.ty),
    ]
}

/// Finds the neighbours of each piece.
fn links(extracted: &[Extracted<'_>]) -> Links {
    let mut links: Links = vec![[None; 2]; extracted.len()];
    let mut join = |[(i, a), (j, b)]: [(usize, usize); 2]| {
        let (p, q) = (end(&extracted[i], a), end(&extracted[j], b));
        // Silhouettes on both sides of a crease end on it at different positions.
        if i != j && (p[0] - q[0]).abs() + (p[1] - q[1]).abs() < 0.05 {
            (links[i][a], links[j][b]) = (Some(j), Some(i));
        }
    };
    let mut open: FxHashMap<End, (usize, usize)> = FxHashMap::default();
    open.reserve(extracted.len());
    for (i, t) in extracted.iter().enumerate() {
        let sides = if t.origin.forward { [0, 1] } else { [1, 0] };
        let from = t.origin.at - 0.5 * t.origin.share;
        if let Some(before) = i.checked_sub(1).filter(|_| from > 1e-9)
            && extracted[before].origin.corners == t.origin.corners
        {
            join([(before, sides[1]), (i, sides[0])]);
        }
        for (which, at_end) in
            [(0, from.abs() < 1e-9), (1, (from + t.origin.share - 1.0).abs() < 1e-9)]
        {
            if !at_end {
                continue;
            }
            match open.remove(&t.ends[which]) {
                Some(other) => join([other, (i, sides[which])]),
                None => {
                    open.insert(t.ends[which], (i, sides[which]));
                }
            }
        }
    }
    links
}

/// True if the hidden stretch that begins with piece `first`, coming from `from`, is
/// short.
fn is_short(extracted: &[Extracted<'_>], links: &Links, first: usize, from: usize) -> bool {
    let (mut before, mut at, mut length) = (from, first, 0.0);
    for _ in 0..MOST {
        length += f64::from(extracted[at].piece.length);
        if length >= SHORT {
            return false;
        }
        let Some(next) = links[at].iter().flatten().copied().find(|n| *n != before) else {
            return true;
        };
        if extracted[next].seen.is_some() {
            return true;
        }
        (before, at) = (at, next);
    }
    false
}

/// The visible pieces, by horizontal bands of the image.
struct Bands {
    /// Where each band begins in `pieces`, followed by the length of `pieces`.
    start: Vec<usize>,
    pieces: Vec<usize>,
}

impl Bands {
    fn new(extracted: &[Extracted<'_>], camera: &Camera) -> Bands {
        let count = band(f64::from(camera.height)) + 1;
        let mut start = vec![0; count + 2];
        let seen = || extracted.iter().enumerate().filter(|(_, t)| t.seen.is_some());
        let of = |t: &Extracted<'_>| band(f64::from(t.piece.y)).min(count - 1);
        seen().for_each(|(_, t)| start[of(t) + 2] += 1);
        (2..start.len()).for_each(|b| start[b] += start[b - 1]);
        let mut pieces = vec![0; start[count + 1]];
        for (i, t) in seen() {
            let place = &mut start[of(t) + 1];
            pieces[*place] = i;
            *place += 1;
        }
        start.truncate(count + 1);
        Bands { start, pieces }
    }

    /// The nearer piece at which a contour becomes hidden, if it continues from the piece
    /// `of` along a tangent, and the nearer piece's normal.
    fn nearer(
        &self,
        extracted: &[Extracted<'_>],
        camera: &Camera,
        of: &Extracted<'_>,
        [tx, ty]: [f64; 2],
    ) -> Option<(usize, [f64; 2])> {
        let half = 0.5 * f64::from(of.piece.length);
        let (x, y) = (f64::from(of.piece.x) + half * tx, f64::from(of.piece.y) + half * ty);
        // At least a pixel's size nearer, so that it is not the continuation on the same
        // surface.
        let lens = Lens::new(camera);
        let pixel = if lens.pinhole { of.piece.depth / lens.scale } else { 1.0 / lens.scale };
        let last = self.start.len().saturating_sub(2);
        let range =
            self.start[band(y - REACH).min(last)]..self.start[(band(y + REACH) + 1).min(last + 1)];
        let mut best = None;
        let mut least = REACH;
        for &k in self.pieces.get(range)? {
            let p = &extracted[k].piece;
            let (dx, dy) = (x - f64::from(p.x), y - f64::from(p.y));
            if dx.abs() > REACH + 1.0 || p.depth >= of.piece.depth - pixel {
                continue;
            }
            let (kx, ky) = (f64::from(p.tx), f64::from(p.ty));
            let (nx, ny) = (ky, -kx);
            let across = tx * nx + ty * ny;
            // The tangent must lead into the nearer object, whose outside is along the
            // normal; edges have no such orientation.
            if (if p.edge { across.abs() } else { -across }) < LEAST {
                continue;
            }
            let along = ((dx * kx + dy * ky).abs() - 0.5 * f64::from(p.length)).max(0.0);
            let aside = dx * nx + dy * ny;
            let distance = (along * along + aside * aside).sqrt();
            if distance < least {
                (least, best) = (distance, Some((k, [nx, ny])));
            }
        }
        best
    }
}

fn band(y: f64) -> usize {
    (y / BAND).max(0.0) as usize
}

#[cfg(test)]
#[path = "junctions_tests.rs"]
mod tests;
