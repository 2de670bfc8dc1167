//! Solids: meshes placed in the world, alone or in groups, and their landmarks. Meshes
//! are shared, so solids are cheap to clone and move.
//!
//! A solid is not a volume: members may overlap, and nothing is cut or merged.
//! Invariants: a member's parts are numbered after those of the members before it
//! (numbers beyond 65534 are all drawn as that one); all landmarks have different names.

use super::armature::PosedBody;
use super::landmark::{Landmark, unique};
use super::mesh::{MOST_PARTS, MOST_TRIANGLES};
use super::revolution::Revolution;
use super::{Affine, Bounds, Edge, Edges, GeomError, Mesh, NO_FACE, Topology};
use glam::{DAffine3, DVec3};
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
    /// The number of the object that it belongs to, as a file of the solid has them.
    pub object: u16,
    /// That object's name, if it has one.
    pub name: Option<Arc<str>>,
}

impl Instance {
    /// A mesh placed by the identity: an object without a name.
    pub fn new(mesh: Arc<Mesh>) -> Instance {
        Instance { mesh, affine: Affine::IDENTITY, first_part: 0, object: 0, name: None }
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
    /// The surface that its only mesh stands for.
    revolution: Option<PlacedRevolution>,
    /// The transforms of the joints of a body in a pose.
    joints: Option<Arc<[DAffine3]>>,
    /// The bodies in it, as they are posed and placed.
    bodies: Option<Arc<[PosedBody]>>,
    /// True if it is one of these, and nothing else.
    is_body: bool,
}

/// A placed surface of revolution.
#[derive(Clone, Debug)]
pub struct PlacedRevolution {
    /// The surface.
    pub surface: Arc<Revolution>,
    /// The placement.
    pub affine: Affine,
}

impl PlacedRevolution {
    /// The bounding box of its rings.
    fn bounds(&self) -> Option<Bounds> {
        let matrix = self.affine.0.matrix3;
        let across = DVec3::from_array([0, 1, 2].map(|axis| {
            let row = matrix.row(axis);
            libm::hypot(row.x, row.z)
        }));
        Bounds::around(self.surface.rings().iter().flat_map(|ring| {
            let centre = self.affine.point(DVec3::new(0.0, ring.y, 0.0));
            [centre - across * ring.r, centre + across * ring.r]
        }))
    }
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

    /// True if the mark identifies this list.
    pub fn is(&self, mark: &MeshesMark) -> bool {
        std::ptr::eq(mark.0.as_ptr(), Arc::as_ptr(&self.0))
    }

    /// The number of part numbers in use.
    pub fn part_count(&self) -> u16 {
        let after = |i: &Instance| i.first_part.saturating_add(i.mesh.topology.part_count);
        self.iter().map(after).max().unwrap_or(0)
    }

    /// The number of objects.
    fn object_count(&self) -> u16 {
        self.iter().map(|i| i.object.saturating_add(1)).max().unwrap_or(0)
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
        Solid::of(Arc::new([Instance::new(mesh)]))
    }

    /// A solid of placed meshes, without landmarks.
    pub fn of(instances: Arc<[Instance]>) -> Solid {
        Solid {
            instances: Meshes(ready(instances)),
            group: None,
            landmarks: ready(Arc::default()),
            lazy_depth: 0,
            revolution: None,
            joints: None,
            bodies: None,
            is_body: false,
        }
    }

    /// A surface of revolution, which is drawn without a mesh where it is the only object.
    /// Its mesh is made when something else needs one, such as export.
    pub(super) fn turned(
        surface: Revolution,
        mesh: impl FnOnce() -> Instance + Send + 'static,
    ) -> Solid {
        let (surface, affine) = (Arc::new(surface), Affine::IDENTITY);
        let revolution = Some(PlacedRevolution { surface, affine });
        Solid { revolution, ..Solid::of_parts(move || [mesh()]) }
    }

