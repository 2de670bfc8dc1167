//! The lathe: profiles swept round the y axis into an object of revolution (Kulkarni et al. 2014, section 2.1.1).

use super::revolve::{Strip, revolve};
use super::{GeomError, Mesh};

/// A profile: radii at heights, upwards. Lengths in scene units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// Heights, not decreasing.
    pub y: Vec<f64>,
    /// Radii, not negative.
    pub r: Vec<f64>,
}

/// Which ends of an object of revolution are closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caps {
    /// Neither.
    None,
    /// The lower one.
    Bottom,
    /// The upper one.
    Top,
    /// Both.
    Both,
}

/// The most points of all profiles together.
const MOST_POINTS: usize = 4096;
/// Profiles that meet within this angle go on smoothly.
const SMOOTH_COS: f64 = 0.766_044_443_118_978; // 40 degrees
/// Radii below this share of the size are drawn as if they were it: a tip, not a degenerate triangle.
const TIP: f64 = 1e-4;
/// An inner wall keeps at least this share of the outer radius.
const LEAST_BORE: f64 = 0.02;

/// Sweeps profiles, stacked in the order given, round the y axis. A step from one to the next is closed by a ring. With
/// `thickness` > 0 it is a vessel open at the top: an outer wall, a rim, an inner wall, and a floor of that thickness where
/// `caps` closes the bottom; without, `caps` says which ends get a disc.
///
/// Parts are numbered: the profiles in order from 0, then rings at steps, the bottom disc, the top disc or rim, the inner
/// wall, the floor inside.
///
/// # Errors
/// If a profile has fewer than 2 points, unequal numbers of heights and radii, numbers that are not finite, heights that
/// decrease, negative radii; if there are no profiles, more than 4096 points, fewer than 3 or more than 1024 sides; if the
/// object has no height and no width.
pub fn lathe(parts: &[Profile], sides: u32, thickness: f64, caps: Caps) -> Result<Mesh, GeomError> {
    check(parts, sides, thickness)?;
    let all = || parts.iter().flat_map(|p| p.r.iter().zip(&p.y));
    let (bottom, top) = (parts[0].y[0], parts[parts.len() - 1].y[parts[parts.len() - 1].y.len() - 1]);
    let widest = all().map(|(r, _)| *r).fold(0.0, f64::max);
    let size = widest.max(top - bottom);
    if size <= 0.0 || !size.is_finite() {
        return Err(GeomError::domain("lathe: the object has no extent"));
    }
    let n = parts.len() as u16;
    let (ring, bottom_disc, rim, inner, floor) = (n, n + 1, n + 2, n + 3, n + 4);
    let outer = outer_wall(parts, size, ring);
    let hollow = thickness > 0.0;
    let closed_bottom = matches!(caps, Caps::Bottom | Caps::Both);
    let closed_top = matches!(caps, Caps::Top | Caps::Both);
    let (first, last) = (outer[0].points[0], outer[outer.len() - 1].points[outer[outer.len() - 1].points.len() - 1]);

    let mut strips = Vec::with_capacity(outer.len() + 4);
    if closed_bottom {
        strips.push(Strip { points: vec![(0.0, first.1), first], parts: vec![bottom_disc] });
    }
    strips.extend(outer.iter().cloned());
    let mut closed = false;
    if hollow {
        let path: Vec<(f64, f64)> = outer.iter().flat_map(|s| s.points.iter().copied()).collect();
        let wall = inner_wall(&path, thickness, if closed_bottom { floor_height(&path, thickness) } else { bottom });
        let (start, end) = (wall[0], wall[wall.len() - 1]);
        strips.push(Strip { points: vec![last, start], parts: vec![rim] });
        strips.push(Strip { parts: vec![inner; wall.len() - 1], points: wall });
        if closed_bottom {
            strips.push(Strip { points: vec![end, (0.0, end.1)], parts: vec![floor] });
        } else {
            strips.push(Strip { points: vec![end, first], parts: vec![rim] });
            closed = true;
        }
    } else if closed_top {
        strips.push(Strip { points: vec![last, (0.0, last.1)], parts: vec![rim] });
    }
    Ok(revolve(&strips, sides, closed, n + 5))
}

