//! Polygons cut into triangles: a fan where that is right, or else the crate `earcut`
//! cuts ears in the plane of the polygon's normal (Newell's: the sum of the cross
//! products of successive corners).

use earcut::Earcut;
use glam::{DVec2, DVec3, Vec3};

/// The area of a fan's triangle below which the fan is not used, in squared extents.
const SLIVER: f64 = 1e-9;

/// The maximum number of corners of a polygon.
pub(super) const MOST_CORNERS: usize = 1000;

/// Cuts polygons; keeps its memory from one to the next.
#[derive(Default)]
pub(super) struct Cutter {
    ears: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    cut: Vec<u32>,
}

impl Cutter {
    /// Adds the triangles of a polygon with these corners, indices into `positions`. They
    /// use every corner, so that neighbours meet at edges. Polygons that cross themselves
    /// or have no area give triangles, too, with the corners in some order.
    pub(super) fn cut(&mut self, positions: &[Vec3], corners: &[u32], out: &mut Vec<[u32; 3]>) {
        let corner = |i: u32| corners[i as usize];
        if corners.len() > 3 && self.flatten(positions, corners) && !self.is_fan() {
            self.ears.earcut_slice(&self.flat, &[], &mut self.cut);
            let mut triangles: Vec<[u32; 3]> =
                self.cut.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
            for t in &mut triangles {
                if self.area(*t) < 0.0 {
                    t.swap(1, 2);
                }
            }
            if !triangles.is_empty() {
                use_all(&mut triangles, corners.len());
                out.extend(triangles.iter().map(|t| t.map(corner)));
                return;
            }
        }
        out.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
    }

    /// Projects a polygon onto its plane, at a size of about 1; false if it has no plane.
    fn flatten(&mut self, positions: &[Vec3], corners: &[u32]) -> bool {
        let at = |v: &u32| positions[*v as usize].as_dvec3();
        let origin = at(&corners[0]);
        let size = corners.iter().map(|v| (at(v) - origin).abs().max_element()).fold(0.0, f64::max);
        let points = || corners.iter().map(|v| (at(v) - origin) / size);
        let normal: DVec3 = points().zip(points().cycle().skip(1)).map(|(a, b)| a.cross(b)).sum();
        let Some(normal) = normal.try_normalize() else { return false };
        let x = normal.any_orthonormal_vector();
        let y = normal.cross(x);
        self.flat.clear();
        self.flat.extend(points().map(|p| [p.dot(x), p.dot(y)]));
        true
    }

    /// Twice the signed area of a triangle.
    fn area(&self, t: [u32; 3]) -> f64 {
        let [a, b, c] = t.map(|i| DVec2::from_array(self.flat[i as usize]));
        (b - a).perp_dot(c - a)
    }

    fn is_fan(&self) -> bool {
        (2..self.flat.len() as u32).all(|i| self.area([0, i - 1, i]) > SLIVER)
    }
}

/// Puts back corners that ear clipping left out because they are on a line with their
/// neighbours: the triangle at that side is cut once more.
fn use_all(triangles: &mut Vec<[u32; 3]>, corners: usize) {
    let mut used = vec![false; corners];
    triangles.iter().flatten().for_each(|c| used[*c as usize] = true);
    let n = corners as u32;
    let kept: Vec<u32> = (0..n).filter(|c| used[*c as usize]).collect();
    for (a, b) in kept.iter().zip(kept.iter().cycle().skip(1)) {
        let skipped = (b + n - a) % n;
        if skipped == 1 {
            continue;
        }
        let side = |t: &[u32; 3]| (0..3).find(|k| t[*k] == *a && t[(k + 1) % 3] == *b);
        let Some((i, k)) = triangles.iter().enumerate().find_map(|(i, t)| Some((i, side(t)?)))
        else {
            continue;
        };
        let apex = triangles[i][(k + 2) % 3];
        let step = |s: u32| [(a + s) % n, (a + s + 1) % n, apex];
        triangles.swap_remove(i);
        triangles.extend((0..skipped).map(step));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    /// The triangles of a polygon in the plane z = 0, turned in space.
    fn cut(flat: &[(f32, f32)]) -> (Vec<[u32; 3]>, f32, f32) {
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
        let positions: Vec<Vec3> =
            flat.iter().map(|(x, y)| turn * Vec3::new(*x, *y, 2.0)).collect();
        let corners: Vec<u32> = (0..flat.len() as u32).collect();
        let mut out = Vec::new();
        Cutter::default().cut(&positions, &corners, &mut out);
        let normal = turn * Vec3::Z;
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| positions[v as usize]);
            (b - a).cross(c - a).dot(normal) / 2.0
        };
        (
            out.clone(),
            out.iter().map(area).sum(),
            out.iter().map(area).fold(f32::INFINITY, f32::min),
        )
    }

    #[test]
    fn concave_polygons_keep_their_shape() {
        // An L of area 3, from a corner where a fan leaves it; a U of 7/9; both ways round.
        let l = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        let u: Vec<(f32, f32)> = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
            .map(|(x, y)| (x as f32 / 3.0, y as f32 / 3.0))
            .to_vec();
        for first in 0..6 {
            let turned: Vec<_> = (0..6).map(|i| l[(i + first) % 6]).collect();
            let (t, area, least) = cut(&turned);
            assert!(t.len() == 4 && (area - 3.0).abs() < 1e-5 && least > 0.0, "{first}: {area}");
        }
        let (t, area, least) = cut(&u);
        assert!(t.len() == 6 && (area - 7.0 / 9.0).abs() < 1e-5 && least > 0.0, "{area} {least}");
        let back: Vec<_> = u.into_iter().rev().collect();
        assert!((cut(&back).1 + 7.0 / 9.0).abs() < 1e-5);
    }

    #[test]
    fn corners_on_a_line_are_used() {
        let square = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 1.0), (0.5, 1.0), (0.0, 1.0)];
        for first in 0..6 {
            let turned: Vec<_> = (0..6).map(|i| square[(i + first) % 6]).collect();
            let (t, area, _) = cut(&turned);
            let used: std::collections::BTreeSet<u32> = t.iter().flatten().copied().collect();
            assert_eq!((t.len(), used.len()), (4, 6), "{first}");
            assert!((area - 1.0).abs() < 1e-5, "{first}: {area}");
        }
    }

    #[test]
    fn strange_polygons_give_triangles() {
        let bow = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)];
        let star: Vec<(f32, f32)> =
            (0..5).map(|i| (i as f32 * 0.8 * std::f32::consts::PI).sin_cos()).collect();
        let line: Vec<(f32, f32)> = (0..9).map(|i| (i as f32, 0.0)).collect();
        let point = [(1.0, 1.0); 5];
        for polygon in [&bow[..], &star, &line, &point] {
            let (t, area, _) = cut(polygon);
            assert!(!t.is_empty() && area.is_finite(), "{t:?}");
        }
    }
}
