//! Solids: meshes placed in the world, alone or in groups, and their landmarks. Meshes
//! are shared, so solids are cheap to clone and move.
//!
//! A solid is not a volume: members may overlap, and nothing is cut or merged.
//! Invariants: a member's parts are numbered after those of the members before it
//! (numbers beyond 65534 are all drawn as that one); all landmarks have different names.

use super::detail::{Coarse, Detail};
use super::landmark::{Landmark, unique};
use super::mesh::{MOST_PARTS, MOST_TRIANGLES};
use super::posed_skin::PosedSkin;
use super::{Affine, Bounds, Edge, Edges, GeomError, Mesh, NO_FACE, Topology, outer};
use glam::{DMat3, DVec3};
use std::fmt;
use std::ops::Deref;
use std::sync::{Arc, LazyLock, Weak};

/// A placed mesh.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// The placement.
    pub affine: Affine,
    /// The offset added to its part numbers.
    pub first_part: u16,
    /// Coarser versions of the mesh, if it has any.
    pub detail: Option<Arc<Detail>>,
    /// The body it is a part of, if it is the part of a posed one.
    pub skin: Option<PosedSkin>,
}

impl Instance {
    /// Returns the coarsest version of the mesh that is within `error` (in the mesh's
    /// units) of every vertex it omits; `None` if that is the mesh itself.
    pub fn coarse(&self, error: f64) -> Option<Arc<Coarse>> {
        self.detail.as_ref()?.within(&self.mesh, error)
    }

    /// Returns the centre and radius of a ball around the mesh, in world coordinates;
    /// `None` if it has no coarser versions.
    pub fn ball(&self) -> Option<(DVec3, f64)> {
        let (centre, radius) = self.detail.as_ref()?.ball(&self.mesh);
        Some((self.affine.point(centre), radius * self.affine.stretch()))
    }
}

/// A list that is computed on first use.
type Lazy<T> = LazyLock<Arc<[T]>, Box<dyn FnOnce() -> Arc<[T]> + Send>>;

/// Placed meshes.
#[derive(Clone)]
pub struct Solid {
    instances: Meshes,
    /// The members, if the solid is a group.
    group: Option<Arc<Group>>,
    landmarks: Arc<Lazy<Landmark>>,
    /// The depth of nested lists that have not been computed yet.
    lazy_depth: u32,
}

/// The members of a group.
struct Group {
    lists: Box<[Meshes]>,
    /// The number of meshes in all lists.
    count: usize,
}

/// An immutable list of placed meshes, shared by the solids that contain it.
#[derive(Clone)]
pub(crate) struct Meshes(Arc<Lazy<Instance>>);

/// Identifies a list of meshes, even after it has been dropped.
pub(crate) struct MeshesMark(Weak<Lazy<Instance>>);

impl Meshes {
    /// Returns a mark that identifies this list.
    pub fn mark(&self) -> MeshesMark {
        MeshesMark(Arc::downgrade(&self.0))
    }

    /// Whether the mark identifies this list.
    pub fn is(&self, mark: &MeshesMark) -> bool {
        std::ptr::eq(mark.0.as_ptr(), Arc::as_ptr(&self.0))
    }

    /// The number of part numbers in use.
    fn part_count(&self) -> u16 {
        let after = |i: &Instance| i.first_part.saturating_add(i.mesh.topology.part_count);
        self.iter().map(after).max().unwrap_or(0)
    }
}

impl Deref for Meshes {
    type Target = [Instance];

    fn deref(&self) -> &[Instance] {
        &self.0
    }
}

/// The maximum depth of uncomputed lists, which bounds the recursion when they are
/// computed.
const MOST_WAITING: u32 = 64;

impl fmt::Debug for Solid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Solid")
            .field("instances", &self.instances())
            .field("landmarks", &self.landmarks())
            .finish()
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
    pub vertices: Vec<DVec3>,
    /// With respect to the landmarks before placement.
    pub landmarks: Vec<DVec3>,
}

/// Returns a list that is computed on first use.
fn later<T: 'static>(make: impl FnOnce() -> Arc<[T]> + Send + 'static) -> Arc<Lazy<T>> {
    Arc::new(LazyLock::new(Box::new(make)))
}

/// Returns a list that is already computed.
fn ready<T: Send + Sync + 'static>(list: Arc<[T]>) -> Arc<Lazy<T>> {
    let lazy = later(|| list);
    LazyLock::force(&lazy);
    lazy
}

