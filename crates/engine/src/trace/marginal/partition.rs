//! Which choices are summed out together: a partition that only becomes coarser.

/// Groups of the numbers below some bound (union-find).
#[derive(Clone, Debug, Default)]
pub(super) struct Partition {
    parent: Vec<u32>,
    /// The number of joins that made it coarser.
    joins: usize,
}

impl Partition {
    /// Adds members up to `len`, each in its own group.
    pub fn grow(&mut self, len: usize) {
        self.parent.extend(self.parent.len() as u32..len as u32);
    }

    /// Returns the least member of a group.
    pub fn root(&self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            i = self.parent[i as usize];
        }
        i
    }

    /// Merges the groups of two members.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            self.parent[a.max(b) as usize] = a.min(b);
            self.joins += 1;
        }
    }

    /// A count that changes whenever the partition does.
    pub fn joins(&self) -> usize {
        self.joins
    }
}
