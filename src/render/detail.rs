//! How fine a mesh must be in a picture: the coarsest version that shows every vertex within so many pixels of where it is.
//!
//! The choice depends on the solid, the camera and that number alone. Meshes that reach behind the eye, or have no coarser versions, stay
//! as they are.

use super::{Camera, Projection};
use crate::geom::{Coarse, Instance, Solid};
use glam::DVec3;
use std::sync::Arc;

/// A solid as a picture shows it.
pub(super) struct Drawn {
    /// It, some of its meshes coarser.
    pub solid: Solid,
    coarse: Vec<Option<Arc<Coarse>>>,
}

impl Drawn {
    /// The solid, nowhere off by more than `detail` pixels; 0 (or less, or NaN) is the solid itself.
    pub fn new(solid: &Solid, camera: &Camera, detail: f64) -> Drawn {
        if !(detail > 0.0) {
            return Drawn { solid: solid.clone(), coarse: Vec::new() };
        }
        let find = |instance: &Instance| instance.coarse(allowed(instance, camera, detail)?);
        let coarse: Vec<Option<Arc<Coarse>>> = solid.instances().iter().map(find).collect();
        if coarse.iter().all(Option::is_none) {
            return Drawn { solid: solid.clone(), coarse: Vec::new() };
        }
        let one = |(instance, coarse): (&Instance, &Option<Arc<Coarse>>)| match coarse {
            Some(coarse) => Instance { mesh: Arc::clone(&coarse.mesh), detail: None, ..*instance },
            None => instance.clone(),
        };
        Drawn { solid: Solid::of(solid.instances().iter().zip(&coarse).map(one).collect()), coarse }
    }

    /// From derivatives by the vertices of what is drawn to those by the solid's own: 0 for those that are not drawn.
    pub fn by_vertices_of(&self, solid: &Solid, by_vertex: Vec<DVec3>) -> Vec<DVec3> {
        if self.coarse.is_empty() {
            return by_vertex;
        }
        let mut out = vec![DVec3::ZERO; solid.vertex_count()];
        let (mut own, mut rest) = (&mut out[..], &by_vertex[..]);
        for (instance, coarse) in solid.instances().iter().zip(&self.coarse) {
            let (here, after) = own.split_at_mut(instance.mesh.positions.len());
            let count = coarse.as_ref().map_or(here.len(), |c| c.vertices.len());
            let (by, others) = rest.split_at(count.min(rest.len()));
            match coarse {
                Some(coarse) => coarse.vertices.iter().zip(by).for_each(|(v, g)| here[*v as usize] = *g),
                None => here.iter_mut().zip(by).for_each(|(place, g)| *place = *g),
            }
            (own, rest) = (after, others);
        }
        out
    }
}

/// How far (the mesh's units) a vertex of an instance may be from where it is to be off by so many pixels at most, wherever in the picture
/// it is and whichever way; `None` for one that reaches behind the eye.
fn allowed(instance: &Instance, camera: &Camera, pixels: f64) -> Option<f64> {
    let (centre, radius) = instance.ball()?;
    let nearest = (centre - camera.eye).dot(camera.forward) - radius;
    let most = match camera.projection {
        Projection::Pinhole { focal_px, cx, cy } => {
            // Towards the corners of a picture what moves along the line of sight's axis moves in the picture, too.
            let side = |c: f64, size: u32| c.abs().max((f64::from(size) - c).abs());
            let slant = side(cx, camera.width).hypot(side(cy, camera.height)) / focal_px;
            focal_px / nearest * (1.0 + slant * slant).sqrt()
        }
        Projection::Orthographic { units_per_pixel, .. } => 1.0 / units_per_pixel,
    };
    let allowed = pixels / (most * instance.affine.stretch());
    (nearest >= Camera::NEAR && allowed > 0.0).then_some(allowed)
}
