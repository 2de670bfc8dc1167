//! Joints from the groups of a mesh: which groups touch, where, and the tree they form.

use crate::near::Surface;
use crate::rigging::{Bone, MOST_GROUPED_TRIANGLES, MOST_GROUPS};
use crate::skin::Mix;
use glam::{DVec3, Vec3};
use pcadlang_scene::geom::armature::Influence;
use pcadlang_scene::geom::{Bounds, GeomError, Mesh};
use std::collections::BTreeSet;

/// Groups are neighbours if they are no farther apart than this fraction of the diagonal
/// of the mesh's bounding box.
const NEAR: f64 = 0.01;
/// A neighbour's influence ends at this multiple of the contact's radius.
const REACH: f64 = 1.5;

/// Joints, and the skin weights of the vertices.
pub(super) struct Grouped {
    pub joints: Vec<Bone>,
    pub influences: Vec<Influence>,
}

struct Group {
    name: String,
    surface: Surface,
    /// The indices of its vertices, in increasing order.
    vertices: Vec<u32>,
    /// Twice the surface area. `centre` is the mean over the surface.
    area: f64,
    centre: DVec3,
}

/// The place where two groups meet, or come closest.
#[derive(Clone, Copy)]
struct Contact {
    gap: f64,
    at: DVec3,
    radius: f64,
}

pub(super) fn rig(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    mesh: &Mesh,
) -> Result<Grouped, GeomError> {
    if triangles.len() > MOST_GROUPED_TRIANGLES {
        let n = triangles.len();
        let message = format!(
            "an armature by groups takes at most {MOST_GROUPED_TRIANGLES} triangles; the mesh has {n}"
        );
        return Err(GeomError::invalid(message));
    }
    let groups = groups(positions, triangles, mesh)?;
    let bounds = Bounds::around(positions.iter().map(|p| p.as_dvec3()));
    let Some(bounds) = bounds else { return Err(GeomError::invalid("the mesh has no vertices")) };
    let near = NEAR * bounds.size().length();
    let n = groups.len();
    let mut contacts: Vec<Vec<Option<Contact>>> = vec![vec![None; n]; n];
    for i in 0..n {
        for j in i + 1..n {
            let c = contact(&groups[i], &groups[j], positions, near);
            (contacts[i][j], contacts[j][i]) = (Some(c), Some(c));
        }
    }
    let (sum, area) =
        groups.iter().fold((DVec3::ZERO, 0.0), |(s, a), g| (s + g.centre * g.area, a + g.area));
    let middle = if area > 0.0 { sum / area } else { bounds.centre() };
    let off = |g: &Group| (g.centre - middle).length();
    let root =
        (0..n).fold(0, |best, i| if off(&groups[i]) < off(&groups[best]) { i } else { best });
    let (order, parents) = spanning_tree(&groups, &contacts, root, near);
    let mut number = vec![0; n];
    for (k, g) in order.iter().enumerate() {
        number[*g] = k;
    }
    let joint = |g: usize| parents[g].and_then(|p| contacts[g][p]);
    let joints = order.iter().map(|&g| {
        let head = joint(g).map_or(groups[g].centre, |c| c.at);
        let below: Vec<DVec3> = (0..n)
            .filter(|c| parents[*c] == Some(g))
            .filter_map(|c| joint(c).map(|j| j.at))
            .collect();
        let mean = below.iter().sum::<DVec3>() / below.len().max(1) as f64;
        let far = groups[g].vertices.iter().map(|v| positions[*v as usize].as_dvec3());
        let far =
            far.fold(head, |f, p| if (p - head).length() > (f - head).length() { p } else { f });
        let tail = if below.is_empty() || (mean - head).length() < near { far } else { mean };
        Bone { name: groups[g].name.clone(), parent: parents[g].map(|p| number[p]), head, tail }
    });
    let joints = joints.collect();

    let mut mixes = vec![Mix::default(); positions.len()];
    for (g, group) in groups.iter().enumerate() {
        let beside = (0..n).filter(|o| parents[*o] == Some(g) || parents[g] == Some(*o));
        let beside: Vec<(usize, Contact)> =
            beside.filter_map(|o| contacts[g][o].map(|c| (o, c))).collect();
        for v in &group.vertices {
            let mix = &mut mixes[*v as usize];
            mix.add(number[g], 1.0);
            for (o, c) in &beside {
                let far = (positions[*v as usize].as_dvec3() - c.at).length();
                mix.add(number[*o], fade(far, c.radius));
            }
        }
    }
    Ok(Grouped { joints, influences: mixes.iter().map(Mix::influence).collect() })
}