impl Solid {
    /// A solid of one mesh, placed by the identity.
    pub fn new(mesh: Arc<Mesh>) -> Solid {
        Solid::of(Arc::new([Instance {
            mesh,
            affine: Affine::IDENTITY,
            first_part: 0,
            detail: None,
            skin: None,
        }]))
    }

    /// A mesh that will be drawn many times, such as a file's. Its coarser versions are
    /// computed when a view first needs one, once for all placements of the solid (in
    /// about a second for 100,000 triangles).
    pub fn lasting(mesh: Mesh) -> Solid {
        Solid::detailed(mesh, Detail::rigid())
    }

    /// A solid of one mesh with coarser versions.
    pub(super) fn detailed(mesh: Mesh, detail: Detail) -> Solid {
        let (mesh, detail) = (Arc::new(mesh), Some(Arc::new(detail)));
        let (affine, first_part, skin) = (Affine::IDENTITY, 0, None);
        Solid::of(Arc::new([Instance { mesh, affine, first_part, detail, skin }]))
    }

    /// A solid of placed meshes, without landmarks.
    pub fn of(instances: Arc<[Instance]>) -> Solid {
        Solid {
            instances: Meshes(ready(instances)),
            group: None,
            landmarks: ready(Arc::default()),
            lazy_depth: 0,
        }
    }

    /// Replaces the landmarks (in world coordinates); repeated names get `#2`, `#3`, …
    /// appended.
    #[must_use]
    pub fn with_landmarks(self, landmarks: impl Into<Arc<[Landmark]>>) -> Solid {
        Solid { landmarks: ready(unique(landmarks.into().iter().cloned())), ..self }
    }

