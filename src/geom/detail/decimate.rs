//! Fewer and fewer triangles through some of a mesh's own vertices: half-edge collapses
//! in the order of quadric errors (Garland and Heckbert 1997, *Surface simplification
//! using quadric error metrics*).
//!
//! Points that lie on a line (a crease, a boundary, where parts meet, a seam between
//! normals) move along that line alone, ends and crossings of lines not at all. No face
//! turns over, and by the link condition no collapse changes what kind of surface it is:
//! what was closed stays closed. Invariant: the result depends on the mesh alone, ties go
//! to lower numbers.

use super::quadric::Quadric;
use crate::geom::NO_FACE;
use crate::geom::edges::{pair_edges, weld};
use glam::{DVec3, Vec3};
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No level has fewer triangles than about this.
const FEWEST: usize = 100;
/// Above this many triangles levels halve them, below they leave seven in ten.
const MANY: usize = 10_000;
/// What an edge's squared length adds to the squared distances: among equals the shortest
/// goes first.
const BY_LENGTH: f64 = 1e-3;
/// A face turns by at most 60 degrees in one step: the cosine.
const LEAST_TURN_COS: f64 = 0.5;
/// The least quality that a face may come to: 1 for an equilateral one, 0 for one without
/// area.
const LEAST_QUALITY: f64 = 0.08;

/// Edges that show or mean something, in bits. One can be several.
const CREASE: u8 = 1;
const BOUNDARY: u8 = 2;
const BORDER: u8 = 4;
const SEAM: u8 = 8;

/// Two points, the lower first.
type Pair = (u32, u32);

fn pair(a: u32, b: u32) -> Pair {
    (a.min(b), a.max(b))
}

/// What is to be made coarser.
pub(super) struct Fine<'a> {
    pub positions: &'a [Vec3],
    pub triangles: &'a [[u32; 3]],
    /// The part of each triangle.
    pub parts: &'a [u16],
    /// The ends of creases.
    pub creases: &'a [[u32; 2]],
}

/// A coarser surface, by the vertices of the fine one.
pub(super) struct Coarsened {
    pub triangles: Vec<[u32; 3]>,
    /// The part of each triangle.
    pub parts: Vec<u16>,
    /// The ends of creases, as points: see [`weld`].
    pub creases: FxHashSet<Pair>,
    /// Where each vertex went: itself, if it is still there.
    pub merged: Vec<u32>,
}

/// Ever coarser surfaces, down to some hundred triangles.
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
        // What lies around may have changed meanwhile; costs mostly rise, so few go in
        // too late.
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

/// A surface on its way.
struct Surface<'a> {
    parts: &'a [u16],
    /// The point of each vertex, and where points are.
    point: Vec<u32>,
    at: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// The triangles that are left around each point, and whether each is left.
    around: Vec<SmallVec<[u32; 8]>>,
    left: Vec<bool>,
    /// How many are.
    live: usize,
    /// What the edges that are lines are, and how many each point has.
    lines: FxHashMap<Pair, u8>,
    lines_at: Vec<u8>,
    quadrics: Vec<Quadric>,
    merged: Vec<u32>,
    plans: Vec<Plan>,
}

/// What a point would do next.
#[derive(Clone, Copy, Default)]
struct Plan {
    /// Where it would go.
    to: u32,
    /// Whether it waits in the queue.
    queued: bool,
    /// Whether its surroundings have changed since.
    stale: bool,
}

/// Cost (bits of a number that is not negative) and point; the least first.
type Queue = BinaryHeap<Reverse<(u64, u32)>>;

/// A collapse that may be done.
struct Collapse {
    from: u32,
    to: u32,
    /// What becomes of the vertices of the point.
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
            // Where more than two faces meet, nothing moves.
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

    /// A plane through an edge at right angles to a face beside it keeps collapses from
    /// moving the line sideways.
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

    /// The vertex that a face has at a point.
    fn corner(&self, face: u32, point: u32) -> Option<u32> {
        self.triangles[face as usize].into_iter().find(|v| self.point[*v as usize] == point)
    }

    /// The points that share an edge with a point, each once, in rising order.
    fn neighbours(&self, point: u32) -> SmallVec<[u32; 16]> {
        let faces = self.around[point as usize].iter();
        let mut all: SmallVec<[u32; 16]> =
            faces.flat_map(|f| self.points(*f)).filter(|p| *p != point).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Puts a point into the queue with the best collapse that it may do, if there is
    /// one.
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

    /// The collapse of a point into one of its neighbours, if it may be done.
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
                // One vertex cannot become two.
                Some(before) if *before != change => return None,
                Some(_) => {}
                None => vertices.push(change),
            }
            apexes.extend(points.into_iter().find(|p| *p != from && *p != to));
        }
        // The link condition: neighbours in common are those of the faces that go.
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
            // Along a line of one kind, and not onto another line.
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
            // Written so that NaN is refused.
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

    /// A line's point is gone: the edge behind it now ends where it went.
    fn shorten_line(&mut self, from: u32, to: u32) {
        self.lines.remove(&pair(from, to));
        let near: SmallVec<[u32; 16]> = self.neighbours(to);
        // Neighbours of the point that went are now those of the other.
        if let Some((other, kind)) =
            near.iter().find_map(|p| self.lines.remove(&pair(from, *p)).map(|kind| (*p, kind)))
        {
            self.lines.insert(pair(other, to), kind);
        }
    }

    fn step(&mut self) -> Coarsened {
        // A vertex that went to one that went on goes to the last of them.
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

/// At right angles to a triangle, as long as twice its area.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Whether a triangle's quality, its area to that of an equilateral one with the same
/// squares of edges, is too low.
fn is_sliver([a, b, c]: [DVec3; 3]) -> bool {
    let around =
        LEAST_QUALITY * (a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a));
    12.0 * normal([a, b, c]).length_squared() < around * around
}