fn check(parts: &[Profile], sides: u32, thickness: f64) -> Result<(), GeomError> {
    let wrong = |message: String| Err(GeomError::domain(format!("lathe: {message}")));
    if parts.is_empty() {
        return wrong("there is no profile".into());
    }
    if parts.len() > 1000 || parts.iter().map(|p| p.y.len()).sum::<usize>() > MOST_POINTS {
        return wrong(format!("at most {MOST_POINTS} points"));
    }
    if !(3..=1024).contains(&sides) {
        return wrong(format!("3 to 1024 sides, got {sides}"));
    }
    if !(thickness >= 0.0 && thickness.is_finite()) {
        return wrong(format!("the thickness must be at least 0, got {thickness}"));
    }
    let mut height = f64::NEG_INFINITY;
    for (i, p) in parts.iter().enumerate() {
        if p.y.len() != p.r.len() {
            return wrong(format!("profile {i} has {} heights and {} radii", p.y.len(), p.r.len()));
        }
        if p.y.len() < 2 {
            return wrong(format!("profile {i} has {} points; it needs 2", p.y.len()));
        }
        for (y, r) in p.y.iter().zip(&p.r) {
            if !y.is_finite() || !r.is_finite() || y.abs() > 1e6 || *r > 1e6 {
                return wrong(format!("profile {i} has a point at height {y} with radius {r}"));
            }
            if *r < 0.0 {
                return wrong(format!("profile {i} has the negative radius {r}"));
            }
            if *y < height {
                return wrong(format!("heights must not decrease: {y} after {height} in profile {i}"));
            }
            height = *y;
        }
    }
    Ok(())
}

/// The strips of the outer wall, rings at steps included.
fn outer_wall(parts: &[Profile], size: f64, ring: u16) -> Vec<Strip> {
    let tip = TIP * size;
    let mut strips: Vec<Strip> = Vec::new();
    for (i, p) in parts.iter().enumerate() {
        let mut points: Vec<(f64, f64)> = Vec::with_capacity(p.y.len());
        for (r, y) in p.r.iter().zip(&p.y) {
            let q = (r.max(tip), *y);
            if points.last() != Some(&q) {
                points.push(q);
            }
        }
        if points.len() < 2 {
            // All points are one: a hair of height keeps the strip.
            let (r, y) = points[0];
            points.push((r, y + 1e-9 * size));
        }
        let segments = points.len() - 1;
        let part = i as u16;
        if let Some(before) = strips.last_mut()
            && let (Some(end), Some(start)) = (before.points.last().copied(), points.first().copied())
        {
            let near = (end.0 - start.0).abs() < 1e-9 * size && (end.1 - start.1).abs() < 1e-9 * size;
            if near {
                let k = before.points.len();
                if is_smooth(before.points[k - 2], end, points[1]) {
                    before.points.extend_from_slice(&points[1..]);
                    before.parts.extend(std::iter::repeat_n(part, segments));
                    continue;
                }
                points[0] = end;
            } else {
                strips.push(Strip { points: vec![end, start], parts: vec![ring] });
            }
        }
        strips.push(Strip { points, parts: vec![part; segments] });
    }
    strips
}

