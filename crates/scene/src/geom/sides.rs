//! The sides of a mesh's faces, each once, with the faces that meet there.

use rustc_hash::FxHashMap;
use std::fmt;
use std::sync::OnceLock;

/// The sides of faces. Computed on first use from the faces alone, so all values compare equal,
/// and are printed alike: meshes share them, and whoever needs one first computes those of all.
#[derive(Default)]
pub struct Sides(OnceLock<Vec<Side>>);

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
    /// Returns the sides, in the order of their first faces. Every call must pass the same faces.
    pub(crate) fn of(&self, triangles: &[[u32; 3]]) -> &[Side] {
        self.0.get_or_init(|| sides(triangles))
    }
}

fn sides(triangles: &[[u32; 3]]) -> Vec<Side> {
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
    sides
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_share_a_side_that_they_have_in_opposite_directions() {
        // The third face has the side from 0 to 1 in the first one's direction.
        let faces = [[0, 1, 2], [2, 1, 3], [0, 1, 4]];
        let sides = Sides::default();
        let found = sides.of(&faces);
        let between = |faces: [u32; 2]| found.iter().filter(|s| s.faces == faces).count();
        assert_eq!(found.len(), 8);
        assert_eq!(
            [between([0, 1]), between([0, 3]), between([1, 3]), between([2, 3])],
            [1, 2, 2, 3]
        );
        assert_eq!(found[1], Side { vertices: [1, 2], faces: [0, 1] });
        assert!(sides == sides.clone() && sides.clone().of(&faces) == found);
    }
}
