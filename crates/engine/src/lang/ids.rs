//! Typed indices: one kind of number for each kind of table, so that none is used for another.

use std::ops::{Add, Index, IndexMut, Sub};

macro_rules! table {
    ($id:ident, $table:ty) => {
        impl<T> Index<$id> for $table {
            type Output = T;

            #[inline]
            fn index(&self, id: $id) -> &T {
                &self[id.0 as usize]
            }
        }

        impl<T> IndexMut<$id> for $table {
            #[inline]
            fn index_mut(&mut self, id: $id) -> &mut T {
                &mut self[id.0 as usize]
            }
        }
    };
}

macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident;)*) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub u32);

        impl $name {
            /// The index of nothing.
            pub const NONE: $name = $name(u32::MAX);

            /// Returns the id with this index.
            pub fn new(index: usize) -> $name {
                $name(index as u32)
            }

            /// Returns the index.
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        table!($name, [T]);
        table!($name, Vec<T>);
    )* };
}

ids! {
    /// The index of a block in [`Code::blocks`](super::code::Code::blocks).
    BlockId;
    /// The index of a slot in a block.
    Slot;
    /// The index of an operation in [`Code::ops`](super::code::Code::ops).
    OpId;
    /// The index of a site in [`Code::sites`](super::code::Code::sites).
    SiteId;
    /// The index of a node of a trace.
    NodeId;
    /// The index of a frame of a trace.
    FrameId;
}

/// A place in a run of consecutive ones, one for each slot of a block.
macro_rules! run_of_slots {
    ($($name:ident)*) => { $(
        impl Add<Slot> for $name {
            type Output = $name;

            #[inline]
            fn add(self, slot: Slot) -> $name {
                $name(self.0 + slot.0)
            }
        }

        impl Sub<Slot> for $name {
            type Output = $name;

            #[inline]
            fn sub(self, slot: Slot) -> $name {
                $name(self.0 - slot.0)
            }
        }

        impl Sub for $name {
            type Output = Slot;

            #[inline]
            fn sub(self, first: $name) -> Slot {
                Slot(self.0 - first.0)
            }
        }
    )* };
}

run_of_slots!(NodeId OpId);

impl NodeId {
    /// Returns the container that this node reads as a whole: it is in the previous slot.
    #[inline]
    pub fn container(self) -> NodeId {
        NodeId(self.0 - 1)
    }

    /// Returns the node that reads this container as a whole: it is in the next slot.
    #[inline]
    pub fn gather(self) -> NodeId {
        NodeId(self.0 + 1)
    }
}

impl BlockId {
    /// The top level.
    pub const ROOT: BlockId = BlockId(0);
}

impl FrameId {
    /// The frame of the top level.
    pub const ROOT: FrameId = FrameId(0);
}
