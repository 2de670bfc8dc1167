//! Closed bodies that are inside out: found by their volume, and turned over.
//!
//! A body is a set of faces connected by edges, after equal positions are merged. It is
//! closed if each edge is used equally often in both directions; then its signed volume
//! (the sum of a . (b x c) / 6 over its faces) does not depend on the origin, and is
//! negative if the faces look inwards. A part that is closed by itself is apart from others
//! whose edges it touches. A body that no other encloses decides for all in
//! it: the inner wall of a hollow vase has a negative volume, and is right.

use super::{Bounds, weld};
use glam::{DVec3, Vec3};

/// The effort to find what encloses what, in pairs of a point and a face.
const MOST_WORK: usize = 50_000_000;
/// The share of the surface's area to the power of 3/2 below which a volume is none.
const FLAT: f64 = 1e-9;

/// Turns over the closed bodies that are inside out. `triangles` are indices into
/// `positions`, `parts` the number of each triangle's part. Returns what users should know of it,
/// if any were turned.
pub fn face_outward(
    positions: &[Vec3],
    triangles: &mut [[u32; 3]],
    parts: &[u16],
) -> Option<String> {
    let corners = |face: &u32| triangles[*face as usize].map(|v| positions[v as usize].as_dvec3());
    let mut bodies: Vec<Body> = closed(&weld(positions), triangles, parts)
        .into_iter()
        .filter_map(|faces| Body::new(faces, corners))
        .collect();
    if bodies.iter().all(|b| b.volume > 0.0) {
        return None;
    }
    // What encloses a body comes before it.
    let extent = |b: &Body| b.bounds.size().element_product();
    bodies.sort_by(|a, b| extent(b).total_cmp(&extent(a)));
    let (mut outer, mut work): (Vec<&Body>, usize) = (Vec::new(), 0);
    let mut wrong: Vec<&Body> = Vec::new();
    for body in &bodies {
        let around = outer.iter().find(|o| {
            work += 1;
            o.may_enclose(body)
                && body.extremes.iter().all(|p| {
                    work += o.faces.len();
                    work < MOST_WORK && winds_around(o.faces.iter().map(corners), *p)
                })
        });
        let outermost = around.copied().unwrap_or(body);
        if work >= MOST_WORK {
            break;
        }
        if outermost.volume < 0.0 {
            wrong.push(body);
        }
        if around.is_none() {
            outer.push(body);
        }
    }
    let count = wrong.len();
    let turned: Vec<u32> = wrong.into_iter().flat_map(|b| &b.faces).copied().collect();
    for f in &turned {
        triangles[*f as usize].swap(1, 2);
    }
    let bodies = match (bodies.len(), count) {
        (_, 0) => return None,
        (1, _) => "the closed body is".to_string(),
        (all, count) if all == count => format!("all {all} closed bodies are"),
        (all, 1) => format!("1 of {all} closed bodies is"),
        (all, count) => format!("{count} of {all} closed bodies are"),
    };
    Some(format!("{bodies} inside out in the file (of negative volume); the faces are turned over"))
}

/// A closed body.
struct Body {
    faces: Vec<u32>,
    /// The signed volume.
    volume: f64,
    bounds: Bounds,
    /// The corners that are farthest out along each axis, both ways.
    extremes: [DVec3; 6],
}

impl Body {
    /// `None` without a volume: a sheet with two sides.
    fn new(faces: Vec<u32>, of: impl Fn(&u32) -> [DVec3; 3]) -> Option<Body> {
        let corners = || faces.iter().flat_map(&of);
        let (origin, bounds) = (corners().next()?, Bounds::around(corners())?);
        let (mut volume, mut area) = (0.0, 0.0);
        for [a, b, c] in faces.iter().map(|f| of(f).map(|p| p - origin)) {
            volume += a.dot(b.cross(c)) / 6.0;
            area += (b - a).cross(c - a).length() / 2.0;
        }
        let mut extremes = [origin; 6];
        for p in corners() {
            for k in 0..3 {
                if p[k] < extremes[k][k] {
                    extremes[k] = p;
                }
                if p[k] > extremes[k + 3][k] {
                    extremes[k + 3] = p;
                }
            }
        }
        let solid = volume.abs() > FLAT * area * area.sqrt();
        solid.then_some(Body { faces, volume, bounds, extremes })
    }

