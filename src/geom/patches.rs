//! Small groups of a mesh's faces, so that many can be passed over at once.

use std::sync::OnceLock;

/// Groups of [`Patches::FACES`] faces that follow one another, with the vertices of each.
/// Made when first asked for; equal to any other, since faces alone decide what they are.
#[derive(Debug, Default)]
pub struct Patches(OnceLock<Lists>);

/// Some vertices that follow one another: in most meshes a patch has few such runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    /// The first one.
    pub first: usize,
    /// How many, 1 to [`Run::MOST`].
    pub count: usize,
}

#[derive(Debug, Default)]
struct Lists {
    /// The vertices of one patch after the other, and where the runs of each end.
    runs: Vec<Run>,
    ends: Vec<usize>,
}

impl Run {
    /// The most vertices in a run.
    pub const MOST: usize = 16;

    /// Its vertices.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.count
    }
}

/// A run goes on over so many vertices that the patch does not have: looking at them,
/// too, is cheaper than another run.
const GAP: usize = 2;

impl Patches {
    /// Faces in a patch; the last one may have fewer.
    pub const FACES: usize = 16;

    /// The vertices of each patch of these faces, which are always the same ones; a few
    /// more may be among them.
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
        assert_eq!(patches.clone().of(&faces[..1]).count(), 1);
        assert_eq!(Patches::default().of(&[]).count(), 0);
        let strip: Vec<[u32; 3]> = (0..16).map(|i| [i / 2, 100 + i / 2, i / 2 + 1]).collect();
        assert_eq!(Patches::default().of(&strip).map(<[Run]>::len).collect::<Vec<_>>(), [2]);
    }
}
