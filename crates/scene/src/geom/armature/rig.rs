//! Rigs: a tree of joints, and named points attached to them, without a mesh or a pose.
//!
//! Rest frames are aligned with the world, so a joint rotates about the world's axes
//! through its rest head. Invariant: joints are in rig order, parents before children,
//! and there is at least one.

use crate::geom::GeomError;
use glam::DVec3;
use std::sync::Arc;

/// The maximum number of joints of a rig.
pub const MOST_JOINTS: usize = 4096;

/// One joint, with the bone that starts there.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// The name.
    pub name: Arc<str>,
    /// The index of the parent, which is less than the joint's own; `None` for a root.
    pub parent: Option<usize>,
    /// The pivot at rest, in the mesh's units.
    pub head: DVec3,
    /// The end of the bone at rest.
    pub tail: DVec3,
}

/// A named point that moves with a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Keypoint {
    /// The name.
    pub name: Arc<str>,
    /// The joint's index.
    pub joint: usize,
    /// The position at rest.
    pub rest: DVec3,
}

/// A tree of joints, or several trees.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    joints: Vec<Joint>,
    keypoints: Vec<Keypoint>,
    /// For each joint as given, its index in rig order.
    order: Vec<usize>,
}

/// A joint whose parent is given by name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedJoint {
    /// The name.
    pub name: String,
    /// The name of the parent; `None` for a root.
    pub parent: Option<String>,
    /// The pivot at rest.
    pub head: DVec3,
    /// The end of the bone at rest.
    pub tail: DVec3,
}

impl Rig {
    /// Makes a rig from joints in any order. The order is kept as far as parents can come
    /// before children.
    ///
    /// # Errors
    /// No joints, or more than 4096; two joints of one name; a parent that does not
    /// exist; a joint that is its own ancestor; a position that is not finite.
    pub fn new(given: Vec<NamedJoint>) -> Result<Rig, GeomError> {
        if given.is_empty() || given.len() > MOST_JOINTS {
            return Err(GeomError::invalid(format!(
                "a rig has 1 to {MOST_JOINTS} joints, not {}",
                given.len()
            )));
        }
        let mut index = std::collections::BTreeMap::new();
        for (i, j) in given.iter().enumerate() {
            if index.insert(j.name.as_str(), i).is_some() {
                return Err(GeomError::invalid(format!(
                    "two joints of the rig are called `{}`",
                    j.name
                )));
            }
            if !(j.head.is_finite() && j.tail.is_finite()) {
                return Err(GeomError::invalid(format!(
                    "the position of joint `{}` is not finite",
                    j.name
                )));
            }
        }
        let mut parents = Vec::with_capacity(given.len());
        for j in &given {
            parents.push(match &j.parent {
                None => None,
                Some(p) => Some(*index.get(p.as_str()).ok_or_else(|| {
                    GeomError::invalid(format!(
                        "joint `{}` has the parent `{p}`, which is not in the rig",
                        j.name
                    ))
                })?),
            });
        }
        // Each pass over the remaining joints places those whose parents have been
        // placed.
        let mut order = vec![usize::MAX; given.len()];
        let mut placed = Vec::with_capacity(given.len());
        while placed.len() < given.len() {
            let before = placed.len();
            for i in 0..given.len() {
                let ready =
                    order[i] == usize::MAX && parents[i].is_none_or(|p| order[p] != usize::MAX);
                if ready {
                    order[i] = placed.len();
                    placed.push(i);
                }
            }
            if placed.len() == before {
                return Err(GeomError::invalid(format!(
                    "the rig has a cycle: {}",
                    cycle(&given, &parents, &order)
                )));
            }
        }
        let joints = placed.iter().map(|&i| Joint {
            name: given[i].name.as_str().into(),
            parent: parents[i].map(|p| order[p]),
            head: given[i].head,
            tail: given[i].tail,
        });
        Ok(Rig { joints: joints.collect(), keypoints: Vec::new(), order })
    }

