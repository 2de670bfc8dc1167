//! Tests of the lathe: closed, outward, with the volumes of cylinders, cones, spheres and vessels; every refusal.

use super::*;
use crate::geom::NO_FACE;
use std::collections::HashMap;
use std::slice::from_ref;

fn profile(points: &[(f64, f64)]) -> Profile {
    Profile { y: points.iter().map(|p| p.1).collect(), r: points.iter().map(|p| p.0).collect() }
}

/// Signed volume; outward orientation makes it positive.
fn volume(m: &Mesh) -> f64 {
    let t = |t: &[u32; 3]| {
        let p = t.map(|v| m.positions[v as usize].as_dvec3());
        p[0].dot(p[1].cross(p[2])) / 6.0
    };
    m.topology.triangles.iter().map(t).sum()
}

/// Each edge has two faces that run through it in opposite directions, and the surface is one sphere or torus.
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
    assert!(directed.iter().all(|((a, b), n)| *n == 1 && directed.get(&(*b, *a)) == Some(&1)), "not watertight");
    assert!(m.topology.edges.iter().all(|e| e.faces[1] != NO_FACE));
    let (v, e, f) = (points.len() as i64, m.topology.edges.len() as i64, m.topology.triangles.len() as i64);
    assert_eq!(v - e + f, euler);
}

fn assert_outward(m: &Mesh) {
    for t in &m.topology.triangles {
        let p = t.map(|v| m.positions[v as usize]);
        let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
        for v in t {
            assert!(n.dot(m.normals[*v as usize]) > 0.5, "normal {} on a face of {n}", m.normals[*v as usize]);
        }
    }
    assert!(m.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
}

/// The volume of a prism with this many sides against its circle's.
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
    let cone = lathe(&[profile(&[(1.0, 0.0), (0.5, 1.0), (0.0, 2.0)])], 64, 0.0, Caps::Both).unwrap();
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
    let smooth = lathe(&[lower.clone(), profile(&[(0.5, 1.0), (0.6, 2.0)])], 32, 0.0, Caps::None).unwrap();
    assert_eq!(creases(&smooth), 0);
    let bent = lathe(&[lower.clone(), profile(&[(0.5, 1.0), (2.5, 2.0)])], 32, 0.0, Caps::None).unwrap();
    assert_eq!(creases(&bent), 32);
    let stepped = lathe(&[lower, profile(&[(0.3, 1.0), (0.3, 2.0)])], 32, 0.0, Caps::Both).unwrap();
    assert_eq!(creases(&stepped), 4 * 32);
    assert_closed(&stepped, 2);
    assert_outward(&stepped);
    assert_eq!(stepped.topology.parts.iter().copied().collect::<std::collections::BTreeSet<_>>().len(), 5);
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
fn impossible_profiles_are_errors() {
    let fails =
        |parts: &[Profile], sides, thickness| lathe(parts, sides, thickness, Caps::Both).unwrap_err().to_string();
    let good = profile(&[(0.5, 0.0), (0.5, 1.0)]);
    assert_eq!(fails(&[], 8, 0.0), "lathe: there is no profile");
    assert_eq!(fails(&[profile(&[(1.0, 0.0)])], 8, 0.0), "lathe: profile 0 needs at least 2 points, got 1");
    assert!(fails(&[profile(&[(0.5, 1.0), (0.5, 0.0)])], 8, 0.0).contains("must not decrease"));
    assert!(fails(&[profile(&[(-0.5, 0.0), (0.5, 1.0)])], 8, 0.0).contains("negative"));
    assert!(fails(&[profile(&[(f64::NAN, 0.0), (0.5, 1.0)])], 8, 0.0).contains("NaN"));
    assert!(fails(from_ref(&good), 2, 0.0).contains("3 to 1024"));
    assert!(fails(from_ref(&good), 8, -1.0).contains("thickness"));
    assert!(fails(&[profile(&[(0.0, 0.0), (0.0, 0.0)])], 8, 0.0).contains("no extent"));
    let flat = lathe(&[profile(&[(0.5, 0.0), (0.5, 0.0)])], 8, 0.0, Caps::Both).unwrap();
    assert!(flat.positions.iter().chain(&flat.normals).all(|p| p.is_finite()));
}
