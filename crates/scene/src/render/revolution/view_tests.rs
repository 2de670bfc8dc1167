//! Views of a single surface of revolution.

use crate::geom::{Affine, Caps, Profile, Solid};
use crate::render::testing::{along, weighted};
use crate::render::{Camera, Channels, Contours, Frame, View};
use glam::DVec3;
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
    let solid = Solid::exact_lathe(&egg(p[7]), 96, 0.0, Caps::None).unwrap();
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
    let mut slopes = Vec::new();
    for k in 0..8 {
        let h = 1e-2;
        let at = |h: f64| view(std::array::from_fn(|i| if i == k { h } else { 0.0 }));
        let value = |view: &View| weighted(&view.contours(128)).0;
        let slope = (value(&at(h)) - value(&at(-h))) / (2.0 * h);
        let (before, after) = (at(-1e-3), at(1e-3));
        let found = along(&by_vertex, before.solid(), after.solid(), 2e-3);
        slopes.push([found, slope]);
    }
    // The mesh only approaches the surface: within a twentieth of the greatest slope.
    let most = slopes.iter().fold(0.0f64, |most, [_, slope]| most.max(slope.abs()));
    let near = |[found, slope]: &[f64; 2]| (found - slope).abs() < 0.05 * most;
    assert!(slopes.iter().all(near), "{slopes:?}");
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
