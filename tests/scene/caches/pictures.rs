//! Pictures: canvases, views, coarser meshes.

use super::{Views, afresh, contour_bits, frame_bits};
use glam::DVec3;
use pcadlang_scene::geom::{Affine, Mesh, Solid, sphere};
use pcadlang_scene::render::{Camera, Channels, Contours, Frame, Projection};
use std::sync::Arc;

fn ball(at: f64, radius: f64) -> Solid {
    let mesh = Arc::new(sphere(radius, 12).unwrap());
    Solid::new(mesh).placed(Affine::new(
        DVec3::new(at, 0.3 * at, 0.2 * at),
        DVec3::ZERO,
        DVec3::ONE,
    ))
}

/// Cameras that differ from the first in one field each, with the name of that field.
fn cameras(projection: Projection) -> Vec<(String, Camera)> {
    let base = Camera { projection, ..Camera::default_for(72, 56) };
    let mut all = vec![("nothing".to_owned(), base)];
    let mut add = |what: String, change: &dyn Fn(&mut Camera)| {
        let mut other = base;
        change(&mut other);
        all.push((what, other));
    };
    type Of = fn(&mut Camera) -> &mut DVec3;
    let vectors: [(&str, Of); 4] = [
        ("eye", |c| &mut c.eye),
        ("right", |c| &mut c.right),
        ("up", |c| &mut c.up),
        ("forward", |c| &mut c.forward),
    ];
    for (name, of) in vectors {
        for axis in 0..3 {
            add(format!("{name}[{axis}]"), &|c| of(c)[axis] += 0.03);
        }
    }
    add("width".into(), &|c| c.width += 1);
    add("height".into(), &|c| c.height -= 20);
    for k in 0..3 {
        add(format!("number {k} of the projection"), &|c| {
            c.projection = match c.projection {
                Projection::Pinhole { mut focal_px, mut cx, mut cy } => {
                    *[&mut focal_px, &mut cx, &mut cy][k] += 1.3;
                    Projection::Pinhole { focal_px, cx, cy }
                }
                Projection::Orthographic { mut units_per_pixel, mut cx, mut cy } => {
                    *[&mut units_per_pixel, &mut cx, &mut cy][k] *= 1.05;
                    Projection::Orthographic { units_per_pixel, cx, cy }
                }
            };
        });
    }
    add("kind of the projection".into(), &|c| {
        c.projection = match c.projection {
            Projection::Pinhole { focal_px, cx, cy } => {
                Projection::Orthographic { units_per_pixel: focal_px.recip(), cx, cy }
            }
            Projection::Orthographic { units_per_pixel, cx, cy } => {
                Projection::Pinhole { focal_px: units_per_pixel.recip(), cx, cy }
            }
        };
    });
    all
}

/// Contours drawn in full, and from the view before, of one mesh and of several.
#[test]
fn pictures_of_another_camera() {
    let members: Vec<Solid> = (0..8).map(|i| ball(0.4 * f64::from(i) - 1.4, 0.5)).collect();
    let still = Solid::group(&members);
    // One moving member in front of fixed ones.
    let moved = Solid::group(&[&members[..3], &[ball(-0.1, 0.8)], &members[4..]].concat());
    let solids = [("at once", &members[0], &members[1]), ("of parts", &still, &moved)];
    let (cx, cy) = (36.0, 28.0);
    let projections = [
        Projection::Pinhole { focal_px: 130.0, cx, cy },
        Projection::Orthographic { units_per_pixel: 0.06, cx, cy },
    ];
    for ((how, a, b), projection) in solids.iter().flat_map(|s| projections.map(|p| (s, p))) {
        let cameras = cameras(projection);
        let base = cameras[0].1;
        let mut views = Views::default();
        for (what, camera) in &cameras {
            let seen = |eye: &Camera| {
                (
                    contour_bits(&Contours::of(a, eye)),
                    frame_bits(&Frame::render(a, eye, Channels::Depth)),
                )
            };
            let differs = seen(camera) != seen(&base);
            assert!(
                differs == (what != "nothing"),
                "{how}, {what}: the picture shows nothing of it"
            );
            for (solid, eye) in [
                (a, &base),
                (b, &base),
                (a, &base),
                (a, camera),
                (b, camera),
                (a, camera),
                (a, &base),
            ] {
                let view = views.next(solid, eye);
                let (change, size) = (view.change(72), eye.width.max(eye.height));
                let (here, there) = (view.contours(size), Contours::of(solid, eye));
                assert!(
                    contour_bits(&here) == contour_bits(&there),
                    "{how}: contours with another {what} of the camera"
                );
                let there = Contours::of(solid, &eye.scaled_to(72)).len();
                assert_eq!(change.count, there, "{how}: what changed with another {what}");
                let here = frame_bits(&Frame::render(solid, eye, Channels::All));
                let there = afresh(|| frame_bits(&Frame::render(solid, eye, Channels::All)));
                assert!(here == there, "{how}: frames with another {what} of the camera");
            }
        }
    }
}