    /// The surface of revolution that the solid shows, if it is one and its placement can
    /// be inverted.
    pub fn revolution(&self) -> Option<&PlacedRevolution> {
        self.revolution.as_ref().filter(|r| r.affine.inverse().is_some())
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

    /// As [`Solid::with_landmarks_of`], with landmarks whose names all differ.
    #[must_use]
    pub(super) fn with_distinct_landmarks_of(
        self,
        make: impl FnOnce() -> Arc<[Landmark]> + Send + 'static,
    ) -> Solid {
        Solid { landmarks: later(make), ..self }
    }

    /// The landmarks, in world coordinates.
    pub fn landmarks(&self) -> &[Landmark] {
        &self.landmarks
    }

    /// Notes the body that this is.
    pub(super) fn with_body(self, body: PosedBody) -> Solid {
        let joints = Some(Arc::clone(&body.joints));
        Solid { joints, bodies: Some(Arc::new([body])), is_body: true, ..self }
    }

    /// The bodies in it, as they are posed and placed.
    pub fn bodies(&self) -> &[PosedBody] {
        self.bodies.as_deref().unwrap_or_default()
    }

    /// The body that it is, if it is nothing but a body.
    pub(crate) fn body(&self) -> Option<&PosedBody> {
        self.bodies().first().filter(|_| self.is_body)
    }

    /// The transforms of the joints, if this is a body in a pose that has not been placed.
    pub fn joints(&self) -> Option<&[DAffine3]> {
        self.joints.as_deref()
    }

    /// A solid of placed meshes that are computed on first use, which saves the work if
    /// only landmarks matter.
    pub fn of_parts<M>(make: impl FnOnce() -> M + Send + 'static) -> Solid
    where
        M: IntoIterator<Item = Instance>,
    {
        let instances = Meshes(later(move || make().into_iter().collect()));
        Solid { instances, lazy_depth: 1, ..Solid::of(Arc::default()) }
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
        let revolution = self
            .revolution
            .as_ref()
            .map(|r| PlacedRevolution { surface: Arc::clone(&r.surface), affine: by * r.affine });
        let moved = |b: &PosedBody| PosedBody { place: by * b.place, ..b.clone() };
        let bodies = self.bodies.as_ref().map(|all| all.iter().map(moved).collect());
        let (lazy_depth, is_body) = (self.lazy_depth + 1, self.is_body);
        let (group, joints) = (None, None);
        Solid { instances, group, landmarks, lazy_depth, revolution, joints, bodies, is_body }
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

    /// Groups solids. Their parts and objects are numbered consecutively, and their landmarks
    /// are concatenated.
    pub fn group(solids: &[Solid]) -> Solid {
        Solid::named_group(solids, Vec::new())
    }

    /// As [`Solid::group`], with a name for each of the solids: that of its objects, before the
    /// names that they have. Solids beyond the names have none.
    pub fn named_group(solids: &[Solid], names: Vec<Arc<str>>) -> Solid {
        let lists: Box<[Meshes]> = solids.iter().map(|s| s.instances.clone()).collect();
        let group = Arc::new(Group { lists, count: solids.iter().map(Solid::mesh_count).sum() });
        let of = Arc::clone(&group);
        let instances = Meshes(later(move || {
            let (mut first, mut object) = (0u16, 0u16);
            let mut instances = Vec::with_capacity(of.count);
            for (k, list) in of.lists.iter().enumerate() {
                let name = names.get(k);
                let numbered = |i: &Instance| Instance {
                    first_part: first.saturating_add(i.first_part),
                    object: object.saturating_add(i.object),
                    name: within(name, i.name.as_ref()),
                    ..i.clone()
                };
                instances.extend(list.iter().map(numbered));
                first = first.saturating_add(list.part_count());
                object = object.saturating_add(list.object_count());
            }
            instances.into()
        }));
        let of: Vec<_> = solids.iter().map(|s| Arc::clone(&s.landmarks)).collect();
        let landmarks =
            later(move || unique(of.iter().flat_map(|landmarks| landmarks.iter().cloned())));
        let lazy_depth = solids.iter().map(|s| s.lazy_depth).max().unwrap_or(0) + 1;
        let bodies: Vec<PosedBody> = solids.iter().flat_map(Solid::bodies).cloned().collect();
        Solid {
            instances,
            group: Some(group),
            landmarks,
            lazy_depth,
            revolution: None,
            joints: None,
            bodies: (!bodies.is_empty()).then(|| bodies.into()),
            is_body: false,
        }
        .forced_if_deep()
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

    /// Returns the bounding box of all vertices, of a surface of revolution that of its
    /// rings; `None` if there are none.
    pub fn bounds(&self) -> Option<Bounds> {
        match self.revolution() {
            Some(r) => r.bounds(),
            None => Bounds::around(self.vertices()),
        }
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
        if let Some(body) = self.body() {
            return body.body.whole().of_parts.len();
        }
        self.instances.iter().map(|i| i.mesh.positions.len()).sum()
    }

    /// The vertices of all its meshes in order, in world coordinates.
    pub fn vertices(&self) -> impl Iterator<Item = DVec3> {
        self.instances
            .iter()
            .flat_map(|i| i.mesh.positions.iter().map(|p| i.affine.point(p.as_dvec3())))
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
        Ok(Mesh::of(positions, normals, Arc::new(t)))
    }
}

/// Returns the name of an object of a group's member.
fn within(member: Option<&Arc<str>>, own: Option<&Arc<str>>) -> Option<Arc<str>> {
    match (member, own) {
        (Some(member), Some(own)) => Some(format!("{member}_{own}").into()),
        (name, own) => name.or(own).cloned(),
    }
}

#[cfg(test)]
#[path = "solid_tests.rs"]
mod tests;
