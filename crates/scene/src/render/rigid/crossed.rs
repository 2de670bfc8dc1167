//! The faces that smooth silhouettes cross.

use super::Posed;
use crate::geom::{Few, LEAF, Node};
use crate::render::pixels::triangle::bits;
use glam::DVec3;
use wide::f32x8;

/// The faces found, in their order. Reused from mesh to mesh.
#[derive(Default)]
pub(in crate::render) struct Found {
    /// A bit for each face.
    words: Vec<u64>,
    /// For each face found, how its corners differ; meaningless for others.
    odd: Vec<u8>,
    /// Faces with the corner whose facing differs from the others' first.
    pub corners: Vec<[u32; 3]>,
    /// Faces of which the facing was computed.
    pub faced: usize,
}

impl Found {
    /// Finds the faces of a mesh whose corners do not all have the same sign of facing.
    #[inline(always)]
    pub fn find(&mut self, posed: &Posed<'_>) {
        let Found { words, odd, corners, faced } = self;
        let (tree, triangles) = (&posed.trees.facing, &posed.mesh.topology.triangles);
        corners.clear();
        words.clear();
        words.resize(triangles.len().div_ceil(64), 0);
        if odd.len() < triangles.len() {
            odd.resize(triangles.len(), 0);
        }
        let (view, bend) = posed.placement.sight();
        let margin = super::ROUNDING as f32;
        let mut waiting = [0u32; 128];
        waiting[0] = tree.root;
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let at = waiting[count];
            if at < LEAF {
                let Some(node) = tree.nodes.get(at as usize) else { continue };
                for i in bits(u64::from(undecided(node, &posed.facing, margin))) {
                    waiting[count & 127] = node.children[i & 7];
                    count += 1;
                }
                continue;
            }
            let Some(leaf) = tree.leaves.get((at - LEAF) as usize) else { continue };
            *faced += Few::MOST;
            let front = fronts(leaf, view, bend);
            let all = u128::from_le_bytes(front);
            if all == 0 || all == u128::MAX / 255 {
                continue;
            }
            for (corners, face) in leaf.corners.iter().zip(&leaf.faces) {
                let [a, b, c] = corners.map(|i| front[usize::from(i) & 15]);
                let differ = (a ^ b) | ((a ^ c) << 1);
                if differ == 0 {
                    continue;
                }
                if let (Some(word), Some(odd)) =
                    (words.get_mut(*face as usize / 64), odd.get_mut(*face as usize))
                {
                    *word |= 1 << (face % 64);
                    *odd = differ;
                }
            }
        }
        for (i, word) in words.iter().enumerate() {
            for bit in bits(*word) {
                let face = i * 64 + bit;
                let (Some(&[a, b, c]), Some(odd)) = (triangles.get(face), odd.get(face)) else {
                    continue;
                };
                corners.push(match odd {
                    1 => [b, c, a],
                    2 => [c, a, b],
                    _ => [a, b, c],
                });
            }
        }
    }
}

/// The children, as bits, whose planes may face the camera or not.
#[inline(always)]
fn undecided(node: &Node<4>, factors: &[f32; 4], margin: f32) -> u32 {
    let (mut least, mut most) = (f32x8::ZERO, f32x8::ZERO);
    for (axis, factor) in factors.iter().enumerate() {
        let turned = usize::from(*factor < 0.0);
        let side = |side: usize| node.sides[side][axis] * f32x8::splat(*factor);
        least += side(turned);
        most += side(1 - turned);
    }
    // False for NaN, where there is no child.
    let margin = f32x8::splat(margin);
    (least.simd_le(margin) & most.simd_ge(-margin)).to_bitmask()
}

/// Whether each vertex faces the camera, 1 or 0.
#[inline(always)]
fn fronts(leaf: &Few, view: DVec3, bend: f64) -> [u8; Few::MOST] {
    let ([px, py, pz], [nx, ny, nz]) = (&leaf.positions, &leaf.normals);
    let mut facing = [0.0; Few::MOST];
    for i in 0..Few::MOST {
        let [px, py, pz] = [px[i], py[i], pz[i]].map(f64::from);
        let [nx, ny, nz] = [nx[i], ny[i], nz[i]].map(f64::from);
        facing[i] =
            nx * (view.x - px * bend) + ny * (view.y - py * bend) + nz * (view.z - pz * bend);
    }
    facing.map(|facing| u8::from(facing >= 0.0))
}
