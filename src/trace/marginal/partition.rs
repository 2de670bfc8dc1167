//! Which choices are summed out together: a partition that only ever gets coarser.

/// Groups of the numbers below some bound (union-find).
#[derive(Clone, Debug, Default)]
pub(super) struct Partition {
    parent: Vec<u32>,
    /// How many joins made it coarser.
    joins: usize,
}

impl Partition {
    /// The same groups with more members, each of the new ones alone.
    pub fn grow(&mut self, len: usize) {
        self.parent.extend(self.parent.len() as u32..len as u32);
    }

    /// The least member of a group.
    pub fn root(&self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            i = self.parent[i as usize];
        }
        i
    }

    /// Makes the groups of two members one.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            self.parent[a.max(b) as usize] = a.min(b);
            self.joins += 1;
        }
    }

    /// Changes whenever the partition does.
    pub fn joins(&self) -> usize {
        self.joins
    }
}
