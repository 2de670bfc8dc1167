//! Frames against analytic shapes, against themselves, and against the object data set.

use super::*;
use crate::geom::{Affine, Mesh};
use crate::render::Projection;
use crate::render::pixels::raster::each_triangle;
use crate::render::testing::{Uniform, cases, cuboid, lathe, solid, sphere};
use std::sync::Arc;

fn render(solid: &Solid, camera: &Camera) -> Frame {
    Frame::render(solid, camera, Channels::All)
}

/// Nearest hit of the ray through a pixel centre with a sphere: depth, normal in camera
/// coordinates, and cosine between normal and ray.
fn hit_sphere(
    camera: &Camera,
    centre: DVec3,
    radius: f64,
    x: u32,
    y: u32,
) -> Option<(f64, DVec3, f64)> {
    let (px, py) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
    let (a, b) = (camera.unproject(px, py, 1.0), camera.unproject(px, py, 2.0));
    let d = (b - a).normalize();
    let (half, c) = ((a - centre).dot(d), (a - centre).length_squared() - radius * radius);
    let root = half * half - c;
    (root > 0.0).then(|| {
        let p = a + d * (-half - root.sqrt());
        let n = (p - centre) / radius;
        let seen = DVec3::new(n.dot(camera.right), n.dot(camera.up), -n.dot(camera.forward));
        (camera.project(p).2, seen, -n.dot(d))
    })
}

fn check_sphere(camera: &Camera) {
    let (centre, radius) = (DVec3::new(0.3, -0.2, 0.4), 1.1);
    let ball = sphere(256, 128).placed(Affine::new(
        centre,
        DVec3::new(0.3, 0.2, 0.1),
        DVec3::splat(radius),
    ));
    let frame = render(&ball, camera);
    let (mut seen, mut wrong) = (0, 0);
    for y in 0..camera.height {
        for x in 0..camera.width {
            let i = (y * camera.width + x) as usize;
            let truth = hit_sphere(camera, centre, radius, x, y);
            wrong += usize::from(truth.is_some() != frame.depth[i].is_finite());
            if let (Some((depth, n, cosine)), true) = (truth, frame.depth[i].is_finite()) {
                seen += 1;
                let ours = Vec3::from_array(frame.normal[i]).as_dvec3();
                assert!((ours.length() - 1.0).abs() < 1e-5 && frame.part[i] == 0);
                if cosine > 0.2 {
                    assert!(
                        (f64::from(frame.depth[i]) - depth).abs() < 2e-3,
                        "{x} {y}: {} {depth}",
                        frame.depth[i]
                    );
                    assert!(ours.distance(n) < 1e-2, "{x} {y}: {ours} {n}");
                }
            } else if !frame.depth[i].is_finite() {
                assert!(frame.part[i] == u16::MAX && frame.normal[i] == [0.0; 3]);
            }
        }
    }
    assert!(seen > 1000 && wrong * 100 < seen, "{seen} {wrong}");
}

#[test]
fn sphere_depth_and_normals_are_analytic() {
    let camera = Camera::default_for(128, 96);
    check_sphere(&camera);
    check_sphere(&Camera {
        projection: Projection::Orthographic { units_per_pixel: 0.04, cx: 60.0, cy: 50.0 },
        ..camera
    });
    // Another position, rotated, and an off-centre principal point.
    let forward = DVec3::new(-0.5, 0.3, -1.0).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    check_sphere(&Camera {
        eye: DVec3::new(0.3, -0.2, 0.4) - forward * 6.0,
        forward,
        right,
        up: right.cross(forward),
        projection: Projection::Pinhole { focal_px: 210.0, cx: 80.0, cy: 30.0 },
        ..camera
    });
}

