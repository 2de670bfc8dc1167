//! Mesh simplification by half-edge collapses in the order of quadric errors (Garland and
//! Heckbert 1997, *Surface simplification using quadric error metrics*). The result uses
//! the mesh's own vertices.
//!
//! Points on feature lines (creases, boundaries, borders between parts, seams between
//! normals) move only along their line; ends and crossings of lines are fixed. No face
//! flips, and by the link condition no collapse changes the topology: closed surfaces
//! stay closed. Invariant: the result depends on the mesh alone, and ties go to lower
//! indices.

use super::quadric::Quadric;
use crate::geom::NO_FACE;
use crate::geom::edges::{pair_edges, weld};
use glam::{DVec3, Vec3};
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The approximate minimum number of triangles of a level.
const FEWEST: usize = 100;
/// Above this number of triangles each level halves them; below it each keeps 70%.
const MANY: usize = 10_000;
/// The weight of an edge's squared length in the cost, so that among equal errors the
/// shortest edge collapses first.
const BY_LENGTH: f64 = 1e-3;
/// The cosine of the largest rotation of a face in one collapse, 60 degrees.
const LEAST_TURN_COS: f64 = 0.5;
/// The minimum quality of a face that a collapse may create: 1 for an equilateral
/// triangle, 0 for one without area.
const LEAST_QUALITY: f64 = 0.08;

/// The kinds of feature lines, as bits: an edge can be of several.
const CREASE: u8 = 1;
const BOUNDARY: u8 = 2;
const BORDER: u8 = 4;
const SEAM: u8 = 8;

/// Two points, the lower index first.
type Pair = (u32, u32);

fn pair(a: u32, b: u32) -> Pair {
    (a.min(b), a.max(b))
}

/// The surface to simplify.
pub(super) struct Fine<'a> {
    pub positions: &'a [Vec3],
    pub triangles: &'a [[u32; 3]],
    /// The part of each triangle.
    pub parts: &'a [u16],
    /// The end vertices of each crease edge.
    pub creases: &'a [[u32; 2]],
}

/// A coarser surface, in terms of the fine one's vertices.
pub(super) struct Coarsened {
    pub triangles: Vec<[u32; 3]>,
    /// The part of each triangle.
    pub parts: Vec<u16>,
    /// The ends of crease edges, as points: see [`weld`].
    pub creases: FxHashSet<Pair>,
    /// The vertex that each vertex was merged into: itself, if it remains.
    pub merged: Vec<u32>,
}

/// Returns ever coarser surfaces, down to about a hundred triangles.
pub(super) fn decimate(fine: &Fine) -> Vec<Coarsened> {
    let mut steps = Vec::new();
    if fine.triangles.len() < 2 * FEWEST {
        return steps;
    }
    let mut surface = Surface::new(fine);
    let mut queue = BinaryHeap::new();
    (0..surface.at.len() as u32).for_each(|p| surface.enqueue(p, &mut queue));
    let next = |live: usize| if live > MANY { live / 2 } else { live * 7 / 10 };
    let mut wanted = next(surface.live);
    while let Some(Reverse((_, from))) = queue.pop() {
        let Plan { to, stale, .. } = surface.plans[from as usize];
        surface.plans[from as usize].queued = false;
        // The surroundings may have changed since the point was queued. Costs mostly
        // rise, so few collapses happen later than they should.
        let collapse =
            if stale { None } else { surface.collapse(from, to, &surface.neighbours(from)) };
        let Some(collapse) = collapse else {
            surface.enqueue(from, &mut queue);
            continue;
        };
        surface.apply(&collapse);
        for p in surface.neighbours(to).into_iter().chain([to]) {
            surface.plans[p as usize].stale = true;
            if !surface.plans[p as usize].queued {
                surface.enqueue(p, &mut queue);
            }
        }
        if surface.live <= wanted {
            steps.push(surface.step());
            wanted = next(surface.live);
            if wanted < FEWEST {
                break;
            }
        }
    }
    steps
}

