//! Surfaces of revolution around the y axis, from a path in the half plane (r, y).
//!
//! The outside is on the right of the path: it goes up along an outer wall, and inwards
//! over a top. It is cut into smooth strips; between strips the surface has a crease
//! unless a strip says otherwise. Topology depends only on discrete data, such as the
//! numbers of points, and is shared between surfaces that agree in them, so a new profile
//! costs only positions and normals. Invariant: the mesh does not depend on whether its
//! topology was in the cache.

use super::edges::pair_edges;
use super::real::Real;
use super::{Edge, Mesh, Topology};
use glam::{DVec3, Vec3};
use std::sync::{Arc, Mutex, PoisonError};

/// A smooth piece of the path.
#[derive(Clone, Debug, Default)]
pub(super) struct Strip<T = f64> {
    /// Points (r, y); consecutive ones differ. Radius 0 is a pole, and allowed only at
    /// the ends of the strip.
    pub points: Vec<(T, T)>,
    /// The part of each segment.
    pub parts: Vec<u16>,
    /// True if the seam to the previous strip is smooth although its normals differ.
    pub blend: bool,
}

/// The data that determine the topology of a surface.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Signature {
    sides: u32,
    closed: bool,
    part_count: u16,
    /// True if the path never goes down, and so cannot cross itself.
    rising: bool,
    /// For each strip: the number of points, flags for poles and blend, then the parts of
    /// its segments.
    strips: Vec<u32>,
}

/// Sweeps strips, each of which starts where the previous one ends; `closed` joins the
/// last to the first.
pub(super) fn revolve(strips: &[Strip], sides: u32, closed: bool, part_count: u16) -> Mesh {
    let Shared { topology, circle } = shared(strips, sides, closed, part_count);
    let n = sides as usize;
    let count: usize = strips.iter().map(|s| s.points.len() * n).sum();
    let (mut positions, mut normals) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for s in strips {
        let last = s.points.len() - 1;
        for (i, (r, y)) in s.points.iter().enumerate() {
            let (a, b) = (s.points[i.saturating_sub(1)], s.points[(i + 1).min(last)]);
            let (nr, ny) = ring_normal([a, b]);
            if *r == 0.0 {
                positions.push(Vec3::new(0.0, *y as f32, 0.0));
                normals.push(Vec3::new(0.0, if ny < 0.0 { -1.0 } else { 1.0 }, 0.0));
                continue;
            }
            for (c, s) in circle.iter() {
                positions.push(Vec3::new((r * c) as f32, *y as f32, (r * s) as f32));
                normals.push(Vec3::new((nr * c) as f32, ny as f32, (nr * s) as f32));
            }
        }
    }
    Mesh::of(positions, normals, topology)
}

/// The unit normal of a ring, away from the axis and along it, from the points before and
/// after it. The outside is on the right of the path's direction.
pub(super) fn ring_normal([a, b]: [(f64, f64); 2]) -> (f64, f64) {
    let (nr, ny) = (b.1 - a.1, -(b.0 - a.0));
    let length = libm::hypot(nr, ny);
    if length > 0.0 { (nr / length, ny / length) } else { (1.0, 0.0) }
}

fn shared(strips: &[Strip], sides: u32, closed: bool, part_count: u16) -> Shared {
    let rising = strips.iter().flat_map(|s| &s.points).is_sorted_by(|a, b| a.1 <= b.1);
    cached(signature(strips, sides, closed, part_count, rising), || {
        let mut topology = topology(strips, sides, closed, part_count);
        topology.encloses = rising && !topology.edges.open();
        Shared { topology: Arc::new(topology), circle: circle(sides) }
    })
}

/// Pulls derivatives with respect to the vertices of [`revolve`]'s mesh back to each
/// point (r, y) of the path, in order.
pub(super) fn vjp_rings<T: Real>(
    strips: &[Strip<T>],
    sides: u32,
    by_vertex: &[DVec3],
) -> Vec<(f64, f64)> {
    let circle = circle(sides);
    let mut rest = by_vertex;
    let mut next = || match rest.split_first() {
        Some((g, after)) => {
            rest = after;
            *g
        }
        None => DVec3::ZERO,
    };
    let one = |p: &(T, T)| match p.0.value() {
        0.0 => (0.0, next().y),
        _ => circle.iter().fold((0.0, 0.0), |(r, y), (c, s)| {
            let g = next();
            (r + g.x * c + g.z * s, y + g.y)
        }),
    };
    strips.iter().flat_map(|s| &s.points).map(one).collect()
}

/// Cosine and sine of each meridian's angle from x towards z.
fn circle(sides: u32) -> Arc<[(f64, f64)]> {
    let angle = |k: u32| core::f64::consts::TAU * f64::from(k) / f64::from(sides);
    (0..sides).map(|k| (libm::cos(angle(k)), libm::sin(angle(k)))).collect()
}