#[test]
fn a_slanted_plane_is_perspective_correct() {
    // z = -x/2 + y/4 over a big square, larger than the screen.
    let z = |x: f32, y: f32| -0.5 * x + 0.25 * y;
    let corner = |x: f32, y: f32| Vec3::new(x, y, z(x, y));
    let plane = solid(
        vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)],
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let camera = Camera::default_for(64, 64);
    let frame = render(&plane, &camera);
    for y in 0..64 {
        for x in 0..64 {
            let d = f64::from(frame.depth[y * 64 + x]);
            let p = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, d);
            assert!((p.z - (-0.5 * p.x + 0.25 * p.y)).abs() < 1e-5);
            let n = Vec3::from_array(frame.normal[y * 64 + x]);
            assert!(n.distance(Vec3::new(0.5, -0.25, 1.0).normalize()) < 1e-5);
        }
    }
}

#[test]
fn triangles_across_the_near_plane_are_cut() {
    // A floor from behind the camera to far in front of it.
    let corners = [(-500.0, 500.0), (500.0, 500.0), (500.0, -500.0), (-500.0, -500.0)];
    let floor = solid(
        corners.iter().map(|&(x, z)| Vec3::new(x, -1.0, z)).collect(),
        vec![[0, 1, 2], [0, 2, 3]],
    );
    let camera = Camera::default_for(40, 40);
    let frame = render(&floor, &camera);
    for y in 0..40 {
        for x in 0..40 {
            let d = frame.depth[y * 40 + x];
            let p = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(d));
            if y > 20 {
                assert!((p.y + 1.0).abs() < 1e-3, "{x} {y}: {p}");
                assert!(Vec3::from_array(frame.normal[y * 40 + x]).distance(Vec3::Y) < 1e-4);
            } else if y < 19 {
                assert!(!d.is_finite());
            }
        }
    }
    // Seen from below, the normal is reversed.
    let below = floor.placed(Affine::new(DVec3::new(0.0, 2.0, 0.0), DVec3::ZERO, DVec3::ONE));
    let frame = render(&below, &camera);
    assert!(Vec3::from_array(frame.normal[2 * 40 + 20]).distance(Vec3::NEG_Y) < 1e-4);
}

#[test]
fn behind_the_camera_and_huge_scales_show_nothing() {
    let camera = Camera::default_for(32, 32);
    for affine in [
        Affine::new(DVec3::new(0.0, 0.0, 20.0), DVec3::ZERO, DVec3::ONE),
        Affine::new(DVec3::new(0.0, f64::NAN, 0.0), DVec3::ZERO, DVec3::ONE),
        Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::splat(1e300)),
        Affine::new(DVec3::new(f64::INFINITY, 0.0, 0.0), DVec3::ZERO, DVec3::ONE),
    ] {
        for channels in [Channels::All, Channels::Depth] {
            let frame = Frame::render(&sphere(16, 8).placed(affine), &camera, channels);
            assert_eq!(frame.mask().filter(|&m| m).count(), 0);
        }
    }
    // Around the camera: every pixel shows the inside.
    let around = sphere(16, 8).placed(Affine::new(
        DVec3::new(0.0, 0.0, 8.0),
        DVec3::ZERO,
        DVec3::splat(5.0),
    ));
    let frame = render(&around, &camera);
    assert!(frame.depth.iter().all(|d| (4.0..5.1).contains(d)));
    assert!(frame.normal.iter().all(|n| n[2] > 0.7));
}

#[test]
fn depth_alone_is_the_same_depth() {
    let camera = Camera::default_for(90, 70);
    let thing = lathe(&[(0.3, -1.0), (0.8, 0.0), (0.5, 1.0)], 24, false);
    let all = render(&thing, &camera);
    let depth = Frame::render(&thing, &camera, Channels::Depth);
    assert_eq!(all.depth, depth.depth);
    assert!(depth.part.is_empty() && depth.normal.is_empty());
}