/// A surface during simplification.
struct Surface<'a> {
    parts: &'a [u16],
    /// The point of each vertex, and the points' positions.
    point: Vec<u32>,
    at: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// The remaining triangles around each point, and whether each triangle remains.
    around: Vec<SmallVec<[u32; 8]>>,
    left: Vec<bool>,
    /// The number of remaining triangles.
    live: usize,
    /// The kinds of the edges on feature lines, and the number of such edges at each
    /// point.
    lines: FxHashMap<Pair, u8>,
    lines_at: Vec<u8>,
    quadrics: Vec<Quadric>,
    merged: Vec<u32>,
    plans: Vec<Plan>,
}

/// The next collapse of a point.
#[derive(Clone, Copy, Default)]
struct Plan {
    /// The point to collapse into.
    to: u32,
    /// Whether the point is in the queue.
    queued: bool,
    /// Whether the surroundings have changed since it was queued.
    stale: bool,
}

/// The cost (bits of a non-negative number) and the point; the least cost comes first.
type Queue = BinaryHeap<Reverse<(u64, u32)>>;

/// A valid collapse.
struct Collapse {
    from: u32,
    to: u32,
    /// The vertices of the collapsing point, and those that replace them.
    vertices: SmallVec<[(u32, u32); 2]>,
}

