//! The level of detail of a mesh in a picture: the coarsest version that shows every
//! vertex within a given number of pixels of its true position.
//!
//! The choice depends on the solid, the camera and that number alone. Meshes that reach
//! behind the camera, or have no coarser versions, stay unchanged.

use super::{Camera, Projection};
use crate::geom::{Coarse, Instance, Solid};
use glam::DVec3;
use std::sync::Arc;

/// A solid as shown in a picture.
pub(super) struct Drawn {
    /// The solid, with some of its meshes replaced by coarser ones.
    pub solid: Solid,
    coarse: Vec<Option<Arc<Coarse>>>,
}

impl Drawn {
    /// The solid, nowhere off by more than `detail` pixels; 0 (or less, or NaN) leaves it
    /// unchanged, as are surfaces that are drawn without a mesh.
    pub fn new(solid: &Solid, camera: &Camera, detail: f64) -> Drawn {
        if detail <= 0.0 || detail.is_nan() || solid.revolution().is_some() {
            return Drawn { solid: solid.clone(), coarse: Vec::new() };
        }
        let find = |instance: &Instance| instance.coarse(allowed(instance, camera, detail)?);
        let coarse: Vec<Option<Arc<Coarse>>> = solid.instances().iter().map(find).collect();
        if coarse.iter().all(Option::is_none) {
            return Drawn { solid: solid.clone(), coarse: Vec::new() };
        }
        let one = |(instance, coarse): (&Instance, &Option<Arc<Coarse>>)| match coarse {
            Some(coarse) => {
                Instance { mesh: Arc::clone(&coarse.mesh), detail: None, skin: None, ..*instance }
            }
            None => instance.clone(),
        };
        Drawn { solid: Solid::of(solid.instances().iter().zip(&coarse).map(one).collect()), coarse }
    }

    /// Maps derivatives with respect to the vertices of what is drawn to those with
    /// respect to the solid's own vertices: 0 for vertices that are not drawn.
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
                Some(coarse) => {
                    coarse.vertices.iter().zip(by).for_each(|(v, g)| here[*v as usize] = *g)
                }
                None => here.iter_mut().zip(by).for_each(|(place, g)| *place = *g),
            }
            (own, rest) = (after, others);
        }
        out
    }
}