#[test]
fn two_halves_make_the_whole() {
    let camera = Camera::default_for(80, 80);
    let whole = lathe(&[(0.2, -1.0), (0.9, -0.3), (0.4, 0.5), (0.6, 1.0)], 30, false);
    let mesh = whole.instances()[0].mesh.clone();
    let triangles = &mesh.topology.triangles;
    let half = |pick: usize| {
        let some =
            triangles.iter().enumerate().filter(|(i, _)| i % 2 == pick).map(|(_, t)| *t).collect();
        solid(mesh.positions.clone(), some)
    };
    let affine = Affine::new(
        DVec3::new(0.1, 0.2, 0.3),
        DVec3::new(0.4, 0.1, 0.2),
        DVec3::new(1.0, -1.2, 0.9),
    );
    let (a, b) = (half(0).placed(affine), half(1).placed(affine));
    let together = render(&Solid::group(&[a.clone(), b.clone()]), &camera);
    let (fa, fb) = (render(&a, &camera), render(&b, &camera));
    let whole = render(&whole.placed(affine), &camera);
    let mut both_parts = [0, 0];
    for i in 0..camera.pixels() {
        assert_eq!(whole.depth[i], fa.depth[i].min(fb.depth[i]));
        assert_eq!(together.depth[i], whole.depth[i]);
        if together.part[i] != u16::MAX {
            let part = usize::from(together.part[i]);
            both_parts[part] += 1;
            assert_eq!([&fa, &fb][part].depth[i], whole.depth[i]);
        }
    }
    assert!(both_parts[0] > 100 && both_parts[1] > 100);
}

#[test]
fn mirrored_and_flat_solids_keep_facing_normals() {
    let camera = Camera::default_for(64, 64);
    let plain = render(&sphere(48, 24), &camera);
    let mirrored = render(
        &sphere(48, 24).placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(-1.0, 1.0, 1.0))),
        &camera,
    );
    for (a, b) in plain.normal.iter().zip(&mirrored.normal) {
        if a[2] > 0.3 && b[2] > 0.3 {
            assert!(Vec3::from_array(*a).distance(Vec3::from_array(*b)) < 0.05);
        }
    }
    let flat = render(
        &cuboid(Vec3::ONE).placed(Affine::new(DVec3::ZERO, DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0))),
        &camera,
    );
    let middle = 32 * 64 + 32;
    assert_eq!(flat.depth[middle], 8.0);
    assert!(flat.normal.iter().flatten().all(|v| v.is_finite()));
}

/// Draws each case's mesh with its true affine and compares the result with the stored
/// depth.
#[test]
fn the_data_set_is_drawn_as_it_was_made() {
    for (name, folder) in cases() {
        let (Ok(meta), Ok((models, _))) = (
            std::fs::read_to_string(folder.join("meta.json")),
            tobj::load_obj(folder.join("mesh.obj"), &tobj::GPU_LOAD_OPTIONS),
        ) else {
            continue;
        };
        let meta: serde_json::Value = serde_json::from_str(&meta).unwrap();
        let camera =
            Camera::from_json(&std::fs::read_to_string(folder.join("camera.json")).unwrap())
                .unwrap();
        let Ok(truth) = image::open(folder.join("depth16.png")) else { continue };
        let truth = truth.to_luma16();
        let triple = |v: &serde_json::Value| {
            let a: Vec<f64> = v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
            DVec3::new(a[0], a[1], a[2])
        };
        let affine = &meta["affine"];
        let pose = Affine::new(
            triple(&affine["translation"]),
            triple(&affine["rotation_deg_xyz"]) * (std::f64::consts::PI / 180.0),
            DVec3::splat(affine["scale"].as_f64().unwrap()),
        );
        let height = meta["object_height"].as_f64().unwrap();
        let solids: Vec<_> = models
            .iter()
            .map(|m| {
                let positions: Vec<_> =
                    m.mesh.positions.chunks_exact(3).map(Vec3::from_slice).collect();
                let triangles: Vec<_> =
                    m.mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
                let parts = vec![0; triangles.len()];
                Solid::new(Arc::new(Mesh::new(positions, triangles, parts).unwrap()))
            })
            .collect();
        let frame = render(&Solid::group(&solids).placed(pose), &camera);
        let (mut both, mut either, mut error) = (0usize, 0usize, 0.0);
        for (i, pixel) in truth.pixels().enumerate() {
            let (seen, ours) = (pixel.0[0] > 0, frame.depth[i].is_finite());
            either += usize::from(seen || ours);
            if seen && ours {
                both += 1;
                error += (f64::from(frame.depth[i]) - f64::from(pixel.0[0]) / 4096.0).abs();
            }
        }
        let (overlap, error) = (both as f64 / either as f64, error / both as f64 / height);
        assert!(overlap > 0.995 && error < 2e-3, "{name}: overlap {overlap}, depth error {error}");
    }
}

