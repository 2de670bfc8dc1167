//! The meshes of a solid by their identity, to find which of them differ in the next one.

use super::layer::affine_bits;
use crate::geom::{Instance, Mesh, MeshesMark, Solid};
use std::sync::{Arc, Weak};

/// A mesh of a solid.
#[derive(Clone, Copy)]
pub struct Member<'a> {
    /// Its index among all meshes of the solid.
    pub index: usize,
    pub instance: &'a Instance,
    /// The number of its first part among all parts of the solid.
    pub first_part: u16,
}

/// The meshes of a list whose first mesh has the given index, and whose first part has the
/// given number.
fn listed(list: &[Instance], first: usize, part: u16) -> impl Iterator<Item = Member<'_>> {
    (first..).zip(list).map(move |(index, instance)| Member {
        index,
        instance,
        first_part: part.saturating_add(instance.first_part),
    })
}

/// All meshes of a solid, in order.
pub fn members(solid: &Solid) -> impl Iterator<Item = Member<'_>> {
    let (mut first, mut part) = (0, 0u16);
    solid.lists().flat_map(move |list| {
        let members = listed(list, first, part);
        (first, part) = (first + list.len(), part.saturating_add(list.part_count()));
        members
    })
}

/// A mesh, its placement and its number.
struct Placed {
    /// A weak reference, so that the address is not reused while it is compared.
    mesh: Weak<Mesh>,
    affine: [u64; 12],
    first_part: u16,
}

impl Placed {
    fn new(Member { instance, first_part, .. }: &Member<'_>) -> Placed {
        let affine = affine_bits(&instance.affine);
        Placed { mesh: Arc::downgrade(&instance.mesh), affine, first_part: *first_part }
    }

    fn is(&self, Member { instance, first_part, .. }: &Member<'_>) -> bool {
        std::ptr::eq(self.mesh.as_ptr(), Arc::as_ptr(&instance.mesh))
            && self.affine == affine_bits(&instance.affine)
            && self.first_part == *first_part
    }
}

/// A list of meshes, and where it is among all of them.
struct List {
    mark: MeshesMark,
    first: usize,
    count: usize,
    /// The number of its first part, and the number of its parts.
    first_part: u16,
    parts: u16,
}

/// The meshes of a solid, in order. The members of a group are recognised by their list,
/// so an unchanged group costs one comparison.
#[derive(Default)]
pub struct Meshes {
    lists: Vec<List>,
    placed: Vec<Placed>,
}

impl Meshes {
    /// The number of meshes.
    pub fn len(&self) -> usize {
        self.placed.len()
    }

    /// The meshes of a solid that differ from these.
    pub fn changed<'a>(&self, solid: &'a Solid) -> Vec<Member<'a>> {
        let (mut changed, mut first, mut part) = (Vec::new(), 0, 0u16);
        for (i, list) in solid.lists().enumerate() {
            let is_it = |l: &&List| l.first == first && l.first_part == part && list.is(&l.mark);
            let (count, parts) = match self.lists.get(i).filter(is_it) {
                Some(known) => (known.count, known.parts),
                None => {
                    let differs = |member: &Member<'_>| {
                        !self.placed.get(member.index).is_some_and(|p| p.is(member))
                    };
                    changed.extend(listed(list, first, part).filter(differs));
                    (list.len(), list.part_count())
                }
            };
            (first, part) = (first + count, part.saturating_add(parts));
        }
        changed
    }

    /// Records a solid whose differences are `changed`.
    pub fn set(&mut self, solid: &Solid, changed: &[Member<'_>]) {
        let (mut first, mut first_part, mut lists) = (0, 0u16, 0);
        for list in solid.lists() {
            let known = self.lists.get_mut(lists);
            let is_it =
                |l: &List| l.first == first && l.first_part == first_part && list.is(&l.mark);
            let (count, parts) = match known {
                Some(l) if is_it(l) => (l.count, l.parts),
                known => {
                    let (count, parts) = (list.len(), list.part_count());
                    let new = List { mark: list.mark(), first, count, first_part, parts };
                    match known {
                        Some(l) => *l = new,
                        None => self.lists.push(new),
                    }
                    (count, parts)
                }
            };
            (first, first_part) = (first + count, first_part.saturating_add(parts));
            lists += 1;
        }
        self.lists.truncate(lists);
        self.placed.truncate(first);
        for member in changed {
            match self.placed.get_mut(member.index) {
                Some(placed) => *placed = Placed::new(member),
                None => self.placed.push(Placed::new(member)),
            }
        }
    }
}