    fn may_enclose(&self, other: &Body) -> bool {
        let (a, b) = (&self.bounds, &other.bounds);
        a.min.cmple(b.min).all() && a.max.cmpge(b.max).all()
    }
}

/// Returns whether a closed surface goes around a point: the sum of its solid angles (Van
/// Oosterom and Strackee 1983) is then 4 pi, or -4 pi.
fn winds_around(surface: impl Iterator<Item = [DVec3; 3]>, point: DVec3) -> bool {
    let half_angle = |t: [DVec3; 3]| {
        let [a, b, c] = t.map(|p| p - point);
        let (x, y, z) = (a.length(), b.length(), c.length());
        let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
        libm::atan2(a.dot(b.cross(c)), below)
    };
    surface.map(half_angle).sum::<f64>().abs() > std::f64::consts::PI
}

/// Returns the faces of each closed body, in the order of their first faces.
fn closed(weld: &[u32], triangles: &[[u32; 3]], parts: &[u16]) -> Vec<Vec<u32>> {
    let part = |f: u32| parts.get(f as usize).copied().unwrap_or_default();
    // For each edge its ends, the part, then the face, twice, plus one if it runs from high to low.
    let mut edges = Vec::with_capacity(triangles.len() * 3);
    for (f, t) in triangles.iter().enumerate() {
        let t = t.map(|v| weld[v as usize]);
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            continue;
        }
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let f = f as u32;
            edges.push((a.min(b), a.max(b), u32::from(part(f)), 2 * f + u32::from(a > b)));
        }
    }
    edges.sort_unstable();
    type Use = (u32, u32, u32, u32);
    let same_edge = |a: &Use, b: &Use| (a.0, a.1, a.2) == (b.0, b.1, b.2);
    let balanced = |uses: &[Use]| 2 * uses.iter().filter(|e| e.3 % 2 == 1).count() == uses.len();
    // Parts that are not closed by themselves are one.
    let mut whole = vec![true; 1 << 16];
    for uses in edges.chunk_by(same_edge).filter(|uses| !balanced(uses)) {
        whole[uses[0].2 as usize] = false;
    }
    edges.iter_mut().filter(|e| !whole[e.2 as usize]).for_each(|e| e.2 = u32::MAX);
    edges.sort_unstable();
    let mut first: Vec<u32> = (0..triangles.len() as u32).collect();
    for uses in edges.chunk_by(same_edge) {
        for pair in uses.windows(2) {
            let (a, b) = (root(&mut first, pair[0].3 / 2), root(&mut first, pair[1].3 / 2));
            first[a.max(b) as usize] = a.min(b);
        }
    }
    let mut open = vec![false; triangles.len()];
    for uses in edges.chunk_by(same_edge).filter(|uses| !balanced(uses)) {
        open[root(&mut first, uses[0].3 / 2) as usize] = true;
    }
    let mut number = vec![usize::MAX; triangles.len()];
    let mut bodies: Vec<Vec<u32>> = Vec::new();
    for (f, t) in triangles.iter().enumerate() {
        let r = root(&mut first, f as u32) as usize;
        let t = t.map(|v| weld[v as usize]);
        if open[r] || t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            continue;
        }
        if number[r] == usize::MAX {
            number[r] = bodies.len();
            bodies.push(Vec::new());
        }
        bodies[number[r]].push(f as u32);
    }
    bodies
}

