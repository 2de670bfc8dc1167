//! Scene values as objects of the language.

use super::adjoints::BySolid;
use glam::{DMat3, DVec3};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::error::Fault;
use pcadlang_engine::lang::index::xyz;
use pcadlang_engine::lang::value::{Object, Value};
use pcadlang_scene::geom::armature::Armature;
use pcadlang_scene::geom::{Affine, Solid, outer};
use pcadlang_scene::render::{Camera, View};
use pcadlang_scene::vision::Lens;
use std::any::Any;
use std::sync::Arc;

/// A solid. Its adjoint is a list of an array and points: the derivatives with respect to each
/// landmark's x, y and z in turn, and to vertices, numbered through its meshes, in world
/// coordinates.
#[derive(Clone, Debug)]
pub struct SolidValue(pub Solid, Remarks);

/// What users should know of how a file was read.
pub type Remarks = Vec<String>;

impl SolidValue {
    /// Creates a solid.
    pub fn new(solid: Solid) -> Self {
        SolidValue(solid, Remarks::new())
    }

    /// Creates a solid that was read from a file.
    pub fn read(solid: Solid, remarks: Remarks) -> Self {
        SolidValue(solid, remarks)
    }
}

impl Object for SolidValue {
    fn type_name(&self) -> &'static str {
        "a solid"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn remark(&self) -> Option<String> {
        (!self.1.is_empty()).then(|| self.1.join("; "))
    }

    fn own_numbers(&self) -> usize {
        self.0.own_numbers()
    }

    fn field(&self, name: &str) -> Option<Value> {
        let bounds = || self.0.bounds();
        match name {
            "size" => bounds().map(|b| Value::array(b.size().to_array())),
            "height" => bounds().map(|b| Value::Num(b.size().y)),
            "landmarks" => Some(Value::Record(Arc::new(
                self.0
                    .landmarks()
                    .iter()
                    .map(|l| (Arc::clone(&l.name), Value::array(l.position.to_array())))
                    .collect(),
            ))),
            _ => None,
        }
    }
}

/// A placement. Its adjoint has twelve numbers: the derivatives with respect to the
/// columns of the linear part and to the translation.
#[derive(Clone, Debug)]
pub struct AffineValue(pub Affine);

impl Object for AffineValue {
    fn type_name(&self) -> &'static str {
        "a placement"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    /// Applies the placement to a solid, or composes it with a placement, of which the
    /// right one acts first.
    fn multiply(&self, other: &Value) -> Option<Result<Value, Fault>> {
        if let Some(s) = other.downcast::<SolidValue>() {
            return Some(Ok(Value::object(SolidValue::new(s.0.placed(self.0)))));
        }
        let other = other.downcast::<AffineValue>()?;
        Some(Ok(Value::object(AffineValue(self.0 * other.0))))
    }

    fn vjp_product(&self, other: &Value, by: &Adjoint) -> Option<[Adjoint; 2]> {
        let a = self.0.0;
        if let Some(s) = other.downcast::<SolidValue>() {
            let by = BySolid::read(by, &s.0);
            let g = s.0.vjp_placed(self.0, &by.vertices, &by.landmarks);
            let inner = BySolid { landmarks: g.landmarks, vertices: g.vertices };
            return Some([affine_adjoint(g.linear, g.shift), inner.into_adjoint()]);
        }
        let b = other.downcast::<AffineValue>()?.0.0;
        let by = by.numbers(12);
        let (linear, shift) = (DMat3::from_cols_slice(&by[..9]), DVec3::from_slice(&by[9..]));
        let left =
            affine_adjoint(linear * b.matrix3.transpose() + outer(shift, b.translation), shift);
        Some([left, affine_adjoint(a.matrix3.transpose() * linear, a.matrix3.transpose() * shift)])
    }

    fn field(&self, name: &str) -> Option<Value> {
        match name {
            "translate" => Some(xyz(self.0.0.translation.to_array())),
            // The direction of the object's own y axis.
            "axis" => Some(xyz(self.0.0.matrix3.y_axis.normalize_or_zero().to_array())),
            _ => None,
        }
    }
}

pub(super) fn affine_adjoint(linear: DMat3, shift: DVec3) -> Adjoint {
    Adjoint::Array(linear.to_cols_array().into_iter().chain(shift.to_array()).collect())
}

/// An armature: a rig with its mesh. Its adjoint is a list of three arrays and points: the
/// derivatives with respect to the rest positions of the joints' heads, their tails, the
/// keypoints and vertices.
#[derive(Clone, Debug)]
pub struct ArmatureValue(pub Arc<Armature>, Remarks);

impl ArmatureValue {
    /// Creates an armature.
    pub fn new(body: Armature) -> Self {
        ArmatureValue(Arc::new(body), Remarks::new())
    }

    /// Creates an armature that was read from a file.
    pub fn read(body: Armature, remarks: Remarks) -> Self {
        ArmatureValue(Arc::new(body), remarks)
    }
}

impl Object for ArmatureValue {
    fn type_name(&self) -> &'static str {
        "an armature"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn remark(&self) -> Option<String> {
        (!self.1.is_empty()).then(|| self.1.join("; "))
    }

    fn field(&self, name: &str) -> Option<Value> {
        let names =
            |names: &mut dyn Iterator<Item = &str>| Value::List(names.map(Value::str).collect());
        let rig = self.0.rig();
        match name {
            "joints" => Some(names(&mut rig.joints().iter().map(|j| &*j.name))),
            "keypoints" => Some(names(&mut rig.keypoints().iter().map(|k| &*k.name))),
            "morphs" => Some(names(&mut self.0.morphs())),
            _ => None,
        }
    }

    fn summary(&self) -> Option<String> {
        let (joints, triangles) = (self.0.rig().joints().len(), self.0.triangles().len());
        Some(format!("{joints} joints, {triangles} triangles"))
    }
}

/// A camera; with the lens by which photographs are undistorted to suit it, if it is the run's.
#[derive(Clone, Debug)]
pub struct CameraValue(pub Camera, pub(super) Option<Lens>);

impl CameraValue {
    /// Creates a camera whose photographs need no undistortion.
    pub fn new(camera: Camera) -> Self {
        CameraValue(camera, None)
    }
}

impl Object for CameraValue {
    fn type_name(&self) -> &'static str {
        "a camera"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn field(&self, name: &str) -> Option<Value> {
        (name == "position").then(|| xyz(self.0.eye.to_array()))
    }

    fn summary(&self) -> Option<String> {
        Some(format!("{} x {} pixels", self.0.width, self.0.height))
    }
}

/// A solid in front of a camera. Its adjoint is that of the solid.
#[derive(Clone, Debug)]
pub struct ViewValue(pub Arc<View>);

impl Object for ViewValue {
    fn type_name(&self) -> &'static str {
        "a view"
    }

    fn as_any(&self) -> &dyn Any {
        self
    }

    fn field(&self, name: &str) -> Option<Value> {
        match name {
            "solid" => Some(Value::object(SolidValue::new(self.0.solid().clone()))),
            "camera" => Some(Value::object(CameraValue::new(*self.0.camera()))),
            _ => None,
        }
    }
}
