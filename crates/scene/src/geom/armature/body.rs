//! Bodies: a rig with a skinned mesh, cut into one part per bone, so that poses that
//! differ in one joint share the meshes of the parts that do not move.
//!
//! Linear blend skinning: vertex' = sum of w_k M[k] vertex. A triangle belongs to the
//! joint with the largest weight in it. The surface is taken to be smooth and closed: it
//! has silhouettes, but no creases, and no contours between parts. Vertices are single
//! precision. Invariant: the meshes of a pose do not depend on earlier poses.

use super::Rig;
use super::morph::{Anchor, Morph};
use super::whole::Whole;
use crate::geom::{ByVertex, GeomError, Instance, Mesh, Normals, Topology, edges, outer};
use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3, Vec3A};
use pcadlang_numerics::num::simd::vectorised;
use std::ops::Range;
use std::sync::{Arc, LazyLock};

/// The maximum number of joints that move a vertex.
pub const MOST_WEIGHTS: usize = 4;

/// The joints that move a vertex, by index in rig order, with weights that sum to 1.
/// Unused entries have weight 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Influence {
    /// The joints' indices.
    pub joints: [u16; MOST_WEIGHTS],
    /// Their weights.
    pub weights: [f32; MOST_WEIGHTS],
}

impl Influence {
    /// The joints of positive weight, with their weights.
    pub fn joints(&self) -> impl Iterator<Item = (usize, f64)> {
        let all = self.joints.into_iter().zip(self.weights).filter(|(_, w)| *w > 0.0);
        all.map(|(j, w)| (usize::from(j), f64::from(w)))
    }

    /// Returns the image of a point under the weighted sum of the joints' transforms.
    pub fn blend(&self, transforms: &[DAffine3], at: DVec3) -> DVec3 {
        self.joints().map(|(j, w)| transforms[j].transform_point3(at) * w).sum()
    }
}

/// The triangles that belong to one joint.
#[derive(Debug)]
pub(super) struct Part {
    /// The joint.
    joint: u16,
    /// The triangles, with indices into the part's own vertices.
    pub topology: Arc<Topology>,
    /// For each of the part's vertices, its index in the body.
    pub vertices: Vec<u32>,
    /// Where they are among those of all parts' meshes.
    numbers: Range<usize>,
    /// The joints that move any of the vertices, in increasing order.
    pub joints: Vec<u16>,
}

/// Data shared by all shapes of a body.
#[derive(Debug)]
pub(super) struct Skin {
    triangles: Vec<[u32; 3]>,
    pub influences: Vec<Influence>,
    parts: Vec<Part>,
    pub whole: Whole,
    morphs: Vec<Morph>,
    /// For each keypoint, what it follows when the shape changes.
    anchors: Vec<Anchor>,
    /// The surface before any change of shape.
    rest: Arc<LazySurface>,
}

impl Skin {
    /// The map of a vertex from the transforms of all joints.
    fn blended(&self, v: u32, transforms: &[Affine3A]) -> Affine3A {
        let Influence { joints, weights } = &self.influences[v as usize];
        match weights[0] == 1.0 {
            true => transforms[usize::from(joints[0])],
            false => blend(joints, weights, transforms),
        }
    }
}

/// The vertices at rest, and their normals.
#[derive(Debug)]
struct Surface {
    positions: Arc<[Vec3]>,
    normals: Normals,
}

impl Surface {
    fn new(positions: Vec<Vec3>, triangles: &[[u32; 3]]) -> Surface {
        let normals = edges::smooth_normals(&positions, triangles).into();
        Surface { normals, positions: positions.into() }
    }

    /// The same for the triangles of a skin, with normals when they are needed.
    fn of(positions: Vec<Vec3>, skin: Arc<Skin>) -> Surface {
        let positions: Arc<[Vec3]> = positions.into();
        let of = Arc::clone(&positions);
        let normals = Normals::later(move || edges::smooth_normals(&of, &skin.triangles));
        Surface { positions, normals }
    }
}

/// Computed on first use: a comparison of the rig's keypoints alone does not need it.
type LazySurface = LazyLock<Surface, Box<dyn FnOnce() -> Surface + Send>>;

