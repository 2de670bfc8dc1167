//! Solids as files have them: objects with names, a mesh each.
//!
//! The members of a group are objects; a mesh from a file is one for each part that has a name.
//! A body is one object, whatever its parts. Names within names are joined by `_`, since
//! three.js drops points. Invariants: names differ and are not empty.

use super::mesh::MOST_TRIANGLES;
use super::{GeomError, Instance, Mesh, Solid, Topology};
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

/// The name of an object that has none.
const UNNAMED: &str = "object";

/// An object of a file.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its name.
    pub name: Arc<str>,
    /// Its mesh, in world coordinates.
    pub mesh: Mesh,
}

impl From<Mesh> for Object {
    /// An object without a name of its own.
    fn from(mesh: Mesh) -> Object {
        Object { name: UNNAMED.into(), mesh }
    }
}

impl Solid {
    /// Returns its objects, for export. Those without area are left out, unless all are. A
    /// name that occurs again gets `_2`, `_3`, … appended.
    ///
    /// # Errors
    /// As [`Solid::to_mesh`].
    pub fn objects(&self) -> Result<Vec<Object>, GeomError> {
        let count: usize = self.instances().iter().map(|i| i.mesh.topology.triangles.len()).sum();
        if count > MOST_TRIANGLES {
            return self.to_mesh().map(|mesh| vec![mesh.into()]);
        }
        let (mut objects, mut failure) = (Vec::new(), None);
        for own in self.instances().chunk_by(|a, b| a.object == b.object) {
            // Its own numbers of parts begin with 0.
            let first = own.iter().map(|i| i.first_part).min().unwrap_or(0);
            let renumbered =
                |i: &Instance| Instance { first_part: i.first_part - first, ..i.clone() };
            match Solid::of(own.iter().map(renumbered).collect()).to_mesh() {
                Ok(mesh) => {
                    let name = own[0].name.as_deref();
                    match own.len() == 1 && mesh.topology.part_names.iter().any(|n| !n.is_empty()) {
                        true => by_part(&mesh, name, &mut objects),
                        false => objects.push((name.map(str::to_owned), mesh)),
                    }
                }
                Err(e) => failure = Some(e),
            }
        }
        match failure {
            // A coordinate that is not finite, or nothing at all.
            Some(e) if objects.is_empty() => Err(e),
            _ if objects.is_empty() => self.to_mesh().map(|mesh| vec![mesh.into()]),
            _ => Ok(named(objects)),
        }
    }
}

/// Cuts a mesh into its parts by name; those without a name stay together.
fn by_part(mesh: &Mesh, within: Option<&str>, objects: &mut Vec<(Option<String>, Mesh)>) {
    let t = &mesh.topology;
    let name_of = |part: u16| t.part_names.get(usize::from(part)).map_or("", |n| &**n);
    let mut names: Vec<&str> = Vec::new();
    let mut faces: FxHashMap<&str, Vec<usize>> = FxHashMap::default();
    for (i, part) in t.parts.iter().enumerate() {
        let name = name_of(*part);
        faces.entry(name).or_insert_with(|| {
            names.push(name);
            Vec::new()
        });
        if let Some(list) = faces.get_mut(name) {
            list.push(i);
        }
    }
    for name in names {
        let own = match (within, name) {
            (None, "") => None,
            (Some(within), "") => Some(within.to_owned()),
            (None, name) => Some(name.to_owned()),
            (Some(within), name) => Some(format!("{within}_{name}")),
        };
        objects.push((own, taken(mesh, &faces[name])));
    }
}

/// Returns some of the triangles of a mesh, with the vertices that they use.
fn taken(mesh: &Mesh, faces: &[usize]) -> Mesh {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    let mut place: FxHashMap<u32, u32> = FxHashMap::default();
    let triangles = faces.iter().map(|i| {
        mesh.topology.triangles[*i].map(|v| {
            *place.entry(v).or_insert_with(|| {
                positions.push(mesh.positions[v as usize]);
                normals.push(mesh.normals[v as usize]);
                positions.len() as u32 - 1
            })
        })
    });
    let triangles: Vec<[u32; 3]> = triangles.collect();
    let parts = vec![0; triangles.len()];
    let topology = Topology { triangles, parts, part_count: 1, ..Topology::default() };
    Mesh::of(positions, normals, Arc::new(topology))
}

