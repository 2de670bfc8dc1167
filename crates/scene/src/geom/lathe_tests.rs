//! Tests of the lathe: closed and outward surfaces, the volumes of cylinders, cones,
//! spheres and vessels, and every error.

use super::*;
use crate::geom::NO_FACE;
use std::collections::HashMap;
use std::slice::from_ref;

fn profile(points: &[(f64, f64)]) -> Profile {
    Profile { y: points.iter().map(|p| p.1).collect(), r: points.iter().map(|p| p.0).collect() }
}

/// Returns the signed volume, which is positive for outward orientation.
fn volume(m: &Mesh) -> f64 {
    let t = |t: &[u32; 3]| {
        let p = t.map(|v| m.positions[v as usize].as_dvec3());
        p[0].dot(p[1].cross(p[2])) / 6.0
    };
    m.topology.triangles.iter().map(t).sum()
}

/// Asserts that each edge has two faces that run along it in opposite directions, and
/// that the surface is a single sphere or torus.
fn assert_closed(m: &Mesh, euler: i64) {
    let key = |v: u32| m.positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut directed: HashMap<_, i32> = HashMap::new();
    let mut points = std::collections::HashSet::new();
    for t in &m.topology.triangles {
        for c in 0..3 {
            *directed.entry((key(t[c]), key(t[(c + 1) % 3]))).or_default() += 1;
            points.insert(key(t[c]));
        }
    }
    assert!(
        directed.iter().all(|((a, b), n)| *n == 1 && directed.get(&(*b, *a)) == Some(&1)),
        "not watertight"
    );
    assert!(m.topology.edges.iter().all(|e| e.faces[1] != NO_FACE));
    let (v, e, f) =
        (points.len() as i64, m.topology.edges.len() as i64, m.topology.triangles.len() as i64);
    assert_eq!(v - e + f, euler);
}