/// A rig and its mesh.
#[derive(Debug)]
pub struct Armature {
    rig: Rig,
    surface: Arc<LazySurface>,
    skin: Arc<Skin>,
    /// The amount of each morph that the file gave the body; 0 once it was set.
    weights: Arc<[f64]>,
}

/// Derivatives with respect to a body at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RestGradient {
    /// With respect to each joint's head.
    pub heads: Vec<DVec3>,
    /// With respect to each joint's tail.
    pub tails: Vec<DVec3>,
    /// With respect to each keypoint.
    pub keypoints: Vec<DVec3>,
    /// With respect to vertices.
    pub vertices: ByVertex,
}

impl Armature {
    /// Skins a mesh to a rig. `influences` gives the joints that move each vertex, by
    /// index in rig order, with weights.
    ///
    /// # Errors
    /// A number of influences that differs from the number of vertices; a weight that is
    /// negative or not finite; weights that do not sum to 1 (within a thousandth); a
    /// joint that does not exist; a mesh without area.
    pub fn new(
        rig: Rig,
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        influences: Vec<Influence>,
    ) -> Result<Armature, GeomError> {
        // This also checks the indices and positions.
        Mesh::new(positions.clone(), triangles.clone(), vec![0; triangles.len()])?;
        if influences.len() != positions.len() {
            return Err(GeomError::invalid(format!(
                "the mesh has {} vertices, but skin weights are given for {}",
                positions.len(),
                influences.len()
            )));
        }
        let mut influences = influences;
        for (v, i) in influences.iter_mut().enumerate() {
            let sum: f32 = i.weights.iter().sum();
            if let Some(w) = i.weights.iter().find(|w| !w.is_finite() || **w < 0.0) {
                return Err(GeomError::invalid(format!("vertex {v} has a skin weight of {w}")));
            }
            if (sum - 1.0).abs() > 1e-3 {
                return Err(GeomError::invalid(format!(
                    "the skin weights of vertex {v} sum to {sum}, not to 1"
                )));
            }
            i.weights = i.weights.map(|w| w / sum);
            for (j, w) in i.joints.iter_mut().zip(i.weights) {
                if w > 0.0 && usize::from(*j) >= rig.joints().len() {
                    let count = rig.joints().len();
                    return Err(GeomError::invalid(format!(
                        "vertex {v} is moved by joint {j}, but the rig has {count} joints"
                    )));
                }
                if w == 0.0 {
                    *j = 0;
                }
            }
        }
        let parts = parts(&rig, &triangles, &influences);
        let surface = Surface::new(positions, &triangles);
        let anchors =
            rig.keypoints().iter().map(|k| Anchor::of(k, &rig, &surface.positions)).collect();
        let lazy: LazySurface = LazyLock::new(Box::new(|| surface));
        LazyLock::force(&lazy);
        let surface = Arc::new(lazy);
        let rest = Arc::clone(&surface);
        let (whole, morphs) = (Whole::new(&parts, influences.len()), Vec::new());
        let skin = Skin { triangles, influences, parts, whole, morphs, anchors, rest };
        Ok(Armature { rig, surface, skin: Arc::new(skin), weights: Arc::default() })
    }

    /// Adds morphs.
    ///
    /// # Errors
    /// A morph with another number of vertices or joints; two morphs of one name.
    pub fn with_morphs(self, morphs: Vec<Morph>) -> Result<Armature, GeomError> {
        for (i, m) in morphs.iter().enumerate() {
            m.check(self.positions().len(), self.rig.joints().len())?;
            if morphs[..i].iter().any(|other| other.name == m.name) {
                return Err(GeomError::invalid(format!("two morphs are called `{}`", m.name)));
            }
        }
        let weights = morphs.iter().map(|m| m.weight).collect();
        let skin = match Arc::try_unwrap(self.skin) {
            Ok(skin) => Skin { morphs, ..skin },
            Err(_) => return Err(GeomError::invalid("this body already has morphs")),
        };
        Ok(Armature { skin: Arc::new(skin), weights, ..self })
    }

    /// The rig.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The vertices at rest.
    pub fn positions(&self) -> &[Vec3] {
        &self.surface.positions
    }

