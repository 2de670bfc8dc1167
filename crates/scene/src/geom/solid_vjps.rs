//! The vector-Jacobian products of placing a solid: only of vertices on which something depends.

use super::{Affine, Instance, Solid, outer};
use glam::{DMat3, DVec3};

/// Derivatives with respect to some vertices, each with the vertex's number. Those of a vertex
/// that is there several times add up.
pub type ByVertex = Vec<(u32, DVec3)>;

/// The vertices of placed meshes by their numbers, from mesh to mesh.
struct Numbered<'a> {
    rest: &'a [Instance],
    /// The number of the first vertex of the first of the rest.
    first: usize,
}

impl Numbered<'_> {
    /// Returns a vertex in world coordinates; `None` if there is none of this number, or of an
    /// earlier mesh than the last one's.
    fn vertex(&mut self, number: usize) -> Option<DVec3> {
        loop {
            let (item, rest) = self.rest.split_first()?;
            let own = number.checked_sub(self.first)?;
            if let Some(p) = item.mesh.positions.get(own) {
                return Some(item.affine.point(p.as_dvec3()));
            }
            self.first += item.mesh.positions.len();
            self.rest = rest;
        }
    }
}

/// Derivatives with respect to the inputs of [`Solid::placed`].
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedGradient {
    /// With respect to the placement's linear part.
    pub linear: DMat3,
    /// With respect to its translation.
    pub shift: DVec3,
    /// With respect to the vertices before placement.
    pub vertices: ByVertex,
    /// With respect to the landmarks before placement.
    pub landmarks: Vec<DVec3>,
}

impl Solid {
    /// Calls a function with each of some vertices in world coordinates, whose numbers come with
    /// something else.
    pub(crate) fn each_of<T>(
        &self,
        numbers: impl IntoIterator<Item = (u32, T)>,
        mut f: impl FnMut(u32, DVec3, T),
    ) {
        let mut numbers = numbers.into_iter().peekable();
        if numbers.peek().is_none() {
            return;
        }
        if let Some(body) = self.body() {
            let vertex = body.vertices();
            for (number, with) in numbers {
                if let Some(at) = vertex(number) {
                    f(number, at, with);
                }
            }
            return;
        }
        let all = || Numbered { rest: self.instances(), first: 0 };
        let mut numbered = all();
        for (number, with) in numbers {
            let mut at = numbered.vertex(number as usize);
            if at.is_none() {
                numbered = all();
                at = numbered.vertex(number as usize);
            }
            if let Some(at) = at {
                f(number, at, with);
            }
        }
    }

    /// The vector-Jacobian product of [`Solid::placed`], given derivatives with respect
    /// to the vertices and landmarks of the placed solid, in world coordinates.
    pub fn vjp_placed(
        &self,
        by: Affine,
        by_vertex: &[(u32, DVec3)],
        by_landmark: &[DVec3],
    ) -> PlacedGradient {
        let (mut linear, mut shift) = (DMat3::ZERO, DVec3::ZERO);
        let back = by.0.matrix3.transpose();
        let mut pull = |p: DVec3, by: &DVec3| {
            linear += outer(*by, p);
            shift += *by;
            back * *by
        };
        let mut vertices = Vec::with_capacity(by_vertex.len());
        let pairs = by_vertex.iter().copied();
        self.each_of(pairs, |number, at, by| vertices.push((number, pull(at, &by))));
        let landmarks =
            self.landmarks().iter().zip(by_landmark).map(|(l, by)| pull(l.position, by)).collect();
        PlacedGradient { linear, shift, vertices, landmarks }
    }

    /// The vector-Jacobian product of [`Solid::centred`], with arguments as in
    /// [`Solid::vjp_placed`]. Returns the derivatives with respect to vertices and
    /// landmarks.
    pub fn vjp_centred(
        &self,
        fit: bool,
        by_vertex: &[(u32, DVec3)],
        by_landmark: &[DVec3],
    ) -> (ByVertex, Vec<DVec3>) {
        let Some(b) = self.bounds() else { return (by_vertex.to_vec(), by_landmark.to_vec()) };
        let (size, centre) = (b.size(), b.centre());
        let half = 0.5 * size.max_element();
        let scale = if fit && half > 0.0 { 1.0 / half } else { 1.0 };
        let by = Affine::new(-scale * centre, DVec3::ZERO, DVec3::splat(scale));
        if !by.is_finite() {
            return (by_vertex.to_vec(), by_landmark.to_vec());
        }
        let PlacedGradient { linear, shift, mut vertices, landmarks } =
            self.vjp_placed(by, by_vertex, by_landmark);
        let by_centre = shift * -scale;
        // The derivative with respect to half the longest edge, through the scale.
        let trace = linear.x_axis.x + linear.y_axis.y + linear.z_axis.z;
        let by_half = if scale == 1.0 / half && fit {
            (shift.dot(centre) - trace) * scale * scale
        } else {
            0.0
        };
        for axis in 0..3 {
            let longest =
                size[axis] == size.max_element() && (0..axis).all(|a| size[a] < size[axis]);
            let by_half = if longest { 0.5 * by_half } else { 0.0 };
            for (end, sign) in [(b.max[axis], 1.0), (b.min[axis], -1.0)] {
                // The first vertex on that side of the box, or the nearest to it.
                let off = |(_, p): &(usize, DVec3)| (p[axis] - end).abs();
                let nearest = self.vertices().enumerate();
                if let Some((v, _)) = nearest.min_by(|a, b| off(a).total_cmp(&off(b))) {
                    let by = 0.5 * by_centre[axis] + sign * by_half;
                    vertices.push((v as u32, DVec3::AXES[axis] * by));
                }
            }
        }
        (vertices, landmarks)
    }
}