fn assert_outward(m: &Mesh) {
    for t in &m.topology.triangles {
        let p = t.map(|v| m.positions[v as usize]);
        let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
        for v in t {
            assert!(
                n.dot(m.normals[*v as usize]) > 0.5,
                "normal {} on a face of {n}",
                m.normals[*v as usize]
            );
        }
    }
    assert!(m.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
}

/// The ratio of the volumes of a prism with this many sides and its circumscribed
/// cylinder.
fn polygon(sides: f64) -> f64 {
    sides / std::f64::consts::TAU * (std::f64::consts::TAU / sides).sin()
}

#[test]
fn cylinder_and_cone_have_their_volumes() {
    let cylinder = lathe(&[profile(&[(0.5, 0.0), (0.5, 2.0)])], 64, 0.0, Caps::Both).unwrap();
    assert_closed(&cylinder, 2);
    assert_outward(&cylinder);
    let expected = std::f64::consts::PI * 0.25 * 2.0 * polygon(64.0);
    assert!((volume(&cylinder) - expected).abs() < 1e-5);
    let cone =
        lathe(&[profile(&[(1.0, 0.0), (0.5, 1.0), (0.0, 2.0)])], 64, 0.0, Caps::Both).unwrap();
    assert_closed(&cone, 2);
    assert!((volume(&cone) - std::f64::consts::PI * 2.0 / 3.0 * polygon(64.0)).abs() < 1e-3);
}

#[test]
fn a_vessel_holds_what_its_walls_leave() {
    let p = [profile(&[(0.5, 0.0), (0.5, 1.0), (0.5, 2.0)])];
    let cup = lathe(&p, 48, 0.1, Caps::Both).unwrap();
    assert_closed(&cup, 2);
    assert_outward(&cup);
    let expected = std::f64::consts::PI * (0.25 * 2.0 - 0.16 * 1.9) * polygon(48.0);
    assert!((volume(&cup) - expected).abs() < 1e-5, "{} {expected}", volume(&cup));
    let tube = lathe(&p, 48, 0.1, Caps::None).unwrap();
    assert_closed(&tube, 0);
    assert_outward(&tube);
    let thick = lathe(&p, 48, 9.0, Caps::Both).unwrap();
    assert_closed(&thick, 2);
}

#[test]
fn joints_are_smooth_bent_or_stepped() {
    let lower = profile(&[(0.5, 0.0), (0.5, 1.0)]);
    let creases = |m: &Mesh| m.topology.edges.iter().filter(|e| e.crease).count();
    let smooth =
        lathe(&[lower.clone(), profile(&[(0.5, 1.0), (0.6, 2.0)])], 32, 0.0, Caps::None).unwrap();
    assert_eq!(creases(&smooth), 0);
    let bent =
        lathe(&[lower.clone(), profile(&[(0.5, 1.0), (2.5, 2.0)])], 32, 0.0, Caps::None).unwrap();
    assert_eq!(creases(&bent), 32);
    let stepped = lathe(&[lower, profile(&[(0.3, 1.0), (0.3, 2.0)])], 32, 0.0, Caps::Both).unwrap();
    assert_eq!(creases(&stepped), 4 * 32);
    assert_closed(&stepped, 2);
    assert_outward(&stepped);
    assert_eq!(
        stepped.topology.parts.iter().copied().collect::<std::collections::BTreeSet<_>>().len(),
        5
    );
}

#[test]
fn topology_is_shared_and_the_cache_changes_nothing() {
    let of = |r: f64| lathe(&[profile(&[(r, 0.0), (r + 0.1, 1.0)])], 16, 0.0, Caps::Both).unwrap();
    let (a, b) = (of(0.5), of(0.7));
    assert!(std::sync::Arc::ptr_eq(&a.topology, &b.topology));
    for n in 3..40 {
        lathe(&[profile(&[(0.5, 0.0), (0.5, 1.0)])], n, 0.0, Caps::Both).unwrap();
    }
    assert_eq!(of(0.5), a);
}

#[test]
fn a_floor_is_as_high_as_it_is_raised() {
    let cup = profile(&[(1.0, 0.0), (1.0, 2.0)]);
    for (floor, high) in [(0.0, 0.1), (0.05, 0.1), (0.7, 0.7), (5.0, 1.9)] {
        let m = lathe(from_ref(&cup), 64, Wall { thickness: 0.1, floor }, Caps::Bottom).unwrap();
        assert_closed(&m, 2);
        assert_outward(&m);
        let full = std::f64::consts::PI * (2.0 - 0.81 * (2.0 - high)) * polygon(64.0);
        assert!((volume(&m) - full).abs() < 1e-5, "{floor}: {} {full}", volume(&m));
    }
    let wrong =
        lathe(from_ref(&cup), 64, Wall { thickness: 0.1, floor: -1.0 }, Caps::Bottom).unwrap_err();
    assert_eq!(wrong.to_string(), "lathe: the floor must be from 0 to 1000000, got -1");
}

#[test]
fn impossible_profiles_are_errors() {
    let fails = |parts: &[Profile], sides, thickness| {
        lathe(parts, sides, thickness, Caps::Both).unwrap_err().to_string()
    };
    let good = profile(&[(0.5, 0.0), (0.5, 1.0)]);
    assert_eq!(fails(&[], 8, 0.0), "lathe: there is no profile");
    assert_eq!(
        fails(&[profile(&[(1.0, 0.0)])], 8, 0.0),
        "lathe: profile 0 needs at least 2 points, got 1"
    );
    assert!(fails(&[profile(&[(0.5, 1.0), (0.5, 0.0)])], 8, 0.0).contains("must not decrease"));
    assert!(fails(&[profile(&[(-0.5, 0.0), (0.5, 1.0)])], 8, 0.0).contains("negative"));
    assert!(fails(&[profile(&[(f64::NAN, 0.0), (0.5, 1.0)])], 8, 0.0).contains("NaN"));
    assert!(fails(from_ref(&good), 2, 0.0).contains("3 to 1024"));
    assert!(fails(from_ref(&good), 8, -1.0).contains("thickness"));
    assert!(fails(&[profile(&[(0.0, 0.0), (0.0, 0.0)])], 8, 0.0).contains("no extent"));
    let flat = lathe(&[profile(&[(0.5, 0.0), (0.5, 0.0)])], 8, 0.0, Caps::Both).unwrap();
    assert!(flat.positions.iter().chain(&flat.normals).all(|p| p.is_finite()));
}

#[test]
fn profiles_that_end_at_the_axis_are_closed_there() {
    // A cone: its tip has no normal, so a disc of invisible size closes it.
    for caps in [Caps::Bottom, Caps::Both] {
        let cone = lathe(&[profile(&[(1.0, 0.0), (0.0, 2.0)])], 64, 0.0, caps).unwrap();
        assert_closed(&cone, 2);
        assert_outward(&cone);
        assert_eq!(
            cone.topology.edges.iter().filter(|e| e.crease).count(),
            64,
            "only the rim of the base"
        );
        assert!((volume(&cone) - std::f64::consts::PI * 2.0 / 3.0 * polygon(64.0)).abs() < 1e-5);
    }
    // A ball, with poles.
    let n = 33;
    let angle = |i: i32| std::f64::consts::PI * f64::from(i) / f64::from(n - 1);
    let ball = profile(&(0..n).map(|i| (angle(i).sin(), -angle(i).cos())).collect::<Vec<_>>());
    for caps in [Caps::None, Caps::Bottom, Caps::Top, Caps::Both] {
        let m = lathe(from_ref(&ball), 64, 0.0, caps).unwrap();
        assert_closed(&m, 2);
        assert_outward(&m);
        assert_eq!(m.positions.len(), 31 * 64 + 2);
        assert!(m.topology.edges.iter().all(|e| !e.crease));
        assert!(m.topology.parts.iter().all(|p| *p == 0));
        // Central differences with equal steps give exact slopes on a circle.
        assert!(
            m.positions.iter().zip(&m.normals).all(|(p, n)| (p.normalize() - *n).length() < 1e-6)
        );
        // The body is a stack of frusta.
        let frusta: f64 = ball
            .r
            .windows(2)
            .zip(ball.y.windows(2))
            .map(|(r, y)| frustum(r[0], r[1], y[1] - y[0]))
            .sum();
        assert!((volume(&m) - frusta * polygon(64.0)).abs() < 1e-5);
        assert!((volume(&m) - 4.0 / 3.0 * std::f64::consts::PI).abs() < 0.02);
    }
    // A spindle, two bodies joined by a neck at the axis, and a bowl that rests on a
    // point.
    let spindle = profile(&[(0.0, -1.0), (1.0, 0.0), (0.0, 1.0)]);
    assert_closed(&lathe(from_ref(&spindle), 12, 0.0, Caps::None).unwrap(), 2);
    let two = [spindle, profile(&[(0.0, 1.0), (1.0, 2.0), (0.0, 3.0)])];
    assert_closed(&lathe(&two, 12, 0.0, Caps::None).unwrap(), 2);
    let bowl = profile(&[(0.0, 0.0), (0.4, 0.1), (0.8, 0.8)]);
    for caps in [Caps::None, Caps::Both] {
        let m = lathe(from_ref(&bowl), 24, 0.1, caps).unwrap();
        assert_closed(&m, 2);
        assert_outward(&m);
    }
    let closed_on_top = profile(&[(0.5, 0.0), (0.5, 1.0), (0.0, 1.0)]);
    assert_closed(&lathe(from_ref(&closed_on_top), 24, 0.1, Caps::Both).unwrap(), 2);
}

fn frustum(a: f64, b: f64, height: f64) -> f64 {
    std::f64::consts::PI * height * (a * a + a * b + b * b) / 3.0
}

#[test]
fn inner_walls_keep_the_creases_and_the_floor_its_height() {
    let stack = [profile(&[(0.5, 0.0), (0.5, 1.0)]), profile(&[(0.8, 1.0), (0.8, 2.0)])];
    let m = lathe(&stack, 40, 0.1, Caps::Bottom).unwrap();
    assert_closed(&m, 2);
    assert_outward(&m);
    let square = |r: f64| r * r;
    let expected = square(0.5) - square(0.4) * 0.9 + square(0.8) - square(0.7);
    assert!((volume(&m) - std::f64::consts::PI * expected * polygon(40.0)).abs() < 1e-5);
    // Outside: the base, two at the step; the rim: two; inside: two at the step, the
    // floor.
    assert_eq!(m.topology.edges.iter().filter(|e| e.crease).count(), 8 * 40);
    let parts: std::collections::BTreeSet<u16> = m.topology.parts.iter().copied().collect();
    assert_eq!(parts.into_iter().collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6]);
    assert_eq!(m.topology.part_count, 7);
    let floor: Vec<f32> = (0..m.topology.triangles.len())
        .filter(|f| m.topology.parts[*f] == 6)
        .flat_map(|f| m.topology.triangles[f].map(|v| m.positions[v as usize].y))
        .collect();
    assert!(floor.len() == 3 * 40 && floor.iter().all(|y| (y - 0.1).abs() < 1e-6));
    // With a wall thicker than the body, a bore remains, and the floor is at half the
    // height.
    let thick = lathe(&[profile(&[(0.5, 0.0), (0.5, 2.0)])], 40, 9.0, Caps::Both).unwrap();
    let expected = std::f64::consts::PI * (square(0.5) * 2.0 - square(0.01)) * polygon(40.0);
    assert!((volume(&thick) - expected).abs() < 1e-5);
}

