//! Levels of detail: coarser versions of meshes that keep a subset of the vertices, for
//! pictures in which the difference is invisible.
//!
//! A coarse version has positions and normals of the original mesh, so derivatives with
//! respect to its vertices are derivatives with respect to the mesh's. It also bounds the
//! distance to the vertices it omits. Invariant: which versions exist depends on how a
//! mesh was made (a lathe's points, a file, a body at rest), never on earlier queries.

mod decimate;
mod level;
mod quadric;
mod turned;

use super::{Mesh, Topology};
use decimate::{Coarsened, Fine, decimate};
use glam::{DVec3, Vec3};
use rustc_hash::FxHashSet;
use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

pub(super) use level::Level;
pub(super) use turned::Turned;

/// A coarser version of a mesh.
#[derive(Debug)]
pub struct Coarse {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// For each of its vertices, the index in the original mesh.
    pub vertices: Arc<[u32]>,
}

impl Coarse {
    /// Makes a coarse mesh of the given vertices and topology.
    fn of(mesh: &Mesh, vertices: Arc<[u32]>, topology: Arc<Topology>) -> Coarse {
        let pick = |list: &[Vec3]| {
            vertices.iter().filter_map(|v| list.get(*v as usize)).copied().collect()
        };
        let (positions, normals) = (pick(&mesh.positions), pick(&mesh.normals));
        Coarse { mesh: Arc::new(Mesh::of(positions, normals, topology)), vertices }
    }
}

/// A source of levels for meshes of one topology, or for the parts of a whole.
pub(super) trait Levels: fmt::Debug + Send + Sync {
    /// Returns the levels of a part, each coarser than the one before.
    fn levels(&self, part: usize) -> &[Level];
}

#[derive(Debug)]
enum Source {
    /// A mesh of fixed shape.
    Rigid(OnceLock<Vec<Level>>),
    /// A part of a posed body.
    Posed(Arc<dyn Levels>, usize),
    Turned(Turned),
}

/// Identifies a version: 0 and the index of a level, or the steps between meridians and
/// rings.
type Key = (u32, usize);

/// The coarser versions of one mesh, each made on first use.
#[derive(Debug)]
pub struct Detail {
    source: Source,
    /// The centre and radius of a ball around the mesh.
    ball: OnceLock<(DVec3, f64)>,
    /// The versions made so far.
    made: Mutex<Vec<(Key, Arc<Coarse>)>>,
}

impl Detail {
    fn new(source: Source) -> Detail {
        Detail { source, ball: OnceLock::new(), made: Mutex::default() }
    }

    /// For a mesh that will be drawn many times: its levels are computed once, in about a
    /// second for 100,000 triangles.
    pub(super) fn rigid() -> Detail {
        Detail::new(Source::Rigid(OnceLock::new()))
    }

    /// For a part of a posed body.
    pub(super) fn posed(levels: Arc<dyn Levels>, part: usize) -> Detail {
        Detail::new(Source::Posed(levels, part))
    }

    /// For a surface of revolution.
    pub(super) fn turned(turned: Turned) -> Detail {
        Detail::new(Source::Turned(turned))
    }