/// Makes the names differ.
fn named(objects: Vec<(Option<String>, Mesh)>) -> Vec<Object> {
    let mut used: FxHashSet<Arc<str>> = FxHashSet::default();
    let mut counts: FxHashMap<String, u32> = FxHashMap::default();
    let one = |(name, mesh): (Option<String>, Mesh)| {
        let base = name.unwrap_or_else(|| UNNAMED.to_owned());
        let count = counts.entry(base.clone()).or_insert(0);
        let name = loop {
            *count += 1;
            let name = if *count == 1 { base.clone() } else { format!("{base}_{count}") };
            if used.insert(name.as_str().into()) {
                break name.into();
            }
        };
        Object { name, mesh }
    };
    objects.into_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Affine, Caps, Profile, cuboid, lathe, obj, sphere};
    use glam::DVec3;

    fn ball(x: f64) -> Solid {
        let by = Affine::new(DVec3::X * x, DVec3::ZERO, DVec3::ONE);
        Solid::new(Arc::new(sphere(1.0, 8).unwrap())).placed(by)
    }

    fn names(solid: &Solid) -> Vec<String> {
        solid.objects().unwrap().iter().map(|o| o.name.to_string()).collect()
    }

    #[test]
    fn members_of_groups_are_objects() {
        assert_eq!(names(&ball(0.0)), ["object"]);
        let pair = Solid::group(&[ball(0.0), ball(3.0)]);
        assert_eq!(names(&pair), ["object", "object_2"]);
        let by = Affine::new(DVec3::Y, DVec3::ZERO, DVec3::splat(2.0));
        let all = [ball(6.0), pair.placed(by), ball(9.0)];
        let all = Solid::named_group(&all, ["lamp", "shelf", "shelf_2"].map(Into::into).to_vec());
        assert_eq!(names(&all.placed(by)), ["lamp", "shelf", "shelf_2", "shelf_2_2"]);
        let outer = Solid::named_group(&[all], vec!["room".into()]);
        assert_eq!(names(&outer)[..2], ["room_lamp", "room_shelf"]);
        let second = &outer.objects().unwrap()[2].mesh;
        assert!((second.bounds().unwrap().centre() - DVec3::new(6.0, 1.0, 0.0)).length() < 1e-5);
    }

    #[test]
    fn parts_of_files_keep_their_names() {
        let text =
            "o foot\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\no shade\nf 1 2 4\nf 2 3 4\n";
        let lamp = Solid::new(Arc::new(obj::load(text.as_bytes()).unwrap()));
        assert_eq!(names(&lamp), ["foot", "shade"]);
        let faces: Vec<usize> =
            lamp.objects().unwrap().iter().map(|o| o.mesh.topology.triangles.len()).collect();
        assert_eq!(faces, [1, 2]);
        let two = Solid::named_group(&[lamp.clone(), lamp], vec!["left".into(), "right".into()]);
        assert_eq!(names(&two), ["left_foot", "left_shade", "right_foot", "right_shade"]);
        // Parts without names are one object.
        let profile = |y: [f64; 2], r: f64| Profile { y: y.to_vec(), r: vec![r, r] };
        let steps = [profile([0.0, 1.0], 0.5), profile([1.0, 2.0], 0.3)];
        let steps = lathe(&steps, 9, 0.0, Caps::Both).unwrap();
        assert_eq!(names(&Solid::new(Arc::new(steps))), ["object"]);
    }

    #[test]
    fn what_has_no_area_is_left_out() {
        let flat = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        let cube = Solid::new(Arc::new(cuboid(DVec3::ONE).unwrap()));
        let both = [cube.placed(flat), cube.clone()];
        assert_eq!(names(&Solid::named_group(&both, vec!["a".into(), "b".into()])), ["b"]);
        assert!(cube.placed(flat).objects().is_err() && Solid::group(&[]).objects().is_err());
    }
}