#[test]
fn slanted_walls_have_analytic_normals() {
    let m = lathe(&[profile(&[(0.5, 0.0), (0.75, 0.5), (1.0, 1.0)])], 16, 0.0, Caps::None).unwrap();
    let slope = 1.0 / 1.25f32.sqrt();
    for (p, n) in m.positions.iter().zip(&m.normals) {
        let expected =
            glam::Vec3::new(p.x, 0.0, p.z).normalize() * slope - glam::Vec3::Y * (0.5 * slope);
        assert!((*n - expected).length() < 1e-6);
    }
    assert_eq!(
        m.topology.edges.iter().filter(|e| e.faces[1] == NO_FACE).count(),
        32,
        "open at both ends"
    );
}

#[test]
fn flat_and_repeated_points_make_no_collapsed_triangles() {
    let shapes: [(&[(f64, f64)], f64); 6] = [
        (&[(0.5, 0.0), (0.5, 0.0)], 0.0),
        (&[(0.0, 0.0), (0.5, 0.0)], 0.1),
        (&[(0.0, 1.0), (0.0, 2.0)], 0.0),
        (&[(0.5, 0.0), (0.5, 1e-12), (0.5, 1.0), (0.5, 1.0)], 0.0),
        (&[(0.5, 999_999.0), (0.500_000_000_1, 999_999.0), (0.5, 1_000_000.0)], 0.0),
        (&[(1e-20, 0.0), (2e-20, 1e-20)], 1e-21),
    ];
    for (points, thickness) in shapes {
        let m = lathe(&[profile(points)], 24, thickness, Caps::Both).unwrap();
        // Coincident discs share positions but not points, so positions cannot be
        // compared here.
        assert!(m.topology.edges.iter().all(|e| e.faces[1] != NO_FACE), "{points:?}");
        assert!(m.positions.iter().chain(&m.normals).all(|p| p.is_finite()));
        for t in &m.topology.triangles {
            let p = t.map(|v| m.positions[v as usize].as_dvec3());
            assert!((p[1] - p[0]).cross(p[2] - p[0]).length_squared() > 0.0, "{points:?}");
        }
    }
}

