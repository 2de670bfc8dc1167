//! Vector-Jacobian products of shapes and placements: from the vertices of surfaces and
//! landmarks to sizes and profiles.

use super::{LatheArgs, lathe_args, vector};
use crate::scene::SolidValue;
use crate::scene::adjoints::{BySolid, shaped};
use glam::{DMat3, DVec3};
use pcadlang_engine::lang::adjoint::Adjoint;
use pcadlang_engine::lang::builtins::{ArgAdjoints, Args};
use pcadlang_engine::lang::value::Value;
use pcadlang_scene::geom::{Mesh, Profile, Solid, vjp_cuboid, vjp_lathe, vjp_sphere};
use smallvec::smallvec;
use std::sync::Arc;

/// Returns a shape's mesh and the derivatives with respect to its vertices; `None` if
/// nothing depends on them.
fn surface<'a>(made: &'a Value, by: &Adjoint) -> Option<(&'a Mesh, Vec<DVec3>)> {
    let solid = &made.downcast::<SolidValue>()?.0;
    let by = BySolid::read(by, solid);
    if by.vertices.is_empty() {
        return None;
    }
    let mesh = &solid.instances().first()?.mesh;
    Some((mesh, by.each_vertex(mesh.positions.len())))
}

/// For `scene.lathe`.
pub(super) fn lathe(a: &Args, made: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let Some((_, by_vertex)) = surface(made, by) else { return Some(ArgAdjoints::new()) };
    let LatheArgs { profiles, sides, wall, caps, .. } = lathe_args(a).ok()?;
    let g = vjp_lathe(&profiles, sides, wall, caps, &by_vertex).ok()?;
    let parts = match a.get(0) {
        Value::List(all) => {
            Adjoint::List(all.iter().zip(&g.profiles).map(|(v, g)| profile(v, g)).collect())
        }
        one => g.profiles.first().map_or(Adjoint::Zero, |g| profile(one, g)),
    };
    let [thickness, floor] = [g.wall.thickness, g.wall.floor].map(Adjoint::Num);
    Some(smallvec![parts, Adjoint::Zero, thickness, Adjoint::Zero, floor])
}

/// Converts to the shape of a profile's record.
fn profile(v: &Value, by: &Profile) -> Adjoint {
    let Value::Record(fields) = v else { return Adjoint::Zero };
    let one = |(name, v): (&Arc<str>, &Value)| {
        let all = if **name == *"y" { &by.y } else { &by.r };
        let by = match v {
            // One radius for all heights.
            Value::Num(_) => Adjoint::Num(all.iter().sum()),
            Value::Array(xs) if xs.len() < all.len() => Adjoint::Array(vec![all.iter().sum()]),
            _ => Adjoint::Array(all.clone()),
        };
        (Arc::clone(name), by)
    };
    Adjoint::Record(
        fields.iter().filter(|(name, _)| matches!(&***name, "y" | "r")).map(one).collect(),
    )
}

/// For `scene.sphere`.
pub(super) fn sphere(a: &Args, made: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let Some((mesh, by_vertex)) = surface(made, by) else { return Some(ArgAdjoints::new()) };
    Some(smallvec![Adjoint::Num(vjp_sphere(a.num(0).ok()?, mesh, &by_vertex))])
}

/// For `scene.box`.
pub(super) fn cuboid(a: &Args, made: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let Some((mesh, by_vertex)) = surface(made, by) else { return Some(ArgAdjoints::new()) };
    let by_size = vjp_cuboid(vector(a, "size").ok()?, mesh, &by_vertex);
    Some(smallvec![shaped(a.get(0), by_size)])
}