/// Random poses never panic, and give positive depth and finite normals.
#[test]
fn random_poses_never_panic() {
    let mut random = Uniform(5);
    let thing = lathe(&[(0.2, -1.0), (0.9, -0.3), (0.4, 0.5)], 7, false);
    for _ in 0..300 {
        let mut place = |s: f64| {
            DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
        };
        let (at, turn, scale) = (place(12.0), place(3.0), place(30.0));
        let frame =
            render(&thing.placed(Affine::new(at, turn, scale)), &Camera::default_for(33, 21));
        assert!(frame.depth.iter().all(|d| *d > 0.0));
        assert!(frame.normal.iter().flatten().all(|v| v.is_finite()));
    }
}

/// Bodies known to hide their own back faces are drawn without them; the depth must not
/// change.
#[test]
fn a_body_without_its_backs_looks_the_same() {
    use crate::geom::{Caps, Profile, lathe, sphere};
    let profile = |y: &[f64], r: &[f64]| Profile { y: y.to_vec(), r: r.to_vec() };
    let parts = [profile(&[-1.0, -0.2, 0.3], &[0.3, 0.9, 0.2]), profile(&[0.3, 0.9], &[0.6, 0.4])];
    let bodies = [lathe(&parts, 24, 0.0, Caps::Both).unwrap(), sphere(0.8, 20).unwrap()];
    assert!(bodies.iter().all(|m| m.topology.encloses));
    assert!(
        !lathe(&parts, 24, 0.0, Caps::Bottom).unwrap().topology.encloses,
        "its inside can be seen"
    );
    assert!(
        !lathe(&parts, 24, 0.05, Caps::Bottom).unwrap().topology.encloses,
        "its walls may cross"
    );
    let mut random = Uniform(8);
    let (camera, mut drawn) = (Camera::default_for(60, 50), 0);
    for round in 0..200 {
        let mut place = |s: f64| {
            DVec3::new(random.between(-s, s), random.between(-s, s), random.between(-s, s))
        };
        let (at, turn, scale) = (place(1.0), place(3.0), place(1.5));
        // Some lie across the near plane or around the camera.
        let at = if round % 5 == 0 { camera.eye + at } else { at };
        let mesh = &bodies[round % 2];
        let mut plain = mesh.clone();
        Arc::make_mut(&mut plain.topology).encloses = false;
        let [fast, plain] = [mesh.clone(), plain].map(|m| {
            render(&Solid::new(Arc::new(m)).placed(Affine::new(at, turn, scale)), &camera)
        });
        for (i, (a, b)) in fast.depth.iter().zip(&plain.depth).enumerate() {
            assert!(a == b || (a - b).abs() < 1e-5 * b, "round {round}, pixel {i}: {a} {b}");
            drawn += usize::from(a.is_finite());
        }
    }
    assert!(drawn > 20_000, "{drawn}");
}