#[test]
fn sizes_are_limited() {
    let fails =
        |parts: &[Profile], sides| lathe(parts, sides, 0.0, Caps::Both).unwrap_err().to_string();
    let long = |n: usize| Profile { y: (0..n).map(|i| i as f64).collect(), r: vec![1.0; n] };
    assert_eq!(fails(&[long(4097)], 8), "lathe: 4097 points; at most 4096");
    assert_eq!(fails(&vec![long(2); 1001], 8), "lathe: 1001 profiles; at most 1000");
    assert_eq!(
        fails(&[long(4096)], 1024),
        "lathe: 4096 points and 1024 sides make 8394752 triangles; at most 5000000"
    );
    assert!(
        fails(&[profile(&[(0.5, 0.0), (0.5, 1.0), (0.5, 2.0)]), long(2)], 8)
            .contains("must not decrease")
    );
    assert!(fails(&[profile(&[(0.5, 0.0), (f64::INFINITY, 1.0)])], 8).contains("the radius inf"));
    assert!(fails(&[profile(&[(0.5, 0.0), (0.5, 2e6)])], 8).contains("at most 1000000"));
    let uneven = Profile { y: vec![0.0, 1.0], r: vec![1.0] };
    assert_eq!(fails(from_ref(&uneven), 8), "lathe: profile 0 has 2 heights and 1 radii");
    let flat = profile(&[(0.5, 0.0), (0.5, 0.0)]);
    let e = lathe(from_ref(&flat), 8, 0.0, Caps::None).unwrap_err();
    assert_eq!(e, GeomError::Domain("lathe: the object has no height and no discs".into()));
    for caps in [Caps::Bottom, Caps::Both] {
        assert!(
            lathe(
                &[long(600), Profile { y: vec![600.0, 601.0], r: vec![0.0, 0.0] }],
                1024,
                0.5,
                caps
            )
            .is_ok()
        );
    }
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config {
        rng_seed: proptest::test_runner::RngSeed::Fixed(11),
        failure_persistence: None,
        ..Default::default()
    })]

    #[test]
    fn every_closed_body_is_watertight_and_the_cache_changes_nothing(
        steps in proptest::collection::vec((0.0..1.0f64, 0.0..1.0f64), 2..12),
        cut in 1..10usize,
        sides in 3..20u32,
        thickness in proptest::option::of(0.001..0.5f64),
        caps in proptest::sample::select(vec![Caps::None, Caps::Bottom, Caps::Top, Caps::Both]),
    ) {
        // Small numbers become 0, to make poles, repeated heights and repeated radii
        // common.
        let snap = |x: f64| if x < 0.25 { 0.0 } else { x };
        let mut y = 0.0;
        let points: Vec<(f64, f64)> = steps.iter().map(|(r, dy)| { y += snap(*dy); (snap(*r), y) }).collect();
        let cut = cut.min(points.len() - 1);
        let parts = if cut >= 2 && points.len() - cut >= 2 {
            vec![profile(&points[..cut]), profile(&points[cut..])]
        } else {
            vec![profile(&points)]
        };
        let thickness = thickness.unwrap_or(0.0);
        let Ok(m) = lathe(&parts, sides, thickness, caps) else {
            proptest::prop_assert!(y == points[0].1, "only objects without height may fail");
            return Ok(());
        };
        proptest::prop_assert!(m.positions.iter().chain(&m.normals).all(|p| p.is_finite()));
        proptest::prop_assert!(m.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
        proptest::prop_assert!(m.topology.parts.iter().all(|p| *p < m.topology.part_count));
        if caps == Caps::Both && thickness == 0.0 {
            proptest::prop_assert!(volume(&m) > -1e-9);
            let watertight = m.topology.edges.iter().all(|e| e.faces[1] != NO_FACE);
            proptest::prop_assert!(watertight);
        }
        let fresh = std::thread::spawn(move || lathe(&parts, sides, thickness, caps)).join().unwrap();
        proptest::prop_assert_eq!(fresh.unwrap(), m);
    }
}
