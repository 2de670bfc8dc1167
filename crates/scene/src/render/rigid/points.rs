//! Single vertices in the image, projected when they are asked for.

use super::Posed;
use crate::geom::Edge;
use crate::render::lines::extraction::{Points, SPECK};
use crate::render::pixels::place::{Place, Point, place};
use crate::render::pixels::project::span_of;

impl Posed<'_> {
    /// A vertex in the image, with its rounded position.
    #[inline(always)]
    pub(super) fn vertex(&self, v: u32) -> Option<(Point, Place)> {
        let p = self.mesh.positions.get(v as usize)?;
        let point = self.lens.point(self.placement.point(p.as_dvec3()));
        Some((point.single(), place(point.x, point.y)))
    }
}

impl Points for Posed<'_> {
    #[inline(always)]
    fn point(&self, v: u32) -> Point {
        let nowhere = Point { x: f64::NAN, y: f64::NAN, nearness: f64::NAN };
        self.vertex(v).map_or(nowhere, |(point, _)| point)
    }

    #[inline(always)]
    fn whole(&self) -> bool {
        true
    }

    fn is_speck(&self, line: &[Edge]) -> bool {
        let mut least = Place::INFINITY;
        for (_, at) in line.iter().flat_map(|e| e.vertices).filter_map(|v| self.vertex(v)) {
            least = least.min(at);
            // It only grows.
            if span_of(least) >= SPECK {
                return false;
            }
        }
        span_of(least) < SPECK
    }
}
