//! Small groups of a mesh's faces, so that many faces can be skipped at once.

use std::fmt;
use std::sync::OnceLock;

/// Groups of [`Patches::FACES`] consecutive faces, with the vertices of each group.
/// Computed on first use from the faces alone, so all values compare equal, and are printed
/// alike: meshes share them, and whoever draws one first computes those of all.
#[derive(Default)]
pub struct Patches(OnceLock<Lists>);

impl fmt::Debug for Patches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Patches")
    }
}

/// A run of consecutive vertices; in most meshes a patch has few runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    /// The first vertex.
    pub first: usize,
    /// The number of vertices, 1 to [`Run::MOST`].
    pub count: usize,
}

#[derive(Debug, Default)]
struct Lists {
    /// The runs of all patches in order, and the index where each patch's runs end.
    runs: Vec<Run>,
    ends: Vec<usize>,
}

impl Run {
    /// The maximum number of vertices in a run.
    pub const MOST: usize = 16;

    /// The vertices' indices.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.count
    }
}

/// The maximum gap that a run bridges: processing a few vertices that the patch lacks is
/// cheaper than another run.
const GAP: usize = 2;

impl Patches {
    /// The number of faces in a patch; the last one may have fewer.
    pub const FACES: usize = 16;

    /// Returns the vertices of each patch, possibly with a few more. Every call must pass
    /// the same faces.
    pub(crate) fn of<'a>(&'a self, triangles: &[[u32; 3]]) -> impl Iterator<Item = &'a [Run]> {
        let Lists { runs, ends } = self.0.get_or_init(|| Lists::new(triangles));
        let firsts = std::iter::once(0).chain(ends.iter().copied());
        firsts.zip(ends).map(|(first, past)| &runs[first..*past])
    }
}

impl Lists {
    fn new(triangles: &[[u32; 3]]) -> Lists {
        let (mut lists, mut own) = (Lists::default(), Vec::new());
        for faces in triangles.chunks(Patches::FACES) {
            own.clear();
            own.extend(faces.as_flattened().iter().map(|v| *v as usize));
            own.sort_unstable();
            let mut run: Option<Run> = None;
            for v in own.iter().copied() {
                match &mut run {
                    Some(r) if v <= r.first + r.count + GAP && v < r.first + Run::MOST => {
                        r.count = v + 1 - r.first
                    }
                    _ => lists.runs.extend(run.replace(Run { first: v, count: 1 })),
                }
            }
            lists.runs.extend(run);
            lists.ends.push(lists.runs.len());
        }
        lists
    }
}

/// A clone is recomputed on first use, since it may get other faces.
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
    fn patches_have_the_vertices_of_their_faces() {
        let faces: Vec<[u32; 3]> = (0..37).map(|i| [i, 40 * i, (i * i) % 7]).collect();
        let patches = Patches::default();
        let lists: Vec<&[Run]> = patches.of(&faces).collect();
        assert_eq!(lists.len(), 3);
        for (runs, faces) in lists.iter().zip(faces.chunks(Patches::FACES)) {
            assert!(runs.iter().all(|run| (1..=Run::MOST).contains(&run.count)));
            let held: Vec<usize> = runs.iter().flat_map(Run::range).collect();
            assert!(held.is_sorted_by(|a, b| a < b));
            let own = faces.as_flattened().iter().map(|v| *v as usize);
            assert!(own.clone().all(|v| held.contains(&v)));
            let near = |v: &usize| own.clone().any(|w| w.abs_diff(*v) <= GAP);
            assert!(held.iter().all(near));
        }
        assert_eq!(format!("{patches:?}"), format!("{:?}", Patches::default()), "printed alike");
        assert_eq!(patches.clone().of(&faces[..1]).count(), 1);
        assert_eq!(Patches::default().of(&[]).count(), 0);
        let strip: Vec<[u32; 3]> = (0..16).map(|i| [i / 2, 100 + i / 2, i / 2 + 1]).collect();
        assert_eq!(Patches::default().of(&strip).map(<[Run]>::len).collect::<Vec<_>>(), [2]);
    }
}