/// How far, in the mesh's units, a vertex of an instance may be from its true position so
/// that it is off by at most `pixels` pixels, anywhere in the picture and in any
/// direction; `None` for an instance that reaches behind the camera.
fn allowed(instance: &Instance, camera: &Camera, pixels: f64) -> Option<f64> {
    let (centre, radius) = instance.ball()?;
    let nearest = (centre - camera.eye).dot(camera.forward) - radius;
    let most = match camera.projection {
        Projection::Pinhole { focal_px, cx, cy } => {
            // Towards the corners of a picture, motion along the camera's axis also moves
            // a point in the picture.
            let side = |c: f64, size: u32| c.abs().max((f64::from(size) - c).abs());
            let slant = side(cx, camera.width).hypot(side(cy, camera.height)) / focal_px;
            focal_px / nearest * (1.0 + slant * slant).sqrt()
        }
        Projection::Orthographic { units_per_pixel, .. } => 1.0 / units_per_pixel,
    };
    let allowed = pixels / (most * instance.affine.stretch());
    (nearest >= Camera::NEAR && allowed > 0.0).then_some(allowed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Affine, Caps, Profile};
    use crate::render::testing::lathe;
    use crate::render::{Channels, Contours, Frame, View};

    /// A lathe, a mesh as if from a file, and a solid without coarser versions.
    fn group() -> Solid {
        let y: Vec<f64> = (0..25).map(|i| f64::from(i) / 12.0 - 1.0).collect();
        let r = y.iter().map(|y| 0.5 + 0.1 * libm::sin(5.0 * y)).collect();
        let vase = Solid::lathe(&[Profile { y, r }], 48, 0.0, Caps::Both).unwrap();
        let fine =
            lathe(&[(0.3, -0.8), (0.7, -0.2), (0.65, 0.1), (0.4, 0.5), (0.6, 0.9)], 96, true);
        let file = Solid::lasting((*fine.instances()[0].mesh).clone());
        let at = |x: f64, turn: f64| {
            Affine::new(DVec3::new(x, 0.0, 0.0), DVec3::new(turn, 0.3, 0.1), DVec3::ONE)
        };
        Solid::group(&[
            vase.placed(at(-1.2, 0.4)),
            file.placed(at(1.0, -0.3)),
            fine.placed(at(0.0, 0.9)),
        ])
    }

    fn triangles(solid: &Solid) -> Vec<usize> {
        solid.instances().iter().map(|i| i.mesh.topology.triangles.len()).collect()
    }

    #[test]
    fn what_is_far_is_coarse_and_nothing_is_without_leave() {
        let (solid, camera) = (group(), Camera::default_for(128, 128));
        let shown = |scale: f64, detail: f64| {
            let by = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::splat(scale));
            triangles(&Drawn::new(&solid.placed(by), &camera, detail).solid)
        };
        for detail in [0.0, -1.0, f64::NAN] {
            assert_eq!(shown(1.0, detail), triangles(&solid));
        }
        let (near, far) = (shown(1.0, 0.5), shown(0.2, 0.5));
        assert!(
            near[0] < triangles(&solid)[0] && far[0] < near[0] && far[1] < triangles(&solid)[1]
        );
        assert_eq!(far[2], triangles(&solid)[2], "nothing is known about this one");
        // Meshes around the camera are not made coarser.
        assert_eq!(shown(40.0, 1.0), triangles(&solid));
        let parallel = Camera {
            projection: Projection::Orthographic { units_per_pixel: 0.05, cx: 64.0, cy: 64.0 },
            ..camera
        };
        assert!(triangles(&Drawn::new(&solid, &parallel, 0.5).solid)[0] < near[0]);
    }

    #[test]
    fn contours_do_not_depend_on_what_was_drawn_before() {
        let (solid, camera) = (group(), Camera::default_for(128, 128));
        let plain = View::new(solid.clone(), camera);
        assert_eq!(*plain.contours(128), Contours::of(&solid, &camera));
        let view = |detail: f64| View::with_detail(solid.clone(), camera, detail);
        assert_eq!(*view(0.0).contours(128), *plain.contours(128));
        let wanted = view(0.5).contours(128);
        assert_ne!(*wanted, *plain.contours(128));
        for before in [View::frame, View::depth] {
            let view = view(0.5);
            before(&view, 128);
            assert_eq!(*view.contours(128), *wanted);
            assert_eq!(
                view.frame(128).depth,
                Frame::render(&solid, &camera, Channels::Depth).depth
            );
        }
        let other = group();
        let there = std::thread::scope(|s| {
            let work = || View::with_detail(other, camera, 0.5).contours(128);
            s.spawn(work).join().unwrap()
        });
        assert_eq!(*there, *wanted);
    }

    #[test]
    fn derivatives_are_by_the_vertices_of_the_solid() {
        let camera = Camera::default_for(96, 96);
        let parallel = Camera {
            projection: Projection::Orthographic { units_per_pixel: 0.05, cx: 48.0, cy: 48.0 },
            ..camera
        };
        for camera in [camera, parallel] {
            let view = View::with_detail(group(), camera, 0.5);
            let contours = view.contours(96);
            let by: Vec<[f64; 4]> = contours
                .x
                .iter()
                .map(|x| [0.5 + 0.1 * libm::sin(f64::from(*x)), libm::cos(f64::from(*x)), 0.7, 0.0])
                .collect();
            let found = view.vjp_contours(96, &by);
            assert_eq!(found.len(), view.solid().vertex_count());
            assert!(view.triangles(96) < triangles(view.solid()).iter().sum());
            let drawn = view.drawn(&camera);
            let plain = contours.vjp(&drawn.solid, &camera, &by);
            let sum = |all: &[DVec3]| all.iter().map(|g| g.length_squared()).sum::<f64>();
            assert!(sum(&found) > 0.0 && (sum(&found) - sum(&plain)).abs() < 1e-9 * sum(&plain));
            // When the solid rotates about the middle of the picture, so do the pieces
            // and the vertices that they come from.
            let (cx, cy) = (48.0, 48.0);
            let along = |(p, g): (DVec3, &DVec3)| {
                let from = p - camera.eye;
                g.dot(camera.up * from.dot(camera.right) - camera.right * from.dot(camera.up))
            };
            let along: f64 = view.solid().vertices().zip(&found).map(along).sum();
            let piece = |i: usize| {
                by[i][0] * (f64::from(contours.y[i]) - cy)
                    - by[i][1] * (f64::from(contours.x[i]) - cx)
            };
            let (pieces, gross) =
                (0..by.len()).map(piece).fold((0.0, 0.0), |(sum, all), x| (sum + x, all + x.abs()));
            assert!((along - pieces).abs() < 1e-4 * gross, "{along} {pieces} of {gross}");
        }
    }
}
