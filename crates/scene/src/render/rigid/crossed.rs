//! The faces that smooth silhouettes cross.

use super::lanes::{Lanes, Work, widest};
use super::{Posed, ROUNDING};
use crate::geom::{Few, LEAF, Mesh, Node};
use crate::render::pixels::triangle::bits;

/// Facing below this, relative to the sum of magnitudes that make it up, may have the other
/// sign.
const MARGIN: f32 = ROUNDING as f32;

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
    pub fn find(&mut self, posed: &Posed<'_>) {
        let Found { words, odd, corners, faced } = self;
        let triangles = &posed.mesh.topology.triangles;
        corners.clear();
        words.clear();
        words.resize(triangles.len().div_ceil(64), 0);
        if odd.len() < triangles.len() {
            odd.resize(triangles.len(), 0);
        }
        *faced += Few::MOST * widest(Search { posed, words, odd });
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

/// Marks the faces in `words`, writes into `odd` how their corners differ, and returns the
/// number of leaves looked at.
struct Search<'a> {
    posed: &'a Posed<'a>,
    words: &'a mut [u64],
    odd: &'a mut [u8],
}

impl Work for Search<'_> {
    type Out = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let Search { posed, words, odd } = self;
        let tree = &posed.trees.facing;
        let mut looked = 0;
        let mut waiting = [0u32; 128];
        waiting[0] = tree.root;
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let at = waiting[count & 127];
            if at < LEAF {
                let Some(node) = tree.nodes.get(at as usize) else { continue };
                for i in bits(u64::from(undecided(lanes, node, &posed.facing))) {
                    waiting[count & 127] = node.children[i & 7];
                    count += 1;
                }
                continue;
            }
            let Some(leaf) = tree.leaves.get((at - LEAF) as usize) else { continue };
            looked += 1;
            let front = fronts(lanes, leaf, posed);
            if front == 0 || front == 0xffff {
                continue;
            }
            // Written to an entry that the next face overwrites unless this one counts: a
            // branch would be unpredictable.
            let (mut found, mut own) = ([(0, 0); Few::MOST], 0);
            for (corners, face) in leaf.corners.iter().zip(&leaf.faces) {
                let corner = |k: u32| front >> (corners >> (4 * k) & 15);
                let differ = ((corner(0) ^ corner(1)) & 1) | (((corner(0) ^ corner(2)) & 1) << 1);
                found[own & 15] = (*face, differ);
                own += usize::from(differ != 0);
            }
            for (face, differ) in &found[..own.min(Few::MOST)] {
                if let (Some(word), Some(odd)) =
                    (words.get_mut(*face as usize / 64), odd.get_mut(*face as usize))
                {
                    *word |= 1 << (face % 64);
                    *odd = *differ as u8;
                }
            }
        }
        looked
    }
}

/// The children, as bits, whose planes may face the camera or not.
#[inline(always)]
fn undecided<L: Lanes>(lanes: L, node: &Node<4>, factors: &[f32; 4]) -> u32 {
    let (mut least, mut most) = (lanes.all(0.0), lanes.all(0.0));
    for (axis, factor) in factors.iter().enumerate() {
        let turned = usize::from(*factor < 0.0);
        let side = |side: usize| lanes.mul(lanes.load(&node.sides[side][axis]), lanes.all(*factor));
        least = lanes.add(least, side(turned));
        most = lanes.add(most, side(1 - turned));
    }
    // False for NaN, where there is no child.
    lanes.at_most(least, lanes.all(MARGIN)) & lanes.at_most(lanes.all(-MARGIN), most)
}

/// Whether each vertex faces the camera, as bits.
#[inline(always)]
fn fronts<L: Lanes>(lanes: L, leaf: &Few, posed: &Posed<'_>) -> u32 {
    let (mut front, mut unsure) = (0, 0);
    for half in 0..2 {
        let mut facing = lanes.all(0.0);
        for (row, factor) in leaf.planes.iter().zip(&posed.facing) {
            facing = lanes.add(facing, lanes.mul(lanes.load(&row[half]), lanes.all(*factor)));
        }
        front |= lanes.at_most(lanes.all(0.0), facing) << (8 * half);
        let near =
            lanes.at_most(facing, lanes.all(MARGIN)) & lanes.at_most(lanes.all(-MARGIN), facing);
        unsure |= near << (8 * half);
    }
    for i in bits(u64::from(unsure)) {
        let own = u32::from(faces_camera(posed, leaf.vertices[i & 15]));
        front = (front & !(1 << i)) | (own << i);
    }
    front
}

/// Whether a vertex faces the camera, as for whole meshes.
#[inline(never)]
fn faces_camera(posed: &Posed<'_>, v: u32) -> bool {
    let Mesh { positions, normals, .. } = posed.mesh;
    let (view, bend) = posed.placement.sight();
    let [p, n] = [positions, normals]
        .map(|list| list.get(v as usize).copied().unwrap_or_default().as_dvec3());
    let facing =
        n.x * (view.x - p.x * bend) + n.y * (view.y - p.y * bend) + n.z * (view.z - p.z * bend);
    facing >= 0.0
}
