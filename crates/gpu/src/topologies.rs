//! Triangles and edges on the device, each topology once for as long as it lives.

use crate::layout::{ENCLOSES, MOST_LINES, OPEN, SIDES};
use pcadlang_scene::geom::{NO_FACE, Revolution, Topology};
use rustc_hash::FxHashMap;
use std::sync::{Arc, Weak};

/// Words after which everything is forgotten before the next call.
const MOST_WORDS: usize = 1 << 24;

/// Kinds of surfaces of revolution, likewise: they are searched one by one.
const MOST_REVOLUTIONS: usize = 64;

/// Where the words of a topology are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place {
    pub triangles: u32,
    pub triangle_count: u32,
    pub edges: u32,
    pub edge_count: u32,
    pub lines: u32,
    pub line_count: u32,
    pub flags: u32,
    /// The vertices that it needs.
    pub vertices: u32,
}

/// A held topology, so that its address stays its own, and its place if it can be drawn.
type Entry = (Weak<Topology>, Option<Place>);

/// The words of all topologies, as the device has them up to `sent`.
#[derive(Default)]
pub struct Topologies {
    pub words: Vec<u32>,
    pub sent: usize,
    meshes: FxHashMap<usize, Entry>,
    revolutions: Vec<Like>,
}

/// Surfaces of revolution like this one, which differ in their rings only.
struct Like {
    surface: Arc<Revolution>,
    rising: bool,
    place: Option<Place>,
}

/// True if heights never fall along the path.
fn is_rising(surface: &Revolution) -> bool {
    surface.rings().is_sorted_by(|a, b| a.y <= b.y)
}

/// An edge: its vertices and faces.
type Sharp = ([u32; 2], [u32; 2]);

impl Topologies {
    /// Forgets everything if it has become much. Not while places are in use.
    pub fn tidy(&mut self) {
        if self.words.len() > MOST_WORDS || self.revolutions.len() > MOST_REVOLUTIONS {
            *self = Topologies::default();
        }
    }

    /// The place of a mesh's topology, `None` within if it cannot be drawn on the device;
    /// `None` if it is not known yet.
    pub fn mesh(&self, topology: &Arc<Topology>) -> Option<Option<Place>> {
        self.meshes.get(&(Arc::as_ptr(topology) as usize)).map(|(_, place)| *place)
    }

    /// Adds the topology of a mesh.
    pub fn add_mesh(&mut self, topology: &Arc<Topology>) {
        if self.mesh(topology).is_some() {
            return;
        }
        let lines: Vec<Vec<Sharp>> = topology
            .edges
            .lines()
            .map(|line| line.iter().map(|e| (e.vertices, e.faces)).collect())
            .collect();
        let flags = if topology.encloses { ENCLOSES } else { 0 };
        let place = self.add(&topology.triangles, &lines, flags);
        let address = Arc::as_ptr(topology) as usize;
        self.meshes.insert(address, (Arc::downgrade(topology), place));
    }

    /// The place of a surface of revolution's mesh of [`SIDES`] sides, whose vertices are
    /// numbered ring by ring; `None` as for meshes.
    pub fn revolution(&self, surface: &Revolution) -> Option<Option<Place>> {
        let like = |known: &Like| {
            known.rising == is_rising(surface)
                && known.surface.rings().len() == surface.rings().len()
                && known.surface.spans() == surface.spans()
                && known.surface.rims() == surface.rims()
        };
        self.revolutions.iter().rev().find(|known| like(known)).map(|known| known.place)
    }

    /// Adds the mesh of a surface of revolution.
    pub fn add_revolution(&mut self, surface: &Arc<Revolution>) {
        if self.revolution(surface).is_some() {
            return;
        }
        let (spans, rims, rising) = (surface.spans(), surface.rims(), is_rising(surface));
        let vertex = |ring: usize, side: u32| ring as u32 * SIDES + side % SIDES;
        let mut triangles = Vec::with_capacity(2 * SIDES as usize * spans.len());
        for span in spans {
            for k in 0..SIDES {
                let [a, b] = [0, 1].map(|i| vertex(span.ring + i, k));
                let [c, d] = [0, 1].map(|i| vertex(span.ring + i, k + 1));
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        let lines: Vec<Vec<Sharp>> = rims
            .iter()
            .map(|rim| {
                // The span before a rim ends there (its first triangles), the one after it
                // begins there (its second ones).
                let faces = |k: u32| {
                    let face = |i: usize| {
                        let first = rim.spans[i].map(|s| (s as u32 * SIDES + k) * 2);
                        first.map(|f| f + i as u32)
                    };
                    match [face(0), face(1)] {
                        [Some(a), b] => [a, b.unwrap_or(NO_FACE)],
                        [None, b] => [b.unwrap_or(NO_FACE), NO_FACE],
                    }
                };
                let edge = |k| ([vertex(rim.ring, k), vertex(rim.ring, k + 1)], faces(k));
                (0..SIDES).map(edge).collect()
            })
            .collect();
        let closed = rims.iter().all(|r| r.spans.iter().all(Option::is_some));
        let place = self.add(&triangles, &lines, if closed && rising { ENCLOSES } else { 0 });
        self.revolutions.push(Like { surface: Arc::clone(surface), rising, place });
    }

    fn add(&mut self, triangles: &[[u32; 3]], lines: &[Vec<Sharp>], flags: u32) -> Option<Place> {
        let edges: Vec<(usize, &Sharp)> = lines
            .iter()
            .enumerate()
            .flat_map(|(i, line)| line.iter().map(move |e| (i, e)))
            .collect();
        let faces = triangles.len() as u32;
        let known = |face: u32| face == NO_FACE || face < faces;
        let sound = edges.iter().all(|(_, (_, [a, b]))| known(*a) && known(*b));
        if !sound || triangles.is_empty() || lines.len() > MOST_LINES {
            return None;
        }
        let ends = edges.iter().flat_map(|(_, (vertices, _))| vertices);
        let vertices = triangles.as_flattened().iter().chain(ends).max()?.checked_add(1)?;
        let room = 3 * triangles.len() + 5 * edges.len() + 2 * lines.len();
        u32::try_from(self.words.len() + room).ok()?;
        let triangle_at = self.words.len() as u32;
        self.words.extend(triangles.as_flattened());
        let edges_at = self.words.len() as u32;
        for (line, ([a, b], [f, g])) in &edges {
            self.words.extend([*a, *b, *f, *g, *line as u32]);
        }
        let lines_at = self.words.len() as u32;
        let (mut past, mut open) = (0, 0);
        for line in lines {
            past += line.len() as u32;
            let boundary = line.first().is_some_and(|(_, faces)| faces[1] == NO_FACE);
            self.words.extend([past, u32::from(boundary)]);
            open |= if boundary { OPEN } else { 0 };
        }
        Some(Place {
            triangles: triangle_at,
            triangle_count: faces,
            edges: edges_at,
            edge_count: edges.len() as u32,
            lines: lines_at,
            line_count: lines.len() as u32,
            flags: flags | open,
            vertices,
        })
    }
}
