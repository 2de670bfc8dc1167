//! Clusters against the faces that they are made from.

use super::*;
use crate::geom::{Mesh, Solid};

fn ball() -> Solid {
    Solid::new(crate::geom::sphere(1.0, 50).unwrap().into())
}

/// The leaves below a node, in order.
fn leaves<const D: usize>(nodes: &[Node<D>], at: u32, out: &mut Vec<u32>) {
    if at >= LEAF {
        return out.push(at - LEAF);
    }
    let node = &nodes[at as usize];
    for i in 0..WIDE {
        if node.sides[0][0].to_array()[i] <= node.sides[1][0].to_array()[i] {
            leaves(nodes, node.children[i], out);
        }
    }
}

#[test]
fn every_face_is_in_one_leaf_inside_of_all_boxes() {
    let solid = ball();
    let mesh = &solid.instances()[0].mesh;
    let trees = Trees::new(mesh.shape()).unwrap();
    let count = mesh.topology.triangles.len();
    let (mut below, mut seen) = (Vec::new(), vec![0; count]);
    leaves(&trees.surface.nodes, trees.surface.root, &mut below);
    assert_eq!(below.len(), trees.surface.leaves.len());
    for leaf in &trees.surface.leaves {
        for i in (0..WIDE).filter(|i| !leaf.corners[0][0].to_array()[*i].is_nan()) {
            seen[leaf.faces[i] as usize] += 1;
            let corners = mesh.topology.triangles[leaf.faces[i] as usize];
            for (own, v) in leaf.corners.iter().zip(corners) {
                assert_eq!(own.map(|row| row.to_array()[i]), mesh.positions[v as usize].to_array());
            }
        }
    }
    assert!(seen.iter().all(|n| *n == 1));
    for node in &trees.surface.nodes {
        for (i, child) in node.children.iter().enumerate() {
            if node.sides[0][0].to_array()[i] > node.sides[1][0].to_array()[i] {
                continue;
            }
            let mut own = Vec::new();
            leaves(&trees.surface.nodes, *child, &mut own);
            for (axis, (low, high)) in node.sides[0].iter().zip(&node.sides[1]).enumerate() {
                let corners = own.iter().flat_map(|leaf| {
                    trees.surface.leaves[*leaf as usize]
                        .corners
                        .iter()
                        .flat_map(|c| c[axis].to_array())
                });
                assert!(
                    corners
                        .filter(|v| !v.is_nan())
                        .all(|v| (low.to_array()[i]..=high.to_array()[i]).contains(&v))
                );
            }
        }
    }
    // Nearly all leaves are full.
    assert!(trees.surface.leaves.len() <= count.div_ceil(WIDE) + 1);
}

#[test]
fn faces_by_facing_have_their_vertices() {
    let solid = ball();
    let mesh = &solid.instances()[0].mesh;
    let trees = Trees::new(mesh.shape()).unwrap();
    let mut seen = vec![0; mesh.topology.triangles.len()];
    let mut below = Vec::new();
    leaves(&trees.facing.nodes, trees.facing.root, &mut below);
    assert_eq!(below.len(), trees.facing.leaves.len());
    for leaf in &trees.facing.leaves {
        for (corners, face) in leaf.corners.iter().zip(&leaf.faces).filter(|(c, _)| **c != 0) {
            seen[*face as usize] += 1;
            for (k, v) in mesh.topology.triangles[*face as usize].into_iter().enumerate() {
                let own = usize::from(corners >> (4 * k) & 15);
                assert_eq!(leaf.vertices[own], v);
                let plane = leaf.planes.map(|row| row[own / 8].to_array()[own % 8]);
                let (p, n) = (mesh.positions[v as usize], mesh.normals[v as usize]);
                assert_eq!(plane[..3], n.to_array());
                let along = n.as_dvec3().dot(p.as_dvec3() - trees.facing.middle);
                assert_eq!(plane[3], along as f32);
            }
        }
    }
    assert!(seen.iter().all(|n| *n == 1));
    assert!(trees.facing.leaves.len() < mesh.topology.triangles.len() / 6);
}

#[test]
fn unsound_meshes_have_no_trees() {
    let solid = ball();
    let mesh = &solid.instances()[0].mesh;
    assert!(Trees::new(mesh.shape()).is_some());
    let mut few = Mesh::clone(mesh);
    few.normals.pop();
    assert!(Trees::new(few.shape()).is_none());
    let mut unused = Mesh::clone(mesh);
    unused.positions.push(glam::Vec3::ZERO);
    unused.normals.push(glam::Vec3::Y);
    assert!(Trees::new(unused.shape()).is_none());
    let mut far = Mesh::clone(mesh);
    far.positions[3].x = f32::INFINITY;
    assert!(Trees::new(far.shape()).is_none());
    let mut other = Mesh::clone(mesh);
    other.normals[3].y = f32::NAN;
    assert!(Trees::new(other.shape()).is_none());
    // Made for other lists than these.
    let made = Mesh::clone(mesh);
    assert!(made.clusters.make(made.shape()).is_some() && made.drawn().is_some());
    let moved = Mesh { positions: made.positions.clone(), ..made };
    assert!(moved.drawn().is_none());
}