fn signature(
    strips: &[Strip],
    sides: u32,
    closed: bool,
    part_count: u16,
    rising: bool,
) -> Signature {
    let mut numbers = Vec::with_capacity(strips.iter().map(|s| s.parts.len() + 2).sum());
    for s in strips {
        let pole = |p: Option<&(f64, f64)>| u32::from(p.is_some_and(|p| p.0 == 0.0));
        let flags = pole(s.points.first()) | pole(s.points.last()) << 1 | u32::from(s.blend) << 2;
        numbers.extend([s.points.len() as u32, flags]);
        numbers.extend(s.parts.iter().map(|p| u32::from(*p)));
    }
    Signature { sides, closed, part_count, rising, strips: numbers }
}

/// The data that surfaces of one signature share.
#[derive(Clone)]
struct Shared {
    topology: Arc<Topology>,
    circle: Arc<[(f64, f64)]>,
}

/// The number of topologies in the cache, which keeps the most recently used.
const KEPT: usize = 16;
/// The maximum size of a cached topology, in triangles.
const KEPT_TRIANGLES: usize = 200_000;
static CACHE: Mutex<Vec<(Signature, Shared)>> = Mutex::new(Vec::new());

/// Returns the shared data of a signature, of which they are a function, from the cache
/// of all threads, or makes it.
fn cached(signature: Signature, make: impl FnOnce() -> Shared) -> Shared {
    let cache = || CACHE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut known = cache();
    if let Some(i) = known.iter().position(|(s, _)| *s == signature) {
        // The most recently used is last.
        known[i..].rotate_left(1);
        return known[known.len() - 1].1.clone();
    }
    drop(known);
    let made = make();
    if made.topology.triangles.len() <= KEPT_TRIANGLES {
        let mut known = cache();
        if known.len() == KEPT {
            known.remove(0);
        }
        known.push((signature, made.clone()));
    }
    made
}

fn topology(strips: &[Strip], sides: u32, closed: bool, part_count: u16) -> Topology {
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut parts = Vec::new();
    // The surface point of each vertex, and the strip of each face.
    let mut weld: Vec<u32> = Vec::new();
    let mut strip_of = Vec::new();
    let mut end: Option<Vec<u32>> = None;
    for (si, s) in strips.iter().enumerate() {
        let rings: Vec<(u32, u32)> = s
            .points
            .iter()
            .map(|p| {
                let first = weld.len() as u32;
                let count = if p.0 == 0.0 { 1 } else { sides };
                weld.extend(first..first + count);
                (first, count)
            })
            .collect();
        // The first ring coincides with the last one of the previous strip.
        if let (Some(end), Some((first, count))) = (&end, rings.first())
            && end.len() == *count as usize
        {
            for (k, w) in end.iter().enumerate() {
                weld[*first as usize + k] = *w;
            }
        }
        for (i, part) in s.parts.iter().enumerate() {
            let ((a0, na), (b0, nb)) = (rings[i], rings[i + 1]);
            for k in 0..sides {
                let next = (k + 1) % sides;
                let (a, b) = if na == 1 { (a0, a0) } else { (a0 + k, a0 + next) };
                let (d, c) = if nb == 1 { (b0, b0) } else { (b0 + k, b0 + next) };
                if nb != 1 {
                    triangles.push([a, d, c]);
                    parts.push(*part);
                    strip_of.push(si);
                }
                if na != 1 {
                    triangles.push([a, c, b]);
                    parts.push(*part);
                    strip_of.push(si);
                }
            }
        }
        end = rings
            .last()
            .map(|(first, count)| (*first..first + count).map(|v| weld[v as usize]).collect());
    }
    if closed && let Some(end) = end {
        // The last ring coincides with the first one: its points, which have consecutive
        // numbers, are renumbered to the first ring's.
        let from = end.first().copied().unwrap_or(0);
        let names = from..from + end.len() as u32;
        weld.iter_mut().filter(|w| names.contains(w)).for_each(|w| *w -= from);
    }
    let welded: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| weld[v as usize])).collect();
    let is_crease = |a: usize, b: usize| {
        let (before, after) = (strip_of[a].min(strip_of[b]), strip_of[a].max(strip_of[b]));
        before != after && !(after == before + 1 && strips[after].blend)
    };
    let edges = pair_edges(&welded, is_crease)
        .into_iter()
        .map(|(f, c, g, crease)| Edge {
            vertices: [triangles[f][c], triangles[f][(c + 1) % 3]],
            faces: [f as u32, g],
            crease,
        })
        .collect();
    Topology { triangles, parts, part_count, edges, ..Topology::default() }
}
