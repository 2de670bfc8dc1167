//! The meshes of a solid by their identity, to find which of them differ in the next one.

use super::layer::affine_bits;
use crate::geom::{Instance, Mesh, MeshesMark, Solid};
use std::sync::{Arc, Weak};

/// A mesh and its placement.
struct Placed {
    /// A weak reference, so that the address is not reused while it is compared.
    mesh: Weak<Mesh>,
    affine: [u64; 12],
}

impl Placed {
    fn new(instance: &Instance) -> Placed {
        Placed { mesh: Arc::downgrade(&instance.mesh), affine: affine_bits(&instance.affine) }
    }

    fn is(&self, instance: &Instance) -> bool {
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

    /// The meshes of a solid that differ from these, with their indices.
    pub fn changed<'a>(&self, solid: &'a Solid) -> Vec<(usize, &'a Instance)> {
        let (mut changed, mut first) = (Vec::new(), 0);
        for (i, list) in solid.lists().enumerate() {
            let known = self.lists.get(i).filter(|l| l.first == first && list.is(&l.mark));
            if let Some(known) = known {
                first += known.count;
                continue;
            }
            let differs = |(i, instance): &(usize, &Instance)| {
                !self.placed.get(*i).is_some_and(|p| p.is(instance))
            };
            changed.extend((first..).zip(list.iter()).filter(differs));
            first += list.len();
        }
        changed
    }

    /// Records a solid whose differences are `changed`.
    pub fn set(&mut self, solid: &Solid, changed: &[(usize, &Instance)]) {
        let (mut first, mut lists) = (0, 0);
        for list in solid.lists() {
            match self.lists.get_mut(lists) {
                Some(l) if l.first == first && list.is(&l.mark) => first += l.count,
                known => {
                    let new = List { mark: list.mark(), first, count: list.len() };
                    first += new.count;
                    match known {
                        Some(l) => *l = new,
                        None => self.lists.push(new),
                    }
                }
            }
            lists += 1;
        }
        self.lists.truncate(lists);
        self.placed.truncate(first);
        for (i, instance) in changed {
            match self.placed.get_mut(*i) {
                Some(placed) => *placed = Placed::new(instance),
                None => self.placed.push(Placed::new(instance)),
            }
        }
    }
}