    /// Returns a vertex at rest and the joints that move it.
    pub(super) fn vertex(&self, v: u32) -> Option<(DVec3, &Influence)> {
        let p = self.positions().get(v as usize)?;
        Some((p.as_dvec3(), self.skin.influences.get(v as usize)?))
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.skin.triangles
    }

    /// The joints that move each vertex.
    pub fn influences(&self) -> &[Influence] {
        &self.skin.influences
    }

    /// The names of the morphs.
    pub fn morphs(&self) -> impl Iterator<Item = &str> + Clone {
        self.skin.morphs.iter().map(|m| &*m.name)
    }

    /// Returns the body in another shape: adds each morph's offsets, times its amount. A morph
    /// that the file gave an amount has the new one instead, the first time.
    ///
    /// # Errors
    /// An unknown morph, or an amount that is not finite.
    pub fn shaped(&self, amounts: &[(&str, f64)]) -> Result<Armature, GeomError> {
        self.clothed(amounts, 0.0)
    }

    /// As [`Armature::shaped`], and offsets the surface by `cloth` along the normals of
    /// the undeformed rest shape, in the mesh's units. Joints and keypoints stay in
    /// place.
    ///
    /// # Errors
    /// As [`Armature::shaped`]; a `cloth` that is not finite.
    pub fn clothed(&self, amounts: &[(&str, f64)], cloth: f64) -> Result<Armature, GeomError> {
        if !cloth.is_finite() {
            return Err(GeomError::domain("the cloth must be finite"));
        }
        let n = self.rig.joints().len();
        let (mut heads, mut tails) = (vec![DVec3::ZERO; n], vec![DVec3::ZERO; n]);
        let mut points = vec![DVec3::ZERO; self.rig.keypoints().len()];
        let mut added = Vec::with_capacity(amounts.len());
        let mut weights = Arc::clone(&self.weights);
        for (name, amount) in amounts {
            let Some(k) = self.skin.morphs.iter().position(|m| *m.name == **name) else {
                let all: Vec<&str> = self.morphs().collect();
                return Err(GeomError::invalid(format!(
                    "the body has no morph `{name}`; it has {}",
                    all.join(", ")
                )));
            };
            if !amount.is_finite() {
                return Err(GeomError::domain(format!(
                    "the amount of the morph `{name}` must be finite"
                )));
            }
            let m = &self.skin.morphs[k];
            let mut amount = *amount;
            if weights[k] != 0.0 {
                amount -= std::mem::take(&mut Arc::make_mut(&mut weights)[k]);
            }
            if amount == 0.0 {
                continue;
            }
            m.move_joints(amount, &mut heads, &mut tails);
            added.push((k, amount));
            for (d, anchor) in points.iter_mut().zip(&self.skin.anchors) {
                *d += m.at(*anchor) * amount;
            }
        }
        let skin = Arc::clone(&self.skin);
        let reshaped = self.reshaped(&heads, &tails, &points, move |positions| {
            let mut all = Vec::with_capacity(3 * positions.len());
            positions.iter().for_each(|p| all.extend_from_slice(p.as_ref()));
            vectorised(
                #[inline(always)]
                || added.iter().for_each(|(k, by)| skin.morphs[*k].move_vertices(*by, &mut all)),
            );
            let mut moved: Vec<Vec3> = all.as_chunks().0.iter().map(|p| Vec3::from(*p)).collect();
            if cloth != 0.0 {
                let normals = &skin.rest.normals;
                moved.iter_mut().zip(normals).for_each(|(p, n)| *p += *n * cloth as f32);
            }
            moved
        });
        Ok(Armature { weights, ..reshaped })
    }

    /// Returns the body with the given offsets added to joints and keypoints at rest, and
    /// the vertices at rest that a function makes of its own.
    pub(super) fn reshaped(
        &self,
        heads: &[DVec3],
        tails: &[DVec3],
        points: &[DVec3],
        change: impl FnOnce(&[Vec3]) -> Vec<Vec3> + Send + 'static,
    ) -> Armature {
        let (before, skin) = (Arc::clone(&self.surface), Arc::clone(&self.skin));
        let surface = move || Surface::of(change(&before.positions), skin);
        Armature {
            rig: self.rig.moved(heads, tails, points),
            surface: Arc::new(LazyLock::new(Box::new(surface))),
            skin: Arc::clone(&self.skin),
            weights: Arc::clone(&self.weights),
        }
    }

