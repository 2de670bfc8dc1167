//! Poses: what each joint of a rig does. Plain numbers; how they move a body is the
//! business of `kinematics`.

use crate::geom::GeomError;
use crate::geom::real::{M3, Real, V3};
use glam::{DMat3, DVec3};

/// How a joint turns, about the world's axes through its rest head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// A rotation vector: the axis times the angle in radians.
    Vector(DVec3),
    /// Angles in radians round x, then y, then z: Rz Ry Rx.
    Angles(DVec3),
    /// A rotation matrix.
    Matrix(DMat3),
}

/// What one joint does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPose {
    /// How far its head is pulled, in the mesh's units: a handle, see [`Rules`].
    pub location: DVec3,
    /// How it turns; its descendants turn along.
    pub turn: Turn,
    /// How its bone is scaled along the axes before it turns.
    pub scale: DVec3,
}

impl JointPose {
    /// The rest.
    pub const REST: JointPose =
        JointPose { location: DVec3::ZERO, turn: Turn::Vector(DVec3::ZERO), scale: DVec3::ONE };

    /// A turn by a rotation vector.
    pub fn turned(v: DVec3) -> JointPose {
        JointPose { turn: Turn::Vector(v), ..JointPose::REST }
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
    /// By joint: whether it stops the pull of location handles below it. Joints beyond
    /// the end do not.
    pub stops: Vec<bool>,
    /// Whether a joint's scale acts on its descendants too.
    pub inherit_scale: bool,
}

/// What a joint does, in numbers of a kind.
#[derive(Clone, Copy)]
pub(super) struct Motion<T> {
    pub location: V3<T>,
    pub turn: M3<T>,
    pub scale: V3<T>,
}

impl JointPose {
    /// With a maker of numbers: first the location, then the turn's three (for a matrix,
    /// a small rotation vector applied after it), then the scale.
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