    /// As [`Solid::with_landmarks`], with landmarks computed on first use.
    #[must_use]
    pub fn with_landmarks_of<L>(self, make: impl FnOnce() -> L + Send + 'static) -> Solid
    where
        L: IntoIterator<Item = Landmark>,
    {
        Solid { landmarks: later(move || unique(make())), ..self }
    }

    /// The landmarks, in world coordinates.
    pub fn landmarks(&self) -> &[Landmark] {
        &self.landmarks
    }

    /// A solid of placed meshes that are computed on first use, which saves the work if
    /// only landmarks matter.
    pub fn of_parts<M>(make: impl FnOnce() -> M + Send + 'static) -> Solid
    where
        M: IntoIterator<Item = Instance>,
    {
        let instances = Meshes(later(move || make().into_iter().collect()));
        Solid { instances, group: None, landmarks: ready(Arc::default()), lazy_depth: 1 }
    }

    /// The placed meshes.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Returns the solid moved by an affine map.
    pub fn placed(&self, by: Affine) -> Solid {
        let of = self.instances.clone();
        let placed =
            move || of.iter().map(|i| Instance { affine: by * i.affine, ..i.clone() }).collect();
        let of = Arc::clone(&self.landmarks);
        let moved = move || {
            of.iter().map(|l| Landmark { position: by.point(l.position), ..l.clone() }).collect()
        };
        let (instances, landmarks) = (Meshes(later(placed)), later(moved));
        Solid { instances, group: None, landmarks, lazy_depth: self.lazy_depth + 1 }
            .forced_if_deep()
    }

    /// Computes the lists now if they are nested too deeply.
    fn forced_if_deep(mut self) -> Solid {
        if self.lazy_depth >= MOST_WAITING {
            LazyLock::force(&self.instances.0);
            LazyLock::force(&self.landmarks);
            self.lazy_depth = 0;
        }
        self
    }

    /// Estimates the count of numbers in meshes that no other solid shares; 0 if they are
    /// not computed yet.
    pub fn own_numbers(&self) -> usize {
        if self.lazy_depth > 0 {
            return 0;
        }
        let own = self.instances.iter().filter(|i| Arc::strong_count(&i.mesh) == 1);
        own.map(|i| 3 * i.mesh.positions.len() + 5 * i.mesh.topology.triangles.len()).sum()
    }

    /// Groups solids. Their parts are numbered consecutively, and their landmarks are
    /// concatenated.
    pub fn group(solids: &[Solid]) -> Solid {
        let lists: Box<[Meshes]> = solids.iter().map(|s| s.instances.clone()).collect();
        let group = Arc::new(Group { lists, count: solids.iter().map(Solid::mesh_count).sum() });
        let of = Arc::clone(&group);
        let instances = Meshes(later(move || {
            let (mut first, mut instances) = (0u16, Vec::with_capacity(of.count));
            for list in &of.lists {
                let numbered = |i: &Instance| Instance {
                    first_part: first.saturating_add(i.first_part),
                    ..i.clone()
                };
                instances.extend(list.iter().map(numbered));
                first = first.saturating_add(list.part_count());
            }
            instances.into()
        }));
        let of: Vec<_> = solids.iter().map(|s| Arc::clone(&s.landmarks)).collect();
        let landmarks =
            later(move || unique(of.iter().flat_map(|landmarks| landmarks.iter().cloned())));
        let lazy_depth = solids.iter().map(|s| s.lazy_depth).max().unwrap_or(0) + 1;
        Solid { instances, group: Some(group), landmarks, lazy_depth }.forced_if_deep()
    }

    /// The number of meshes.
    pub fn mesh_count(&self) -> usize {
        self.group.as_ref().map_or_else(|| self.instances().len(), |group| group.count)
    }

    /// The meshes in order, as the lists of the group's members. Each list has its own
    /// part numbers.
    pub(crate) fn lists(&self) -> impl Iterator<Item = &Meshes> {
        self.group
            .as_ref()
            .map_or(std::slice::from_ref(&self.instances), |group| &group.lists)
            .iter()
    }

    /// The number of parts.
    pub fn part_count(&self) -> u16 {
        self.instances.part_count()
    }

    /// Returns the bounding box of all vertices; `None` if there are none.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::around(self.vertices())
    }

    /// Returns the solid translated so that the centre of its bounding box is the origin;
    /// with `fit`, also scaled so that half the box's longest edge is 1. If that
    /// placement is not finite, the solid is unchanged.
    pub fn centred(&self, fit: bool) -> Solid {
        let Some(b) = self.bounds() else { return self.clone() };
        let half = 0.5 * b.size().max_element();
        let scale = if fit && half > 0.0 { 1.0 / half } else { 1.0 };
        let by = Affine::new(-scale * b.centre(), DVec3::ZERO, DVec3::splat(scale));
        if by.is_finite() { self.placed(by) } else { self.clone() }
    }

    /// The number of vertices of all its meshes.
    pub fn vertex_count(&self) -> usize {
        self.instances.iter().map(|i| i.mesh.positions.len()).sum()
    }

    /// The vertices of all its meshes in order, in world coordinates.
    pub fn vertices(&self) -> impl Iterator<Item = DVec3> {
        self.instances
            .iter()
            .flat_map(|i| i.mesh.positions.iter().map(|p| i.affine.point(p.as_dvec3())))
    }

    /// The vector-Jacobian product of [`Solid::placed`], given derivatives with respect
    /// to the vertices and landmarks of the placed solid, in world coordinates.
    /// `by_vertex` is empty if nothing depends on the vertices.
    pub fn vjp_placed(
        &self,
        by: Affine,
        by_vertex: &[DVec3],
        by_landmark: &[DVec3],
    ) -> PlacedGradient {
        let (mut linear, mut shift) = (DMat3::ZERO, DVec3::ZERO);
        let back = by.0.matrix3.transpose();
        let mut pull = |p: DVec3, by: &DVec3| {
            // Most vertices are not on a contour.
            if *by == DVec3::ZERO {
                return DVec3::ZERO;
            }
            linear += outer(*by, p);
            shift += *by;
            back * *by
        };
        let vertices = if by_vertex.is_empty() {
            Vec::new()
        } else {
            self.vertices().zip(by_vertex).map(|(p, by)| pull(p, by)).collect()
        };
        let landmarks =
            self.landmarks.iter().zip(by_landmark).map(|(l, by)| pull(l.position, by)).collect();
        PlacedGradient { linear, shift, vertices, landmarks }
    }

    /// The vector-Jacobian product of [`Solid::centred`], with arguments as in
    /// [`Solid::vjp_placed`]. Returns the derivatives with respect to vertices and
    /// landmarks.
    pub fn vjp_centred(
        &self,
        fit: bool,
        by_vertex: &[DVec3],
        by_landmark: &[DVec3],
    ) -> (Vec<DVec3>, Vec<DVec3>) {
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
        vertices.resize(self.vertex_count(), DVec3::ZERO);
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
                // The first vertex on that side of the box.
                if let Some(v) = self.vertices().position(|p| p[axis] == end) {
                    vertices[v][axis] += 0.5 * by_centre[axis] + sign * by_half;
                }
            }
        }
        (vertices, landmarks)
    }

    /// Returns one mesh in world coordinates, for export: the faces, normals and creases
    /// of all members, in order. If a placement flattens faces, the mesh is rebuilt from
    /// the remaining ones.
    ///
    /// # Errors
    /// As [`Mesh::new`].
    pub fn to_mesh(&self) -> Result<Mesh, GeomError> {
        let count: usize = self.instances.iter().map(|i| i.mesh.topology.triangles.len()).sum();
        if count > MOST_TRIANGLES {
            return Err(GeomError::invalid(format!(
                "the solid has {count} triangles; at most {MOST_TRIANGLES} are allowed in one mesh"
            )));
        }
        let (mut positions, mut normals, mut t) = (Vec::new(), Vec::new(), Topology::default());
        let mut edges = Vec::new();
        for i in self.instances.iter() {
            let (first, first_face) = (positions.len() as u32, t.triangles.len() as u32);
            let turn = i.affine.normal_matrix();
            // If the mesh is squashed to a line or point, normals have no image; any one
            // will do.
            let normal = |n: &glam::Vec3| (turn * n.as_dvec3()).normalize_or(DVec3::Y).as_vec3();
            positions
                .extend(i.mesh.positions.iter().map(|p| i.affine.point(p.as_dvec3()).as_vec3()));
            normals.extend(i.mesh.normals.iter().map(normal));
            let mirrored = i.affine.is_mirrored();
            t.triangles.extend(i.mesh.topology.triangles.iter().map(|face| {
                let [a, b, c] = face.map(|v| v + first);
                if mirrored { [a, c, b] } else { [a, b, c] }
            }));
            let last_part = (MOST_PARTS - 1) as u16;
            t.parts.extend(
                i.mesh.topology.parts.iter().map(|p| p.saturating_add(i.first_part).min(last_part)),
            );
            edges.extend(i.mesh.topology.edges.iter().map(|e| {
                let [a, b] = e.vertices.map(|v| v + first);
                let faces = e.faces.map(|f| if f == NO_FACE { NO_FACE } else { f + first_face });
                Edge { vertices: if mirrored { [b, a] } else { [a, b] }, faces, crease: e.crease }
            }));
        }
        t.edges = Edges::new(edges);
        t.part_count = self.part_count();
        for i in self.instances.iter() {
            let first = usize::from(i.first_part);
            for (k, name) in
                i.mesh.topology.part_names.iter().enumerate().filter(|(_, n)| !n.is_empty())
            {
                let at = (first + k).min(MOST_PARTS - 1);
                t.part_names.resize(t.part_names.len().max(at + 1), Arc::from(""));
                t.part_names[at] = Arc::clone(name);
            }
        }
        let whole = |face: &[u32; 3]| {
            let p = face.map(|v| positions[v as usize].as_dvec3());
            (p[1] - p[0]).cross(p[2] - p[0]).length_squared() > 0.0
        };
        // Also false if a coordinate is not finite, which `Mesh::new` then reports.
        if t.triangles.is_empty()
            || !t.triangles.iter().all(whole)
            || !positions.iter().all(|p| p.is_finite())
        {
            let mut mesh = Mesh::new(positions, t.triangles, t.parts)?;
            Arc::make_mut(&mut mesh.topology).part_names = t.part_names;
            return Ok(mesh);
        }
        Ok(Mesh { positions, normals, topology: Arc::new(t) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{cuboid, sphere};

    #[test]
    fn groups_and_centring() {
        let a = Solid::new(Arc::new(cuboid(DVec3::new(1.0, 4.0, 2.0)).unwrap()));
        let b = Solid::new(Arc::new(sphere(1.0, 16).unwrap()));
        let shift = Affine::new(DVec3::new(3.0, 0.0, 0.0), DVec3::ZERO, DVec3::ONE);
        let g = Solid::group(&[a.clone(), b.placed(shift)]);
        assert_eq!((g.instances().len(), g.part_count()), (2, 2));
        let bounds = g.bounds().unwrap();
        assert!((bounds.max - DVec3::new(4.0, 2.0, 1.0)).length() < 1e-5);
        let c = g.centred(true).bounds().unwrap();
        assert!(c.centre().length() < 1e-6);
        assert!((c.size().max_element() - 2.0).abs() < 1e-6);
        let m = g.to_mesh().unwrap();
        assert_eq!(m.topology.triangles.len(), 12 + b.instances()[0].mesh.topology.triangles.len());
        assert_eq!(m.topology.part_count, 2);
    }

    fn block(size: DVec3) -> Solid {
        Solid::new(Arc::new(cuboid(size).unwrap()))
    }

    #[test]
    fn centring_without_fit_keeps_sizes_and_survives_extremes() {
        let shift = Affine::new(DVec3::new(3.0, -5.0, 0.25), DVec3::new(0.3, 0.0, 0.0), DVec3::ONE);
        let s = block(DVec3::new(1.0, 4.0, 2.0)).placed(shift);
        let (before, after) = (s.bounds().unwrap(), s.centred(false).bounds().unwrap());
        assert!(after.centre().length() < 1e-12 && (after.size() - before.size()).length() < 1e-12);
        assert!(Solid::group(&[]).centred(true).bounds().is_none());
        for scale in [0.0, 1e-320, 1e308] {
            let extreme = block(DVec3::ONE).placed(Affine::new(
                DVec3::ZERO,
                DVec3::ZERO,
                DVec3::splat(scale),
            ));
            assert!(
                extreme.centred(true).instances().iter().all(|i| i.affine.is_finite()),
                "{scale}"
            );
        }
    }

    #[test]
    fn landmarks_go_where_their_solid_goes() {
        let at = |name: &str, position| Landmark { name: Arc::from(name), position };
        let tip = DVec3::new(0.0, 2.0, 0.0);
        let arm = block(DVec3::new(1.0, 4.0, 1.0))
            .with_landmarks([at("elbow", DVec3::ZERO), at("hand", tip)]);
        let turned = Affine::new(
            DVec3::X,
            DVec3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2),
            DVec3::splat(3.0),
        );
        let two = Solid::group(&[arm.clone(), arm.placed(turned), block(DVec3::ONE)]);
        let names: Vec<&str> = two.landmarks().iter().map(|l| &*l.name).collect();
        assert_eq!(names, ["elbow", "hand", "elbow#2", "hand#2"]);
        assert!((two.landmarks()[3].position - DVec3::new(-5.0, 0.0, 0.0)).length() < 1e-12);
        let lifted = arm.placed(Affine::new(DVec3::Y, DVec3::ZERO, DVec3::ONE));
        let fit = lifted.centred(true);
        assert!(
            (fit.landmarks()[1].position - DVec3::Y).length() < 1e-6,
            "half the longest edge is 1 now"
        );
        assert!(fit.landmarks()[0].position.length() < 1e-6);
        assert!(block(DVec3::ONE).landmarks().is_empty());
    }

    #[test]
    fn parts_of_nested_groups_follow_one_another() {
        let b = block(DVec3::ONE);
        let inner = Solid::group(&[b.clone(), b.clone()]);
        let outer = Solid::group(&[b.clone(), inner.clone(), inner]);
        assert_eq!(
            outer.instances().iter().map(|i| i.first_part).collect::<Vec<_>>(),
            [0, 1, 2, 3, 4]
        );
        let far = (0..17).fold(b, |s, _| Solid::group(&[s.clone(), s]));
        assert_eq!(far.part_count(), u16::MAX, "numbers end there");
        let m = far.to_mesh().unwrap();
        assert_eq!(
            (m.topology.triangles.len(), m.topology.parts.iter().max()),
            (12 << 17, Some(&65534))
        );
    }

    #[test]
    fn export_keeps_normals_and_creases_and_turns_mirrored_faces() {
        // A coarse sphere is smooth although its faces meet at 90 degrees.
        let s = Solid::new(Arc::new(sphere(1.0, 4).unwrap()));
        let scale = DVec3::new(-1.0, 2.0, 1.0);
        let m = s.placed(Affine::new(DVec3::ZERO, DVec3::ZERO, scale)).to_mesh().unwrap();
        assert!(m.topology.edges.iter().all(|e| !e.crease && e.faces[1] != NO_FACE));
        for (p, n) in m.positions.iter().zip(&m.normals) {
            // The gradient of x^2 + (y/2)^2 + z^2.
            let expected = (p.as_dvec3() / (scale * scale)).normalize();
            assert!((n.as_dvec3() - expected).length() < 1e-6);
        }
        let t = &m.topology;
        for face in &t.triangles {
            let p = face.map(|v| m.positions[v as usize]);
            assert!((p[1] - p[0]).cross(p[2] - p[0]).dot(p[0] + p[1] + p[2]) > 0.0, "outward");
        }
        for e in t.edges.iter() {
            let face = t.triangles[e.faces[0] as usize];
            assert!(
                (0..3).any(|c| e.vertices == [face[c], face[(c + 1) % 3]]),
                "as the first face runs"
            );
        }
    }

    #[test]
    fn squashed_and_endless_solids() {
        let flat = |y: f64| {
            block(DVec3::ONE).placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, y, 1.0)))
        };
        assert_eq!(flat(0.0).to_mesh().unwrap().topology.triangles.len(), 4, "the sides are gone");
        assert!(flat(1e300).to_mesh().unwrap_err().to_string().contains("not finite"));
        assert!(Solid::group(&[]).to_mesh().is_err());
    }
}