/// Returns the first face of the body that a face belongs to, and shortens the way there.
fn root(first: &mut [u32], mut f: u32) -> u32 {
    while first[f as usize] != f {
        first[f as usize] = first[first[f as usize] as usize];
        f = first[f as usize];
    }
    f
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::cuboid;

    /// Cubes as one mesh: the size of each, its centre's x, and whether it is inside out.
    fn cubes(all: &[(f32, f32, bool)]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (size, x, inside_out) in all {
            let mesh = cuboid(DVec3::splat(f64::from(*size))).unwrap();
            let first = positions.len() as u32;
            positions.extend(mesh.positions.iter().map(|p| *p + Vec3::X * *x));
            triangles.extend(mesh.topology.triangles.iter().map(|t| {
                let [a, b, c] = t.map(|v| v + first);
                if *inside_out { [a, c, b] } else { [a, b, c] }
            }));
        }
        (positions, triangles)
    }

    fn volume(positions: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
        let of = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        triangles.iter().map(of).sum()
    }

    /// Turns what must be; returns the volume then, and the remark.
    fn turned(all: &[(f32, f32, bool)]) -> (f64, String) {
        let (positions, mut triangles) = cubes(all);
        let remark = face_outward(&positions, &mut triangles, &[]).unwrap_or_default();
        ((volume(&positions, &triangles) * 1000.0).round() / 1000.0, remark)
    }

    #[test]
    fn what_is_inside_out_is_turned_over() {
        assert_eq!(turned(&[(1.0, 0.0, false)]), (1.0, String::new()));
        let one = "the closed body is inside out in the file (of negative volume); the faces are \
                   turned over";
        assert_eq!(turned(&[(2.0, 5.0, true)]), (8.0, one.into()));
        let (v, remark) = turned(&[(1.0, 0.0, false), (1.0, 3.0, true), (2.0, 7.0, false)]);
        assert!(v == 10.0 && remark.starts_with("1 of 3 closed bodies is inside out"), "{remark}");
        let (v, remark) = turned(&[(1.0, 0.0, true), (1.0, 3.0, true)]);
        assert!(v == 2.0 && remark.starts_with("all 2 closed bodies are"), "{remark}");
    }

    #[test]
    fn walls_of_hollows_look_inwards() {
        assert_eq!(turned(&[(2.0, 0.0, false), (1.0, 0.0, true)]), (7.0, String::new()));
        // Mirrored as a whole, and with something solid in the hollow.
        assert_eq!(turned(&[(1.0, 0.0, false), (2.0, 0.0, true)]).0, 7.0);
        let nested = [(3.0, 0.0, true), (2.0, 0.0, false), (1.0, 0.0, true)];
        assert_eq!(turned(&nested).0, 27.0 - 8.0 + 1.0);
        // Two solid bodies in one another, both mirrored.
        assert_eq!(turned(&[(2.0, 0.0, true), (1.0, 0.0, true)]).0, 9.0);
        // One that sticks out of the other is not in it.
        assert_eq!(turned(&[(2.0, 0.0, false), (1.0, 1.0, true)]).0, 9.0);
    }

    /// Two parts that share the edges of a face; halves of one body that are not closed alone.
    #[test]
    fn a_part_that_is_closed_stands_alone() {
        let (positions, mut triangles) = cubes(&[(1.0, 0.0, false), (1.0, 1.0, true)]);
        let half = triangles.len() / 2;
        let parts: Vec<u16> = (0..2 * half).map(|f| (f / half) as u16).collect();
        let remark = face_outward(&positions, &mut triangles, &parts).unwrap();
        assert!(remark.starts_with("1 of 2 closed bodies is"), "{remark}");
        assert!((volume(&positions, &triangles) - 2.0).abs() < 1e-6);
        let (positions, mut triangles) = cubes(&[(1.0, 0.0, true)]);
        let parts: Vec<u16> = (0..triangles.len()).map(|f| (f % 3) as u16).collect();
        assert!(face_outward(&positions, &mut triangles, &parts).is_some());
        assert!((volume(&positions, &triangles) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_not_closed_stays_as_it_is() {
        let (positions, mut triangles) = cubes(&[(1.0, 0.0, true)]);
        triangles.pop();
        let before = triangles.clone();
        assert_eq!(face_outward(&positions, &mut triangles, &[]), None);
        assert_eq!(triangles, before);
        let mut sheet = vec![[0, 1, 2], [0, 2, 1], [0, 0, 1]];
        assert_eq!(face_outward(&positions, &mut sheet, &[]), None);
        assert_eq!(face_outward(&[], &mut [], &[]), None);
    }
}