    /// Pulls derivatives with respect to the body at rest back to the amount of a morph;
    /// `None` if there is no morph of that name.
    pub fn vjp_morph(&self, name: &str, by: &RestGradient) -> Option<f64> {
        let m = self.skin.morphs.iter().find(|m| *m.name == *name)?;
        let dot = |offsets: &[DVec3], by: &[DVec3]| {
            offsets.iter().zip(by).map(|(d, g)| d.dot(*g)).sum::<f64>()
        };
        let points =
            self.skin.anchors.iter().zip(&by.keypoints).map(|(anchor, g)| m.at(*anchor).dot(*g));
        let vertices = by.vertices.iter().filter_map(|(v, g)| Some(m.of(*v as usize)?.dot(*g)));
        Some(
            dot(&m.heads, &by.heads)
                + dot(&m.tails, &by.tails)
                + points.sum::<f64>()
                + vertices.sum::<f64>(),
        )
    }

    /// Pulls derivatives with respect to the body at rest back to the cloth offset; see
    /// [`Armature::clothed`].
    pub fn vjp_cloth(&self, by: &RestGradient) -> f64 {
        let normals = &self.skin.rest.normals;
        let along = |v: u32, g: DVec3| Some(normals.get(v as usize)?.as_dvec3().dot(g));
        by.vertices.iter().filter_map(|(v, g)| along(*v, *g)).sum()
    }

    /// Pulls derivatives with respect to the vertices of a posed body's meshes back to the
    /// body's vertices, some of which adjacent parts share.
    pub fn vjp_parts(&self, by_vertex: &[(u32, DVec3)]) -> ByVertex {
        let Whole { order, of_parts, .. } = &self.skin.whole;
        let own =
            |(v, g): &(u32, DVec3)| Some((*order.get(*of_parts.get(*v as usize)? as usize)?, *g));
        by_vertex.iter().filter_map(own).collect()
    }

    /// The surface as one mesh.
    pub(crate) fn whole(&self) -> &Whole {
        &self.skin.whole
    }

    pub(super) fn skin(&self) -> Arc<Skin> {
        Arc::clone(&self.skin)
    }

    pub(super) fn parts(&self) -> &[Part] {
        &self.skin.parts
    }

    /// Appends the vertices that a part has first in the surface as one mesh, deformed by the
    /// transforms of all joints.
    pub(super) fn skin_stretch(
        &self,
        number: usize,
        transforms: &[Affine3A],
        positions: &mut Vec<Vec3>,
    ) {
        let Whole { order, stretches, .. } = &self.skin.whole;
        let rest: &[Vec3] = &self.surface.positions;
        let place = |v: &u32| {
            let m = self.skin.blended(*v, transforms);
            Vec3::from(m.transform_point3a(rest[*v as usize].into()))
        };
        positions.extend(order[stretches[number].vertices.clone()].iter().map(place));
    }

    /// Returns a part deformed by the transforms of all joints, with normals when they are
    /// needed, given the deformed vertices of the surface as one mesh.
    pub(super) fn skinned(
        &self,
        number: usize,
        transforms: &Arc<[Affine3A]>,
        all: &[Vec3],
    ) -> Instance {
        let part = &self.skin.parts[number];
        let own = &self.skin.whole.of_parts[part.numbers.clone()];
        let positions = own.iter().map(|v| all[*v as usize]).collect();
        let (surface, skin) = (Arc::clone(&self.surface), Arc::clone(&self.skin));
        let transforms = Arc::clone(transforms);
        let normals = Normals::later(move || {
            let turned = |v: &u32| {
                let m = skin.blended(*v, &transforms);
                let n = Vec3A::from(surface.normals[*v as usize]);
                (cofactor(&m.matrix3) * n).normalize_or(Vec3A::Y).into()
            };
            skin.parts[number].vertices.iter().map(turned).collect()
        });
        let mesh = Arc::new(Mesh::of(positions, normals, Arc::clone(&part.topology)));
        Instance { first_part: part.joint, ..Instance::new(mesh) }
    }