/// Whether the path a, b, c turns by less than a crease does.
fn is_smooth(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> bool {
    let (u, v) = ((b.0 - a.0, b.1 - a.1), (c.0 - b.0, c.1 - b.1));
    let dot = u.0 * v.0 + u.1 * v.1;
    dot >= SMOOTH_COS * libm::hypot(u.0, u.1) * libm::hypot(v.0, v.1)
}

/// The height of the floor inside.
fn floor_height(path: &[(f64, f64)], thickness: f64) -> f64 {
    let (bottom, top) = (path[0].1, path[path.len() - 1].1);
    bottom + thickness.min(0.5 * (top - bottom))
}

/// The inner wall, from the rim down to a height.
fn inner_wall(path: &[(f64, f64)], thickness: f64, down_to: f64) -> Vec<(f64, f64)> {
    let bore = |r: f64| (r - thickness).max(LEAST_BORE * r);
    let mut wall: Vec<(f64, f64)> = Vec::with_capacity(path.len());
    for (i, (r, y)) in path.iter().enumerate().rev() {
        if *y <= down_to && i + 1 < path.len() {
            // The last piece ends at the floor.
            let (r1, y1) = path[i + 1];
            let t = if y1 > *y { (down_to - y) / (y1 - y) } else { 0.0 };
            wall.push((bore(r + t * (r1 - r)), down_to));
            break;
        }
        wall.push((bore(*r), *y));
    }
    wall.dedup();
    if wall.len() < 2 {
        let (r, _) = wall[0];
        wall.push((r, down_to - 1e-9));
    }
    wall
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::NO_FACE;
    use std::collections::HashMap;

    fn profile(points: &[(f64, f64)]) -> Profile {
        Profile { y: points.iter().map(|p| p.1).collect(), r: points.iter().map(|p| p.0).collect() }
    }

    /// Signed volume; outward orientation makes it positive.
    fn volume(m: &Mesh) -> f64 {
        let t = |t: &[u32; 3]| {
            let p = t.map(|v| m.positions[v as usize].as_dvec3());
            p[0].dot(p[1].cross(p[2])) / 6.0
        };
        m.topology.triangles.iter().map(t).sum()
    }

    /// Each edge has two faces that run through it in opposite directions, and the surface is one sphere or torus.
    fn assert_closed(m: &Mesh, euler: i64) {
        let key = |v: u32| m.positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut directed: HashMap<_, i32> = HashMap::new();
        let mut points = std::collections::HashSet::new();
        for t in &m.topology.triangles {
            for c in 0..3 {
                *directed.entry((key(t[c]), key(t[(c + 1) % 3]))).or_default() += 1;
                points.insert(key(t[c]));
            }
        }
        assert!(directed.iter().all(|((a, b), n)| *n == 1 && directed.get(&(*b, *a)) == Some(&1)), "not watertight");
        assert!(m.topology.edges.iter().all(|e| e.faces[1] != NO_FACE));
        let (v, e, f) = (points.len() as i64, m.topology.edges.len() as i64, m.topology.triangles.len() as i64);
        assert_eq!(v - e + f, euler);
    }

    fn assert_outward(m: &Mesh) {
        for t in &m.topology.triangles {
            let p = t.map(|v| m.positions[v as usize]);
            let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
            for v in t {
                assert!(n.dot(m.normals[*v as usize]) > 0.5, "normal {} on a face of {n}", m.normals[*v as usize]);
            }
        }
        assert!(m.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    }

    /// The volume of a prism with this many sides against its circle's.
    fn polygon(sides: f64) -> f64 {
        sides / std::f64::consts::TAU * (std::f64::consts::TAU / sides).sin()
    }

    #[test]
    fn cylinder_and_cone_have_their_volumes() {
        let cylinder = lathe(&[profile(&[(0.5, 0.0), (0.5, 2.0)])], 64, 0.0, Caps::Both).unwrap();
        assert_closed(&cylinder, 2);
        assert_outward(&cylinder);
        let expected = std::f64::consts::PI * 0.25 * 2.0 * polygon(64.0);
        assert!((volume(&cylinder) - expected).abs() < 1e-5);
        let cone = lathe(&[profile(&[(1.0, 0.0), (0.5, 1.0), (0.0, 2.0)])], 64, 0.0, Caps::Both).unwrap();
        assert_closed(&cone, 2);
        assert!((volume(&cone) - std::f64::consts::PI * 2.0 / 3.0 * polygon(64.0)).abs() < 1e-3);
    }

    #[test]
    fn a_vessel_holds_what_its_walls_leave() {
        let p = [profile(&[(0.5, 0.0), (0.5, 1.0), (0.5, 2.0)])];
        let cup = lathe(&p, 48, 0.1, Caps::Both).unwrap();
        assert_closed(&cup, 2);
        assert_outward(&cup);
        let expected = std::f64::consts::PI * (0.25 * 2.0 - 0.16 * 1.9) * polygon(48.0);
        assert!((volume(&cup) - expected).abs() < 1e-5, "{} {expected}", volume(&cup));
        let tube = lathe(&p, 48, 0.1, Caps::None).unwrap();
        assert_closed(&tube, 0);
        assert_outward(&tube);
        let thick = lathe(&p, 48, 9.0, Caps::Both).unwrap();
        assert_closed(&thick, 2);
    }

    #[test]
    fn joints_are_smooth_bent_or_stepped() {
        let lower = profile(&[(0.5, 0.0), (0.5, 1.0)]);
        let creases = |m: &Mesh| m.topology.edges.iter().filter(|e| e.crease).count();
        let smooth = lathe(&[lower.clone(), profile(&[(0.5, 1.0), (0.6, 2.0)])], 32, 0.0, Caps::None).unwrap();
        assert_eq!(creases(&smooth), 0);
        let bent = lathe(&[lower.clone(), profile(&[(0.5, 1.0), (2.5, 2.0)])], 32, 0.0, Caps::None).unwrap();
        assert_eq!(creases(&bent), 32);
        let stepped = lathe(&[lower, profile(&[(0.3, 1.0), (0.3, 2.0)])], 32, 0.0, Caps::Both).unwrap();
        assert_eq!(creases(&stepped), 4 * 32);
        assert_closed(&stepped, 2);
        assert_outward(&stepped);
        assert_eq!(stepped.topology.parts.iter().copied().collect::<std::collections::BTreeSet<_>>().len(), 5);
    }

    #[test]
    fn topology_is_shared_and_the_cache_changes_nothing() {
        let of = |r: f64| lathe(&[profile(&[(r, 0.0), (r + 0.1, 1.0)])], 16, 0.0, Caps::Both).unwrap();
        let (a, b) = (of(0.5), of(0.7));
        assert!(std::sync::Arc::ptr_eq(&a.topology, &b.topology));
        for n in 3..40 {
            lathe(&[profile(&[(0.5, 0.0), (0.5, 1.0)])], n, 0.0, Caps::Both).unwrap();
        }
        assert_eq!(of(0.5), a);
    }

    #[test]
    fn impossible_profiles_are_errors() {
        let fails =
            |parts: &[Profile], sides, thickness| lathe(parts, sides, thickness, Caps::Both).unwrap_err().to_string();
        let good = profile(&[(0.5, 0.0), (0.5, 1.0)]);
        assert_eq!(fails(&[], 8, 0.0), "lathe: there is no profile");
        assert_eq!(fails(&[profile(&[(1.0, 0.0)])], 8, 0.0), "lathe: profile 0 has 1 points; it needs 2");
        assert!(fails(&[profile(&[(0.5, 1.0), (0.5, 0.0)])], 8, 0.0).contains("must not decrease"));
        assert!(fails(&[profile(&[(-0.5, 0.0), (0.5, 1.0)])], 8, 0.0).contains("negative"));
        assert!(fails(&[profile(&[(f64::NAN, 0.0), (0.5, 1.0)])], 8, 0.0).contains("NaN"));
        assert!(fails(&[good.clone()], 2, 0.0).contains("3 to 1024"));
        assert!(fails(&[good.clone()], 8, -1.0).contains("thickness"));
        assert!(fails(&[profile(&[(0.0, 0.0), (0.0, 0.0)])], 8, 0.0).contains("no extent"));
        let flat = lathe(&[profile(&[(0.5, 0.0), (0.5, 0.0)])], 8, 0.0, Caps::Both).unwrap();
        assert!(flat.positions.iter().chain(&flat.normals).all(|p| p.is_finite()));
    }
}
