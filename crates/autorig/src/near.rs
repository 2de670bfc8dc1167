//! Distances from points to a surface, and an inside test.

use glam::DVec3;
use pcadlang_scene::geom::Bounds;

/// The triangles of one part.
pub(super) struct Surface {
    /// The corners of each triangle.
    pub faces: Vec<[DVec3; 3]>,
    /// The bounding box of the triangles.
    pub bounds: Bounds,
}

impl Surface {
    /// Returns the distance to the nearest point of the surface, and that point. For a
    /// point inside they are 0 and the point itself.
    pub fn nearest(&self, p: DVec3) -> (f64, DVec3) {
        if self.to_box(p) == 0.0 && self.winding(p) > 0.5 {
            return (0.0, p);
        }
        let start = (f64::INFINITY, p);
        let (square, at) = self.faces.iter().fold(start, |best, t| {
            let at = closest(p, t);
            let square = (at - p).length_squared();
            if square < best.0 { (square, at) } else { best }
        });
        (square.sqrt(), at)
    }

    /// Returns the distance to the bounding box, 0 within it: a lower bound on `nearest`.
    pub fn to_box(&self, p: DVec3) -> f64 {
        (self.bounds.min - p).max(p - self.bounds.max).max(DVec3::ZERO).length()
    }

    /// Returns the absolute generalized winding number of the surface around a point
    /// (Jacobson et al. 2013), with triangles' solid angles after van Oosterom and
    /// Strackee (1983).
    fn winding(&self, p: DVec3) -> f64 {
        let angle = |t: &[DVec3; 3]| {
            let [a, b, c] = t.map(|v| v - p);
            let (x, y, z) = (a.length(), b.length(), c.length());
            let over = a.dot(b.cross(c));
            let under = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
            2.0 * libm::atan2(over, under)
        };
        (self.faces.iter().map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)).abs()
    }
}

/// Returns the point of a triangle nearest to `p` (Ericson 2005, "Real-Time Collision
/// Detection", section 5.1.5).
fn closest(p: DVec3, [a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (*b - *a, *c - *a, p - *a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = p - *b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return *a + ab * (d1 / (d1 - d3));
    }
    let cp = p - *c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return *a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return *b + (*c - *b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let whole = va + vb + vc;
    *a + ab * (vb / whole) + ac * (vc / whole)
}

/// Returns the distance from a point to a segment.
pub(super) fn to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let square = along.length_squared();
    let t = if square > 0.0 { ((p - a).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    (a + along * t - p).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcadlang_scene::geom::cuboid;

    #[test]
    fn distances_from_a_cube() {
        let m = cuboid(DVec3::splat(2.0)).unwrap();
        let at = |v: &u32| m.positions[*v as usize].as_dvec3();
        let faces =
            m.topology.triangles.iter().map(|t| [at(&t[0]), at(&t[1]), at(&t[2])]).collect();
        let s = Surface { faces, bounds: m.bounds().unwrap() };
        let cases = [
            (DVec3::new(0.3, 0.2, -0.9), 0.0),
            (DVec3::new(3.0, 0.5, 0.5), 2.0),
            (DVec3::new(0.1, -4.0, 0.2), 3.0),
            (DVec3::new(2.0, 2.0, 0.0), 2f64.sqrt()),
            (DVec3::new(-2.0, 2.0, 2.0), 3f64.sqrt()),
        ];
        for (p, d) in cases {
            let (found, at) = s.nearest(p);
            assert!(
                (found - d).abs() < 1e-6 && ((at - p).length() - d).abs() < 1e-6,
                "{p} {found}"
            );
            assert!(s.to_box(p) <= d + 1e-6);
        }
        assert!((s.winding(DVec3::new(0.2, 0.1, 0.7)) - 1.0).abs() < 1e-9);
        assert!(s.winding(DVec3::new(1.2, 0.1, 0.7)) < 1e-9);
        assert!(
            (to_segment(DVec3::new(3.0, 4.0, 0.0), DVec3::ZERO, DVec3::Y) - 18f64.sqrt()).abs()
                < 1e-12
        );
        assert_eq!(to_segment(DVec3::Y, DVec3::ZERO, DVec3::ZERO), 1.0);
    }
}
