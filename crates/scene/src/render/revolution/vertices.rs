//! Derivatives with respect to a surface of revolution as derivatives with respect to the
//! vertices of its mesh, which placements and lathes pass on.
//!
//! A surface moves by its placement and by its rings. Derivatives are spread over the
//! vertices so that both get theirs: those by rings along the radius and the axis, and the
//! rest of what the placement gets in ways that leave rings as they are.

use super::derivative::RevolutionGradient;
use crate::geom::{Affine, Revolution};
use glam::{DVec3, Vec3};

impl RevolutionGradient {
    /// Derivatives with respect to the vertices of the placed surface's mesh, in world
    /// coordinates: their sum is the derivative with respect to the translation, the sum
    /// of their products with the positions that with respect to the linear part, and each
    /// ring's vertices together give that ring's. `positions` are the mesh's own.
    pub fn by_vertex(
        &self,
        surface: &Revolution,
        affine: &Affine,
        positions: &[Vec3],
    ) -> Vec<DVec3> {
        let back = affine.0.matrix3.transpose();
        let (mut linear, mut shift) = (back * self.linear, back * self.shift);
        let rings = surface.rings();
        let round = rings.iter().filter(|ring| ring.r > 0.0);
        let poles = rings.len() - round.clone().count();
        let count = (rings.len() - poles).max(1) as f64;
        let sides = (positions.len().saturating_sub(poles) / (rings.len() - poles).max(1)).max(1);
        let per = 1.0 / sides as f64;
        for (ring, (by_r, by_y)) in rings.iter().zip(&self.rings) {
            // Over a circle, the squares of cosine and sine are 1/2 in the mean.
            let half = if ring.r > 0.0 { 0.5 * by_r * ring.r } else { 0.0 };
            linear.x_axis.x -= half;
            linear.z_axis.z -= half;
            linear.y_axis.y -= by_y * ring.y;
            shift.y -= by_y;
        }
        let middle = round.clone().map(|ring| ring.y).sum::<f64>() / count;
        let spread: f64 = round.clone().map(|ring| (ring.y - middle) * (ring.y - middle)).sum();
        let radii: f64 = round.map(|ring| ring.r).sum();
        let slope = |by_y: f64, by: f64| match spread > 0.0 {
            true => (by_y - by * middle) / spread,
            false => 0.0,
        };
        // Sideways motion of rings, and how it changes with height.
        let (along_x, along_z) = (slope(linear.y_axis.x, shift.x), slope(linear.y_axis.z, shift.z));
        let scale = if radii > 0.0 { 2.0 * per / radii } else { 0.0 };
        let (tip_x, tip_z) = (linear.x_axis.y * scale, linear.z_axis.y * scale);
        let squeeze = 0.5 * (linear.x_axis.x - linear.z_axis.z) * scale;
        let shear = 0.5 * (linear.x_axis.z + linear.z_axis.x) * scale;
        let twist = 0.5 * (linear.x_axis.z - linear.z_axis.x) * scale;
        let to_world = affine.0.matrix3.inverse().transpose();
        let mut out = Vec::with_capacity(positions.len());
        let mut rest = positions;
        for (ring, &(by_r, by_y)) in rings.iter().zip(&self.rings) {
            if ring.r == 0.0 {
                out.push(to_world * DVec3::new(0.0, by_y, 0.0));
                rest = rest.get(1..).unwrap_or(&[]);
                continue;
            }
            let (own, after) = rest.split_at(sides.min(rest.len()));
            let from = ring.y - middle;
            for p in own {
                let (c, s) = (f64::from(p.x) / ring.r, f64::from(p.z) / ring.r);
                let x = per * (by_r * c + shift.x / count + along_x * from)
                    + squeeze * c
                    + (shear - twist) * s;
                let y = per * by_y + tip_x * c + tip_z * s;
                let z = per * (by_r * s + shift.z / count + along_z * from) - squeeze * s
                    + (shear + twist) * c;
                out.push(to_world * DVec3::new(x, y, z));
            }
            rest = after;
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Caps, Profile, Solid};
    use crate::render::testing::{along, weighted};
    use crate::render::{Camera, Channels, Contours, Frame, View};
    use std::sync::Arc;

    fn egg(h: f64) -> Vec<Profile> {
        let point = |i: u32| {
            let a = core::f64::consts::PI * f64::from(i) / 24.0;
            let bump = 1.0 + h * libm::sin(0.5 * f64::from(i));
            (-libm::cos(a), 0.8 * bump * libm::sin(a) * (1.0 - 0.2 * libm::cos(a)))
        };
        let (y, r) = (0..=24).map(point).unzip();
        vec![Profile { y, r }]
    }

    fn placed(p: [f64; 8]) -> Solid {
        let solid = Solid::exact_lathe(&egg(p[7]), 12, 0.0, Caps::None).unwrap();
        let inner = Affine::new(DVec3::ZERO, DVec3::new(0.0, 0.3, 0.1), DVec3::new(1.0, 0.9, 1.1));
        let outer = Affine::new(
            DVec3::new(0.1 + p[0], p[1], p[2]),
            DVec3::new(0.6 + p[3], p[4], p[5]),
            DVec3::splat(1.0 + p[6]),
        );
        solid.placed(inner).placed(outer)
    }

    #[test]
    fn views_draw_a_single_lathe_exactly_and_derive_by_its_mesh() {
        let camera = Camera::default_for(128, 128);
        let view = |p| View::new(placed(p), camera);
        let here = view([0.0; 8]);
        let contours = here.contours(128);
        let r = here.solid().revolution().unwrap();
        assert_eq!(*contours, Contours::of_revolution(&r.surface, &r.affine, &camera));
        let by = weighted(&contours).1;
        let by_vertex = here.vjp_contours(128, &by);
        assert_eq!(by_vertex.len(), here.solid().vertex_count());
        let mut wrong = 0.0f64;
        for k in 0..8 {
            let h = 1e-2;
            let at = |h: f64| view(std::array::from_fn(|i| if i == k { h } else { 0.0 }));
            let value = |view: &View| weighted(&view.contours(128)).0;
            let slope = (value(&at(h)) - value(&at(-h))) / (2.0 * h);
            let (before, after) = (at(-1e-3), at(1e-3));
            let found = along(&by_vertex, before.solid(), after.solid(), 2e-3);
            wrong = wrong.max((found - slope).abs() - 0.01 * slope.abs());
        }
        assert!(wrong < 0.3, "{wrong}");
    }

    #[test]
    fn what_a_view_shows_does_not_depend_on_what_was_drawn_before() {
        let camera = Camera::default_for(96, 80);
        let view = || View::new(placed([0.0; 8]), camera);
        let wanted = view().contours(96);
        let other = view();
        assert_eq!(other.depth(96).depth, other.frame(96).depth);
        assert_eq!(*other.contours(96), *wanted);
        assert!(other.change(96).all_move());
        let next = view().after(&other);
        assert_eq!(*next.contours(96), *wanted);
        // Views of depth alone that follow one another.
        let moved = [[0.0; 8], [0.1; 8], [0.0; 8], [0.0; 8]].map(placed);
        let mut last = view();
        for solid in moved {
            let wanted = View::new(solid.clone(), camera).depth(96);
            last = View::new(solid, camera).after(&last);
            assert_eq!(last.depth(96).depth, wanted.depth);
        }
        // Beside something else, it is drawn by its mesh.
        let solid = placed([0.0; 8]);
        let pair = Solid::group(&[solid.clone(), solid.clone()]);
        let alone = Solid::new(Arc::clone(&solid.instances()[0].mesh));
        let mesh = alone.placed(solid.instances()[0].affine);
        assert!(pair.revolution().is_none() && mesh.revolution().is_none());
        assert_eq!(Contours::of(&mesh, &camera), Contours::of(&Solid::group(&[mesh]), &camera));
        let depth = Frame::render(&pair, &camera, Channels::Depth).depth;
        let exact = other.depth(96);
        let apart =
            depth.iter().zip(&exact.depth).filter(|(a, b)| a.is_finite() != b.is_finite()).count();
        assert!(apart < 200, "{apart}");
    }

    #[test]
    fn a_flattened_lathe_has_no_exact_surface() {
        let flat = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0));
        assert!(placed([0.0; 8]).placed(flat).revolution().is_none());
    }
}
