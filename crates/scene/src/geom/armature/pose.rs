//! Poses: the motion of each joint of a rig, as plain numbers. `kinematics` turns them
//! into transforms.

use crate::geom::GeomError;
use crate::geom::real::{M3, Real, V3};
use glam::{DMat3, DVec3};

/// The rotation of a joint, about the world's axes through its rest head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// A rotation vector: the axis times the angle in radians.
    Vector(DVec3),
    /// Angles in radians about x, then y, then z: Rz Ry Rx.
    Angles(DVec3),
    /// A rotation matrix.
    Matrix(DMat3),
}

/// The pose of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPose {
    /// How far a handle pulls the joint's head, in the mesh's units; see [`Rules`].
    pub location: DVec3,
    /// The rotation, which also rotates the joint's descendants.
    pub turn: Turn,
    /// The scale of the bone along the axes, applied before the rotation.
    pub scale: DVec3,
}

impl JointPose {
    /// The rest pose.
    pub const REST: JointPose =
        JointPose { location: DVec3::ZERO, turn: Turn::Vector(DVec3::ZERO), scale: DVec3::ONE };

    /// A rotation by a rotation vector.
    pub fn turned(v: DVec3) -> JointPose {
        JointPose { turn: Turn::Vector(v), ..JointPose::REST }
    }

    /// True if the joint is neither pulled nor scaled.
    pub(super) fn only_turns(&self) -> bool {
        self.location == DVec3::ZERO && self.scale == DVec3::ONE
    }

    /// The rotation as a matrix of plain numbers.
    pub(super) fn rotation(&self) -> M3<f64> {
        self.motion(|x| x).turn
    }

    pub(super) fn check(&self, name: &str) -> Result<(), GeomError> {
        let turn = match self.turn {
            Turn::Vector(v) | Turn::Angles(v) => v.is_finite(),
            Turn::Matrix(m) => m.is_finite(),
        };
        if turn && self.location.is_finite() && self.scale.is_finite() {
            return Ok(());
        }
        Err(GeomError::domain(format!("the pose of the joint `{name}` must be finite")))
    }
}

/// How poses move a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rules {
    /// For each joint, whether it stops the pull of location handles below it. Joints
    /// beyond the end of the list do not.
    pub stops: Vec<bool>,
    /// True if a joint's scale also acts on its descendants.
    pub inherit_scale: bool,
}

/// The motion of a joint, in numbers of type `T`.
#[derive(Clone, Copy)]
pub(super) struct Motion<T> {
    pub location: V3<T>,
    pub turn: M3<T>,
    pub scale: V3<T>,
}

impl JointPose {
    /// Returns the motion, with components made by `number` in this order: the location,
    /// the three of the rotation (for a matrix, a small rotation vector applied after
    /// it), the scale.
    pub(super) fn motion<T: Real>(&self, mut number: impl FnMut(f64) -> T) -> Motion<T> {
        let mut vector = |v: DVec3| V3(v.to_array().map(&mut number));
        let location = vector(self.location);
        let turn = match self.turn {
            Turn::Vector(v) => M3::from_rotation_vector(vector(v)),
            Turn::Angles(v) => M3::from_angles(vector(v)),
            Turn::Matrix(m) => {
                let small = vector(DVec3::ZERO);
                let constant = M3(m
                    .transpose()
                    .to_cols_array_2d()
                    .map(|row| row.map(|x| small.0[0].constant(x))));
                M3::from_rotation_vector(small).times(constant)
            }
        };
        Motion { location, turn, scale: vector(self.scale) }
    }
}
