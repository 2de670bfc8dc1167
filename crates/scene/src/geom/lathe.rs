//! The lathe: profiles swept around the y axis into an object of revolution (Kulkarni et
//! al. 2014, section 2.1.1).
//!
//! Checks the arguments and lays out the surface as strips; `profile_path` cuts profiles
//! into strips, and `revolve` sweeps them. Invariant: faces are oriented outward, and the
//! mesh is watertight if both ends are closed.

use super::mesh::MOST_TRIANGLES;
use super::profile_path::{OuterPath, Profile, Tolerance, Wall, floor_height, inner_wall};
use super::real::{Real, Tape, Var};
use super::revolve::{Strip, revolve, vjp_rings};
use super::{GeomError, Instance, Mesh, Revolution, Solid};
use glam::DVec3;
use std::sync::Arc;

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

/// The maximum number of points of all profiles together.
const MOST_POINTS: usize = 4096;
/// The maximum number of profiles.
const MOST_PROFILES: usize = 1000;
/// The minimum number of sides.
const FEWEST_SIDES: u32 = 3;
/// The maximum height or radius, in scene units.
const LARGEST: f64 = 1e6;

/// Sweeps profiles, stacked in the given order, around the y axis. A step from one to the
/// next is closed by a ring. A wall of positive thickness makes a vessel that is open at
/// the top, with an outer wall, a rim and an inner wall. The inner radius is smaller by
/// the thickness, measured horizontally, and at least 2 % of the outer one. If `caps`
/// closes the bottom, there is also a floor, as high as the wall is thick (at most half
/// the height) or as `wall` raises it (at most 95 % of the height). Without a wall,
/// `caps` says which ends get a disc.
///
/// A profile that begins or ends at the axis (below 1e-6 of the object's size) is closed
/// there regardless of `caps`, except at the top of a vessel, which stays open. Radii at
/// the axis between the ends make a thin neck.
///
/// Part numbers: the `n` profiles in order from 0, then `n` for rings at steps, `n + 1`
/// for the bottom disc, `n + 2` for the top disc or the rim, `n + 3` for the inner wall,
/// `n + 4` for the floor inside. The count is `n + 5` even if some are absent.
///
/// Normals come from the slope of the profile (central differences). Creases run along
/// discs, rings and rims, and between profiles that meet at more than 40 degrees, never
/// within a profile.
///
/// # Errors
/// [`GeomError::Domain`] if a profile has fewer than 2 points, unequal numbers of heights
/// and radii, numbers that are not finite or above 1e6, decreasing heights or negative
/// radii; if there are no profiles or more than 1000, more than 4096 points, fewer than 3
/// or more than 1024 sides, or more than five million triangles; if the object has no
/// extent.
pub fn lathe(
    parts: &[Profile],
    sides: u32,
    wall: impl Into<Wall>,
    caps: Caps,
) -> Result<Mesh, GeomError> {
    let wall = wall.into();
    check(parts, sides, wall)?;
    let Layout { strips, closed } = layout(parts, caps, wall, |x| x)?;
    Ok(revolve(&strips, sides, closed, parts.len() as u16 + 5))
}

impl Solid {
    /// As [`lathe`], for a solid that is drawn as the [`Revolution`] itself where it
    /// is the only object. `sides` is for the mesh, which is made when something else needs
    /// it: several objects in one picture, export, bounds.
    ///
    /// # Errors
    /// As [`lathe`].
    pub fn exact_lathe(
        parts: &[Profile],
        sides: u32,
        wall: impl Into<Wall>,
        caps: Caps,
    ) -> Result<Solid, GeomError> {
        let wall = wall.into();
        check(parts, sides, wall)?;
        let Layout { strips, closed } = layout(parts, caps, wall, |x| x)?;
        let count = parts.len() as u16 + 5;
        let surface = Revolution::new(&strips, closed, count);
        Ok(Solid::turned(surface, move || {
            Instance::new(Arc::new(revolve(&strips, sides, closed, count)))
        }))
    }
}

/// Derivatives with respect to the inputs of [`lathe`].
#[derive(Clone, Debug, PartialEq)]
pub struct LatheGradient {
    /// With respect to the heights and radii of each profile.
    pub profiles: Vec<Profile>,
    /// With respect to the thickness of the wall and the height of the floor.
    pub wall: Wall,
}

/// The vector-Jacobian product of [`lathe`], given derivatives with respect to the mesh's
/// vertices, in order. Which points are merged and which ends are closed is held fixed.
///
/// # Errors
/// As [`lathe`].
pub fn vjp_lathe(
    parts: &[Profile],
    sides: u32,
    wall: impl Into<Wall>,
    caps: Caps,
    by_vertex: &[DVec3],
) -> Result<LatheGradient, GeomError> {
    let wall = wall.into();
    check(parts, sides, wall)?;
    vjp_layout(parts, wall, caps, |strips| vjp_rings(strips, sides, by_vertex))
}

