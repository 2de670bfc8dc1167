//! Forward kinematics: from a pose to the transform of each joint.
//!
//! M[j] = M[parent] T(head + d) R S T(-head), as transforms of points at rest. R rotates
//! the whole subtree; S acts on the bone's own region, and on the subtree only if
//! [`Rules`] say so. A location t is a *handle*: in rig order, for a joint b with t != 0,
//! one sweep goes over its ancestors a, from its parent to the nearest stop (included) or
//! the root. It rotates each, with its subtree, by 1 / (number of those ancestors) of the
//! shortest arc from (p_b - p_a) to (p_b + t - p_a). The remainder becomes d, so that the
//! head of b ends at p_b + t. Positions p are those of the pose so far.
//!
//! A pure function of the pose: it is never iterated to convergence, and t = 0 changes
//! nothing. It is smooth, except where a handle is pulled straight through an ancestor.

use super::pose::Motion;
use super::{JointPose, Rig, Rules};
use crate::geom::GeomError;
use crate::geom::real::{M3, Real, Tape, V3, Var};
use glam::{DAffine3, DMat3, DVec3};

/// The transform of a joint: p' = linear p + shift.
#[derive(Clone, Copy)]
pub(super) struct Place<T> {
    pub linear: M3<T>,
    pub shift: V3<T>,
}

impl<T: Real> Place<T> {
    fn point(&self, p: V3<T>) -> V3<T> {
        self.linear.apply(p) + self.shift
    }
}

/// Derivatives with respect to one joint's pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointGradient {
    /// With respect to the location.
    pub location: DVec3,
    /// With respect to the rotation vector or the angles; for a matrix, to a small
    /// rotation vector applied after it.
    pub turn: DVec3,
    /// With respect to the scale.
    pub scale: DVec3,
}

impl Rig {
    /// Returns the transform of points at rest for each joint, in rig order. Joints
    /// beyond the end of `pose` are at rest.
    ///
    /// # Errors
    /// A pose that is not finite.
    pub fn transforms(
        &self,
        pose: &[JointPose],
        rules: &Rules,
    ) -> Result<Vec<DAffine3>, GeomError> {
        if !rules.inherit_scale && pose.iter().all(JointPose::only_turns) {
            return self.turned(pose);
        }
        let motions = self.motions(pose, |x| x)?;
        let places = places(self, motions, rules, false);
        let affine = |p: &Place<f64>| DAffine3 {
            matrix3: DMat3::from_cols_array_2d(&p.linear.transposed().0),
            translation: DVec3::from_array(p.shift.0),
        };
        Ok(places.iter().map(affine).collect())
    }

    /// The transforms of a pose in which joints only turn, as [`places`] has them to the
    /// last bit, without its lists.
    fn turned(&self, pose: &[JointPose]) -> Result<Vec<DAffine3>, GeomError> {
        let mut unscaled: Vec<Place<f64>> = Vec::with_capacity(self.joints().len());
        let mut transforms = Vec::with_capacity(self.joints().len());
        for (j, joint) in self.joints().iter().enumerate() {
            let p = pose.get(j).unwrap_or(&JointPose::REST);
            p.check(&joint.name)?;
            // Where no handle pulls the head, 0 is added to it.
            let (head, to) = (V3(joint.head.to_array()), V3((joint.head + DVec3::ZERO).to_array()));
            let own = p.rotation();
            let (linear, fixed) = match joint.parent {
                Some(up) => (unscaled[up].linear.times(own), unscaled[up].point(to)),
                None => (own, to),
            };
            let place = Place { linear, shift: fixed - linear.apply(head) };
            let shift = place.point(head) - linear.apply(head);
            transforms.push(DAffine3 {
                matrix3: DMat3::from_cols_array_2d(&linear.transposed().0),
                translation: DVec3::from_array(shift.0),
            });
            unscaled.push(place);
        }
        Ok(transforms)
    }

    /// The vector-Jacobian product of [`Rig::transforms`]: pulls derivatives with respect
    /// to each transform (matrix and translation) back to the pose.
    ///
    /// # Errors
    /// A pose that is not finite.
    pub fn transforms_vjp(
        &self,
        pose: &[JointPose],
        rules: &Rules,
        by_transform: &[DAffine3],
    ) -> Result<Vec<JointGradient>, GeomError> {
        let tape = Tape::default();
        let mut inputs: Vec<Var> = Vec::with_capacity(self.joints().len() * 9);
        let motions = self.motions(pose, |x| {
            let v = tape.variable(x);
            inputs.push(v);
            v
        })?;
        let places = places(self, motions, rules, true);
        let outputs = places.iter().zip(by_transform).flat_map(|(p, g)| {
            let linear =
                p.linear.transposed().0.concat().into_iter().zip(g.matrix3.to_cols_array());
            linear.chain(p.shift.0.into_iter().zip(g.translation.to_array())).collect::<Vec<_>>()
        });
        let slopes = tape.reverse(outputs);
        let mut numbers = inputs.iter().map(|v| slopes[v.index()]);
        let mut vector = || DVec3::from_array([(); 3].map(|()| numbers.next().unwrap_or(0.0)));
        let one = |_| JointGradient { location: vector(), turn: vector(), scale: vector() };
        Ok((0..self.joints().len()).map(one).collect())
    }

