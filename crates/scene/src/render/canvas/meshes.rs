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
}

/// The meshes of a list whose first mesh has the given index.
fn listed(list: &[Instance], first: usize) -> impl Iterator<Item = Member<'_>> {
    (first..).zip(list).map(|(index, instance)| Member { index, instance })
}

/// All meshes of a solid, in order.
pub fn members(solid: &Solid) -> impl Iterator<Item = Member<'_>> {
    solid
        .lists()
        .flat_map(|list| &**list)
        .enumerate()
        .map(|(index, instance)| Member { index, instance })
}

/// A mesh and its placement.
struct Placed {
    /// A weak reference, so that the address is not reused while it is compared.
    mesh: Weak<Mesh>,
    affine: [u64; 12],
}

impl Placed {
    fn new(Member { instance, .. }: &Member<'_>) -> Placed {
        Placed { mesh: Arc::downgrade(&instance.mesh), affine: affine_bits(&instance.affine) }
    }

    fn is(&self, Member { instance, .. }: &Member<'_>) -> bool {
        std::ptr::eq(self.mesh.as_ptr(), Arc::as_ptr(&instance.mesh))
            && self.affine == affine_bits(&instance.affine)
    }
}

/// A list of meshes, and where it is among all of them.
struct List {
    mark: MeshesMark,
    first: usize,
    count: usize,
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
        let (mut changed, mut first) = (Vec::new(), 0);
        for (i, list) in solid.lists().enumerate() {
            let is_it = |l: &&List| l.first == first && list.is(&l.mark);
            first += match self.lists.get(i).filter(is_it) {
                Some(known) => known.count,
                None => {
                    let differs = |member: &Member<'_>| {
                        !self.placed.get(member.index).is_some_and(|p| p.is(member))
                    };
                    changed.extend(listed(list, first).filter(differs));
                    list.len()
                }
            };
        }
        changed
    }

    /// Records a solid whose differences are `changed`.
    pub fn set(&mut self, solid: &Solid, changed: &[Member<'_>]) {
        let (mut first, mut lists) = (0, 0);
        for list in solid.lists() {
            let known = self.lists.get_mut(lists);
            first += match known {
                Some(l) if l.first == first && list.is(&l.mark) => l.count,
                known => {
                    let new = List { mark: list.mark(), first, count: list.len() };
                    match known {
                        Some(l) => *l = new,
                        None => self.lists.push(new),
                    }
                    list.len()
                }
            };
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
