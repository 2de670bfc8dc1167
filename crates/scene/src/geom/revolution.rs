//! Surfaces of revolution without a mesh: the path in the half plane (r, y) with its
//! normals, which is all that drawing them exactly needs.
//!
//! The surface is the one that the mesh of a lathe approaches as the number of its sides
//! grows: cones between rings, normals linear along them. Invariant: a span's two rings
//! are consecutive and differ.

use super::revolve::{Strip, ring_normal};

/// A ring of the surface: a circle around the y axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Its radius; 0 is a pole.
    pub r: f64,
    /// Its height.
    pub y: f64,
    /// The unit normal's component away from the axis.
    pub nr: f64,
    /// The unit normal's component along the axis.
    pub ny: f64,
}

/// A cone frustum, disc or annulus between two rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The number of its first ring; the next one is its last.
    pub ring: usize,
    /// Its part.
    pub part: u16,
}

/// A sharp circle: a crease between two spans, or a boundary of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rim {
    /// The ring that it runs along.
    pub ring: usize,
    /// The numbers of the spans beside it.
    pub spans: [Option<usize>; 2],
}

/// A surface of revolution around the y axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Revolution {
    rings: Vec<Ring>,
    spans: Vec<Span>,
    rims: Vec<Rim>,
    part_count: u16,
    encloses: bool,
}

impl Revolution {
    /// From the path of a lathe, as it is swept into a mesh by [`super::revolve::revolve`].
    pub(super) fn new(strips: &[Strip], closed: bool, part_count: u16) -> Revolution {
        let points = strips.iter().map(|s| s.points.len()).sum();
        let (mut rings, mut spans) = (Vec::with_capacity(points), Vec::with_capacity(points));
        let mut rims = Vec::with_capacity(strips.len() + 1);
        let mut before: Option<usize> = None;
        for (i, s) in strips.iter().enumerate() {
            let first = rings.len();
            rings.extend(strip_rings(s));
            let sharp = match before {
                // Seams are sharp unless the strip says otherwise, ends always.
                Some(_) => !s.blend,
                None => !closed,
            };
            if sharp && s.points.first().is_some_and(|p| p.0 != 0.0) {
                rims.push(Rim { ring: first, spans: [before, Some(spans.len())] });
            }
            spans.extend(
                s.parts.iter().enumerate().map(|(k, part)| Span { ring: first + k, part: *part }),
            );
            before = spans.len().checked_sub(1);
            if i + 1 == strips.len() && s.points.last().is_some_and(|p| p.0 != 0.0) {
                let next = if closed { Some(0) } else { None };
                if !closed || strips.len() > 1 {
                    rims.push(Rim { ring: rings.len() - 1, spans: [before, next] });
                }
            }
        }
        let encloses = rims.iter().all(|rim| !rim.spans.contains(&None)) && is_simple(&rings);
        Revolution { rings, spans, rims, part_count, encloses }
    }

    /// The rings, along the path.
    pub fn rings(&self) -> &[Ring] {
        &self.rings
    }

    /// The spans between rings, along the path.
    pub fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// The two rings of a span.
    pub fn ends(&self, span: &Span) -> Option<[&Ring; 2]> {
        Some([self.rings.get(span.ring)?, self.rings.get(span.ring + 1)?])
    }

    /// The sharp circles, which show as lines from every viewpoint.
    pub fn rims(&self) -> &[Rim] {
        &self.rims
    }

    /// True if it surely encloses a body, with its normals pointing out of it.
    pub fn encloses(&self) -> bool {
        self.encloses
    }

    /// The number of parts.
    pub fn part_count(&self) -> u16 {
        self.part_count
    }
}

/// True if a path surely does not cross itself: it goes up, then down again inside.
fn is_simple(rings: &[Ring]) -> bool {
    let top = rings.windows(2).position(|pair| pair[1].y < pair[0].y);
    let top = top.unwrap_or(rings.len().saturating_sub(1));
    let (Some(outer), Some(inner)) = (rings.get(..=top), rings.get(top..)) else { return false };
    let rises = |pair: &&[Ring]| pair[0].y < pair[1].y;
    let ends_above = matches!((outer.first(), inner.last()), (Some(a), Some(b)) if a.y <= b.y);
    if inner.windows(2).any(|pair| rises(&pair)) || !ends_above {
        return false;
    }
    let mut walls = outer.windows(2).filter(rises).peekable();
    let at = |a: &Ring, b: &Ring, y: f64| a.r + (b.r - a.r) * ((y - a.y) / (b.y - a.y));
    for (a, b) in inner.windows(2).rev().map(|pair| (&pair[1], &pair[0])) {
        if a.y == b.y {
            continue;
        }
        // All outer spans beside this inner one.
        while let Some([c, d]) = walls.peek() {
            let ends = [a.y.max(c.y), b.y.min(d.y)];
            if ends[0] < ends[1] && ends.iter().any(|y| at(a, b, *y) > at(c, d, *y)) {
                return false;
            }
            if d.y >= b.y {
                break;
            }
            walls.next();
        }
        if walls.peek().is_none() {
            return false;
        }
    }
    true
}

/// The rings of a strip, with normals from central differences.
fn strip_rings(s: &Strip) -> impl Iterator<Item = Ring> {
    let last = s.points.len().saturating_sub(1);
    s.points.iter().enumerate().map(move |(i, &(r, y))| {
        let (nr, ny) = ring_normal([s.points[i.saturating_sub(1)], s.points[(i + 1).min(last)]]);
        match r == 0.0 {
            true => Ring { r, y, nr: 0.0, ny: if ny < 0.0 { -1.0 } else { 1.0 } },
            false => Ring { r, y, nr, ny },
        }
    })
}