/// A weight that is 1 up to the contact's radius, 0 from [`REACH`] radii on, and smooth
/// in between.
fn fade(far: f64, radius: f64) -> f64 {
    if far >= REACH * radius {
        return 0.0;
    }
    let t = ((far - radius) / ((REACH - 1.0) * radius)).clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

fn groups(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    mesh: &Mesh,
) -> Result<Vec<Group>, GeomError> {
    let parts: BTreeSet<u16> = mesh.topology.parts.iter().copied().collect();
    if !(2..=MOST_GROUPS).contains(&parts.len()) {
        let n = parts.len();
        let message = format!(
            "an armature by groups needs 2 to {MOST_GROUPS} groups in the mesh; it has {n}"
        );
        return Err(GeomError::invalid(message));
    }
    let mut taken = BTreeSet::new();
    let mut groups = Vec::with_capacity(parts.len());
    for (k, part) in parts.into_iter().enumerate() {
        let own =
            triangles.iter().zip(&mesh.topology.parts).filter(|(_, p)| **p == part).map(|(t, _)| t);
        let vertices: BTreeSet<u32> = own.clone().flatten().copied().collect();
        let faces: Vec<[DVec3; 3]> =
            own.map(|t| t.map(|v| positions[v as usize].as_dvec3())).collect();
        let (mut sum, mut area) = (DVec3::ZERO, 0.0);
        for [a, b, c] in &faces {
            let twice = (*b - *a).cross(*c - *a).length();
            sum += (*a + *b + *c) * (twice / 3.0);
            area += twice;
        }
        let Some(bounds) = Bounds::around(faces.iter().flatten().copied()) else { continue };
        let centre = if area > 0.0 { sum / area } else { bounds.centre() };
        let given = mesh.topology.part_names.get(usize::from(part)).filter(|n| !n.is_empty());
        let given = given.map_or_else(|| format!("part_{}", k + 1), |n| n.to_string());
        let mut name = given.clone();
        let mut count = 1;
        while !taken.insert(name.clone()) {
            count += 1;
            name = format!("{given}#{count}");
        }
        let vertices = vertices.into_iter().collect();
        groups.push(Group { name, surface: Surface { faces, bounds }, vertices, area, centre });
    }
    Ok(groups)
}

/// Returns the contact of two groups: the midpoints between vertices of one and the
/// nearest points of the other, for all vertices within `near` of the smallest gap. A
/// vertex inside the other group is its own midpoint.
fn contact(a: &Group, b: &Group, positions: &[Vec3], near: f64) -> Contact {
    let (mut gap, mut found) = (f64::INFINITY, Vec::new());
    for (one, other) in [(a, b), (b, a)] {
        for v in &one.vertices {
            let p = positions[*v as usize].as_dvec3();
            if other.surface.to_box(p) <= gap + near {
                let (d, at) = other.surface.nearest(p);
                gap = gap.min(d);
                found.push((*v, d, 0.5 * (p + at)));
            }
        }
    }
    found.retain(|(_, d, _)| *d <= gap + near);
    // A vertex that belongs to both groups counts once.
    found.sort_by_key(|(v, ..)| *v);
    found.dedup_by_key(|(v, ..)| *v);
    let at = found.iter().map(|f| f.2).sum::<DVec3>() / found.len().max(1) as f64;
    let radius = found.iter().map(|f| (f.2 - at).length()).fold(near, f64::max);
    Contact { gap, at, radius }
}

/// Returns the groups, parents before children, and their parents. Parents follow the
/// shortest paths from the root over contacts; groups that no contact reaches attach
/// across the smallest gap.
fn spanning_tree(
    groups: &[Group],
    contacts: &[Vec<Option<Contact>>],
    root: usize,
    near: f64,
) -> (Vec<usize>, Vec<Option<usize>>) {
    let n = groups.len();
    let (mut far, mut parents) = (vec![f64::INFINITY; n], vec![None; n]);
    let (mut order, mut done) = (Vec::with_capacity(n), vec![false; n]);
    far[root] = 0.0;
    while order.len() < n {
        let open = (0..n).filter(|i| !done[*i]);
        let next =
            open.fold(
                None,
                |best: Option<usize>, i| {
                    if best.is_none_or(|b| far[i] < far[b]) { Some(i) } else { best }
                },
            );
        let Some(mut next) = next else { break };
        if far[next].is_infinite() {
            let mut best: Option<(usize, usize, Contact)> = None;
            for i in (0..n).filter(|i| !done[*i]) {
                for j in (0..n).filter(|j| done[*j]) {
                    if let Some(c) = contacts[i][j].filter(|c| best.is_none_or(|b| c.gap < b.2.gap))
                    {
                        best = Some((i, j, c));
                    }
                }
            }
            if let Some((i, j, c)) = best {
                next = i;
                parents[i] = Some(j);
                far[i] = far[j] + way(&groups[j], &c, &groups[i]);
            }
        }
        done[next] = true;
        order.push(next);
        for i in (0..n).filter(|i| !done[*i]) {
            if let Some(c) = contacts[next][i].filter(|c| c.gap <= near) {
                let by = far[next] + way(&groups[next], &c, &groups[i]);
                if by < far[i] {
                    far[i] = by;
                    parents[i] = Some(next);
                }
            }
        }
    }
    (order, parents)
}

/// The length of the path from centre to centre through the contact.
fn way(a: &Group, c: &Contact, b: &Group) -> f64 {
    (a.centre - c.at).length() + (c.at - b.centre).length()
}
