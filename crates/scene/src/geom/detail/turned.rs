//! Coarser surfaces of revolution: every n-th meridian, and every m-th ring of each
//! strip.
//!
//! Ends of strips are kept, and with them poles and creases, as are rings where parts
//! meet. Invariant: the rings that a step keeps depend only on the numbers of points and
//! the parts, so a few topologies serve a profile that changes shape.

use super::Coarse;
use crate::geom::Mesh;
use crate::geom::revolve::{Strip, topology_of};
use std::sync::OnceLock;

/// The minimum number of meridians of a coarser surface, unless the fine one has fewer.
const FEWEST_SIDES: u32 = 6;

/// The data that a surface of revolution was made from.
#[derive(Debug)]
pub(in crate::geom) struct Turned {
    pub strips: Vec<Strip>,
    pub sides: u32,
    /// Whether the path ends where it starts.
    pub closed: bool,
    pub part_count: u16,
    /// For each step between rings (1, 2, 4, …), the largest distance of the path's
    /// omitted points to the coarser path; computed on first use.
    exceeds: OnceLock<Vec<f64>>,
}

/// The steps: every `sides`-th meridian and every `rings`-th ring are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Steps {
    pub sides: u32,
    pub rings: usize,
}

impl Turned {
    pub fn new(strips: Vec<Strip>, sides: u32, closed: bool, part_count: u16) -> Turned {
        Turned { strips, sides, closed, part_count, exceeds: OnceLock::new() }
    }

    /// Returns the steps with the fewest triangles whose surface is within `most` of
    /// every omitted vertex; `None` if all vertices are kept. The distance is bounded by
    /// that of the path's points from the coarser path, plus the sagitta r (1 - cos(pi /
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
        let all = self.exceeds().iter().enumerate().filter_map(fits);
        let best = all.min_by_key(|s| segments(s.rings) * (self.sides / s.sides) as usize)?;
        (best != Steps { sides: 1, rings: 1 }).then_some(best)
    }

    fn exceeds(&self) -> &[f64] {
        self.exceeds.get_or_init(|| {
            let longest = self.strips.iter().map(|s| s.points.len()).max().unwrap_or(0);
            let stray =
                |rings| self.strips.iter().map(|s| stray(s, &kept(s, rings))).fold(0.0, f64::max);
            (0..=longest.ilog2()).map(|i| stray(1 << i)).collect()
        })
    }

    /// Returns the coarser version of a mesh of this surface.
    pub(super) fn coarse(&self, mesh: &Mesh, steps: Steps) -> Coarse {
        let sides = self.sides / steps.sides;
        let mut strips = Vec::with_capacity(self.strips.len());
        let mut vertices = Vec::new();
        let mut first = 0;
        for s in &self.strips {
            let rings = kept(s, steps.rings);
            // The first vertex of each ring of the fine mesh; a pole is a single vertex.
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

/// Returns the rings of a strip that are kept: its ends, those where parts meet, and
/// every `step`-th in between.
fn kept(s: &Strip, step: usize) -> Vec<usize> {
    let last = s.points.len() - 1;
    (0..=last).filter(|i| *i == last || *i % step == 0 || s.parts[*i - 1] != s.parts[*i]).collect()
}

/// Returns the largest distance of omitted points to the segments between the kept ones.
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