/// The face visible at each pixel, from the runs of every triangle: instance and face.
fn by_runs(solid: &Solid, camera: &Camera) -> Vec<Option<(usize, usize)>> {
    let mut projected = Projected::default();
    project(solid, camera, &mut projected);
    let mut nearest = vec![empty(camera); camera.pixels()];
    let mut seen = vec![None; camera.pixels()];
    each_triangle(solid, camera, &projected, |triangle, source| {
        triangle.runs(|run| {
            for column in run.from..run.to {
                let i = run.row * camera.width as usize + column;
                if run.nearness(column) > nearest[i] {
                    (nearest[i], seen[i]) =
                        (run.nearness(column), Some((source.instance, source.face)));
                }
            }
        });
    });
    seen
}

/// The nearest face of each pixel is that of drawing all triangles one by one, and the
/// normal is that face's: many meshes, large and small triangles, mirrored ones, open and
/// closed, pictures narrower than the lanes.
#[test]
fn faces_are_those_of_all_triangles_drawn_by_runs() {
    let mut random = Uniform(5);
    let mut pixels = 0;
    for round in 0..60 {
        let [w, h] = [[96, 64], [7, 40], [200, 150]][round % 3];
        let camera = Camera::default_for(w, h);
        let shape = |i: usize| match i % 4 {
            0 => sphere(24, 12),
            1 => cuboid(Vec3::new(0.7, 0.4, 0.5)),
            2 => lathe(&[(0.5, -0.8), (0.3, 0.1), (0.6, 0.7)], 24, round % 2 == 0),
            _ => solid(
                (0..30)
                    .map(|k| {
                        Vec3::new(
                            (k % 6) as f32 - 2.5,
                            (k / 6) as f32 - 2.0,
                            ((k * 7) % 5) as f32 * 0.3,
                        )
                    })
                    .collect(),
                (0..24).map(|k| [k, k + 1, k + 6]).collect(),
            ),
        };
        let placed: Vec<Solid> = (0..1 + round % 5)
            .map(|i| {
                let mut v = |scale: f64| {
                    DVec3::from_array(std::array::from_fn(|_| random.between(-scale, scale)))
                };
                let (at, turn, size) = (v(1.2), v(3.0), v(0.7) + DVec3::splat(0.1));
                shape(i + round).placed(Affine::new(at, turn, size))
            })
            .collect();
        let solid = Solid::group(&placed);
        let (frame, faces) = (render(&solid, &camera), by_runs(&solid, &camera));
        assert_eq!(
            frame.depth,
            Frame::render(&solid, &camera, Channels::Depth).depth,
            "round {round}"
        );
        let mut projected = Projected::default();
        project(&solid, &camera, &mut projected);
        for (i, seen) in faces.iter().enumerate() {
            let Some((instance, face)) = *seen else {
                assert_eq!((frame.part[i], frame.normal[i]), (u16::MAX, [0.0; 3]), "round {round}");
                continue;
            };
            pixels += 1;
            let item = &solid.instances()[instance];
            let (mesh, placement) = (&item.mesh, Placement::new(&camera, &item.affine));
            let part = mesh.topology.parts.get(face).map_or(0, |p| p + item.first_part);
            let points = projected.mesh(instance).corners(&mesh.topology, face as u32);
            let slope = Slope::new(mesh, &placement, true, face, &points, WHOLE);
            let (x, y) = ((i % w as usize) as f64 + 0.5, (i / w as usize) as f64 + 0.5);
            let away = (camera.unproject(x, y, 1.0) - camera.eye).normalize();
            let to_eye =
                -DVec3::new(away.dot(camera.right), away.dot(camera.up), -away.dot(camera.forward));
            let wanted = Vec3::from_array(seen_normal(slope.at(x, y).as_vec3(), to_eye.as_vec3()));
            assert_eq!(frame.part[i], part, "round {round}");
            assert!(Vec3::from_array(frame.normal[i]).distance(wanted) < 1e-4, "round {round}");
        }
    }
    assert!(pixels > 20_000, "{pixels}");
}