    /// The vector-Jacobian product of posing with respect to the joints' transforms,
    /// given the derivatives with respect to the posed vertices (in the order of
    /// [`Armature::positions`]) and keypoints. The result is an input of
    /// [`Rig::transforms_vjp`].
    pub fn transforms_gradient(
        &self,
        by_vertex: &[(u32, DVec3)],
        by_keypoint: &[DVec3],
    ) -> Vec<DAffine3> {
        let zero = DAffine3 { matrix3: glam::DMat3::ZERO, translation: DVec3::ZERO };
        let mut out = vec![zero; self.rig.joints().len()];
        let mut add = |joint: usize, weight: f64, at: DVec3, g: DVec3| {
            let g = g * weight;
            let m = &mut out[joint];
            m.matrix3 += outer(g, at);
            m.translation += g;
        };
        for (v, g) in by_vertex {
            let Some((p, i)) = self.vertex(*v) else { continue };
            i.joints().for_each(|(j, w)| add(j, w, p, *g));
        }
        for (k, g) in self.rig.keypoints().iter().zip(by_keypoint) {
            add(k.joint, 1.0, k.rest, *g);
        }
        out
    }
}

fn blend(
    joints: &[u16; MOST_WEIGHTS],
    weights: &[f32; MOST_WEIGHTS],
    transforms: &[Affine3A],
) -> Affine3A {
    let mut m = Affine3A { matrix3: Mat3A::ZERO, translation: Vec3A::ZERO };
    // Those of weight 0 too: how many there are differs from vertex to vertex.
    for (j, w) in joints.iter().zip(weights) {
        let t = &transforms[usize::from(*j)];
        m.matrix3 += t.matrix3 * *w;
        m.translation += t.translation * *w;
    }
    m
}

/// Returns the matrix that transforms normals, as [`crate::geom::Affine::normal_matrix`]
/// but without its sign for mirrored maps.
fn cofactor(m: &Mat3A) -> Mat3A {
    Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Cuts the triangles into parts by the joint with the largest weight in each; the first
/// in rig order on ties.
fn parts(rig: &Rig, triangles: &[[u32; 3]], influences: &[Influence]) -> Vec<Part> {
    let joints = rig.joints().len();
    let mut by_joint: Vec<Vec<[u32; 3]>> = vec![Vec::new(); joints];
    let mut sums = vec![0.0f64; joints];
    for t in triangles {
        for v in t {
            let i = &influences[*v as usize];
            for (j, w) in i.joints.iter().zip(i.weights) {
                sums[usize::from(*j)] += f64::from(w);
            }
        }
        let most = (0..joints).fold(0, |most, j| if sums[j] > sums[most] { j } else { most });
        by_joint[most].push(*t);
        sums.fill(0.0);
    }
    let mut parts: Vec<Part> = Vec::new();
    let mut own = vec![u32::MAX; influences.len()];
    for (joint, triangles) in by_joint.iter().enumerate().filter(|(_, t)| !t.is_empty()) {
        let mut vertices = Vec::new();
        let faces: Vec<[u32; 3]> = triangles
            .iter()
            .map(|t| {
                t.map(|v| {
                    if own[v as usize] == u32::MAX {
                        own[v as usize] = vertices.len() as u32;
                        vertices.push(v);
                    }
                    own[v as usize]
                })
            })
            .collect();
        let mut used: Vec<u16> = Vec::new();
        for v in &vertices {
            own[*v as usize] = u32::MAX;
            let i = &influences[*v as usize];
            used.extend(i.joints().map(|(j, _)| j as u16));
        }
        used.sort_unstable();
        used.dedup();
        let topology = Topology {
            parts: vec![0; faces.len()],
            triangles: faces,
            part_count: 1,
            part_names: vec![Arc::clone(&rig.joints()[joint].name)],
            encloses: true,
            ..Topology::default()
        };
        let first = parts.last().map_or(0, |before| before.numbers.end);
        parts.push(Part {
            joint: joint as u16,
            topology: Arc::new(topology),
            numbers: first..first + vertices.len(),
            vertices,
            joints: used,
        });
    }
    parts
}
