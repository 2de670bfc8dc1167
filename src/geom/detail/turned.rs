//! Coarser surfaces of revolution: every so many meridians, every so many rings of each
//! strip.
//!
//! Ends of strips stay, and with them poles and creases; so do rings where parts meet.
//! Invariant: which rings a step keeps depends on the numbers of points and parts alone,
//! so few topologies serve a profile that moves.

use super::Coarse;
use crate::geom::Mesh;
use crate::geom::revolve::{Strip, topology_of};
use std::sync::OnceLock;

/// The fewest meridians of a coarser surface, as long as the fine one has more.
const FEWEST_SIDES: u32 = 6;

/// What a surface of revolution was made of.
#[derive(Debug)]
pub(in crate::geom) struct Turned {
    pub strips: Vec<Strip>,
    pub sides: u32,
    /// Whether the path ends where it begins.
    pub closed: bool,
    pub part_count: u16,
    /// For each step between rings (1, 2, 4, …) how far points of the path left out are
    /// from it; found when asked for.
    strays: OnceLock<Vec<f64>>,
}

/// How much coarser: a meridian of so many, and a ring of so many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Steps {
    pub sides: u32,
    pub rings: usize,
}

impl Turned {
    pub fn new(strips: Vec<Strip>, sides: u32, closed: bool, part_count: u16) -> Turned {
        Turned { strips, sides, closed, part_count, strays: OnceLock::new() }
    }

    /// The steps with the fewest triangles whose surface is nowhere farther than `most`
    /// from the vertices left out, if not every vertex is kept. The distance is at most
    /// that of the path's points from the coarser path, and the sagitta r (1 - cos(pi /
    /// sides)).
    pub(super) fn steps(&self, most: f64) -> Option<Steps> {
        let radius = self.strips.iter().flat_map(|s| &s.points).fold(0.0, |r: f64, p| r.max(p.0));
        let fits = |(i, stray): (usize, &f64)| {
            let rings = 1 << i;
            let sagitta = |step: u32| match step {
                1 => 0.0,
                _ => {
                    radius
                        * (1.0
                            - libm::cos(
                                core::f64::consts::PI * f64::from(step) / f64::from(self.sides),
                            ))
                }
            };
            let is_step =
                |step: &u32| self.sides.is_multiple_of(*step) && stray + sagitta(*step) <= most;
            let sides = (1..=self.sides / FEWEST_SIDES.min(self.sides)).rev().find(is_step)?;
            Some(Steps { sides, rings })
        };
        let segments = |rings| self.strips.iter().map(|s| kept(s, rings).len() - 1).sum::<usize>();
        let all = self.strays().iter().enumerate().filter_map(fits);
        let best = all.min_by_key(|s| segments(s.rings) * (self.sides / s.sides) as usize)?;
        (best != Steps { sides: 1, rings: 1 }).then_some(best)
    }

    fn strays(&self) -> &[f64] {
        self.strays.get_or_init(|| {
            let longest = self.strips.iter().map(|s| s.points.len()).max().unwrap_or(0);
            let stray =
                |rings| self.strips.iter().map(|s| stray(s, &kept(s, rings))).fold(0.0, f64::max);
            (0..=longest.ilog2()).map(|i| stray(1 << i)).collect()
        })
    }

    /// The coarser version of its mesh.
    pub(super) fn coarse(&self, mesh: &Mesh, steps: Steps) -> Coarse {
        let sides = self.sides / steps.sides;
        let mut strips = Vec::with_capacity(self.strips.len());
        let mut vertices = Vec::new();
        let mut first = 0;
        for s in &self.strips {
            let rings = kept(s, steps.rings);
            // Where each ring of the fine mesh begins; poles are one vertex.
            let begin = |p: &(f64, f64)| {
                let past = first + if p.0 == 0.0 { 1 } else { self.sides };
                std::mem::replace(&mut first, past)
            };
            let starts: Vec<u32> = s.points.iter().map(begin).collect();
            for ring in &rings {
                let count = if s.points[*ring].0 == 0.0 { 1 } else { sides };
                vertices.extend((0..count).map(|k| starts[*ring] + k * steps.sides));
            }
            let parts = rings.iter().take(rings.len() - 1).map(|ring| s.parts[*ring]).collect();
            strips.push(Strip {
                points: rings.iter().map(|ring| s.points[*ring]).collect(),
                parts,
                blend: s.blend,
            });
        }
        Coarse::of(mesh, vertices.into(), topology_of(&strips, sides, self.closed, self.part_count))
    }
}

/// The rings of a strip that are kept: its ends, where parts meet, and one of so many
/// between.
fn kept(s: &Strip, step: usize) -> Vec<usize> {
    let last = s.points.len() - 1;
    (0..=last).filter(|i| *i == last || *i % step == 0 || s.parts[*i - 1] != s.parts[*i]).collect()
}

/// How far points left out are from the segments between those kept, at most.
fn stray(s: &Strip, kept: &[usize]) -> f64 {
    let between = |ends: &[usize]| {
        let [(r0, y0), (r1, y1)] = [s.points[ends[0]], s.points[ends[1]]];
        let (dr, dy) = (r1 - r0, y1 - y0);
        let one = move |(r, y): &(f64, f64)| {
            let t = ((r - r0) * dr + (y - y0) * dy) / (dr * dr + dy * dy);
            let t = if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 };
            libm::hypot(r - r0 - t * dr, y - y0 - t * dy)
        };
        s.points[ends[0]..ends[1]].iter().map(one).fold(0.0, f64::max)
    };
    kept.windows(2).map(between).fold(0.0, f64::max)
}
