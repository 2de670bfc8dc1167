//! Bones from curves: the curves are smoothed, split at branches and bends, and
//! simplified to the allowed number of bones.

use crate::rigging::Bone;
use crate::skeleton::Node;
use glam::DVec3;

/// The number of smoothing passes; each replaces a point by the mean of it and its
/// neighbours.
const SMOOTHING: usize = 4;
/// The initial tolerance for straightness, in cells, and its growth factor while there
/// are too many bones.
const TOLERANCE: f64 = 1.5;
const GROWTH: f64 = 1.3;
/// The number of tolerances tried before terminal bones are dropped.
const TRIES: usize = 16;

/// A piece of curve between two branch points or ends.
struct Chain {
    /// The chain that this one continues; `None` at the root.
    parent: Option<usize>,
    /// The points from start to end.
    points: Vec<DVec3>,
    /// The distance from its end to the surface.
    clearance: f64,
    /// True if no chain continues it.
    ends: bool,
}

impl Chain {
    fn length(&self) -> f64 {
        self.points.windows(2).map(|p| (p[1] - p[0]).length()).sum()
    }
}

/// Returns at most `most` joints, including the root.
pub(super) fn bones(nodes: Vec<Node>, cell: f64, most: usize) -> Vec<Bone> {
    let Some(root) = nodes.first().copied() else { return Vec::new() };
    let mut chains = chains(&nodes);
    contract(&mut chains, cell);
    let mut tolerance = TOLERANCE * cell;
    for _ in 0..TRIES {
        if chains.iter().map(|c| simplified(&c.points, tolerance).len() - 1).sum::<usize>() < most {
            break;
        }
        tolerance *= GROWTH;
    }
    let mut cut: Vec<Vec<DVec3>> =
        chains.iter().map(|c| simplified(&c.points, tolerance)).collect();
    // Chains that are straight cannot be simplified further; drop the shortest terminal
    // ones.
    let mut dropped = vec![false; chains.len()];
    let count = |cut: &[Vec<DVec3>], dropped: &[bool]| -> usize {
        1 + cut.iter().zip(dropped).filter(|(_, d)| !**d).map(|(c, _)| c.len() - 1).sum::<usize>()
    };
    while count(&cut, &dropped) > most {
        let open = |k: &usize| {
            !dropped[*k] && !chains.iter().zip(&dropped).any(|(c, d)| c.parent == Some(*k) && !d)
        };
        let shortest = (0..chains.len()).filter(open);
        let shortest = shortest.fold(None, |best: Option<usize>, k| match best {
            Some(b) if chains[b].length() <= chains[k].length() => Some(b),
            _ => Some(k),
        });
        let Some(k) = shortest else { break };
        if cut[k].len() > 2 {
            cut[k] = vec![cut[k][0], cut[k][cut[k].len() - 1]];
        } else {
            dropped[k] = true;
        }
    }
    let mut bones = vec![Bone { name: "root".into(), parent: None, head: root.at, tail: root.at }];
    let mut last: Vec<usize> = vec![0; chains.len()];
    for (k, c) in chains.iter().enumerate().filter(|(k, _)| !dropped[*k]) {
        let mut parent = c.parent.map_or(0, |p| last[p]);
        for pair in cut[k].windows(2) {
            bones.push(Bone {
                name: format!("bone_{}", bones.len()),
                parent: Some(parent),
                head: pair[0],
                tail: pair[1],
            });
            parent = bones.len() - 1;
        }
        last[k] = parent;
    }
    bones
}

/// Returns the chains, parents before children.
fn chains(nodes: &[Node]) -> Vec<Chain> {
    let mut below: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    for (i, n) in nodes.iter().enumerate() {
        if let Some(p) = n.parent {
            below[p].push(i);
        }
    }
    let mut out: Vec<Chain> = Vec::new();
    // Chains yet to be traced: the start node, the chain that ends there, the first node
    // after it.
    let mut open: Vec<(usize, Option<usize>, usize)> =
        below[0].iter().rev().map(|c| (0, None, *c)).collect();
    while let Some((start, parent, first)) = open.pop() {
        let mut points = vec![nodes[start].at, nodes[first].at];
        let mut end = first;
        while let [only] = below[end][..] {
            end = only;
            points.push(nodes[end].at);
        }
        for _ in 0..SMOOTHING {
            let before = points.clone();
            for k in 1..points.len() - 1 {
                points[k] = (before[k - 1] + before[k] + before[k + 1]) / 3.0;
            }
        }
        out.push(Chain {
            parent,
            points,
            clearance: nodes[end].clearance,
            ends: below[end].is_empty(),
        });
        let this = out.len() - 1;
        open.extend(below[end].iter().rev().map(|c| (end, Some(this), *c)));
    }
    out
}

/// Merges nearby branch points: removes chains between two branch points that are shorter
/// than the body's thickness there. The end moves to the start.
fn contract(chains: &mut Vec<Chain>, cell: f64) {
    while let Some(k) =
        chains.iter().position(|c| !c.ends && c.length() < c.clearance.max(2.0 * cell))
    {
        let gone = chains.remove(k);
        for c in chains.iter_mut() {
            if c.parent == Some(k) {
                c.parent = gone.parent;
                c.points[0] = gone.points[0];
            } else {
                c.parent = c.parent.map(|p| if p > k { p - 1 } else { p });
            }
        }
    }
}

/// Ramer-Douglas-Peucker simplification: keeps the ends, and the points where the curve
/// is farther than the tolerance from the simplified one.
fn simplified(points: &[DVec3], tolerance: f64) -> Vec<DVec3> {
    let mut keep = vec![false; points.len()];
    let mut open = vec![(0, points.len() - 1)];
    (keep[0], keep[points.len() - 1]) = (true, true);
    while let Some((a, b)) = open.pop() {
        let far = |k: usize| crate::near::to_segment(points[k], points[a], points[b]);
        let worst =
            (a + 1..b).fold((0, tolerance), |w, k| if far(k) > w.1 { (k, far(k)) } else { w });
        if worst.0 > 0 {
            keep[worst.0] = true;
            open.extend([(a, worst.0), (worst.0, b)]);
        }
    }
    points.iter().zip(keep).filter(|(_, k)| *k).map(|(p, _)| *p).collect()
}