    /// Adds named points, given by name, joint and position at rest.
    ///
    /// # Errors
    /// A joint that does not exist; two points of one name; a position that is not
    /// finite.
    pub fn with_keypoints(
        mut self,
        points: Vec<(String, String, DVec3)>,
    ) -> Result<Rig, GeomError> {
        for (name, joint, rest) in points {
            let Some(j) = self.find(&joint) else {
                return Err(GeomError::invalid(format!(
                    "keypoint `{name}` is attached to the joint `{joint}`, which is not in the rig"
                )));
            };
            if self.keypoints.iter().any(|k| *k.name == *name) {
                return Err(GeomError::invalid(format!(
                    "two keypoints of the rig are called `{name}`"
                )));
            }
            if !rest.is_finite() {
                return Err(GeomError::invalid(format!(
                    "the position of keypoint `{name}` is not finite"
                )));
            }
            self.keypoints.push(Keypoint { name: name.into(), joint: j, rest });
        }
        Ok(self)
    }

    /// The joints in rig order.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The named points.
    pub fn keypoints(&self) -> &[Keypoint] {
        &self.keypoints
    }

    /// Returns the index of a joint.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|j| *j.name == *name)
    }

    /// Returns the index in rig order of the joint that was given as number `i`.
    pub fn placed(&self, i: usize) -> Option<usize> {
        self.order.get(i).copied()
    }

    /// Returns the same tree with the given offsets added to heads and tails (by joint)
    /// and to keypoints.
    pub(super) fn moved(&self, heads: &[DVec3], tails: &[DVec3], points: &[DVec3]) -> Rig {
        let mut rig = self.clone();
        for ((j, h), t) in rig.joints.iter_mut().zip(heads).zip(tails) {
            (j.head, j.tail) = (j.head + *h, j.tail + *t);
        }
        for (k, d) in rig.keypoints.iter_mut().zip(points) {
            k.rest += *d;
        }
        rig
    }
}

/// Returns a cycle among the joints that could not be placed, as text.
fn cycle(given: &[NamedJoint], parents: &[Option<usize>], order: &[usize]) -> String {
    let Some(mut at) = order.iter().position(|o| *o == usize::MAX) else { return String::new() };
    // After that many steps up, `at` is on the cycle.
    for _ in 0..given.len() {
        at = parents[at].unwrap_or(at);
    }
    let (start, mut names) = (at, vec![given[at].name.as_str()]);
    loop {
        at = parents[at].unwrap_or(start);
        names.push(&given[at].name);
        if at == start || names.len() > 12 {
            return names.join(" -> ");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(name: &str, parent: Option<&str>) -> NamedJoint {
        NamedJoint {
            name: name.into(),
            parent: parent.map(Into::into),
            head: DVec3::ZERO,
            tail: DVec3::Y,
        }
    }

    #[test]
    fn parents_come_before_children() {
        let rig =
            Rig::new(vec![joint("c", Some("b")), joint("a", None), joint("b", Some("a"))]).unwrap();
        let names: Vec<&str> = rig.joints().iter().map(|j| &*j.name).collect();
        assert_eq!(names, ["a", "b", "c"]);
        assert_eq!(
            rig.joints().iter().map(|j| j.parent).collect::<Vec<_>>(),
            [None, Some(0), Some(1)]
        );
        assert_eq!([0, 1, 2].map(|i| rig.placed(i).unwrap()), [2, 0, 1]);
    }

    #[test]
    fn broken_rigs_are_refused_by_name() {
        let e = |joints| Rig::new(joints).unwrap_err().to_string();
        assert_eq!(e(vec![]), "a rig has 1 to 4096 joints, not 0");
        assert_eq!(
            e(vec![joint("a", None), joint("a", None)]),
            "two joints of the rig are called `a`"
        );
        assert_eq!(
            e(vec![joint("a", Some("x"))]),
            "joint `a` has the parent `x`, which is not in the rig"
        );
        let round = vec![
            joint("r", None),
            joint("a", Some("c")),
            joint("b", Some("a")),
            joint("c", Some("b")),
        ];
        assert_eq!(e(round), "the rig has a cycle: c -> b -> a -> c");
        assert_eq!(e(vec![joint("a", Some("a"))]), "the rig has a cycle: a -> a");
        let rig = Rig::new(vec![joint("a", None)]).unwrap();
        let e = rig
            .with_keypoints(vec![("nose".into(), "head".into(), DVec3::ZERO)])
            .unwrap_err()
            .to_string();
        assert_eq!(e, "keypoint `nose` is attached to the joint `head`, which is not in the rig");
    }
}
