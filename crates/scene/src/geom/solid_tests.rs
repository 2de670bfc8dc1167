//! Grouping, centring, landmarks, parts and export of solids.

use super::*;
use crate::geom::{cuboid, sphere};

#[test]
fn groups_and_centring() {
    let a = Solid::new(Arc::new(cuboid(DVec3::new(1.0, 4.0, 2.0)).unwrap()));
    let b = Solid::new(Arc::new(sphere(1.0, 16).unwrap()));
    let shift = Affine::new(DVec3::new(3.0, 0.0, 0.0), DVec3::ZERO, DVec3::ONE);
    let g = Solid::group(&[a.clone(), b.placed(shift)]);
    assert_eq!((g.instances().len(), g.part_count()), (2, 2));
    let bounds = g.bounds().unwrap();
    assert!((bounds.max - DVec3::new(4.0, 2.0, 1.0)).length() < 1e-5);
    let c = g.centred(true).bounds().unwrap();
    assert!(c.centre().length() < 1e-6);
    assert!((c.size().max_element() - 2.0).abs() < 1e-6);
    let m = g.to_mesh().unwrap();
    assert_eq!(m.topology.triangles.len(), 12 + b.instances()[0].mesh.topology.triangles.len());
    assert_eq!(m.topology.part_count, 2);
}

fn block(size: DVec3) -> Solid {
    Solid::new(Arc::new(cuboid(size).unwrap()))
}

#[test]
fn centring_without_fit_keeps_sizes_and_survives_extremes() {
    let shift = Affine::new(DVec3::new(3.0, -5.0, 0.25), DVec3::new(0.3, 0.0, 0.0), DVec3::ONE);
    let s = block(DVec3::new(1.0, 4.0, 2.0)).placed(shift);
    let (before, after) = (s.bounds().unwrap(), s.centred(false).bounds().unwrap());
    assert!(after.centre().length() < 1e-12 && (after.size() - before.size()).length() < 1e-12);
    assert!(Solid::group(&[]).centred(true).bounds().is_none());
    for scale in [0.0, 1e-320, 1e308] {
        let extreme =
            block(DVec3::ONE).placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::splat(scale)));
        assert!(extreme.centred(true).instances().iter().all(|i| i.affine.is_finite()), "{scale}");
    }
}

#[test]
fn landmarks_go_where_their_solid_goes() {
    let at = |name: &str, position| Landmark { name: Arc::from(name), position };
    let tip = DVec3::new(0.0, 2.0, 0.0);
    let arm = block(DVec3::new(1.0, 4.0, 1.0))
        .with_landmarks([at("elbow", DVec3::ZERO), at("hand", tip)]);
    let turned =
        Affine::new(DVec3::X, DVec3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2), DVec3::splat(3.0));
    let two = Solid::group(&[arm.clone(), arm.placed(turned), block(DVec3::ONE)]);
    let names: Vec<&str> = two.landmarks().iter().map(|l| &*l.name).collect();
    assert_eq!(names, ["elbow", "hand", "elbow#2", "hand#2"]);
    assert!((two.landmarks()[3].position - DVec3::new(-5.0, 0.0, 0.0)).length() < 1e-12);
    let lifted = arm.placed(Affine::new(DVec3::Y, DVec3::ZERO, DVec3::ONE));
    let fit = lifted.centred(true);
    assert!(
        (fit.landmarks()[1].position - DVec3::Y).length() < 1e-6,
        "half the longest edge is 1 now"
    );
    assert!(fit.landmarks()[0].position.length() < 1e-6);
    assert!(block(DVec3::ONE).landmarks().is_empty());
}

#[test]
fn parts_of_nested_groups_follow_one_another() {
    let b = block(DVec3::ONE);
    let inner = Solid::group(&[b.clone(), b.clone()]);
    let outer = Solid::group(&[b.clone(), inner.clone(), inner]);
    assert_eq!(outer.instances().iter().map(|i| i.first_part).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    let far = (0..17).fold(b, |s, _| Solid::group(&[s.clone(), s]));
    assert_eq!(far.part_count(), u16::MAX, "numbers end there");
    let m = far.to_mesh().unwrap();
    assert_eq!(
        (m.topology.triangles.len(), m.topology.parts.iter().max()),
        (12 << 17, Some(&65534))
    );
}

#[test]
fn export_keeps_normals_and_creases_and_turns_mirrored_faces() {
    // A coarse sphere is smooth although its faces meet at 90 degrees.
    let s = Solid::new(Arc::new(sphere(1.0, 4).unwrap()));
    let scale = DVec3::new(-1.0, 2.0, 1.0);
    let m = s.placed(Affine::new(DVec3::ZERO, DVec3::ZERO, scale)).to_mesh().unwrap();
    assert!(m.topology.edges.iter().all(|e| !e.crease && e.faces[1] != NO_FACE));
    for (p, n) in m.positions.iter().zip(&m.normals) {
        // The gradient of x^2 + (y/2)^2 + z^2.
        let expected = (p.as_dvec3() / (scale * scale)).normalize();
        assert!((n.as_dvec3() - expected).length() < 1e-6);
    }
    let t = &m.topology;
    for face in &t.triangles {
        let p = face.map(|v| m.positions[v as usize]);
        assert!((p[1] - p[0]).cross(p[2] - p[0]).dot(p[0] + p[1] + p[2]) > 0.0, "outward");
    }
    for e in t.edges.iter() {
        let face = t.triangles[e.faces[0] as usize];
        assert!(
            (0..3).any(|c| e.vertices == [face[c], face[(c + 1) % 3]]),
            "as the first face runs"
        );
    }
}

#[test]
fn squashed_and_endless_solids() {
    let flat = |y: f64| {
        block(DVec3::ONE).placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, y, 1.0)))
    };
    assert_eq!(flat(0.0).to_mesh().unwrap().topology.triangles.len(), 4, "the sides are gone");
    assert!(flat(1e300).to_mesh().unwrap_err().to_string().contains("not finite"));
    assert!(Solid::group(&[]).to_mesh().is_err());
}