    fn motions<T: Real>(
        &self,
        pose: &[JointPose],
        mut number: impl FnMut(f64) -> T,
    ) -> Result<Vec<Motion<T>>, GeomError> {
        let mut motions = Vec::with_capacity(self.joints().len());
        for (i, joint) in self.joints().iter().enumerate() {
            let p = pose.get(i).copied().unwrap_or(JointPose::REST);
            p.check(&joint.name)?;
            motions.push(p.motion(&mut number));
        }
        Ok(motions)
    }
}

/// Returns the transforms. With `all`, handles with t = 0 are run too, for their
/// derivatives.
fn places<T: Real>(
    rig: &Rig,
    mut motions: Vec<Motion<T>>,
    rules: &Rules,
    all: bool,
) -> Vec<Place<T>> {
    let Some(zero) = motions.first().map(|m| m.location.0[0].constant(0.0)) else {
        return Vec::new();
    };
    let vector = |v: DVec3| V3(v.to_array().map(|x| zero.constant(x)));
    let heads: Vec<V3<T>> = rig.joints().iter().map(|j| vector(j.head)).collect();
    let mut pulled = vec![V3([zero; 3]); motions.len()];
    let mut chain = Vec::new();
    let unscaled =
        |motions: &[Motion<T>], pulled: &[V3<T>]| forward(rig, &heads, motions, pulled, |m| m.turn);
    let mut now = unscaled(&motions, &pulled);
    for b in 0..motions.len() {
        let t = motions[b].location;
        if t.is_zero() && !all {
            continue;
        }
        chain.clear();
        let mut at = rig.joints()[b].parent;
        while let Some(a) = at {
            chain.push(a);
            at = if rules.stops.get(a) == Some(&true) { None } else { rig.joints()[a].parent };
        }
        let mut p = now[b].point(heads[b]);
        let target = p + t;
        for a in &chain {
            let pivot = now[*a].point(heads[*a]);
            let q = part_of_arc(p - pivot, target - pivot, 1.0 / chain.len() as f64);
            p = pivot + q.apply(p - pivot);
            // The rotation in the frame of the parent, which this sweep has not moved
            // yet.
            let local = rig.joints()[*a].parent.map_or(q, |up| {
                let w = now[up].linear;
                w.transposed().times(q).times(w)
            });
            motions[*a].turn = local.times(motions[*a].turn);
        }
        now = unscaled(&motions, &pulled);
        let left = target - now[b].point(heads[b]);
        pulled[b] =
            rig.joints()[b].parent.map_or(left, |up| now[up].linear.transposed().apply(left));
        now = unscaled(&motions, &pulled);
    }
    if rules.inherit_scale {
        return forward(rig, &heads, &motions, &pulled, |m| m.turn.scaled(m.scale));
    }
    let mut places = now;
    for ((place, m), head) in places.iter_mut().zip(&motions).zip(&heads) {
        let fixed = place.point(*head);
        place.linear = place.linear.scaled(m.scale);
        place.shift = fixed - place.linear.apply(*head);
    }
    places
}

/// Composes the transforms along the tree, given each joint's own linear map.
fn forward<T: Real>(
    rig: &Rig,
    heads: &[V3<T>],
    motions: &[Motion<T>],
    pulled: &[V3<T>],
    own: impl Fn(&Motion<T>) -> M3<T>,
) -> Vec<Place<T>> {
    let mut places: Vec<Place<T>> = Vec::with_capacity(motions.len());
    for (j, m) in motions.iter().enumerate() {
        let (head, own) = (heads[j], own(m));
        let to = head + pulled[j];
        let (linear, fixed) = match rig.joints()[j].parent {
            Some(up) => (places[up].linear.times(own), places[up].point(to)),
            None => (own, to),
        };
        places.push(Place { linear, shift: fixed - linear.apply(head) });
    }
    places
}

/// Returns the rotation by a fraction of the shortest arc from the direction of u to that
/// of v.
fn part_of_arc<T: Real>(u: V3<T>, v: V3<T>, share: f64) -> M3<T> {
    // Only directions matter: lengths near 1 keep squares from overflowing. The scaling
    // does not change the derivatives.
    let unit = |v: V3<T>| {
        let longest = v.0.iter().fold(0.0, |m: f64, x| m.max(x.value().abs()));
        if longest > 0.0 && longest.is_finite() {
            v.scale(v.0[0].constant(1.0 / longest))
        } else {
            v
        }
    };
    let (u, v) = (unit(u), unit(v));
    let (w, c) = (u.cross(v), u.dot(v));
    let square = w.dot(w);
    let (s2, cv) = (square.value(), c.value());
    let vector = if s2 > 1e-16 * cv * cv {
        let s = square.sqrt();
        w.scale(s.atan2(c) * s.recip() * c.constant(share))
    } else if cv > 0.0 {
        // angle / sin -> 1 / cos.
        w.scale(c.recip() * c.constant(share))
    } else if cv < 0.0 {
        // Opposite directions: rotate about a fixed axis perpendicular to u.
        let axis = DVec3::from_array(u.0.map(Real::value)).any_orthonormal_vector()
            * (std::f64::consts::PI * share);
        V3(axis.to_array().map(|x| c.constant(x)))
    } else {
        w
    };
    M3::from_rotation_vector(vector)
}

#[cfg(test)]
#[path = "kinematics_tests.rs"]
mod tests;