impl<'a> Surface<'a> {
    fn new(fine: &Fine<'a>) -> Surface<'a> {
        let point = weld(fine.positions);
        let count = fine.positions.len();
        let whole = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| point[v as usize]);
            a != b && b != c && c != a
        };
        let left: Vec<bool> = fine.triangles.iter().map(whole).collect();
        let mut surface = Surface {
            parts: fine.parts,
            at: fine.positions.iter().map(|p| p.as_dvec3()).collect(),
            triangles: fine.triangles.to_vec(),
            around: vec![SmallVec::new(); count],
            live: left.iter().filter(|left| **left).count(),
            left,
            lines: FxHashMap::default(),
            lines_at: vec![0; count],
            quadrics: vec![Quadric::default(); count],
            merged: (0..count as u32).collect(),
            plans: vec![Plan::default(); count],
            point,
        };
        for f in 0..surface.triangles.len() {
            if surface.left[f] {
                let points = surface.points(f as u32);
                let plane = normal(points.map(|p| surface.at[p as usize])).try_normalize();
                for p in points {
                    surface.around[p as usize].push(f as u32);
                    if let Some(normal) = plane {
                        surface.quadrics[p as usize] +=
                            Quadric::plane(normal, surface.at[p as usize]);
                    }
                }
            }
        }
        surface.find_lines(fine);
        surface
    }

    fn find_lines(&mut self, fine: &Fine) {
        let is_crease: FxHashSet<Pair> = fine
            .creases
            .iter()
            .map(|e| pair(self.point[e[0] as usize], self.point[e[1] as usize]))
            .collect();
        let faces: Vec<u32> =
            (0..self.triangles.len() as u32).filter(|f| self.left[*f as usize]).collect();
        let welded: Vec<[u32; 3]> = faces.iter().map(|f| self.points(*f)).collect();
        let mut seen: FxHashSet<Pair> = FxHashSet::default();
        for (f, c, g, _) in pair_edges(&welded, |_, _| false) {
            let (a, b) = (welded[f][c], welded[f][(c + 1) % 3]);
            let key = pair(a, b);
            let mut kind = if is_crease.contains(&key) { CREASE } else { 0 };
            if g == NO_FACE {
                kind |= BOUNDARY;
            } else {
                let (f, g) = (faces[f], faces[g as usize]);
                if self.parts.get(f as usize) != self.parts.get(g as usize) {
                    kind |= BORDER;
                }
                if [a, b].iter().any(|p| self.corner(f, *p) != self.corner(g, *p)) {
                    kind |= SEAM;
                }
            }
            if kind & (CREASE | BOUNDARY) != 0 {
                self.keep_line(a, b, faces[f]);
            }
            // Points where more than two faces meet at an edge are fixed.
            let odd = !seen.insert(key);
            for p in [a, b] {
                let many = if odd { u8::MAX } else { u8::from(kind != 0) };
                self.lines_at[p as usize] = self.lines_at[p as usize].saturating_add(many);
            }
            if kind != 0 {
                self.lines.insert(key, kind);
            }
        }
    }

    /// Adds to both ends of an edge the plane through it perpendicular to an adjacent
    /// face, so that collapses do not move the line sideways.
    fn keep_line(&mut self, a: u32, b: u32, face: u32) {
        let [p, q] = [a, b].map(|p| self.at[p as usize]);
        let across = (q - p).cross(normal(self.points(face).map(|p| self.at[p as usize])));
        if let Some(side) = across.try_normalize() {
            let plane = Quadric::plane(side, p);
            self.quadrics[a as usize] += plane;
            self.quadrics[b as usize] += plane;
        }
    }

    fn points(&self, face: u32) -> [u32; 3] {
        self.triangles[face as usize].map(|v| self.point[v as usize])
    }

    /// Returns the vertex that a face has at a point.
    fn corner(&self, face: u32, point: u32) -> Option<u32> {
        self.triangles[face as usize].into_iter().find(|v| self.point[*v as usize] == point)
    }

    /// Returns the points that share an edge with a point, each once, in increasing
    /// order.
    fn neighbours(&self, point: u32) -> SmallVec<[u32; 16]> {
        let faces = self.around[point as usize].iter();
        let mut all: SmallVec<[u32; 16]> =
            faces.flat_map(|f| self.points(*f)).filter(|p| *p != point).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Queues a point with its cheapest valid collapse, if there is one.
    fn enqueue(&mut self, from: u32, queue: &mut Queue) {
        let lines = self.lines_at[from as usize];
        if lines != 0 && lines != 2 {
            return;
        }
        let (here, ours) = (self.at[from as usize], self.neighbours(from));
        let cost = |to: u32| {
            let there = self.at[to as usize];
            let sum = self.quadrics[from as usize] + self.quadrics[to as usize];
            (sum.at(there) + BY_LENGTH * here.distance_squared(there)).to_bits()
        };
        let ways =
            ours.iter().filter(|to| lines == 0 || self.lines.contains_key(&pair(from, **to)));
        let mut ways: SmallVec<[(u64, u32); 16]> = ways.map(|to| (cost(*to), *to)).collect();
        ways.sort_unstable();
        if let Some((cost, to)) =
            ways.into_iter().find(|(_, to)| self.collapse(from, *to, &ours).is_some())
        {
            self.plans[from as usize] = Plan { to, queued: true, stale: false };
            queue.push(Reverse((cost, from)));
        }
    }

    /// Returns the collapse of a point into one of its neighbours, if it is valid.
    fn collapse(&self, from: u32, to: u32, ours: &[u32]) -> Option<Collapse> {
        let around = &self.around[from as usize];
        let kind = |p: u32| self.lines.get(&pair(from, p)).copied().unwrap_or(0);
        let mut vertices: SmallVec<[(u32, u32); 2]> = SmallVec::new();
        let mut apexes: SmallVec<[u32; 2]> = SmallVec::new();
        for f in around {
            let points = self.points(*f);
            if !points.contains(&to) {
                continue;
            }
            let change = (self.corner(*f, from)?, self.corner(*f, to)?);
            match vertices.iter().find(|(old, _)| *old == change.0) {
                // One vertex cannot be replaced by two.
                Some(before) if *before != change => return None,
                Some(_) => {}
                None => vertices.push(change),
            }
            apexes.extend(points.into_iter().find(|p| *p != from && *p != to));
        }
        // The link condition: the only common neighbours are the apexes of the removed
        // faces.
        let theirs = self.neighbours(to);
        let common = ours.iter().filter(|p| theirs.binary_search(p).is_ok()).count();
        let faces = if kind(to) & BOUNDARY != 0 { 1 } else { 2 };
        if apexes.len() != faces
            || common != faces
            || apexes.iter().any(|p| self.around[*p as usize].len() < 2)
        {
            return None;
        }
        if self.lines_at[from as usize] != 0 {
            // Only along a line of one kind, and not onto another line.
            let other = ours.iter().copied().find(|p| *p != to && kind(*p) != 0)?;
            if kind(to) == 0 || kind(other) != kind(to) || self.lines.contains_key(&pair(other, to))
            {
                return None;
            }
        }
        let goal = self.at[to as usize];
        for f in around {
            let points = self.points(*f);
            if points.contains(&to) {
                continue;
            }
            let corner = self.corner(*f, from)?;
            let doubled = points.iter().filter(|p| apexes.contains(p)).count() == 2;
            if doubled || !vertices.iter().any(|(old, _)| *old == corner) {
                return None;
            }
            let before = points.map(|p| self.at[p as usize]);
            let after = points.map(|p| if p == from { goal } else { self.at[p as usize] });
            let (a, b) = (normal(before), normal(after));
            let (dot, least) = (
                a.dot(b),
                LEAST_TURN_COS * LEAST_TURN_COS * a.length_squared() * b.length_squared(),
            );
            // Written so that NaN is rejected.
            if !(dot > 0.0 && dot * dot >= least) || (is_sliver(after) && !is_sliver(before)) {
                return None;
            }
        }
        Some(Collapse { from, to, vertices })
    }

    fn apply(&mut self, Collapse { from, to, vertices }: &Collapse) {
        for (old, new) in vertices {
            self.merged[*old as usize] = *new;
        }
        for f in std::mem::take(&mut self.around[*from as usize]) {
            let points = self.points(f);
            if points.contains(to) {
                self.left[f as usize] = false;
                self.live -= 1;
                for p in points {
                    self.around[p as usize].retain(|other| *other != f);
                }
                continue;
            }
            for v in &mut self.triangles[f as usize] {
                if let Some((_, new)) = vertices.iter().find(|(old, _)| old == v) {
                    *v = *new;
                }
            }
            self.around[*to as usize].push(f);
        }
        self.quadrics[*to as usize] = self.quadrics[*to as usize] + self.quadrics[*from as usize];
        if self.lines_at[*from as usize] == 2 {
            self.shorten_line(*from, *to);
        }
        self.lines_at[*from as usize] = u8::MAX;
    }

    /// Updates a line after one of its points collapsed: the edge behind it now ends at
    /// `to`.
    fn shorten_line(&mut self, from: u32, to: u32) {
        self.lines.remove(&pair(from, to));
        let near: SmallVec<[u32; 16]> = self.neighbours(to);
        // The neighbours of the removed point are now those of `to`.
        if let Some((other, kind)) =
            near.iter().find_map(|p| self.lines.remove(&pair(from, *p)).map(|kind| (*p, kind)))
        {
            self.lines.insert(pair(other, to), kind);
        }
    }

    fn step(&mut self) -> Coarsened {
        // Follow chains of merges to the vertex that remains.
        for v in 0..self.merged.len() {
            let mut end = self.merged[v];
            while self.merged[end as usize] != end {
                end = self.merged[end as usize];
            }
            self.merged[v] = end;
        }
        let kept = || (0..self.triangles.len()).filter(|f| self.left[*f]);
        Coarsened {
            triangles: kept().map(|f| self.triangles[f]).collect(),
            parts: kept().map(|f| self.parts.get(f).copied().unwrap_or(0)).collect(),
            creases: self
                .lines
                .iter()
                .filter(|(_, kind)| **kind & CREASE != 0)
                .map(|(key, _)| *key)
                .collect(),
            merged: self.merged.clone(),
        }
    }
}

/// The normal of a triangle, with a length of twice its area.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Whether a triangle's quality is too low: the ratio of its area to that of an
/// equilateral triangle with the same sum of squared edges.
fn is_sliver([a, b, c]: [DVec3; 3]) -> bool {
    let around =
        LEAST_QUALITY * (a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a));
    12.0 * normal([a, b, c]).length_squared() < around * around
}
