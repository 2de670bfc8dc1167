//! Where a camera is, from the matrices of other tools.

use crate::geom::FileFrame;
use crate::render::CameraError;
use glam::{DMat3, DMat4, DQuat, DVec3};

/// Position and axes, orthonormal and right-handed, as those of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pub eye: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
}

impl Pose {
    /// The camera at the origin of its own frame: x right, y down, z forward.
    pub fn own_frame() -> Pose {
        Pose { eye: DVec3::ZERO, right: DVec3::X, up: -DVec3::Y, forward: DVec3::Z }
    }

    /// From the map of the world to a camera with x right, y down, z forward (OpenCV).
    pub fn from_world(rotation: DMat3, translation: DVec3) -> Result<Pose, CameraError> {
        let to_world = orthonormal(rotation.transpose())?;
        let eye = -(to_world * translation);
        Pose::sound(Pose {
            eye,
            right: to_world.x_axis,
            up: -to_world.y_axis,
            forward: to_world.z_axis,
        })
    }

    /// From the map of a camera with x right, y up, z backward (OpenGL) to the world.
    pub fn to_world(matrix: DMat4) -> Result<Pose, CameraError> {
        let axes = orthonormal(DMat3::from_mat4(matrix))?;
        let eye = matrix.w_axis.truncate();
        Pose::sound(Pose { eye, right: axes.x_axis, up: axes.y_axis, forward: -axes.z_axis })
    }

    fn sound(self) -> Result<Pose, CameraError> {
        match self.eye.abs().max_element() < 1e12 {
            true => Ok(self),
            false => Err(CameraError::other("the camera's position is not finite")),
        }
    }

    /// The same camera in the scene, if this one is in a file's world.
    pub fn within(&self, world: &FileFrame) -> Pose {
        let turned = |v: DVec3| world.apply(v).normalize();
        Pose {
            eye: world.apply(self.eye),
            right: turned(self.right),
            up: turned(self.up),
            forward: turned(self.forward),
        }
    }
}

/// The rotation of a matrix that is one but for its scale and rounding.
fn orthonormal(m: DMat3) -> Result<DMat3, CameraError> {
    let wrong = |why: &str| Err(CameraError::other(format!("the camera's rotation {why}")));
    let det = m.determinant();
    if !(det.abs() > 1e-12 && det.abs() < 1e12) {
        return wrong("is not a rotation");
    }
    if det < 0.0 {
        return wrong("is a mirror: its determinant is negative");
    }
    let m = m * (1.0 / det.cbrt());
    let off = m.transpose() * m - DMat3::IDENTITY;
    if !(off.to_cols_array().iter().all(|x| x.abs() < 0.02)) {
        return wrong(
            "is not a rotation: its rows are not at right angles, or of different lengths",
        );
    }
    Ok(DMat3::from_quat(DQuat::from_mat3(&m).normalize()))
}
