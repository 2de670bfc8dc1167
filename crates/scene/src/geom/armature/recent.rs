//! Cached meshes of each thread's last poses, by part: poses that move a part in the same
//! way share its mesh.
//!
//! The cache only saves work: results do not depend on it. Renderers benefit from shared
//! meshes, because they cache what they draw of a mesh.

use super::Armature;
use crate::geom::Instance;
use glam::Affine3A;
use std::cell::RefCell;
use std::sync::{Arc, Weak};

/// The number of bodies remembered, and of poses of each part: the current pose, and a
/// few from recent proposals.
const BODIES: usize = 4;
const POSES: usize = 4;

/// The transforms that moved a part, and the resulting instance.
type Moved = (Vec<Affine3A>, Instance);

struct Known {
    body: Weak<Armature>,
    /// By part, the most recent first.
    parts: Vec<Vec<Moved>>,
}

thread_local! {
    static KNOWN: RefCell<Vec<Known>> = const { RefCell::new(Vec::new()) };
}

/// The bits that identify a transform. Equal numbers do not suffice: 0 and -0 can produce
/// results that differ in the sign of zeros.
fn bits(t: &Affine3A) -> [u32; 12] {
    t.to_cols_array().map(f32::to_bits)
}

/// Returns the mesh of each part under the transforms of all joints.
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
