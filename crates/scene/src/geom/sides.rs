//! The sides of a mesh's faces, each once, with the faces that meet there, and where meshes that
//! are parts of one surface meet.

use rustc_hash::FxHashMap;
use std::fmt;
use std::sync::OnceLock;

/// The sides of faces. Computed on first use from the faces alone, so all values compare equal,
/// and are printed alike: meshes share them, and whoever needs one first computes those of all.
#[derive(Default)]
pub struct Sides(OnceLock<List>);

struct List {
    /// Those of one face first.
    all: Vec<Side>,
    open: usize,
}

impl fmt::Debug for Sides {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Sides")
    }
}

impl Clone for Sides {
    fn clone(&self) -> Sides {
        Sides::default()
    }
}

impl PartialEq for Sides {
    fn eq(&self, _: &Sides) -> bool {
        true
    }
}

/// A side of one or two faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Side {
    /// From and to, as the first face has them.
    pub vertices: [u32; 2],
    /// The faces. The second has the side in the other direction; if none has, it is one beyond
    /// the last face.
    pub faces: [u32; 2],
}

impl Sides {
    /// Returns the sides, and how many of them, the first ones, have one face. Every call must
    /// pass the same faces.
    pub(crate) fn of(&self, triangles: &[[u32; 3]]) -> (&[Side], usize) {
        let List { all, open } = self.0.get_or_init(|| sides(triangles));
        (all, *open)
    }
}

/// Where the meshes that are the parts of a surface meet: for each seam, twice the number of a
/// part and that of a side among its sides of one face.
#[derive(Debug, Default, PartialEq)]
pub struct Seams(pub(crate) Vec<[[u32; 2]; 2]>);

impl Seams {
    /// Those of parts given by their triangles and by the surface's vertex that each of their
    /// vertices is.
    pub(crate) fn between<'a>(parts: impl Iterator<Item = (&'a [[u32; 3]], &'a [u32])>) -> Seams {
        let mut seams = Seams::default();
        let mut met: FxHashMap<[u32; 2], [u32; 2]> = FxHashMap::default();
        for (part, (triangles, vertices)) in (0..).zip(parts) {
            let List { all, open } = sides(triangles);
            for (side, number) in all.iter().take(open).zip(0..) {
                let [from, to] = side.vertices.map(|v| vertices[v as usize]);
                match met.remove(&[to, from]) {
                    Some(other) => seams.0.push([other, [part, number]]),
                    None => drop(met.insert([from, to], [part, number])),
                }
            }
        }
        seams
    }
}

fn sides(triangles: &[[u32; 3]]) -> List {
    let none = triangles.len() as u32;
    let mut sides: Vec<Side> = Vec::with_capacity(triangles.len() * 3 / 2);
    // Those whose second face has not been met.
    let mut open: FxHashMap<[u32; 2], usize> = FxHashMap::default();
    for (face, [a, b, c]) in (0..).zip(triangles) {
        for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
            if let Some(side) = open.remove(&[to, from]).and_then(|at| sides.get_mut(at)) {
                side.faces[1] = face;
                continue;
            }
            open.insert([from, to], sides.len());
            sides.push(Side { vertices: [from, to], faces: [face, none] });
        }
    }
    sides.sort_by_key(|side| side.faces[1] != none);
    List { open: sides.partition_point(|side| side.faces[1] == none), all: sides }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_share_a_side_that_they_have_in_opposite_directions() {
        // The third face has the side from 0 to 1 in the first one's direction.
        let faces = [[0, 1, 2], [2, 1, 3], [0, 1, 4]];
        let sides = Sides::default();
        let (found, open) = sides.of(&faces);
        let between = |faces: [u32; 2]| found.iter().filter(|s| s.faces == faces).count();
        assert_eq!(found.len(), 8);
        assert_eq!(
            [between([0, 1]), between([0, 3]), between([1, 3]), between([2, 3])],
            [1, 2, 2, 3]
        );
        assert_eq!((open, found[7]), (7, Side { vertices: [1, 2], faces: [0, 1] }));
        assert!(sides == sides.clone() && sides.clone().of(&faces) == (found, open));
    }

    #[test]
    fn parts_meet_where_the_surface_has_one_side() {
        let (left, right) = ([[0, 1, 2]], [[0, 1, 2]]);
        let parts = [(&left[..], &[4, 5, 6][..]), (&right[..], &[7, 6, 5][..])];
        assert_eq!(Seams::between(parts.into_iter()).0, [[[0, 1], [1, 1]]]);
    }
}