    /// Returns the coarsest version of the mesh that is within `error` (in the mesh's
    /// units) of every vertex it omits; `None` if that is the mesh itself.
    pub(super) fn within(&self, mesh: &Mesh, error: f64) -> Option<Arc<Coarse>> {
        let last = |levels: &[Level], fits: &dyn Fn(&Level) -> bool| {
            levels.iter().rposition(fits).map(|i| (0, i))
        };
        let key = match &self.source {
            Source::Rigid(levels) => {
                last(rigid_levels(levels, mesh), &|level| level.deviation <= error)
            }
            Source::Posed(levels, part) => {
                last(levels.levels(*part), &|level| !level.exceeds(&mesh.positions, error))
            }
            Source::Turned(turned) => turned.steps(error).map(|s| (s.sides, s.rings)),
        }?;
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, coarse)) = made.iter().find(|(k, _)| *k == key) {
            return Some(Arc::clone(coarse));
        }
        let coarse = Arc::new(match &self.source {
            Source::Rigid(levels) => rigid_levels(levels, mesh).get(key.1)?.of(mesh),
            Source::Posed(levels, part) => levels.levels(*part).get(key.1)?.of(mesh),
            Source::Turned(turned) => {
                turned.coarse(mesh, turned::Steps { sides: key.0, rings: key.1 })
            }
        });
        made.push((key, Arc::clone(&coarse)));
        Some(coarse)
    }

    /// Returns the centre and radius of a ball around the mesh.
    pub(super) fn ball(&self, mesh: &Mesh) -> (DVec3, f64) {
        *self.ball.get_or_init(|| {
            let centre = mesh.bounds().map_or(DVec3::ZERO, |b| b.centre());
            let far = |r: f64, p: &Vec3| r.max(p.as_dvec3().distance_squared(centre));
            (centre, mesh.positions.iter().fold(0.0, far).sqrt())
        })
    }
}

fn rigid_levels<'a>(levels: &'a OnceLock<Vec<Level>>, mesh: &Mesh) -> &'a [Level] {
    levels.get_or_init(|| {
        levels_of(&mesh.positions, &mesh.topology).into_iter().map(Level::rigid).collect()
    })
}

/// Returns the levels of the parts of a smooth body; each part has its own list of the
/// body's vertices. The body is simplified as a whole, so that parts still meet at every
/// level.
pub(super) fn levels_of_parts(
    positions: &[Vec3],
    parts: &[(&[u32], &Topology)],
) -> Vec<Vec<Level>> {
    let triangles =
        parts.iter().flat_map(|(own, t)| t.triangles.iter().map(|t| t.map(|v| own[v as usize])));
    let numbers =
        parts.iter().zip(0u16..).flat_map(|((_, t), i)| t.triangles.iter().map(move |_| i));
    let (triangles, numbers): (Vec<_>, Vec<_>) = (triangles.collect(), numbers.collect());
    let steps = decimate(&Fine { positions, triangles: &triangles, parts: &numbers, creases: &[] });
    let mut of_part = vec![u32::MAX; positions.len()];
    let one = |((own, topology), number): (&(&[u32], &Topology), u16)| {
        let at: Vec<Vec3> = own.iter().map(|v| positions[*v as usize]).collect();
        own.iter().zip(0..).for_each(|(v, i)| of_part[*v as usize] = i);
        // Where parts meet at a point but share no edge, a collapse can give one of them
        // a vertex of another; its levels end there.
        let mine = |v: u32| Some(of_part[v as usize]).filter(|i| *i != u32::MAX);
        let part = |step: &Coarsened| {
            let theirs =
                step.triangles.iter().zip(&step.parts).filter(|(_, part)| **part == number);
            let triangles = theirs.map(|([a, b, c], _)| Some([mine(*a)?, mine(*b)?, mine(*c)?]));
            let triangles = triangles.collect::<Option<Vec<[u32; 3]>>>()?;
            let merged =
                own.iter().map(|v| mine(step.merged[*v as usize])).collect::<Option<Vec<u32>>>()?;
            let parts = vec![0; triangles.len()];
            Some(Level::new(
                &at,
                topology,
                &Coarsened { triangles, parts, creases: FxHashSet::default(), merged },
            ))
        };
        let levels = steps.iter().map_while(part).collect();
        own.iter().for_each(|v| of_part[*v as usize] = u32::MAX);
        levels
    };
    parts.iter().zip(0u16..).map(one).collect()
}

/// Returns the levels of a mesh, each coarser than the one before.
fn levels_of(positions: &[Vec3], topology: &Topology) -> Vec<Level> {
    let creases: Vec<[u32; 2]> =
        topology.edges.iter().filter(|e| e.crease).map(|e| e.vertices).collect();
    let fine = Fine {
        positions,
        triangles: &topology.triangles,
        parts: &topology.parts,
        creases: &creases,
    };
    decimate(&fine).iter().map(|step| Level::new(positions, topology, step)).collect()
}

#[cfg(test)]
mod tests;
