//! Affine maps that place solids in the world. Arguments are not checked.
//!
//! Invariant: the same arguments give the same bits on every machine (sines and cosines
//! come from `libm`).

use glam::{DAffine3, DMat3, DVec3};
use std::ops::Mul;

/// An affine map p' = T Rz Ry Rx S p, in the order of Kulkarni et al. 2014, section
/// 2.1.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine(pub DAffine3);

impl Affine {
    /// The identity.
    pub const IDENTITY: Affine = Affine(DAffine3::IDENTITY);

    /// Scales along the axes, then rotates about x, y and z (radians), then translates.
    pub fn new(translate: DVec3, rotate: DVec3, scale: DVec3) -> Affine {
        let axis = |angle: f64| (libm::sin(angle), libm::cos(angle));
        let ((sx, cx), (sy, cy), (sz, cz)) = (axis(rotate.x), axis(rotate.y), axis(rotate.z));
        // Rz Ry Rx written out, by columns.
        let x = DVec3::new(cz * cy, sz * cy, -sy);
        let y = DVec3::new(cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx);
        let z = DVec3::new(cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx);
        Affine(DAffine3 {
            matrix3: DMat3::from_cols(x * scale.x, y * scale.y, z * scale.z),
            translation: translate,
        })
    }

    /// Returns the image of a point.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.0.matrix3 * p + self.0.translation
    }

    /// Returns the matrix that transforms normals: the cofactor matrix times the sign of
    /// the determinant, which is the inverse transpose times the absolute determinant.
    /// Outward normals stay outward even if the map mirrors, and the matrix exists even
    /// if the map is singular. The resulting normals are not unit vectors.
    pub fn normal_matrix(&self) -> DMat3 {
        let m = self.0.matrix3;
        let cofactor = DMat3::from_cols(
            m.y_axis.cross(m.z_axis),
            m.z_axis.cross(m.x_axis),
            m.x_axis.cross(m.y_axis),
        );
        if self.is_mirrored() { -1.0 * cofactor } else { cofactor }
    }

    /// True if the map changes handedness.
    pub fn is_mirrored(&self) -> bool {
        self.0.matrix3.determinant() < 0.0
    }

    /// Returns the inverse map, if it exists.
    pub fn inverse(&self) -> Option<Affine> {
        let d = self.0.matrix3.determinant();
        (d != 0.0 && d.is_finite()).then(|| Affine(self.0.inverse())).filter(Affine::is_finite)
    }

    /// True if all components are finite.
    pub fn is_finite(&self) -> bool {
        self.0.is_finite()
    }
}

impl Mul for Affine {
    type Output = Affine;

    /// Composes two maps; the right one applies first.
    fn mul(self, other: Affine) -> Affine {
        Affine(self.0 * other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_scale_turns_shift() {
        let quarter = core::f64::consts::FRAC_PI_2;
        let a = Affine::new(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(quarter, 0.0, quarter),
            DVec3::new(2.0, 3.0, 4.0),
        );
        // (1, 1, 1) is scaled to (2, 3, 4), rotated about x to (2, -4, 3), about z to (4,
        // 2, 3), and translated to (5, 4, 6).
        assert!((a.point(DVec3::ONE) - DVec3::new(5.0, 4.0, 6.0)).length() < 1e-14);
        let rotation = DVec3::new(0.3, -0.7, 1.1);
        let m = Affine::new(DVec3::ZERO, rotation, DVec3::ONE).0.matrix3;
        let expected = DMat3::from_rotation_z(1.1)
            * DMat3::from_rotation_y(-0.7)
            * DMat3::from_rotation_x(0.3);
        assert!((m - expected).to_cols_array().iter().all(|x| x.abs() < 1e-14));
    }

    #[test]
    fn inverse_and_composition() {
        let a = Affine::new(
            DVec3::new(1.0, -2.0, 0.5),
            DVec3::new(0.3, 0.2, -0.5),
            DVec3::new(1.5, 0.5, 2.0),
        );
        let p = DVec3::new(0.3, 0.4, 0.5);
        let back = a.inverse().unwrap() * a;
        assert!((back.point(p) - p).length() < 1e-13);
        assert!(
            Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0)).inverse().is_none()
        );
    }

    #[test]
    fn normals_stay_perpendicular_and_outward() {
        for scale in [DVec3::new(1.0, 3.0, 0.5), DVec3::new(-1.0, 1.0, 2.0)] {
            let a = Affine::new(DVec3::ZERO, DVec3::new(0.4, 1.0, -0.3), scale);
            let (n, t) = (DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.8, -0.6, 0.7));
            let (m, u) = (a.normal_matrix() * n, a.0.matrix3 * t);
            assert!(m.dot(u).abs() < 1e-12);
            assert!(
                m.dot(a.0.matrix3 * n) > 0.0,
                "points the same way as the image of the outside"
            );
        }
    }

    #[test]
    fn products_apply_the_right_one_first() {
        let a = Affine::new(
            DVec3::new(1.0, -2.0, 0.5),
            DVec3::new(0.3, 0.2, -0.5),
            DVec3::new(1.5, 0.5, 2.0),
        );
        let b = Affine::new(
            DVec3::new(0.0, 3.0, 1.0),
            DVec3::new(-1.3, 0.0, 0.8),
            DVec3::new(-1.0, 0.7, 1.1),
        );
        let p = DVec3::new(0.3, 0.4, 0.5);
        assert!(((a * b).point(p) - a.point(b.point(p))).length() < 1e-13);
        assert!(((b * a).point(p) - a.point(b.point(p))).length() > 0.1);
        assert_eq!((a * Affine::IDENTITY, Affine::IDENTITY * a), (a, a));
        let (am, bm) = (a.0.matrix3, b.0.matrix3);
        let by_hand = am * (bm * p + b.0.translation) + a.0.translation;
        assert!(((a * b).point(p) - by_hand).length() < 1e-13);
        assert!((a * b).is_mirrored() && !a.is_mirrored());
    }

    #[test]
    fn normal_matrix_is_the_scaled_inverse_transpose() {
        for scale in [DVec3::new(1.5, 0.5, 2.0), DVec3::new(1.5, -0.5, 2.0)] {
            let a = Affine::new(DVec3::ONE, DVec3::new(0.3, 0.2, -0.5), scale);
            let expected = a.0.matrix3.determinant().abs() * a.0.matrix3.inverse().transpose();
            assert!((a.normal_matrix() - expected).to_cols_array().iter().all(|x| x.abs() < 1e-14));
        }
        // Flattened into the plane y = 0, whose normal remains.
        let flat = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(2.0, 0.0, 3.0));
        assert_eq!(flat.normal_matrix() * DVec3::Y, DVec3::Y * 6.0);
        assert_eq!(flat.normal_matrix() * DVec3::X, DVec3::ZERO);
        assert!(!Affine::new(DVec3::splat(f64::NAN), DVec3::ZERO, DVec3::ONE).is_finite());
    }
}