/// Maps derivatives with respect to the points of the path, in order, to the inputs.
fn vjp_layout(
    parts: &[Profile],
    wall: Wall,
    caps: Caps,
    by_point: impl FnOnce(&[Strip<Var<'_>>]) -> Vec<(f64, f64)>,
) -> Result<LatheGradient, GeomError> {
    let tape = Tape::default();
    let wall = Wall { thickness: tape.variable(wall.thickness), floor: tape.variable(wall.floor) };
    let mut inputs = Vec::new();
    let number = |x| {
        let v = tape.variable(x);
        inputs.push(v);
        v
    };
    let strips = layout(parts, caps, wall, number)?.strips;
    let rings = by_point(&strips);
    let outputs = strips
        .iter()
        .flat_map(|s| &s.points)
        .zip(rings)
        .flat_map(|(p, (r, y))| [(p.0, r), (p.1, y)]);
    let slopes = tape.reverse(outputs);
    let mut numbers = inputs.iter().map(|v| slopes[v.index()]);
    let mut next = || numbers.next().unwrap_or(0.0);
    let wall =
        Wall { thickness: slopes[wall.thickness.index()], floor: slopes[wall.floor.index()] };
    let one = |p: &Profile| {
        let (r, y) = p.r.iter().map(|_| (next(), next())).unzip();
        Profile { y, r }
    };
    Ok(LatheGradient { profiles: parts.iter().map(one).collect(), wall })
}

/// The path that a lathe sweeps.
struct Layout<T> {
    strips: Vec<Strip<T>>,
    /// True if the path ends where it starts.
    closed: bool,
}

/// Lays out checked profiles; `number` is called with each radius and height in turn.
fn layout<T: Real>(
    parts: &[Profile],
    caps: Caps,
    wall: Wall<T>,
    number: impl FnMut(f64) -> T,
) -> Result<Layout<T>, GeomError> {
    let flat = || GeomError::domain("lathe: the object has no extent");
    let tolerance = Tolerance::of(parts).ok_or_else(flat)?;
    let n = parts.len() as u16;
    let (ring, bottom_disc, rim, inner, floor) = (n, n + 1, n + 2, n + 3, n + 4);
    let OuterPath { first, last, mut strips } =
        OuterPath::new(parts, &tolerance, ring, number).ok_or_else(flat)?;
    let thickness = wall.thickness;
    let axis = thickness.constant(0.0);
    let hollow = thickness.value() > 0.0;
    let bottom_pole = tolerance.is_tip(first.0.value()) && !strips.is_empty();
    let top_pole = tolerance.is_tip(last.0.value()) && !strips.is_empty() && !hollow;
    let closed_bottom = bottom_pole || matches!(caps, Caps::Bottom | Caps::Both);
    let closed_top = top_pole || matches!(caps, Caps::Top | Caps::Both);

    let mut all = Vec::with_capacity(2 * strips.len() + 4);
    let mut after = Vec::new();
    let mut closed = false;
    if hollow {
        let down_to = if closed_bottom {
            floor_height(first.1, last.1, wall)
        } else {
            thickness.constant(f64::NEG_INFINITY)
        };
        let (walls, [start, end]) =
            inner_wall(&strips, last, thickness, down_to, &tolerance, inner);
        after.push(Strip { points: vec![last, start], parts: vec![rim], blend: false });
        after.extend(walls);
        if closed_bottom {
            after.push(Strip {
                points: vec![end, (axis, end.1)],
                parts: vec![floor],
                blend: false,
            });
        } else {
            after.push(Strip { points: vec![end, first], parts: vec![rim], blend: false });
            closed = true;
        }
    }
    if bottom_pole {
        all.extend(strips[0].close_start());
    } else if closed_bottom {
        all.push(Strip {
            points: vec![(axis, first.1), first],
            parts: vec![bottom_disc],
            blend: false,
        });
    }
    if top_pole {
        after.extend(strips.last_mut().and_then(Strip::close_end));
    } else if closed_top && !hollow {
        after.push(Strip { points: vec![last, (axis, last.1)], parts: vec![rim], blend: false });
    }
    all.append(&mut strips);
    all.append(&mut after);
    if all.is_empty() {
        return Err(GeomError::domain("lathe: the object has no height and no discs"));
    }
    Ok(Layout { strips: all, closed })
}

fn check(parts: &[Profile], sides: u32, wall: Wall) -> Result<(), GeomError> {
    let wrong = |message: String| Err(GeomError::domain(format!("lathe: {message}")));
    if parts.is_empty() {
        return wrong("there is no profile".into());
    }
    if parts.len() > MOST_PROFILES {
        return wrong(format!("{} profiles; at most {MOST_PROFILES}", parts.len()));
    }
    let points = parts.iter().map(|p| p.y.len()).sum::<usize>();
    if points > MOST_POINTS {
        return wrong(format!("{points} points; at most {MOST_POINTS}"));
    }
    if !(FEWEST_SIDES..=1024).contains(&sides) {
        return wrong(format!("3 to 1024 sides, got {sides}"));
    }
    for (what, x) in [("thickness", wall.thickness), ("floor", wall.floor)] {
        if !(0.0..=LARGEST).contains(&x) {
            return wrong(format!("the {what} must be from 0 to {LARGEST}, got {x}"));
        }
    }
    let walls = if wall.thickness > 0.0 { 2 } else { 1 };
    let triangles = 2 * (walls * points + 3) * sides as usize;
    if triangles > MOST_TRIANGLES {
        return wrong(format!(
            "{points} points and {sides} sides make {triangles} triangles; at most {MOST_TRIANGLES}"
        ));
    }
    let mut height = f64::NEG_INFINITY;
    for (i, p) in parts.iter().enumerate() {
        if p.y.len() != p.r.len() {
            return wrong(format!("profile {i} has {} heights and {} radii", p.y.len(), p.r.len()));
        }
        if p.y.len() < 2 {
            return wrong(format!("profile {i} needs at least 2 points, got {}", p.y.len()));
        }
        for (y, r) in p.y.iter().zip(&p.r) {
            for (what, x) in [("height", y), ("radius", r)] {
                if !x.is_finite() || x.abs() > LARGEST {
                    return wrong(format!(
                        "profile {i} has the {what} {x}; it must be finite and at most {LARGEST}"
                    ));
                }
            }
            if *r < 0.0 {
                return wrong(format!("profile {i} has the negative radius {r}"));
            }
            if *y < height {
                return wrong(format!(
                    "heights must not decrease: {y} after {height} in profile {i}"
                ));
            }
            height = *y;
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "lathe_tests.rs"]
mod tests;
