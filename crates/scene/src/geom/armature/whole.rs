//! The surface of a body as one mesh, in the order of its parts: what needs no parts, such as
//! what the body covers of a picture, sees no seams between them, and handles each vertex once.

use super::body::Part;
use crate::geom::{Side, Sides};
use std::ops::Range;

/// The surface; its vertices are those of the parts in turn, each where it comes first.
#[derive(Debug)]
pub(crate) struct Whole {
    /// For each vertex, its index in the body.
    pub order: Vec<u32>,
    /// For each vertex, its number among those of the parts' meshes.
    pub numbers: Vec<u32>,
    /// For each vertex of the parts' meshes in turn, its index here.
    pub of_parts: Vec<u32>,
    /// The triangles of the parts in turn.
    pub triangles: Vec<[u32; 3]>,
    sides: Sides,
    /// By part.
    pub stretches: Vec<Stretch>,
}

/// What of the surface is of one part.
#[derive(Debug, Default)]
pub(crate) struct Stretch {
    /// The vertices that no part before it has.
    pub vertices: Range<usize>,
    /// The triangles.
    pub faces: Range<usize>,
    /// The sides whose first face is one of them.
    pub sides: Range<usize>,
    /// The parts of these sides' second faces.
    pub beside: Vec<usize>,
}

impl Whole {
    /// The surface of these parts of a body with this number of vertices.
    pub(super) fn new(parts: &[Part], vertices: usize) -> Whole {
        let (mut order, mut numbers, mut of_parts) = (Vec::new(), Vec::new(), Vec::new());
        let (mut triangles, mut part_of) = (Vec::new(), Vec::new());
        let mut stretches: Vec<Stretch> = Vec::with_capacity(parts.len());
        let mut own = vec![u32::MAX; vertices];
        for (k, part) in parts.iter().enumerate() {
            let (first_vertex, first_face) = (order.len(), triangles.len());
            for v in &part.vertices {
                let place = &mut own[*v as usize];
                if *place == u32::MAX {
                    *place = order.len() as u32;
                    numbers.push(of_parts.len() as u32);
                    order.push(*v);
                }
                of_parts.push(*place);
            }
            let here = |v: u32| own[part.vertices[v as usize] as usize];
            triangles.extend(part.topology.triangles.iter().map(|t| t.map(here)));
            part_of.resize(triangles.len(), k);
            let (vertices, faces) = (first_vertex..order.len(), first_face..triangles.len());
            stretches.push(Stretch { vertices, faces, ..Stretch::default() });
        }
        let sides = Sides::default();
        let mut at = 0;
        for stretch in &mut stretches {
            let all = &sides.of(&triangles)[at..];
            let count = all.partition_point(|s| (s.faces[0] as usize) < stretch.faces.end);
            let second = all[..count].iter().filter_map(|s| part_of.get(s.faces[1] as usize));
            stretch.beside = second.copied().collect();
            stretch.beside.sort_unstable();
            stretch.beside.dedup();
            stretch.sides = at..at + count;
            at += count;
        }
        Whole { order, numbers, of_parts, triangles, sides, stretches }
    }

    /// The sides of the triangles.
    pub fn sides(&self) -> &[Side] {
        self.sides.of(&self.triangles)
    }
}
