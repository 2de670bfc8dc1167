//! Small groups of a mesh's faces, so that many can be passed over at once.

use rustc_hash::FxHashSet;
use std::sync::OnceLock;

/// Groups of [`Patches::FACES`] faces that follow one another, with the vertices of each. Made when first asked for; equal to
/// any other, since faces alone decide what they are.
#[derive(Debug, Default)]
pub struct Patches(OnceLock<Lists>);

#[derive(Debug, Default)]
struct Lists {
    /// The vertices of one patch after the other, each once in a patch.
    vertices: Vec<u32>,
    /// Where those of each end.
    ends: Vec<usize>,
}

impl Patches {
    /// Faces in a patch; the last one may have fewer.
    pub const FACES: usize = 16;

    /// The vertices of each patch of these faces, which are always the same ones.
    pub(crate) fn of<'a>(&'a self, triangles: &[[u32; 3]]) -> impl Iterator<Item = &'a [u32]> {
        let Lists { vertices, ends } = self.0.get_or_init(|| Lists::new(triangles));
        let firsts = std::iter::once(0).chain(ends.iter().copied());
        firsts.zip(ends).map(|(first, past)| &vertices[first..*past])
    }
}

impl Lists {
    fn new(triangles: &[[u32; 3]]) -> Lists {
        let (mut lists, mut met) = (Lists::default(), FxHashSet::default());
        for faces in triangles.chunks(Patches::FACES) {
            met.clear();
            lists.vertices.extend(faces.as_flattened().iter().filter(|v| met.insert(**v)));
            lists.ends.push(lists.vertices.len());
        }
        lists
    }
}

/// Made anew when asked for: a copy may get other faces.
impl Clone for Patches {
    fn clone(&self) -> Patches {
        Patches::default()
    }
}

impl PartialEq for Patches {
    fn eq(&self, _: &Patches) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_have_the_vertices_of_their_faces_once() {
        let faces: Vec<[u32; 3]> = (0..37).map(|i| [i, i + 1, (i * i) % 7]).collect();
        let patches = Patches::default();
        let lists: Vec<&[u32]> = patches.of(&faces).collect();
        assert_eq!(lists.len(), 3);
        for (list, faces) in lists.iter().zip(faces.chunks(Patches::FACES)) {
            let mut wanted = faces.as_flattened().to_vec();
            wanted.sort_unstable();
            wanted.dedup();
            let mut list = list.to_vec();
            list.sort_unstable();
            assert_eq!(list, wanted);
        }
        assert_eq!(patches.clone().of(&faces[..1]).count(), 1);
        assert_eq!(Patches::default().of(&[]).count(), 0);
    }
}