/// For `scene.group`: landmarks and vertices are concatenated in the order of the
/// members.
pub(super) fn group(a: &Args, made: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let BySolid { landmarks, vertices } = BySolid::read(by, &made.downcast::<SolidValue>()?.0);
    let (mut rest, mut first) = (&landmarks[..], 0);
    let mut one = |member: &Value| {
        let solid = &member.downcast::<SolidValue>()?.0;
        let (landmarks, after) = rest.split_at(solid.landmarks().len().min(rest.len()));
        rest = after;
        let mut own = BySolid { landmarks: landmarks.to_vec(), ..BySolid::default() };
        // Counting the vertices would build the meshes.
        if !vertices.is_empty() {
            let past = first + solid.vertex_count() as u32;
            let of_it = vertices.iter().filter(|(v, _)| (first..past).contains(v));
            own.vertices = of_it.map(|(v, by)| (v - first, *by)).collect();
            first = past;
        }
        Some(own.into_adjoint())
    };
    let by_members = match a.get(0) {
        Value::Record(all) => {
            let named = |(name, v): (&Arc<str>, &Value)| Some((Arc::clone(name), one(v)?));
            Adjoint::Record(all.iter().map(named).collect::<Option<_>>()?)
        }
        array => {
            let all = (0..array.len()?).map(|i| one(&array.element(i)?));
            Adjoint::List(all.collect::<Option<_>>()?)
        }
    };
    Some(smallvec![by_members])
}

/// For `scene.centred`: the bounding box moves with the vertices on its sides.
pub(super) fn centred(a: &Args, made: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let by = BySolid::read(by, &made.downcast::<SolidValue>()?.0);
    let solid: &Solid = &a.object::<SolidValue>(0, "a solid").ok()?.0;
    let (vertices, landmarks) = solid.vjp_centred(a.bool("fit").ok()?, &by.vertices, &by.landmarks);
    Some(smallvec![BySolid { landmarks, vertices }.into_adjoint()])
}

/// For `scene.landmarks`.
pub(super) fn landmarks(a: &Args, made: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let BySolid { landmarks, vertices } = BySolid::read(by, &made.downcast::<SolidValue>()?.0);
    let own = a.record(1).ok()?.keys().zip(landmarks);
    let by_points =
        own.map(|(name, g)| (Arc::clone(name), Adjoint::Array(g.to_array().to_vec()))).collect();
    Some(smallvec![
        BySolid { vertices, ..BySolid::default() }.into_adjoint(),
        Adjoint::Record(by_points)
    ])
}

/// For `scene.affine`, T Rz Ry Rx S.
pub(super) fn affine(a: &Args, _: &Value, by: &Adjoint) -> Option<ArgAdjoints> {
    let (turn, scale) = (vector(a, "rotate").ok()?, vector(a, "scale").ok()?);
    let by = by.numbers(12);
    let (linear, shift) = (DMat3::from_cols_slice(&by[..9]), DVec3::from_slice(&by[9..]));
    let turns = [
        DMat3::from_rotation_x(turn.x),
        DMat3::from_rotation_y(turn.y),
        DMat3::from_rotation_z(turn.z),
    ];
    let rotation = turns[2] * turns[1] * turns[0];
    let by_scale: [f64; 3] = std::array::from_fn(|i| rotation.col(i).dot(linear.col(i)));
    // With respect to R: the columns of the linear part are those of R times the scale.
    let by_rotation =
        DMat3::from_cols(linear.x_axis * scale.x, linear.y_axis * scale.y, linear.z_axis * scale.z);
    let by_turn: [f64; 3] = std::array::from_fn(|i| {
        // d R_i(angle) / d angle = [axis]x R_i.
        let axis = DVec3::AXES[i];
        let cross =
            DMat3::from_cols(axis.cross(DVec3::X), axis.cross(DVec3::Y), axis.cross(DVec3::Z));
        let mut moved = turns;
        moved[i] = cross * turns[i];
        let slope = moved[2] * moved[1] * moved[0];
        (0..3).map(|k| slope.col(k).dot(by_rotation.col(k))).sum()
    });
    let like = |i: usize, g: DVec3| shaped(a.get(i), g);
    Some(smallvec![like(0, shift), like(1, by_turn.into()), like(2, by_scale.into())])
}
