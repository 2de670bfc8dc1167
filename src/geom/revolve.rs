//! Surfaces of revolution round the y axis, from a path in the half plane (r, y).
//!
//! The path runs with the outside on its right: up along an outer wall, inwards over a
//! top. It is cut into strips that are smooth in themselves; between strips the surface
//! has a crease unless a strip says otherwise. Topology depends on the numbers of points
//! only and is shared between surfaces of the same numbers: positions and normals are all
//! that a new profile costs. Invariant: the mesh is the same whether its topology was
//! found in the cache or not.

use super::edges::pair_edges;
use super::real::Real;
use super::{Edge, Mesh, Topology};
use glam::{DVec3, Vec3};
use std::cell::RefCell;
use std::sync::Arc;

/// A smooth piece of the path.
#[derive(Clone, Debug, Default)]
pub(super) struct Strip<T = f64> {
    /// Points (r, y); consecutive ones differ. Radius 0 is a pole and allowed at the very
    /// ends of the strip only.
    pub points: Vec<(T, T)>,
    /// The part of each segment.
    pub parts: Vec<u16>,
    /// Whether the seam to the strip before is no crease although its normals differ.
    pub blend: bool,
}

/// What the topology of a surface depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Signature {
    sides: u32,
    closed: bool,
    part_count: u16,
    /// Whether the path never turns down: it cannot cross itself then.
    rising: bool,
    /// For each strip: points, poles and blend; then the parts of its segments.
    strips: Vec<u32>,
}

/// Sweeps strips, each beginning where the one before ends; `closed` joins the last to
/// the first.
pub(super) fn revolve(strips: &[Strip], sides: u32, closed: bool, part_count: u16) -> Mesh {
    let Shared { topology, circle } = shared(strips, sides, closed, part_count);
    let n = sides as usize;
    let count: usize = strips.iter().map(|s| s.points.len() * n).sum();
    let (mut positions, mut normals) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for s in strips {
        let last = s.points.len() - 1;
        for (i, (r, y)) in s.points.iter().enumerate() {
            let (a, b) = (s.points[i.saturating_sub(1)], s.points[(i + 1).min(last)]);
            // The outside is on the right of the path's direction (dr, dy).
            let (nr, ny) = (b.1 - a.1, -(b.0 - a.0));
            let length = libm::hypot(nr, ny);
            let (nr, ny) = if length > 0.0 { (nr / length, ny / length) } else { (1.0, 0.0) };
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
    Mesh { positions, normals, topology }
}

/// The topology of [`revolve`].
pub(super) fn topology_of(
    strips: &[Strip],
    sides: u32,
    closed: bool,
    part_count: u16,
) -> Arc<Topology> {
    shared(strips, sides, closed, part_count).topology
}

fn shared(strips: &[Strip], sides: u32, closed: bool, part_count: u16) -> Shared {
    let rising = strips.iter().flat_map(|s| &s.points).is_sorted_by(|a, b| a.1 <= b.1);
    cached(signature(strips, sides, closed, part_count, rising), || {
        let mut topology = topology(strips, sides, closed, part_count);
        topology.encloses = rising && !topology.edges.open();
        Shared { topology: Arc::new(topology), circle: circle(sides) }
    })
}

/// From the derivatives of something by the vertices of [`revolve`] to those by each
/// point (r, y) of the path in turn.
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

/// What surfaces of one signature have in common.
#[derive(Clone)]
struct Shared {
    topology: Arc<Topology>,
    circle: Arc<[(f64, f64)]>,
}

/// The number of topologies kept, those used last.
const KEPT: usize = 16;
/// Larger ones, in triangles, are not kept.
const KEPT_TRIANGLES: usize = 200_000;
thread_local! {
    static CACHE: RefCell<Vec<(Signature, Shared)>> = const { RefCell::new(Vec::new()) };
}

/// What was made for this signature before on this thread, or is made now.
fn cached(signature: Signature, make: impl FnOnce() -> Shared) -> Shared {
    let found = CACHE.with_borrow_mut(|cache| {
        let i = cache.iter().position(|(s, _)| *s == signature)?;
        // The one used last stands last.
        cache[i..].rotate_left(1);
        cache.last().map(|(_, shared)| shared.clone())
    });
    found.unwrap_or_else(|| {
        let made = make();
        if made.topology.triangles.len() <= KEPT_TRIANGLES {
            CACHE.with_borrow_mut(|cache| {
                if cache.len() == KEPT {
                    cache.remove(0);
                }
                cache.push((signature, made.clone()));
            });
        }
        made
    })
}

fn topology(strips: &[Strip], sides: u32, closed: bool, part_count: u16) -> Topology {
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut parts = Vec::new();
    // For each vertex the point of the surface it stands for, and the strip of each face.
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
        // The first ring lies on the last one of the strip before.
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
        // The last ring is the first one: its points, numbered one after another, take
        // their names wherever used.
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
