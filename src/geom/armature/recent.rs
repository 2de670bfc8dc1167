//! The meshes of the last poses of each thread, by part: a pose that moves a part as one
//! of them did shares its mesh.
//!
//! Only saves work: what it gives equals what would be made. Sharing matters to
//! renderers, which keep what they drew of a mesh.

use super::Armature;
use crate::geom::Instance;
use glam::Affine3A;
use std::cell::RefCell;
use std::sync::{Arc, Weak};

/// Bodies remembered, and poses of each part: the present one and what a few proposals
/// tried.
const BODIES: usize = 4;
const POSES: usize = 4;

/// What moved a part, and what it made.
type Moved = (Vec<Affine3A>, Instance);

struct Known {
    body: Weak<Armature>,
    /// By part, the latest first.
    parts: Vec<Vec<Moved>>,
}

thread_local! {
    static KNOWN: RefCell<Vec<Known>> = const { RefCell::new(Vec::new()) };
}

/// What transforms are told by: equal numbers are not enough, 0 and -0 may make other
/// zeros.
fn bits(t: &Affine3A) -> [u32; 12] {
    t.to_cols_array().map(f32::to_bits)
}

/// The mesh of each part under the transforms of all joints.
pub(super) fn parts(body: &Arc<Armature>, transforms: &[Affine3A]) -> Vec<Instance> {
    KNOWN.with_borrow_mut(|known| {
        match known.iter().position(|k| std::ptr::eq(k.body.as_ptr(), Arc::as_ptr(body))) {
            Some(i) => known[..=i].rotate_right(1),
            None => {
                known.retain(|k| k.body.strong_count() > 0);
                known.truncate(BODIES - 1);
                let parts = body.parts().iter().map(|_| Vec::with_capacity(POSES)).collect();
                known.insert(0, Known { body: Arc::downgrade(body), parts });
            }
        }
        let parts = body.parts().iter().enumerate().zip(&mut known[0].parts);
        parts
            .map(|((i, part), poses)| {
                let own = || part.joints.iter().map(|j| &transforms[usize::from(*j)]);
                match poses.iter().position(|(moved, _)| moved.iter().map(bits).eq(own().map(bits)))
                {
                    Some(i) => poses[..=i].rotate_right(1),
                    None => {
                        poses.truncate(POSES - 1);
                        poses.insert(0, (own().copied().collect(), body.skinned(i, transforms)));
                    }
                }
                poses[0].1.clone()
            })
            .collect()
    })
}