/// A change of the kind of projection alone: the scene is so large that the same number
/// works as focal length and as pixel size.
#[test]
fn pictures_of_another_kind_of_camera() {
    let by = Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::splat(800.0));
    let members: Vec<Solid> =
        (0..6).map(|i| ball(0.4 * f64::from(i) - 1.0, 0.5).placed(by)).collect();
    let moved = Solid::group(&[&members[..5], &[ball(1.1, 0.3).placed(by)]].concat());
    let still = Solid::group(&members);
    let (scale, cx, cy) = (80.0, 36.0, 28.0);
    let kinds = [
        Projection::Pinhole { focal_px: scale, cx, cy },
        Projection::Orthographic { units_per_pixel: scale, cx, cy },
    ];
    let (mut seen, mut views) = (Vec::new(), Views::default());
    for i in 0..8 {
        let base = Camera { projection: kinds[i % 2], ..Camera::default_for(72, 56) };
        let camera = Camera { eye: DVec3::new(0.0, 0.0, 6400.0), ..base };
        for solid in [&still, &moved, &still] {
            let here = contour_bits(&views.contours(solid, &camera));
            let there = contour_bits(&Contours::of(solid, &camera));
            assert!(here == there, "another kind of projection");
            seen.push(here);
        }
    }
    assert!(seen[0] != seen[3] && seen[0] != seen[1] && seen[0].len() > 100);
}

/// Another mesh in the same pose, possibly allocated at the address of a dropped one; a
/// placement that differs in a single number.
#[test]
fn pictures_of_another_mesh_and_placement() {
    let camera = Camera::default_for(64, 64);
    let rest: Vec<Solid> = (0..5).map(|i| ball(0.5 * f64::from(i) - 1.0, 0.4)).collect();
    let with = |one: &Solid| Solid::group(&[&rest[..], std::slice::from_ref(one)].concat());
    let mut views = Views::default();
    let mut check = |what: &str, solid: &Solid| {
        let here = contour_bits(&views.contours(solid, &camera));
        assert!(here == contour_bits(&Contours::of(solid, &camera)), "{what}");
        here
    };
    let mut seen = Vec::new();
    for i in 0..40 {
        seen.push(check("another mesh", &with(&ball(0.1, 0.6 + 0.01 * f64::from(i % 20)))));
    }
    assert!((1..20).all(|i| seen[i] != seen[i - 1] && seen[i] == seen[i + 20]));
    let mesh = Arc::new(sphere(0.7, 16).unwrap());
    let base = Affine::new(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.1, 0.2, 0.3), DVec3::ONE);
    let placed = |by: Affine| with(&Solid::new(mesh.clone()).placed(by));
    let first = check("a placement", &placed(base));
    for k in 0..12 {
        let mut numbers = base.0.to_cols_array();
        numbers[k] += 0.05;
        let other =
            check("another placement", &placed(Affine(glam::DAffine3::from_cols_array(&numbers))));
        assert!(other != first, "number {k} of a placement is not seen");
        assert!(check("the placement again", &placed(base)) == first);
    }
    // A change of one field of the mesh itself.
    let fields: [fn(&mut Mesh); 4] = [
        |m| m.positions[40].x += 0.2,
        |m| m.normals = m.normals.iter().map(|n| -*n).collect(),
        |m| Arc::make_mut(&mut m.topology).triangles.truncate(60),
        |m| Arc::make_mut(&mut m.topology).encloses ^= true,
    ];
    for (k, field) in fields.iter().enumerate() {
        let mut other = Mesh::clone(&mesh);
        field(&mut other);
        check(
            &format!("a mesh with another field {k}"),
            &with(&Solid::new(Arc::new(other)).placed(base)),
        );
        assert!(check("the mesh again", &placed(base)) == first);
    }
}
